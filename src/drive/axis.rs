//! One axis while the port thread runs: a state machine without I/O.
//!
//! The port thread asks it for the next exchange, carries that out, and hands the outcome back.
//! What the control loop demands is taken anew every time, so that the newest set-point is the one
//! that is written.
//!
//! After a fault, a loss, a failure or an interference from outside the axis does not come on again
//! by itself: the demand must have been something else than enabled in between.

mod ask;
mod cadence;
mod demand;
mod enabling;
mod homing;
mod outcome;
mod power;
mod stage;
mod steer;

use std::ops::RangeInclusive;

use crate::config::{AxisConfig, Polling};
use crate::units::{Counts, Nanos};

use super::cia402::{State, Statusword};
use super::error::{AxisFault, LinkError};
use super::event::{Failure, PortEvent, PortEventKind};
use super::family::{Drive, HomingPlan};
use super::object::Address;
use super::request::AbortCode;
use super::{AxisFeedback, AxisRequest, Demand, LinkCounters};

pub(super) use ask::{Access, Ask};
use cadence::Cadence;
use stage::Stage;
use steer::Steer;

/// How long the drive may take to report quick stop, and then to stand still.
const STOP_DEADLINE: Nanos = Nanos::from_millis(1000);

/// Where events go.
pub(super) type Events<'a> = &'a mut dyn FnMut(PortEvent);

/// How a step of a procedure ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Progress {
    Going,
    Done,
    Failed(Failure),
}

/// What an exchange brought: the value read (0 for a write), and when.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reply {
    pub(super) raw: u32,
    pub(super) sent: Nanos,
    pub(super) received: Nanos,
}

/// One axis.
#[derive(Debug)]
pub(super) struct Axis {
    motor: usize,
    limits: RangeInclusive<i32>,
    /// How far it can have gone from where it was last seen: to its last set-point, counts.
    reach: u32,
    drive: &'static dyn Drive,
    plan: HomingPlan,
    stage: Stage,
    rearm: Rearm,
    polling: Polling,
    cadence: Cadence,
    steer: Steer,
    feedback: AxisFeedback,
    /// The position jumped while no one looked: what the drive says of its zero is not believed
    /// until it is homed.
    displaced: bool,
    /// Homing changed settings that have not been put back.
    unrestored: bool,
    still: bool,
    misses: u32,
    reported: Reported,
}

/// Whether a demand for enabled may be obeyed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rearm {
    /// The demand was something else than enabled since the last trouble.
    Free,
    /// It must be something else first.
    Held,
}

/// What was reported last, so that repeats are not.
#[derive(Debug, Clone, Copy, Default)]
struct Reported {
    target: bool,
    refusal: Option<(Address, AbortCode)>,
    fault: Option<AxisFault>,
}

impl Axis {
    pub(super) fn new(config: &AxisConfig, drive: &'static dyn Drive, polling: Polling) -> Self {
        Self {
            motor: config.motor,
            limits: config.position_min_counts.0..=config.position_max_counts.0,
            reach: config.following_error_counts,
            drive,
            plan: drive.homing(config),
            stage: Stage::Starting,
            rearm: Rearm::Held,
            polling,
            cadence: Cadence::new(polling),
            steer: Steer::default(),
            displaced: false,
            unrestored: false,
            feedback: AxisFeedback::default(),
            still: false,
            misses: 0,
            reported: Reported::default(),
        }
    }

