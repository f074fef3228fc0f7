//! All devices together: whether the snake may follow, and if not, why.
//!
//! ```text
//!            all at rest, dead-man released            dead-man pressed, all centred
//!   UNRESTED ------------------------------>  RESTED  ------------------------------>  CLOSED
//!      ^                                      |    ^                                  |    |
//!      +---- pressed while deflected, fault --+    +--------- dead-man released ------+    |
//!      +------------------------------- fault of any device -------------------------------+
//! ```
//!
//! After every start, loss and return all devices must be seen at rest, then the dead-man pressed.

use i2ris::units::Nanos;

use crate::control::{DeadMan, Fault, Reading};

/// Reason why the snake does not follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Open {
    #[error("the stick was never centred: move it once and release it")]
    NeverCentred,
    #[error("the stick was deflected when the dead-man closed: release both once")]
    Deflected,
    /// A trigger was never seen untouched.
    #[error("the dead-man is half pressed: release it, then press it fully")]
    HalfPressed,
    #[error("{0}: release everything, then press it again")]
    Fault(Fault),
    /// The dead-man reports a release while it is held.
    #[error("the pedal sends taps, not a dead-man: set it to hold its key, or use another")]
    Tapped,
    /// No fault.
    #[error("the dead-man is not pressed")]
    Released,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Unrested(Open),
    Rested,
    Closed,
}

/// State of all devices together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hand {
    /// Deflection to the right and up; zero unless it is known for all devices.
    pub push: [f64; 2],
    /// `None`: the snake may follow.
    pub open: Option<Open>,
    pub scale_steps: u32,
    /// Number of requested marks.
    pub marks: u32,
    /// Arrival of the newest event of any device at the computer.
    pub newest: Option<Nanos>,
}

impl Default for Hand {
    /// Nothing is touched.
    fn default() -> Self {
        let open = Some(Open::Released);
        Self { push: [0.0; 2], open, scale_steps: 0, marks: 0, newest: None }
    }
}

/// The dead-man of a hand with one or more devices.
#[derive(Debug)]
pub struct Clutch(Phase);

impl Default for Clutch {
    fn default() -> Self {
        Self(Phase::Unrested(Open::NeverCentred))
    }
}

