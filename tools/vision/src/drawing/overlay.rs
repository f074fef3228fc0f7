//! What the detector saw, drawn over what the camera saw.

use super::canvas::{Canvas, Colour};
use crate::fibre::{FittedLine, Reading};
use crate::image::GreyImage;

const BASE: Colour = [40, 220, 60];
const TIP: Colour = [255, 140, 0];
const TRACE: Colour = [0, 200, 255];
const GOOD: Colour = [120, 255, 120];
const POOR: Colour = [255, 110, 110];

/// Draws a reading over its image: base line green, tip line orange, trace blue, the end a cross,
/// and in words the name, the angle, its standard deviation, the quality and the doubt; or why
/// there is no reading.
#[must_use]
pub fn overlay(image: &GreyImage, name: &str, reading: &Result<Reading, String>) -> Canvas {
    let mut canvas = Canvas::of(image);
    let scale = (image.width() as i64 / 320).max(1);
    let (text, colour) = match reading {
        Ok(reading) => {
            draw(&mut canvas, reading, scale);
            (words(reading), if reading.is_good() { GOOD } else { POOR })
        }
        Err(cause) => (cause.clone(), POOR),
    };
    // On a page of small overlays a dot of a letter is then two pixels, which can be read.
    let letters = 2 * scale;
    canvas.text(name, [0, 0], letters, [230, 230, 230]);
    canvas.text(&text, [0, 7 * letters], letters, colour);
    canvas
}

fn words(reading: &Reading) -> String {
    let (angle, std) = (reading.angle_rad.to_degrees(), reading.std_rad.to_degrees());
    let issue = reading.issue.map_or(String::new(), |issue| format!(" {issue}"));
    format!("{angle:+.2} +-{std:.3} deg  Q {:.2}{issue}", reading.quality)
}

fn draw(canvas: &mut Canvas, reading: &Reading, scale: i64) {
    let thick = scale.max(1);
    for at in reading.trace.iter().step_by(3) {
        canvas.square(*at, thick, TRACE);
    }
    // A little longer than the stretch that made it, so that a wrong direction shows.
    let mut line = |line: &FittedLine, colour| {
        canvas.line(line.at(-0.6 * line.length_px), line.at(0.8 * line.length_px), thick, colour)
    };
    line(&reading.base, BASE);
    line(&reading.tip, TIP);
    let [x, y] = reading.tip_px;
    let arm = 5.0 * scale as f64;
    canvas.line([x - arm, y], [x + arm, y], thick, [255, 0, 255]);
    canvas.line([x, y - arm], [x, y + arm], thick, [255, 0, 255]);
}
