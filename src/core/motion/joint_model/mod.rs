//! Joint model: a model with the memory that it needs in the loop.
//!
//! `memory`: motor positions, replayed into it; the report, and the interface of the adaptation.

pub(in crate::core) mod memory;
pub(in crate::core) mod position_history;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::config::{AxisConfig, Config};
use crate::core::drift::Correction;
use crate::core::drift::geometry::ModelGeometry;
use crate::core::motion::GoalStep;
use crate::core::motion::joint_filter::JointFilter;
use crate::core::motion::joint_limits::JointBounds;
use crate::core::motion::pipeline::{BacklashDeadBand, Outputs, PassedGoal};
use crate::core::motion::pipeline::{Pipeline, PipelineTick};
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::vector;
use crate::drive::AxisFeedback;
use crate::model::file::OutputUnit;
use crate::model::{Estimate, History, Inverse, JacobianMatrix, Memory};
use crate::model::{MemoryTerms, Model, Query, Reach};
use crate::units::{Counts, MAX_MOTORS, MotorVec, Nanos, OutputVec};
use memory::rate;
use position_history::{HistoryCursor, PositionHistory};

/// Positions of the history that a model replays per tick. One takes a microsecond or two.
const MAX_REPLAYED: usize = 8;

#[derive(Debug, Clone)]
pub(crate) struct JointModel {
    model: Arc<Model>,
    /// The calibrated hull between the position limits of the motors.
    reach: Reach,
    /// The outputs at the centre of the hull without past motion, rad (m).
    centre: OutputVec,
    compensation: f64,
    /// `None`: off, or the outputs are not angles.
    bounds: Option<JointBounds>,
    /// Only with the adaptation on, and for models that are adapted.
    geometry: Option<ModelGeometry>,
    state: JointModelState,
    known: CachedTerms,
}

/// Values derived from the state, always with the same bits, so not stored in it.
#[derive(Debug, Clone, Copy, Default)]
struct CachedTerms {
    /// The setpoints that `memory` contains after the positions, motor by motor; `None`: to be
    /// computed.
    written: Option<[Option<f64>; MAX_MOTORS]>,
    measured: MemoryTerms,
    /// [`Model::correction`] of `memory`.
    residual: OutputVec,
    /// The pose at the setpoints with `memory`, before the correction of the adaptation.
    setpoint: Option<KnownSetpoint>,
    /// [`Model::is_memory_known`] was true: it stays so until the memory is reset.
    is_memory_known: bool,
}

/// Everything that changes from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct JointModelState {
    /// The last entry of the position history that `measured_memory` contains.
    cursor: HistoryCursor,
    /// Memory at the last encoder positions.
    measured_memory: Memory,
    /// The same, and then the setpoints that were written after the positions were read.
    memory: Memory,
    /// Where the search for the inverse starts: the last solution.
    search_start: MotorVec,
    measured: Option<Measured>,
    setpoint: Option<Setpoint>,
    pipeline: Pipeline,
    /// The correction of the adaptation; `None` as calibrated.
    correction: Option<Correction>,
    /// Motion of the goal in the last tick, rad.
    goal_motion: OutputVec,
}

#[derive(Debug, Clone, Copy)]
struct KnownSetpoint {
    at: MotorVec,
    mean: OutputVec,
    slope: JacobianMatrix,
}

impl KnownSetpoint {
    /// The pose before the setpoints moved by some increments.
    fn before(&self, increments: &MotorVec) -> OutputVec {
        let mut before = self.mean;
        for (output, slope) in before.iter_mut().zip(&self.slope) {
            let products = slope.iter().zip(increments);
            *output -= products.map(|(slope, change)| slope * change).sum::<f64>();
        }
        before
    }
}

/// The pose at the encoder positions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Measured {
    estimate: Estimate,
    /// The mean before the correction, rad.
    gapped: OutputVec,
    position: MotorVec,
    stamp: Nanos,
    /// rad/s.
    velocity: OutputVec,
}

/// The pose at the setpoints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Setpoint {
    mean: OutputVec,
    /// rad/s.
    velocity: OutputVec,
}

/// The poses at the last encoder positions, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MeasuredPoses {
    pub stamp: Nanos,
    /// counts.
    pub position: MotorVec,
    /// With scaled gaps.
    pub gapped: OutputVec,
    /// With all of the correction.
    pub adapted: OutputVec,
}

/// The model gave a value that is not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NotFinite;

impl JointModel {
    /// A model that has seen no motion yet, at the start of the position history.
    pub(crate) fn new(model: Arc<Model>, config: &Config) -> Self {
        Self::with_memory(model, config, Memory::default(), HistoryCursor::default())
    }

    /// A model whose memory is rebuilt from a history that ends at a cursor. Takes thousands of
    /// steps: not for the control loop.
    pub(crate) fn from_history(
        model: Arc<Model>,
        config: &Config,
        history: &History,
        cursor: HistoryCursor,
    ) -> Self {
        let memory = model.recall(history);
        Self::with_memory(model, config, memory, cursor)
    }

