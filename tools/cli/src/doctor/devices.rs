//! Devices that are plugged in. USB adapters and drives: driver, latency timer, autosuspend, name.
//! Input devices: their profiles, and the permission to read them.

use std::fs;
use std::path::{Path, PathBuf};

use i2ris_teleop::finder::{Found, known, line, scan};
use i2ris_teleop::profile::Profile;

use super::Report;

/// maxon EPOS2 on USB: an FTDI chip, for whose product number `ftdi_sio` has no entry.
const EPOS2: [&str; 2] = ["0403", "a8b0"];
const EPOS4: [&str; 2] = ["24e7", "3b01"];
const RULES: &str = "to make this permanent, install config/system/60-i2ris.rules";

/// Checks every adapter and drive on USB, as a tree such as `/sys` shows them.
pub fn check_usb(sys: &Path, report: &mut Report) {
    for device in entries(&sys.join("bus/usb/devices")) {
        let id = ["idVendor", "idProduct"].map(|name| text(&device.join(name)));
        let id = id.each_ref().map(String::as_str);
        let interfaces = interfaces(&device);
        let is_ftdi = id[0] == "0403" || interfaces.iter().any(|it| driver(it) == "ftdi_sio");
        if !is_ftdi && id != EPOS4 {
            continue;
        }
        // Other adapters only need their driver loaded.
        let (what, bind) = match id {
            EPOS2 => (
                "EPOS2",
                "modprobe ftdi_sio && echo 0403 a8b0 > /sys/bus/usb-serial/drivers/ftdi_sio/new_id",
            ),
            EPOS4 => ("EPOS4", "modprobe usbserial vendor=0x24e7 product=0x3b01"),
            _ => ("FTDI adapter", "modprobe ftdi_sio"),
        };
        let name = format!("{what} on USB {}", shown(&device));
        match interfaces.iter().find_map(|interface| port(interface)) {
            Some(port) => {
                report.pass(&name, format!("/dev/{}", shown(&port)));
                check_port(&name, &port, report);
            }
            None => report.warn(
                &name,
                "detected, but no driver has created a port for it",
                format!("sudo sh -c '{bind}'; {RULES}"),
            ),
        }
        check_device(&name, &device, report);
    }
}

fn check_port(name: &str, port: &Path, report: &mut Report) {
    let timer = port.join("latency_timer");
    let name = format!("{name} latency timer");
    match text(&timer).parse::<u32>() {
        Err(_) => {}
        Ok(0..=1) => report.pass(name, "1 ms"),
        Ok(ms) => {
            let file = format!("/sys/bus/usb-serial/devices/{}/latency_timer", shown(port));
            let found = format!("{ms} ms: about {} exchanges a second", 1000 / (ms + 2));
            report.warn(name, found, format!("echo 1 | sudo tee {file}; {RULES}"));
        }
    }
}

fn check_device(name: &str, device: &Path, report: &mut Report) {
    if text(&device.join("power/control")) == "auto" {
        let file = format!("/sys/bus/usb/devices/{}/power/control", shown(device));
        report.warn(
            format!("{name} autosuspend"),
            "on: the system may switch the device off while the line is silent",
            format!("echo on | sudo tee {file}; {RULES}"),
        );
    }
    if text(&device.join("serial")).is_empty() {
        let found = "no serial number: an identical adapter would get the same name in \
                     /dev/serial/by-id";
        report.warn(
            format!("{name} name"),
            found,
            "name it by its place: `ls -l /dev/serial/by-path`",
        );
    }
}

/// Interfaces of a device: folders in it, `1-4:1.0` in `1-4`.
fn interfaces(device: &Path) -> Vec<PathBuf> {
    entries(device).into_iter().filter(|entry| shown(entry).contains(':')).collect()
}

fn driver(interface: &Path) -> String {
    fs::read_link(interface.join("driver")).map_or_else(|_| String::new(), |to| shown(&to))
}

/// The port that a driver created for an interface: `ttyUSB0`, or `tty/ttyACM0`.
fn port(interface: &Path) -> Option<PathBuf> {
    let places = [entries(interface), entries(&interface.join("tty"))].concat();
    places.into_iter().find(|it| ["ttyUSB", "ttyACM"].iter().any(|tty| shown(it).starts_with(tty)))
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut entries: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    entries.sort();
    entries
}

