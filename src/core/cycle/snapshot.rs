//! Snapshot of the cycle between two ticks, for the black box and its replay.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::adaptation::AdaptationState;
use crate::core::command::admission::CommandAdmission;
use crate::core::command::goals::Clutch;
use crate::core::cycle::ControlCycle;
use crate::core::events::PlausibilityCheck;
use crate::core::events::fold::{ClipEvents, EventFold, OtherCameras};
use crate::core::faults::OverrunMonitor;
use crate::core::faults::plausibility::PlausibilityMonitor;
use crate::core::model_slots::{LoadedModelStates, LoadedModels};
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::axis_group::{AuxiliaryAxis, AxisGroup};
use crate::core::motion::gate::Gate;
use crate::core::motion::joint_model::position_history::PositionHistory;
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::states::automatic_transitions::Shutdown;
use crate::core::states::state_machine::StateMachine;
use crate::model::{Model, ModelId};
use crate::units::MAX_MOTORS;

/// All values of the cycle that change from tick to tick. About 60 kB, without pointers.
///
/// Order and types of the fields are part of the file format of the black box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CycleSnapshot {
    axes: [Option<AxisControl>; MAX_MOTORS],
    auxiliary: Option<AuxiliaryAxis>,
    history: PositionHistory,
    models: LoadedModelStates,
    overruns: OverrunMonitor,
    plausibility: PlausibilityMonitor,
    plausibility_check: PlausibilityCheck,
    adaptation: Option<AdaptationState>,
    other_cameras: OtherCameras,
    machine: StateMachine,
    admission: CommandAdmission,
    clutch: Clutch,
    fixtures: VirtualFixtures,
    gate: Gate,
    feedback_stops: EventFold,
    clips: ClipEvents,
    ticks: u64,
    stale_stops: u64,
    lost_events: u64,
    shutdown: Shutdown,
}

impl CycleSnapshot {
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    pub fn models(&self) -> impl Iterator<Item = ModelId> {
        self.models.ids()
    }
}

impl ControlCycle {
    /// All values that change from tick to tick. `None` while a model waits to be taken by
    /// [`ControlCycle::take_retired`].
    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    pub fn snapshot(&self) -> Option<CycleSnapshot> {
        Some(CycleSnapshot {
            axes: self.axes.to_snapshot(),
            auxiliary: self.auxiliary,
            history: self.history,
            models: self.models.states()?,
            overruns: self.overruns,
            plausibility: self.plausibility,
            plausibility_check: self.plausibility_check,
            other_cameras: self.other_cameras,
            adaptation: self.adaptation.map(|adaptation| adaptation.state),
            machine: self.machine,
            admission: self.admission,
            clutch: self.clutch,
            fixtures: self.fixtures,
            gate: self.gate,
            feedback_stops: self.feedback_stops,
            clips: self.clips,
            ticks: self.ticks,
            stale_stops: self.stale_stops,
            lost_events: self.lost_events,
            shutdown: self.shutdown,
        })
    }

    /// A cycle that continues from a snapshot of a cycle with the same configuration. Not for the
    /// control loop. Fails with the id of a model that `find` does not know.
    pub fn restored(
        config: &Config,
        snapshot: &CycleSnapshot,
        find: impl Fn(ModelId) -> Option<Arc<Model>>,
    ) -> Result<Self, ModelId> {
        let mut cycle = Self::new(config, None);
        cycle.axes = AxisGroup::from_snapshot(&snapshot.axes);
        cycle.auxiliary = snapshot.auxiliary;
        cycle.history = snapshot.history;
        cycle.models = LoadedModels::from_states(&snapshot.models, config, find)?;
        cycle.overruns = snapshot.overruns;
        cycle.plausibility = snapshot.plausibility;
        cycle.plausibility_check = snapshot.plausibility_check;
        if let (Some(adaptation), Some(state)) = (&mut cycle.adaptation, snapshot.adaptation) {
            adaptation.state = state;
        }
        cycle.other_cameras = snapshot.other_cameras;
        cycle.machine = snapshot.machine;
        cycle.admission = snapshot.admission;
        cycle.clutch = snapshot.clutch;
        cycle.fixtures = snapshot.fixtures;
        cycle.gate = snapshot.gate;
        cycle.feedback_stops = snapshot.feedback_stops;
        cycle.clips = snapshot.clips;
        cycle.ticks = snapshot.ticks;
        cycle.stale_stops = snapshot.stale_stops;
        cycle.lost_events = snapshot.lost_events;
        cycle.shutdown = snapshot.shutdown;
        Ok(cycle)
    }
}
