//! The last message of every stream, and its text. Pure.

mod page;
#[cfg(test)]
mod tests;
mod text;

use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, ExternalPosition, Health, JointState, OperatingStateMsg,
    PeriodStatistics, ReachTarget, ReasonMsg, VirtualFixturesMsg,
};
use i2ris::ipc::{Fault, Message, OperatingState};
use i2ris::units::{MAX_MOTORS, Nanos};

pub use text::{granted, health_text, microseconds, short_id, state_name};

/// Age at which a value is marked as stale. Cameras are slow; everything else comes many times a
/// second.
pub const STALE: Nanos = Nanos::from_millis(500);
/// The same for a camera.
pub const CAMERA_STALE: Nanos = STALE;
/// Statistics come once a second.
pub const STATISTICS_STALE: Nanos = Nanos::from_millis(2500);

/// How long the last refusal, stop or clip is news.
const WARNING_SHOWN: Nanos = Nanos::from_millis(5000);

/// The last message of every stream, as far as there is one.
#[derive(Debug, Clone, Copy, Default)]
pub struct LatestMessages {
    pub state: Option<OperatingStateMsg>,
    pub goal: Option<JointState>,
    pub setpoint: Option<JointState>,
    pub measured: Option<JointState>,
    pub camera: Option<ExternalPosition>,
    pub actuators: Option<ActuatorState>,
    pub statistics: Option<PeriodStatistics>,
    pub health: Option<Health>,
    pub adaptation: Option<AdaptationMsg>,
    pub fixtures: Option<VirtualFixturesMsg>,
    /// The target of a reach-and-hold task.
    pub target: Option<ReachTarget>,
    /// The last fault.
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
        let all =
            state.is_some() && measured.is_some() && actuators.is_some() && statistics.is_some();
        all && exchange_rates.is_some()
    }

    /// Why the robot is in FAULT, if it is.
    pub fn fault(&self) -> Option<Fault> {
        let state = self.state.filter(|state| state.state == OperatingState::Fault.number())?;
        Fault::from_number(state.fault)
    }

    /// The message of the present fault.
    pub fn present_error(&self) -> Option<ReasonMsg> {
        let fault = self.fault()?;
        self.error.filter(|error| error.number == fault.number())
    }

    /// The last refusal, stop or clip, as long as it is news.
    pub fn recent_warning(&self, now: Nanos) -> Option<ReasonMsg> {
        self.warning.filter(|warning| warning.age(now) < WARNING_SHOWN)
    }

    /// The last angles of the camera, degrees, fresh or not.
    pub fn camera_angles(&self) -> Option<[f64; 2]> {
        let camera = self
            .camera
            .filter(|camera| camera.flags & ExternalPosition::VALID != 0 && camera.count == 2)?;
        Some([camera.position[0].to_degrees(), camera.position[1].to_degrees()])
    }
}

fn is_valid(joint: &JointState) -> bool {
    joint.flags & JointState::VALID != 0
}

/// Pitch and yaw, degrees; `None` where they mean nothing, or are a position instead.
pub fn angles(joint: Option<&JointState>) -> Option<[f64; 2]> {
    let joint = joint.filter(|joint| is_valid(joint) && joint.count == 2)?;
    Some([joint.position[0].to_degrees(), joint.position[1].to_degrees()])
}

/// How many motors there are.
pub fn count(count: u32) -> usize {
    usize::try_from(count).unwrap_or(MAX_MOTORS).min(MAX_MOTORS)
}
