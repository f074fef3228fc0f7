//! Input devices, their profiles, and the permission to read them.

use std::fs;
use std::path::Path;

use i2ris_teleop::finder::{Found, known, line, scan};
use i2ris_teleop::profile::Profile;

use super::report::Report;

/// Battery level below which a device should be charged before a trial, %.
const LOW_BATTERY: u32 = 20;

/// Checks every input device of this computer. None is required: the keyboard always works.
pub fn check(report: &mut Report) {
    let profiles: Vec<_> = Profile::shipped().collect();
    let found = scan(&profiles);
    if found.is_empty() {
        report.pass("input devices", "none plugged in; `i2ris teleop --keyboard` needs none");
    }
    for Found { path, description } in &found {
        match description {
            Ok(device) if known(device, &profiles).is_some() => {
                let found = format!("{} at {}", device.identity, path.display());
                match battery(Path::new("/sys/class"), path) {
                    None => report.pass("input device", found),
                    Some(left) if left >= LOW_BATTERY => {
                        report.pass("input device", format!("{found}, battery {left} %"));
                    }
                    Some(left) => report.warn(
                        "input device",
                        format!("{found}, battery {left} %"),
                        "charge it, or plug in its cable",
                    ),
                }
            }
            Ok(device) => report.warn(
                "input device",
                format!("{} at {} has no profile", device.identity, path.display()),
                "`i2ris teleop input learn` creates a profile",
            ),
            // Keyboards are readable by administrators only, so they are not reported.
            Err(_) => {}
        }
    }
    let closed = found.iter().filter(|found| found.description.is_err()).count();
    if closed > 0 && closed == found.len() {
        report.warn(
            "input devices",
            format!("{closed} cannot be read, {}", line(&found[0], &profiles)),
            "install config/system/60-i2ris.rules, then plug the device in again",
        );
    }
}

/// Battery level of a device, %, if the kernel reports it, under `input/event7/device/device` or
/// `hidraw/hidraw2/device`.
fn battery(classes: &Path, device: &Path) -> Option<u32> {
    let name = device.file_name()?;
    let hangs = ["input", "hidraw"].map(|class| classes.join(class).join(name).join("device"));
    let places =
        hangs.iter().flat_map(|at| [at.join("power_supply"), at.join("device/power_supply")]);
    let supplies = places.filter_map(|place| fs::read_dir(place).ok()).flatten().flatten();
    let left =
        supplies.filter_map(|supply| fs::read_to_string(supply.path().join("capacity")).ok());
    left.filter_map(|text| text.trim().parse().ok()).next()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn battery_level_is_read_from_the_kernel() {
        let classes = tempfile::tempdir().unwrap();
        for (place, left) in [
            ("input/event7/device/device/power_supply/ps-controller-battery-1", "15\n"),
            ("hidraw/hidraw2/device/power_supply/hidpp_battery_0", "80\n"),
        ] {
            let folder = classes.path().join(place);
            fs::create_dir_all(&folder).unwrap();
            fs::write(folder.join("capacity"), left).unwrap();
        }
        let left = |path: &str| battery(classes.path(), Path::new(path));
        assert_eq!(left("/dev/input/event7"), Some(15));
        assert_eq!(left("/dev/hidraw2"), Some(80));
        assert_eq!(left("/dev/input/event8"), None);
    }
}