    /// The drive of the axis.
    pub(super) fn drive(&self) -> &'static dyn Drive {
        self.drive
    }

    /// What the control loop shall see.
    pub(super) fn feedback(&self, counters: LinkCounters) -> AxisFeedback {
        AxisFeedback {
            counters,
            ..self.feedback
        }
    }

    pub(super) fn is_lost(&self) -> bool {
        self.stage == Stage::Lost
    }

    /// A request to be off, and nothing else.
    pub(super) fn rest(&self) -> AxisRequest {
        let AxisFeedback {
            fault_resets,
            homings,
            ..
        } = self.feedback;
        AxisRequest {
            demand: Demand::Disabled,
            fault_resets,
            homings,
            ..AxisRequest::default()
        }
    }

    /// There is nothing left to switch off, or no way to.
    pub(super) fn is_at_rest(&self) -> bool {
        matches!(
            self.stage,
            Stage::Disabled | Stage::Faulted(_) | Stage::Lost
        )
    }

    /// The power stage is known to be off.
    pub(super) fn is_off(&self) -> bool {
        matches!(self.stage, Stage::Disabled)
            || Statusword(self.feedback.statusword).state() == Some(State::Fault)
    }

    /// The axis does not answer any more.
    pub(super) fn lose(&mut self, error: LinkError, events: Events<'_>) {
        if self.stage != Stage::Lost {
            self.report(PortEventKind::Lost(error), events);
            self.enter(Stage::Lost, events);
        }
    }

    /// The axis answers again, is the right one, off, and limited. `position` is where it stands
    /// now: further from where it was last seen than it could have gone by itself, it has been
    /// moved, or counts from another zero.
    pub(super) fn readmit(&mut self, position: i32, events: Events<'_>) {
        let (before, after) = (self.feedback.position, Counts(position));
        if self.feedback.stamp > Nanos::ZERO && before.0.abs_diff(after.0) > self.reach {
            self.displace(Some(before), after, events);
        }
        self.misses = 0;
        self.unrestored = false;
        self.reported = Reported::default();
        self.report(PortEventKind::Readmitted, events);
        self.enter(Stage::Starting, events);
    }

    /// The position is not where it was left: what the drive says of its zero is not believed until
    /// the axis is homed.
    pub(super) fn displace(&mut self, before: Option<Counts>, after: Counts, events: Events<'_>) {
        self.displaced = true;
        self.feedback.homed = false;
        self.report(PortEventKind::Displaced { before, after }, events);
    }

    /// Compares where the axis stands with where it was left, at the start of the controller.
    pub(super) fn compare(&mut self, before: Option<Counts>, after: Counts, events: Events<'_>) {
        if before.is_none_or(|before| before.0.abs_diff(after.0) > self.reach) {
            self.displace(before, after, events);
        }
    }

    /// Where it rests, switched off and homed: a place to find it again.
    pub(super) fn resting_place(&self) -> Option<Counts> {
        (self.stage == Stage::Disabled && self.feedback.homed).then_some(self.feedback.position)
    }

    /// The axis answers, but is not usable as it is.
    pub(super) fn refuse(&mut self, fault: AxisFault, events: Events<'_>) {
        if self.reported.fault != Some(fault) {
            self.reported.fault = Some(fault);
            self.report(PortEventKind::NotUsable(fault), events);
        }
    }

    /// The one place where an axis changes its phase.
    fn enter(&mut self, stage: Stage, events: Events<'_>) {
        let from = self.stage.phase();
        match (self.stage, stage) {
            (Stage::Homing(..), Stage::Disabled) => self.end_homing_with(None, events),
            (Stage::Homing(..), _) => self.end_homing_with(Some(Failure::Interrupted), events),
            (Stage::Faulted(step), _) => {
                self.feedback.fault_resets = step.count().unwrap_or(self.feedback.fault_resets);
            }
            _ => {}
        }
        if matches!(stage, Stage::Starting | Stage::Faulted(_) | Stage::Lost) {
            self.rearm = Rearm::Held;
        }
        if matches!(stage, Stage::Enabling(..) | Stage::Homing(..)) {
            // The drive is given another target, or another zero.
            self.feedback.written = None;
        }
        self.still = false;
        self.stage = stage;
        self.cadence = Cadence::new(self.polling);
        self.steer = Steer::default();
        self.reported.refusal = None;
        let (to, statusword) = (stage.phase(), self.feedback.statusword);
        self.feedback.phase = to;
        if from != to {
            self.report(
                PortEventKind::Phase {
                    from,
                    to,
                    statusword,
                },
                events,
            );
        }
    }

    /// Homing ends once, and is answered once.
    fn end_homing_with(&mut self, failure: Option<Failure>, events: Events<'_>) {
        if let Stage::Homing(_, _, count) = self.stage
            && self.feedback.homings != count
        {
            self.feedback.homings = count;
            self.displaced &= failure.is_some();
            self.report(PortEventKind::HomingEnded { failure }, events);
        }
    }

    fn state(&self) -> Option<State> {
        Statusword(self.feedback.statusword).state()
    }

    fn report_target(&mut self, target: Counts, events: Events<'_>) {
        let (min, max) = (Counts(*self.limits.start()), Counts(*self.limits.end()));
        if !self.reported.target {
            self.reported.target = true;
            self.report(PortEventKind::TargetRefused { target, min, max }, events);
        }
    }

    fn report_refusal(&mut self, object: Address, code: AbortCode, events: Events<'_>) {
        if self.reported.refusal != Some((object, code)) {
            self.reported.refusal = Some((object, code));
            self.report(PortEventKind::Refused { object, code }, events);
        }
    }

    /// Reports what happened.
    pub(super) fn report(&self, kind: PortEventKind, events: Events<'_>) {
        events(PortEvent {
            motor: self.motor,
            kind,
        });
    }
}
