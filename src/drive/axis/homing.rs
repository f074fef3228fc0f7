//! Homing: the drive finds its zero by itself.

use super::Progress;
use super::ask::Ask;
use super::power::Power;
use crate::drive::cia402::{Controlword, Goal, Statusword};
use crate::drive::event::Failure;
use crate::drive::family::{HomingPlan, Parts};
use crate::drive::object::{Address, Setting, Value};
use crate::drive::request::AbortCode;

/// The steps, in order. Numbers are places in the lists of the plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Homing {
    /// Read where the motor stands.
    Position,
    /// Make that the target, for the case that the drive is not in homing mode after all. Before
    /// homing the position means nothing, so the drive may find it outside its limits and refuse;
    /// homing does not look at the target.
    Preload(i32),
    /// Choose the homing mode.
    SetMode,
    /// Wait until it is in force.
    Mode,
    /// Choose the method.
    SetMethod,
    /// Read it back.
    Method,
    /// Set what the method needs: little current first of all.
    Prepare(usize),
    /// Read that back.
    CheckPrepared(usize),
    /// Switch on.
    On(Power),
    /// Start.
    Start,
    /// Wait for the end.
    Run,
    /// Lower the start bit, ready for the next time.
    Lower,
    /// Switch off.
    Off(Power),
    /// Put back what was set.
    Restore(usize),
    /// Read that back.
    CheckRestored(usize),
    /// Choose the mode for set-points again.
    SetModeBack,
    /// Wait until it is in force.
    ModeBack,
}

impl Homing {
    pub(super) fn ask(self, parts: &Parts, plan: &HomingPlan) -> Ask {
        let listed = |list: &[Setting], place: usize, ask: fn(Setting) -> Ask| {
            // A place is only ever entered when it is in its list.
            list.get(place).map_or(Ask::Status, |setting| ask(*setting))
        };
        let read_back = |setting: Setting| Ask::ReadBack(setting.object);
        match self {
            Self::Position => Ask::Position,
            Self::Preload(target) => Ask::Preload(target),
            Self::SetMode => Ask::SetMode(parts.homing_mode),
            Self::SetModeBack => Ask::SetMode(parts.streaming_mode),
            Self::Mode | Self::ModeBack => Ask::Mode,
            Self::SetMethod => Ask::SetMethod(plan.method()),
            Self::Method => Ask::Method,
            Self::Prepare(place) => listed(plan.settings(), place, Ask::Set),
            Self::CheckPrepared(place) => listed(plan.settings(), place, read_back),
            Self::Restore(place) => listed(plan.restored(), place, Ask::Set),
            Self::CheckRestored(place) => listed(plan.restored(), place, read_back),
            Self::On(power) | Self::Off(power) => power.ask(),
            Self::Start => Ask::StartHoming,
            Self::Run => Ask::Status,
            Self::Lower => Ask::Control(Controlword::ENABLE_OPERATION),
        }
    }

    pub(super) fn take(
        &mut self,
        ask: Ask,
        raw: u32,
        parts: &Parts,
        plan: &HomingPlan,
    ) -> Progress {
        let next = match (*self, ask) {
            (Self::Position, Ask::Position) => Self::Preload(i32::from_raw(raw)),
            (Self::Preload(_), Ask::Preload(_)) => Self::SetMode,
            (Self::SetMode, Ask::SetMode(_)) => Self::Mode,
            (Self::Mode, Ask::Mode) if i8::from_raw(raw) == parts.homing_mode => Self::SetMethod,
            (Self::SetMethod, Ask::SetMethod(_)) => Self::Method,
            (Self::Method, Ask::Method) if i8::from_raw(raw) == plan.method() => {
                Self::prepare(0, plan)
            }
            (Self::Method, Ask::Method) => return Progress::Failed(Failure::HomingMethod),
            (Self::Prepare(place), Ask::Set(_)) => Self::CheckPrepared(place),
            (Self::CheckPrepared(place), Ask::ReadBack(_)) => {
                match compare(plan.settings(), place, raw) {
                    Ok(()) => Self::prepare(place + 1, plan),
                    Err(failure) => return Progress::Failed(failure),
                }
            }
            (Self::On(power), _) => pass(power, ask, raw, Self::On, Self::Start),
            (Self::Start, Ask::StartHoming) => Self::Run,
            (Self::Run, Ask::Status) => match Statusword(u16::from_raw(raw)) {
                word if word.homing_error() => return Progress::Failed(Failure::HomingError),
                word if word.homing_attained() => Self::Lower,
                _ => Self::Run,
            },
            (Self::Lower, Ask::Control(_)) => Self::Off(Power::towards(Goal::Off)),
            (Self::Off(power), _) => pass(power, ask, raw, Self::Off, Self::restore(0, plan)),
            (Self::Restore(place), Ask::Set(_)) => Self::CheckRestored(place),
            (Self::CheckRestored(place), Ask::ReadBack(_)) => {
                match compare(plan.restored(), place, raw) {
                    Ok(()) => Self::restore(place + 1, plan),
                    Err(failure) => return Progress::Failed(failure),
                }
            }
            (Self::SetModeBack, Ask::SetMode(_)) => Self::ModeBack,
            (Self::ModeBack, Ask::Mode) if i8::from_raw(raw) == parts.streaming_mode => {
                return Progress::Done;
            }
            (same, _) => same,
        };
        *self = next;
        Progress::Going
    }

    fn prepare(place: usize, plan: &HomingPlan) -> Self {
        if place < plan.settings().len() {
            Self::Prepare(place)
        } else {
            Self::On(Power::towards(Goal::On))
        }
    }

    fn restore(place: usize, plan: &HomingPlan) -> Self {
        if place < plan.restored().len() {
            Self::Restore(place)
        } else {
            Self::SetModeBack
        }
    }

    /// The drive refused a step.
    pub(super) fn refused(&mut self, object: Address, code: AbortCode) -> Progress {
        match self {
            Self::Preload(_) => {
                *self = Self::SetMode;
                Progress::Going
            }
            _ => Progress::Failed(Failure::Refused { object, code }),
        }
    }

    /// A step was not answered. All may be asked for again but the start.
    pub(super) fn unanswered(self) -> Progress {
        if self == Self::Start {
            Progress::Failed(Failure::Unanswered)
        } else {
            Progress::Going
        }
    }

    /// The drive is meant to be powered: leaving operation enabled is an error.
    pub(super) fn is_powered(self) -> bool {
        matches!(self, Self::Start | Self::Run | Self::Lower)
    }
}

/// Compares what was read back with the setting at a place of a list.
fn compare(list: &[Setting], place: usize, found: u32) -> Result<(), Failure> {
    match list.get(place) {
        Some(setting) if setting.raw != found => Err(Failure::ReadBack {
            object: setting.object,
            written: setting.raw,
            found,
        }),
        _ => Ok(()),
    }
}

/// Passes an answer to a change of power, and tells the step after it.
fn pass(mut power: Power, ask: Ask, raw: u32, same: fn(Power) -> Homing, next: Homing) -> Homing {
    match ask {
        Ask::Control(_) => power.commanded(),
        Ask::Status
            if Statusword(u16::from_raw(raw))
                .state()
                .is_some_and(|state| power.look(state)) =>
        {
            return next;
        }
        _ => {}
    }
    same(power)
}
