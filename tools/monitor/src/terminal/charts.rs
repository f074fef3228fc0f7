//! Plots out of braille: strips over time, the plane of pitch and yaw, and counts against angle.

use i2ris::units::{MAX_MOTORS, Nanos};
use i2ris_report::hull_outline::Outline;
use i2ris_report::view::{Pair, View};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType};

use super::style::{CAMERA, ESTIMATE, GOAL, HULL, SETPOINT, faint};
use crate::dashboard::Dashboard;
use crate::history::{CameraFrame, History, Sample};

/// How far back strips go, and how far the other plots.
const STRIP_S: f64 = 20.0;
const TAIL_S: f64 = 12.0;
/// A plot shows at least this much, or noise would fill it.
const LEAST_DEG: f64 = 2.0;
const LEAST_COUNTS: f64 = 100.0;

/// A curve in pieces: where something is missing there is a gap.
struct Curve {
    pieces: Vec<Vec<(f64, f64)>>,
    colour: Color,
    dots: bool,
}

impl Curve {
    fn line(colour: Color, points: impl Iterator<Item = Option<(f64, f64)>>) -> Self {
        let points: Vec<_> = points.collect();
        let pieces = points.split(Option::is_none).filter(|piece| !piece.is_empty());
        Self {
            pieces: pieces.map(|it| it.iter().flatten().copied().collect()).collect(),
            colour,
            dots: false,
        }
    }

    fn dots(colour: Color, points: impl Iterator<Item = Option<(f64, f64)>>) -> Self {
        Self { pieces: vec![points.flatten().collect()], colour, dots: true }
    }
}

/// The plots of the last seconds.
pub struct Plots<'a> {
    history: &'a History,
    outline: &'a Outline,
    /// Motors that there are.
    pub motors: usize,
    now: Nanos,
}

impl<'a> Plots<'a> {
    pub fn new(dashboard: &'a Dashboard, view: &View, now: Nanos) -> Self {
        let motors = view.motors.as_ref().map_or(MAX_MOTORS, Vec::len).max(1);
        Self { history: &dashboard.history, outline: &dashboard.models.outline, motors, now }
    }

    /// Seconds from now; negative.
    fn at(&self, stamp: Nanos) -> f64 {
        stamp.as_seconds() - self.now.as_seconds()
    }

    fn samples(&self, span_s: f64) -> impl Iterator<Item = &Sample> + Clone {
        self.history.samples(0).0.filter(move |sample| self.at(sample.stamp) >= -span_s)
    }

    fn frames(&self, span_s: f64) -> impl Iterator<Item = &CameraFrame> + Clone {
        self.history.frames(0).0.filter(move |frame| self.at(frame.stamp) >= -span_s)
    }

    /// One strip: an angle over the last seconds.
    pub fn strip(&self, frame: &mut Frame, area: Rect, axis: usize) {
        let of = |pair: Pair| pair.map(|pair| pair[axis]);
        let curve = |colour, field: fn(&Sample) -> Pair| {
            let point = |s: &Sample| of(field(s)).map(|value| (self.at(s.stamp), value));
            Curve::line(colour, self.samples(STRIP_S).map(point))
        };
        let edge = |sign: f64| {
            let value = move |s: &Sample| {
                Some((self.at(s.stamp), of(s.estimate)? + sign * of(s.deviation)?))
            };
            Curve::dots(Color::DarkGray, self.samples(STRIP_S).map(value))
        };
        let seen = self.frames(STRIP_S).map(|it| Some((self.at(it.stamp), it.angles[axis])));
        let curves = [
            edge(1.0),
            edge(-1.0),
            Curve::line(CAMERA, seen),
            curve(GOAL, |sample| sample.goal),
            curve(SETPOINT, |sample| sample.setpoint),
            curve(ESTIMATE, |sample| sample.estimate),
        ];
        let title = format!("{}, deg", if axis == 0 { "pitch" } else { "yaw" });
        plot(
            frame,
            area,
            &title,
            &curves,
            ([-STRIP_S, 0.0], "s"),
            range(&curves, |p| p.1, LEAST_DEG),
        );
    }

    /// The plane of pitch and yaw, with the hull.
    pub fn plane(&self, frame: &mut Frame, area: Rect) {
        let point = |pair: Pair| pair.map(|[pitch, yaw]| (yaw, pitch));
        let here = self.samples(TAIL_S).last().and_then(|sample| sample.estimate);
        let hull = &self.outline.points;
        let curves = [
            Curve::line(HULL, hull.iter().map(|at| point(Some(*at)))),
            Curve::line(CAMERA, self.frames(TAIL_S).map(|it| point(Some(it.angles)))),
            Curve::line(GOAL, self.samples(TAIL_S).map(|sample| point(sample.goal))),
            Curve::line(ESTIMATE, self.samples(TAIL_S).map(|sample| point(sample.estimate))),
            Curve::dots(Color::White, std::iter::once(point(here))),
        ];
        let x = range(&curves, |p| p.0, LEAST_DEG);
        let (x, y) = equal_scales(x, range(&curves, |p| p.1, LEAST_DEG), area);
        let mark = if hull.is_empty() { "" } else { ", hull" };
        plot(frame, area, &format!("pitch over yaw, deg{mark}"), &curves, (x, "yaw"), y);
    }

