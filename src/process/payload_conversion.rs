//! Conversion between payloads and values of the core. Validation is left to the core; the server
//! sets sequence and boot id.

use crate::config::Config;
use crate::core::{
    CycleReport, ExternalPose, PlausibilityCheck, ServoCommand, ServoGoal, StateRequest, Validity,
};
use crate::ipc::payload::{
    ActuatorState, AdaptationMsg, ExternalPosition, Health, JointState, MoveRequest,
    OperatingStateMsg, ServoJp, StateCommandRequest, Version, VirtualFixtureRequest, padded_text,
};
use crate::ipc::server::ReceivedCommand;
use crate::process::channels::LostCounters;
use crate::process::fixture_table::FixtureTable;
use crate::realtime::Granted;
use crate::robot::{Refusal, StateCommand};
use crate::units::{Counts, MAX_OUTPUTS, Nanos, OutputVec};

const TIP_RATE: u32 = ServoJp::TIP | ServoJp::RATE;
const KINDS: u32 = TIP_RATE | ServoJp::INTERPOLATE;

impl From<&ReceivedCommand> for ServoCommand {
    fn from(raw: &ReceivedCommand) -> Self {
        match raw {
            ReceivedCommand::Joint(raw) => Self {
                client_id: raw.client_id,
                sequence: raw.sequence,
                stamp: Nanos(raw.stamp_ns),
                deadline: Nanos(raw.deadline_ns),
                goal: match raw.flags & KINDS {
                    ServoJp::RATE => ServoGoal::Rate(raw.position, raw.count),
                    ServoJp::INTERPOLATE => ServoGoal::Interpolated(raw.position, raw.count),
                    ServoJp::TIP => ServoGoal::Tip(raw.position, raw.count),
                    TIP_RATE => ServoGoal::TipRate(raw.position, raw.count),
                    _ => ServoGoal::Joint(raw.position, raw.count),
                },
                clutched: raw.flags & ServoJp::CLUTCH != 0,
                has_unknown_flags: raw.flags & !(KINDS | ServoJp::CLUTCH) != 0
                    || raw.flags & ServoJp::INTERPOLATE != 0 && raw.flags & TIP_RATE != 0,
            },
            ReceivedCommand::Actuator(raw) => Self {
                client_id: raw.client_id,
                sequence: raw.sequence,
                stamp: Nanos(raw.stamp_ns),
                deadline: Nanos(raw.deadline_ns),
                goal: ServoGoal::Actuator(raw.position_counts.map(Counts), raw.count),
                clutched: false,
                has_unknown_flags: raw.flags != 0,
            },
        }
    }
}

pub(super) fn validity(stamp_ns: u64, valid_ns: u64) -> Validity {
    Validity { stamp: Nanos(stamp_ns), span: Nanos(valid_ns) }
}

pub(super) fn state_request(id: u64, raw: &StateCommandRequest) -> Result<StateRequest, Refusal> {
    let command = StateCommand::from_number(raw.command).ok_or(Refusal::Malformed)?;
    // A later version may give the reserved field a meaning that this version would ignore.
    if raw.client_id == 0 || raw.reserved != 0 {
        return Err(Refusal::Malformed);
    }
    let (client_id, validity) = (raw.client_id, validity(raw.stamp_ns, raw.valid_ns));
    Ok(StateRequest { id, client_id, validity, command, pose: None, fixture: None })
}

pub(crate) fn move_request(id: u64, raw: &MoveRequest) -> Result<StateRequest, Refusal> {
    let pose = match raw.flags {
        0 => ServoGoal::Joint(raw.position, raw.count),
        MoveRequest::TIP => ServoGoal::Tip(raw.position, raw.count),
        _ => return Err(Refusal::Malformed),
    };
    let (client_id, validity) = (raw.client_id, validity(raw.stamp_ns, raw.valid_ns));
    let command = StateCommand::Move;
    Ok(StateRequest { id, client_id, validity, command, pose: Some(pose), fixture: None })
}

