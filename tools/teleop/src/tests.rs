//! The chain from device to clutch. Random faults, checked against the true state: a device that is
//! silent, lost, replaced or repeats itself. Devices as published by others.

use std::collections::BTreeMap;

use i2ris::units::Nanos;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use crate::clutch::Clutch;
use crate::control::{Control, DeadMan, Fault, Reading};
use crate::identity::Identity;
use crate::master::{Master, Mode, Motion, Settings};
use crate::profile::{Handedness, Profile};
use crate::space_mouse;
use crate::state::{Code, Description, DeviceState, Event};
use crate::view::View;

const PERIOD_MS: u64 = 5;
/// Timeouts of the shipped profile; silence equals the deadline of the shipped configurations.
const SILENCE_MS: u64 = 50;
const REPEAT_MS: u64 = 500;
const DEAD_MAN: u16 = 0x100;

/// Event of one period.
#[derive(Debug, Clone, Copy)]
enum Happens {
    /// The cap moves; 20 is within the dead zone.
    Cap(i32),
    DeadMan(bool),
    /// Nothing for this many periods; a cap that is held trembles.
    Time(u16),
    /// The receiver is out of range: it sends nothing.
    Lost,
    /// It keeps sending the same.
    Zombie,
    Back,
    /// Unplugged, and plugged in again in its present state.
    Replug,
    Dropped,
    /// A value that such a device cannot have.
    Beyond,
}

