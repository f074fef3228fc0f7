//! How numbers look as JSON.

use i2ris::core::adaptation::PARAMETERS;
use i2ris::units::Nanos;
use serde::{Serialize, Serializer};

/// Three digits.
pub fn short(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

pub fn pair<S: Serializer>(pair: &Option<[f64; 2]>, serializer: S) -> Result<S::Ok, S::Error> {
    pair.map(|pair| pair.map(short)).serialize(serializer)
}

pub fn tenth<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64((value * 10.0).round() / 10.0)
}

/// Six digits.
pub fn drift<S: Serializer>(values: &[f64; PARAMETERS], serializer: S) -> Result<S::Ok, S::Error> {
    values.map(|value| (1e6 * value).round() / 1e6).serialize(serializer)
}

pub fn milliseconds<S: Serializer>(age: &Option<Nanos>, serializer: S) -> Result<S::Ok, S::Error> {
    age.map(|age| age.0 / 1_000_000).serialize(serializer)
}