fn shown(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn text(file: &Path) -> String {
    fs::read_to_string(file).unwrap_or_default().trim().to_owned()
}

/// Battery level below which a device should be charged before a trial, %.
const LOW_BATTERY: u32 = 20;

/// Checks every input device of this computer. None is required: the keyboard always works.
pub fn check_input(report: &mut Report) {
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
                    Some(left) => {
                        let found = format!("{found}, battery {left} %");
                        report.warn("input device", found, "charge it, or plug in its cable");
                    }
                }
            }
            Ok(device) => {
                let found = format!("{} at {} has no profile", device.identity, path.display());
                report.warn("input device", found, "`i2ris teleop input learn` creates a profile");
            }
            // Keyboards are readable by administrators only, so they are not reported.
            Err(_) => {}
        }
    }
    let closed = found.iter().filter(|found| found.description.is_err()).count();
    if closed > 0 && closed == found.len() {
        let found = format!("{closed} cannot be read, {}", line(&found[0], &profiles));
        let fix = "install config/system/60-i2ris.rules, then plug the device in again";
        report.warn("input devices", found, fix);
    }
}

/// Battery level, %, under `input/event7/device/device` or `hidraw/hidraw2/device`.
fn battery(classes: &Path, device: &Path) -> Option<u32> {
    let name = device.file_name()?;
    let hangs = ["input", "hidraw"].map(|class| classes.join(class).join(name).join("device"));
    let places =
        hangs.iter().flat_map(|at| [at.join("power_supply"), at.join("device/power_supply")]);
    let supplies = places.filter_map(|place| fs::read_dir(place).ok()).flatten().flatten();
    let levels =
        supplies.filter_map(|supply| fs::read_to_string(supply.path().join("capacity")).ok());
    levels.filter_map(|text| text.trim().parse().ok()).next()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plug(sys: &Path, place: &str, files: &[(&str, &str)]) {
        let device = sys.join("bus/usb/devices").join(place);
        for (name, content) in files {
            let file = device.join(name);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, format!("{content}\n")).unwrap();
        }
    }

    #[test]
    fn driver_timer_autosuspend_and_name_are_checked_with_their_fix() {
        let sys = tempfile::tempdir().unwrap();
        let sys = sys.path();
        let [epos2, epos4, adapter] =
            [["0403", "a8b0"], ["24e7", "3b01"], ["0403", "6001"]].map(|[vendor, product]| {
                [("idVendor", vendor), ("idProduct", product), ("serial", "12")]
            });
        let plug = |place, [id, product, serial]: [_; 3], more: &[_]| {
            plug(sys, place, &[&[id, product, serial], more].concat());
        };
        plug("1-1", epos2, &[("1-1:1.0/bInterfaceClass", "ff")]);
        let port = ("1-2:1.0/ttyUSB0/latency_timer", "16");
        plug("1-2", epos2, &[("serial", ""), port, ("power/control", "auto")]);
        plug("1-3", epos4, &[]);
        plug("1-4", epos4, &[("1-4:1.0/tty/ttyACM0/dev", "166:0")]);
        plug("1-5", [("idVendor", "046d"), ("idProduct", "c52b"), ("serial", "")], &[]);
        plug("1-6", adapter, &[("1-6:1.0/ttyUSB1/latency_timer", "1"), ("power/control", "on")]);
        let mut report = Report::default();
        check_usb(sys, &mut report);
        let text = report.to_string();
        for part in [
            "EPOS2 on USB 1-1                detected, but no driver",
            "echo 0403 a8b0 > /sys/bus/usb-serial/drivers/ftdi_sio/new_id",
            "EPOS2 on USB 1-2                /dev/ttyUSB0",
            "16 ms: about 55 exchanges a second",
            "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer",
            "echo on | sudo tee /sys/bus/usb/devices/1-2/power/control",
            "EPOS2 on USB 1-2 name           no serial number",
            "/dev/serial/by-path",
            "modprobe usbserial vendor=0x24e7 product=0x3b01",
            "EPOS4 on USB 1-4                /dev/ttyACM0",
            "FTDI adapter on USB 1-6 latency timer  1 ms",
        ] {
            let squeezed = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(squeezed(&text).contains(&squeezed(part)), "{part}: {text}");
        }
        assert!(!text.contains("1-5") && text.matches("WARN").count() == 5, "{text}");
    }

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
