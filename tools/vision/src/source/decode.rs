//! PNG and JPEG files to grey images.

use std::io::Cursor;

use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::image::GreyImage;

/// Maximum number of pixels of an image: a file that claims more is not from a microscope.
const MAX_PIXELS: usize = 64 << 20;

/// Reason why a file is not an image.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct DecodeError(String);

/// Decodes the bytes of a PNG or JPEG file. Colours become brightness by the weights of ITU-R
/// BT.601.
/// A truncated file is an error, not an image with a grey rest.
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
    let size = reader
        .output_buffer_size()
        .filter(|size| *size <= 4 * MAX_PIXELS)
        .ok_or_else(|| broken("too large"))?;
    let mut data = vec![0; size];
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
    let whole = bytes
        .iter()
        .rposition(|b| *b != 0 && *b != b'\n' && *b != b'\r')
        .is_some_and(|end| end > 2 && bytes[end] == 0xD9 && bytes[end - 1] == 0xFF);
    if !whole {
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
