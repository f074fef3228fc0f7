//! All devices together: may the snake follow, and why not.
//!
//! ```text
//!            all at rest, dead-man released            dead-man pressed, all centred
//!   UNRESTED ------------------------------>  RESTED  ------------------------------>  CLOSED
//!      ^                                      |    ^                                  |    |
//!      +---- pressed while deflected, fault --+    +--------- dead-man released ------+    |
//!      +------------------------------- fault of any device -------------------------------+
//! ```
//!
//! So every start, loss and return of a device wants to see all of them at rest once, and the
//! dead-man pressed anew.

use std::fmt;

use i2ris::units::Nanos;

use crate::control::{DeadMan, Fault, Reading};

/// Why the snake does not follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Open {
    /// A control was not seen centred since the start.
    NeverCentred,
    /// The dead-man was pressed while a control was deflected.
    Deflected,
    /// A trigger was never seen untouched.
    HalfPressed,
    Fault(Fault),
    /// All is well: the dead-man is not pressed.
    Released,
}

impl fmt::Display for Open {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NeverCentred => {
                f.write_str("the stick was never centred: move it round once and let go")
            }
            Self::Deflected => {
                f.write_str("the stick was deflected when the dead-man closed: let go of both once")
            }
            Self::HalfPressed => {
                f.write_str("the dead-man is half pressed: let go of it, then press it well")
            }
            Self::Fault(fault) => {
                write!(f, "{fault}: let go of all, then press it anew")
            }
            Self::Released => f.write_str("the dead-man is not pressed"),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Unrested(Open),
    Rested,
    Closed,
}

/// What all devices say together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hand {
    /// To the right and up; zero unless all devices know theirs.
    pub push: [f64; 2],
    /// `None`: the snake may follow.
    pub open: Option<Open>,
    pub scale_steps: u32,
    /// How often a mark was asked for.
    pub marks: u32,
    /// When the newest event of any device came to the computer.
    pub newest: Option<Nanos>,
}

/// The dead-man of a hand with one or more devices.
#[derive(Debug)]
pub struct Clutch {
    phase: Phase,
}

impl Default for Clutch {
    fn default() -> Self {
        Self { phase: Phase::Unrested(Open::NeverCentred) }
    }
}

impl Clutch {
    /// `readings`: of every device that belongs to the hand. A device without axes (a pedal) takes
    /// the place of the dead-man of one that steers.
    pub fn update(&mut self, readings: &[(bool, Reading)]) -> Hand {
        let pedals = readings.iter().filter(|(has_axes, _)| !has_axes);
        let pedal = pedals.filter_map(|(_, reading)| reading.dead_man).min_by_key(|dead_man| {
            // With two pedals both have to be held.
            *dead_man == DeadMan::Pressed
        });
        let own = readings.iter().find_map(|(_, reading)| reading.dead_man);
        let dead_man = pedal.or(own).unwrap_or(DeadMan::Released);
        let known: Option<Vec<_>> = readings.iter().map(|(_, reading)| reading.push).collect();
        let push = known.map(|all| {
            let sum = |axis: usize| all.iter().map(|push| push[axis]).sum::<f64>();
            [sum(0).clamp(-1.0, 1.0), sum(1).clamp(-1.0, 1.0)]
        });
        let fault = readings.iter().find_map(|(_, reading)| reading.fault);
        self.phase = match (fault, self.phase) {
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
            open: match self.phase {
                Phase::Unrested(why) => Some(why),
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
    fn the_clutch_closes_when_all_was_at_rest_and_the_dead_man_is_pressed_then() {
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

    #[test]
    fn a_fault_opens_it_until_all_was_at_rest_again() {
        use DeadMan::{Pressed, Released};
        let mut silent = stick(DEFLECTED, Pressed);
        silent.1.fault = Some(Fault::Silent);
        let story =
            [stick(CENTRED, Released), stick(CENTRED, Pressed), silent, stick(DEFLECTED, Pressed)];
        assert_eq!(after(&story), Some(Open::Fault(Fault::Silent)));
        let centred = [&story[..], &[stick(CENTRED, Pressed)]].concat();
        assert_eq!(after(&centred), Some(Open::Fault(Fault::Silent)), "still held");
        let again = [&centred[..], &[stick(CENTRED, Released), stick(CENTRED, Pressed)]].concat();
        assert_eq!(after(&again), None);
    }

    #[test]
    fn a_pedal_takes_the_place_of_the_button_and_the_loss_of_either_opens() {
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
