//! What lies between camera and snake.

use super::raster::{Raster, Rod};

/// An object in front of the snake, in pixels.
#[derive(Debug, Clone, PartialEq)]
pub enum Clutter {
    /// A straight instrument that tapers from `from` to its free end `to`.
    Instrument {
        /// Where it comes from, usually outside the image.
        from: [f64; 2],
        to: [f64; 2],
        /// Half its thickness at both ends.
        half_width: [f64; 2],
        /// Brightness along its middle.
        brightness: f32,
        /// How much darker its rims are.
        rim: f32,
    },
    /// A speck of dust, a bubble, a drop.
    Speck { centre: [f64; 2], half: [f64; 2], turn_rad: f64, brightness: f32 },
}

impl Clutter {
    pub(super) fn paint(&self, canvas: &mut Raster) {
        match self {
            Self::Instrument { from, to, half_width, brightness, rim } => canvas.rod(&Rod {
                points: vec![[from[0], from[1], half_width[0]], [to[0], to[1], half_width[1]]],
                brightness: *brightness,
                rim: *rim,
            }),
            Self::Speck { centre, half, turn_rad, brightness } => {
                canvas.blob(*centre, *half, *turn_rad, *brightness)
            }
        }
    }
}

/// A sheet of one brightness over the circle of `radius` around `centre`: hides whatever is there.
pub fn cover(centre: [f64; 2], radius: f64, brightness: f32) -> Clutter {
    Clutter::Speck { centre, half: [radius, radius], turn_rad: 0.0, brightness }
}
