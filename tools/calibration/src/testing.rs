//! Recordings made up for tests.

use i2ris::model::file::{OutputSpec, OutputUnit};
use rand::RngExt;
use rand_pcg::Pcg64;

use crate::recording::{ColumnMap, Recording, RecordingWriter, Row};

/// A recording of pitch and yaw with two motors, 5 rows a second, that was written and read. `row`
/// gives counts and angles at a time.
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
    let outputs = ["pitch", "yaw"].map(|name| OutputSpec {
        name: name.to_owned(),
        unit: OutputUnit::Deg,
    });
    let mut file = tempfile::NamedTempFile::new().unwrap();
    let mut writer = RecordingWriter::new(&mut file, true, size, &outputs[..size]).unwrap();
    for index in 0..rows {
        let time = index as f64 * 0.2;
        let (counts, [pitch, yaw]) = row(time);
        writer
            .row(&Row {
                line: 0,
                time_s: Some(time),
                counts,
                outputs: [pitch, yaw, 0.0],
                place: 0,
            })
            .unwrap();
    }
    writer.finish().unwrap();
    Recording::read(file.path(), &ColumnMap::default())
        .unwrap()
        .0
}

/// Noise of standard deviation 1, nearly Gaussian: the sum of twelve uniform numbers.
pub(crate) fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Pcg64::new(u128::from(seed), 1);
    move || (0..12).map(|_| random.random::<f64>() - 0.5).sum()
}

/// Two motors on their way through the plane with many reversals.
pub(crate) fn wander(time: f64) -> [f64; 2] {
    let (slow, fast) = (300.0, 150.0);
    [
        (slow * (0.31 * time).sin() + fast * (1.13 * time).sin()).round(),
        (slow * (0.23 * time + 1.0).cos() + fast * (0.97 * time).sin()).round(),
    ]
}

/// What a straight model makes of counts.
pub(crate) fn straight([a, b]: [f64; 2]) -> [f64; 2] {
    [0.02 * a - 0.015 * b + 2.0, 0.015 * a + 0.02 * b - 5.0]
}
