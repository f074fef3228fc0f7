//! What a hand may hold: input devices, their profiles, and the permission to read them.

use i2ris_teleop::finder::{Found, known, line, scan};
use i2ris_teleop::profile::Profile;

use super::report::Report;

/// Checks every input device of this computer. None is no fault: there is the keyboard.
pub fn check(report: &mut Report) {
    let profiles: Vec<_> = Profile::shipped().collect();
    let found = scan(&profiles);
    if found.is_empty() {
        report.pass("input devices", "none is plugged in; `i2ris teleop --keyboard` needs none");
    }
    for Found { path, description } in &found {
        match description {
            Ok(device) if known(device, &profiles).is_some() => {
                report.pass("input device", format!("{} at {}", device.identity, path.display()));
            }
            Ok(device) => report.warn(
                "input device",
                format!("{} at {} is not known", device.identity, path.display()),
                "`i2ris input learn` asks what its controls are",
            ),
            // Every keyboard is closed to who is no administrator: that is no news.
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
