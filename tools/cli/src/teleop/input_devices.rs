//! Input devices: found, opened, read together, and found again after a loss.

use std::fs;
use std::path::{Path, PathBuf};

use i2ris::clock;
use i2ris::units::Nanos;
use i2ris_report::{Failure, bail};
use i2ris_teleop::clutch::Clutch;
use i2ris_teleop::control::{Control, Fault, Reading};
use i2ris_teleop::device::Device;
use i2ris_teleop::finder::{self, Found, known, reopen, scan};
use i2ris_teleop::identity::Identity;
use i2ris_teleop::profile::{Handedness, Profile};
use i2ris_teleop::state::Protocol;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use super::source::{HandRequest, Source, SourceLost};

/// Search period for a lost device.
const SEARCH: Nanos = Nanos::from_millis(500);

/// Profiles of these files, then the shipped ones.
pub fn profiles(files: &[PathBuf]) -> Result<Vec<Profile>, Failure> {
    let mut profiles = Vec::new();
    for file in files {
        let named = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
        let text = fs::read_to_string(file).map_err(|error| named(&error))?;
        profiles.push(Profile::parse(&text).map_err(|error| named(&error))?);
    }
    profiles.extend(Profile::shipped());
    Ok(profiles)
}

fn gone() -> Reading {
    Reading { fault: Some(Fault::Gone), ..Reading::default() }
}

struct Part {
    /// `None` while it is disconnected.
    device: Option<Device>,
    path: PathBuf,
    is_played: bool,
    identity: Identity,
    control: Control,
    next_search: Nanos,
}

/// All input devices in use.
pub(super) struct InputDevices {
    parts: Vec<Part>,
    clutch: Clutch,
    pulses: bool,
    news: Vec<String>,
}

impl InputDevices {
    /// Opens `/dev/input/event*`, `/dev/hidraw*`, or pipes through which recordings are played;
    /// without any, the known devices. Profiles of these files come before the shipped ones.
    pub fn open(
        mut devices: Vec<PathBuf>,
        profile_files: &[PathBuf],
        held_in: Handedness,
        pulses: bool,
    ) -> Result<Self, Failure> {
        let profiles = profiles(profile_files)?;
        if devices.is_empty() {
            devices = only_known(&scan(&profiles), &profiles)?;
        }
        let open = |path: &PathBuf| Part::open(path, &profiles, held_in);
        let mut parts = devices.iter().map(open).collect::<Result<Vec<_>, _>>()?;
        if !parts.iter().any(|part| part.control.has_axes()) {
            bail!("no steering device: a pedal alone moves nothing");
        }
        if !parts.iter().any(|part| part.control.has_dead_man()) {
            bail!(
                "no dead-man: name one in the profile, or add a pedal with a second \
                        --device"
            );
        }
        let mut news = Vec::new();
        if pulses && !parts.iter_mut().any(Part::can_pulse) {
            news.push("none of these devices can pulse: limits cannot be felt".to_owned());
        }
        Ok(Self { parts, clutch: Clutch::default(), pulses, news })
    }
}

/// The known steering device, and a known pedal. Fails if there are several, or none.
///
/// One device has several files: a DualSense has pad, sensors and touchpad, a pedal keys and mouse,
/// a SpaceMouse reports and events. Only a file with all controls of the profile is used, and
/// reports are preferred to events.
fn only_known(found: &[Found], profiles: &[Profile]) -> Result<Vec<PathBuf>, Failure> {
    let list = found.iter().map(|found| format!("\n  {}", finder::line(found, profiles)));
    let list = list.collect::<String>();
    let has_reports = |product| {
        found.iter().filter_map(|found| found.description.as_ref().ok()).any(|device| {
            device.protocol == Protocol::SpaceMouse && device.identity.product_id() == product
        })
    };
    let steers = |found: &&Found| {
        let device = found.description.as_ref().ok()?;
        let controls = known(device, profiles)?.controls(device, Handedness::Right).ok()?;
        let is_second = device.protocol == Protocol::Evdev;
        (!(is_second && has_reports(device.identity.product_id())))
            .then_some(controls.axes.is_some())
    };
    let is = |wanted: bool| found.iter().filter(move |found| steers(found) == Some(wanted));
    let [steering] = is(true).collect::<Vec<_>>()[..] else {
        let how_many = if is(true).count() == 0 { "no" } else { "more than one" };
        bail!(
            "{how_many} known device is plugged in; name one with --device, or steer with \
             --keyboard{list}"
        );
    };
    let pedals: Vec<_> = is(false).map(|found| found.path.clone()).collect();
    if pedals.len() > 1 {
        bail!("more than one pedal is plugged in; name all with --device{list}");
    }
    Ok([vec![steering.path.clone()], pedals].concat())
}

impl Part {
    fn open(path: &Path, profiles: &[Profile], hand: Handedness) -> Result<Self, Failure> {
        let mut device = Device::open(path)?;
        let description = device.description();
        let profile = known(description, profiles).ok_or_else(|| {
            let path = path.display();
            format!(
                "{path}: {} has no profile: create one by `i2ris teleop input learn {path} \
                 --output mine.toml`, then add --profile mine.toml",
                description.identity
            )
        })?;
        let controls = profile.controls(description, hand)?;
        device.grab()?;
        Ok(Self {
            path: path.to_owned(),
            is_played: device.is_played(),
            identity: device.description().identity.clone(),
            control: Control::new(profile, controls),
            device: Some(device),
            next_search: Nanos::ZERO,
        })
    }

