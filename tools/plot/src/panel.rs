//! One pair of axes with what is drawn in it.

use crate::axis::Axis;
use crate::mark::{Bounds, Frame, Key, Mark};
use crate::scale::Scale;
use crate::style::{Ink, Stroke};
use crate::text;
use crate::ticks::Tick;
use crate::xml::Element;

/// Length of the small strokes at numbers.
const TICK: f64 = 4.0;
/// From the frame to the numbers.
const GAP: f64 = 7.0;
/// Room for a line of text.
const LINE: f64 = 17.0;
/// Room for one number along a level axis, at least, and for one along an upright axis.
const PER_TICK: [f64; 2] = [62.0, 34.0];
/// Free space between the numbers of a level axis.
const BETWEEN_LABELS: f64 = 10.0;

/// One pair of axes with what is drawn in it, in the order of drawing.
#[derive(Debug)]
pub struct Panel {
    title: String,
    x: Axis,
    y: Axis,
    marks: Vec<Box<dyn Mark>>,
    equal: bool,
}

/// A stretch of paper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Area {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

impl Panel {
    /// An empty panel. The title may be empty.
    #[must_use]
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            marks: Vec::new(),
            equal: false,
        }
    }

    /// With something drawn over what there is.
    #[must_use]
    pub fn with(mut self, mark: impl Mark + 'static) -> Self {
        self.marks.push(Box::new(mark));
        self
    }

    /// With several.
    #[must_use]
    pub fn with_all<M: Mark + 'static>(self, marks: impl IntoIterator<Item = M>) -> Self {
        marks.into_iter().fold(self, Self::with)
    }

    /// With one unit of x as long as one of y: a circle stays one.
    #[must_use]
    pub fn equal(self) -> Self {
        Self {
            equal: true,
            ..self
        }
    }

    pub(crate) fn keys(&self) -> impl Iterator<Item = Key> + '_ {
        self.marks.iter().flat_map(|mark| mark.keys())
    }

    fn data(&self) -> Bounds {
        self.marks
            .iter()
            .map(|mark| mark.bounds())
            .fold(Bounds::default(), Bounds::and)
    }

    /// Room to the left of the frame: numbers, label.
    pub(crate) fn left_margin(&self, height: f64) -> f64 {
        let scale = self.y.scale(self.y.reach(self.data().y), height, 0.0);
        let widest = self
            .y_ticks(&scale)
            .into_iter()
            .filter_map(|tick| tick.label)
            .map(|label| text::width(&label));
        let label = if self.y.label().is_empty() {
            4.0
        } else {
            LINE + 2.0
        };
        widest.fold(0.0, f64::max) + GAP + label
    }

    pub(crate) fn top_margin(&self, lettered: bool) -> f64 {
        if lettered || !self.title.is_empty() {
            LINE + 5.0
        } else {
            6.0
        }
    }

    pub(crate) fn bottom_margin(&self) -> f64 {
        GAP + LINE + if self.x.label().is_empty() { 0.0 } else { LINE }
    }

    fn y_ticks(&self, scale: &Scale) -> Vec<Tick> {
        self.y.ticks(scale, (scale.length() / PER_TICK[1]) as usize)
    }

    /// As many numbers as stand side by side.
    fn x_ticks(&self, scale: &Scale) -> Vec<Tick> {
        let most = (scale.length() / PER_TICK[0]) as usize;
        let fits = |ticks: &Vec<Tick>| {
            let widths = ticks
                .iter()
                .filter_map(|tick| tick.label.as_deref())
                .map(|label| text::width(label) + BETWEEN_LABELS);
            widths.sum::<f64>() <= scale.length() + BETWEEN_LABELS
        };
        let mut counts = (2..=most).rev().map(|count| self.x.ticks(scale, count));
        counts.find(fits).unwrap_or_else(|| self.x.ticks(scale, 2))
    }

    fn frame(&self, area: Area) -> Frame {
        let data = self.data();
        let (mut x, mut y) = (self.x.reach(data.x), self.y.reach(data.y));
        if self.equal {
            (x, y) = same_unit(x, y, area);
        }
        Frame {
            x: self.x.scale(x, area.left, area.left + area.width),
            y: self.y.scale(y, area.top + area.height, area.top),
        }
    }

    /// Draws it into the area within its margins; `letter` is put before the title.
    pub(crate) fn draw(&self, area: Area, clip: &str, letter: Option<char>) -> Element {
        let frame = self.frame(area);
        let (x_ticks, y_ticks) = (self.x_ticks(&frame.x), self.y_ticks(&frame.y));
        let rect = || {
            let rect = Element::new("rect").at("x", area.left).at("y", area.top);
            rect.at("width", area.width).at("height", area.height)
        };
        let marks = self.marks.iter().map(|mark| mark.draw(&frame));
        Element::new("g")
            .child(Element::new("clipPath").with("id", clip).child(rect()))
            .child(self.grid(&frame, area, &x_ticks, &y_ticks))
            .child(
                Element::new("g")
                    .with("clip-path", format!("url(#{clip})"))
                    .children(marks),
            )
            .child(Stroke::new(Ink::DARK, 0.9).on(rect()))
            .child(x_axis(&frame, area, &x_ticks))
            .child(y_axis(&frame, area, &y_ticks))
            .children(self.words(area, letter))
    }

    fn grid(&self, frame: &Frame, area: Area, x_ticks: &[Tick], y_ticks: &[Tick]) -> Element {
        let (right, bottom) = (area.left + area.width, area.top + area.height);
        let upright = places(x_ticks, &frame.x).filter(|_| self.x.has_numbers());
        let upright = upright.map(|(x, _)| line([x, area.top], [x, bottom]));
        let level = places(y_ticks, &frame.y).filter(|_| self.y.has_numbers());
        let level = level.map(|(y, _)| line([area.left, y], [right, y]));
        Stroke::new(Ink::FAINT, 0.6)
            .on(Element::new("g"))
            .children(upright)
            .children(level)
    }

    fn words(&self, area: Area, letter: Option<char>) -> Vec<Element> {
        let middle = [area.left + area.width / 2.0, area.top + area.height / 2.0];
        let bottom = area.top + area.height + GAP + 2.0 * LINE - 5.0;
        let title = match letter {
            Some(letter) => format!("({letter}) {}", self.title),
            None => self.title.clone(),
        };
        let left = area.left - self.left_margin(area.height) + LINE - 5.0;
        let words = [
            written([area.left, area.top - 7.0], "start", title.trim()).with("font-weight", "bold"),
            written([middle[0], bottom], "middle", self.x.label()),
            written([0.0, 0.0], "middle", self.y.label()).with(
                "transform",
                format!("translate({left:.1} {:.1})rotate(-90)", middle[1]),
            ),
        ];
        let said = [
            !title.trim().is_empty(),
            !self.x.label().is_empty(),
            !self.y.label().is_empty(),
        ];
        words
            .into_iter()
            .zip(said)
            .filter_map(|(word, said)| said.then_some(word))
            .collect()
    }
}

