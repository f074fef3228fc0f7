//! Devices as published by others, against the shipped profiles. None of them was available here.

use i2ris::units::Nanos;

use crate::control::{Control, DeadMan, Fault};
use crate::identity::Identity;
use crate::profile::{Handedness, Profile};
use crate::space_mouse;
use crate::state::{Code, Description, DeviceState, Event};

#[derive(serde::Deserialize)]
struct Captures {
    capture: Vec<Capture>,
}

#[derive(serde::Deserialize)]
struct Capture {
    source: String,
    refused: Option<String>,
    rest: Vec<i32>,
    device: Description,
}

fn profile(device: &Description) -> Option<Profile> {
    Profile::shipped().find(|profile| profile.is_for(&device.identity))
}

#[test]
fn captured_devices_are_at_rest_or_refused_by_name() {
    let captures: Captures = toml::from_str(include_str!("captures.toml")).unwrap();
    assert_eq!(captures.capture.len(), 5);
    for Capture { source, refused, rest, device } in captures.capture {
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