    /// The reading, and a message to print.
    fn read(&mut self, now: Nanos) -> (Reading, Option<String>) {
        let Some(device) = &mut self.device else {
            return (gone(), self.search(now));
        };
        if let Err(error) = device.read(now, |_| {}) {
            self.device = None;
            self.next_search = now + SEARCH;
            return (gone(), Some(format!("{error}; the snake holds until it is reconnected")));
        }
        let (description, state) = device.parts();
        (self.control.read(description, state, now), None)
    }

    fn can_pulse(&mut self) -> bool {
        self.device.as_mut().is_some_and(Device::can_pulse)
    }

    fn search(&mut self, now: Nanos) -> Option<String> {
        if now < self.next_search {
            return None;
        }
        self.next_search = now + SEARCH;
        let mut device = reopen(&self.path, self.is_played, &self.identity)?;
        device.grab().ok()?;
        self.path = device.path().to_owned();
        self.device = Some(device);
        Some(format!("{} reconnected at {}", self.identity, self.path.display()))
    }
}

impl Source for InputDevices {
    fn read(&mut self, now: Nanos) -> Result<HandRequest, SourceLost> {
        let mut readings = Vec::with_capacity(self.parts.len());
        for part in &mut self.parts {
            let was_gone = part.device.is_none();
            let (reading, news) = part.read(now);
            if self.pulses && was_gone {
                part.can_pulse();
            }
            self.news.extend(news);
            readings.push((part.control.has_axes(), reading));
        }
        let hand = self.clutch.update(&readings);
        Ok(HandRequest { hand, ..HandRequest::default() })
    }

    fn wait(&mut self, until: Nanos) {
        let devices = self.parts.iter().filter_map(|part| part.device.as_ref());
        let mut ready: Vec<_> = devices
            .map(|device| PollFd::new(std::os::fd::AsFd::as_fd(device), PollFlags::POLLIN))
            .collect();
        // Events are sent at once; a resolution of milliseconds suffices for the period.
        let span = until.duration_since(clock::now()).0.div_ceil(1_000_000);
        let span = u16::try_from(span).unwrap_or(u16::MAX);
        if ready.is_empty() || poll(&mut ready, PollTimeout::from(span)).is_err() {
            clock::sleep_until(until);
        }
    }

    fn pulse(&mut self) {
        self.parts.iter_mut().filter_map(|part| part.device.as_mut()).for_each(Device::pulse);
    }

    fn news(&mut self) -> Option<String> {
        (!self.news.is_empty()).then(|| self.news.remove(0))
    }

    fn help(&self) -> String {
        let names = self.parts.iter().map(|part| part.identity.to_string());
        let names = names.collect::<Vec<_>>().join(" and ");
        format!("{names}: hold the dead-man and steer; release it to hold. Ctrl-C exits.")
    }
}

#[cfg(test)]
mod tests {
    use i2ris_teleop::space_mouse;
    use i2ris_teleop::state::{Description, Range};

    use super::*;

    fn evdev((vendor, product): (u16, u16), name: &str, axes: &[u16], keys: &[u16]) -> Description {
        let range = |code: &u16| Range { code: *code, minimum: -350, maximum: 350, flat: 0 };
        let identity = Identity::new(vendor, product, name);
        Description::new(identity, axes.iter().map(range).collect(), keys.to_vec())
    }

    /// A DualSense with its three files (ShadowBlip/InputPlumber#148), a pedal with its keyboard
    /// and mouse (omustardo.com/timeline/2023/foot_pedal.html), and a SpaceMouse with events and
    /// reports.
    fn plugged_in() -> Vec<Found> {
        const PAD: (u16, u16) = (0x054c, 0x0ce6);
        const PEDAL: (u16, u16) = (0x3553, 0xb001);
        const MOUSE: (u16, u16) = (0x256f, 0xc635);
        let keys: Vec<u16> = (1..84).collect();
        let events = evdev(MOUSE, "SpaceMouse Compact", &[0, 1, 2, 3, 4, 5], &[0x100, 0x101]);
        let reports = space_mouse::description(events.identity.clone());
        let all = [
            ("/dev/hidraw2", reports),
            ("/dev/input/event20", evdev(PAD, "DualSense", &[0, 1, 3, 4], &[0x130, 0x131, 0x137])),
            ("/dev/input/event21", evdev(PAD, "DualSense Motion Sensors", &[0, 1, 2], &[])),
            ("/dev/input/event22", evdev(PAD, "DualSense Touchpad", &[0, 1], &[0x110, 0x145])),
            ("/dev/input/event23", evdev(PEDAL, "PCsensor FootSwitch Keyboard", &[], &keys)),
            ("/dev/input/event24", evdev(PEDAL, "PCsensor FootSwitch Mouse", &[], &[0x110, 0x111])),
            ("/dev/input/event25", events),
        ];
        all.map(|(path, device)| Found { path: path.into(), description: Ok(device) }).into()
    }

    #[test]
    fn device_with_several_files_is_one_device() {
        let profiles: Vec<_> = Profile::shipped().collect();
        let chosen = |without: &str| {
            let mut found = plugged_in();
            found.retain(|found| {
                let device = found.description.as_ref().unwrap();
                without.is_empty() || !device.identity.name.starts_with(without)
            });
            only_known(&found, &profiles).map_err(|error| error.to_string())
        };
        let [pedal, pad] = ["/dev/input/event23", "/dev/input/event20"].map(PathBuf::from);
        assert_eq!(chosen("SpaceMouse"), Ok(vec![pad, pedal.clone()]));
        assert_eq!(chosen("DualSense"), Ok(vec!["/dev/hidraw2".into(), pedal]));
        assert!(chosen("").unwrap_err().starts_with("more than one known device is plugged in"));
    }
}
