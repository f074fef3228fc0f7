//! What stop operators remember, and how it moves on.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::Stops;
use super::balance::{Hold, Settled};
use super::parameters::MAX_STOPS;
use crate::model::hysteresis::Lags;
use crate::model::regression::{array, vector};
use crate::units::{MAX_MOTORS, MotorVec};

/// One value per axis of the bend or per motor.
type Pair = [f64; MAX_MOTORS];

/// Where the motors are, how far the snake bends, what the wires pull, and where the stops are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StopState {
    pub(super) position: MotorVec,
    pub(super) bend: Pair,
    pub(super) force: Pair,
    pub(super) own: [Pair; MAX_STOPS],
    pub(super) shared: [Pair; MAX_STOPS],
}

impl StopState {
    /// All stops in their middle.
    pub(super) fn centred<const D: usize>(position: &SVector<f64, D>, settled: &Settled<D>) -> Self {
        Self {
            position: array(position),
            bend: array(&settled.bend),
            force: array(&settled.force),
            own: [Pair::default(); MAX_STOPS],
            shared: [Pair::default(); MAX_STOPS],
        }
    }
}

impl<const D: usize> Stops<D> {
    /// What stays put in the next step. The reach of the stops follows the forces of the last one.
    pub(super) fn hold(&self, state: &StopState) -> Hold<D> {
        let bend = vector::<D>(&state.bend);
        let load = self.load(&vector(&state.force), &bend);
        let mut hold = Hold {
            bend,
            own: state.own.map(|own| vector(&own)),
            shared: state.shared.map(|shared| vector(&shared)),
            own_reach: [SVector::zeros(); MAX_STOPS],
            shared_reach: [0.0; MAX_STOPS],
        };
        let reaches = hold.own_reach.iter_mut().zip(&mut hold.shared_reach);
        for ((own, shared), element) in reaches.zip(&self.elements) {
            *own = load.map(|load| element.reach * (self.base_friction + load));
            *shared = element.reach * (self.base_friction + load.norm());
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

    /// Makes a balance the state.
    pub(super) fn commit(&self, state: &mut StopState, hold: &Hold<D>, settled: &Settled<D>) {
        let moved = settled.bend - hold.bend;
        let along = self.axes.tr_mul(&moved);
        for (k, (own, shared)) in state.own.iter_mut().zip(&mut state.shared).take(self.elements.len()).enumerate() {
            if let Some((own_now, shared_now)) = hold.moved(k, &along, &moved) {
                (*own, *shared) = (array(&own_now), array(&shared_now));
            }
        }
        state.bend = array(&settled.bend);
        state.force = array(&settled.force);
    }

    /// Every stop over its reach, own ones before shared ones; then the forces.
    pub(super) fn all_lags(&self, state: &StopState) -> Lags {
        let hold = self.hold(state);
        let mut lags = Lags::default();
        let stops = hold.own.iter().zip(&hold.shared).zip(hold.own_reach.iter().zip(hold.shared_reach));
        for ((own, shared), (own_reach, shared_reach)) in stops.take(self.elements.len()) {
            own.iter().zip(own_reach.iter()).for_each(|(own, reach)| lags.push(own / reach.max(LEAST_REACH)));
            if D > 1 {
                shared.iter().for_each(|shared| lags.push(shared / shared_reach.max(LEAST_REACH)));
            }
        }
        state.force.iter().take(D).for_each(|force| lags.push(force / self.usual_force));
        lags
    }
}

/// A reach below this is no reach.
const LEAST_REACH: f64 = 1e-9;
