//! Virtual fixtures: the goal never enters a forbidden region, and slows down before it.
//!
//! The rule is the velocity damper (B. Faverjon and P. Tournassoud 1987): the distance `d` to a
//! region falls by at most `d / T` per second, with the time `T` of [`SLOW_DOWN`]. The goal comes
//! to rest at the border, and glides along it. A goal that is inside when a region is switched on
//! can move, but not deeper.
//!
//! Several regions at once: the step of a tick is projected on the rule of every region in turn,
//! and clamped to the joint limits; the result is then checked with the distances at the new goal.
//! A step that fails the check is halved until it passes; at last the goal stays where it is. So
//! the guarantee does not depend on the projection, and it also holds for the tip, whose motion is
//! not linear in the angles.
//!
//! The distance to a region is the smaller one of the pose as adapted and the pose as calibrated: a
//! camera that misleads the adaptation opens no region.
//!
//! The time per tick is bounded: a pose takes one computation of the tip for all regions, and there
//! are at most `2 + HALVINGS` poses, each of them once more as calibrated.

mod region;

use serde::{Deserialize, Serialize};

use crate::config::{FixtureRegionConfig, MAX_REGIONS};
use crate::core::drift::CalibratedView;
use crate::core::events::fold::EventFold;
use crate::core::inputs::FixtureChange;
use crate::core::motion::GoalStep;
use crate::core::motion::joint_limits::JointBounds;
use crate::core::vector;
use crate::model::file::OutputUnit;
use crate::robot::Refusal;
use crate::units::{Nanos, OutputVec};
pub(crate) use region::Region;
use region::{Distances, PoseDistance, dot};

/// Rounds of projections. Two regions need two or three.
const ROUNDS: usize = 4;
/// Near a region, the speed towards it is at most the distance divided by this time. Speed along
/// the region and away from it is not limited.
const SLOW_DOWN: Nanos = Nanos::from_millis(200);
/// Halvings of a step before the goal stays where it is.
const HALVINGS: usize = 3;
/// Longest step of the goal per tick while regions count: farther than any motor moves. On such a
/// step the path of the tip bends by less than a micrometre.
const MAX_STEP_RAD: f64 = 0.01;
const MAX_STEP_M: f64 = 1e-4;
/// Rounding may not make a step at a limit a longer one.
const ROUNDING: f64 = 1.0 + 1e-9;
/// Part of the margin that setpoints may use before their motors stop. The rest is for braking.
const BRAKING_SHARE: f64 = 0.6;
/// Points on the line of `move_jp` that are looked at.
const LINE_POINTS: u32 = 32;

/// The regions and the goal of the last tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct VirtualFixtures {
    regions: [Option<Region>; MAX_REGIONS],
    /// The first ones come from the configuration.
    configured: u8,
    is_on: bool,
    /// Largest part of a distance that the goal crosses per tick.
    fall: f64,
    /// The goal of the last tick, while goals in joint space are followed.
    last: Option<OutputVec>,
    step: OutputVec,
    /// The goal was limited in this tick, by the region with this index.
    pub limited_by: Option<u8>,
    limits: EventFold,
}

/// Limits of a goal besides the regions, and its interpretation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GoalSpace<'a> {
    pub unit: OutputUnit,
    /// `None`: as calibrated, or the outputs are not angles.
    pub view: Option<CalibratedView>,
    /// `None`: off.
    pub bounds: Option<&'a JointBounds>,
}

impl VirtualFixtures {
    pub(crate) fn new(configured: &[FixtureRegionConfig], tick: Nanos) -> Self {
        let mut regions = [None; MAX_REGIONS];
        for (to, from) in regions.iter_mut().zip(configured) {
            *to = Some(Region::new(&from.shape));
        }
        Self {
            regions,
            configured: configured.len().min(MAX_REGIONS) as u8,
            is_on: true,
            fall: (tick.as_seconds() / SLOW_DOWN.as_seconds()).min(1.0),
            last: None,
            step: OutputVec::default(),
            limited_by: None,
            limits: EventFold::default(),
        }
    }

    /// Some region counts.
    pub(crate) fn is_on(&self) -> bool {
        self.is_on && self.regions.iter().any(Option::is_some)
    }

