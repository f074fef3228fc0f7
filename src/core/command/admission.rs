//! Command admission: the checks that a servo command must pass before it is followed.
//!
//! A command is checked completely before anything changes. The first check that fails names the
//! reason, in this order:
//!
//! | | check | refusal | file |
//! |---|---|---|---|
//! | 1 | client id not 0, no unknown flag, number of entries possible | `Malformed` | `admission` |
//! | 2 | every entry finite | `NotFinite` | `admission` |
//! | 3 | stamp at most 2 ms in the future, deadline at most 1 s | `Stamp` | `client_stream` |
//! | 4 | younger than its deadline | `Stale` | `client_stream` |
//! | 5 | state ENABLED, | `NotEnabled`, `Paused`, `InFault` | `admission` |
//! |   | no conditioning cycle or trajectory in progress | `Conditioning`, `Busy` | `admission` |
//! | 6 | every axis homed | `NotHomed` | `admission` |
//! | 7 | positions of all drives fresh | `DrivesNotReady` | `admission` |
//! | 8 | no other client commands | `Lease` | `authority` |
//! | 9 | the client has a session or begins one, | `StreamInterrupted` | `sessions` |
//! |   | and is not held | `StreamInterrupted` | `authority` |
//! | 10 | sequence above the client's last accepted one, | `Sequence` | `client_stream` |
//! |   | and stamp not before it | `Stamp` | `client_stream` |
//! |   | counts: no virtual fixture is active | `Fixture` | `cycle/commands` |
//! | 11 | a model; for rates and places: of angles | `NoModel`, `Unsupported` | `range_check` |
//! | 12 | number of entries as the model or the motors have | `Malformed` | `range_check` |
//! | 13 | counts: within the position limits of the axes | `Range` | `range_check` |
//! | 14 | near the last goal or setpoint; rates: by the deadline | `StepTooLarge` | `range_check` |
//!
//! Errors of the command itself come before errors of the present situation. A refused command
//! changes only counters: it does not renew the lease and does not use up its sequence number.
//!
//! Checks 1 to 4 do not depend on the robot: [`CommandCheck`]. The thread that chooses among the
//! commands of several clients also applies them, so an invalid command cannot displace a valid
//! one.

use serde::{Deserialize, Serialize};

use crate::config::CommandConfig;
use crate::core::command::authority::Access;
use crate::core::command::client_stream::DeadlineCheck;
use crate::core::command::refusal_record::{ClientRefusals, RefusalRecord};
use crate::core::command::sessions::{Arrival, Sessions};
use crate::core::events::{CycleEventKind, EventList};
use crate::core::inputs::{ServoCommand, ServoGoal};
use crate::robot::{Measurement, OperatingState, Quantity, REFUSED_CLIENTS, Refusal, StateCommand};
use crate::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec, Nanos, OutputVec};

/// Deadline of `interpolate_jp`, unless the client requests another: a stream of 10 Hz may miss a
/// command. Without the next command, the goal comes to rest at its end long before.
const INTERPOLATED_DEADLINE: Nanos = Nanos::from_millis(250);

#[derive(Debug, Clone, Copy)]
pub struct AdmissionContext {
    pub state: OperatingState,
    /// The refusal while a conditioning cycle or a trajectory is in progress.
    pub unoccupied: Result<(), Refusal>,
    /// The client whose activity is in progress.
    pub owner: Option<u64>,
    /// Every axis has a valid zero.
    pub is_homed: bool,
    pub is_fresh: bool,
}

/// Checks 1 to 4, which concern only the command.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CommandCheck {
    deadline: DeadlineCheck,
}

impl CommandCheck {
    pub fn new(config: &CommandConfig) -> Self {
        Self { deadline: DeadlineCheck::new(Nanos::from_millis(config.deadline_ms)) }
    }

    /// Checks a command and returns its deadline. Fails with the first check.
    pub fn check(&self, command: &ServoCommand, now: Nanos) -> Result<Nanos, Refusal> {
        require_well_formed(command)?;
        self.deadline.check(command.stamp, deadline(command), now)
    }
}

/// Checks 1 to 10, and the counters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CommandAdmission {
    check: CommandCheck,
    pub(in crate::core) sessions: Sessions,
    refusals: RefusalRecord,
    /// Refusals of state commands, to fold their events.
    request_refusals: RefusalRecord,
    /// Numbers of servo commands.
    pub(in crate::core) accepted: u64,
    pub(in crate::core) refused: u64,
    pub(in crate::core) last_refusal: Refusal,
}

