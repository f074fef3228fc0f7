//! The fingerprint of a drive: all its settings, and the comparison of two fingerprints.
//!
//! Reads only. A model belongs to the settings of its calibration: with another gear, encoder or
//! gain, the same counts bend the snake differently.

use std::collections::BTreeSet;

use crate::config::{AxisConfig, Family, PortConfig};
use crate::drive::bring_up::{DriveNode, explain, learn_constants};
use crate::drive::error::{AxisError, DriveError, LinkError};
use crate::drive::family_selection::{family_of_axis, family_of_line, family_of_port};
use crate::drive::link::DriveLink;
use crate::drive::object::{AbortCode, Address};
use crate::drive::objects::{self, Access, Entry};
use crate::drive::serial_transport::SerialTransport;
use crate::drive::transport::Transport;
use crate::robot::DriveFingerprint;
use crate::units::Counts;

/// Objects, all subindices, on which a model depends: encoder, gear, motor, gains. What the
/// configuration writes of them does not count: a raised limit makes no other drive.
const OF_MODEL: [u16; 13] = [
    0x2210, 0x2230, 0x3000, 0x3001, 0x3003, 0x3010, 0x30A0, 0x30A1, 0x30A2, 0x60F6, 0x60F9, 0x60FB,
    0x6410,
];

/// The object as a key of a fingerprint.
pub fn key(entry: &Entry) -> String {
    format!("0x{:04X}:{:02X}", entry.index, entry.subindex)
}

/// The settings of a family that can be read in one transfer.
pub fn settings(family: Family) -> impl Iterator<Item = &'static Entry> {
    objects::of_family(family).filter(|entry| {
        // What can be read and written, and keeps its value.
        let is_setting = entry.access == Access::Rw && !entry.live;
        is_setting && (1..=4).contains(&entry.kind.size())
    })
}

/// Opens a port and reads every setting of its drives. Writes nothing. Fails when the port cannot
/// be opened, nothing answers, or a drive is not the configured one.
pub fn read_port(config: &PortConfig) -> Result<Vec<DriveFingerprint>, DriveError> {
    read_transport(SerialTransport::open(config)?, config)
}

/// Reads the settings over an open line, see [`read_port`].
pub fn read_transport<T: Transport>(
    transport: T,
    config: &PortConfig,
) -> Result<Vec<DriveFingerprint>, DriveError> {
    let mut link = DriveLink::new(transport, family_of_port(config), config);
    if let Some(first) = config.axes.first() {
        learn_constants(&mut link).map_err(|error| explain(config, first, error))?;
    }
    read_axes(&mut link, config)
}

/// Reads the settings on a line whose constants are known, see [`read_port`].
pub fn read_axes(
    link: &mut DriveLink<impl Transport>,
    config: &PortConfig,
) -> Result<Vec<DriveFingerprint>, DriveError> {
    let axes = config.axes.iter();
    axes.map(|axis| read_axis(link, config, axis).map_err(|error| explain(config, axis, error)))
        .collect()
}

fn read_axis(
    link: &mut DriveLink<impl Transport>,
    config: &PortConfig,
    axis: &AxisConfig,
) -> Result<DriveFingerprint, AxisError> {
    let family = family_of_axis(config, axis);
    let mut drive = DriveNode::new(link, axis.node_id);
    drive.check_identity(axis.serial_number)?;
    let firmware = drive.read_firmware(family.object_map().firmware_version)?;
    let mut fingerprint = DriveFingerprint {
        motor: axis.motor,
        family: family.name().to_owned(),
        firmware: format!("{firmware:04X}"),
        serial_number: axis.short_serial_number(),
        settings: [].into(),
    };
    for entry in settings(axis.family.unwrap_or(config.family)) {
        match drive.read_if_present(Address::from_entry(entry)) {
            Ok(Some(raw)) => drop(fingerprint.settings.insert(key(entry), entry.kind.decode(raw))),
            Ok(None) => {}
            // An unreadable setting must not prevent the start.
            Err(AxisError::Exchange { error: LinkError::Refused(code), .. })
                if code != AbortCode::NO_NODE => {}
            Err(error) => return Err(error),
        }
    }
    Ok(fingerprint)
}

