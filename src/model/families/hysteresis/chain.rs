//! The chain of a model with memory: operator, regression, residual.

use nalgebra::SVector;

use super::residual::Residual;
use super::{Lags, StoredOperator};
use crate::model::error::ModelError;
use crate::model::estimate::{Estimate, Inverse, JacobianMatrix, MemoryTerms, OutputUnit, Query};
use crate::model::families::memory::Memory;
use crate::model::families::runtime::{Reach, Runtime, Search};
use crate::model::maths::hull::{Hull, TOLERANCE_COUNTS};
use crate::model::maths::newton_inverse::SearchStart;
use crate::model::maths::{
    Local, Regression, array, bounded, estimate, newton_inverse, rows, vector,
};
use crate::units::{MAX_MOTORS, MotorVec, OutputVec};

#[derive(Debug)]
pub(in crate::model) struct Chain<O, R, const D: usize, const M: usize> {
    pub operator: O,
    /// Read-out from virtual counts to outputs.
    pub read_out: R,
    pub residual: Option<Residual<D, M>>,
    /// The region of virtual counts that calibration visited.
    pub virtual_hull: Hull,
}

impl<O, R, const D: usize, const M: usize> Chain<O, R, D, M>
where
    O: StoredOperator<D>,
    R: Regression<D, M>,
{
    /// Works on the state in a memory. Without one, on the state from the present position alone.
    #[inline]
    fn with_state<T>(&self, memory: &Memory, work: impl FnOnce(&O::State) -> T) -> T {
        match O::unpack(&memory.state) {
            Some(state) => work(state),
            None => {
                let position = memory.seen.map(|seen| seen.position).unwrap_or_default();
                work(&self.operator.begin(&vector(&bounded(&position))))
            }
        }
    }

    /// The virtual counts after a straight motion. NaN for a position of NaN: operators
    /// that compare would keep their state.
    #[inline]
    fn virtual_counts_at(&self, state: &O::State, counts: &MotorVec) -> SVector<f64, D> {
        let counts = vector::<D>(&bounded(counts));
        if counts.iter().any(|counts| counts.is_nan()) {
            return SVector::repeat(f64::NAN);
        }
        self.operator.virtual_counts(state, &counts)
    }

    /// The virtual counts at a position, and the residual there.
    fn terms(&self, state: &O::State, position: &MotorVec) -> MemoryTerms {
        let position = vector(&bounded(position));
        let virtual_counts = self.operator.virtual_counts(state, &position);
        let mut terms =
            MemoryTerms { virtual_counts: array(&virtual_counts), ..MemoryTerms::default() };
        if let Some(residual) = &self.residual {
            let mut lags = Lags::default();
            self.operator.push_lags(state, &mut lags);
            terms.correction = array(&residual.at(&virtual_counts, &lags));
        }
        terms
    }

    /// Outputs without the residual, and their slope.
    fn local(&self, state: &O::State, counts: &SVector<f64, D>) -> Local<D, M> {
        let inner = self.operator.local(state, counts);
        let outer = self.read_out.local(&inner.mean);
        Local { mean: outer.mean, jacobian: outer.jacobian * inner.jacobian }
    }

    /// Mean and covariances at counts, with the terms at the position of the memory.
    fn predict_from(
        &self,
        counts: &MotorVec,
        state: &O::State,
        position: &MotorVec,
        terms: &MemoryTerms,
    ) -> Estimate {
        let virtual_counts = if counts == position {
            vector(&terms.virtual_counts)
        } else {
            self.virtual_counts_at(state, counts)
        };
        let mut prediction = self.read_out.predict(&virtual_counts);
        prediction.mean += vector::<M>(&terms.correction);
        estimate(&prediction)
    }

    /// The virtual counts at a position that nothing led to.
    fn without_past(&self, counts: &MotorVec) -> MotorVec {
        let counts = vector(counts);
        array(&self.operator.virtual_counts(&self.operator.begin(&counts), &counts))
    }

    fn search_start(&self, state: &O::State, query: &Query, hull: &Hull) -> SearchStart<D, M> {
        let start = vector(&bounded(&query.start));
        let virtual_counts = self.operator.virtual_counts(state, &start);
        SearchStart::new(&self.read_out, hull, &array(&virtual_counts))
    }

    /// The inverse of a goal without the residual, and where the search of the regression ended.
    fn invert_from(
        &self,
        goal: &OutputVec,
        (state, origin): (&O::State, &O::Origin<'_>),
        Reach { counts: hull, virtual_counts }: &Reach,
        query: &Query,
        start: &SearchStart<D, M>,
    ) -> (Inverse, SearchStart<D, M>) {
        let (found, end) = newton_inverse::invert_from(&self.read_out, virtual_counts, goal, start);
        if !found.residual.is_finite() {
            let counts = hull.project(&query.start);
            return (Inverse { counts, ..found }, end);
        }
        let virtual_counts = vector::<D>(&found.counts);
        let unconstrained: MotorVec =
            array(&self.operator.invert_from(origin, &virtual_counts, query.compensation));
        let nearest = hull.project(&unconstrained);
        let differs = |a: MotorVec, b: MotorVec| {
            a.iter().zip(b).any(|(a, b)| (a - b).abs() > TOLERANCE_COUNTS)
        };
        if !differs(nearest, unconstrained) {
            return (Inverse { counts: nearest, ..found }, end);
        }
        let slack = self.operator.slack(origin, &vector(&unconstrained), &virtual_counts);
        let counts = hull.project_with_slack(&unconstrained, &slack);
        let [low, high] = slack;
        let held = std::array::from_fn(|motor| counts[motor].max(low[motor]).min(high[motor]));
        if !differs(held, counts) {
            return (Inverse { counts, ..found }, end);
        }
        let reached_virtual = self.operator.virtual_counts(state, &vector(&counts));
        let reached = self.read_out.mean(&reached_virtual);
        let inverse = Inverse {
            counts,
            clipped: true,
            residual: (reached - vector::<M>(goal)).norm(),
            ..found
        };
        (inverse, end)
    }
}

/// A goal plus a share of the correction.
fn with(goal: &OutputVec, share: f64, correction: &OutputVec) -> OutputVec {
    std::array::from_fn(|output| goal[output] + share * correction[output])
}

impl<O, R, const D: usize, const M: usize> Runtime for Chain<O, R, D, M>
where
    O: StoredOperator<D>,
    R: Regression<D, M>,
{
    fn advance(&self, memory: &mut Memory, counts: &MotorVec, time_s: f64) {
        let counts = vector(&bounded(counts));
        match O::unpack_mut(&mut memory.state) {
            Some(state) => self.operator.advance_over(state, &counts, time_s),
            None => memory.state = O::pack(self.operator.begin(&counts)),
        }
    }

    fn conditioning_range(&self) -> MotorVec {
        self.operator.conditioning_range()
    }

    fn has_backlash(&self) -> bool {
        true
    }

    fn virtual_counts(&self, counts: &MotorVec, memory: &Memory) -> MotorVec {
        let counts = vector(&bounded(counts));
        self.with_state(memory, |state| array(&self.operator.virtual_counts(state, &counts)))
    }

    fn predict(&self, counts: &MotorVec, memory: &Memory) -> Estimate {
        let position = memory.seen.map_or(*counts, |seen| seen.position);
        self.with_state(memory, |state| {
            let terms = self.terms(state, &position);
            self.predict_from(counts, state, &position, &terms)
        })
    }

    fn predict_with(&self, counts: &MotorVec, memory: &Memory, terms: &MemoryTerms) -> Estimate {
        memory.seen.map_or_else(
            || self.predict(counts, memory),
            |seen| {
                self.with_state(memory, |state| {
                    self.predict_from(counts, state, &seen.position, terms)
                })
            },
        )
    }

    fn pose(&self, counts: &MotorVec, memory: &Memory, correction: &OutputVec) -> OutputVec {
        self.with_state(memory, |state| {
            let virtual_counts = self.virtual_counts_at(state, counts);
            array(&(self.read_out.mean(&virtual_counts) + vector::<M>(correction)))
        })
    }

    fn pose_and_slope(
        &self,
        counts: &MotorVec,
        memory: &Memory,
        correction: &OutputVec,
    ) -> (OutputVec, JacobianMatrix) {
        let counts = vector(&bounded(counts));
        let local = self.with_state(memory, |state| self.local(state, &counts));
        let mean = local.mean + vector::<M>(correction);
        (array(&mean), rows(&local.jacobian))
    }

    fn memory_terms(&self, memory: &Memory) -> MemoryTerms {
        memory.seen.map_or_else(MemoryTerms::default, |seen| {
            self.with_state(memory, |state| self.terms(state, &seen.position))
        })
    }

    /// The virtual counts of the calibration, and of the counts as they are without past motion.
    fn reach(&self, hull: &Hull) -> Reach {
        let counts: Vec<_> = hull.corners().map(|corner| self.without_past(&corner)).collect();
        let led_to = Hull::from_points(D, &counts);
        let common = led_to.and_then(|led_to| self.virtual_hull.common(&led_to, D));
        let virtual_counts = common.unwrap_or_else(|_| self.virtual_hull.clone());
        Reach { counts: hull.clone(), virtual_counts }
    }

    fn invert_each(&self, goals: &[OutputVec], search: Search<'_>, found: &mut [Inverse]) {
        let Search { memory, reach, query } = search;
        let correction = query.correction.unwrap_or_else(|| self.memory_terms(memory).correction);
        self.with_state(memory, |state| {
            let origin = self.operator.origin(state);
            let mut start = self.search_start(state, query, &reach.virtual_counts);
            for (index, (goal, found)) in goals.iter().zip(found).enumerate() {
                let goal = with(goal, -1.0, &correction);
                let from = (state, &origin);
                let (inverse, end) = self.invert_from(&goal, from, reach, query, &start);
                *found = Inverse { reached: with(&inverse.reached, 1.0, &correction), ..inverse };
                if index == 0 {
                    start = end;
                }
            }
        });
    }

    /// Starts from the centre of the hull, without past motion. Virtual counts outside the
    /// calibrated region are left out.
    fn check_round_trip(&self, hull: &Hull, unit: OutputUnit) -> Result<(), ModelError> {
        let state = self.operator.begin(&vector(&hull.centre()));
        let origin = self.operator.origin(&state);
        let query = Query::new(hull.centre());
        let reach = Reach { counts: hull.clone(), virtual_counts: self.virtual_hull.clone() };
        let start = self.search_start(&state, &query, &self.virtual_hull);
        let virtual_counts = |counts: &MotorVec| -> MotorVec {
            array::<D, MAX_MOTORS>(&self.operator.virtual_counts(&state, &vector(counts)))
        };
        newton_inverse::check_round_trip(
            hull,
            unit,
            |counts| {
                self.virtual_hull
                    .contains(&virtual_counts(counts))
                    .then(|| self.local(&state, &vector(counts)))
            },
            |goal| self.invert_from(goal, (&state, &origin), &reach, &query, &start).0,
        )
    }
}
