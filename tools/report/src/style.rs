//! Colors, dashes and markers that can be distinguished on a grey print.
//!
//! The colors are those of Okabe and Ito ("Color universal design", 2008), which people with color
//! blindness can distinguish, and greys. In grey print some are close to each other: lines that
//! must be distinguished have different dashes or markers as well.

use plotters::element::PathElement;
use plotters::style::{Color as _, RGBColor, ShapeStyle};

/// `plotters` accepts only whole coordinates and widths: a figure is drawn in tenths of a unit.
pub const UNIT: f64 = 10.0;

/// A length in tenths of a unit.
pub fn pixels(length: f64) -> i32 {
    (UNIT * length).round() as i32
}

/// A color: red, green, blue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Color(u32);

impl Color {
    pub const BLACK: Self = Self(0x00_0000);
    /// Text and frames.
    pub const DARK: Self = Self(0x22_2222);
    /// Lines of second rank.
    pub const GREY: Self = Self(0x70_7070);
    /// Point clouds behind lines.
    pub const PALE: Self = Self(0xb4_b4b4);
    /// Grids.
    pub const FAINT: Self = Self(0xe2_e2e2);
    /// Dark in grey.
    pub const BLUE: Self = Self(0x00_60a0);
    /// Red-orange, middle in grey.
    pub const VERMILION: Self = Self(0xd5_5e00);
    /// Middle in grey.
    pub const GREEN: Self = Self(0x00_8a65);
    /// Light in grey.
    pub const ORANGE: Self = Self(0xe6_9f00);
    /// Light blue, light in grey.
    pub const SKY: Self = Self(0x56_b4e9);
    pub const WHITE: Self = Self(0xff_ffff);

    pub(crate) fn rgb(self) -> RGBColor {
        let [_, red, green, blue] = self.0.to_be_bytes();
        RGBColor(red, green, blue)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dash {
    #[default]
    Solid,
    Dashed,
    Dotted,
    Long,
}

impl Dash {
    /// Dash and gap, in units of the figure; round ends make a dash longer.
    pub(crate) fn lengths(self) -> [f64; 2] {
        match self {
            Self::Solid => [1.0, 0.0],
            Self::Dashed => [5.0, 4.0],
            Self::Dotted => [0.5, 3.5],
            Self::Long => [12.0, 4.0],
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    pub color: Color,
    /// In units of the figure: 1 is about 0.7 pt in print.
    pub width: f64,
    pub dash: Dash,
}

impl Stroke {
    pub const fn new(color: Color, width: f64) -> Self {
        Self { color, width, dash: Dash::Solid }
    }

    pub const fn dash(self, dash: Dash) -> Self {
        Self { dash, ..self }
    }

    pub(crate) fn style(self) -> ShapeStyle {
        self.color.rgb().stroke_width(pixels(self.width) as u32)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    /// A filled disc.
    Dot,
    Circle,
    Square,
    Triangle,
    /// An x.
    Cross,
    /// An open square on its tip.
    Diamond,
}

impl Marker {
    /// The symbol at a pixel: a polyline, because those of one style become one path.
    pub(crate) fn symbol(self, (x, y): (i32, i32), color: Color) -> PathElement<(i32, i32)> {
        let corners: &[[f64; 2]] = match self {
            Self::Dot => {
                // A disc: a line of no length with round ends.
                return PathElement::new([(x, y), (x, y)], Stroke::new(color, 5.0).style());
            }
            Self::Circle => &CIRCLE,
            Self::Square => &[[-0.85, -0.85], [0.85, -0.85], [0.85, 0.85], [-0.85, 0.85]],
            Self::Triangle => &[[0.0, -1.1], [1.0, 0.75], [-1.0, 0.75]],
            Self::Diamond => &[[0.0, -1.2], [1.2, 0.0], [0.0, 1.2], [-1.2, 0.0]],
            Self::Cross => {
                &[[0.9, 0.9], [-0.9, -0.9], [0.0, 0.0], [-0.9, 0.9], [0.9, -0.9], [0.0, 0.0]]
            }
        };
        let closed = corners.iter().chain(corners.first());
        let pixel = |at: &[f64; 2]| (x + pixels(RADIUS * at[0]), y + pixels(RADIUS * at[1]));
        PathElement::new(closed.map(pixel).collect::<Vec<_>>(), Stroke::new(color, 1.1).style())
    }
}

const RADIUS: f64 = 3.0;
/// Eight corners of a circle: round enough at this size.
const CIRCLE: [[f64; 2]; 8] = {
    let a = std::f64::consts::FRAC_1_SQRT_2;
    [[1.0, 0.0], [a, a], [0.0, 1.0], [-a, a], [-1.0, 0.0], [-a, -a], [0.0, -1.0], [a, -a]]
};
