//! Snapshot of the cycle between two ticks, for the black box and its replay.

use serde::{Deserialize, Serialize};

use crate::core::command::admission::CommandAdmission;
use crate::core::command::clutch::Clutch;
use crate::core::faults::overrun::OverrunMonitor;
use crate::core::faults::plausibility::PlausibilityMonitor;
use crate::core::joint_space::position_history::PositionHistory;
use crate::core::model_slots::loaded_models::LoadedModelStates;
use crate::core::motion::axis_control::AxisControl;
use crate::core::states::shutdown::Shutdown;
use crate::core::states::state_machine::StateMachine;
use crate::model::ModelId;
use crate::units::MAX_MOTORS;

/// All values of the cycle that change from tick to tick. About 20 kB, without pointers.
///
/// Order and types of the fields are part of the file format of the black box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CycleSnapshot {
    pub(super) axes: [Option<AxisControl>; MAX_MOTORS],
    pub(super) history: PositionHistory,
    pub(super) models: LoadedModelStates,
    pub(super) overruns: OverrunMonitor,
    pub(super) plausibility: PlausibilityMonitor,
    pub(super) machine: StateMachine,
    pub(super) admission: CommandAdmission,
    pub(super) clutch: Clutch,
    pub(super) ticks: u64,
    pub(super) stale_stops: u64,
    pub(super) lost_events: u64,
    pub(super) shutdown: Shutdown,
}

impl CycleSnapshot {
    /// Number of ticks since the start of the cycle.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Ids of the models that were loaded.
    pub fn models(&self) -> impl Iterator<Item = ModelId> {
        self.models.ids()
    }
}
