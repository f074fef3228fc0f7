//! A pair of axes with marks.

use crate::axis::Axis;
use crate::mark::{Extent, LegendEntry, Mark, PlotArea};
use crate::markup::Element;
use crate::scale::Scale;
use crate::style::{Color, Stroke};
use crate::text_width::text_width;
use crate::ticks::Tick;

/// Length of a tick.
const TICK: f64 = 4.0;
/// Between the frame and the numbers.
const GAP: f64 = 7.0;
/// Height of a line of text.
const TEXT_LINE: f64 = 17.0;
/// Least width of a number along the x axis.
const X_TICK_DISTANCE: f64 = 62.0;
/// Least distance of two numbers along the y axis.
const Y_TICK_DISTANCE: f64 = 34.0;
/// Free space between the numbers of the x axis.
const X_LABEL_GAP: f64 = 10.0;

/// A pair of axes with marks in the order of drawing.
#[derive(Debug)]
pub struct Panel {
    title: String,
    x: Axis,
    y: Axis,
    marks: Vec<Box<dyn Mark>>,
    is_equal: bool,
}

/// A rectangle of the figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rectangle {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

impl Rectangle {
    fn element(self) -> Element {
        Element::rect([self.left, self.top], [self.width, self.height])
    }

    fn right(self) -> f64 {
        self.left + self.width
    }

    fn bottom(self) -> f64 {
        self.top + self.height
    }
}

impl Panel {
    /// An empty panel. The title may be empty.
    #[must_use]
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { title: title.into(), x, y, marks: Vec::new(), is_equal: false }
    }

    /// Adds a mark, drawn over the others.
    #[must_use]
    pub fn with(mut self, mark: impl Mark + 'static) -> Self {
        self.marks.push(Box::new(mark));
        self
    }

    /// Adds several marks.
    #[must_use]
    pub fn with_all<M: Mark + 'static>(self, marks: impl IntoIterator<Item = M>) -> Self {
        marks.into_iter().fold(self, Self::with)
    }

    /// Gives both axes the same scale: a circle stays a circle.
    #[must_use]
    pub fn equal(self) -> Self {
        Self { is_equal: true, ..self }
    }

    pub(crate) fn legend(&self) -> impl Iterator<Item = LegendEntry> + '_ {
        self.marks.iter().flat_map(|mark| mark.legend())
    }

    fn extent(&self) -> Extent {
        let extents = self.marks.iter().map(|mark| mark.extent());
        extents.fold(Extent::default(), Extent::union)
    }

    /// Width of the numbers and the label to the left of the frame.
    pub(crate) fn left_margin(&self, height: f64) -> f64 {
        let scale = self.y.scale(self.y.range_for(self.extent().y), height, 0.0);
        let labels = self.y_ticks(&scale).into_iter().filter_map(|tick| tick.label);
        let widest = labels.map(|label| text_width(&label)).fold(0.0, f64::max);
        let label = if self.y.label.is_empty() { 4.0 } else { TEXT_LINE + 2.0 };
        widest + GAP + label
    }

    pub(crate) fn top_margin(&self, has_letter: bool) -> f64 {
        if has_letter || !self.title.is_empty() { TEXT_LINE + 5.0 } else { 6.0 }
    }

    pub(crate) fn bottom_margin(&self) -> f64 {
        GAP + TEXT_LINE * if self.x.label.is_empty() { 1.0 } else { 2.0 }
    }

    fn y_ticks(&self, scale: &Scale) -> Vec<Tick> {
        self.y.ticks(scale, (scale.length() / Y_TICK_DISTANCE) as usize)
    }

    /// As many numbers as there is room for.
    fn x_ticks(&self, scale: &Scale) -> Vec<Tick> {
        let most = (scale.length() / X_TICK_DISTANCE) as usize;
        let fits = |ticks: &Vec<Tick>| {
            let labels = ticks.iter().filter_map(|tick| tick.label.as_deref());
            let width: f64 = labels.map(|label| text_width(label) + X_LABEL_GAP).sum();
            width <= scale.length() + X_LABEL_GAP
        };
        let mut choices = (2..=most).rev().map(|count| self.x.ticks(scale, count));
        choices.find(fits).unwrap_or_else(|| self.x.ticks(scale, 2))
    }

    fn plot_area(&self, frame: Rectangle) -> PlotArea {
        let extent = self.extent();
        let (mut x, mut y) = (self.x.range_for(extent.x), self.y.range_for(extent.y));
        if self.is_equal {
            let unit = ((x.1 - x.0) / frame.width).max((y.1 - y.0) / frame.height);
            let widened = |range: (f64, f64), length: f64| {
                let (middle, half) = (0.5 * (range.0 + range.1), 0.5 * unit * length);
                (middle - half, middle + half)
            };
            (x, y) = (widened(x, frame.width), widened(y, frame.height));
        }
        PlotArea {
            x: self.x.scale(x, frame.left, frame.right()),
            y: self.y.scale(y, frame.bottom(), frame.top),
        }
    }

    /// Draws the panel around its frame. `clip` is an identifier; `letter` precedes the title.
    pub(crate) fn draw(&self, frame: Rectangle, clip: &str, letter: Option<char>) -> Element {
        let area = self.plot_area(frame);
        let (x_ticks, y_ticks) = (self.x_ticks(&area.x), self.y_ticks(&area.y));
        let marks = Element::new("g")
            .with("clip-path", format!("url(#{clip})"))
            .children(self.marks.iter().map(|mark| mark.draw(&area)));
        Element::new("g")
            .child(Element::new("clipPath").with("id", clip).child(frame.element()))
            .child(self.grid(&area, frame, &x_ticks, &y_ticks))
            .child(marks)
            .child(Stroke::new(Color::DARK, 0.9).apply(frame.element()))
            .child(x_axis(&area.x, frame, &x_ticks))
            .child(y_axis(&area.y, frame, &y_ticks))
            .children(self.texts(frame, letter))
    }

    fn grid(
        &self,
        area: &PlotArea,
        frame: Rectangle,
        x_ticks: &[Tick],
        y_ticks: &[Tick],
    ) -> Element {
        let mut grid = Stroke::new(Color::FAINT, 0.6).apply(Element::new("g"));
        if self.x.has_numbers() {
            let line = |(x, _)| Element::line([x, frame.top], [x, frame.bottom()]);
            grid = grid.children(labels(x_ticks, &area.x).map(line));
        }
        if self.y.has_numbers() {
            let line = |(y, _)| Element::line([frame.left, y], [frame.right(), y]);
            grid = grid.children(labels(y_ticks, &area.y).map(line));
        }
        grid
    }

    /// The title and the labels of the axes, without empty ones.
    fn texts(&self, frame: Rectangle, letter: Option<char>) -> Vec<Element> {
        let x = frame.left + frame.width / 2.0;
        let y = frame.top + frame.height / 2.0;
        let bottom = frame.bottom() + GAP + 2.0 * TEXT_LINE - 5.0;
        let left = frame.left - self.left_margin(frame.height) + TEXT_LINE - 5.0;
        let letter = letter.map(|letter| format!("({letter}) ")).unwrap_or_default();
        let title = format!("{letter}{}", self.title);
        let title = title.trim();
        let title_element = text_element([frame.left, frame.top - 7.0], "start", title);
        let rotation = format!("translate({left:.1} {y:.1})rotate(-90)");
        let y_label = text_element([0.0, 0.0], "middle", &self.y.label);
        let texts = [
            (title, title_element.with("font-weight", "bold")),
            (&self.x.label, text_element([x, bottom], "middle", &self.x.label)),
            (&self.y.label, y_label.with("transform", rotation)),
        ];
        let texts = texts.into_iter().filter(|(text, _)| !text.is_empty());
        texts.map(|(_, element)| element).collect()
    }
}

