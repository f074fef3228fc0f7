//! Plots out of braille: strips over time, the plane of pitch and yaw, and counts against angle.

use i2ris::units::{MAX_MOTORS, Nanos};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType};

use super::style::{CAMERA, ESTIMATE, GOAL, HULL, SETPOINT, faint};
use crate::dashboard::Dashboard;
use crate::history::{Pair, Sample};

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
        let mut pieces = vec![Vec::new()];
        for point in points {
            match (point, pieces.last_mut()) {
                (Some(point), Some(piece)) => piece.push(point),
                (None, Some(piece)) if !piece.is_empty() => pieces.push(Vec::new()),
                _ => {}
            }
        }
        Self { pieces, colour, dots: false }
    }

    fn dots(colour: Color, points: impl Iterator<Item = Option<(f64, f64)>>) -> Self {
        Self { pieces: vec![points.flatten().collect()], colour, dots: true }
    }

    fn values(&self, of: fn(&(f64, f64)) -> f64) -> impl Iterator<Item = f64> {
        self.pieces.iter().flatten().map(of)
    }
}

/// One strip: an angle over the last seconds.
pub fn strip(frame: &mut Frame, area: Rect, dashboard: &Dashboard, axis: usize, now: Nanos) {
    let at = |stamp: Nanos| stamp.as_seconds() - now.as_seconds();
    let (samples, _) = dashboard.history.samples(0);
    let samples = samples.filter(|sample| at(sample.stamp) >= -STRIP_S);
    let of = |value: Pair| value.and_then(|value| value.get(axis).copied());
    let curve = |colour, field: fn(&Sample) -> Pair| {
        Curve::line(colour, samples.clone().map(|s| of(field(s)).map(|value| (at(s.stamp), value))))
    };
    let edge = |sign: f64| {
        let value =
            move |s: &Sample| Some((at(s.stamp), of(s.estimate)? + sign * of(s.deviation)?));
        Curve::dots(Color::DarkGray, samples.clone().map(value))
    };
    let frames = dashboard.history.frames(0).0.filter(|frame| at(frame.stamp) >= -STRIP_S);
    let seen = frames.map(|frame| Some((at(frame.stamp), *frame.angles.get(axis)?)));
    let curves = [
        edge(1.0),
        edge(-1.0),
        Curve::line(CAMERA, seen),
        curve(GOAL, |sample| sample.goal),
        curve(SETPOINT, |sample| sample.setpoint),
        curve(ESTIMATE, |sample| sample.estimate),
    ];
    let name = if axis == 0 { "pitch" } else { "yaw" };
    let y = padded(range(curves.iter().flat_map(|curve| curve.values(|p| p.1))), LEAST_DEG);
    plot(frame, area, &format!("{name}, deg"), &curves, ([-STRIP_S, 0.0], "s"), y);
}

/// The plane of pitch and yaw, with the hull.
pub fn plane(frame: &mut Frame, area: Rect, dashboard: &Dashboard, now: Nanos) {
    let (samples, _) = dashboard.history.samples(0);
    let samples = samples.filter(|sample| now.since(sample.stamp).as_seconds() <= TAIL_S);
    let point = |value: Pair| value.map(|[pitch, yaw]| (yaw, pitch));
    let frames =
        dashboard.history.frames(0).0.filter(|frame| now.since(frame.stamp).as_seconds() <= TAIL_S);
    let here = samples.clone().last().and_then(|sample| sample.estimate);
    let curves = [
        Curve::line(
            HULL,
            dashboard.models.outline.points.iter().map(|point| Some((point[1], point[0]))),
        ),
        Curve::line(CAMERA, frames.map(|frame| point(Some(frame.angles)))),
        Curve::line(GOAL, samples.clone().map(|sample| point(sample.goal))),
        Curve::line(ESTIMATE, samples.map(|sample| point(sample.estimate))),
        Curve::dots(Color::White, std::iter::once(point(here))),
    ];
    let x = padded(range(curves.iter().flat_map(|curve| curve.values(|p| p.0))), LEAST_DEG);
    let y = padded(range(curves.iter().flat_map(|curve| curve.values(|p| p.1))), LEAST_DEG);
    let (x, y) = equal_scales(x, y, area);
    let hull = if dashboard.models.outline.points.is_empty() {
        "pitch over yaw, deg"
    } else {
        "pitch over yaw, deg, hull"
    };
    plot(frame, area, hull, &curves, (x, "yaw"), y);
}

/// Counts against angle: the hysteresis loop of a motor.
pub fn hysteresis(frame: &mut Frame, area: Rect, dashboard: &Dashboard, motor: usize, now: Nanos) {
    let outline = &dashboard.models.outline;
    let (samples, _) = dashboard.history.samples(0);
    let samples = samples.filter(|sample| now.since(sample.stamp).as_seconds() <= TAIL_S);
    let frames =
        dashboard.history.frames(0).0.filter(|frame| now.since(frame.stamp).as_seconds() <= TAIL_S);
    let seen =
        frames.map(|frame| Some((*frame.counts?.get(motor)?, outline.bend(motor, frame.angles))));
    let estimated =
        samples.map(|s| Some((*s.counts?.get(motor)?, outline.bend(motor, s.estimate?))));
    let curves = [Curve::line(CAMERA, seen), Curve::line(ESTIMATE, estimated)];
    let x = padded(range(curves.iter().flat_map(|curve| curve.values(|p| p.0))), LEAST_COUNTS);
    let y = padded(range(curves.iter().flat_map(|curve| curve.values(|p| p.1))), LEAST_DEG);
    plot(
        frame,
        area,
        &format!("motor {motor}, {}, deg", outline.name(motor)),
        &curves,
        (x, "counts"),
        y,
    );
}

/// What the colours mean.
pub fn legend() -> Vec<Span<'static>> {
    let names =
        [(GOAL, "goal"), (SETPOINT, "set-point"), (ESTIMATE, "estimate"), (CAMERA, "camera")];
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
    let sets = |curve| Curve::pieces_of(curve).map(move |piece| set(curve, piece));
    let empty = curves.iter().all(|curve| curve.pieces.iter().all(Vec::is_empty));
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

impl Curve {
    fn pieces_of(curve: &Self) -> impl Iterator<Item = &[(f64, f64)]> {
        curve.pieces.iter().filter(|piece| !piece.is_empty()).map(Vec::as_slice)
    }
}

fn label(value: f64) -> Line<'static> {
    Line::from(if value.abs() < 99.5 { format!("{value:.1}") } else { format!("{value:.0}") })
}

/// Lowest and highest value.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    })
}

/// A little more than the range, at least `least` wide; around 0 when there is none.
fn padded([low, high]: [f64; 2], least: f64) -> [f64; 2] {
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

/// Motors that there are, for their plots.
pub fn motors(dashboard: &Dashboard) -> usize {
    dashboard
        .view
        .actuators
        .map_or(MAX_MOTORS, |motors| crate::latest_messages::count(motors.count))
        .max(1)
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
        assert_eq!(padded(range(std::iter::empty()), 2.0), [-1.0, 1.0]);
        assert_eq!(padded(range([3.0].into_iter()), 2.0), [2.0, 4.0]);
        let area = Rect::new(0, 0, 48, 24);
        let (x, y) = equal_scales([-1.0, 1.0], [-5.0, 5.0], area);
        assert!(((x[1] - x[0]) / 80.0 - (y[1] - y[0]) / 80.0).abs() < 1e-12);
        assert_eq!(y, [-5.0, 5.0]);
    }
}
