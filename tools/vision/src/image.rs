//! A grey image.

use std::hash::{DefaultHasher, Hasher};

/// An image with one byte of brightness per pixel, rows from top to bottom.
///
/// Coordinates are in pixels: `x` to the right, `y` down, the centre of the first pixel is (0, 0).
#[derive(Clone, PartialEq, Eq)]
pub struct GreyImage {
    width: usize,
    height: usize,
    data: Vec<u8>,
}

impl GreyImage {
    /// An image from its bytes, row by row. `None` if there are not exactly `width * height` of
    /// them, or none at all.
    pub fn new(width: usize, height: usize, data: Vec<u8>) -> Option<Self> {
        (!data.is_empty() && width.checked_mul(height) == Some(data.len())).then_some(Self {
            width,
            height,
            data,
        })
    }

    /// The smallest image: one black pixel.
    pub fn black() -> Self {
        Self { width: 1, height: 1, data: vec![0] }
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.height
    }

    /// The bytes, row by row.
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// Brightness at (x, y), interpolated between the four pixels around it. `None` outside the
    /// image.
    pub fn sample(&self, x: f64, y: f64) -> Option<f32> {
        // A comparison with NaN is false, so a NaN leaves here as well.
        if !(x >= 0.0 && y >= 0.0) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        if column + 1 >= self.width || row + 1 >= self.height {
            return None;
        }
        let (fx, fy) = ((x - column as f64) as f32, (y - row as f64) as f32);
        let start = row * self.width + column;
        let upper = self.data.get(start..start + 2)?;
        let lower = self.data.get(start + self.width..start + self.width + 2)?;
        let top = f32::from(upper[0]) + fx * (f32::from(upper[1]) - f32::from(upper[0]));
        let bottom = f32::from(lower[0]) + fx * (f32::from(lower[1]) - f32::from(lower[0]));
        Some(top + fy * (bottom - top))
    }

    /// A hash of the image, to detect a frozen camera. Not stable
    /// between releases.
    pub fn digest(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        hasher.write_usize(self.width);
        hasher.write(&self.data);
        hasher.finish()
    }
}

impl std::fmt::Debug for GreyImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Grey({}x{})", self.width, self.height)
    }
}

/// A position in the image, px.
pub(crate) type Px = [f64; 2];

/// The unit step in a direction.
pub(crate) fn step(direction_rad: f64) -> Px {
    [direction_rad.cos(), -direction_rad.sin()]
}

/// The unit step to the left of a direction.
pub(crate) fn across(direction_rad: f64) -> Px {
    [-direction_rad.sin(), -direction_rad.cos()]
}

/// `from` and `length` times a unit step.
pub(crate) fn advance(from: Px, unit: Px, length: f64) -> Px {
    [from[0] + length * unit[0], from[1] + length * unit[1]]
}

/// Along and to the left of `direction_rad`, as seen from `origin`.
pub(crate) fn relative(point: Px, origin: Px, direction_rad: f64) -> Px {
    let ([ux, uy], [vx, vy]) = (step(direction_rad), across(direction_rad));
    let (dx, dy) = (point[0] - origin[0], point[1] - origin[1]);
    [dx * ux + dy * uy, dx * vx + dy * vy]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolates_between_pixels_and_knows_its_borders() {
        let image = GreyImage::new(2, 2, vec![0, 100, 50, 150]).unwrap();
        assert_eq!(image.sample(0.5, 0.0), Some(50.0));
        assert_eq!(image.sample(0.5, 0.5), Some(75.0));
        assert_eq!(image.sample(-0.1, 0.0), None);
        assert_eq!(image.sample(1.0, 0.0), None, "no pixel on the right to interpolate with");
        assert_eq!(image.sample(f64::NAN, 0.0), None);
    }

    #[test]
    fn refuses_bytes_that_do_not_fill_the_image() {
        assert!(GreyImage::new(2, 2, vec![0; 3]).is_none());
        assert!(GreyImage::new(0, 0, Vec::new()).is_none());
        assert!(GreyImage::new(usize::MAX, 2, vec![0; 4]).is_none());
    }
}
