//! What an axis does next: the demand of the control loop, deadlines, and the turn of the line.

use super::ask::Ask;
use super::cadence::{Extra, Slot};
use super::enabling::Enabling;
use super::homing::Homing;
use super::power::Power;
use super::stage::{FaultStep, Stage};
use super::{Axis, Events, Rearm, STOP_DEADLINE};
use crate::drive::cia402::{Goal, State};
use crate::drive::event::{Failure, PortEventKind};
use crate::drive::{AxisRequest, Demand};
use crate::units::Nanos;

/// How long enabling may take.
const ENABLE_DEADLINE: Nanos = Nanos::from_millis(2000);

/// How long switching off in order may take before the power is cut, and cutting it before it is
/// tried again.
const OFF_DEADLINE: Nanos = Nanos::from_millis(2000);

/// How long homing may take. Taking the present position as zero takes a few exchanges.
const HOMING_DEADLINE: Nanos = Nanos::from_millis(10_000);

/// How long looking for a hard stop may take, at the slow speed that it takes.
const STOP_SEARCH_DEADLINE: Nanos = Nanos::from_millis(60_000);

impl Axis {
    /// The next exchange, towards what the control loop demands. On a line that is `late`, what is
    /// not pressing is left out.
    pub(in crate::drive) fn next(
        &mut self,
        request: &AxisRequest,
        now: Nanos,
        late: bool,
        events: Events<'_>,
    ) -> Ask {
        self.check_deadline(now, events);
        if request.demand != Demand::Enabled {
            self.rearm = Rearm::Free;
        }
        self.obey(request, now, events);
        self.acknowledge(request, events);
        if self.stage == Stage::Enabled {
            self.follow(request, late, events)
        } else {
            self.go_on()
        }
    }

    fn follow(&mut self, request: &AxisRequest, late: bool, events: Events<'_>) -> Ask {
        if let Some(ask) = self.steer.ask() {
            return ask;
        }
        match self.cadence.following(late) {
            Slot::Lead if self.limits.contains(&request.target.0) => Ask::Follow(*request),
            // Clamping would move the motor somewhere that no one asked for.
            Slot::Lead => {
                self.report_target(request.target, events);
                self.cadence.following(late);
                Ask::Position
            }
            Slot::Position => Ask::Position,
            Slot::Extra(extra) => extra_ask(extra),
        }
    }

    fn go_on(&mut self) -> Ask {
        match (
            self.cadence.idle(),
            self.stage.ask(self.drive.parts(), &self.plan),
        ) {
            ((Slot::Position, _), _) => Ask::Position,
            ((_, _), Some(ask)) => ask,
            ((_, extra), None) => extra_ask(extra),
        }
    }

    /// Starts what the demand asks for.
    fn obey(&mut self, request: &AxisRequest, now: Nanos, events: Events<'_>) {
        let homing = request.homings != self.feedback.homings;
        let reset = request.fault_resets != self.feedback.fault_resets;
        match (self.stage, request.demand) {
            (Stage::Disabled, Demand::Disabled | Demand::QuickStop) if homing => {
                let span = if self.plan.moves() {
                    STOP_SEARCH_DEADLINE
                } else {
                    HOMING_DEADLINE
                };
                self.enter(
                    Stage::Homing(Homing::Position, now + span, request.homings),
                    events,
                );
            }
            (Stage::Disabled | Stage::QuickStopped(_), Demand::Enabled)
                if self.rearm == Rearm::Free =>
            {
                self.enter(
                    Stage::Enabling(Enabling::LimitMin, now + ENABLE_DEADLINE),
                    events,
                );
            }
            (Stage::Enabled, Demand::QuickStop) => {
                self.enter(
                    Stage::QuickStopping(Power::towards(Goal::Stopped), now + STOP_DEADLINE),
                    events,
                );
            }
            // Out of quick stop the power goes at once, so the ramp is waited for.
            (Stage::QuickStopped(by), Demand::Disabled) if !self.still && now < by => {}
            (Stage::Enabling(..) | Stage::Enabled | Stage::QuickStopped(..), Demand::Disabled)
            | (Stage::Enabling(..) | Stage::Homing(..), Demand::QuickStop) => {
                self.switch_off(now, events);
            }
            (Stage::Faulted(FaultStep::Rest), _) if reset && self.state() == Some(State::Fault) => {
                self.stage = Stage::Faulted(FaultStep::Lower(request.fault_resets));
            }
            _ => {}
        }
    }

    /// Answers counters that ask for something which this stage does not do: an old request must
    /// not be carried out much later, when no one expects it.
    pub(in crate::drive) fn acknowledge(&mut self, request: &AxisRequest, events: Events<'_>) {
        if !matches!(self.stage, Stage::Faulted(_) | Stage::Starting) {
            self.feedback.fault_resets = request.fault_resets;
        }
        if !matches!(self.stage, Stage::Homing(..) | Stage::Starting)
            && self.feedback.homings != request.homings
        {
            self.feedback.homings = request.homings;
            self.report(PortEventKind::HomingRefused, events);
        }
    }

    /// Powers the axis down, whatever is going on.
    pub(in crate::drive) fn power_down(&mut self, now: Nanos, events: Events<'_>) {
        if !self.is_at_rest() && !matches!(self.stage, Stage::Disabling(..)) {
            self.give_up(now, events);
        }
    }

    /// Switches off because something went wrong.
    pub(super) fn give_up(&mut self, now: Nanos, events: Events<'_>) {
        self.rearm = Rearm::Held;
        self.switch_off(now, events);
    }

    fn switch_off(&mut self, now: Nanos, events: Events<'_>) {
        self.enter(
            Stage::Disabling(Power::towards(Goal::Off), now + OFF_DEADLINE),
            events,
        );
    }

    fn check_deadline(&mut self, now: Nanos, events: Events<'_>) {
        let late = Failure::Deadline {
            statusword: self.feedback.statusword,
        };
        match self.stage {
            Stage::Enabling(_, deadline) if now > deadline => {
                self.report(PortEventKind::EnableFailed(late), events);
                self.give_up(now, events);
            }
            Stage::QuickStopping(_, deadline) if now > deadline => {
                self.report(PortEventKind::QuickStopFailed(late), events);
                self.give_up(now, events);
            }
            Stage::Homing(_, deadline, _) if now > deadline => self.fail_homing(late, now, events),
            Stage::Faulted(FaultStep::Watch(count, deadline)) if now > deadline => {
                self.end_reset(count, events)
            }
            Stage::Disabling(_, deadline) if now > deadline => {
                self.report(
                    PortEventKind::StillOn {
                        state: self.state(),
                    },
                    events,
                );
                self.stage = Stage::Disabling(Power::towards(Goal::Cut), now + OFF_DEADLINE);
            }
            _ => {}
        }
    }
}

fn extra_ask(extra: Extra) -> Ask {
    match extra {
        Extra::Status => Ask::Status,
        Extra::ErrorCode => Ask::ErrorCode,
        Extra::Current => Ask::Current,
    }
}