    pub(crate) fn from_state(model: Arc<Model>, config: &Config, state: JointModelState) -> Self {
        Self { state, ..Self::new(model, config) }
    }

    fn with_memory(
        model: Arc<Model>,
        config: &Config,
        memory: Memory,
        cursor: HistoryCursor,
    ) -> Self {
        let tick = config.control.period();
        let has_angles = output_unit(&model) == OutputUnit::Deg;
        let outputs = match model.conditioning_range() != MotorVec::default() {
            _ if !has_angles => Outputs::Others,
            true => Outputs::AnglesWithBacklash,
            // Without a memory the inverse does not jump where the motion reverses.
            false => Outputs::Angles,
        };
        let state = JointModelState {
            cursor,
            measured_memory: memory,
            memory,
            search_start: model.hull().centre(),
            measured: None,
            setpoint: None,
            pipeline: Pipeline::new(
                BacklashDeadBand::new(&config.compensation, outputs, tick),
                JointFilter::new(config, tick, has_angles),
            ),
            correction: None,
            goal_motion: OutputVec::default(),
        };
        let adapts = config.adaptation.enabled;
        let limits = |of: fn(&AxisConfig) -> Counts| {
            let axes = (0..config.motors()).filter_map(|motor| config.axis(motor));
            vector::collect(axes.map(|axis| of(axis).as_f64()))
        };
        let [low, high] =
            [limits(|axis| axis.position_min_counts), limits(|axis| axis.position_max_counts)];
        Self {
            geometry: adapts.then(|| ModelGeometry::new(&model)).flatten(),
            reach: model.reach_between(low, high),
            centre: model.predict(&model.hull().centre(), &Memory::default()).mean,
            model,
            compensation: config.compensation.factor,
            bounds: JointBounds::new(
                &config.joint_limits,
                tick,
                config.setpoint_interval(),
                has_angles,
            ),
            state,
            known: CachedTerms::default(),
        }
    }

    pub(crate) fn state(&self) -> &JointModelState {
        &self.state
    }

    pub(crate) fn model(&self) -> &Model {
        &self.model
    }

    /// Enough motion has been seen to know the memory.
    pub(crate) fn is_memory_known(&self) -> bool {
        self.known.is_memory_known || self.model.is_memory_known(&self.state.measured_memory)
    }

    /// The whole position history has been replayed.
    pub(crate) fn is_up_to_date(&self, history: &PositionHistory) -> bool {
        self.state.cursor == history.cursor
    }

    /// Both models have the same outputs, so a goal means the same to both.
    pub(crate) fn has_outputs_of(&self, other: &Self) -> bool {
        self.model.file().outputs == other.model.file().outputs
    }

    pub(crate) fn outputs(&self) -> usize {
        self.model.outputs()
    }

    /// Unit of the outputs in files: angles, or a position of the tip.
    pub(crate) fn unit(&self) -> OutputUnit {
        output_unit(&self.model)
    }

    /// The pose at the last setpoints.
    pub(crate) fn setpoint(&self) -> Option<OutputVec> {
        self.state.setpoint.map(|setpoint| setpoint.mean)
    }

    /// Takes over from the model that was active before. The setpoints stay, the poses are
    /// recomputed, and their difference becomes a blend.
    pub(crate) fn take_over(
        &mut self,
        from: Option<&Self>,
        drives: &[AxisFeedback],
        setpoints: &MotorVec,
        now: Nanos,
    ) -> Result<(), NotFinite> {
        let before = from.map(|from| &from.state);
        self.state.search_start = *setpoints;
        self.state.correction = None;
        self.update_memory(drives, true)?;
        self.update_measured(drives, before.and_then(|before| before.measured))?;
        let pose = self.pose(setpoints)?;
        self.state.setpoint = Some(Setpoint { mean: pose, velocity: OutputVec::default() });
        let difference = before.and_then(|before| before.setpoint);
        let difference =
            difference.map_or(OutputVec::default(), |old| vector::difference(&pose, &old.mean));
        self.state.pipeline.take_over(before.map(|before| (&before.pipeline, difference)), now);
        Ok(())
    }

    pub(crate) fn pass_goal(
        &mut self,
        goal: GoalStep,
        fixtures: &mut VirtualFixtures,
        [now, before]: [Nanos; 2],
    ) -> Result<PassedGoal, NotFinite> {
        let start = self.setpoint().ok_or(NotFinite)?;
        let mut pipeline = self.state.pipeline;
        let tick = PipelineTick { start, space: self.goal_space(), now, before };
        let passed = pipeline.pass(goal, fixtures, &tick);
        self.state.pipeline = pipeline;
        self.state.goal_motion = vector::difference(&passed.goal.now, &passed.goal.before);
        Ok(passed)
    }

