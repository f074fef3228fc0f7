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

/// Width of one overlay on a contact sheet, px.
const CELL: u32 = 320;
const BORDER: u32 = 4;

/// A colour image to draw on.
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

/// Draws with dots of `by` times `by` pixels.
struct Enlarged<'a> {
    canvas: &'a mut Canvas,
    by: u32,
}

impl OriginDimensions for Enlarged<'_> {
    fn size(&self) -> Size {
        self.canvas.size / self.by
    }
}

impl DrawTarget for Enlarged<'_> {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            let dot = Rectangle::new(at * self.by as i32, Size::new_equal(self.by));
            self.canvas.fill_solid(&dot, colour)?;
        }
        Ok(())
    }
}

impl Canvas {
    fn new(size: Size) -> Self {
        Self { size, data: vec![Rgb888::BLACK; (size.width * size.height) as usize] }
    }

    fn of(image: &GreyImage) -> Self {
        let size = Size::new(image.width() as u32, image.height() as u32);
        Self { size, data: image.data().iter().map(|v| Rgb888::new(*v, *v, *v)).collect() }
    }

    /// How much smaller it is on a contact sheet.
    fn reduction(&self) -> u32 {
        self.size.width.div_ceil(CELL).max(1)
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
        // On a contact sheet a dot of a letter is then one pixel.
        let by = self.reduction();
        let mut target = Enlarged { canvas: self, by };
        let Ok(_) = Text::with_baseline(text, at, style, Baseline::Top).draw(&mut target);
    }

    /// Smaller by a whole number: every pixel is the mean of `by` times `by`.
    fn reduced(&self, by: u32) -> Self {
        let mut small = Self::new(self.size / by);
        let pixel = |at: Point| self.data[(at.y * self.size.width as i32 + at.x) as usize];
        let mean = |at: Point| {
            let block = Rectangle::new(at * by as i32, Size::new_equal(by));
            let sum = |channel: fn(&Rgb888) -> u8| {
                let sum: u32 = block.points().map(|at| u32::from(channel(&pixel(at)))).sum();
                (sum / (by * by)) as u8
            };
            Rgb888::new(sum(Rgb888::r), sum(Rgb888::g), sum(Rgb888::b))
        };
        let pixels = small.bounding_box().points().map(|at| Pixel(at, mean(at)));
        let Ok(()) = small.draw_iter(pixels);
        small
    }

    /// Writes it as a PNG file.
    pub fn save(&self, path: &Path) -> Result<(), SaveError> {
        let data: Vec<u8> = self.data.iter().flat_map(|c| [c.r(), c.g(), c.b()]).collect();
        save_png(path, self.size, png::ColorType::Rgb, &data)
    }
}

/// Draws a reading over its image: base line green, tip line orange, trace blue, the end a cross,
/// and in words the name, the angle, its standard deviation, the quality and the doubt; or why
/// there is no reading.
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
    let thick = (canvas.size.width / CELL).max(1);
    for [x, y] in reading.trace.iter().step_by(3) {
        let centre = Point::new(x.round() as i32, y.round() as i32);
        let dot = Rectangle::with_center(centre, Size::new_equal(thick));
        let Ok(()) = canvas.fill_solid(&dot, TRACE);
    }
    // A little longer than the stretch that made it, so that a wrong direction shows.
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

/// Many overlays on one page, made smaller, in rows from left to right.
#[derive(Default)]
pub struct ContactSheet(Vec<Canvas>);

impl ContactSheet {
    /// Adds an overlay.
    pub fn add(&mut self, canvas: &Canvas) {
        self.0.push(canvas.reduced(canvas.reduction()));
    }

    /// The page, with so many overlays per row; at least one.
    pub fn page(&self, columns: usize) -> Canvas {
        let columns = columns.clamp(1, self.0.len().max(1));
        let largest =
            self.0.iter().fold(Size::new(1, 1), |size, cell| size.component_max(cell.size));
        let cell = largest + Size::new_equal(BORDER);
        let rows = self.0.len().div_ceil(columns).max(1);
        let mut page = Canvas::new(cell.component_mul(Size::new(columns as u32, rows as u32)));
        for (number, overlay) in self.0.iter().enumerate() {
            let place = Point::new((number % columns) as i32, (number / columns) as i32);
            let corner = place.component_mul(Point::new(cell.width as i32, cell.height as i32));
            let Ok(()) = page.fill_contiguous(
                &Rectangle::new(corner, overlay.size),
                overlay.data.iter().copied(),
            );
        }
        page
    }
}

/// Why an image was not written.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {source}")]
pub struct SaveError {
    path: PathBuf,
    source: png::EncodingError,
}

/// Writes a grey image as a PNG file.
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
        assert_eq!(crate::source::decode(&std::fs::read(&path).unwrap()).unwrap(), image);
    }

    #[test]
    fn drawing_outside_is_harmless() {
        let mut canvas = Canvas::new(Size::new(10, 10));
        canvas.line([-50.0, -50.0], [60.0, 60.0], 3, Rgb888::WHITE);
        canvas.line([0.0, 0.0], [f64::NAN, 1e300], 3, Rgb888::RED);
        canvas.text("outside", 9, Rgb888::WHITE);
        assert_eq!(canvas.data[44], Rgb888::WHITE);
        assert!(!canvas.data.contains(&Rgb888::RED));
    }
}
