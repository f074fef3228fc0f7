//! Finds devices, and those of a hand, by their identity, not by their number.

use std::fs;
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;

use crate::device::{Device, DeviceError};
use crate::identity::Identity;
use crate::profile::Profile;
use crate::state::{Code, Description};

const FOLDERS: [(&str, &str); 2] = [("/dev/input", "event"), ("/dev", "hidraw")];
/// The vendors of [`crate::space_mouse`].
const SPACE_MOUSE_VENDORS: [u16; 2] = [0x046d, 0x256f];

/// A device that was found.
#[derive(Debug)]
pub struct Found {
    pub path: PathBuf,
    /// Description, or the error while reading it.
    pub description: Result<Description, DeviceError>,
}

/// The files of all devices, sorted by name.
fn paths() -> Vec<PathBuf> {
    let entries = FOLDERS.into_iter().flat_map(|(folder, prefix)| {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let is_one = move |path: &PathBuf| {
            path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(prefix))
        };
        entries.map(|entry| entry.path()).filter(is_one)
    });
    let mut paths: Vec<_> = entries.collect();
    paths.sort();
    paths
}

/// All devices of this computer that a hand may hold.
pub fn scan(profiles: &[Profile]) -> Vec<Found> {
    let found = paths().into_iter().map(|path| {
        let description = Device::open(&path).map(|device| device.description().clone());
        Found { path, description }
    });
    found.filter(|found| is_for_a_hand(found, profiles)).collect()
}

/// Whether it is a known device, or may be one, unlike mice, keyboards and lids.
fn is_for_a_hand(found: &Found, profiles: &[Profile]) -> bool {
    const BTN_JOYSTICK: u16 = 0x120;
    const BTN_DIGI: u16 = 0x140;
    let is_raw = found.path.starts_with("/dev") && found.path.to_string_lossy().contains("hidraw");
    match &found.description {
        // Without permission the kind of a raw device is unknown.
        Err(_) => !is_raw,
        Ok(device) if is_raw => {
            SPACE_MOUSE_VENDORS.contains(&device.identity.vendor)
                && known(device, profiles).is_some()
        }
        Ok(device) => {
            let is_joystick = |key: &u16| (BTN_JOYSTICK..BTN_DIGI).contains(key);
            known(device, profiles).is_some() || device.keys.iter().any(is_joystick)
        }
    }
}

/// The profile of a device: the first that is for it.
pub fn known<'a>(device: &Description, profiles: &'a [Profile]) -> Option<&'a Profile> {
    profiles.iter().find(|profile| profile.is_for(&device.identity))
}

/// Reopens a lost device by its identity, under any path. `None`: it is not connected.
pub fn reopen(last: &Path, is_played: bool, identity: &Identity) -> Option<Device> {
    let is_same = |device: &Device| device.description().identity == *identity;
    if is_played {
        return Device::open_played(last, Nanos::ZERO).ok().filter(is_same);
    }
    // Not only joysticks: pedals are keyboards, and a SpaceMouse is a raw device.
    let mut all = std::iter::once(last.to_owned()).chain(paths());
    all.find_map(|path| Device::open(&path).ok().filter(is_same))
}

/// Description of a device for a list, in one line.
pub fn line(found: &Found, profiles: &[Profile]) -> String {
    let path = found.path.display();
    let device = match &found.description {
        Ok(device) => device,
        Err(error) => return error.to_string(),
    };
    if let Some(profile) = known(device, profiles) {
        return format!("{path}  {}: {}", device.identity, profile.name);
    }
    let axes = device.absolute.iter().map(|range| Code::Absolute(range.code).to_string());
    let axes = axes.collect::<Vec<_>>().join(" ");
    format!(
        "{path}  {}: unknown ({axes}); `i2ris teleop input learn {path} --output FILE` creates a \
         profile",
        device.identity
    )
}
