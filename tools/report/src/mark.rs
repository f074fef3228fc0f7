//! Marks of a panel: lines, points, reference lines and intervals. Values are in the units of the
//! axes; values that are not finite are left out, and points that cannot be seen.

use std::collections::HashSet;

use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::element::{DashedPathElement, DottedPathElement, PathElement, Rectangle};
use plotters::prelude::{DrawingArea, SVGBackend};
use plotters::style::Color as _;

use crate::axis::Scale;
use crate::statistics::{distance, distance_to_segment, min_max};
use crate::style::{Color, Marker, Stroke, pixels};

/// Distance between markers along a line.
const MARKER_DISTANCE: f64 = 55.0;

/// Maximum number of dashes: a line with more is solid, because the file would be large.
const MAX_DASHES: f64 = 1500.0;

/// Maximum number of points drawn of a cloud: more make a large file and a black panel.
const MAX_CLOUD_POINTS: usize = 3000;

/// A deviation of the line that cannot be seen, in tenths of a unit of the figure.
const TOLERANCE: f64 = 2.0;

/// Width of a column in which a line that only goes forward keeps its first, lowest, highest and
/// last point, in tenths of a unit.
const COLUMN: f64 = 5.0;

pub type Point = [f64; 2];

/// The whole figure, a panel or the inside of a panel.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

pub type Plane = Cartesian2d<Scale, Scale>;

/// Something that a panel can draw.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    shape: Shape,
    points: Vec<Point>,
    stroke: Stroke,
    marker: Option<Marker>,
    label: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    Line,
    Points,
    /// Straight lines across the whole panel, and an interval of x: they widen no axis.
    Horizontal,
    Vertical,
    Interval,
}

/// A legend entry: its text, and a mark without points in front.
pub type LegendEntry = (String, Mark);

impl Mark {
    fn new(shape: Shape, points: Vec<Point>, stroke: Stroke) -> Self {
        Self { shape, points, stroke, marker: None, label: None }
    }

    /// A line through points in their order. A point that is not finite is a gap.
    pub fn line(points: Vec<Point>, stroke: Stroke) -> Self {
        Self::new(Shape::Line, points, stroke)
    }

    /// The outline of a histogram, from 0 to 0. There is one edge more than heights.
    pub fn steps(edges: &[f64], heights: &[f64], stroke: Stroke) -> Self {
        let foot = |edge: Option<&f64>| edge.map(|edge| [*edge, 0.0]);
        let mut points = Vec::from_iter(foot(edges.first()));
        for (edge, height) in edges.windows(2).zip(heights) {
            points.extend([[edge[0], *height], [edge[1], *height]]);
        }
        points.extend(foot(edges.last()));
        Self::line(points, stroke)
    }

    /// A cloud of filled discs with a diameter in units of the figure. Discs that others hide are
    /// not drawn, and only some of a dense cloud.
    pub fn dots(points: Vec<Point>, color: Color, diameter: f64) -> Self {
        Self::new(Shape::Points, points, Stroke::new(color, diameter))
    }

    pub fn markers(points: Vec<Point>, color: Color, marker: Marker) -> Self {
        Self::dots(points, color, 1.1).marker(marker)
    }

    pub fn horizontal(value: f64, stroke: Stroke) -> Self {
        Self::new(Shape::Horizontal, vec![[value; 2]], stroke)
    }

    pub fn vertical(value: f64, stroke: Stroke) -> Self {
        Self::new(Shape::Vertical, vec![[value; 2]], stroke)
    }

    /// An interval of x, shaded over the whole height.
    pub fn interval(from: f64, to: f64, color: Color) -> Self {
        Self::new(Shape::Interval, vec![[from, to]], Stroke::new(color, 1.0))
    }

    /// With markers: along a line at equal distances in the figure.
    pub fn marker(self, marker: Marker) -> Self {
        Self { marker: Some(marker), ..self }
    }

    pub fn label(self, label: impl Into<String>) -> Self {
        Self { label: Some(label.into()), ..self }
    }

    /// Lowest and highest value of both axes; of no values, infinity and minus infinity.
    pub(crate) fn extent(&self) -> [(f64, f64); 2] {
        let is_counted = matches!(self.shape, Shape::Line | Shape::Points);
        let finite = self.points.iter().filter(|[x, y]| x.is_finite() && y.is_finite());
        let finite = finite.filter(|_| is_counted);
        [0, 1].map(|axis: usize| min_max(finite.clone().map(|point| point[axis])))
    }

    pub(crate) fn legend(&self) -> Option<LegendEntry> {
        let bare = Self { points: Vec::new(), label: None, ..self.clone() };
        self.label.clone().map(|label| (label, bare))
    }