impl CommandAdmission {
    pub fn new(config: &CommandConfig) -> Self {
        Self {
            check: CommandCheck::new(config),
            sessions: Sessions::new(Nanos::from_millis(config.lease_timeout_ms)),
            refusals: RefusalRecord::default(),
            request_refusals: RefusalRecord::default(),
            accepted: 0,
            refused: 0,
            last_refusal: Refusal::None,
        }
    }

    pub fn refusals(&self) -> [ClientRefusals; REFUSED_CLIENTS] {
        self.refusals.clients()
    }

    /// Records the refusal of a request. Returns whether it is an event: repeats are folded.
    pub(crate) fn refuse_request(&mut self, client_id: u64, refusal: Refusal, now: Nanos) -> bool {
        self.last_refusal = refusal;
        self.sessions.request_refused(client_id, now);
        self.request_refusals.record(client_id, refusal, now)
    }

    pub(crate) fn accept_request(&mut self, command: StateCommand, client_id: u64, now: Nanos) {
        self.request_refusals.accepted(client_id);
        self.sessions.carried_out(command, client_id, now);
    }

    /// The client that commands, as the owner of the activity in progress or the holder of the
    /// lease; 0: none.
    pub(crate) fn commander(&self, owner: Option<u64>) -> u64 {
        owner.unwrap_or(self.sessions.holder())
    }

    /// The table of `authority`.
    pub(crate) fn require(
        &self,
        access: Access,
        client_id: u64,
        owner: Option<u64>,
        now: Nanos,
    ) -> Result<(), Refusal> {
        self.sessions.require(access, client_id, self.commander(owner), now)
    }

    /// The age at which a command that was checked becomes stale: at most the duration of the
    /// lease, because a client that has lost its lease is not followed.
    pub fn deadline(&self, command: &ServoCommand) -> Nanos {
        self.check.deadline.of(deadline(command)).min(self.sessions.lease_duration)
    }

    /// Age or stamp that makes a command stale or invalid.
    pub(crate) fn deadline_measurement(
        &self,
        command: &ServoCommand,
        now: Nanos,
    ) -> Option<Measurement> {
        let check = &self.check.deadline;
        if let Some((_, last)) = self.sessions.last(command.client_id)
            && check.check(command.stamp, deadline(command), now).is_ok()
        {
            return Some(Measurement::from_age(last.duration_since(command.stamp), Nanos::ZERO));
        }
        Some(check.measurement(command.stamp, deadline(command), now))
    }

    pub(crate) fn sequence_measurement(&self, command: &ServoCommand) -> Option<Measurement> {
        let last = self.sessions.last(command.client_id).map(|(last, _)| last as f64);
        Some(Measurement::new(Quantity::Sequence, command.sequence as f64, last))
    }

    /// Checks 1 to 10. Returns the deadline of the command. Fails with the first check.
    pub(crate) fn check(
        &self,
        arrival: Arrival<'_>,
        context: &AdmissionContext,
    ) -> Result<Nanos, Refusal> {
        let Arrival { command, now, .. } = arrival;
        self.check.check(command, now)?;
        require_ready(context)?;
        self.require(Access::Alone, command.client_id, context.owner, now)?;
        self.sessions.require_stream(arrival)?;
        Ok(self.deadline(command))
    }

    /// Records an accepted command, with the setpoints where they are, counts.
    pub(crate) fn accept(
        &mut self,
        arrival: Arrival<'_>,
        setpoints: &MotorVec,
        events: &mut EventList,
    ) {
        let (client_id, deadline) = (arrival.command.client_id, self.deadline(arrival.command));
        self.sessions.accepted(arrival, setpoints, deadline);
        if self.sessions.renew_lease(client_id, arrival.now) {
            events.push(CycleEventKind::Lease { client_id });
        }
        self.refusals.accepted(client_id);
        self.accepted = self.accepted.saturating_add(1);
    }

    /// Records a refused command. Returns whether it is an event: repeats are folded.
    pub(crate) fn refuse(&mut self, arrival: Arrival<'_>, refusal: Refusal) -> bool {
        self.refused = self.refused.saturating_add(1);
        self.last_refusal = refusal;
        self.sessions.refused(arrival, refusal);
        self.refusals.record(arrival.command.client_id, refusal, arrival.now)
    }

    /// Frees the lease of a client that has been silent for too long, unless a move or a
    /// conditioning cycle is in progress, which is its own.
    pub(crate) fn expire_lease(&mut self, is_occupied: bool, now: Nanos, events: &mut EventList) {
        if !is_occupied && self.sessions.expire_lease(now) {
            events.push(CycleEventKind::Lease { client_id: 0 });
        }
    }

