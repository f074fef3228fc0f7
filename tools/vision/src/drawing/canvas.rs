//! A colour image to draw on.

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use super::font;
use crate::image::GreyImage;

/// Red, green, blue.
pub type Colour = [u8; 3];

/// A colour image.
#[derive(Clone)]
pub struct Canvas {
    width: usize,
    height: usize,
    data: Vec<u8>,
}

/// Why a image was not written.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    /// The file cannot be written.
    #[error("{path}: {source}")]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The image cannot be encoded.
    #[error("{path}: {source}")]
    Encode {
        /// Which.
        path: PathBuf,
        /// Why.
        source: png::EncodingError,
    },
}

impl Canvas {
    /// A page of one colour.
    #[must_use]
    pub fn new(width: usize, height: usize, colour: Colour) -> Self {
        Self { width, height, data: colour.repeat(width * height) }
    }

    /// A grey image to draw on.
    #[must_use]
    pub fn of(image: &GreyImage) -> Self {
        let data = image.data().iter().flat_map(|v| [*v; 3]).collect();
        Self { width: image.width(), height: image.height(), data }
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Colours a pixel; outside the image nothing happens.
    pub fn dot(&mut self, x: i64, y: i64, colour: Colour) {
        if (0..self.width as i64).contains(&x) && (0..self.height as i64).contains(&y) {
            let at = 3 * (y as usize * self.width + x as usize);
            self.data[at..at + 3].copy_from_slice(&colour);
        }
    }

    /// Draws a straight line, `thick` px thick.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], thick: i64, colour: Colour) {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        // No line is longer than its image would allow; a wild one is not drawn.
        let steps = dx.abs().max(dy.abs()).ceil();
        if !steps.is_finite() || steps > 20.0 * (self.width + self.height) as f64 {
            return;
        }
        for i in 0..=steps as usize {
            let t = i as f64 / steps.max(1.0);
            self.square([from[0] + t * dx, from[1] + t * dy], thick, colour);
        }
    }

    /// A filled square of `size` px around a place.
    pub fn square(&mut self, [x, y]: [f64; 2], size: i64, colour: Colour) {
        let (left, top) = (x.round() as i64 - size / 2, y.round() as i64 - size / 2);
        self.fill([left, top], [size, size], colour);
    }

    /// A filled rectangle.
    pub fn fill(&mut self, [left, top]: [i64; 2], [width, height]: [i64; 2], colour: Colour) {
        for y in top..top + height {
            for x in left..left + width {
                self.dot(x, y, colour);
            }
        }
    }

    /// Writes text with its upper left corner at (x, y), `scale` px per dot, on a dark ground.
    pub fn text(&mut self, text: &str, [x, y]: [i64; 2], scale: i64, colour: Colour) {
        let advance = 4 * scale;
        let width = advance * text.chars().count() as i64 + scale;
        self.fill([x, y], [width, 7 * scale], [20, 20, 20]);
        for (i, letter) in text.chars().enumerate() {
            let left = x + scale + i as i64 * advance;
            for (column, row) in font::dots(letter) {
                self.fill([left + column * scale, y + scale + row * scale], [scale, scale], colour);
            }
        }
    }

    /// Copies another image with its upper left corner at (x, y), made smaller by the whole
    /// number `by`.
    pub fn paste(&mut self, other: &Self, [x, y]: [usize; 2], by: usize) {
        for row in 0..other.height / by {
            for column in 0..other.width / by {
                let colour = other.mean(column * by, row * by, by);
                self.dot((x + column) as i64, (y + row) as i64, colour);
            }
        }
    }

    fn mean(&self, x: usize, y: usize, size: usize) -> Colour {
        std::array::from_fn(|channel| {
            let pixels =
                (y..y + size).flat_map(|row| (x..x + size).map(move |column| (row, column)));
            let sum: usize = pixels
                .map(|(row, column)| {
                    usize::from(self.data[3 * (row * self.width + column) + channel])
                })
                .sum();
            (sum / (size * size)) as u8
        })
    }

    /// Writes it as a PNG file.
    ///
    /// # Errors
    ///
    /// [`SaveError`] with the path.
    pub fn save(&self, path: &Path) -> Result<(), SaveError> {
        save_png(path, self.width, self.height, png::ColorType::Rgb, &self.data)
    }
}

/// Writes a grey image as a PNG file.
///
/// # Errors
///
/// [`SaveError`] with the path.
pub fn save_grey(path: &Path, image: &GreyImage) -> Result<(), SaveError> {
    save_png(path, image.width(), image.height(), png::ColorType::Grayscale, image.data())
}

fn save_png(
    path: &Path,
    width: usize,
    height: usize,
    colour: png::ColorType,
    data: &[u8],
) -> Result<(), SaveError> {
    let encode = |source| SaveError::Encode { path: path.to_owned(), source };
    let file = std::fs::File::create(path)
        .map_err(|source| SaveError::Write { path: path.to_owned(), source })?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), width as u32, height as u32);
    encoder.set_color(colour);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().map_err(encode)?;
    writer.write_image_data(data).map_err(encode)?;
    writer.finish().map_err(encode)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saved_image_decodes_to_itself() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let image = GreyImage::new(3, 2, vec![0, 50, 100, 150, 200, 250]).unwrap();
        save_grey(&path, &image).unwrap();
        assert_eq!(crate::source::decode(&std::fs::read(&path).unwrap()).unwrap(), image);
    }

    #[test]
    fn drawing_outside_is_harmless() {
        let mut canvas = Canvas::new(10, 10, [0; 3]);
        canvas.line([-50.0, -50.0], [60.0, 60.0], 3, [255; 3]);
        canvas.line([0.0, 0.0], [f64::NAN, 1e300], 3, [255; 3]);
        canvas.text("outside", [-5, 8], 2, [255; 3]);
        assert_eq!(canvas.mean(4, 4, 1), [255; 3]);
    }
}
