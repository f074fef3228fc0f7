//! Variants of drives: models and versions of firmware differ in their objects and ranges, and only
//! the drive itself knows its own.

use std::fmt;

use crate::drive::abort_code::AbortCode;
use crate::drive::object::Setting;
use crate::drive::objects::{self, Entry};

/// Names of models by the upper half of the product code.
const MODELS: [(u32, &str); 5] =
    [(0x6050, "24/1.5"), (0x6150, "50/5"), (0x6420, "70/10"), (0x6551, "50/8"), (0x6552, "50/15")];

/// A drive as messages name it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DriveModel {
    /// Name of the family.
    pub family: &'static str,
    pub product_code: u32,
    /// Firmware version, in hexadecimal as maxon writes it.
    pub firmware: u16,
}

impl fmt::Display for DriveModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.family)?;
        match (self.product_code >> 16, self.product_code) {
            (_, 0) => {}
            (upper, code) => match MODELS.iter().find(|(model, _)| *model == upper) {
                Some((_, name)) => write!(f, " {name}")?,
                None => write!(f, ", product 0x{code:08X}")?,
            },
        }
        write!(f, ", firmware 0x{:04X}", self.firmware)
    }
}

/// A setting that a drive does not take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SettingError {
    pub setting: Setting,
    pub drive: DriveModel,
    pub why: SettingRefusal,
}

/// Why a drive does not accept a setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SettingRefusal {
    /// Maximum value that it accepts.
    AtMost(i64),
    /// Minimum value that it accepts.
    AtLeast(i64),
    /// It refuses to write the object.
    Refused(AbortCode),
    /// It does not have the object.
    Missing,
    /// It acknowledges the value but keeps this one.
    Keeps(i64),
}

impl fmt::Display for SettingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { setting, drive, why } = self;
        let object = setting.object;
        let Entry { kind, key, since, .. } = *objects::first(object.index, object.subindex);
        let name = if key.is_empty() { object.name } else { key };
        write!(f, "`{name} = {}`: this drive ({drive}) ", kind.decode(setting.raw))?;
        match why {
            SettingRefusal::AtMost(most) => write!(f, "takes at most {most} in {object}")?,
            SettingRefusal::AtLeast(least) => write!(f, "takes at least {least} in {object}")?,
            SettingRefusal::Refused(code) => write!(f, "refuses {object}: {code}")?,
            SettingRefusal::Missing => write!(f, "has no {object}")?,
            SettingRefusal::Keeps(kept) => write!(f, "keeps {kept} in {object}")?,
        }
        match (why, key.is_empty()) {
            (SettingRefusal::Missing, _) if since > drive.firmware => {
                write!(f, "; firmware 0x{since:04X} has it: update the drive")
            }
            (SettingRefusal::Missing, _) => f.write_str("; use another firmware, or another drive"),
            (_, false) => write!(f, "; correct `{key}` in the configuration"),
            (_, true) => f.write_str("; the controller needs this value: use another firmware"),
        }
    }
}
