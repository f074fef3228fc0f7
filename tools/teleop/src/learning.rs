//! Asks for the controls of an unknown device, without guessing.
//!
//! At rest, pushed to the right, pushed up, dead-man pressed: each time, the control that differs
//! most from rest, relative to its range, is the answer.

use crate::profile::{ControlNames, Profile};
use crate::state::{Code, Description, DeviceState};

/// Share of its range by which an axis has to move.
const MIN_SHARE: f64 = 0.3;
/// Maximum ratio of the second largest motion to the largest.
const MAX_SECOND: f64 = 0.7;

/// Instructions to the person.
pub const QUESTIONS: [&str; 4] = [
    "move every control once, then release all controls",
    "push the control to the right and keep it there",
    "push it away from you and keep it there",
    "release it, and press the control that shall be the dead-man",
];

/// The axes and keys at an answer.
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    axes: Vec<(Code, i32)>,
    keys: Vec<Code>,
    /// Pressed since the last answer, and already released.
    tapped: Option<Code>,
}

impl Snapshot {
    pub fn of(state: &mut DeviceState) -> Self {
        let presses = std::mem::take(&mut state.presses);
        let tapped = presses.into_iter().rfind(|key| !state.is_pressed(*key));
        let (axes, keys) = (state.axes().collect(), state.pressed().collect());
        Self { axes, keys, tapped: tapped.map(Code::Key) }
    }

    /// The axis that differs most from `rest`, as a share of its range with its sign.
    fn moved(&self, rest: &Self, device: &Description) -> Result<(Code, f64), String> {
        let share = |(code, value): &(Code, i32)| {
            let Code::Absolute(number) = *code else { return None };
            let range = device.range(number)?;
            let (_, at_rest) = rest.axes.iter().find(|(axis, _)| axis == code)?;
            let moved = f64::from(*value) - f64::from(*at_rest);
            Some((*code, moved / (f64::from(range.maximum) - f64::from(range.minimum))))
        };
        let mut moved: Vec<_> = self.axes.iter().filter_map(share).collect();
        moved.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        match moved[..] {
            [(code, share), ref rest @ ..] if share.abs() >= MIN_SHARE => match rest.first() {
                Some((second, other)) if other.abs() > MAX_SECOND * share.abs() => {
                    Err(format!("{code} and {second} moved alike: push in one direction only"))
                }
                _ => Ok((code, share)),
            },
            _ => Err("no axis moved by a third of its range".into()),
        }
    }
}

fn taps(key: Code) -> String {
    format!(
        "{key} is no longer held: keep it pressed; a pedal that sends taps is not a dead-man, so \
         set it to hold its key"
    )
}

/// Creates a profile from four answers. An error is one sentence about an unclear answer.
pub fn profile(device: &Description, answers: &[Snapshot; 4]) -> Result<Profile, String> {
    let [rest, right, up, dead_man] = answers;
    let named =
        |(code, share): (Code, f64)| format!("{}{code}", if share < 0.0 { "-" } else { "" });
    let question = |index: usize| move |error: String| format!("{}: {error}", QUESTIONS[index]);
    let right = right.moved(rest, device).map_err(question(1))?;
    let up = up.moved(rest, device).map_err(question(2))?;
    if right.0 == up.0 {
        return Err(format!("{} moved to the right and away from you: two axes are needed", up.0));
    }
    let pressed: Vec<_> = dead_man.keys.iter().filter(|key| !rest.keys.contains(key)).collect();
    let dead_man = match pressed[..] {
        [key] => key.to_string(),
        [] => {
            let moved = dead_man.moved(rest, device);
            let moved = moved.map_err(|error| dead_man.tapped.map_or(error, taps));
            moved.map_err(question(3))?.0.to_string()
        }
        _ => return Err(format!("{}: {} keys were pressed", QUESTIONS[3], pressed.len())),
    };
    let head = format!(
        "name = {}\ndevices = [\"{}\"]\n",
        toml::Value::from(device.identity.name.clone()),
        device.identity.product_id()
    );
    let mut profile = Profile::parse(&head)?;
    profile.controls = ControlNames {
        right: Some(named(right)),
        up: Some(named(up)),
        dead_man: Some(dead_man),
        scale: None,
        mark: None,
    };
    Ok(profile)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::Identity;
    use crate::space_mouse;

    fn snapshot(x: i32, y: i32, keys: &[u16]) -> Snapshot {
        let axes = vec![(Code::Absolute(0), x), (Code::Absolute(1), y)];
        let keys = keys.iter().map(|key| Code::Key(*key)).collect();
        Snapshot { axes, keys, tapped: None }
    }

    #[test]
    fn four_answers_make_a_profile_that_is_read_again() {
        let device = space_mouse::description(Identity::new(0x1234, 0xabcd, "Stick \"7\""));
        let rest = snapshot(3, -2, &[]);
        let pushed = [snapshot(340, 20, &[]), snapshot(5, -300, &[]), snapshot(0, 0, &[0x101])];
        let [right, up, dead_man] = pushed;
        let answers = [rest.clone(), right, up, dead_man];
        let learned = profile(&device, &answers).unwrap();
        let text = toml::to_string(&learned).unwrap();
        assert_eq!(Profile::parse(&text).unwrap(), learned, "{text}");
        let names = &learned.controls;
        let named = [&names.right, &names.up, &names.dead_man].map(|it| it.as_deref().unwrap());
        assert_eq!(named, ["ABS_X", "-ABS_Y", "BTN_1"]);
        let tapped = Snapshot { tapped: Some(Code::Key(48)), ..rest.clone() };
        for (index, wrong, part) in [
            (1, rest.clone(), "no axis moved"),
            (1, snapshot(300, 290, &[]), "moved alike"),
            (2, snapshot(300, 0, &[]), "two axes are needed"),
            (3, snapshot(0, 0, &[0x101, 0x102]), "2 keys"),
            (3, tapped, "KEY_B is no longer held"),
            (3, rest, "no axis moved"),
        ] {
            let mut answers = answers.clone();
            answers[index] = wrong;
            let error = profile(&device, &answers).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
