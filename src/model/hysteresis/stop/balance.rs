//! The balance of forces: wires against springs and stops.

use nalgebra::{SMatrix, SVector};

use super::Stops;
use super::parameters::MAX_STOPS;
use super::wire::contact;

/// The most evaluations of one balance. In steps of the control loop it takes two to four.
const MAX_EVALUATIONS: u32 = 30;

/// A balance that is off by less than this part of the wire travel is found: far below what a count moves.
const BALANCED: f64 = 1e-10;

/// A Newton step that does not help is shortened by this, at most so many times.
const SHORTENING: f64 = 0.4;
const LEAST_STEP: f64 = 0.01;

/// Stiffness of the ends of the joints, and the part of the limit over which they are met.
const LIMIT_STIFFNESS: f64 = 3.0;
const LIMIT_SOFTNESS: f64 = 0.1;

/// What stays put while the balance is sought: the bend and the stops before the step, and how far stops reach.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hold<const D: usize> {
    pub bend: SVector<f64, D>,
    /// Stops of the motors, one row of motors per stop.
    pub own: [SVector<f64, D>; MAX_STOPS],
    pub shared: [SVector<f64, D>; MAX_STOPS],
    pub own_reach: [SVector<f64, D>; MAX_STOPS],
    pub shared_reach: [f64; MAX_STOPS],
}

/// A force and its slope.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pull<const D: usize> {
    pub force: SVector<f64, D>,
    pub slope: SMatrix<f64, D, D>,
}

/// Where the balance is, and what the wires pull there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Settled<const D: usize> {
    pub bend: SVector<f64, D>,
    /// Of the wires, per motor.
    pub force: SVector<f64, D>,
    /// Of the wires over their stretch.
    pub wire_slope: SVector<f64, D>,
    /// What is not in balance yet, and how it changes with the bend.
    rest: Pull<D>,
}

impl<const D: usize> Hold<D> {
    /// Own stops and shared stop of one element after the bend went to `bend`.
    pub fn moved(
        &self,
        stop: usize,
        along: &SVector<f64, D>,
        moved: &SVector<f64, D>,
    ) -> Option<(SVector<f64, D>, SVector<f64, D>)> {
        let reach = self.own_reach.get(stop)?;
        let own = (self.own.get(stop)? + along).zip_map(reach, |x, reach| x.clamp(-reach, reach));
        let free = self.shared.get(stop)? + moved;
        let length = free.norm();
        let reach = *self.shared_reach.get(stop)?;
        Some((own, if length > reach { free * (reach / length) } else { free }))
    }
}

impl<const D: usize> Stops<D> {
    /// What springs and stops hold against a bend; without a hold, the springs alone.
    pub(super) fn resistance(&self, hold: Option<&Hold<D>>, bend: &SVector<f64, D>) -> Pull<D> {
        let mut pull = self.elastic(bend);
        let Some(hold) = hold else { return pull };
        let moved = bend - hold.bend;
        let along = self.axes.tr_mul(&moved);
        let mut own = SVector::<f64, D>::zeros();
        let mut own_slope = SVector::<f64, D>::zeros();
        for (k, stop) in self.elements.iter().enumerate() {
            let (Some(at), Some(reach)) = (hold.own.get(k), hold.own_reach.get(k)) else { break };
            for i in 0..D {
                let free = at[i] + along[i];
                own[i] += stop.own * free.clamp(-reach[i], reach[i]);
                own_slope[i] += if free.abs() < reach[i] { stop.own } else { 0.0 };
            }
            if let (Some(at), Some(reach)) = (hold.shared.get(k), hold.shared_reach.get(k)) {
                disc(stop.shared, &(at + moved), *reach, &mut pull);
            }
        }
        pull.force += self.axes * own;
        pull.slope += self.axes * SMatrix::from_diagonal(&own_slope) * self.axes.transpose();
        pull
    }

    /// Springs along the axes of the bend, with the ends of the joints.
    fn elastic(&self, bend: &SVector<f64, D>) -> Pull<D> {
        let mut pull = Pull { force: SVector::zeros(), slope: SMatrix::zeros() };
        for (axis, spring) in self.springs.iter().enumerate() {
            let b = bend[axis];
            let (over, over_slope) = contact(b - spring.limit, LIMIT_SOFTNESS * spring.limit);
            let (under, under_slope) = contact(-b - spring.limit, LIMIT_SOFTNESS * spring.limit);
            let cubed = spring.stiffening * b * b;
            pull.force[axis] = (spring.stiffness + cubed) * b + LIMIT_STIFFNESS * (over - under);
            pull.slope[(axis, axis)] = spring.stiffness + 3.0 * cubed + LIMIT_STIFFNESS * (over_slope + under_slope);
        }
        pull
    }

    /// The bend at which the wires, pulled so far, balance springs and stops. Both sides are gradients of convex
    /// functions, so there is one, and a Newton step that is short enough always helps.
    pub(super) fn settle(
        &self,
        hold: Option<&Hold<D>>,
        travel: &SVector<f64, D>,
        start: &SVector<f64, D>,
    ) -> Settled<D> {
        let near = BALANCED * (1.0 + travel.amax());
        let mut here = self.stand(hold, travel, *start);
        let mut evaluations = 1;
        while evaluations < MAX_EVALUATIONS && here.rest.force.norm() > near {
            let Some(inverse) = here.rest.slope.try_inverse() else { break };
            let step = inverse * here.rest.force;
            let mut share = 1.0;
            let next = loop {
                let there = self.stand(hold, travel, here.bend - step * share);
                evaluations += 1;
                let better = there.rest.force.norm() < here.rest.force.norm();
                if better || evaluations >= MAX_EVALUATIONS || share < LEAST_STEP {
                    break better.then_some(there);
                }
                share *= SHORTENING;
            };
            let Some(next) = next else { break };
            here = next;
        }
        here
    }

    fn stand(&self, hold: Option<&Hold<D>>, travel: &SVector<f64, D>, bend: SVector<f64, D>) -> Settled<D> {
        let mut rest = self.resistance(hold, &bend);
        let stretch = travel - self.axes.tr_mul(&bend);
        let (mut force, mut wire_slope) = (SVector::<f64, D>::zeros(), SVector::<f64, D>::zeros());
        for (i, motor) in self.motors.iter().enumerate() {
            (force[i], wire_slope[i]) = motor.wire.pull(stretch[i]);
        }
        rest.force -= self.axes * force;
        rest.slope += self.axes * SMatrix::from_diagonal(&wire_slope) * self.axes.transpose();
        Settled { bend, force, wire_slope, rest }
    }
}

impl<const D: usize> Settled<D> {
    /// How the bend follows the wire travel of the motors.
    pub fn follow(&self, axes: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
        let inverse = self.rest.slope.try_inverse().unwrap_or_else(SMatrix::zeros);
        inverse * axes * SMatrix::from_diagonal(&self.wire_slope)
    }
}

/// Adds the force of a stop whose reach is a disc.
fn disc<const D: usize>(stiffness: f64, free: &SVector<f64, D>, reach: f64, pull: &mut Pull<D>) {
    let length = free.norm();
    if length <= reach {
        pull.force += free * stiffness;
        pull.slope += SMatrix::identity() * stiffness;
        return;
    }
    let direction = free / length;
    pull.force += direction * (stiffness * reach);
    let across = SMatrix::identity() - direction * direction.transpose();
    pull.slope += across * (stiffness * reach / length);
}