/// All settings that differ, with both values; `of_model`: those that a model depends on.
pub fn differences(
    before: &DriveFingerprint,
    after: &DriveFingerprint,
    of_model: bool,
) -> Vec<String> {
    let keys: BTreeSet<&String> = before.settings.keys().chain(after.settings.keys()).collect();
    let difference = |key: &String| {
        let values = [before, after].map(|drive| drive.settings.get(key));
        let is_asked = !of_model || is_of_model(key) && values.iter().all(Option::is_some);
        if values[0] == values[1] || !is_asked {
            return None;
        }
        let [old, new] = values.map(|it| it.map_or_else(|| "absent".to_owned(), i64::to_string));
        Some(format!("motor {}: {} ({key}) {old} -> {new}", before.motor, name(before, key)))
    };
    keys.into_iter().filter_map(difference).collect()
}

/// Keys of what the configuration writes into a drive.
fn settings_written(family: Family) -> impl Iterator<Item = String> {
    let written = family_of_line(family).settings(&AxisConfig::new(0, 0, [Counts(0); 2]));
    written.into_iter().map(|it| format!("0x{:04X}:{:02X}", it.object.index, it.object.subindex))
}

fn is_of_model(key: &str) -> bool {
    let index = key.get(2..6).and_then(|index| u16::from_str_radix(index, 16).ok());
    let is_written = |family| settings_written(family).any(|it| key == it);
    index.is_some_and(|index| OF_MODEL.contains(&index))
        && ![Family::Epos4, Family::Epos2].into_iter().any(is_written)
}

fn name(drive: &DriveFingerprint, key: &str) -> &'static str {
    let of_name = |it: &Family| format!("{it:?}").eq_ignore_ascii_case(&drive.family);
    let family = [Family::Epos4, Family::Epos2].into_iter().find(of_name);
    let entry = family.and_then(|family| settings(family).find(|entry| self::key(entry) == key));
    entry.map_or("object", |entry| entry.name)
}

/// Settings that differ from those of the calibration: those that a model depends on, of the
/// drives of its motors, where both values are known.
pub fn differences_of_model(
    calibrated: &[DriveFingerprint],
    present: &[DriveFingerprint],
    motors: usize,
) -> Vec<String> {
    let mut found = Vec::new();
    for before in calibrated.iter().filter(|drive| drive.motor < motors) {
        match present.iter().find(|after| after.motor == before.motor) {
            Some(after) if after.family == before.family => {
                found.extend(differences(before, after, true));
            }
            Some(DriveFingerprint { motor, family, .. }) => {
                found.push(format!("motor {motor}: family {} -> {family}", before.family));
            }
            None => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use std::slice::from_ref;

    use super::*;

    /// A drive with the defaults of its family.
    fn drive(family: Family) -> DriveFingerprint {
        DriveFingerprint {
            motor: 1,
            family: format!("{family:?}").to_uppercase(),
            firmware: "0170".to_owned(),
            serial_number: 7,
            settings: settings(family).map(|entry| (key(entry), entry.default)).collect(),
        }
    }

    #[test]
    fn any_setting_that_is_changed_by_one_is_named() {
        for family in [Family::Epos4, Family::Epos2] {
            let before = drive(family);
            assert!(before.settings.len() >= 40 && differences(&before, &before, false).is_empty());
            for entry in settings(family) {
                let mut after = before.clone();
                *after.settings.get_mut(&key(entry)).unwrap() += 1;
                let [text] = &differences(&before, &after, false)[..] else {
                    panic!("{}", entry.name)
                };
                let (name, value) = (entry.name, entry.default);
                let expected = format!("motor 1: {name} ({}) {value} -> {}", key(entry), value + 1);
                assert_eq!(text, &expected);
                let of_model = differences_of_model(from_ref(&before), from_ref(&after), 2);
                let is_limit = [(0x3001, 2), (0x6410, 2), (0x6410, 4)]
                    .contains(&(entry.index, entry.subindex));
                let counts = OF_MODEL.contains(&entry.index) && !is_limit;
                assert_eq!(of_model.len(), usize::from(counts), "{text}");
                assert!(differences_of_model(from_ref(&before), from_ref(&after), 1).is_empty());
                after.settings.remove(&key(entry));
                assert!(differences(&before, &after, false)[0].ends_with("-> absent"));
                assert!(differences_of_model(from_ref(&before), &[after], 2).is_empty());
            }
        }
        let (old, new) = (drive(Family::Epos4), drive(Family::Epos2));
        assert_eq!(differences_of_model(&[old], &[new], 2).len(), 1);
    }
}