    pub(crate) fn draw_symbol(&self, area: &Area, [left, top]: [i32; 2], [right, low]: [i32; 2]) {
        let middle = (top + low) / 2;
        let [a, b] = [left, right].map(|x| [f64::from(x), f64::from(middle)]);
        let center = ((left + right) / 2, middle);
        match self.shape {
            Shape::Points => {
                draw(area, &self.marker.unwrap_or(Marker::Dot).symbol(center, self.stroke.color));
            }
            Shape::Interval => {
                let corners = [(left + 40, top + 30), (right - 40, low - 30)];
                draw(area, &Rectangle::new(corners, self.stroke.color.rgb().filled()));
                draw(area, &Rectangle::new(corners, Stroke::new(Color::GREY, 0.6).style()));
            }
            _ => {
                let bare = Self { marker: None, ..self.clone() };
                bare.draw_line(area, &[a, b]);
                self.marker.iter().for_each(|it| draw(area, &it.symbol(center, self.stroke.color)));
            }
        }
    }

    pub(crate) fn draw(&self, plane: &DrawingArea<SVGBackend, Plane>) {
        let (x, y) = (plane.as_coord_spec().x_spec(), plane.as_coord_spec().y_spec());
        let inside = plane.strip_coord_spec();
        let (left, top) = inside.get_base_pixel();
        let position = |point: &Point| {
            (x.knows(point[0]) && y.knows(point[1])).then(|| {
                let (x, y) = plane.map_coordinate(&(point[0], point[1]));
                [f64::from(x - left), f64::from(y - top)]
            })
        };
        match (self.shape, self.points.as_slice()) {
            (Shape::Points, points) => {
                let points = points.iter().filter(|at| x.contains(at[0]) && y.contains(at[1]));
                self.draw_cloud(&inside, &points.filter_map(position).collect::<Vec<_>>());
            }
            (Shape::Horizontal, [[at, _]]) if y.contains(*at) => {
                self.draw_run(&inside, [[x.low, *at], [x.high, *at]].iter().map(position));
            }
            (Shape::Vertical, [[at, _]]) if x.contains(*at) => {
                self.draw_run(&inside, [[*at, y.low], [*at, y.high]].iter().map(position));
            }
            (Shape::Interval, [[from, to]]) => {
                let ends = [[*from, y.high], [*to, y.low]].map(|end| position(&end).map(whole));
                if let [Some(a), Some(b)] = ends {
                    let fill = self.stroke.color.rgb().filled();
                    draw(&inside, &Rectangle::new([a, b], fill));
                }
            }
            (Shape::Line, points) => {
                // A gap in the values is a gap in the line.
                let positions: Vec<_> = points.iter().map(position).collect();
                let runs = positions.split(Option::is_none).filter(|run| !run.is_empty());
                runs.for_each(|run| self.draw_run(&inside, run.iter().copied()));
            }
            _ => {}
        }
    }

    fn draw_run(&self, area: &Area, run: impl Iterator<Item = Option<Point>>) {
        self.draw_line(area, &simple_line(&run.flatten().collect::<Vec<_>>()));
    }

    fn draw_line(&self, area: &Area, points: &[Point]) {
        let [dash, gap] = self.stroke.dash.lengths().map(pixels);
        let length: f64 = points.windows(2).map(|pair| distance(&pair[0], &pair[1])).sum();
        let points: Vec<_> = points.iter().copied().map(whole).collect();
        let style = self.stroke.style();
        if gap == 0 || length > MAX_DASHES * f64::from(dash + gap) {
            draw(area, &PathElement::new(points.clone(), style));
        } else {
            draw(area, &DashedPathElement::new(points.clone(), dash, gap, style));
        }
        let Some(marker) = self.marker else { return };
        // Half a distance at the start: no marker is on the frame.
        let distance = pixels(MARKER_DISTANCE);
        let color = self.stroke.color;
        let symbol = move |at| marker.symbol(at, color);
        let symbols = DottedPathElement::new(points, distance / 2, distance, symbol);
        draw(area, &symbols);
    }

    fn draw_cloud(&self, area: &Area, positions: &[Point]) {
        for at in thin_cloud(positions, MAX_CLOUD_POINTS) {
            let at = whole(at);
            match self.marker {
                // A disc: a line of no length with round ends, which makes small files.
                None => draw(area, &PathElement::new(vec![at, at], self.stroke.style())),
                Some(marker) => draw(area, &marker.symbol(at, self.stroke.color)),
            }
        }
    }
}

fn whole([x, y]: Point) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}

