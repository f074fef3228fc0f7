//! A grey image.

use std::hash::{DefaultHasher, Hasher};
use std::io::Cursor;

use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

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
    /// An image from its bytes, row by row: exactly `width * height`, and not none.
    pub fn new(width: usize, height: usize, data: Vec<u8>) -> Option<Self> {
        let fits = !data.is_empty() && width.checked_mul(height) == Some(data.len());
        fits.then_some(Self { width, height, data })
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

    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// Brightness at (x, y), interpolated between four pixels. `None` outside the image.
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

    /// A hash, to detect a frozen camera. Not stable between releases.
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

/// Maximum number of pixels of an image: a file that claims more is not from a microscope.
const MAX_PIXELS: usize = 64 << 20;

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct DecodeError(String);

/// Decodes a PNG or JPEG file; colours become brightness by the weights of ITU-R BT.601. A
/// truncated file is an error, not an image with a grey rest.
pub fn decode(bytes: &[u8]) -> Result<GreyImage, DecodeError> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => decode_png(bytes),
        [0xFF, 0xD8, ..] => decode_jpeg(bytes),
        _ => Err(broken("neither PNG nor JPEG")),
    }
}

fn broken(error: impl std::fmt::Display) -> DecodeError {
    DecodeError(error.to_string())
}

fn decode_png(bytes: &[u8]) -> Result<GreyImage, DecodeError> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    // Palettes and 1, 2, 4 bit become 8 bit; 16 bit lose their lower half.
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info().map_err(broken)?;
    let size = reader.output_buffer_size().filter(|size| *size <= 4 * MAX_PIXELS);
    let mut data = vec![0; size.ok_or_else(|| broken("too large"))?];
    let info = reader.next_frame(&mut data).map_err(broken)?;
    data.truncate(info.buffer_size());
    let grey = match info.color_type {
        png::ColorType::Grayscale => data,
        png::ColorType::GrayscaleAlpha => data.chunks_exact(2).map(|p| p[0]).collect(),
        png::ColorType::Rgb => data.chunks_exact(3).map(brightness).collect(),
        png::ColorType::Rgba => data.chunks_exact(4).map(brightness).collect(),
        png::ColorType::Indexed => return Err(broken("indexed pixels are not supported")),
    };
    GreyImage::new(info.width as usize, info.height as usize, grey)
        .ok_or_else(|| broken("size and data differ"))
}

fn brightness(pixel: &[u8]) -> u8 {
    let [red, green, blue] = [pixel[0], pixel[1], pixel[2]].map(u32::from);
    ((299 * red + 587 * green + 114 * blue + 500) / 1000) as u8
}

fn decode_jpeg(bytes: &[u8]) -> Result<GreyImage, DecodeError> {
    // Decoders fill missing data with grey, so a missing end has to be detected here.
    let end = bytes.iter().rposition(|b| !matches!(b, 0 | b'\n' | b'\r'));
    let is_whole = |end: usize| end > 2 && bytes[end] == 0xD9 && bytes[end - 1] == 0xFF;
    if !end.is_some_and(is_whole) {
        return Err(broken("no end of image: the file is truncated"));
    }
    let options = DecoderOptions::default()
        .jpeg_set_out_colorspace(ColorSpace::Luma)
        .set_strict_mode(true)
        .set_max_width(1 << 14)
        .set_max_height(1 << 14);
    let mut decoder = zune_jpeg::JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let data = decoder.decode().map_err(broken)?;
    let (width, height) = decoder.dimensions().ok_or_else(|| broken("no size"))?;
    GreyImage::new(width, height, data).ok_or_else(|| broken("size and data differ"))
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

    fn encoded(colour: png::ColorType, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
        encoder.set_color(colour);
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        bytes
    }

    #[test]
    fn grey_and_colour_png() {
        let grey = decode(&encoded(png::ColorType::Grayscale, &[1, 2, 3, 4])).unwrap();
        assert_eq!(grey.data(), [1, 2, 3, 4]);
        let colour =
            decode(&encoded(png::ColorType::Rgb, &[255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 9, 9]))
                .unwrap();
        assert_eq!(colour.data(), [76, 150, 29, 9]);
    }

    #[test]
    fn truncated_files_are_errors() {
        let png = encoded(png::ColorType::Grayscale, &[1, 2, 3, 4]);
        for length in 0..png.len() - 12 {
            assert!(decode(&png[..length]).is_err(), "{length} of {}", png.len());
        }
        assert!(decode(&[0xFF, 0xD8, 0xFF, 0xE0, 0, 0, 0, 0]).is_err());
        assert_eq!(decode(b"hello"), Err(broken("neither PNG nor JPEG")));
    }
}