    /// The region that begins to limit the goal in this tick; folded to one per second. Call it
    /// once per tick.
    pub(crate) fn begun_limit(&mut self, now: Nanos) -> Option<u8> {
        let is_new = self.limits.update(self.limited_by.is_some(), now);
        self.limited_by.filter(|_| is_new)
    }

    /// The regions that count, as bits.
    pub(crate) fn active_bits(&self) -> u32 {
        let set = self.regions.iter().enumerate();
        let bits = set.filter(|(_, region)| self.is_on && region.is_some());
        bits.fold(0, |bits, (index, _)| bits | 1 << index)
    }

    /// Carries out a request. [`Refusal::Range`] when there is no place for one more region.
    pub(crate) fn change(&mut self, change: &FixtureChange) -> Result<(), Refusal> {
        match change {
            FixtureChange::SwitchOn => self.is_on = true,
            FixtureChange::SwitchOff => self.is_on = false,
            FixtureChange::Add(simple) => {
                let free = self.regions.iter_mut().find(|region| region.is_none());
                *free.ok_or(Refusal::Range)? = Some(Region::grown(simple));
                self.is_on = true;
            }
            FixtureChange::RemoveAdded => {
                for region in self.regions.iter_mut().skip(usize::from(self.configured)) {
                    *region = None;
                }
            }
        }
        Ok(())
    }

    /// No goal in joint space is followed in this tick.
    pub(crate) fn release_goal(&mut self) {
        (self.last, self.step) = (None, OutputVec::default());
        self.limited_by = None;
    }

    /// Limits the goal of this tick. `start`: where the goal begins after a pause.
    pub(crate) fn limit(
        &mut self,
        goal: GoalStep,
        start: OutputVec,
        space: &GoalSpace<'_>,
    ) -> GoalStep {
        let was_limited = self.limited_by.take().is_some();
        if !self.is_on() {
            (self.last, self.step) = (None, OutputVec::default());
            return goal;
        }
        let last = self.last.unwrap_or(start);
        let now = self.limited(&last, &goal.now, space);
        self.step = vector::difference(&now, &last);
        self.last = Some(now);
        // After a limit, the goal of one tick before is not where this goal came from.
        if now == goal.now && !was_limited {
            return goal;
        }
        GoalStep { now, before: last }
    }

    /// Setpoints may be at poses, adapted and calibrated: not nearer to a region than a part of the
    /// margin, or not nearer than other poses, computed only if needed. Otherwise records the
    /// region.
    pub(crate) fn allow_setpoint<E>(
        &mut self,
        poses: &[OutputVec],
        unit: OutputUnit,
        others: impl FnOnce() -> Result<[OutputVec; 2], E>,
    ) -> Result<bool, E> {
        let regions = self.regions;
        let border = |index: u8| {
            let region = regions.get(usize::from(index)).and_then(Option::as_ref);
            region.map_or(0.0, |region| -BRAKING_SHARE * region::margin(region.space))
        };
        let distances =
            |poses: &[OutputVec], at: usize| poses.get(at).map(|pose| self.distances(pose, unit));
        let now = [distances(poses, 0), distances(poses, 1)];
        let is_clear = |at: &PoseDistance| at.distance >= border(at.region);
        if now.iter().flatten().all(|now| now.iter().all(is_clear)) {
            return Ok(true);
        }
        let others = others()?;
        let least = |before: &PoseDistance| before.distance.min(border(before.region));
        let entered = (0..).zip(&now).find_map(|(at, now)| {
            let before = distances(&others, at)?;
            now.as_ref()?.first_below(&before, least)
        });
        self.limited_by = entered.or(self.limited_by);
        Ok(entered.is_none())
    }

    /// A straight line from one goal to another meets no region, apart from one that it leaves. On
    /// [`LINE_POINTS`] points: what lies between them is left to [`VirtualFixtures::limit`].
    pub(crate) fn allows_line(
        &self,
        from: &OutputVec,
        to: &OutputVec,
        space: &GoalSpace<'_>,
    ) -> bool {
        if !self.is_on() {
            return true;
        }
        let mut before: Option<Distances> = None;
        (0..=LINE_POINTS).all(|k| {
            let at = vector::interpolate(from, to, f64::from(k) / f64::from(LINE_POINTS));
            let now = self.seen(&at, space);
            let last = before.replace(now).unwrap_or(now);
            now.first_below(&last, |before| before.distance.min(0.0)).is_none()
        })
    }