/// Draws an element. Writing to a string cannot fail.
pub fn draw<'a, E>(area: &Area<'a>, element: &E)
where
    E: plotters::element::Drawable<SVGBackend<'a>>,
    for<'b> &'b E: plotters::element::PointCollection<'b, (i32, i32)>,
{
    let _ = area.draw(element);
}

/// Keeps the ends of a line, and all extremes if it only goes forward.
fn simple_line(points: &[Point]) -> Vec<Point> {
    let is_forward = points.windows(2).all(|pair| pair[0][0] <= pair[1][0]);
    if is_forward { simplified(&column_extremes(points)) } else { simplified(points) }
}

/// First, lowest, highest and last point of every column, in their order (U. Jugel et al., "M4: a
/// visualization-oriented time series data aggregation", VLDB 2014).
fn column_extremes(points: &[Point]) -> Vec<Point> {
    let column = |point: &Point| (point[0] / COLUMN).floor();
    let mut kept = Vec::new();
    for run in points.chunk_by(|a, b| column(a) == column(b)) {
        let by_height = |a: &usize, b: &usize| run[*a][1].total_cmp(&run[*b][1]);
        let lowest = (0..run.len()).min_by(by_height).unwrap_or(0);
        let highest = (0..run.len()).max_by(by_height).unwrap_or(0);
        let mut indices = [0, lowest, highest, run.len() - 1].to_vec();
        indices.sort_unstable();
        indices.dedup();
        kept.extend(indices.into_iter().map(|index| run[index]));
    }
    kept
}

/// Ramer, Douglas and Peucker: a section whose points are all near its chord becomes the chord.
fn simplified(points: &[Point]) -> Vec<Point> {
    let Some(last) = points.len().checked_sub(1) else {
        return Vec::new();
    };
    let mut keep = vec![false; points.len()];
    (keep[0], keep[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((from, to)) = open.pop() {
        let distance = |i: &usize| distance_to_segment(points[*i], points[from], points[to]);
        let furthest = (from + 1..to).max_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(furthest) = furthest.filter(|index| distance(index) > TOLERANCE) {
            keep[furthest] = true;
            open.extend([(from, furthest), (furthest, to)]);
        }
    }
    let kept = points.iter().zip(keep).filter(|(_, keep)| *keep);
    kept.map(|(point, _)| *point).collect()
}

/// A point cloud without the points that others hide: the first point of every square cell stays.
/// The cells grow until at most `most` points are left, so a dense cloud gets thinner and its
/// outliers stay.
fn thin_cloud(points: &[Point], most: usize) -> Vec<Point> {
    let mut size = 10.0;
    loop {
        let mut taken = HashSet::new();
        let cell = |point: &Point| point.map(|x| (x / size).floor() as i64);
        let kept = points.iter().filter(|point| taken.insert(cell(point)));
        let kept: Vec<_> = kept.copied().collect();
        // A figure has only a few cells above this size.
        if kept.len() <= most || size > 1e5 {
            return kept;
        }
        size *= 1.25;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn points_on_a_straight_line_are_left_out() {
        let straight: Vec<_> = (0..1000).map(|i| [0.3, 0.1].map(|k| k * f64::from(i))).collect();
        assert_eq!(simple_line(&straight), [straight[0], straight[999]]);
        assert!(simple_line(&[]).is_empty());
        assert_eq!(simple_line(&[[1.0, 2.0]]), [[1.0, 2.0]]);
    }

    #[test]
    fn a_long_noisy_line_becomes_short_and_keeps_its_spikes() {
        let noise = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 20) * 0.01;
        let mut noisy: Vec<_> = (0..100_000).map(|i| [f64::from(i) * 0.006, noise(i)]).collect();
        noisy.extend([[600.0, 777.0], [600.001, 0.0]]);
        let short = simple_line(&noisy);
        assert!(short.len() < 5000, "{}", short.len());
        assert!(short.iter().any(|point| point[1] == 777.0));
    }

    fn points() -> impl Strategy<Value = Vec<Point>> {
        prop::collection::vec([0.0..300.0_f64, 0.0..200.0_f64], 2..150)
    }

    proptest! {
        #[test]
        fn every_point_left_out_is_near_the_line(points in points()) {
            let short = simplified(&points);
            let is_near = |point: &Point| short.windows(2).any(|pair| {
                distance_to_segment(*point, pair[0], pair[1]) <= TOLERANCE + 1e-9
            });
            prop_assert!(points.iter().all(is_near));
        }

        #[test]
        fn a_cloud_keeps_at_most_the_given_count(points in points(), most in 5..200_usize) {
            let thin = thin_cloud(&points, most);
            prop_assert!(thin.len() <= most && !thin.is_empty());
            prop_assert!(thin.iter().all(|point| points.contains(point)));
        }
    }
}
