//! Inks, dashes and markers that stay apart on a grey print.
//!
//! The inks are those of Okabe and Ito ("Color universal design", 2008), which people who do not
//! see all colours can tell apart, and greys. In grey print some come close to each other, so lines
//! that must be told apart take different dashes or markers as well.

use crate::xml::Element;

/// A colour, as SVG writes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ink(&'static str);

impl Ink {
    /// Black.
    pub const BLACK: Self = Self("#000000");
    /// Text and frames.
    pub const DARK: Self = Self("#222222");
    /// Lines of second rank.
    pub const GREY: Self = Self("#707070");
    /// Clouds of dots behind lines.
    pub const PALE: Self = Self("#b4b4b4");
    /// Grids.
    pub const FAINT: Self = Self("#e2e2e2");
    /// Blue, dark in grey.
    pub const BLUE: Self = Self("#0060a0");
    /// Red-orange, middle in grey.
    pub const VERMILION: Self = Self("#d55e00");
    /// Green, middle in grey.
    pub const GREEN: Self = Self("#008a65");
    /// Yellow-orange, light in grey.
    pub const ORANGE: Self = Self("#e69f00");
    /// Light blue, light in grey.
    pub const SKY: Self = Self("#56b4e9");
    /// White.
    pub const WHITE: Self = Self("#ffffff");

    /// A scale of one hue from light to dark: it keeps its order in grey.
    pub const STEPS: [Self; 5] = [
        Self("#e8eef4"),
        Self("#b9cfe2"),
        Self("#7fa6c9"),
        Self("#41719f"),
        Self("#123b63"),
    ];

    /// As SVG writes it.
    #[must_use]
    pub const fn code(self) -> &'static str {
        self.0
    }
}

/// How a line is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dash {
    /// Not at all.
    #[default]
    Solid,
    /// Long strokes.
    Dashed,
    /// Points.
    Dotted,
    /// Strokes and points in turn.
    DashDot,
}

impl Dash {
    const fn pattern(self) -> Option<&'static str> {
        match self {
            Self::Solid => None,
            Self::Dashed => Some("6 3"),
            Self::Dotted => Some("1.5 2.5"),
            Self::DashDot => Some("7 2.5 1.5 2.5"),
        }
    }
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Colour.
    pub ink: Ink,
    /// Width, in the units of the figure: 1 is about 0.7 pt in print.
    pub width: f64,
    /// How it is broken.
    pub dash: Dash,
}

impl Stroke {
    /// A solid line.
    #[must_use]
    pub const fn new(ink: Ink, width: f64) -> Self {
        Self {
            ink,
            width,
            dash: Dash::Solid,
        }
    }

    /// Broken.
    #[must_use]
    pub const fn dash(self, dash: Dash) -> Self {
        Self { dash, ..self }
    }

    /// Puts it on an element.
    #[must_use]
    pub fn on(&self, element: Element) -> Element {
        let element = element
            .with("fill", "none")
            .with("stroke", self.ink.code())
            .at("stroke-width", self.width);
        match self.dash.pattern() {
            Some(pattern) => element.with("stroke-dasharray", pattern),
            None => element.with("stroke-linejoin", "round"),
        }
    }
}

/// What stands at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    /// A filled disc.
    Dot,
    /// An open ring.
    Circle,
    /// An open square.
    Square,
    /// An open triangle.
    Triangle,
    /// An x.
    Cross,
    /// An open square on its tip.
    Diamond,
}
