//! The balance of forces between the wires and the segments. The same force bends every segment.
//!
//! Both searches apply Newton's method to the slope of a convex function of the bends of all
//! segments. No step needs a matrix larger than D x D, because the segments are coupled only by the
//! sum of their bends. With the slope `H_s` of segment `s` and `C = sum_s 1 / H_s`, the formula of
//! Woodbury (1950) solves the whole system.

use nalgebra::{SMatrix, SVector};

use super::Stops;
use super::parameters::MAX_SEGMENTS;
use super::segment::{Bends, Reactions, WireForce};
use super::wire::Wire;

/// The most evaluations of one search. A step of the control loop takes two to four.
const MAX_EVALUATIONS: u32 = 40;

/// Tolerance of a balance relative to the wire travel: far below the effect of one count.
const BALANCE_TOLERANCE: f64 = 1e-10;

/// Line search: a Newton step that does not improve the residual is scaled by this factor, down to
/// the least share.
const STEP_REDUCTION: f64 = 0.4;
const LEAST_STEP_SHARE: f64 = 0.01;

/// The bends of all segments, and the force of each segment at its bend.
#[derive(Debug, Clone, Copy)]
struct OperatingPoint<const D: usize> {
    bends: Bends<D>,
    forces: [WireForce<D>; MAX_SEGMENTS],
}

impl<const D: usize> OperatingPoint<D> {
    /// Some bends, whose forces are not known yet.
    fn at(bends: &Bends<D>) -> Self {
        Self { bends: *bends, forces: [WireForce::default(); MAX_SEGMENTS] }
    }
}

/// The solution of a balance, and the wire forces there.
#[derive(Debug, Clone, Copy)]
pub(in crate::model) struct Equilibrium<const D: usize> {
    pub bends: Bends<D>,
    /// Force of the wires, per motor.
    pub force: SVector<f64, D>,
}

/// Force of the wires at a bend.
struct Wires<const D: usize> {
    /// Along the axes of the bend; the slope is the loss of force per bend.
    along_axes: WireForce<D>,
    /// Force and its slope per stretch, per motor.
    force: SVector<f64, D>,
    slope: SVector<f64, D>,
}

impl<const D: usize> Stops<D> {
    /// The bends at which the wires, at the given wire travel, balance all segments. `pairs` are
    /// the two wires of every motor. The balance is unique, and a short enough Newton step always
    /// reduces the residual.
    pub(in crate::model) fn find_equilibrium(
        &self,
        pairs: &[Wire; D],
        reactions: Option<&Reactions<'_, D>>,
        travel: &SVector<f64, D>,
        start: &Bends<D>,
    ) -> Equilibrium<D> {
        let (point, wires) = self.balance(pairs, reactions, travel, start);
        Equilibrium { bends: point.bends, force: wires.force }
    }