    /// Counts against angle: the hysteresis loop of a motor.
    pub fn hysteresis(&self, frame: &mut Frame, area: Rect, motor: usize) {
        let bend = |angles| self.outline.bend(motor, angles);
        let seen = self.frames(TAIL_S).map(|it| Some((it.counts?[motor], bend(it.angles))));
        let estimated = self.samples(TAIL_S).map(|s| Some((s.counts?[motor], bend(s.estimate?))));
        let curves = [Curve::line(CAMERA, seen), Curve::line(ESTIMATE, estimated)];
        let (x, y) = (range(&curves, |p| p.0, LEAST_COUNTS), range(&curves, |p| p.1, LEAST_DEG));
        let title = format!("motor {motor}, {}, deg", self.outline.name(motor));
        plot(frame, area, &title, &curves, (x, "counts"), y);
    }
}

/// What the colours mean.
pub fn legend() -> Vec<Span<'static>> {
    let names =
        [(GOAL, "goal"), (SETPOINT, "setpoint"), (ESTIMATE, "estimate"), (CAMERA, "camera")];
    names.map(|(colour, name)| Span::styled(format!("━ {name}"), Style::new().fg(colour))).to_vec()
}

fn plot(
    frame: &mut Frame,
    area: Rect,
    title: &str,
    curves: &[Curve],
    (x, x_name): ([f64; 2], &str),
    y: [f64; 2],
) {
    let set = |curve: &Curve, piece| {
        let kind = if curve.dots { GraphType::Scatter } else { GraphType::Line };
        Dataset::default().data(piece).marker(Marker::Braille).graph_type(kind).style(curve.colour)
    };
    let sets = |curve| pieces(curve).map(move |piece| set(curve, piece));
    let empty = curves.iter().all(|curve| pieces(curve).next().is_none());
    let title = if empty { format!(" {title}: no data ") } else { format!(" {title} ") };
    let axis = |bounds: [f64; 2], labels: Vec<Line<'static>>| {
        Axis::default().bounds(bounds).labels(labels).style(faint())
    };
    let chart = Chart::new(curves.iter().flat_map(sets).collect())
        .block(Block::bordered().border_style(faint()).title(title))
        .x_axis(axis(x, vec![label(x[0]), Line::from(x_name.to_owned()), label(x[1])]))
        .y_axis(axis(y, vec![label(y[0]), label(0.5 * (y[0] + y[1])), label(y[1])]))
        .legend_position(None);
    frame.render_widget(chart, area);
}

fn pieces(curve: &Curve) -> impl Iterator<Item = &[(f64, f64)]> {
    curve.pieces.iter().filter(|piece| !piece.is_empty()).map(Vec::as_slice)
}

fn label(value: f64) -> Line<'static> {
    Line::from(if value.abs() < 99.5 { format!("{value:.1}") } else { format!("{value:.0}") })
}

/// A little more than the curves, at least `least` wide; around 0 when there is nothing.
fn range(curves: &[Curve], value: fn(&(f64, f64)) -> f64, least: f64) -> [f64; 2] {
    let values = curves.iter().flat_map(|curve| curve.pieces.iter().flatten().map(value));
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    if low > high {
        return [-0.5 * least, 0.5 * least];
    }
    let (middle, half) = (0.5 * (low + high), (0.55 * (high - low)).max(0.5 * least));
    [middle - half, middle + half]
}

/// Widens one of two ranges so that a degree is as long upwards as sideways: a cell has 2 by 4
/// dots, and those are about square.
fn equal_scales(x: [f64; 2], y: [f64; 2], area: Rect) -> ([f64; 2], [f64; 2]) {
    let dots = [
        2.0 * f64::from(area.width.saturating_sub(8).max(1)),
        4.0 * f64::from(area.height.saturating_sub(4).max(1)),
    ];
    let per_dot = ((x[1] - x[0]) / dots[0]).max((y[1] - y[0]) / dots[1]);
    let widened = |range: [f64; 2], dots: f64| {
        let middle = 0.5 * (range[0] + range[1]);
        [middle - 0.5 * per_dot * dots, middle + 0.5 * per_dot * dots]
    };
    (widened(x, dots[0]), widened(y, dots[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_parts_a_curve() {
        let points = [Some((0.0, 1.0)), Some((1.0, 1.0)), None, None, Some((3.0, 1.0))];
        let pieces = Curve::line(GOAL, points.into_iter()).pieces;
        assert_eq!(pieces.iter().map(Vec::len).collect::<Vec<_>>(), [2, 1]);
    }

    #[test]
    fn ranges_are_never_empty_and_scales_are_equal() {
        let of = |value| Curve::line(GOAL, std::iter::once(value));
        assert_eq!(range(&[of(None)], |p| p.1, 2.0), [-1.0, 1.0]);
        assert_eq!(range(&[of(Some((0.0, 3.0)))], |p| p.1, 2.0), [2.0, 4.0]);
        let area = Rect::new(0, 0, 48, 24);
        let (x, y) = equal_scales([-1.0, 1.0], [-5.0, 5.0], area);
        assert!(((x[1] - x[0]) / 80.0 - (y[1] - y[0]) / 80.0).abs() < 1e-12);
        assert_eq!(y, [-5.0, 5.0]);
    }
}
