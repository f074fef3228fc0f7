//! The balance of forces: wires against the segments, which bend one after the other by the same
//! forces.
//!
//! Both searches are Newton's method on the slope of a convex function of the bends of all
//! segments. A step takes no matrix larger than D x D: the segments hang together only through the
//! sum of their bends, so with `H_s` the slope of segment `s` and `C = sum_s 1 / H_s` the whole is
//! solved by the formula of Woodbury (1950).

use nalgebra::{SMatrix, SVector};

use super::Stops;
use super::parameters::MAX_SEGMENTS;
use super::segment::{Bends, Holds, Pull};

/// The most evaluations of one balance. In steps of the control loop it takes two to four.
const MAX_EVALUATIONS: u32 = 40;

/// A balance that is off by less than this part of the wire travel is found: far below what a count
/// moves.
const BALANCED: f64 = 1e-10;

/// A Newton step that does not help is shortened by this, at most so many times.
const SHORTENING: f64 = 0.4;
const LEAST_STEP: f64 = 0.01;

/// Bends, and what every segment holds against its own.
#[derive(Debug, Clone, Copy)]
struct Stand<const D: usize> {
    bends: Bends<D>,
    pulls: [Pull<D>; MAX_SEGMENTS],
}

/// Where the balance is, and what the wires pull there.
#[derive(Debug, Clone, Copy)]
pub(in crate::model) struct Settled<const D: usize> {
    pub bends: Bends<D>,
    /// Of the wires, per motor.
    pub force: SVector<f64, D>,
    /// How the whole bend follows the wire travel of the motors.
    pub follow: SMatrix<f64, D, D>,
}

/// Force of the wires along the axes of the bend, what it would lose with more bend, and the same
/// per motor.
struct Wires<const D: usize> {
    pull: Pull<D>,
    force: SVector<f64, D>,
    slope: SVector<f64, D>,
}

impl<const D: usize> Stops<D> {
    /// The bends at which the wires, pulled so far, balance all segments. There is one such
    /// balance, and a Newton step that is short enough always helps.
    pub(in crate::model) fn settle(
        &self,
        holds: Option<&Holds<D>>,
        travel: &SVector<f64, D>,
        start: &Bends<D>,
    ) -> Settled<D> {
        let near = BALANCED * (1.0 + travel.amax());
        let mut here = self.stand(holds, *start);
        let mut wires = self.wires(travel, &here);
        let mut evaluations = 1;
        while evaluations < MAX_EVALUATIONS && self.rest(&here, &wires.pull.force) > near {
            let Some(step) = self.towards_balance(&here, &wires.pull) else {
                break;
            };
            let before = self.rest(&here, &wires.pull.force);
            let tried = self.shorten(holds, &here, &step, &mut evaluations, |there| {
                let wires = self.wires(travel, there);
                (self.rest(there, &wires.pull.force) < before).then_some(wires)
            });
            let Some((there, there_wires)) = tried else {
                break;
            };
            (here, wires) = (there, there_wires);
        }
        let follow = self
            .compliance(&here)
            .map_or_else(SMatrix::zeros, |compliance| {
                let yielding = (SMatrix::identity() + compliance * wires.pull.slope).try_inverse();
                yielding.unwrap_or_else(SMatrix::zeros)
                    * compliance
                    * self.axes
                    * SMatrix::from_diagonal(&wires.slope)
            });
        Settled {
            bends: here.bends,
            force: wires.force,
            follow,
        }
    }

    /// The force along the axes that holds a whole bend, with stops as they are held; without a
    /// hold, against the springs alone. One segment has the whole bend; of several, each takes as
    /// much as that force gives it.
    pub(in crate::model) fn holding(
        &self,
        holds: Option<&Holds<D>>,
        bend: &SVector<f64, D>,
    ) -> SVector<f64, D> {
        let mut bends = holds.map_or([SVector::zeros(); MAX_SEGMENTS], |holds| {
            holds.each_ref().map(|hold| hold.bend)
        });
        if self.segments.len() == 1 {
            bends[0] = *bend;
            return self.stand(holds, bends).pulls[0].force;
        }
        let near = BALANCED * (1.0 + bend.amax());
        let mut here = self.stand(holds, bends);
        let mut evaluations = 1;
        // The first step closes the gap between the bend and the sum; all others keep it closed.
        let mut first = true;
        while evaluations < MAX_EVALUATIONS && (first || self.apart(&here) > near) {
            let Some(step) = self.towards_agreement(&here, bend) else {
                break;
            };
            let before = if first {
                f64::INFINITY
            } else {
                self.apart(&here)
            };
            let tried = self.shorten(holds, &here, &step, &mut evaluations, |there| {
                (self.apart(there) < before).then_some(())
            });
            let Some((there, ())) = tried else { break };
            here = there;
            first = false;
        }
        self.mean_force(&here)
    }

