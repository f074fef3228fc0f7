//! Devices as published by others, against the shipped profiles. None of them was available here.

use i2ris::units::Nanos;

use crate::control::{Control, DeadMan, Fault};
use crate::identity::Identity;
use crate::profile::{Handedness, Profile};
use crate::space_mouse;
use crate::state::{Code, Description, DeviceState, Event, Range};

/// Number, minimum, maximum, flat, and value at rest.
type Axis = (u16, i32, i32, i32, i32);

/// Sticks and triggers as reported by xpad.
const XPAD: [Axis; 6] = [
    (0, -32768, 32767, 128, 93),
    (1, -32768, 32767, 128, -208),
    (2, 0, 1023, 0, 0),
    (3, -32768, 32767, 128, 637),
    (4, -32768, 32767, 128, -192),
    (5, 0, 1023, 0, 0),
];
/// The same pad over Bluetooth with xpadneo; it does not return to its centre.
const XPADNEO: [Axis; 6] = [
    (0, -32768, 32767, 4095, 2765),
    (1, -32768, 32767, 4095, 825),
    (2, 0, 1023, 63, 1),
    (3, -32768, 32767, 4095, -152),
    (4, -32768, 32767, 4095, 1338),
    (5, 0, 1023, 63, 0),
];
const PLAYSTATION: [Axis; 6] = [
    (0, 0, 255, 0, 128),
    (1, 0, 255, 0, 128),
    (2, 0, 255, 0, 0),
    (3, 0, 255, 0, 128),
    (4, 0, 255, 0, 128),
    (5, 0, 255, 0, 0),
];
const XPAD_KEYS: [u16; 11] = [304, 305, 307, 308, 310, 311, 314, 315, 316, 317, 318];
const PLAYSTATION_KEYS: [u16; 13] =
    [304, 305, 307, 308, 310, 311, 312, 313, 314, 315, 316, 317, 318];
const GENERIC_KEYS: [u16; 14] =
    [304, 305, 306, 307, 308, 309, 310, 311, 312, 313, 314, 315, 316, 317];

struct Capture {
    source: &'static str,
    id: (u16, u16),
    name: &'static str,
    axes: &'static [Axis],
    relative: &'static [u16],
    keys: &'static [u16],
    /// Text of the refusal; `None`: it fits.
    refused: Option<&'static str>,
}

const fn pad(
    source: &'static str,
    id: (u16, u16),
    name: &'static str,
    axes: &'static [Axis],
    keys: &'static [u16],
) -> Capture {
    Capture { source, id, name, axes, relative: &[], keys, refused: None }
}

const CAPTURES: [Capture; 5] = [
    // The ranges of its sticks: medusalix/xow#12.
    pad("RPCS3/rpcs3#3179", (0x045e, 0x02ea), "Microsoft X-Box One S pad", &XPAD, &XPAD_KEYS),
    pad("atar-axis/xpadneo#77", (0x045e, 0x02fd), "Xbox Wireless Controller", &XPADNEO, &XPAD_KEYS),
    // A real driver, fed by a program.
    pad(
        "the-moisrex/foresight#69",
        (0x054c, 0x0ce6),
        "Wolf DualSense (virtual) pad",
        &PLAYSTATION,
        &PLAYSTATION_KEYS,
    ),
    // BTN_TR is a different button here, and ABS_RX a trigger.
    Capture {
        refused: Some("has BTN_C: another driver serves it"),
        ..pad(
            "moonlight-stream/moonlight-embedded#116",
            (0x054c, 0x05c4),
            "Sony Computer Entertainment Wireless Controller",
            &PLAYSTATION,
            &GENERIC_KEYS,
        )
    },
    // As seen by the kernel driver. The raw reports are read instead, where permitted.
    Capture {
        relative: &[0, 1, 2, 3, 4, 5],
        refused: Some("has no ABS_X"),
        ..pad(
            "KarsMulder/evsieve#34",
            (0x046d, 0xc626),
            "3Dconnexion SpaceNavigator",
            &[],
            &[256, 257],
        )
    },
];

impl Capture {
    fn device(&self) -> Description {
        let axes = self.axes.iter();
        let ranges =
            axes.map(|&(code, minimum, maximum, flat, _)| Range { code, minimum, maximum, flat });
        let identity = Identity::new(self.id.0, self.id.1, self.name);
        let mut device = Description::new(identity, ranges.collect(), self.keys.into());
        device.relative = self.relative.into();
        device
    }
}

fn profile(device: &Description) -> Option<Profile> {
    Profile::shipped().find(|profile| profile.is_for(&device.identity))
}

#[test]
fn captured_devices_are_at_rest_or_refused_by_name() {
    for capture in &CAPTURES {
        let (device, source) = (capture.device(), capture.source);
        let profile = profile(&device).unwrap();
        for hand in [Handedness::Right, Handedness::Left] {
            let controls = profile.controls(&device, hand);
            if let Some(expected) = capture.refused {
                let error = controls.unwrap_err();
                assert!(error.contains(expected), "{source}: {error}");
                continue;
            }
            let mut control = Control::new(&profile, controls.unwrap());
            let mut state = DeviceState::new(Nanos(1));
            for &(code, .., told) in capture.axes {
                state.apply(Event::Value(Code::Absolute(code), told), Nanos(2));
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

/// A SpaceNavigator sends its translation and its rotation every 8 ms while it is deflected, and
/// zeros three times when it returns (FreeSpacenav/spacenavd#108).
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
