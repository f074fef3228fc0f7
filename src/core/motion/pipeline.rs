//! Pipeline: a goal in joint space on its way to the inverse, through stages 4 to 8 of the table in
//! `gate`.

use serde::{Deserialize, Serialize};

use crate::core::motion::GoalStep;
use crate::core::motion::backlash_dead_band::BacklashDeadBand;
use crate::core::motion::joint_filter::JointFilter;
use crate::core::motion::model_blend::ModelBlend;
use crate::core::motion::virtual_fixtures::{GoalSpace, VirtualFixtures};
use crate::core::vector::{difference, zip_map};
use crate::units::{Nanos, OutputVec};

/// The stages that belong to a model, with the state that they keep from tick to tick. The black
/// box depends on order and types of the fields.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Pipeline {
    pub dead_band: BacklashDeadBand,
    filter: JointFilter,
    /// The goal of the last tick after the dead-band, while angles are followed.
    dead_banded: Option<OutputVec>,
    blend: Option<ModelBlend>,
    /// How far the stages up to the dead-band kept the goal of the last tick back, rad.
    pub held_back: OutputVec,
}

/// Inputs of the stages in one tick.
pub(crate) struct PipelineTick<'a> {
    /// The pose at the setpoints: where a goal begins.
    pub start: OutputVec,
    pub space: GoalSpace<'a>,
    pub now: Nanos,
    /// Start of the tick before.
    pub before: Nanos,
}

/// A goal after the stages.
pub(crate) struct PassedGoal {
    /// After the virtual fixtures, for the report.
    pub limited: OutputVec,
    /// For the inverse.
    pub goal: GoalStep,
}

impl Pipeline {
    pub(super) fn new(dead_band: BacklashDeadBand, filter: JointFilter) -> Self {
        let held_back = OutputVec::default();
        Self { dead_band, filter, dead_banded: None, blend: None, held_back }
    }

    /// Takes the goal of this tick through the stages.
    pub(super) fn pass(
        &mut self,
        goal: GoalStep,
        fixtures: &mut VirtualFixtures,
        tick: &PipelineTick<'_>,
    ) -> PassedGoal {
        let filtered = self.filter.filter(goal, tick.start);
        // Regions that begin to count during a blend begin with a goal that it is not yet added to.
        let start = difference(&tick.start, &self.blended(OutputVec::default(), tick.before));
        let limited = fixtures.limit(filtered, start, &tick.space);
        let banded = self.dead_banded(limited, &goal.now);
        let blended = GoalStep {
            now: self.blended(banded.now, tick.now),
            before: self.blended(banded.before, tick.before),
        };
        PassedGoal { limited: limited.now, goal: blended }
    }

    /// The goal after the dead-band. Records how far it is from the `requested` one.
    fn dead_banded(&mut self, goal: GoalStep, requested: &OutputVec) -> GoalStep {
        let banded = self.dead_band.apply(&goal.now);
        self.dead_banded = Some(banded.goal);
        let led = zip_map(requested, &self.filter.lead(), |requested, lead| requested + lead);
        self.held_back = difference(&led, &banded.goal);
        let before = if banded.is_held { banded.goal } else { goal.before };
        GoalStep { now: banded.goal, before }
    }

    /// A goal with the offset of the last model swap.
    fn blended(&self, goal: OutputVec, now: Nanos) -> OutputVec {
        let offset = self.blend.and_then(|blend| blend.offset_at(now));
        offset.map_or(goal, |offset| zip_map(&goal, &offset, |a, b| a + b))
    }

    /// No angles are followed in this tick.
    pub(super) fn release_goal(&mut self) {
        self.dead_band.release_goal();
        self.filter.reset();
        (self.dead_banded, self.blend) = (None, None);
        self.held_back = OutputVec::default();
    }

    /// Takes over from the model that was active before. The difference of their poses at the
    /// present setpoints becomes a [`ModelBlend`]; motion that remains to the goal does not, or it
    /// would continue after the hand has stopped.
    pub(super) fn take_over(&mut self, before: Option<(&Self, OutputVec)>, now: Nanos) {
        self.dead_band.take_over(before.map(|(before, _)| &before.dead_band));
        (self.dead_banded, self.blend, self.held_back) = (None, None, OutputVec::default());
        let Some((before, difference)) = before else { return };
        self.filter = before.filter;
        (self.dead_banded, self.held_back) = (before.dead_banded, before.held_back);
        let offset = before.blended(difference, now);
        self.blend = self.dead_banded.map(|_| ModelBlend::new(offset, now));
    }
}