    /// As [`Stops::find_equilibrium`]; the total bend, and its derivative with respect to the wire
    /// travel of the motors.
    pub(in crate::model) fn bend_and_slope(
        &self,
        pairs: &[Wire; D],
        reactions: &Reactions<'_, D>,
        travel: &SVector<f64, D>,
        start: &Bends<D>,
    ) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
        let (point, wires) = self.balance(pairs, Some(reactions), travel, start);
        let slope = self.compliances(&point).map_or_else(SMatrix::zeros, |(_, compliance)| {
            let wire_yield =
                (SMatrix::identity() + compliance * wires.along_axes.slope).try_inverse();
            wire_yield.unwrap_or_else(SMatrix::zeros)
                * compliance
                * self.axes
                * SMatrix::from_diagonal(&wires.slope)
        });
        (point.bends.iter().sum(), slope)
    }

    fn balance(
        &self,
        pairs: &[Wire; D],
        reactions: Option<&Reactions<'_, D>>,
        travel: &SVector<f64, D>,
        start: &Bends<D>,
    ) -> (OperatingPoint<D>, Wires<D>) {
        let tolerance = BALANCE_TOLERANCE * (1.0 + travel.amax());
        let mut current = OperatingPoint::at(start);
        self.find_forces(reactions, &mut current);
        let mut wires = self.wires(pairs, travel, &current);
        let mut residual = self.residual_norm(&current, &wires.along_axes.force);
        let mut evaluations = 1;
        while evaluations < MAX_EVALUATIONS && residual > tolerance {
            let Some(step) = self.balance_step(&current, &wires.along_axes) else {
                break;
            };
            let accept = |next: &OperatingPoint<D>| {
                let wires = self.wires(pairs, travel, next);
                let reached = self.residual_norm(next, &wires.along_axes.force);
                (reached < residual).then_some((wires, reached))
            };
            let trial = self.shorten_step(reactions, &mut current, &step, &mut evaluations, accept);
            let Some(accepted) = trial else {
                break;
            };
            (wires, residual) = accepted;
        }
        (current, wires)
    }

    /// The force along the axes that holds a total bend against springs and stops; without
    /// reactions, against the springs alone. A single segment takes the total bend. Of several
    /// segments, each takes the bend that the common force gives it.
    pub(in crate::model) fn holding_force(
        &self,
        reactions: Option<&Reactions<'_, D>>,
        bend: &SVector<f64, D>,
    ) -> SVector<f64, D> {
        let mut bends = reactions.map_or([SVector::zeros(); MAX_SEGMENTS], |reactions| {
            reactions.each_ref().map(|reaction| reaction.bend)
        });
        if self.segments.len() == 1 {
            bends[0] = *bend;
        }
        let mut current = OperatingPoint::at(&bends);
        self.find_forces(reactions, &mut current);
        if self.segments.len() == 1 {
            return current.forces[0].force;
        }
        let tolerance = BALANCE_TOLERANCE * (1.0 + bend.amax());
        let mut evaluations = 1;
        // The first step makes the sum of the bends equal to the total bend. All later steps keep
        // it.
        let mut mismatch = f64::INFINITY;
        while evaluations < MAX_EVALUATIONS && mismatch > tolerance {
            let Some(step) = self.common_force_step(&current, bend) else {
                break;
            };
            let accept = |next: &OperatingPoint<D>| {
                let reached = self.force_mismatch(next);
                (reached < mismatch).then_some(reached)
            };
            let trial = self.shorten_step(reactions, &mut current, &step, &mut evaluations, accept);
            let Some(accepted) = trial else { break };
            mismatch = accepted;
        }
        self.mean_force(&current)
    }

    /// The forces of all segments at the bends of a point.
    fn find_forces(&self, reactions: Option<&Reactions<'_, D>>, point: &mut OperatingPoint<D>) {
        let at = self.segments.iter().zip(&point.bends);
        for (s, ((segment, bend), force)) in at.zip(&mut point.forces).enumerate() {
            *force = segment.resistance(
                &self.elements,
                &self.axes,
                reactions.and_then(|reactions| reactions.get(s)),
                bend,
            );
        }
    }

    fn wires(
        &self,
        pairs: &[Wire; D],
        travel: &SVector<f64, D>,
        point: &OperatingPoint<D>,
    ) -> Wires<D> {
        let stretch = travel - self.axes.tr_mul(&point.bends.iter().sum::<SVector<f64, D>>());
        let (mut force, mut slope) = (SVector::<f64, D>::zeros(), SVector::<f64, D>::zeros());
        for (i, pair) in pairs.iter().enumerate() {
            (force[i], slope[i]) = pair.force(stretch[i]);
        }
        let along = self.axes * SMatrix::from_diagonal(&slope) * self.axes.transpose();
        Wires { along_axes: WireForce { force: self.axes * force, slope: along }, force, slope }
    }

    fn forces<'a>(
        &self,
        point: &'a OperatingPoint<D>,
    ) -> impl Iterator<Item = &'a WireForce<D>> + use<'a, D> {
        point.forces.iter().take(self.segments.len())
    }

    /// Norm of the differences between the segment forces and a common force.
    fn residual_norm(&self, point: &OperatingPoint<D>, force: &SVector<f64, D>) -> f64 {
        self.forces(point)
            .map(|segment_force| (segment_force.force - force).norm_squared())
            .sum::<f64>()
            .sqrt()
    }

    fn mean_force(&self, point: &OperatingPoint<D>) -> SVector<f64, D> {
        self.forces(point).map(|segment_force| segment_force.force).sum::<SVector<f64, D>>()
            / self.segments.len() as f64
    }

    /// Norm of the differences between the segment forces and their mean.
    fn force_mismatch(&self, point: &OperatingPoint<D>) -> f64 {
        self.residual_norm(point, &self.mean_force(point))
    }

    /// Bend per force of every segment, and of all. Unused entries are 0.
    fn compliances(
        &self,
        point: &OperatingPoint<D>,
    ) -> Option<([SMatrix<f64, D, D>; MAX_SEGMENTS], SMatrix<f64, D, D>)> {
        let mut each = [SMatrix::zeros(); MAX_SEGMENTS];
        let mut total = SMatrix::zeros();
        for (compliance, segment_force) in each.iter_mut().zip(self.forces(point)) {
            *compliance = segment_force.slope.try_inverse()?;
            total += *compliance;
        }
        Some((each, total))
    }

    /// The Newton step of all segments towards a balance with the wires.
    fn balance_step(&self, point: &OperatingPoint<D>, wires: &WireForce<D>) -> Option<Bends<D>> {
        let (each, total) = self.compliances(point)?;
        let coupling = (SMatrix::identity() + total * wires.slope).try_inverse()?;
        let mut bends = [SVector::zeros(); MAX_SEGMENTS];
        let entries = bends.iter_mut().zip(&each).zip(self.forces(point));
        for ((bend, compliance), segment_force) in entries {
            *bend = compliance * (wires.force - segment_force.force);
        }
        let total_change = coupling * bends.iter().sum::<SVector<f64, D>>();
        let common = wires.slope * total_change;
        for (bend, compliance) in bends.iter_mut().zip(&each) {
            *bend -= compliance * common;
        }
        Some(bends)
    }

    /// The Newton step of all segments towards a common force. After it the bends sum to the total
    /// bend.
    fn common_force_step(
        &self,
        point: &OperatingPoint<D>,
        bend: &SVector<f64, D>,
    ) -> Option<Bends<D>> {
        let (each, total) = self.compliances(point)?;
        let bend_error = bend - point.bends.iter().sum::<SVector<f64, D>>();
        let mut bends = [SVector::zeros(); MAX_SEGMENTS];
        let entries = bends.iter_mut().zip(&each).zip(self.forces(point));
        for ((bend, compliance), segment_force) in entries {
            *bend = compliance * segment_force.force;
        }
        let uncoupled = bends.iter().sum::<SVector<f64, D>>();
        let force = total.try_inverse()? * (bend_error + uncoupled);
        for (bend, compliance) in bends.iter_mut().zip(&each) {
            *bend = compliance * force - *bend;
        }
        Some(bends)
    }

    /// Moves a point by a step that is shortened until `accept` returns a value, which is returned.
    /// If no step is accepted, the point stays.
    fn shorten_step<T>(
        &self,
        reactions: Option<&Reactions<'_, D>>,
        point: &mut OperatingPoint<D>,
        step: &Bends<D>,
        evaluations: &mut u32,
        accept: impl Fn(&OperatingPoint<D>) -> Option<T>,
    ) -> Option<T> {
        let mut share = 1.0;
        let mut next = OperatingPoint::at(&point.bends);
        loop {
            for ((next, from), step) in next.bends.iter_mut().zip(&point.bends).zip(step) {
                *next = from + step * share;
            }
            self.find_forces(reactions, &mut next);
            *evaluations += 1;
            if let Some(accepted) = accept(&next) {
                *point = next;
                return Some(accepted);
            }
            if *evaluations >= MAX_EVALUATIONS || share < LEAST_STEP_SHARE {
                return None;
            }
            share *= STEP_REDUCTION;
        }
    }
}
