//! The resistance of one segment of the snake against its bend: springs with limits, and stops.

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use super::parameters::{MAX_SEGMENTS, MAX_STOPS, StopAxis, StopSegment};
use super::wire::contact;
use crate::model::maths::regression::vector;
use crate::units::MAX_MOTORS;

/// Stiffness beyond the limit of the joints, and the range around the limit, as a part of it, over
/// which the stiffness sets in.
const LIMIT_STIFFNESS: f64 = 3.0;
const LIMIT_SOFTNESS: f64 = 0.1;

/// One value per axis of the bend or per motor.
pub(in crate::model) type Pair = [f64; MAX_MOTORS];

/// The bend of a segment and the positions of its stops.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(in crate::model) struct SegmentState {
    pub bend: Pair,
    pub own: [Pair; MAX_STOPS],
    pub shared: [Pair; MAX_STOPS],
}

/// The bends of the segments. Unused entries are 0.
pub(in crate::model) type Bends<const D: usize> = [SVector<f64, D>; MAX_SEGMENTS];

/// A prepared segment.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Segment<const D: usize> {
    springs: [Spring; D],
    /// Factor on the reach of the stops.
    pub friction: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Spring {
    stiffness: f64,
    stiffening: f64,
    limit: f64,
}

/// The parameters of a stop. Every segment has one stop of each element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::model) struct Element {
    /// Stiffness of the own stops and of the shared stop.
    pub own: f64,
    pub shared: f64,
    /// Reach per force.
    pub reach: f64,
}

/// The reaction of a segment: the part of its state that a balance keeps constant. It contains the
/// bend and the stops before the step, and the reach of the stops as a factor on
/// [`Element::reach`].
#[derive(Debug, Clone, Copy)]
pub(in crate::model) struct Reaction<'a, const D: usize> {
    pub bend: SVector<f64, D>,
    pub state: &'a SegmentState,
    pub own_reach: SVector<f64, D>,
    pub shared_reach: f64,
}

/// The reactions of all segments.
pub(in crate::model) type Reactions<'a, const D: usize> = [Reaction<'a, D>; MAX_SEGMENTS];

/// A force along the axes of the bend and its slope: of the wires, or of a segment against the
/// wires.
#[derive(Debug, Clone, Copy)]
pub(in crate::model) struct WireForce<const D: usize> {
    pub force: SVector<f64, D>,
    pub slope: SMatrix<f64, D, D>,
}

impl<const D: usize> Default for WireForce<D> {
    fn default() -> Self {
        Self { force: SVector::zeros(), slope: SMatrix::zeros() }
    }
}

impl<const D: usize> Segment<D> {
    pub fn new(file: &StopSegment) -> Self {
        Self {
            springs: std::array::from_fn(|i| Spring::new(&file.axes[i])),
            friction: file.friction,
        }
    }

    /// The force of springs and stops at a bend; without a reaction, of the springs alone. `axes`
    /// are the directions of the motors, one column each.
    pub fn resistance(
        &self,
        elements: &[Element],
        axes: &SMatrix<f64, D, D>,
        reaction: Option<&Reaction<'_, D>>,
        bend: &SVector<f64, D>,
    ) -> WireForce<D> {
        let mut total = self.elastic(bend);
        let Some(reaction) = reaction else {
            return total;
        };
        let moved = bend - reaction.bend;
        let along = axes.tr_mul(&moved);
        let mut own = SVector::<f64, D>::zeros();
        let mut own_slope = SVector::<f64, D>::zeros();
        let stops = reaction.state.own.iter().zip(&reaction.state.shared);
        for (stop, (at_own, at_shared)) in elements.iter().zip(stops) {
            for i in 0..D {
                let free = at_own[i] + along[i];
                let reach = stop.reach * reaction.own_reach[i];
                // Not `clamp`, which checks the order of its limits.
                own[i] += stop.own * free.min(reach).max(-reach);
                own_slope[i] += if free.abs() < reach { stop.own } else { 0.0 };
            }
            if stop.shared > 0.0 {
                let free = vector::<D>(at_shared) + moved;
                let reach = stop.reach * reaction.shared_reach;
                add_shared_stop(stop.shared, &free, reach, &mut total);
            }
        }
        total.force += axes * own;
        total.slope += axes * SMatrix::from_diagonal(&own_slope) * axes.transpose();
        total
    }

