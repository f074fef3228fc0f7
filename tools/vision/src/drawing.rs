//! Measurements drawn over their images, for people; and images as PNG files.

use std::convert::Infallible;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use embedded_graphics::mono_font::MonoTextStyleBuilder;
use embedded_graphics::mono_font::ascii::FONT_6X10;
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::{Line, PrimitiveStyle, Rectangle};
use embedded_graphics::text::{Baseline, Text};

use crate::fibre::{FittedLine, Reading};
use crate::image::GreyImage;

const BASE: Rgb888 = Rgb888::new(40, 220, 60);
const TIP: Rgb888 = Rgb888::new(255, 140, 0);
const TRACE: Rgb888 = Rgb888::new(0, 200, 255);
const END: Rgb888 = Rgb888::new(255, 0, 255);
const NAME: Rgb888 = Rgb888::new(230, 230, 230);
const GOOD: Rgb888 = Rgb888::new(120, 255, 120);
const POOR: Rgb888 = Rgb888::new(255, 110, 110);
const LABEL: Rgb888 = Rgb888::new(20, 20, 20);
/// Lines are a pixel thick for every 320 columns of the image.
const COLUMNS: u32 = 320;

#[derive(Clone)]
pub struct Canvas {
    size: Size,
    data: Vec<Rgb888>,
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        self.size
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            if self.bounding_box().contains(at) {
                self.data[(at.y * self.size.width as i32 + at.x) as usize] = colour;
            }
        }
        Ok(())
    }
}

impl Canvas {
    fn of(image: &GreyImage) -> Self {
        let size = Size::new(image.width() as u32, image.height() as u32);
        Self { size, data: image.data().iter().map(|v| Rgb888::new(*v, *v, *v)).collect() }
    }

    fn line(&mut self, from: [f64; 2], to: [f64; 2], thick: u32, colour: Rgb888) {
        // No line is longer than its image would allow; a wild one is not drawn.
        let most = 20.0 * f64::from(self.size.width + self.size.height);
        if [from, to].as_flattened().iter().all(|v| v.abs() < most) {
            let [from, to] =
                [from, to].map(|[x, y]| Point::new(x.round() as i32, y.round() as i32));
            let style = PrimitiveStyle::with_stroke(colour, thick);
            let Ok(()) = Line::new(from, to).into_styled(style).draw(self);
        }
    }

    fn text(&mut self, text: &str, row: i32, colour: Rgb888) {
        let style = MonoTextStyleBuilder::new().font(&FONT_6X10);
        let style = style.text_color(colour).background_color(LABEL).build();
        let at = Point::new(0, row * FONT_6X10.character_size.height as i32);
        let Ok(_) = Text::with_baseline(text, at, style, Baseline::Top).draw(self);
    }

    pub fn save(&self, path: &Path) -> Result<(), SaveError> {
        let data: Vec<u8> = self.data.iter().flat_map(|c| [c.r(), c.g(), c.b()]).collect();
        save_png(path, self.size, png::ColorType::Rgb, &data)
    }
}

/// Draws a reading over its image: base line green, tip line orange, trace blue, the end a cross,
/// and as text name, angle, deviation, quality and issue.
pub fn overlay(image: &GreyImage, name: &str, reading: &Result<Reading, String>) -> Canvas {
    let mut canvas = Canvas::of(image);
    let (text, colour) = match reading {
        Ok(reading) => {
            draw(&mut canvas, reading);
            let (angle, std) = (reading.angle_rad.to_degrees(), reading.std_rad.to_degrees());
            let issue = reading.issue.map_or(String::new(), |issue| format!(" {issue}"));
            let text = format!("{angle:+.2} +-{std:.3} deg  Q {:.2}{issue}", reading.quality);
            (text, if reading.is_good() { GOOD } else { POOR })
        }
        Err(cause) => (cause.clone(), POOR),
    };
    canvas.text(name, 0, NAME);
    canvas.text(&text, 1, colour);
    canvas
}

fn draw(canvas: &mut Canvas, reading: &Reading) {
    let thick = (canvas.size.width / COLUMNS).max(1);
    for [x, y] in reading.trace.iter().step_by(3) {
        let centre = Point::new(x.round() as i32, y.round() as i32);
        let dot = Rectangle::with_center(centre, Size::new_equal(thick));
        let Ok(()) = canvas.fill_solid(&dot, TRACE);
    }
    // A little longer than the fitted stretch, so that a wrong direction shows.
    let mut line = |line: &FittedLine, colour| {
        canvas.line(line.at(-0.6 * line.length_px), line.at(0.8 * line.length_px), thick, colour)
    };
    line(&reading.base, BASE);
    line(&reading.tip, TIP);
    let [x, y] = reading.tip_px;
    let arm = 5.0 * f64::from(thick);
    canvas.line([x - arm, y], [x + arm, y], thick, END);
    canvas.line([x, y - arm], [x, y + arm], thick, END);
}

#[derive(Debug, thiserror::Error)]
#[error("{path}: {source}")]
pub struct SaveError {
    path: PathBuf,
    source: png::EncodingError,
}

pub fn save_grey(path: &Path, image: &GreyImage) -> Result<(), SaveError> {
    let size = Size::new(image.width() as u32, image.height() as u32);
    save_png(path, size, png::ColorType::Grayscale, image.data())
}

fn save_png(path: &Path, size: Size, colour: png::ColorType, data: &[u8]) -> Result<(), SaveError> {
    let write = || {
        let file = std::fs::File::create(path)?;
        let mut encoder = png::Encoder::new(BufWriter::new(file), size.width, size.height);
        encoder.set_color(colour);
        encoder.set_compression(png::Compression::Fast);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(data)?;
        writer.finish()
    };
    write().map_err(|source| SaveError { path: path.to_owned(), source })
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
        assert_eq!(crate::image::decode(&std::fs::read(&path).unwrap()).unwrap(), image);
    }

    #[test]
    fn drawing_outside_is_harmless() {
        let mut canvas = Canvas::of(&GreyImage::new(10, 10, vec![0; 100]).unwrap());
        canvas.line([-50.0, -50.0], [60.0, 60.0], 3, Rgb888::WHITE);
        canvas.line([0.0, 0.0], [f64::NAN, 1e300], 3, Rgb888::RED);
        canvas.text("outside", 9, Rgb888::WHITE);
        assert_eq!(canvas.data[44], Rgb888::WHITE);
        assert!(!canvas.data.contains(&Rgb888::RED));
    }
}
