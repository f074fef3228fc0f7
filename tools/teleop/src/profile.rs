//! Meaning of the axes and keys of a device, by its identity: numbers differ between drivers.

use serde::{Deserialize, Serialize};

use crate::identity::{Identity, check_product_id};
use crate::state::{Code, Description};

/// The profiles that come with the software: `config/devices`.
const SHIPPED: [&str; 6] = [
    include_str!("../../../config/devices/spacemouse.toml"),
    include_str!("../../../config/devices/xbox.toml"),
    include_str!("../../../config/devices/dualsense.toml"),
    include_str!("../../../config/devices/pedal.toml"),
    include_str!("../../../config/devices/joystick.toml"),
    include_str!("../../../config/devices/crtk.toml"),
];
/// Exponents of the curve from deflection to speed.
const CURVES: std::ops::RangeInclusive<f64> = 1.0..=3.0;
const DEAD_ZONES: std::ops::RangeInclusive<f64> = 0.02..=0.5;
/// Maximum time for which a dead-man may be held without an event from its device. The kernel
/// reports changes only and keeps the last state, like this program: a pedal that is held looks
/// like one with an empty battery or out of range, even if its keys are requested from the kernel,
/// which also repeats a held key automatically.
pub const DEAD_MAN_MS: u64 = 30_000;
const DEAD_MEN_MS: std::ops::RangeInclusive<u64> = 1000..=120_000;
const SILENCES_MS: std::ops::RangeInclusive<u64> = 50..=5000;

/// A profile as in its file. Names are those of the kernel; `-` before a name reverses it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Devices that it is for, in words.
    pub name: String,
    /// Vendor and product of the devices, such as `046d:c62b`.
    pub devices: Vec<String>,
    /// Controls that a device must not have: a different driver uses these names for others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unlike: Vec<String>,
    #[serde(flatten)]
    pub controls: ControlNames,
    /// Share of the range around the centre that counts as centred.
    #[serde(default = "dead_zone")]
    pub dead_zone: f64,
    /// The deflection is raised to this power: above 1 it is finer near the centre.
    #[serde(default = "curve")]
    pub curve: f64,
    /// A deflected control without an event for this time is silent, and the snake holds.
    #[serde(default = "patience_ms")]
    pub silence_ms: u64,
    /// The same for one that sends nothing new, which is normal for a while if it is held still.
    #[serde(default = "patience_ms")]
    pub repeat_ms: u64,
    /// A dead-man that is held for this time without an event from its device, while another device
    /// steers, has to be pressed again. One on the device that steers is as alive as its axes.
    #[serde(default = "dead_man_ms")]
    pub dead_man_ms: u64,
    /// Full deflection of axes that the kernel calls relative.
    pub relative_range: Option<i32>,
    /// Controls that differ for the left hand.
    pub left: Option<ControlNames>,
}

/// The controls, by their names.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControlNames {
    /// The axis to the right, and the axis away from the person.
    pub right: Option<String>,
    pub up: Option<String>,
    /// The dead-man: a key, or an axis that is pressed (a trigger, a pedal).
    pub dead_man: Option<String>,
    /// The key that goes to the next scale.
    pub scale: Option<String>,
    /// The key that marks a moment of the trial.
    pub mark: Option<String>,
}

fn dead_zone() -> f64 {
    0.1
}

fn curve() -> f64 {
    1.0
}

/// The kernel passes on changes only: a stick that is held still may send nothing.
fn patience_ms() -> u64 {
    2000
}

fn dead_man_ms() -> u64 {
    DEAD_MAN_MS
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignedAxis {
    pub code: Code,
    pub sign: f64,
}

fn signed_axis(text: &str) -> Result<SignedAxis, String> {
    let (sign, name) = text.strip_prefix('-').map_or((1.0, text), |name| (-1.0, name));
    match name.parse()? {
        Code::Key(_) => Err(format!("`{text}` is a key, an axis is needed")),
        code => Ok(SignedAxis { code, sign }),
    }
}

/// The controls of a device, found in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Controls {
    /// Axes to the right and up.
    pub axes: Option<[SignedAxis; 2]>,
    pub dead_man: Option<Code>,
    pub scale: Option<u16>,
    pub mark: Option<u16>,
}

/// Hand that holds the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Handedness {
    #[default]
    Right,
    Left,
}

impl Profile {
    /// Parses a profile. An error is one sentence with the valid form.
    pub fn parse(text: &str) -> Result<Self, String> {
        let profile: Self = toml::from_str(text).map_err(|error| error.to_string())?;
        profile.devices.iter().try_for_each(|id| check_product_id(id))?;
        let is_patient = |ms: &u64| SILENCES_MS.contains(ms);
        let checks: [(_, _, &dyn std::fmt::Debug); 5] = [
            ("dead_zone", DEAD_ZONES.contains(&profile.dead_zone), &DEAD_ZONES),
            ("curve", CURVES.contains(&profile.curve), &CURVES),
            ("silence_ms", is_patient(&profile.silence_ms), &SILENCES_MS),
            ("repeat_ms", is_patient(&profile.repeat_ms), &SILENCES_MS),
            ("dead_man_ms", DEAD_MEN_MS.contains(&profile.dead_man_ms), &DEAD_MEN_MS),
        ];
        if let Some((key, _, range)) = checks.into_iter().find(|(_, is_within, _)| !is_within) {
            return Err(format!("profile `{}`: {key} must be within {range:?}", profile.name));
        }
        Ok(profile)
    }

    /// All profiles that come with the software.
    pub fn shipped() -> impl Iterator<Item = Self> {
        // A test reads each.
        SHIPPED.iter().filter_map(|text| Self::parse(text).ok())
    }

