//! Enabling on the spot: the drive's target is its own position before it may follow anything.

use std::ops::RangeInclusive;

use super::Progress;
use super::ask::Ask;
use super::power::Power;
use crate::drive::cia402::{Goal, State, Statusword};
use crate::drive::event::Failure;
use crate::drive::family::Parts;
use crate::drive::object::Value;
use crate::units::Counts;

/// The steps, in order. A target that is left over in the drive would be a jump.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Enabling {
    /// Read a position limit back: a drive that was restarted since it was configured has lost them
    /// all.
    LimitMin,
    /// The other one. Not both are 0, as they are in a restarted drive.
    LimitMax,
    /// Read where the motor stands.
    Position,
    /// Make that the target.
    Preload(i32),
    /// Read the target back.
    Check(i32),
    /// Choose the mode.
    SetMode,
    /// Wait until the mode is in force.
    Mode,
    /// Switch on.
    Power(Power),
}

impl Enabling {
    pub(super) fn ask(self, parts: &Parts) -> Ask {
        match self {
            Self::LimitMin => Ask::LimitMin,
            Self::LimitMax => Ask::LimitMax,
            Self::Position => Ask::Position,
            Self::Preload(target) => Ask::Preload(target),
            Self::Check(_) => Ask::Target,
            Self::SetMode => Ask::SetMode(parts.streaming_mode),
            Self::Mode => Ask::Mode,
            Self::Power(power) => power.ask(),
        }
    }

    pub(super) fn take(
        &mut self,
        ask: Ask,
        raw: u32,
        parts: &Parts,
        limits: &RangeInclusive<i32>,
    ) -> Progress {
        match (*self, ask) {
            (Self::LimitMin, Ask::LimitMin) if i32::from_raw(raw) == *limits.start() => {
                *self = Self::LimitMax
            }
            (Self::LimitMax, Ask::LimitMax) if i32::from_raw(raw) == *limits.end() => {
                *self = Self::Position
            }
            (Self::LimitMin, Ask::LimitMin) | (Self::LimitMax, Ask::LimitMax) => {
                return Progress::Failed(Failure::Restarted);
            }
            (Self::Position, Ask::Position) => {
                return self.take_position(i32::from_raw(raw), limits);
            }
            (Self::Preload(target), Ask::Preload(_)) => *self = Self::Check(target),
            (Self::Check(target), Ask::Target) if i32::from_raw(raw) == target => {
                *self = Self::SetMode
            }
            (Self::Check(target), Ask::Target) => {
                let (written, found) = (Counts(target), Counts(i32::from_raw(raw)));
                return Progress::Failed(Failure::Preload { written, found });
            }
            (Self::SetMode, Ask::SetMode(_)) => *self = Self::Mode,
            (Self::Mode, Ask::Mode) if i8::from_raw(raw) == parts.streaming_mode => {
                *self = Self::Power(Power::towards(Goal::On));
            }
            (Self::Power(mut power), Ask::Control(_)) => {
                power.commanded();
                *self = Self::Power(power);
            }
            (Self::Power(power), Ask::Status) => {
                return self.look(power, Statusword(u16::from_raw(raw)).state());
            }
            _ => {}
        }
        Progress::Going
    }

    fn take_position(&mut self, position: i32, limits: &RangeInclusive<i32>) -> Progress {
        if !limits.contains(&position) {
            let (position, min, max) = (
                Counts(position),
                Counts(*limits.start()),
                Counts(*limits.end()),
            );
            return Progress::Failed(Failure::OutsideLimits { position, min, max });
        }
        *self = Self::Preload(position);
        Progress::Going
    }

    fn look(&mut self, mut power: Power, state: Option<State>) -> Progress {
        let reached = state.is_some_and(|state| power.look(state));
        *self = Self::Power(power);
        if reached {
            Progress::Done
        } else {
            Progress::Going
        }
    }
}
