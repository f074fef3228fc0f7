//! The columns of a data set, and what a row has in them.

use serde_json::{Value, json};

use super::recorded::{Moment, Row};
use super::table::{Cell, Column, Kind};

/// A column of numbers or texts that a row of a recording fills.
pub struct Feature {
    pub name: &'static str,
    pub kind: Kind,
    /// Of its values; empty for texts.
    pub entries: &'static [&'static str],
    /// For readers of the data.
    pub about: &'static str,
}

const fn feature(
    name: &'static str,
    kind: Kind,
    entries: &'static [&'static str],
    about: &'static str,
) -> Feature {
    Feature { name, kind, entries, about }
}

/// In the order of [`cells`].
pub const FEATURES: [Feature; 10] = [
    feature(
        "observation.state",
        Kind::Float,
        &[
            "pitch_rad",
            "yaw_rad",
            "pitch_deviation_rad",
            "yaw_deviation_rad",
            "memory_known",
            "motor_0_counts",
            "motor_1_counts",
        ],
        "The model's estimate from the encoders, its standard deviation, whether the hysteresis \
         memory is known (1), and the encoders",
    ),
    feature(
        "action",
        Kind::Float,
        &["pitch_rad", "yaw_rad"],
        "The goal, after all limits of the controller: absolute",
    ),
    feature(
        "action.tip_motion",
        Kind::Float,
        &["right_m", "up_m"],
        "How the goal of the tip moves in the picture until the next row: relative; 0 in the last",
    ),
    feature(
        "ground_truth.camera",
        Kind::Float,
        &["pitch_rad", "yaw_rad", "valid"],
        "Angles by the camera; without one near, all three are 0",
    ),
    feature("observation.meta.model_id", Kind::Text, &[], "SHA-256 of the model of the estimate"),
    feature("observation.meta.fixtures", Kind::Text, &[], "Regions that the tip may not enter"),
    feature(
        "observation.meta.fixture_limits",
        Kind::Float,
        &["fixture_limits"],
        "1: a region limited the goal",
    ),
    feature(
        "observation.meta.clutch",
        Kind::Text,
        &[],
        "`closed`: a hand steers; `open`: it rests; `none`: no hand is there",
    ),
    feature(
        "observation.meta.stamp_ns",
        Kind::Integer,
        &["stamp_ns"],
        "When the row was, on the monotonic clock of the recording",
    ),
    feature(
        "observation.meta.jitter_s",
        Kind::Float,
        &["jitter_s"],
        "stamp_ns less the time that `timestamp` (index / fps) says: what resampling left",
    ),
];

/// What every data set of LeRobot has behind them.
pub const INDEX: [(&str, Kind); 5] = [
    ("timestamp", Kind::Float),
    ("frame_index", Kind::Integer),
    ("episode_index", Kind::Integer),
    ("index", Kind::Integer),
    ("task_index", Kind::Integer),
];

/// What a row has in [`FEATURES`].
pub fn cells(row: &Row, moment: &Moment, tip_motion: [f64; 2]) -> Vec<Cell> {
    let truth = |is| f64::from(u8::from(is));
    let mut state = moment.estimate.to_vec();
    state.push(truth(moment.is_memory_known));
    state.extend(moment.counts);
    let [pitch, yaw] = moment.camera.unwrap_or_default();
    let clutch = match moment.is_clutch_open {
        None => "none",
        Some(true) => "open",
        Some(false) => "closed",
    };
    vec![
        Cell::Numbers(state),
        Cell::Numbers(moment.goal.to_vec()),
        Cell::Numbers(tip_motion.to_vec()),
        Cell::Numbers(vec![pitch, yaw, truth(moment.camera.is_some())]),
        Cell::Text(moment.model.map(|byte| format!("{byte:02x}")).concat()),
        Cell::Text(moment.fixtures.clone()),
        Cell::Numbers(vec![truth(moment.is_limited)]),
        Cell::Text(clutch.to_owned()),
        Cell::Integer(row.stamp_ns.cast_signed()),
        Cell::Numbers(vec![row.jitter_s]),
    ]
}

impl Feature {
    pub fn column(&self) -> Column {
        let shape: &[usize] = if self.entries.len() > 1 { &[self.entries.len()] } else { &[] };
        Column::new(self.name, self.kind, shape)
    }
}

/// The name of a type in LeRobot and in Hugging Face's `datasets`.
pub fn dtype(kind: Kind) -> &'static str {
    match kind {
        Kind::Float => "float32",
        Kind::Double => "float64",
        Kind::Integer => "int64",
        Kind::Text => "string",
        Kind::Picture => "image",
    }
}

/// How `datasets` describes a column.
pub fn described(column: &Column) -> Value {
    let value = json!({ "dtype": dtype(column.kind), "_type": "Value" });
    match (column.kind, column.shape.as_slice()) {
        (Kind::Picture, _) => json!({ "_type": "Image" }),
        (_, [length]) => json!({ "feature": value, "length": length, "_type": "Sequence" }),
        _ => value,
    }
}