    /// The force of the springs along the axes of the bend, with the limits of the joints.
    fn elastic(&self, bend: &SVector<f64, D>) -> WireForce<D> {
        let mut total = WireForce::default();
        for (axis, spring) in self.springs.iter().enumerate() {
            let b = bend[axis];
            let (above, above_slope) = contact(b - spring.limit, LIMIT_SOFTNESS * spring.limit);
            let (below, below_slope) = contact(-b - spring.limit, LIMIT_SOFTNESS * spring.limit);
            let cubed = spring.stiffening * b * b;
            total.force[axis] = (spring.stiffness + cubed) * b + LIMIT_STIFFNESS * (above - below);
            total.slope[(axis, axis)] =
                spring.stiffness + 3.0 * cubed + LIMIT_STIFFNESS * (above_slope + below_slope);
        }
        total
    }

    /// Bend per force of the straight segment without friction.
    pub fn compliance(&self) -> SVector<f64, D> {
        SVector::from_fn(|axis, _| 1.0 / self.springs[axis].stiffness)
    }

    /// The force amplitude that moves the segment back and forth through `drag` times its friction.
    pub fn force_for_swing(&self, friction: f64, drag: f64) -> f64 {
        let friction = self.friction * friction;
        let stiffest = self.springs.iter().map(|spring| spring.stiffness).fold(0.0, f64::max);
        friction + 0.5 * stiffest * drag * friction
    }

    /// The range, from end to end, over which a force amplitude moves the segment against friction.
    pub fn swing_at_force(&self, friction: f64, force: f64) -> f64 {
        let beyond = (force - self.friction * friction).max(0.0);
        2.0 * self
            .springs
            .iter()
            .map(|spring| (beyond / spring.stiffness).min(spring.limit))
            .fold(0.0, f64::max)
    }

    /// The largest limit of the axes, and the largest spring force at a limit.
    pub fn limits(&self) -> (f64, f64) {
        let force = |s: &Spring| (s.stiffness + s.stiffening * s.limit * s.limit) * s.limit;
        let largest = |of: &dyn Fn(&Spring) -> f64| self.springs.iter().map(of).fold(0.0, f64::max);
        (largest(&|spring| spring.limit), largest(&force))
    }
}

impl Spring {
    fn new(file: &StopAxis) -> Self {
        Self { stiffness: file.stiffness, stiffening: file.stiffening, limit: file.limit }
    }
}

impl<const D: usize> Reaction<'_, D> {
    /// Own stops and shared stop of one element after a movement of the bend.
    pub fn advanced(
        &self,
        stop: usize,
        element: &Element,
        along: &SVector<f64, D>,
        moved: &SVector<f64, D>,
    ) -> Option<(SVector<f64, D>, SVector<f64, D>)> {
        let own_reach = self.own_reach * element.reach;
        let own = (vector::<D>(self.state.own.get(stop)?) + along)
            .zip_map(&own_reach, |x, reach| x.min(reach).max(-reach));
        let free = vector::<D>(self.state.shared.get(stop)?) + moved;
        let length = free.norm();
        let reach = self.shared_reach * element.reach;
        Some((own, if length > reach { free * (reach / length) } else { free }))
    }
}

/// Adds the force of a shared stop, whose reach is a disc.
fn add_shared_stop<const D: usize>(
    stiffness: f64,
    free: &SVector<f64, D>,
    reach: f64,
    total: &mut WireForce<D>,
) {
    let length = free.norm();
    if length <= reach {
        total.force += free * stiffness;
        total.slope += SMatrix::identity() * stiffness;
        return;
    }
    let direction = free / length;
    total.force += direction * (stiffness * reach);
    let across = SMatrix::identity() - direction * direction.transpose();
    total.slope += across * (stiffness * reach / length);
}
