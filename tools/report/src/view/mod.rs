//! The robot as shown to people: one value, made from the last message of every stream. Text, JSON
//! and web page show it. Pure.
//!
//! Degrees, counts, milliampere, seconds. As JSON, angles have three digits (a thousandth of a
//! degree; more is noise, and bytes), and ages are in milliseconds.

mod adaptation;
mod control_loop;
mod fixtures;
mod operator;
mod reasons;

use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, ExternalPosition, Health, JointState, OperatingStateMsg,
    PeriodStatistics, ReachTarget, ReasonMsg, TeleopMsg, TrialMsg, VirtualFixturesMsg,
};
use i2ris::ipc::{Fault, MaskedClientId, Message, OperatingState, Refusal};
use i2ris::model::ModelId;
use i2ris::units::{MAX_MOTORS, Nanos};
use serde::{Serialize, Serializer};

pub use adaptation::Adaptation;
pub use control_loop::{ControlLoop, Motor, Span, count};
pub use fixtures::{Cue, Fixture, Near};
pub use operator::{Hand, Target, Trial};
pub use reasons::{NOTHING, Why, reasons};

/// Age at which a value is marked as stale.
pub const STALE: Nanos = Nanos::from_millis(500);
/// Time for which the last refusal, stop or clip is shown.
const WARNING_SHOWN: Nanos = Nanos::from_millis(5000);

/// Pitch and yaw, degrees.
pub type Pair = Option<[f64; 2]>;

/// The last message of every stream, as far as there is one.
#[derive(Debug, Clone, Copy, Default)]
pub struct LatestMessages {
    pub state: Option<OperatingStateMsg>,
    pub goal: Option<JointState>,
    pub setpoint: Option<JointState>,
    pub measured: Option<JointState>,
    pub camera: Option<ExternalPosition>,
    pub actuators: Option<ActuatorState>,
    /// The auxiliary axis, if there is one.
    pub jaw: Option<JointState>,
    pub statistics: Option<PeriodStatistics>,
    pub health: Option<Health>,
    pub adaptation: Option<AdaptationMsg>,
    pub fixtures: Option<VirtualFixturesMsg>,
    /// The target of a reach-and-hold task.
    pub target: Option<ReachTarget>,
    /// State of the operator's input device.
    pub hand: Option<TeleopMsg>,
    pub trial: Option<TrialMsg>,
    pub error: Option<ReasonMsg>,
    /// The last refusal, stop or clip.
    pub warning: Option<ReasonMsg>,
    /// Answered requests per second and drive.
    pub exchange_rates: Option<[f64; MAX_MOTORS]>,
}

impl LatestMessages {
    /// Whether there is a message of every stream that a controller always publishes.
    pub fn is_complete(&self) -> bool {
        let Self { state, measured, actuators, statistics, exchange_rates, .. } = self;
        let loop_is_seen = actuators.is_some() && statistics.is_some() && exchange_rates.is_some();
        state.is_some() && measured.is_some() && loop_is_seen
    }
}

#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct View {
    /// Why the controller is not reachable, if it is not.
    pub problem: Option<String>,
    pub state: Option<State>,
    /// Why the robot does not move now, most important first; then recent refusals and clips.
    pub why: Vec<Why>,
    pub goal: Option<Pose>,
    pub setpoint: Option<Pose>,
    pub estimate: Option<Pose>,
    pub camera: Option<Pose>,
    pub motors: Option<Vec<Motor>>,
    /// The auxiliary axis: the first angle.
    pub jaw: Option<Pose>,
    #[serde(rename = "loop")]
    pub control_loop: Option<ControlLoop>,
    /// Failures and losses since the start of the controller; in capitals if there are any.
    pub health: Option<String>,
    pub adaptation: Option<Adaptation>,
    pub fixtures: Vec<Fixture>,
    pub target: Option<Target>,
    pub hand: Option<Hand>,
    pub trial: Option<Trial>,
    pub models: Models,
    /// The newest first.
    pub events: Vec<Event>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Age {
    /// `None`: there never was a value.
    #[serde(rename = "age_ms", serialize_with = "milliseconds")]
    pub age: Option<Nanos>,
    pub stale: bool,
}

