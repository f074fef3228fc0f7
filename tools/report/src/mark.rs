//! Marks of a panel: lines, points, reference lines and intervals. Values are in the units of the
//! axes; values that are not finite are left out.

use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::element::{DashedPathElement, DottedPathElement, PathElement, Rectangle};
use plotters::prelude::{DrawingArea, SVGBackend};
use plotters::style::Color as _;

use crate::axis::Scale;
use crate::decimate;
use crate::statistics::{distance, min_max};
use crate::style::{Color, Marker, Stroke, pixels};

/// Distance between markers along a line.
const MARKER_DISTANCE: f64 = 55.0;

/// Maximum number of dashes of a line. A line with more is drawn solid: the file would be large,
/// and the dashes could not be seen.
const MAX_DASHES: f64 = 1500.0;

/// Maximum number of points drawn of a cloud: more make a large file and a black panel.
const MAX_CLOUD_POINTS: usize = 3000;

pub type Point = [f64; 2];

/// The whole figure, a panel or the inside of a panel.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// The inside of a panel with its axes.
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

    /// A cloud of markers.
    pub fn markers(points: Vec<Point>, color: Color, marker: Marker) -> Self {
        Self::dots(points, color, 1.1).marker(marker)
    }

    /// A straight line across the whole panel at a value of y.
    pub fn horizontal(value: f64, stroke: Stroke) -> Self {
        Self::new(Shape::Horizontal, vec![[value; 2]], stroke)
    }

    /// A straight line across the whole panel at a value of x.
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

    /// With an entry in the legend.
    pub fn label(self, label: impl Into<String>) -> Self {
        Self { label: Some(label.into()), ..self }
    }

    /// The lowest and highest values of both axes that they must contain; of no values, infinity
    /// and minus infinity.
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

    /// Draws the symbol of a legend entry into a rectangle.
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
        self.draw_line(area, &decimate::line(&run.flatten().collect::<Vec<_>>()));
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
        for at in decimate::cloud(positions, MAX_CLOUD_POINTS) {
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