    /// Ends every session because a client stopped the robot. A `hold` also ends the lease of
    /// others.
    pub(crate) fn stopped(
        &mut self,
        client_id: u64,
        is_hold: bool,
        now: Nanos,
        events: &mut EventList,
    ) {
        self.sessions.stopped(client_id, is_hold, now);
        let holder = self.sessions.holder();
        if is_hold && holder != client_id {
            self.release_lease(holder, events);
        }
    }

    pub(crate) fn release_lease(&mut self, client_id: u64, events: &mut EventList) {
        if self.sessions.release_lease(client_id) {
            events.push(CycleEventKind::Lease { client_id: 0 });
        }
    }
}

fn require_well_formed(command: &ServoCommand) -> Result<(), Refusal> {
    let (values, entries, possible) = match command.goal {
        ServoGoal::Joint(values, entries)
        | ServoGoal::Interpolated(values, entries)
        | ServoGoal::Rate(values, entries) => (values, entries, 1..=MAX_OUTPUTS),
        ServoGoal::Tip(values, entries) | ServoGoal::TipRate(values, entries) => {
            (values, entries, MAX_OUTPUTS..=MAX_OUTPUTS)
        }
        ServoGoal::Actuator(_, entries) => (OutputVec::default(), entries, 1..=MAX_MOTORS),
    };
    let is_known = command.client_id != 0 && !command.has_unknown_flags;
    if !is_known || !possible.contains(&(entries as usize)) {
        return Err(Refusal::Malformed);
    }
    let is_finite = values.iter().take(entries as usize).all(|value| value.is_finite());
    if is_finite { Ok(()) } else { Err(Refusal::NotFinite) }
}

/// The deadline that a command asks for; zero: the configured one.
fn deadline(command: &ServoCommand) -> Nanos {
    match command.goal {
        ServoGoal::Interpolated(..) if command.deadline == Nanos::ZERO => INTERPOLATED_DEADLINE,
        _ => command.deadline,
    }
}

fn require_ready(context: &AdmissionContext) -> Result<(), Refusal> {
    match context.state {
        OperatingState::Enabled if context.unoccupied.is_err() => context.unoccupied,
        OperatingState::Enabled if !context.is_homed => Err(Refusal::NotHomed),
        OperatingState::Enabled if !context.is_fresh => Err(Refusal::DrivesNotReady),
        OperatingState::Enabled => Ok(()),
        OperatingState::Disabled => Err(Refusal::NotEnabled),
        OperatingState::Paused => Err(Refusal::Paused),
        OperatingState::Fault => Err(Refusal::InFault),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::command::sessions::StreamOf;
    use crate::units::Counts;

    const NOW: Nanos = Nanos::from_millis(5000);

    fn command(client_id: u64, sequence: u64) -> ServoCommand {
        ServoCommand {
            client_id,
            sequence,
            stamp: NOW,
            deadline: Nanos::ZERO,
            goal: ServoGoal::Actuator([Counts(0); MAX_MOTORS], 2),
            clutched: false,
            has_unknown_flags: false,
        }
    }

    #[test]
    fn an_accepted_request_ends_the_folding_of_refused_ones() {
        let mut admission = CommandAdmission::new(&CommandConfig::default());
        assert!(admission.refuse_request(7, Refusal::Busy, NOW));
        assert!(!admission.refuse_request(7, Refusal::Busy, NOW));
        admission.accept_request(StateCommand::Release, 8, NOW);
        assert!(!admission.refuse_request(7, Refusal::Busy, NOW));
        admission.accept_request(StateCommand::Release, 7, NOW);
        assert!(admission.refuse_request(7, Refusal::Busy, NOW));
        assert_eq!(admission.last_refusal, Refusal::Busy);
    }

    #[test]
    fn old_sequence_is_reported_with_the_last_accepted() {
        let mut admission = CommandAdmission::new(&CommandConfig::default());
        let first = admission.sequence_measurement(&command(7, 4)).unwrap();
        assert_eq!(first, Measurement::new(Quantity::Sequence, 4.0, None));
        let events = &mut EventList::new(NOW);
        let (of, command_9) = (StreamOf::Joints, &command(7, 9));
        admission.accept(Arrival { of, command: command_9, now: NOW }, &[0.0; 2], events);
        let old = admission.sequence_measurement(&command(7, 4)).unwrap();
        assert_eq!(old, Measurement::new(Quantity::Sequence, 4.0, Some(9.0)));
    }
}
