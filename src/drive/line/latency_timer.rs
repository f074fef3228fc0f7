//! The latency timer of FTDI adapters.
//!
//! These chips delay short replies until the timer expires, after 16 ms by default. This limits the
//! line to about 60 exchanges per second. Linux shows the timer as a file under `/sys`.

use std::fs;
use std::path::{Path, PathBuf};

/// The system lists serial adapters on USB here.
const ADAPTERS: &str = "/sys/bus/usb-serial/devices";

/// The shortest setting, milliseconds.
const MIN_TIMER_MS: u32 = 1;

/// Shortens the timer if there is one and it is permitted; returns the setting in force. A udev
/// rule makes it permanent, see the README.
pub fn shorten(device: &Path) -> Option<u32> {
    shorten_at(&file(Path::new(ADAPTERS), device)?)
}

/// The command that shortens the timer of a device.
pub fn command(device: &Path) -> String {
    let real = fs::canonicalize(device).unwrap_or_else(|_| device.to_owned());
    let name = real.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let name = if name.starts_with("ttyUSB") { name } else { "ttyUSB0" };
    format!("echo {MIN_TIMER_MS} | sudo tee {ADAPTERS}/{name}/latency_timer")
}

/// The file of the timer. The device may be a link such as those in `/dev/serial/by-id`.
fn file(adapters: &Path, device: &Path) -> Option<PathBuf> {
    let device = fs::canonicalize(device).ok()?;
    let file = adapters.join(device.file_name()?).join("latency_timer");
    file.exists().then_some(file)
}

fn read_from(file: &Path) -> Option<u32> {
    fs::read_to_string(file).ok()?.trim().parse().ok()
}

fn shorten_at(file: &Path) -> Option<u32> {
    let found = read_from(file)?;
    if found > MIN_TIMER_MS {
        // Without permission this fails; the setting in force is read back.
        let _ = fs::write(file, MIN_TIMER_MS.to_string());
    }
    read_from(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_timer_is_found_behind_a_link_and_shortened() {
        let base = tempfile::tempdir().unwrap();
        let (adapters, device) = (base.path().join("adapters"), base.path().join("ttyUSB3"));
        fs::create_dir_all(adapters.join("ttyUSB3")).unwrap();
        fs::write(&device, "").unwrap();
        let link = base.path().join("by-id");
        std::os::unix::fs::symlink(&device, &link).unwrap();
        assert_eq!(file(&adapters, &link), None, "an adapter without a timer");
        let timer = adapters.join("ttyUSB3/latency_timer");
        fs::write(&timer, "16\n").unwrap();
        let found = file(&adapters, &link).unwrap();
        assert_eq!(read_from(&found), Some(16));
        assert_eq!(shorten_at(&found), Some(1));
        assert_eq!(read_from(&timer), Some(1));
        assert!(command(&link).ends_with(" /sys/bus/usb-serial/devices/ttyUSB3/latency_timer"));
    }

    #[test]
    fn other_devices_have_no_latency_timer() {
        assert_eq!(shorten(Path::new("/dev/null")), None);
        assert_eq!(shorten(Path::new("/dev/i2ris-no-such-port")), None);
    }
}