/// Widens the range of one axis so that a unit of x is as long as one of y.
fn same_unit(x: (f64, f64), y: (f64, f64), area: Area) -> ((f64, f64), (f64, f64)) {
    let per_unit = |range: (f64, f64), length: f64| (range.1 - range.0) / length;
    let unit = per_unit(x, area.width).max(per_unit(y, area.height));
    let widened = |range: (f64, f64), length: f64| {
        let (middle, half) = (0.5 * (range.0 + range.1), 0.5 * unit * length);
        (middle - half, middle + half)
    };
    (widened(x, area.width), widened(y, area.height))
}

/// Text in the font of the figure. `anchor` as SVG has it: `start`, `middle`, `end`.
pub(crate) fn written([x, y]: [f64; 2], anchor: &'static str, words: &str) -> Element {
    let element = Element::new("text").at("x", x).at("y", y).text(words);
    if anchor == "start" {
        element
    } else {
        element.with("text-anchor", anchor)
    }
}

fn line(from: [f64; 2], to: [f64; 2]) -> Element {
    Element::new("line")
        .at("x1", from[0])
        .at("y1", from[1])
        .at("x2", to[0])
        .at("y2", to[1])
}

/// Places of marks with numbers, and their labels.
fn places<'a>(ticks: &'a [Tick], scale: &'a Scale) -> impl Iterator<Item = (f64, &'a str)> {
    ticks
        .iter()
        .filter_map(|tick| Some((scale.place(tick.value)?, tick.label.as_deref()?)))
}

fn strokes(ticks: &[Tick], scale: &Scale, stroke: impl Fn(f64, f64) -> Element) -> Element {
    let length = |tick: &Tick| {
        if tick.label.is_some() {
            TICK
        } else {
            0.55 * TICK
        }
    };
    let strokes = ticks
        .iter()
        .filter_map(|tick| Some(stroke(scale.place(tick.value)?, length(tick))));
    Stroke::new(Ink::DARK, 0.9)
        .on(Element::new("g"))
        .children(strokes)
}

fn x_axis(frame: &Frame, area: Area, ticks: &[Tick]) -> Element {
    let bottom = area.top + area.height;
    let labels = places(ticks, &frame.x)
        .map(|(x, label)| written([x, bottom + GAP + LINE - 7.0], "middle", label));
    Element::new("g")
        .child(strokes(ticks, &frame.x, |x, length| {
            line([x, bottom], [x, bottom + length])
        }))
        .children(labels)
}

fn y_axis(frame: &Frame, area: Area, ticks: &[Tick]) -> Element {
    let labels =
        places(ticks, &frame.y).map(|(y, label)| written([area.left - GAP, y + 4.0], "end", label));
    Element::new("g")
        .child(strokes(ticks, &frame.y, |y, length| {
            line([area.left - length, y], [area.left, y])
        }))
        .children(labels)
}