    fn distances(&self, pose: &OutputVec, unit: OutputUnit) -> Distances {
        Distances::new(&self.regions, pose, None, unit)
    }

    fn seen(&self, goal: &OutputVec, space: &GoalSpace<'_>) -> Distances {
        Distances::new(&self.regions, goal, space.view.as_ref(), space.unit)
    }

    fn limited(&mut self, last: &OutputVec, goal: &OutputVec, space: &GoalSpace<'_>) -> OutputVec {
        let near = self.seen(last, space);
        let whole = vector::difference(goal, last);
        let projected = self.projected(whole, last, &near, space);
        // One region after the other, the rules can lead along a wedge and away from the goal, and
        // further in every tick. The nearest step that keeps all of them never does.
        let left = vector::difference(&whole, &projected);
        let leads_away = dot(&left, &left) > dot(&whole, &whole);
        let projected = if leads_away { OutputVec::default() } else { projected };
        let mut step = self.shortened(projected, space);
        if step == whole && self.first_entered(&near, last, &step, space).is_none() {
            return *goal;
        }
        for _ in 0..=HALVINGS {
            match self.first_entered(&near, last, &step, space) {
                None => return vector::zip_map(last, &step, |last, step| last + step),
                Some(index) => self.limited_by = Some(index),
            }
            step = step.map(|value| 0.5 * value);
        }
        *last
    }

    /// The step that keeps to the rule of every region and to the joint limits, taken to be planes.
    fn projected(
        &mut self,
        mut step: OutputVec,
        last: &OutputVec,
        near: &Distances,
        space: &GoalSpace<'_>,
    ) -> OutputVec {
        for _ in 0..ROUNDS {
            let mut is_changed = false;
            for at in near.iter() {
                let lowest = -self.fall * at.distance.max(0.0);
                let towards = dot(&at.slope, &step);
                let squared = dot(&at.slope, &at.slope);
                if towards < lowest && squared > 0.0 {
                    let push = (lowest - towards) / squared;
                    step = vector::zip_map(&step, &at.slope, |step, slope| step + push * slope);
                    self.limited_by = Some(at.region);
                    is_changed = true;
                }
            }
            if !is_changed {
                break;
            }
            if let Some(bounds) = space.bounds {
                let next = vector::zip_map(last, &step, |last, step| last + step);
                step = vector::difference(&bounds.clamp(&next), last);
            }
        }
        step
    }

    /// The same direction, no faster than joint limits and motors.
    fn shortened(&self, step: OutputVec, space: &GoalSpace<'_>) -> OutputVec {
        let longest = match space.unit {
            OutputUnit::Deg => MAX_STEP_RAD,
            OutputUnit::Mm => MAX_STEP_M,
        };
        let mut share = longest / dot(&step, &step).sqrt();
        if let Some(bounds) = space.bounds {
            let largest = bounds.largest_goal_step(&step, &self.step, ROUNDING);
            for (largest, step) in largest.iter().zip(&step) {
                share = share.min(largest / step.abs());
            }
        }
        if share < 1.0 { step.map(|value| share * value) } else { step }
    }

    /// The first region that a step enters, crosses, or enters deeper. Comparisons are written so
    /// that a distance that is not a number counts as entered.
    fn first_entered(
        &self,
        near: &Distances,
        last: &OutputVec,
        step: &OutputVec,
        space: &GoalSpace<'_>,
    ) -> Option<u8> {
        // In the coordinates of the region, no step that keeps to this rule meets the set.
        let is_beside = |at: &PoseDistance| dot(&at.slope, step) >= -at.distance.max(0.0);
        let met = near.iter().find(|at| !is_beside(at)).map(|at| at.region);
        met.or_else(|| {
            let next = vector::zip_map(last, step, |last, step| last + step);
            self.seen(&next, space).first_below(near, |before| before.distance.min(0.0))
        })
    }
}

#[cfg(test)]
mod tests;
