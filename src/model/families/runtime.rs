//! The interface of every family to the controller, in arrays of fixed size.

use std::fmt::Debug;

use crate::model::error::ModelError;
use crate::model::estimate::{Estimate, Inverse, JacobianMatrix, MemoryTerms, OutputUnit, Query};
use crate::model::families::memory::Memory;
use crate::model::maths::hull::Hull;
use crate::model::maths::{Regression, array, bounded, estimate, newton_inverse, rows, vector};
use crate::units::{MotorVec, OutputVec};

/// Where an inverse may go.
#[derive(Debug, Clone)]
pub(crate) struct Reach {
    pub(in crate::model) counts: Hull,
    /// The virtual counts that they lead to; the counts of families without.
    pub(in crate::model) virtual_counts: Hull,
}

/// Start and method of a search.
#[derive(Debug, Clone, Copy)]
pub(in crate::model) struct Search<'a> {
    pub memory: &'a Memory,
    pub reach: &'a Reach,
    pub query: &'a Query,
}

/// A family of models with its numbers of motors and outputs hidden. The provided methods suit a
/// family without memory.
pub(in crate::model) trait Runtime: Debug + Send + Sync {
    /// Advances the state of a memory to `counts` in a time, s. The memory already contains this
    /// position.
    fn advance(&self, _memory: &mut Memory, _counts: &MotorVec, _time_s: f64) {}

    /// The range that every motor must cover until earlier motion is forgotten, counts.
    fn conditioning_range(&self) -> MotorVec {
        MotorVec::default()
    }

    /// See [`crate::model::Model::has_backlash`].
    fn has_backlash(&self) -> bool {
        false
    }

    /// See [`crate::model::Model::memory_terms`].
    fn memory_terms(&self, _memory: &Memory) -> MemoryTerms {
        MemoryTerms::default()
    }

    /// See [`crate::model::Model::virtual_counts`].
    fn virtual_counts(&self, counts: &MotorVec, _memory: &Memory) -> MotorVec {
        bounded(counts)
    }

    fn predict(&self, counts: &MotorVec, memory: &Memory) -> Estimate;

    /// See [`crate::model::Model::predict_with`].
    fn predict_with(&self, counts: &MotorVec, memory: &Memory, _terms: &MemoryTerms) -> Estimate {
        self.predict(counts, memory)
    }

    /// See [`crate::model::Model::pose`].
    fn pose(&self, counts: &MotorVec, memory: &Memory, correction: &OutputVec) -> OutputVec;

    /// See [`crate::model::Model::pose_and_slope`].
    fn pose_and_slope(
        &self,
        counts: &MotorVec,
        memory: &Memory,
        correction: &OutputVec,
    ) -> (OutputVec, JacobianMatrix);

    fn jacobian(&self, counts: &MotorVec, memory: &Memory) -> JacobianMatrix {
        self.pose_and_slope(counts, memory, &OutputVec::default()).1
    }

    /// A family implements this or [`Runtime::invert_each`].
    fn invert(&self, goal: &OutputVec, search: Search<'_>) -> Inverse {
        let mut found = [Inverse::default()];
        self.invert_each(std::slice::from_ref(goal), search, &mut found);
        let [found] = found;
        found
    }

    /// Region of the inverse in a hull of counts within the calibrated hull.
    fn reach(&self, hull: &Hull) -> Reach {
        Reach { counts: hull.clone(), virtual_counts: hull.clone() }
    }

    /// See [`crate::model::Model::invert_each`].
    fn invert_each(&self, goals: &[OutputVec], search: Search<'_>, found: &mut [Inverse]) {
        let mut query = *search.query;
        for (index, (goal, found)) in goals.iter().zip(found).enumerate() {
            *found = self.invert(goal, Search { query: &query, ..search });
            if index == 0 {
                query.start = found.counts;
            }
        }
    }

    /// See [`newton_inverse::check_round_trip`].
    fn check_round_trip(&self, hull: &Hull, unit: OutputUnit) -> Result<(), ModelError>;
}

/// A regression on the counts, without memory.
#[derive(Debug)]
pub(in crate::model) struct Memoryless<const D: usize, const M: usize>(
    pub Box<dyn Regression<D, M>>,
);

impl<const D: usize, const M: usize> Runtime for Memoryless<D, M> {
    fn predict(&self, counts: &MotorVec, _memory: &Memory) -> Estimate {
        estimate(&self.0.predict(&vector(&bounded(counts))))
    }

    fn pose(&self, counts: &MotorVec, _memory: &Memory, _correction: &OutputVec) -> OutputVec {
        array(&self.0.mean(&vector(&bounded(counts))))
    }

    fn pose_and_slope(
        &self,
        counts: &MotorVec,
        _memory: &Memory,
        _correction: &OutputVec,
    ) -> (OutputVec, JacobianMatrix) {
        let local = self.0.local(&vector(&bounded(counts)));
        (array(&local.mean), rows(&local.jacobian))
    }

    fn invert(&self, goal: &OutputVec, search: Search<'_>) -> Inverse {
        newton_inverse::invert(&*self.0, &search.reach.counts, goal, &search.query.start)
    }

    fn check_round_trip(&self, hull: &Hull, unit: OutputUnit) -> Result<(), ModelError> {
        let local = |counts: &MotorVec| Some(self.0.local(&vector::<D>(counts)));
        newton_inverse::check_round_trip(hull, unit, local, |goal| {
            newton_inverse::invert(&*self.0, hull, goal, &hull.centre())
        })
    }
}
