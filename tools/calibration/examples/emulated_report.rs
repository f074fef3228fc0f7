//! The report of a calibration of an emulated snake, without a controller and a serial line:
//! `cargo run --release -p i2ris-calibration --example emulated_report -- SNAKE.toml SECONDS FAMILY FOLDER`
//! writes `recording.csv` and `report.html` into a folder. FAMILY is one of them or `best`.
#![allow(clippy::print_stdout, reason = "an example says what it did")]

use std::error::Error;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;
use std::time::Instant;

use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris_calibration::fit::{FitOptions, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording, RecordingWriter, Row};
use i2ris_calibration::report::{html, of_fit};
use i2ris_calibration::split::HoldOut;
use i2ris_emulator::snake::{Snake, SnakeConfig};
use rand::RngExt;

/// Rows a second.
const RATE_HZ: f64 = 30.0;
/// Half the range of each motor, counts.
const AMPLITUDE: f64 = 1500.0;
/// Standard deviation of a measured angle, degrees.
const NOISE_DEG: f64 = 0.05;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [snake, seconds, family, folder] = arguments.as_slice() else {
        return Err("SNAKE.toml SECONDS FAMILY FOLDER".into());
    };
    let folder = Path::new(folder);
    let file = folder.join("recording.csv");
    record(Path::new(snake), seconds.parse()?, &file)?;
    let (recording, read) = Recording::read(&file, &ColumnMap::default())?;
    let options = FitOptions {
        choice: family.parse()?,
        hold_out: HoldOut::Fraction(0.25),
        ..FitOptions::default()
    };
    let outcome = fit(&recording, &options, &Silent)?;
    let start = Instant::now();
    let text = html(&of_fit(&recording, &read, &options, &outcome));
    println!(
        "report of {} rows: {} bytes in {:.2} s",
        recording.rows().len(),
        text.len(),
        start.elapsed().as_secs_f64()
    );
    fs::write(folder.join("report.html"), text)?;
    Ok(())
}

/// Two-axis motion with reversals at many depths.
fn counts(t_s: f64) -> [f64; 2] {
    let triangle = |phase: f64| 1.0 - 4.0 * ((phase + 0.25).rem_euclid(1.0) - 0.5).abs();
    let depth = |period: f64| 0.7 - 0.3 * (TAU * t_s / period).cos();
    [
        depth(47.0) * triangle(t_s / 7.3),
        depth(61.0) * triangle(t_s / 5.1),
    ]
    .map(|share| (AMPLITUDE * share).round())
}

fn record(snake: &Path, seconds: f64, file: &Path) -> Result<(), Box<dyn Error>> {
    let mut snake = Snake::new(&SnakeConfig::load(snake)?, 1);
    let mut random = rand_pcg::Pcg64::new(7, 1);
    let mut noise = || NOISE_DEG * (0..12).map(|_| random.random::<f64>() - 0.5).sum::<f64>();
    let outputs = ["pitch", "yaw"].map(|name| OutputSpec {
        name: name.to_owned(),
        unit: OutputUnit::Deg,
    });
    let mut writer = RecordingWriter::new(fs::File::create(file)?, true, 2, &outputs)?;
    for index in 0..(seconds * RATE_HZ) as usize {
        let time = index as f64 / RATE_HZ;
        let counts = counts(time);
        snake.step(1.0 / RATE_HZ, counts);
        let [pitch, yaw] = snake.angles_deg();
        let outputs = [pitch + noise(), yaw + noise(), 0.0];
        writer.row(&Row {
            line: 0,
            time_s: Some(time),
            counts,
            outputs,
            place: 0,
        })?;
    }
    writer.finish()?;
    Ok(())
}
