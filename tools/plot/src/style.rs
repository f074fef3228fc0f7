//! Colors, dashes and markers that can be distinguished on a grey print.
//!
//! The colors are those of Okabe and Ito ("Color universal design", 2008), which people with color
//! blindness can distinguish, and greys. In grey print some are close to each other: lines that
//! must be distinguished have different dashes or markers as well.

use crate::markup::Element;

/// A color in the notation of SVG.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Color(pub(crate) &'static str);

impl Color {
    /// Black.
    pub const BLACK: Self = Self("#000000");
    /// Text and frames.
    pub const DARK: Self = Self("#222222");
    /// Lines of second rank.
    pub const GREY: Self = Self("#707070");
    /// Point clouds behind lines.
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

    /// A sequential scale of one hue from light to dark. It keeps its order in grey.
    pub(crate) const SEQUENTIAL: [Self; 5] =
        [Self("#e8eef4"), Self("#b9cfe2"), Self("#7fa6c9"), Self("#41719f"), Self("#123b63")];
}

/// The dash pattern of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dash {
    /// No gaps.
    #[default]
    Solid,
    /// Long strokes.
    Dashed,
    /// Dots.
    Dotted,
    /// Strokes and dots in turn.
    DashDot,
}

/// Color, width and dash pattern of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Color.
    pub color: Color,
    /// Width in units of the figure: 1 is about 0.7 pt in print.
    pub width: f64,
    /// Dash pattern.
    pub dash: Dash,
}

impl Stroke {
    /// A solid line.
    #[must_use]
    pub const fn new(color: Color, width: f64) -> Self {
        Self { color, width, dash: Dash::Solid }
    }

    /// With a dash pattern.
    #[must_use]
    pub const fn dash(self, dash: Dash) -> Self {
        Self { dash, ..self }
    }

    /// Sets the attributes of an element.
    pub(crate) fn apply(&self, element: Element) -> Element {
        let element = element
            .with("fill", "none")
            .with("stroke", self.color.0)
            .lengths([("stroke-width", self.width)]);
        match self.dash {
            Dash::Solid => element.with("stroke-linejoin", "round"),
            Dash::Dashed => element.with("stroke-dasharray", "6 3"),
            Dash::Dotted => element.with("stroke-dasharray", "1.5 2.5"),
            Dash::DashDot => element.with("stroke-dasharray", "7 2.5 1.5 2.5"),
        }
    }
}

/// The symbol at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    /// A filled disc.
    Dot,
    /// An open circle.
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
