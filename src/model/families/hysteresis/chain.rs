//! The chain of a model with memory: operator, regression, residual.

use nalgebra::SVector;

use super::StoredOperator;
use super::residual::Residual;
use crate::model::error::ModelError;
use crate::model::estimate::{Estimate, Inverse, JacobianMatrix, Query};
use crate::model::families::memory::Memory;
use crate::model::families::round_trip;
use crate::model::families::runtime::Runtime;
use crate::model::maths::gaussian_mixture_regression::Gmr;
use crate::model::maths::hull::{Hull, TOLERANCE_COUNTS};
use crate::model::maths::newton_inverse;
use crate::model::maths::regression::{Local, Regression, array, bounded, estimate, rows, vector};
use crate::model::output_unit::OutputUnit;
use crate::units::{MAX_MOTORS, MotorVec, OutputVec};

/// A prepared model with memory.
#[derive(Debug)]
pub(in crate::model) struct Chain<O, const D: usize, const M: usize> {
    pub operator: O,
    /// From virtual counts to outputs.
    pub read_out: Gmr<D, M>,
    pub residual: Option<Residual<D, M>>,
    /// The region of virtual counts that calibration visited.
    pub virtual_hull: Hull,
}

impl<O: StoredOperator<D>, const D: usize, const M: usize> Chain<O, D, M> {
    /// The state in a memory. Without one, the state from the present position alone.
    fn state(&self, memory: &Memory) -> O::State {
        let position = memory.seen.map(|seen| seen.position).unwrap_or_default();
        O::unpack(&memory.state)
            .unwrap_or_else(|| self.operator.begin(&vector(&bounded(&position))))
    }

    fn residual(&self, state: &O::State, position: &MotorVec) -> SVector<f64, M> {
        self.residual
            .as_ref()
            .map_or_else(SVector::zeros, |residual| {
                let virtual_counts = self.operator.local(state, &vector(&bounded(position))).mean;
                residual.at(&virtual_counts, &self.operator.lags(state))
            })
    }

    /// Outputs without the residual, and their slope.
    fn local(&self, state: &O::State, counts: &SVector<f64, D>) -> Local<D, M> {
        let inner = self.operator.local(state, counts);
        let outer = self.read_out.local(&inner.mean);
        Local {
            mean: outer.mean,
            jacobian: outer.jacobian * inner.jacobian,
        }
    }

    fn invert_without_residual(
        &self,
        goal: &OutputVec,
        state: &O::State,
        hull: &Hull,
        query: &Query,
    ) -> Inverse {
        let start = self
            .operator
            .local(state, &vector(&bounded(&query.start)))
            .mean;
        let found =
            newton_inverse::invert(&self.read_out, &self.virtual_hull, goal, &array(&start));
        if !found.residual.is_finite() {
            return Inverse {
                counts: hull.project(&query.start),
                ..found
            };
        }
        let virtual_counts = vector::<D>(&found.counts);
        let unconstrained: MotorVec = array(&self.operator.invert(
            state,
            &virtual_counts,
            query.compensation,
        ));
        let counts = hull.project(&unconstrained);
        let outside_hull = counts
            .iter()
            .zip(unconstrained)
            .any(|(inside, outside)| (inside - outside).abs() > TOLERANCE_COUNTS);
        if !outside_hull {
            return Inverse { counts, ..found };
        }
        let reached = self.local(state, &vector(&counts)).mean;
        Inverse {
            counts,
            clipped: true,
            residual: (reached - vector::<M>(goal)).norm(),
            ..found
        }
    }
}

impl<O: StoredOperator<D>, const D: usize, const M: usize> Runtime for Chain<O, D, M> {
    fn advance(&self, memory: &mut Memory, counts: &MotorVec) {
        let counts = vector(&bounded(counts));
        memory.state = match O::unpack(&memory.state) {
            Some(mut state) => {
                self.operator.advance(&mut state, &counts);
                O::pack(state)
            }
            None => O::pack(self.operator.begin(&counts)),
        };
    }

    fn conditioning_range(&self) -> MotorVec {
        self.operator.wipe_counts()
    }

    /// An operator that forgets only over more than the hull is taken as known when the hull has
    /// been covered: calibration cannot cover more.
    fn is_known(&self, memory: &Memory, range: &MotorVec) -> bool {
        let limited = self.operator.wipe_counts() != *range;
        memory.covered(range) && (limited || self.operator.has_forgotten(&self.state(memory)))
    }

    fn virtual_counts(&self, counts: &MotorVec, memory: &Memory) -> MotorVec {
        array(
            &self
                .operator
                .local(&self.state(memory), &vector(&bounded(counts)))
                .mean,
        )
    }

    fn predict(&self, counts: &MotorVec, memory: &Memory) -> Estimate {
        let state = self.state(memory);
        let position = memory.seen.map_or(*counts, |seen| seen.position);
        let virtual_counts = self.operator.local(&state, &vector(&bounded(counts))).mean;
        let mut prediction = self.read_out.predict(&virtual_counts);
        prediction.mean += self.residual(&state, &position);
        estimate(&prediction)
    }

    fn jacobian(&self, counts: &MotorVec, memory: &Memory) -> JacobianMatrix {
        rows(
            &self
                .local(&self.state(memory), &vector(&bounded(counts)))
                .jacobian,
        )
    }

    fn correction(&self, memory: &Memory) -> OutputVec {
        memory.seen.map_or_else(OutputVec::default, |seen| {
            array(&self.residual(&self.state(memory), &seen.position))
        })
    }

    fn invert(&self, goal: &OutputVec, memory: &Memory, hull: &Hull, query: &Query) -> Inverse {
        let correction = query.correction.unwrap_or_else(|| self.correction(memory));
        let mut goal = *goal;
        for (output, correction) in goal.iter_mut().zip(correction) {
            *output -= correction;
        }
        self.invert_without_residual(&goal, &self.state(memory), hull, query)
    }

    /// Starts from the centre of the hull, without past motion. Virtual counts outside the
    /// calibrated region are left out.
    fn check_round_trip(&self, hull: &Hull, unit: OutputUnit) -> Result<(), ModelError> {
        let state = self.operator.begin(&vector(&hull.centre()));
        let query = Query::new(hull.centre());
        let virtual_counts = |counts: &MotorVec| -> MotorVec {
            array::<D, MAX_MOTORS>(&self.operator.local(&state, &vector(counts)).mean)
        };
        round_trip::check(
            hull,
            unit,
            |counts| {
                self.virtual_hull
                    .contains(&virtual_counts(counts))
                    .then(|| self.local(&state, &vector(counts)))
            },
            |goal| self.invert_without_residual(goal, &state, hull, &query),
        )
    }
}
