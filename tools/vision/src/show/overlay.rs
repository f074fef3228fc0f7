//! What the detector saw, drawn over what the camera saw.

use super::paper::{Colour, Paper};
use crate::fibre::{Line, Reading};
use crate::image::Grey;

const BASE: Colour = [40, 220, 60];
const TIP: Colour = [255, 140, 0];
const TRACE: Colour = [0, 200, 255];
const GOOD: Colour = [120, 255, 120];
const POOR: Colour = [255, 110, 110];

/// Draws a reading over its picture: base line green, tip line orange, trace blue, the end a cross,
/// and in words the name, the angle, its standard deviation, the quality and the doubt; or why
/// there is no reading.
#[must_use]
pub fn overlay(picture: &Grey, name: &str, reading: &Result<Reading, String>) -> Paper {
    let mut paper = Paper::of(picture);
    let scale = (picture.width() as i64 / 320).max(1);
    let (text, colour) = match reading {
        Ok(reading) => {
            draw(&mut paper, reading, scale);
            (words(reading), if reading.is_good() { GOOD } else { POOR })
        }
        Err(cause) => (cause.clone(), POOR),
    };
    // On a page of small overlays a dot of a letter is then two pixels, which can be read.
    let letters = 2 * scale;
    paper.text(name, [0, 0], letters, [230, 230, 230]);
    paper.text(&text, [0, 7 * letters], letters, colour);
    paper
}

fn words(reading: &Reading) -> String {
    let (angle, std) = (reading.angle_rad.to_degrees(), reading.std_rad.to_degrees());
    let doubt = reading
        .doubt
        .map_or(String::new(), |doubt| format!(" {doubt}"));
    format!(
        "{angle:+.2} +-{std:.3} deg  Q {:.2}{doubt}",
        reading.quality
    )
}

fn draw(paper: &mut Paper, reading: &Reading, scale: i64) {
    let thick = scale.max(1);
    for at in reading.trace.iter().step_by(3) {
        paper.square(*at, thick, TRACE);
    }
    // A little longer than the stretch that made it, so that a wrong direction shows.
    let mut line = |line: &Line, colour| {
        paper.line(
            line.at(-0.6 * line.length_px),
            line.at(0.8 * line.length_px),
            thick,
            colour,
        )
    };
    line(&reading.base, BASE);
    line(&reading.tip, TIP);
    let [x, y] = reading.tip_px;
    let arm = 5.0 * scale as f64;
    paper.line([x - arm, y], [x + arm, y], thick, [255, 0, 255]);
    paper.line([x, y - arm], [x, y + arm], thick, [255, 0, 255]);
}
