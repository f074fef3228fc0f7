//! The settings of a drive: numbers that decide how it moves its motor.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Every setting of a drive that can be read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveFingerprint {
    /// Index of its motor.
    pub motor: usize,
    /// Its family, `EPOS2` or `EPOS4`.
    pub family: String,
    /// Version of the firmware, in hexadecimal as maxon writes it.
    pub firmware: String,
    /// Serial number.
    pub serial_number: u32,
    /// Values by object, such as `0x3001:02`. Objects that the drive does not have are absent.
    pub settings: BTreeMap<String, i64>,
}