    /// Remaining motion of the snake to the requested goal, without deliberate offsets (a goal that
    /// they limit would run away), with up to [`JointModel::dead_band_width`] of the dead-band.
    pub(crate) fn remaining_motion(&self, setpoints: &MotorVec) -> Result<OutputVec, NotFinite> {
        let left =
            vector::difference(&self.pose(&self.state.search_start)?, &self.pose(setpoints)?);
        let held_back = &self.state.pipeline.held_back;
        Ok(vector::zip_map(&left, held_back, |motors, held_back| motors + held_back))
    }

    /// How far the dead-band keeps the snake from a goal that turns back, rad.
    pub(crate) fn dead_band_width(&self) -> f64 {
        self.state.pipeline.dead_band.width()
    }

    /// No angles are followed in this tick.
    pub(crate) fn release_goal(&mut self) {
        self.state.pipeline.release_goal();
        self.state.goal_motion = OutputVec::default();
    }

    /// A pose amid those in reach, rad (m).
    pub(crate) fn centre(&self) -> OutputVec {
        self.corrected(self.centre)
    }

    /// The counts in reach at which the outputs are nearest to a goal.
    pub(crate) fn solve(&self, goal: &OutputVec) -> Result<Inverse, NotFinite> {
        self.solve_each(&[*goal]).map(|[inverse]| inverse)
    }

    /// Like [`JointModel::solve`], for several nearby goals. The searches for all but the first
    /// goal start at the first result.
    pub(crate) fn solve_each<const N: usize>(
        &self,
        goals: &[OutputVec; N],
    ) -> Result<[Inverse; N], NotFinite> {
        let state = &self.state;
        let query = Query {
            start: state.search_start,
            correction: state.pipeline.dead_band.correction(),
            compensation: self.compensation,
        };
        let uncorrected = |goal: &OutputVec| {
            let correction = state.correction.as_ref();
            correction.map_or(*goal, |correction| correction.undo(goal))
        };
        let goals = goals.each_ref().map(uncorrected);
        let mut inverses = self.model.invert_within(&self.reach, &goals, &state.memory, &query);
        for inverse in &mut inverses {
            inverse.reached = self.corrected(inverse.reached);
        }
        let are_finite = inverses.iter().all(|inverse| vector::is_finite(&inverse.counts));
        if are_finite { Ok(inverses) } else { Err(NotFinite) }
    }

    /// The next search for the inverse starts here.
    pub(crate) fn set_search_start(&mut self, counts: MotorVec) {
        self.state.search_start = counts;
    }

    /// The outputs at given counts.
    pub(crate) fn pose(&self, counts: &MotorVec) -> Result<OutputVec, NotFinite> {
        let (memory, residual) = (&self.state.memory, self.residual());
        let pose = self.model.pose(counts, memory, &residual);
        if vector::is_finite(&pose) { Ok(self.corrected(pose)) } else { Err(NotFinite) }
    }

    /// The pose at given counts keeps the position limits of the angles.
    pub(crate) fn allows_position(&self, counts: &MotorVec) -> bool {
        let excess = |bounds: &JointBounds| self.pose(counts).map(|pose| bounds.excess(&pose));
        self.bounds().is_none_or(|bounds| excess(bounds).is_ok_and(|excess| excess <= 0.0))
    }

    /// Joint limits; `None`: off, or the outputs are not angles.
    pub(crate) fn bounds(&self) -> Option<&JointBounds> {
        self.bounds.as_ref()
    }

    /// The part of the model that depends on the memory alone.
    fn residual(&self) -> OutputVec {
        match self.known.written {
            Some(_) => self.known.residual,
            None => self.model.correction(&self.state.memory),
        }
    }

    fn corrected(&self, mean: OutputVec) -> OutputVec {
        let correction = self.state.correction.as_ref();
        correction.map_or(mean, |correction| correction.apply(&mean))
    }

    pub(crate) fn update_setpoint(
        &mut self,
        setpoints: &MotorVec,
        increments: &MotorVec,
        tick: Nanos,
    ) -> Result<(), NotFinite> {
        let known = self.known.setpoint.filter(|known| known.at == *setpoints);
        let known = known.map_or_else(|| self.setpoint_at(setpoints), Ok)?;
        self.known.setpoint = Some(known);
        let mean = self.corrected(known.mean);
        let before = self.corrected(known.before(increments));
        self.state.setpoint =
            Some(Setpoint { mean, velocity: rate(&mean, &before, tick).unwrap_or_default() });
        Ok(())
    }

    fn setpoint_at(&self, setpoints: &MotorVec) -> Result<KnownSetpoint, NotFinite> {
        let (memory, residual) = (&self.state.memory, self.residual());
        let (mean, slope) = self.model.pose_and_slope(setpoints, memory, &residual);
        let are_finite = vector::is_finite(&mean) && slope.iter().all(vector::is_finite);
        are_finite.then_some(KnownSetpoint { at: *setpoints, mean, slope }).ok_or(NotFinite)
    }
}

fn output_unit(model: &Model) -> OutputUnit {
    let outputs = &model.file().outputs;
    outputs.first().map_or(OutputUnit::Deg, |output| output.unit)
}