impl Clutch {
    /// Updates with all readings; `true`: the device steers. A pedal replaces its dead-man.
    pub fn update(&mut self, readings: &[(bool, Reading)]) -> Hand {
        let has_dead_man = |reading: &&(bool, Reading)| reading.1.dead_man.is_some();
        let pedals: Vec<_> =
            readings.iter().filter(|reading| !reading.0).filter(has_dead_man).collect();
        let own = readings.iter().find(has_dead_man).into_iter().collect();
        let used = if pedals.is_empty() { own } else { pedals };
        let dead_men = used.iter().filter_map(|(_, reading)| reading.dead_man);
        // With two pedals both have to be held.
        let dead_man = dead_men.min_by_key(|dead_man| *dead_man == DeadMan::Pressed);
        let dead_man = dead_man.unwrap_or(DeadMan::Released);
        let is_tapped = used.iter().any(|(_, reading)| reading.is_tapped);
        // A dead-man on a device that steers is as alive as its axes.
        let is_overdue = readings.len() > 1 && used.iter().any(|(_, reading)| reading.is_overdue);
        let known: Option<Vec<_>> = readings.iter().map(|(_, reading)| reading.push).collect();
        let push = known.map(|all| {
            let sum = |axis: usize| all.iter().map(|push| push[axis]).sum::<f64>();
            [sum(0).clamp(-1.0, 1.0), sum(1).clamp(-1.0, 1.0)]
        });
        let fault = readings.iter().find_map(|(_, reading)| reading.fault);
        let fault = fault.or(is_overdue.then_some(Fault::Overdue));
        self.0 = match (fault, self.0) {
            (Some(fault), _) => Phase::Unrested(Open::Fault(fault)),
            (None, Phase::Unrested(why)) => match (push, dead_man) {
                (Some([0.0, 0.0]), DeadMan::Released) => Phase::Rested,
                (Some([0.0, 0.0]), DeadMan::HalfPressed) if why == Open::NeverCentred => {
                    Phase::Unrested(Open::HalfPressed)
                }
                _ => Phase::Unrested(why),
            },
            (None, Phase::Rested) if dead_man == DeadMan::Pressed => match push {
                Some([0.0, 0.0]) => Phase::Closed,
                _ => Phase::Unrested(Open::Deflected),
            },
            (None, Phase::Closed) if dead_man != DeadMan::Pressed => Phase::Rested,
            (None, phase) => phase,
        };
        Hand {
            push: push.unwrap_or([0.0; 2]),
            open: match self.0 {
                Phase::Unrested(why) => Some(why),
                Phase::Rested if is_tapped => Some(Open::Tapped),
                Phase::Rested => Some(Open::Released),
                Phase::Closed => None,
            },
            scale_steps: readings.iter().map(|(_, reading)| reading.scale_steps).sum(),
            marks: readings.iter().map(|(_, reading)| reading.marks).sum(),
            newest: readings.iter().filter_map(|(_, reading)| reading.newest).max(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CENTRED: Option<[f64; 2]> = Some([0.0; 2]);
    const DEFLECTED: Option<[f64; 2]> = Some([0.5, 0.0]);

    fn stick(push: Option<[f64; 2]>, dead_man: DeadMan) -> (bool, Reading) {
        (true, Reading { push, dead_man: Some(dead_man), ..Reading::default() })
    }

    fn pedal(dead_man: DeadMan) -> (bool, Reading) {
        (false, stick(CENTRED, dead_man).1)
    }

    fn after(readings: &[(bool, Reading)]) -> Option<Open> {
        let mut clutch = Clutch::default();
        readings.iter().map(|reading| clutch.update(&[*reading]).open).last().unwrap()
    }

    #[test]
    fn clutch_closes_after_rest_and_dead_man_press() {
        use DeadMan::{HalfPressed, Pressed, Released};
        let rest = stick(CENTRED, Released);
        assert_eq!(after(&[rest, stick(CENTRED, Pressed)]), None);
        assert_eq!(after(&[rest, stick(CENTRED, Pressed), stick(DEFLECTED, Pressed)]), None);
        for (story, expected) in [
            (vec![rest], Open::Released),
            // Held, deflected or half pressed from the start.
            (vec![stick(CENTRED, Pressed)], Open::NeverCentred),
            (vec![stick(DEFLECTED, Released), stick(DEFLECTED, Pressed)], Open::NeverCentred),
            (vec![stick(None, Released), stick(None, Pressed)], Open::NeverCentred),
            (vec![stick(CENTRED, HalfPressed), stick(CENTRED, Pressed)], Open::HalfPressed),
            // Deflected when it closes.
            (vec![rest, stick(DEFLECTED, Pressed), stick(CENTRED, Pressed)], Open::Deflected),
            // Released in motion.
            (vec![rest, stick(CENTRED, Pressed), stick(DEFLECTED, Released)], Open::Released),
        ] {
            assert_eq!(after(&story), Some(expected), "{story:?}");
        }
    }

    /// A pedal sends changes only: its receiver is out of range, the foot has long been lifted, and
    /// the kernel keeps repeating the key. The stick works.
    #[test]
    fn separate_dead_man_expires_while_the_stick_works() {
        use crate::control::Control;
        use crate::control::tests::{control, device};
        use crate::profile::DEAD_MAN_MS;
        use crate::state::{Code, DeviceState, Event};
        let mut stick = (control("right = 'ABS_X'\nup = 'ABS_Y'"), DeviceState::new(Nanos(1)));
        let mut pedal = (control("dead_man = 'BTN_TR'"), DeviceState::new(Nanos(1)));
        let (mut clutch, mut open_at) = (Clutch::default(), None);
        let mut period = |ms: u64, key: Option<i32>, x: i32| {
            let now = Nanos::from_millis(ms);
            stick.1.apply(Event::Value(Code::Absolute(0), x), now);
            stick.1.apply(Event::Value(Code::Absolute(1), 128), now);
            if let Some(key) = key {
                pedal.1.apply(Event::Value(Code::Key(0x137), key), now);
            }
            let read = |(control, state): &mut (Control, DeviceState)| {
                (control.has_axes(), control.read(&device(), state, now))
            };
            clutch.update(&[read(&mut stick), read(&mut pedal)]).open
        };
        period(1, Some(0), 0);
        assert_eq!(period(10, Some(1), 0), None);
        for ms in (20..2 * DEAD_MAN_MS).step_by(20) {
            // A stick that a hand holds trembles.
            let open = period(ms, Some(2), 80 + (ms / 20 % 2) as i32);
            assert_eq!(open.is_none(), ms <= 10 + DEAD_MAN_MS, "{ms}: {open:?}");
            open_at = open_at.or(open);
        }
        assert_eq!(open_at, Some(Open::Fault(Fault::Overdue)));
        let late = 2 * DEAD_MAN_MS;
        assert_eq!(period(late, Some(0), 0), Some(Open::Released));
        assert_eq!(period(late + 5, Some(1), 0), None, "pressed again");
        assert_eq!(period(late + 105, Some(0), 0), Some(Open::Released));
        // A pedal that sends taps, pressed twice, and then set correctly.
        for (ms, open) in [(200, Open::Released), (300, Open::Tapped)] {
            assert_eq!(period(late + ms, Some(1), 0), None);
            assert_eq!(period(late + ms + 10, Some(0), 0), Some(open));
        }
        assert_eq!(period(late + 400, Some(1), 0), None);
        assert_eq!(period(late + 500, Some(0), 0), Some(Open::Released));
    }

    #[test]
    fn pedal_replaces_the_button_and_either_loss_opens() {
        use DeadMan::{Pressed, Released};
        let mut clutch = Clutch::default();
        let mut step = |stick: (bool, Reading), pedal| clutch.update(&[stick, pedal]).open;
        let (rest, held) = (stick(CENTRED, Released), stick(CENTRED, Pressed));
        assert_eq!(step(rest, pedal(Released)), Some(Open::Released));
        assert_eq!(step(held, pedal(Released)), Some(Open::Released), "the button does not count");
        assert_eq!(step(rest, pedal(Pressed)), None);
        let mut gone = pedal(Pressed);
        gone.1.fault = Some(Fault::Gone);
        assert_eq!(step(rest, gone), Some(Open::Fault(Fault::Gone)));
        assert_eq!(step(rest, pedal(Released)), Some(Open::Released));
        assert_eq!(step(rest, pedal(Pressed)), None);
        let mut gone = rest;
        (gone.1.fault, gone.1.push) = (Some(Fault::Gone), None);
        assert_eq!(step(gone, pedal(Pressed)), Some(Open::Fault(Fault::Gone)));
    }
}