fn happens() -> impl Strategy<Value = Happens> {
    prop_oneof![
        4 => prop_oneof![Just(0), Just(20), -350..350].prop_map(Happens::Cap),
        4 => any::<bool>().prop_map(Happens::DeadMan),
        6 => (1_u16..200).prop_map(Happens::Time),
        1 => Just(Happens::Lost),
        1 => Just(Happens::Zombie),
        2 => Just(Happens::Back),
        1 => Just(Happens::Replug),
        1 => Just(Happens::Dropped),
        1 => Just(Happens::Beyond),
    ]
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Link {
    Alive,
    Lost,
    Zombie,
}

/// The world: the device, the hand on it, and the true state of both.
struct World {
    device: Description,
    state: DeviceState,
    control: Control,
    clutch: Clutch,
    master: Master,
    now_ms: u64,
    cap: i32,
    held: bool,
    link: Link,
    /// Last value that the device sent.
    sent: (i32, bool),
    pose: [f64; 2],
    /// Times at which the device last sent a value, and a true value.
    sent_ms: u64,
    true_ms: u64,
    /// Whether it sent a centred cap and a released dead-man since it was opened or lost.
    was_at_rest: bool,
}

impl World {
    fn new() -> Self {
        let device = space_mouse::description(Identity::new(0x256f, 0xc635, "Mouse"));
        let profile = profile(&device).unwrap();
        let controls = profile.controls(&device, Handedness::Right).unwrap();
        let settings =
            Settings { mode: Mode::Rate, speed_deg_s: 10.0, reach_deg: 1.0, step_deg: 0.1 };
        Self {
            state: DeviceState::new(Nanos::ZERO),
            control: Control::new(&profile, controls),
            clutch: Clutch::default(),
            master: Master::new([0.0; 2], settings),
            device,
            now_ms: 1000,
            cap: 0,
            held: false,
            link: Link::Alive,
            sent: (0, false),
            pose: [0.0; 2],
            sent_ms: 0,
            true_ms: 0,
            was_at_rest: false,
        }
    }

    fn now(&self) -> Nanos {
        Nanos::from_millis(self.now_ms)
    }

    fn send(&mut self, (cap, held): (i32, bool)) {
        let now = self.now();
        self.state.apply(Event::Value(Code::Absolute(0), cap), now);
        self.state.apply(Event::Value(Code::Absolute(1), 0), now);
        self.state.apply(Event::Value(Code::Key(DEAD_MAN), held.into()), now);
        (self.sent, self.sent_ms) = ((cap, held), self.now_ms);
    }

    /// Runs one period; fails if the snake moves when it must not.
    fn period(&mut self) -> Result<(), TestCaseError> {
        self.now_ms += PERIOD_MS;
        match self.link {
            Link::Alive => {
                // A hand trembles, and the sensor has noise.
                let tremble =
                    if self.cap.abs() > 20 { (self.now_ms / PERIOD_MS % 2) as i32 } else { 0 };
                self.send((self.cap + tremble, self.held));
                self.true_ms = self.now_ms;
            }
            Link::Lost => {}
            Link::Zombie => self.send(self.sent),
        }
        let is_centred = self.sent.0.abs() <= 35;
        self.was_at_rest |= is_centred && !self.sent.1 && self.link != Link::Lost;
        let now = self.now();
        let reading = self.control.read(&self.device, &mut self.state, now);
        let hand = self.clutch.update(&[(true, reading)]);
        let before = self.pose;
        let motion = Motion {
            engaged: hand.open.is_none(),
            push: View::default().joints(hand.push),
            steps: [0.0; 2],
            scale: 1.0,
        };
        let command = self.master.update(&motion, Some(before), 0.005);
        let moves = command.pose != before;
        let describe = || format!("sent {:?}, link {:?}, {hand:?}", self.sent, self.link);
        prop_assert!(!moves || self.sent.1, "without a dead-man: {}", describe());
        prop_assert!(!moves || self.was_at_rest, "never at rest: {}", describe());
        let ages_ms = [self.sent_ms, self.true_ms].map(|at| self.now_ms - at);
        let late = ages_ms[0] > SILENCE_MS + PERIOD_MS || ages_ms[1] > REPEAT_MS + PERIOD_MS;
        prop_assert!(!moves || !late, "too long: {}", describe());
        prop_assert!(!moves || self.sent.0.abs() <= 525, "beyond: {}", describe());
        self.pose = command.pose;
        prop_assert_eq!(command.clutch_open, hand.open.is_some());
        Ok(())
    }

    fn happen(&mut self, happens: Happens) -> Result<(), TestCaseError> {
        match happens {
            Happens::Cap(cap) => self.cap = cap,
            Happens::DeadMan(held) => self.held = held,
            Happens::Lost => self.link = Link::Lost,
            Happens::Zombie => self.link = Link::Zombie,
            Happens::Back => self.link = Link::Alive,
            Happens::Replug => {
                let gone = Reading { fault: Some(Fault::Gone), ..Reading::default() };
                self.clutch.update(&[(true, gone)]);
                self.state = DeviceState::new(self.now());
                (self.link, self.sent, self.was_at_rest) = (Link::Alive, (0, false), false);
            }
            Happens::Dropped => {
                self.state.apply(Event::Dropped, self.now());
                self.was_at_rest = false;
                self.sent = (0, false);
            }
            Happens::Beyond => self.cap = 5000,
            Happens::Time(periods) => {
                for _ in 0..periods {
                    self.period()?;
                }
            }
        }
        self.period()
    }
}

#[test]
fn snake_moves_only_with_a_dead_man_closed_at_rest() {
    let file = Some(file!());
    let config = ProptestConfig { cases: 2000, source_file: file, ..ProptestConfig::default() };
    let mut runner = TestRunner::new(config);
    let outcome = runner.run(&prop::collection::vec(happens(), 1..40), |story| {
        let mut world = World::new();
        story.into_iter().try_for_each(|happens| world.happen(happens))
    });
    outcome.unwrap();
}

#[test]
fn simulated_snake_moves_without_faults() {
    let mut world = World::new();
    let mut moved = false;
    for happens in [Happens::Time(3), Happens::DeadMan(true), Happens::Time(3), Happens::Cap(200)] {
        world.happen(happens).unwrap();
        moved = world.pose[1] > 0.0;
    }
    assert!(moved);
}

/// Devices as published by others, against the shipped profiles. None of them was available here.
#[derive(serde::Deserialize)]
struct Capture {
    source: String,
    refused: Option<String>,
    rest: Vec<i32>,
    device: Description,
}

pub(crate) fn profile(device: &Description) -> Option<Profile> {
    Profile::shipped().find(|profile| profile.is_for(&device.identity))
}

#[test]
fn captured_devices_are_at_rest_or_refused_by_name() {
    let captures: BTreeMap<String, Vec<Capture>> =
        toml::from_str(include_str!("captures.toml")).unwrap();
    assert_eq!(captures["capture"].len(), 5);
    for Capture { source, refused, rest, device } in captures.into_values().flatten() {
        let profile = profile(&device).unwrap();
        for hand in [Handedness::Right, Handedness::Left] {
            let controls = profile.controls(&device, hand);
            if let Some(expected) = &refused {
                let error = controls.unwrap_err();
                assert!(error.contains(expected), "{source}: {error}");
                continue;
            }
            let mut control = Control::new(&profile, controls.unwrap());
            let mut state = DeviceState::new(Nanos(1));
            assert_eq!(rest.len(), device.absolute.len());
            for (range, value) in device.absolute.iter().zip(&rest) {
                state.apply(Event::Value(Code::Absolute(range.code), *value), Nanos(2));
            }
            let reading = control.read(&device, &mut state, Nanos::from_millis(60_000));
            assert_eq!((reading.push, reading.fault), (Some([0.0; 2]), None), "{source} {hand:?}");
            assert_eq!(reading.dead_man, Some(DeadMan::Released), "{source}");
        }
    }
}

/// A pedal with unknown keys (rvaiya/keyd#591).
#[test]
fn pedal_without_a_profile_is_unknown() {
    let identity = Identity::new(0x05f3, 0x00ff, "VEC  VEC USB Footpedal");
    assert!(profile(&Description::new(identity, Vec::new(), vec![184, 185, 186])).is_none());
}

/// A SpaceNavigator sends every 8 ms while deflected, then 3 zeros (FreeSpacenav/spacenavd#108).
#[test]
fn space_navigator_is_silent_only_when_its_reports_stop() {
    let device = space_mouse::description(Identity::new(0x046d, 0xc626, "SpaceNavigator"));
    let profile = profile(&device).unwrap();
    let controls = profile.controls(&device, Handedness::Right).unwrap();
    let (mut control, mut state) = (Control::new(&profile, controls), DeviceState::default());
    let mut read = |state: &mut DeviceState, ms: u64| {
        let reading = control.read(&device, state, Nanos::from_millis(ms));
        (reading.push.is_some_and(|push| push != [0.0; 2]), reading.fault)
    };
    for ms in 0..4000 {
        if ms % 8 == 0 {
            let x = 200 + (ms / 8 % 3) as u8;
            let mut send = |report: &[u8]| {
                space_mouse::decode(report, |event| state.apply(event, Nanos::from_millis(ms)));
            };
            send(&[1, x, 0, 0, 0, 0, 0]);
            send(&[2, 0, 0, 0, 0, 0, 0]);
        }
        assert_eq!(read(&mut state, ms), (true, None), "{ms}");
    }
    // The last report came 8 ms before: one that is lost, and two.
    assert_eq!(read(&mut state, 4016), (true, None));
    assert_eq!(read(&mut state, 4050), (true, Some(Fault::Silent)));
    space_mouse::decode(&[1, 0, 0, 0, 0, 0, 0], |event| {
        state.apply(event, Nanos::from_millis(4051))
    });
    assert_eq!(read(&mut state, 9000), (false, None));
}
