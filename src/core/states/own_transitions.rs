//! What a state does by itself as time passes and drives answer.

use crate::core::states::drive_status::{Expected, Sight, off};
use crate::core::states::state::{Cause, Failure, Inactive, Motion, Stage, State};
use crate::drive::{AxisPhase, Demand};
use crate::robot::{Fault, StateCommand};
use crate::units::{MAX_MOTORS, Nanos};

/// How long a drive may take to be enabled, switched off or brought to a quick stop. Each takes
/// about ten exchanges: 25 ms at 115200 baud, a quarter of a second at 9600, and a ramp of the
/// drive. 3 s leaves room for repeats.
const DRIVE_TIMEOUT: Nanos = Nanos::from_millis(3000);

/// How long a fault reset may take until the drive has left its fault: a handful of exchanges, and
/// room for repeats.
const RESET_TIMEOUT: Nanos = Nanos::from_millis(1000);

/// How long homing may take. Method 37 ("here is zero") takes as long as enabling; a search for a
/// hard stop takes seconds.
const HOMING_TIMEOUT: Nanos = Nanos::from_millis(30_000);

/// How long the set-points may take to stop before the power goes anyway. At the default limits it
/// takes 2 ms.
const STOP_TIMEOUT: Nanos = Nanos::from_millis(1000);

/// How long a motor gets to come to rest on its last set-point, and how long a drive that reports
/// to be off is not believed, because the report may be older than the demand. A dozen exchanges.
const SETTLE_TIME: Nanos = Nanos::from_millis(50);

/// What comes next.
pub(crate) type Next = Option<(State, Cause)>;

/// What a state does by itself in this tick.
pub(crate) fn progress(state: &State, sight: &Sight) -> Next {
    if let State::Fault(failure) = state {
        return failed(failure, sight);
    }
    if let Some(fault) = wrong(state, sight) {
        return Some(fail(state, fault, sight));
    }
    match state {
        State::Disabled(stage) => disabled(stage, sight),
        State::Enabled(Motion::Following(_) | Motion::Conditioning(_) | Motion::Moving(_))
            if !sight.fresh() || !sight.homed =>
        {
            Some((State::Enabled(Motion::Holding), Cause::Progress(None)))
        }
        State::Enabled(_) | State::Paused | State::Fault(_) => None,
    }
}

/// A fault: drives that work hold by quick stop, all others are switched off. See the reasons in
/// [`crate::core`].
pub(crate) fn fail(state: &State, fault: Fault, sight: &Sight) -> (State, Cause) {
    let expected = state.expected();
    let mut demands = [Demand::Disabled; MAX_MOTORS];
    for (demand, axis) in demands.iter_mut().zip(&sight.axes) {
        let Some(axis) = axis else { continue };
        let at_fault = match axis.wrong(expected, sight.lost) {
            Some(Fault::Drive | Fault::DriveState | Fault::FollowingError | Fault::Current) => true,
            Some(_) | None => false,
        };
        if expected == Expected::On && !at_fault {
            *demand = Demand::QuickStop;
        }
    }
    let stage = Stage::Latched {
        since: sight.now,
        demands,
    };
    (
        State::Fault(Failure {
            cause: fault,
            stage,
        }),
        Cause::Fault(fault),
    )
}

fn wrong(state: &State, sight: &Sight) -> Option<Fault> {
    let on = state.expected() == Expected::On;
    let of_all = [
        (!sight.model_sound, Fault::Model),
        (on && sight.late, Fault::Late),
    ];
    let of_all = of_all
        .into_iter()
        .chain([(on && sight.implausible, Fault::Implausible)]);
    sight.wrong(state.expected()).or_else(|| {
        of_all
            .into_iter()
            .find_map(|(is, fault)| is.then_some(fault))
    })
}

fn disabled(stage: &Inactive, sight: &Sight) -> Next {
    let now = sight.now;
    let past = |since: Nanos, span: Nanos| now.since(since) >= span;
    let step = |stage| Some((State::Disabled(stage), Cause::Progress(None)));
    let late = || Some(fail(&State::Disabled(*stage), Fault::DriveTimeout, sight));
    match *stage {
        // A drive that someone left on, or that was on its way when the demand changed.
        Inactive::Idle if !sight.off() => step(Inactive::PoweringOff { since: now }),
        Inactive::Idle => None,
        Inactive::Enabling { .. } if sight.all(AxisPhase::Enabled) => Some((
            State::Enabled(Motion::Holding),
            Cause::Progress(Some(StateCommand::Enable)),
        )),
        Inactive::Enabling { since } if past(since, DRIVE_TIMEOUT) => late(),
        Inactive::Homing { .. } if sight.homing_done && sight.homed => step(Inactive::Idle),
        Inactive::Homing { .. } if sight.homing_done => {
            Some(fail(&State::Disabled(*stage), Fault::Homing, sight))
        }
        Inactive::Homing { since } if past(since, HOMING_TIMEOUT) => late(),
        Inactive::Stopping { since } if sight.at_rest || past(since, STOP_TIMEOUT) => {
            step(Inactive::Settling { since: now })
        }
        Inactive::Settling { since } if past(since, SETTLE_TIME) => {
            step(Inactive::PoweringOff { since: now })
        }
        Inactive::PoweringOff { since } if sight.off() && past(since, SETTLE_TIME) => {
            step(Inactive::Idle)
        }
        Inactive::PoweringOff { since } if past(since, DRIVE_TIMEOUT) => late(),
        Inactive::Enabling { .. }
        | Inactive::Homing { .. }
        | Inactive::Stopping { .. }
        | Inactive::Settling { .. }
        | Inactive::PoweringOff { .. } => None,
    }
}

fn failed(failure: &Failure, sight: &Sight) -> Next {
    let now = sight.now;
    let cause = failure.cause;
    match failure.stage {
        Stage::Resetting { .. } if sight.reset_done => {
            let cause = Cause::Progress(Some(StateCommand::Acknowledge));
            Some((State::Disabled(Inactive::PoweringOff { since: now }), cause))
        }
        Stage::Resetting { since } if now.since(since) >= RESET_TIMEOUT => {
            let stage = Stage::Latched {
                since: now,
                demands: [Demand::Disabled; MAX_MOTORS],
            };
            Some((State::Fault(Failure { cause, stage }), Cause::Fault(cause)))
        }
        Stage::Resetting { .. } => None,
        Stage::Latched { since, demands } => {
            let settled = settled(since, demands, sight);
            let stage = Stage::Latched {
                since,
                demands: settled,
            };
            (settled != demands).then_some((
                State::Fault(Failure { cause, stage }),
                Cause::Progress(None),
            ))
        }
    }
}

/// A drive that is off stays off; one that does not come to its quick stop in time is switched off.
/// A drive that is out of reach keeps its demand: if the line comes back while it still has power,
/// it shall hold.
fn settled(since: Nanos, demands: [Demand; MAX_MOTORS], sight: &Sight) -> [Demand; MAX_MOTORS] {
    let late = sight.now.since(since) >= DRIVE_TIMEOUT;
    let mut settled = demands;
    for (demand, axis) in settled.iter_mut().zip(&sight.axes) {
        let Some(axis) = axis else { continue };
        match axis.phase {
            AxisPhase::QuickStopped | AxisPhase::Lost | AxisPhase::Starting => {}
            phase if off(phase) || late => *demand = Demand::Disabled,
            _ => {}
        }
    }
    settled
}