pub(crate) fn fixture_request(
    id: u64,
    raw: &VirtualFixtureRequest,
) -> Result<StateRequest, Refusal> {
    let fixture = Some(FixtureTable::parse(raw)?);
    let (client_id, validity) = (raw.client_id, validity(raw.stamp_ns, raw.valid_ns));
    let command = StateCommand::Fixture;
    Ok(StateRequest { id, client_id, validity, command, pose: None, fixture })
}

/// The measurement of a camera, if it is valid.
pub(super) fn external(raw: &ExternalPosition) -> Option<ExternalPose> {
    // A flag of a later version could change the meaning of the values.
    let valid = raw.flags == ExternalPosition::VALID && raw.count as usize <= MAX_OUTPUTS;
    let seen = ExternalPose {
        stamp: Nanos(raw.stamp_ns),
        position: raw.position,
        outputs: raw.count,
        quality: raw.quality,
    };
    (valid && raw.position.iter().all(|value| value.is_finite())).then_some(seen)
}

/// `goal_js`, `setpoint_js` and `measured_js` of one tick. Without a model they are not valid.
pub(super) fn joint_states(report: &CycleReport) -> [JointState; 3] {
    let mut base = JointState { stamp_ns: report.now.0, ..JointState::default() };
    let Some(joint) = report.joint else {
        return [base; 3];
    };
    base.model_id = joint.model.0;
    base.count = joint.outputs;
    base.flags = JointState::VALID
        | flag(joint.memory_known, JointState::MEMORY_KNOWN)
        | flag(report.clipped, JointState::CLIPPED)
        | flag(report.limited_by_fixture.is_some(), JointState::FIXTURE);
    let state =
        |position, velocity, deviation| JointState { position, velocity, deviation, ..base };
    let zero = OutputVec::default();
    [
        state(joint.goal, zero, zero),
        state(joint.setpoint, joint.setpoint_velocity, zero),
        state(joint.measured, joint.measured_velocity, joint.deviation),
    ]
}

/// `jaw/measured_js` of one tick; `None` without an auxiliary axis.
pub(crate) fn jaw_state(report: &CycleReport) -> Option<JointState> {
    let jaw = report.auxiliary?;
    let mut position = OutputVec::default();
    position[0] = jaw.measured;
    let (stamp_ns, flags) = (report.now.0, JointState::VALID);
    Some(JointState { stamp_ns, position, count: 1, flags, ..JointState::default() })
}

const fn flag(set: bool, value: u32) -> u32 {
    if set { value } else { 0 }
}

/// `actuators/measured_js` of one tick for this number of motors.
pub(crate) fn actuator_state(report: &CycleReport, motors: u32) -> ActuatorState {
    let feedback = &report.feedback;
    let written = feedback.map(|axis| axis.written.unwrap_or_default());
    ActuatorState {
        stamp_ns: report.now.0,
        measured_stamp_ns: feedback.map(|axis| axis.stamp.0),
        written_stamp_ns: written.map(|write| write.stamp.0),
        command_stamp_ns: written.map(|write| write.command_stamp.0),
        command_sequence: written.map(|write| write.command_sequence),
        exchanges: feedback.map(|axis| axis.counters.exchanges),
        measured_counts: feedback.map(|axis| axis.position.0),
        setpoint_counts: report.setpoints.map(|counts| counts.0),
        written_counts: written.map(|write| write.target.0),
        current_ma: feedback.map(|axis| axis.current_ma),
        statusword: feedback.map(|axis| axis.statusword),
        error_code: feedback.map(|axis| axis.error_code),
        phase: feedback.map(|axis| axis.phase.number() as u8),
        count: motors,
        ..ActuatorState::default()
    }
}

