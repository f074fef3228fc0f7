//! What one segment of the snake holds against its bend: springs with ends, and stops.

use nalgebra::{SMatrix, SVector};

use super::parameters::{MAX_SEGMENTS, MAX_STOPS, StopAxis, StopSegment};
use super::wire::contact;

/// Stiffness of the ends of the joints, and the part of the limit over which they are met.
const LIMIT_STIFFNESS: f64 = 3.0;
const LIMIT_SOFTNESS: f64 = 0.1;

/// Bends of the segments; unused ones are 0.
pub(in crate::model) type Bends<const D: usize> = [SVector<f64, D>; MAX_SEGMENTS];

/// A prepared segment.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Segment<const D: usize> {
    springs: [Spring; D],
    /// Reach of its stops over what they say.
    pub friction: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Spring {
    stiffness: f64,
    stiffening: f64,
    limit: f64,
}

/// A stop of every segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::model) struct Element {
    /// Stiffness of the own stops and of the shared stop.
    pub own: f64,
    pub shared: f64,
    /// Reach per force.
    pub reach: f64,
}

/// What stays put while the balance is sought: the bend and the stops before the step, and how far
/// stops reach.
#[derive(Debug, Clone, Copy)]
pub(in crate::model) struct Hold<const D: usize> {
    pub bend: SVector<f64, D>,
    /// Stops of the motors, one row of motors per stop.
    pub own: [SVector<f64, D>; MAX_STOPS],
    pub shared: [SVector<f64, D>; MAX_STOPS],
    pub own_reach: [SVector<f64, D>; MAX_STOPS],
    pub shared_reach: [f64; MAX_STOPS],
}

/// What stays put in every segment.
pub(in crate::model) type Holds<const D: usize> = [Hold<D>; MAX_SEGMENTS];

/// A force and its slope.
#[derive(Debug, Clone, Copy)]
pub(in crate::model) struct Pull<const D: usize> {
    pub force: SVector<f64, D>,
    pub slope: SMatrix<f64, D, D>,
}

impl<const D: usize> Default for Pull<D> {
    fn default() -> Self {
        Self {
            force: SVector::zeros(),
            slope: SMatrix::zeros(),
        }
    }
}

impl<const D: usize> Segment<D> {
    pub fn new(file: &StopSegment) -> Self {
        Self {
            springs: std::array::from_fn(|i| Spring::new(&file.axes[i])),
            friction: file.friction,
        }
    }

    /// What springs and stops hold against a bend; without a hold, the springs alone. `axes` are
    /// the directions of the motors, one column each.
    pub fn resistance(
        &self,
        elements: &[Element],
        axes: &SMatrix<f64, D, D>,
        hold: Option<&Hold<D>>,
        bend: &SVector<f64, D>,
    ) -> Pull<D> {
        let mut pull = self.elastic(bend);
        let Some(hold) = hold else { return pull };
        let moved = bend - hold.bend;
        let along = axes.tr_mul(&moved);
        let mut own = SVector::<f64, D>::zeros();
        let mut own_slope = SVector::<f64, D>::zeros();
        for (k, stop) in elements.iter().enumerate() {
            let (Some(at), Some(reach)) = (hold.own.get(k), hold.own_reach.get(k)) else {
                break;
            };
            for i in 0..D {
                let free = at[i] + along[i];
                own[i] += stop.own * free.clamp(-reach[i], reach[i]);
                own_slope[i] += if free.abs() < reach[i] { stop.own } else { 0.0 };
            }
            if let (Some(at), Some(reach)) = (hold.shared.get(k), hold.shared_reach.get(k)) {
                disc(stop.shared, &(at + moved), *reach, &mut pull);
            }
        }
        pull.force += axes * own;
        pull.slope += axes * SMatrix::from_diagonal(&own_slope) * axes.transpose();
        pull
    }

    /// Springs along the axes of the bend, with the ends of the joints.
    fn elastic(&self, bend: &SVector<f64, D>) -> Pull<D> {
        let mut pull = Pull::default();
        for (axis, spring) in self.springs.iter().enumerate() {
            let b = bend[axis];
            let (over, over_slope) = contact(b - spring.limit, LIMIT_SOFTNESS * spring.limit);
            let (under, under_slope) = contact(-b - spring.limit, LIMIT_SOFTNESS * spring.limit);
            let cubed = spring.stiffening * b * b;
            pull.force[axis] = (spring.stiffness + cubed) * b + LIMIT_STIFFNESS * (over - under);
            pull.slope[(axis, axis)] =
                spring.stiffness + 3.0 * cubed + LIMIT_STIFFNESS * (over_slope + under_slope);
        }
        pull
    }

    /// Bend per force of a straight segment without friction.
    pub fn compliance(&self) -> SVector<f64, D> {
        SVector::from_fn(|axis, _| 1.0 / self.springs[axis].stiffness)
    }

    /// The force that swings the segment to and fro through `drag` times its friction.
    pub fn force_of_swing(&self, friction: f64, drag: f64) -> f64 {
        let friction = self.friction * friction;
        let stiffest = self
            .springs
            .iter()
            .map(|spring| spring.stiffness)
            .fold(0.0, f64::max);
        friction + 0.5 * stiffest * drag * friction
    }

    /// How far a force swings the segment against friction, from end to end.
    pub fn swing_of_force(&self, friction: f64, force: f64) -> f64 {
        let beyond = (force - self.friction * friction).max(0.0);
        2.0 * self
            .springs
            .iter()
            .map(|spring| (beyond / spring.stiffness).min(spring.limit))
            .fold(0.0, f64::max)
    }

    /// The furthest end of a joint, and the largest force at one.
    pub fn ends(&self) -> (f64, f64) {
        let force = |s: &Spring| (s.stiffness + s.stiffening * s.limit * s.limit) * s.limit;
        let most = |of: &dyn Fn(&Spring) -> f64| self.springs.iter().map(of).fold(0.0, f64::max);
        (most(&|spring| spring.limit), most(&force))
    }
}

impl Spring {
    fn new(file: &StopAxis) -> Self {
        Self {
            stiffness: file.stiffness,
            stiffening: file.stiffening,
            limit: file.limit,
        }
    }
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
        Some((
            own,
            if length > reach {
                free * (reach / length)
            } else {
                free
            },
        ))
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
