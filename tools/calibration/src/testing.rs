//! Recordings and assertions for tests.

use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use rand::RngExt;
use rand_pcg::Pcg64;

use crate::em::EmOptions;
use crate::recording::{ColumnMap, Recording, RecordingWriter, Row};

/// A recording of pitch and yaw with two motors, 5 rows a second, written and read.
pub(crate) fn recording(rows: usize, row: impl FnMut(f64) -> ([f64; 2], [f64; 2])) -> Recording {
    recorded(rows, 2, row)
}

/// The same with the first motor and pitch only.
pub(crate) fn one_motor(rows: usize, mut row: impl FnMut(f64) -> (f64, f64)) -> Recording {
    recorded(rows, 1, |time| {
        let (count, angle) = row(time);
        ([count, 0.0], [angle, 0.0])
    })
}

fn recorded(
    rows: usize,
    size: usize,
    mut row: impl FnMut(f64) -> ([f64; 2], [f64; 2]),
) -> Recording {
    let outputs = ["pitch", "yaw"].map(degrees);
    let mut file = tempfile::NamedTempFile::new().unwrap();
    let mut writer = RecordingWriter::new(&mut file, true, size, &outputs[..size]).unwrap();
    for index in 0..rows {
        let time = index as f64 * 0.2;
        let (counts, [pitch, yaw]) = row(time);
        writer.row(&Row::new(Some(time), counts, [pitch, yaw, 0.0])).unwrap();
    }
    writer.finish().unwrap();
    Recording::read(file.path(), &ColumnMap::default()).unwrap().0
}

pub(crate) fn degrees(name: &str) -> OutputSpec {
    OutputSpec { name: name.to_owned(), unit: OutputUnit::Deg }
}

/// Two motors on a circle about a centre, 2 rad per 4 s.
pub(crate) fn circle(rows: usize) -> Recording {
    recording(rows, |time| {
        let counts = [350.0 * (0.5 * time).cos(), 350.0 * (0.5 * time).sin()];
        (counts, straight(counts))
    })
}

/// Two motors with many reversals, and a straight snake without noise.
pub(crate) fn wandering(rows: usize) -> Recording {
    recording(rows, |time| (wander(time), straight(wander(time))))
}

/// A snake that bends less and less, with noise of 0.05 deg.
pub(crate) fn bent(rows: usize) -> Recording {
    let mut random = noise(1);
    recording(rows, |time| {
        let bend = |angle: f64| 12.0 * (angle / 12.0).tanh() + 0.05 * random();
        (wander(time), straight(wander(time)).map(bend))
    })
}

/// Noise of standard deviation 1, nearly Gaussian: the sum of twelve uniform numbers.
pub(crate) fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Pcg64::new(u128::from(seed), 1);
    move || (0..12).map(|_| random.random::<f64>() - 0.5).sum()
}

/// Counts of two motors on a path through the plane with many reversals.
pub(crate) fn wander(time: f64) -> [f64; 2] {
    let (slow, fast) = (300.0, 150.0);
    [
        (slow * (0.31 * time).sin() + fast * (1.13 * time).sin()).round(),
        (slow * (0.23 * time + 1.0).cos() + fast * (0.97 * time).sin()).round(),
    ]
}

pub(crate) fn straight([a, b]: [f64; 2]) -> [f64; 2] {
    [0.02 * a - 0.015 * b + 2.0, 0.015 * a + 0.02 * b - 5.0]
}

/// Moves plays of a half-width with the counts.
pub(crate) fn play<const N: usize>(played: &mut [f64; N], counts: [f64; N], half: f64) {
    for (played, counts) in played.iter_mut().zip(counts) {
        *played = played.clamp(counts - half, counts + half);
    }
}

/// Parameters of plays of single motors.
pub(crate) fn plays_of(thresholds: Vec<Vec<f64>>, weights: Vec<Vec<f64>>) -> PlayParameters {
    let (thresholds_counts, planar_thresholds_counts) = (thresholds, Vec::new());
    PlayParameters { thresholds_counts, weights, planar_thresholds_counts }
}

/// Options for tests that need only a few starts.
pub(crate) fn few_starts(restarts: usize) -> EmOptions {
    EmOptions { restarts, ..EmOptions::default() }
}

pub(crate) fn with_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(run)
}

#[track_caller]
pub(crate) fn assert_near(found: f64, expected: f64, tolerance: f64) {
    let near = (found - expected).abs() <= tolerance;
    assert!(near, "{found} instead of {expected} +- {tolerance}");
}

#[track_caller]
pub(crate) fn assert_contains(text: &dyn std::fmt::Display, parts: &[&str]) {
    let text = text.to_string();
    for part in parts {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}