impl Age {
    fn of(message: &impl Message, now: Nanos, limit: Nanos) -> Self {
        Self { age: Some(message.age(now)), stale: message.age(now) > limit }
    }

    /// `STALE` and the age, `NEVER READ`, or nothing.
    pub fn mark(&self) -> Option<String> {
        match self.age {
            None => Some("NEVER READ".to_owned()),
            Some(age) => self.stale.then(|| format!("STALE {:.1} s", age.as_seconds())),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct State {
    pub name: &'static str,
    /// Why it is in FAULT.
    pub fault: Option<&'static str>,
    pub for_s: f64,
    pub homed: bool,
    pub busy: bool,
    pub holding: bool,
    /// The goal is outside of the hull.
    pub clipped: bool,
    /// Limited by a virtual fixture.
    pub at_fixture: bool,
    pub model: bool,
    pub memory_known: bool,
    /// A watchdog holds every port.
    pub watched: bool,
    /// The pose is compared with the camera.
    pub compared: bool,
    /// Program, process and user that hold the lease, where they are known.
    pub commander: Option<String>,
    /// The client that holds the lease.
    pub lease: Option<String>,
    pub accepted: u64,
    pub refused: u64,
    pub last_refusal: Option<&'static str>,
    pub stale_stops: u64,
    #[serde(flatten)]
    pub age: Age,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pose {
    /// `None`: they mean nothing, or are a position instead.
    #[serde(serialize_with = "short_pair")]
    pub deg: Pair,
    /// Standard deviation.
    #[serde(serialize_with = "short_pair")]
    pub deviation_deg: Pair,
    /// The model gives a position, not angles.
    pub is_position: bool,
    #[serde(flatten)]
    pub age: Age,
}

impl Pose {
    pub fn fresh(&self) -> Pair {
        self.deg.filter(|_| !self.age.stale)
    }
}

/// The loaded models, as far as they are known.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Models {
    pub known: bool,
    pub used: Option<LoadedModel>,
    pub staged: Option<LoadedModel>,
    /// The model that was in use before.
    pub previous: Option<LoadedModel>,
    /// Why there are no models to name.
    pub problem: Option<String>,
    /// Why there is no hull.
    pub hull_problem: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LoadedModel {
    #[serde(skip)]
    pub id: ModelId,
    /// Family and the beginning of the identity.
    pub name: String,
    /// The last part of the path of its file.
    pub file: String,
    pub memory_known: bool,
}

/// How much an event matters: normal, needs attention, needs action now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    Info,
    Warning,
    Alarm,
}

/// Something that happened, once or several times.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Event {
    /// Since it was last seen.
    pub age_ms: u64,
    pub severity: Severity,
    pub text: String,
    /// Recommended action; may be empty.
    pub advice: String,
    pub count: u64,
}

impl View {
    /// Builds the view from the messages. Only the monitor knows models and events.
    pub fn new(messages: &LatestMessages, now: Nanos) -> Self {
        let warning = messages.warning.filter(|it| it.age(now) < WARNING_SHOWN);
        Self {
            state: messages.state.as_ref().map(|it| state(it, now)),
            why: reasons(messages, warning.as_slice(), now),
            goal: messages.goal.as_ref().map(|it| pose(it, now)),
            setpoint: messages.setpoint.as_ref().map(|it| pose(it, now)),
            estimate: messages.measured.as_ref().map(|it| pose(it, now)),
            camera: messages.camera.as_ref().map(|it| seen(it, now)),
            motors: messages.actuators.map(|it| Motor::all(&it, messages.exchange_rates, now)),
            jaw: messages.jaw.as_ref().map(|it| jaw(it, now)),
            control_loop: messages.statistics.as_ref().map(|it| ControlLoop::new(it, now)),
            health: messages.health.as_ref().map(control_loop::health),
            adaptation: messages.adaptation.as_ref().map(Adaptation::new),
            fixtures: messages.fixtures.as_ref().map_or_else(Vec::new, fixtures::fixtures),
            hand: messages.hand.as_ref().and_then(|it| Hand::new(it, now)),
            trial: messages.trial.as_ref().and_then(|it| Trial::new(it, now)),
            target: messages.target.as_ref().and_then(|it| Target::new(it, now)),
            ..Self::default()
        }
    }
}

fn state(message: &OperatingStateMsg, now: Nanos) -> State {
    let has = |flag: u32| message.flags & flag != 0;
    let last = Refusal::from_number(message.last_refusal).filter(|it| *it != Refusal::None);
    let is_fault = message.state == OperatingState::Fault.number();
    State {
        name: OperatingState::from_number(message.state)
            .map_or("UNKNOWN STATE", OperatingState::text),
        fault: Fault::from_number(message.fault).filter(|_| is_fault).map(Fault::text),
        for_s: message.stamp().duration_since(Nanos(message.since_ns)).as_seconds().round(),
        homed: has(OperatingStateMsg::HOMED),
        busy: has(OperatingStateMsg::BUSY),
        holding: has(OperatingStateMsg::HOLDING),
        clipped: has(OperatingStateMsg::CLIPPED),
        at_fixture: has(OperatingStateMsg::FIXTURE),
        model: has(OperatingStateMsg::MODEL),
        memory_known: has(OperatingStateMsg::MEMORY_KNOWN),
        watched: has(OperatingStateMsg::WATCHED),
        compared: has(OperatingStateMsg::COMPARED),
        commander: None,
        lease: (message.lease_client_id != 0)
            .then(|| MaskedClientId(message.lease_client_id).to_string()),
        accepted: message.accepted,
        refused: message.refused,
        last_refusal: last.map(Refusal::text),
        stale_stops: message.stale_stops,
        age: Age::of(message, now, STALE),
    }
}

fn plain_pose(message: &impl Message, deg: Pair, now: Nanos) -> Pose {
    Pose { deg, deviation_deg: None, is_position: false, age: Age::of(message, now, STALE) }
}

fn pose(joint: &JointState, now: Nanos) -> Pose {
    let deg = angles(joint);
    let deviation = [joint.deviation[0].to_degrees(), joint.deviation[1].to_degrees()];
    Pose {
        deviation_deg: deg.map(|_| deviation),
        is_position: joint.count == 3,
        ..plain_pose(joint, deg, now)
    }
}

fn jaw(joint: &JointState, now: Nanos) -> Pose {
    let is_valid = joint.flags & JointState::VALID != 0;
    plain_pose(joint, is_valid.then_some([joint.position[0].to_degrees(), 0.0]), now)
}

fn seen(camera: &ExternalPosition, now: Nanos) -> Pose {
    let is_valid = camera.flags & ExternalPosition::VALID != 0 && camera.count == 2;
    let deg = [camera.position[0].to_degrees(), camera.position[1].to_degrees()];
    plain_pose(camera, is_valid.then_some(deg), now)
}

/// The beginning of a model's identity: enough to distinguish models.
pub fn short_id(id: ModelId) -> String {
    id.to_string().chars().take(8).collect()
}

/// Pitch and yaw, degrees; `None` where they mean nothing, or are a position instead.
pub fn angles(joint: &JointState) -> Pair {
    (joint.flags & JointState::VALID != 0 && joint.count == 2)
        .then(|| [joint.position[0].to_degrees(), joint.position[1].to_degrees()])
}

/// Three digits.
fn short(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

fn short_pair<S: Serializer>(pair: &Pair, serializer: S) -> Result<S::Ok, S::Error> {
    pair.map(|pair| pair.map(short)).serialize(serializer)
}

fn milliseconds<S: Serializer>(age: &Option<Nanos>, serializer: S) -> Result<S::Ok, S::Error> {
    age.map(|age| age.0 / 1_000_000).serialize(serializer)
}