    pub fn is_for(&self, identity: &Identity) -> bool {
        self.devices.contains(&identity.product_id())
    }

    /// Finds the controls in a device. An error names a control that the device lacks, or has but
    /// must not: it is a different device, in a different mode, or served by a different driver.
    pub fn controls(&self, device: &Description, hand: Handedness) -> Result<Controls, String> {
        let left = { self.left.as_ref() }.filter(|_| hand == Handedness::Left);
        let name = |choose: fn(&ControlNames) -> &Option<String>| {
            let special = left.and_then(|left| choose(left).as_deref());
            special.or(choose(&self.controls).as_deref())
        };
        let present = |name: &str, code: Code| {
            let absent = format!(
                "{} has no {name}, which its profile `{}` names: it is in a different mode, or \
                 served by a different driver; `i2ris teleop input show` lists its controls, \
                 `i2ris teleop input learn` creates a profile",
                device.identity, self.name
            );
            if device.has(code) { Ok(code) } else { Err(absent) }
        };
        for name in &self.unlike {
            if device.has(name.parse()?) {
                return Err(format!(
                    "{} has {name}: another driver serves it, not the one of its profile `{}`; \
                     `i2ris teleop input learn` creates a profile",
                    device.identity, self.name
                ));
            }
        }
        let axis = |text: &str| {
            let axis = signed_axis(text)?;
            present(text, axis.code)?;
            if matches!(axis.code, Code::Relative(_)) && self.relative_range.is_none() {
                return Err(format!(
                    "profile `{}`: {text} is a relative axis; without relative_range it has no \
                     deflection (a mouse cannot steer)",
                    self.name
                ));
            }
            Ok(axis)
        };
        let axis = |name: Option<&str>| name.map(axis).transpose();
        let key = |name: Option<&str>| name.map(|text| present(text, text.parse()?)).transpose();
        let axes = match (axis(name(|names| &names.right))?, axis(name(|names| &names.up))?) {
            (Some(right), Some(up)) => Some([right, up]),
            (None, None) => None,
            _ => return Err(format!("profile `{}`: right and up belong together", self.name)),
        };
        let dead_man = key(name(|names| &names.dead_man))?;
        if axes.is_none() && dead_man.is_none() {
            return Err(format!("profile `{}` has neither axes nor a dead-man", self.name));
        }
        let button = |code: Option<Code>, what: &str| match code {
            None => Ok(None),
            Some(Code::Key(key)) => Ok(Some(key)),
            Some(code) => Err(format!("{code} is an axis; the {what} needs a key")),
        };
        let scale = button(key(name(|names| &names.scale))?, "scale")?;
        let mark = button(key(name(|names| &names.mark))?, "mark")?;
        Ok(Controls { axes, dead_man, scale, mark })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space_mouse;

    #[test]
    fn shipped_profiles_are_valid_and_share_no_device() {
        let profiles: Vec<_> = SHIPPED.iter().map(|text| Profile::parse(text).unwrap()).collect();
        let mut devices: Vec<_> = profiles.iter().flat_map(|profile| &profile.devices).collect();
        let count = devices.len();
        devices.sort();
        devices.dedup();
        assert!(devices.len() == count && count > 20, "{count}");
        for profile in &profiles {
            for controls in [&profile.controls].into_iter().chain(&profile.left) {
                for axis in controls.right.iter().chain(&controls.up) {
                    signed_axis(axis).unwrap();
                }
                let keys = [&controls.dead_man, &controls.scale, &controls.mark];
                for code in keys.into_iter().flatten().chain(&profile.unlike) {
                    code.parse::<Code>().unwrap();
                }
            }
        }
    }

    #[test]
    fn device_without_a_control_of_its_profile_is_refused() {
        let mut device = space_mouse::description(Identity::new(0x256f, 0xc635, "Mouse"));
        let profile = crate::tests::profile(&device).unwrap();
        let controls = profile.controls(&device, Handedness::Right).unwrap();
        assert!(controls.axes.is_some() && controls.dead_man.is_some(), "{controls:?}");
        device.absolute.truncate(1);
        let refused = profile.controls(&device, Handedness::Right).unwrap_err();
        assert!(refused.contains("Mouse (256f:c635) has no -ABS_Y"), "{refused}");
    }

    #[test]
    fn a_wrong_profile_is_reported_in_one_sentence() {
        let text = |line: &str| format!("name = 'x'\ndevices = ['1234:abcd']\n{line}\n");
        for (line, part) in [
            ("dead_zone = 0.9", "dead_zone must be within 0.02..=0.5"),
            ("curve = 9.0", "curve must be within"),
            ("silence_ms = 9", "silence_ms must be within"),
            ("repeat_ms = 5001", "repeat_ms must be within"),
            ("dead_man_ms = 120001", "dead_man_ms must be within"),
            ("deadman = 'BTN_0'", "deadman"),
        ] {
            let error = Profile::parse(&text(line)).unwrap_err();
            assert!(error.contains(part), "{line}: {error}");
        }
        assert!(Profile::parse("name = 'x'\ndevices = ['1']").unwrap_err().contains("046d:c62b"));
        let device = space_mouse::description(Identity::new(1, 1, "Mouse"));
        for (line, part) in [
            ("right = 'ABS_X'", "belong together"),
            ("scale = 'BTN_0'", "neither axes nor a dead-man"),
            ("right = 'BTN_0'\nup = 'ABS_X'", "is a key"),
            ("dead_man = 'BTN_0'\nscale = 'ABS_X'", "needs a key"),
            ("dead_man = 'BTN_99999'", "not an axis or key"),
        ] {
            let profile = Profile::parse(&text(line)).unwrap();
            let error = profile.controls(&device, Handedness::Right).unwrap_err();
            assert!(error.contains(part), "{line}: {error}");
        }
    }
}
