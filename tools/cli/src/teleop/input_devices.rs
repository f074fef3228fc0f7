//! Input devices: found, opened, read together, and found again after a loss. Their pulses near
//! limits are the same beats as the sound of the operator's page, and never a command.

use std::path::{Path, PathBuf};
use std::{fs, os::fd::AsFd};

use i2ris::ipc::client::{Client, ClientError, Latest};
use i2ris::ipc::payload::{JointState, OperatingStateMsg, VirtualFixturesMsg};
use i2ris::{clock, ipc::Domain, units::Nanos};
use i2ris_report::view::{LatestMessages, View};
use i2ris_report::{Failure, bail, model_poller::ModelPoller};
use i2ris_teleop::control::{Control, Fault, Reading};
use i2ris_teleop::finder::{self, Found, known, reopen, scan};
use i2ris_teleop::profile::{Handedness, Profile};
use i2ris_teleop::{clutch::Clutch, device::Device, identity::Identity, state::Protocol};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use super::{HandRequest, Source, SourceLost};

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
/// a SpaceMouse reports and events. A file with all controls is used, and rather one of reports.
fn only_known(found: &[Found], profiles: &[Profile]) -> Result<Vec<PathBuf>, Failure> {
    let list = found.iter().map(|found| format!("\n  {}", finder::line(found, profiles)));
    let list = list.collect::<String>();
    let has_reports = |product| {
        let mut devices = found.iter().filter_map(|found| found.description.as_ref().ok());
        devices.any(|device| {
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

    fn read(&mut self, now: Nanos) -> (Reading, Option<String>) {
        let Some(device) = &mut self.device else { return (gone(), self.search(now)) };
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
        let waiting = |device| PollFd::new(Device::as_fd(device), PollFlags::POLLIN);
        let mut ready: Vec<_> = devices.map(waiting).collect();
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

const LOOK: Nanos = Nanos::from_millis(100);

pub(super) struct Pulses {
    measured: Latest<JointState>,
    state: Latest<OperatingStateMsg>,
    fixtures: Latest<VirtualFixturesMsg>,
    models: ModelPoller,
    last: Nanos,
    looked: Nanos,
}

impl Pulses {
    pub fn new(client: &Client, domain: &Domain) -> Self {
        let watcher = client.watcher();
        let models = ModelPoller::start(domain);
        models.poll_now();
        Self {
            measured: Latest::new(watcher.measured_js()),
            state: Latest::new(watcher.operating_state()),
            fixtures: Latest::new(watcher.virtual_fixtures()),
            models,
            last: Nanos::ZERO,
            looked: Nanos::ZERO,
        }
    }

    pub fn due(&mut self, now: Nanos) -> Result<bool, ClientError> {
        if now.duration_since(self.looked) < LOOK {
            return Ok(false);
        }
        self.looked = now;
        let messages = LatestMessages {
            measured: self.measured.refresh()?.copied(),
            state: self.state.refresh()?.copied(),
            fixtures: self.fixtures.refresh()?.copied(),
            ..LatestMessages::default()
        };
        let cue = View::new(&messages, now).cue(&self.models.known().outline.points);
        let due = cue.is_some_and(|cue| now.duration_since(self.last) >= cue.beat());
        if due {
            self.last = now;
        }
        Ok(due)
    }
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::FixtureKind;
    use i2ris_teleop::space_mouse;
    use i2ris_teleop::state::{Description, Range};
    use i2ris_testing::{Controller, wait_until};

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

    #[test]
    fn pulses_are_faster_nearer_to_a_fixture() {
        let controller = Controller::enabled();
        let mut fixtures = VirtualFixturesMsg { active: 1, ..VirtualFixturesMsg::default() };
        fixtures.kind[0] = FixtureKind::Circle.number();
        // It ends 5.73 deg from the middle.
        fixtures.values[0][..3].copy_from_slice(&[0.0, 0.2, 0.1]);
        controller.robot().fixtures = Some(fixtures);
        let client = Client::connect(&controller.domain, Nanos::from_millis(10_000)).unwrap();
        let mut pulses = Pulses::new(&client, &controller.domain);
        wait_until("the fixture", || pulses.fixtures.refresh().unwrap().is_some());
        let beat = |pulses: &mut Pulses, yaw_deg: f64| {
            controller.robot().pose = [0.0, yaw_deg];
            wait_until("the snake is there", || {
                let measured = pulses.measured.refresh().unwrap();
                measured.is_some_and(|it| (it.position[1].to_degrees() - yaw_deg).abs() < 0.01)
            });
            // Backdates the last pulse, so that the test need not wait for a beat.
            let due_after = |pulses: &mut Pulses, wait_ms: u64| {
                let now = clock::now();
                (pulses.looked, pulses.last) = (Nanos::ZERO, now - Nanos::from_millis(wait_ms));
                pulses.due(now).unwrap()
            };
            (1..=10).map(|step| 100 * step).find(|wait_ms| due_after(pulses, *wait_ms))
        };
        // 0.1 s when it touches, 1 s from 3 deg away.
        assert_eq!(beat(&mut pulses, 5.7), Some(100));
        assert_eq!(beat(&mut pulses, 4.0), Some(700));
        assert_eq!(beat(&mut pulses, 0.0), None);
    }
}
