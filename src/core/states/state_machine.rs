//! State machine: the only place where the state changes.

use serde::{Deserialize, Serialize};

use crate::core::events::{CycleEventKind, EventList};
use crate::core::states::control_state::{ControlState, DisabledActivity};
use crate::robot::{Fault, Refusal, StateCommand, Stop};
use crate::units::Nanos;

/// A state and the reason to change to it.
pub(crate) type Transition = (ControlState, TransitionCause);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TransitionCause {
    Command(StateCommand),
    /// The activity of a state advanced or ended; with the command that had started it, if the end
    /// is reported.
    Progress(Option<StateCommand>),
    /// The activity is interrupted.
    BrokenOff(Stop),
    Fault(Fault),
    Shutdown,
}

impl TransitionCause {
    fn command(self) -> Option<StateCommand> {
        match self {
            Self::Command(command) => Some(command),
            Self::Progress(command) => command,
            Self::BrokenOff(_) | Self::Fault(_) | Self::Shutdown => None,
        }
    }

    /// Stop cause for the activity that this transition ends.
    fn stop(self) -> Option<Stop> {
        match self {
            Self::Progress(_) => None,
            Self::BrokenOff(stop) => Some(stop),
            Self::Fault(_) => Some(Stop::Fault),
            Self::Command(_) | Self::Shutdown => Some(Stop::Command),
        }
    }

    fn fault(self) -> Fault {
        match self {
            Self::Fault(fault) => fault,
            Self::Command(_) | Self::Progress(_) | Self::BrokenOff(_) | Self::Shutdown => {
                Fault::None
            }
        }
    }
}

/// The state, its time of entry, the last fault and the end of the last activity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct StateMachine {
    state: ControlState,
    since: Nanos,
    fault: Fault,
    broken_off: Option<Stop>,
}

impl StateMachine {
    /// DISABLED, until the drives report that they are on.
    pub(crate) fn new() -> Self {
        Self {
            state: ControlState::Disabled(DisabledActivity::Idle),
            since: Nanos::ZERO,
            fault: Fault::None,
            broken_off: None,
        }
    }

    /// The first tick.
    pub(crate) fn start(&mut self, now: Nanos) {
        self.since = now;
    }

    pub(crate) fn state(&self) -> &ControlState {
        &self.state
    }

    /// Time of the last change of the operating state.
    pub(crate) fn since(&self) -> Nanos {
        self.since
    }

    /// Refuses an acknowledge that was sent before the fault: its client cannot have seen it.
    pub(crate) fn require_seen(&self, sent: Nanos) -> Result<(), Refusal> {
        let is_older = matches!(self.state, ControlState::Fault(_)) && sent < self.since;
        if is_older { Err(Refusal::InFault) } else { Ok(()) }
    }

    /// The present fault, or the last one.
    pub(crate) fn fault(&self) -> Fault {
        self.fault
    }

    /// Cause that interrupted the last activity of a command, or a later stream; `None` if it
    /// continues or was completed.
    pub(crate) fn broken_off(&self) -> Option<Stop> {
        self.broken_off
    }

    /// Changes the state. Every change of the operating state, every command that starts an
    /// activity and every fault is an event; steps in between are not.
    pub(crate) fn change(&mut self, transition: Transition, now: Nanos, events: &mut EventList) {
        let (next, cause) = transition;
        let (from, to) = (self.state.operating_state(), next.operating_state());
        let (command, fault) = (cause.command(), cause.fault());
        if from != to {
            self.since = now;
        }
        if fault != Fault::None {
            self.fault = fault;
        }
        if from != to || matches!(cause, TransitionCause::Command(_)) || fault != Fault::None {
            events.push(CycleEventKind::State { from, to, command, fault });
        }
        let (before, after) = (self.state.activity(), next.activity());
        if after != before {
            self.broken_off = before.and_then(|_| cause.stop()).filter(|_| after.is_none());
        } else if let TransitionCause::BrokenOff(stop) = cause {
            self.broken_off = Some(stop);
        }
        self.state = next;
    }

    /// Changes the state because its activity advanced or ended.
    pub(crate) fn progress(&mut self, next: ControlState, now: Nanos, events: &mut EventList) {
        self.change((next, TransitionCause::Progress(None)), now, events);
    }
}
