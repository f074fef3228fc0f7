//! Colors, dashes and markers that can be distinguished on a grey print.
//!
//! The colors are those of Okabe and Ito ("Color universal design", 2008), which people with color
//! blindness can distinguish, and greys. In grey print some are close to each other: lines that
//! must be distinguished have different dashes or markers as well.

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

/// The dash pattern of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dash {
    #[default]
    Solid,
    Dashed,
    Dotted,
    DashDot,
}

impl Dash {
    /// Dash, gap, dash, ... Round ends make a dash longer by the width of the line.
    pub(crate) fn lengths(self) -> &'static [f64] {
        match self {
            Self::Solid => &[],
            Self::Dashed => &[5.0, 4.0],
            Self::Dotted => &[0.5, 3.5],
            Self::DashDot => &[6.0, 3.5, 0.5, 3.5],
        }
    }
}

/// Color, width and dash pattern of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    pub color: Color,
    /// In units of the figure: 1 is about 0.7 pt in print.
    pub width: f64,
    pub dash: Dash,
}

impl Stroke {
    /// A solid line.
    pub const fn new(color: Color, width: f64) -> Self {
        Self { color, width, dash: Dash::Solid }
    }

    /// With a dash pattern.
    pub const fn dash(self, dash: Dash) -> Self {
        Self { dash, ..self }
    }

    pub(crate) fn style(self) -> ShapeStyle {
        self.color.rgb().stroke_width(pixels(self.width) as u32)
    }
}

/// The symbol at a point.
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
