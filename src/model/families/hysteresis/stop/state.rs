//! The state of stop operators, and its update.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::Stops;
use super::balance::Equilibrium;
use super::parameters::MAX_SEGMENTS;
use super::segment::{Bends, Pair, Reaction, Reactions, SegmentState};
use crate::model::families::gap_scale::UNSCALED;
use crate::model::families::hysteresis::Lags;
use crate::model::maths::regression::{array, vector};
use crate::units::MotorVec;

/// The positions of the motors, the forces of the wires, and the state of every segment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StopState {
    pub(in crate::model) position: MotorVec,
    pub(in crate::model) force: Pair,
    pub(in crate::model) segments: [SegmentState; MAX_SEGMENTS],
    /// Factor on slack and friction of every motor: 1 as calibrated.
    pub(in crate::model) gap_scale: MotorVec,
}

impl StopState {
    /// The state at an equilibrium with all stops centred.
    pub(in crate::model) fn centred<const D: usize>(
        position: &SVector<f64, D>,
        equilibrium: &Equilibrium<D>,
    ) -> Self {
        let segments = equilibrium
            .bends
            .map(|bend| SegmentState { bend: array(&bend), ..SegmentState::default() });
        Self {
            position: array(position),
            force: array(&equilibrium.force),
            segments,
            gap_scale: UNSCALED,
        }
    }

    /// The total bend of the snake.
    pub(in crate::model) fn bend<const D: usize>(&self) -> SVector<f64, D> {
        self.segments.iter().map(|segment| vector::<D>(&segment.bend)).sum()
    }
}

impl<const D: usize> Stops<D> {
    /// The reactions for the next step. The reach of the stops follows the forces of the last step.
    pub(in crate::model) fn reactions<'a>(&self, state: &'a StopState) -> Reactions<'a, D> {
        let load = self.load(&vector(&state.force), &state.bend());
        let scale = vector::<D>(&state.gap_scale);
        let own_reach = load.zip_map(&scale, |load, scale| scale * (self.base_friction + load));
        let shared_reach = scale.mean() * (self.base_friction + load.norm());
        let mut reactions = state.segments.each_ref().map(|state| Reaction {
            bend: vector(&state.bend),
            state,
            own_reach,
            shared_reach,
        });
        for (reaction, segment) in reactions.iter_mut().zip(&self.segments) {
            reaction.own_reach *= segment.friction;
            reaction.shared_reach *= segment.friction;
        }
        reactions
    }

    /// Load-dependent friction per motor, a force.
    fn load(&self, force: &SVector<f64, D>, bend: &SVector<f64, D>) -> SVector<f64, D> {
        let growth = 1.0 + self.friction_growth * bend.norm();
        let mut load = *force;
        for (load, motor) in load.iter_mut().zip(&self.motors) {
            let [plus, minus] = motor.friction;
            *load *= growth * if *load > 0.0 { plus } else { -minus };
        }
        load
    }

    /// The bends before a step. They start the search for the bends after it.
    pub(in crate::model) fn bends(reactions: &Reactions<'_, D>) -> Bends<D> {
        reactions.each_ref().map(|reaction| reaction.bend)
    }

    /// Stores an equilibrium in the state.
    pub(in crate::model) fn store(
        &self,
        state: &mut StopState,
        reactions: &Reactions<'_, D>,
        equilibrium: &Equilibrium<D>,
    ) {
        let segments = state.segments.iter_mut().zip(reactions).zip(&equilibrium.bends);
        for ((segment, reaction), bend) in segments.take(self.segments.len()) {
            let movement = bend - reaction.bend;
            let along = self.axes.tr_mul(&movement);
            let stops = segment.own.iter_mut().zip(&mut segment.shared);
            for (k, ((own, shared), element)) in stops.zip(&self.elements).enumerate() {
                let advanced = reaction.advanced(k, element, &along, &movement);
                if let Some((next_own, next_shared)) = advanced {
                    (*own, *shared) = (array(&next_own), array(&next_shared));
                }
            }
            segment.bend = array(bend);
        }
        state.force = array(&equilibrium.force);
    }

    /// The lags, segment by segment: every stop relative to its reach, own stops before the shared
    /// stop. The forces of the motors follow, relative to the reference force.
    pub(in crate::model) fn push_all_lags(&self, state: &StopState, lags: &mut Lags) {
        for reaction in self.reactions(state).iter().take(self.segments.len()) {
            let stops = reaction.state.own.iter().zip(&reaction.state.shared);
            for (element, (own, shared)) in self.elements.iter().zip(stops) {
                for (own, reach) in own.iter().zip(reaction.own_reach.iter()) {
                    lags.push(own / (reach * element.reach).max(LEAST_REACH));
                }
                if D > 1 {
                    let reach = (reaction.shared_reach * element.reach).max(LEAST_REACH);
                    for shared in shared.iter().take(D) {
                        lags.push(shared / reach);
                    }
                }
            }
        }
        for force in state.force.iter().take(D) {
            lags.push(force / self.reference_force);
        }
    }
}

/// Least reach that a lag is divided by.
const LEAST_REACH: f64 = 1e-9;