/// Text in the font of the figure. `anchor` is `start`, `middle` or `end`, as in SVG.
pub(crate) fn text_element([x, y]: [f64; 2], anchor: &'static str, text: &str) -> Element {
    let element = Element::new("text").lengths([("x", x), ("y", y)]).text(text);
    match anchor {
        "start" => element,
        _ => element.with("text-anchor", anchor),
    }
}

/// Positions and labels of all ticks with a label.
fn labels<'a>(ticks: &'a [Tick], scale: &'a Scale) -> impl Iterator<Item = (f64, &'a str)> {
    let label = |tick: &'a Tick| Some((scale.position(tick.value)?, tick.label.as_deref()?));
    ticks.iter().filter_map(label)
}

fn tick_strokes(ticks: &[Tick], scale: &Scale, line: impl Fn(f64, f64) -> Element) -> Element {
    let strokes = ticks.iter().filter_map(|tick| {
        let length = if tick.label.is_some() { TICK } else { 0.55 * TICK };
        Some(line(scale.position(tick.value)?, length))
    });
    Stroke::new(Color::DARK, 0.9).apply(Element::new("g")).children(strokes)
}

fn x_axis(scale: &Scale, frame: Rectangle, ticks: &[Tick]) -> Element {
    let bottom = frame.bottom();
    let strokes =
        tick_strokes(ticks, scale, |x, length| Element::line([x, bottom], [x, bottom + length]));
    let label = |(x, label)| text_element([x, bottom + GAP + TEXT_LINE - 7.0], "middle", label);
    Element::new("g").child(strokes).children(labels(ticks, scale).map(label))
}

fn y_axis(scale: &Scale, frame: Rectangle, ticks: &[Tick]) -> Element {
    let strokes = tick_strokes(ticks, scale, |y, length| {
        Element::line([frame.left - length, y], [frame.left, y])
    });
    let label = |(y, label)| text_element([frame.left - GAP, y + 4.0], "end", label);
    Element::new("g").child(strokes).children(labels(ticks, scale).map(label))
}
