//! What stop operators remember, and how it moves on.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::Stops;
use super::balance::Settled;
use super::parameters::{MAX_SEGMENTS, MAX_STOPS};
use super::segment::{Bends, Hold, Holds};
use crate::model::families::hysteresis::Lags;
use crate::model::maths::regression::{array, vector};
use crate::units::{MAX_MOTORS, MotorVec};

/// One value per axis of the bend or per motor.
type Pair = [f64; MAX_MOTORS];

/// Where the motors are, what the wires pull, how far every segment bends, and where its stops are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StopState {
    pub(in crate::model) position: MotorVec,
    pub(in crate::model) force: Pair,
    pub(in crate::model) segments: [SegmentState; MAX_SEGMENTS],
}

/// What a segment remembers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(in crate::model) struct SegmentState {
    pub bend: Pair,
    pub own: [Pair; MAX_STOPS],
    pub shared: [Pair; MAX_STOPS],
}

impl StopState {
    /// All stops in their middle.
    pub(in crate::model) fn centred<const D: usize>(
        position: &SVector<f64, D>,
        settled: &Settled<D>,
    ) -> Self {
        let segments = settled.bends.map(|bend| SegmentState {
            bend: array(&bend),
            ..SegmentState::default()
        });
        Self {
            position: array(position),
            force: array(&settled.force),
            segments,
        }
    }

    /// Of the whole snake.
    pub(in crate::model) fn bend<const D: usize>(&self) -> SVector<f64, D> {
        self.segments
            .iter()
            .map(|segment| vector::<D>(&segment.bend))
            .sum()
    }
}

impl<const D: usize> Stops<D> {
    /// What stays put in the next step. The reach of the stops follows the forces of the last one.
    pub(in crate::model) fn hold(&self, state: &StopState) -> Holds<D> {
        let load = self.load(&vector(&state.force), &state.bend());
        let mut friction = [0.0; MAX_SEGMENTS];
        friction
            .iter_mut()
            .zip(&self.segments)
            .for_each(|(friction, segment)| *friction = segment.friction);
        std::array::from_fn(|s| self.hold_segment(&state.segments[s], &load, friction[s]))
    }

    fn hold_segment(&self, state: &SegmentState, load: &SVector<f64, D>, friction: f64) -> Hold<D> {
        let mut hold = Hold {
            bend: vector(&state.bend),
            own: state.own.map(|own| vector(&own)),
            shared: state.shared.map(|shared| vector(&shared)),
            own_reach: [SVector::zeros(); MAX_STOPS],
            shared_reach: [0.0; MAX_STOPS],
        };
        let reaches = hold.own_reach.iter_mut().zip(&mut hold.shared_reach);
        for ((own, shared), element) in reaches.zip(&self.elements) {
            let reach = friction * element.reach;
            *own = load.map(|load| reach * (self.base_friction + load));
            *shared = reach * (self.base_friction + load.norm());
        }
        hold
    }

    /// Friction under load, per motor, a force.
    fn load(&self, force: &SVector<f64, D>, bend: &SVector<f64, D>) -> SVector<f64, D> {
        let growth = 1.0 + self.friction_growth * bend.norm();
        let mut load = *force;
        for (load, motor) in load.iter_mut().zip(&self.motors) {
            let [plus, minus] = motor.friction;
            *load *= growth * if *load > 0.0 { plus } else { -minus };
        }
        load
    }

    /// The bends before a step, as a start for the search of those after it.
    pub(in crate::model) fn bends(holds: &Holds<D>) -> Bends<D> {
        holds.each_ref().map(|hold| hold.bend)
    }

    /// Makes a balance the state.
    pub(in crate::model) fn commit(
        &self,
        state: &mut StopState,
        holds: &Holds<D>,
        settled: &Settled<D>,
    ) {
        let segments = state.segments.iter_mut().zip(holds).zip(&settled.bends);
        for ((segment, hold), bend) in segments.take(self.segments.len()) {
            let moved = bend - hold.bend;
            let along = self.axes.tr_mul(&moved);
            let stops = segment.own.iter_mut().zip(&mut segment.shared);
            for (k, (own, shared)) in stops.take(self.elements.len()).enumerate() {
                if let Some((own_now, shared_now)) = hold.moved(k, &along, &moved) {
                    (*own, *shared) = (array(&own_now), array(&shared_now));
                }
            }
            segment.bend = array(bend);
        }
        state.force = array(&settled.force);
    }

    /// Segment by segment every stop over its reach, own ones before shared ones; then the forces.
    pub(in crate::model) fn all_lags(&self, state: &StopState) -> Lags {
        let mut lags = Lags::default();
        for hold in self.hold(state).iter().take(self.segments.len()) {
            let stops = hold
                .own
                .iter()
                .zip(&hold.shared)
                .zip(hold.own_reach.iter().zip(hold.shared_reach));
            for ((own, shared), (own_reach, shared_reach)) in stops.take(self.elements.len()) {
                own.iter()
                    .zip(own_reach.iter())
                    .for_each(|(own, reach)| lags.push(own / reach.max(LEAST_REACH)));
                if D > 1 {
                    shared
                        .iter()
                        .for_each(|shared| lags.push(shared / shared_reach.max(LEAST_REACH)));
                }
            }
        }
        state
            .force
            .iter()
            .take(D)
            .for_each(|force| lags.push(force / self.usual_force));
        lags
    }
}

/// A reach below this is no reach.
const LEAST_REACH: f64 = 1e-9;