    fn stand(&self, holds: Option<&Holds<D>>, bends: Bends<D>) -> Stand<D> {
        let mut pulls = [Pull::default(); MAX_SEGMENTS];
        for (s, (segment, pull)) in self.segments.iter().zip(&mut pulls).enumerate() {
            *pull = segment.resistance(
                &self.elements,
                &self.axes,
                holds.and_then(|holds| holds.get(s)),
                &bends[s],
            );
        }
        Stand { bends, pulls }
    }

    fn wires(&self, travel: &SVector<f64, D>, stand: &Stand<D>) -> Wires<D> {
        let stretch = travel
            - self
                .axes
                .tr_mul(&stand.bends.iter().sum::<SVector<f64, D>>());
        let (mut force, mut slope) = (SVector::<f64, D>::zeros(), SVector::<f64, D>::zeros());
        for (i, motor) in self.motors.iter().enumerate() {
            (force[i], slope[i]) = motor.wire.pull(stretch[i]);
        }
        let along = self.axes * SMatrix::from_diagonal(&slope) * self.axes.transpose();
        Wires {
            pull: Pull {
                force: self.axes * force,
                slope: along,
            },
            force,
            slope,
        }
    }

    fn pulls<'a>(&self, stand: &'a Stand<D>) -> impl Iterator<Item = &'a Pull<D>> + use<'a, D> {
        stand.pulls.iter().take(self.segments.len())
    }

    /// How far all segments are from holding a force.
    fn rest(&self, stand: &Stand<D>, force: &SVector<f64, D>) -> f64 {
        self.pulls(stand)
            .map(|pull| (pull.force - force).norm_squared())
            .sum::<f64>()
            .sqrt()
    }

    fn mean_force(&self, stand: &Stand<D>) -> SVector<f64, D> {
        self.pulls(stand)
            .map(|pull| pull.force)
            .sum::<SVector<f64, D>>()
            / self.segments.len() as f64
    }

    /// How far the segments are from holding the same force.
    fn apart(&self, stand: &Stand<D>) -> f64 {
        self.rest(stand, &self.mean_force(stand))
    }

    /// Bend of all segments per force.
    fn compliance(&self, stand: &Stand<D>) -> Option<SMatrix<f64, D, D>> {
        self.pulls(stand).map(|pull| pull.slope.try_inverse()).sum()
    }

    /// The Newton step of all segments towards what the wires pull.
    fn towards_balance(&self, stand: &Stand<D>, wires: &Pull<D>) -> Option<Bends<D>> {
        let coupled =
            (SMatrix::identity() + self.compliance(stand)? * wires.slope).try_inverse()?;
        let alone = self.each(stand, |pull| wires.force - pull.force)?;
        let whole = coupled * alone.iter().sum::<SVector<f64, D>>();
        self.each(stand, |pull| wires.force - pull.force - wires.slope * whole)
    }

    /// The Newton step of all segments towards one force, whose sum closes the gap to the whole
    /// bend.
    fn towards_agreement(&self, stand: &Stand<D>, bend: &SVector<f64, D>) -> Option<Bends<D>> {
        let gap = bend - stand.bends.iter().sum::<SVector<f64, D>>();
        let alone = self.each(stand, |pull| pull.force)?;
        let force =
            self.compliance(stand)?.try_inverse()? * (gap + alone.iter().sum::<SVector<f64, D>>());
        self.each(stand, |pull| force - pull.force)
    }

    /// What a force on every segment moves it.
    fn each(
        &self,
        stand: &Stand<D>,
        force: impl Fn(&Pull<D>) -> SVector<f64, D>,
    ) -> Option<Bends<D>> {
        let mut bends = [SVector::zeros(); MAX_SEGMENTS];
        for (bend, pull) in bends.iter_mut().zip(self.pulls(stand)) {
            *bend = pull.slope.try_inverse()? * force(pull);
        }
        Some(bends)
    }

    /// The longest part of a step that is accepted, and what accepted it.
    fn shorten<T>(
        &self,
        holds: Option<&Holds<D>>,
        from: &Stand<D>,
        step: &Bends<D>,
        evaluations: &mut u32,
        accept: impl Fn(&Stand<D>) -> Option<T>,
    ) -> Option<(Stand<D>, T)> {
        let mut share = 1.0;
        loop {
            let mut bends = from.bends;
            bends
                .iter_mut()
                .zip(step)
                .for_each(|(bend, step)| *bend += step * share);
            let there = self.stand(holds, bends);
            *evaluations += 1;
            if let Some(accepted) = accept(&there) {
                return Some((there, accepted));
            }
            if *evaluations >= MAX_EVALUATIONS || share < LEAST_STEP {
                return None;
            }
            share *= SHORTENING;
        }
    }
}