pub(super) fn adaptation(report: &CycleReport) -> AdaptationMsg {
    let base = AdaptationMsg { stamp_ns: report.now.0, ..AdaptationMsg::default() };
    let Some(adaptation) = &report.adaptation else {
        return base;
    };
    let frames = &adaptation.frames;
    let excited = adaptation.excited.into_iter().enumerate();
    AdaptationMsg {
        model_id: adaptation.model.unwrap_or_default().0,
        estimate: adaptation.estimate.to_array(),
        deviation: adaptation.deviations,
        applied: adaptation.applied.to_array(),
        budget_used: adaptation.budget_used,
        total_used: adaptation.total_used,
        calibrated_error: adaptation.calibrated_error,
        adapted_error: adaptation.adapted_error,
        frames_used: frames.used,
        frames_refused: frames.refused,
        frames_paused: frames.paused,
        frames_dropped: [
            frames.duplicate,
            frames.out_of_order,
            frames.future,
            frames.too_old,
            frames.too_frequent,
            frames.bad,
        ],
        taken_back: adaptation.taken_back,
        method: adaptation.method as u32,
        pauses: adaptation.pauses.0,
        excited: excited.map(|(bit, excited)| flag(excited, 1 << bit)).sum(),
        flags: AdaptationMsg::ON,
        ..base
    }
}

pub(super) fn health(report: &CycleReport, lost: &LostCounters) -> Health {
    let counters = report.feedback.map(|axis| axis.counters);
    Health {
        lost_events: lost.events,
        lost_reports: lost.reports,
        lost_records: lost.records,
        lost_replies: lost.replies,
        timeouts: counters.map(|line| line.timeouts),
        crc_errors: counters.map(|line| line.crc_errors),
        resynchronisations: counters.map(|line| line.resynchronisations),
        retries: counters.map(|line| line.retries),
        ..Health::default()
    }
}

/// Robot and limits of a configuration, for the reply to `version`.
pub fn robot_description(config: &Config) -> Version {
    let mut described = Version {
        robot_id: padded_text(&config.robot_id),
        velocity_counts_s: config.limits.velocity_counts_s,
        acceleration_counts_s2: config.limits.acceleration_counts_s2,
        ..Version::default()
    };
    let limits = described.position_min_counts.iter_mut().zip(&mut described.position_max_counts);
    for (motor, (lowest, highest)) in limits.enumerate() {
        if let Some(axis) = config.axis(motor) {
            *lowest = axis.position_min_counts.0;
            *highest = axis.position_max_counts.0;
        }
    }
    described
}

pub fn operating_state(report: &CycleReport, granted: &Granted) -> OperatingStateMsg {
    let memory_known = report.joint.is_some_and(|joint| joint.memory_known);
    let flags = [
        flag(report.homed, OperatingStateMsg::HOMED),
        flag(report.busy, OperatingStateMsg::BUSY),
        flag(report.models.active.is_some(), OperatingStateMsg::MODEL),
        flag(memory_known, OperatingStateMsg::MEMORY_KNOWN),
        flag(report.holding, OperatingStateMsg::HOLDING),
        flag(report.clipped, OperatingStateMsg::CLIPPED),
        flag(report.limited_by_fixture.is_some(), OperatingStateMsg::FIXTURE),
        flag(report.plausibility == PlausibilityCheck::Working, OperatingStateMsg::COMPARED),
        flag(report.at_rest, OperatingStateMsg::AT_REST),
        flag(report.off, OperatingStateMsg::OFF),
        flag(report.stopped, OperatingStateMsg::STOPPED),
        OperatingStateMsg::broken_off_by(report.broken_off),
        flag(granted.priority > 0, OperatingStateMsg::FIFO),
        flag(granted.memory_locked, OperatingStateMsg::MEMORY_LOCKED),
        flag(granted.cpu.is_some(), OperatingStateMsg::PINNED),
    ];
    OperatingStateMsg {
        stamp_ns: report.now.0,
        since_ns: report.since.0,
        lease_client_id: report.lease_client_id,
        accepted: report.accepted,
        refused: report.refused,
        stale_stops: report.stale_stops,
        state: report.state.number(),
        fault: report.fault.number(),
        last_refusal: report.last_refusal.number(),
        refused_client_id: report.refusals.map(|client| client.client_id),
        refused_commands: report.refusals.map(|client| client.count),
        refused_reason: report.refusals.map(|client| client.last.number()),
        flags: flags.iter().sum(),
        ..OperatingStateMsg::default()
    }
}
