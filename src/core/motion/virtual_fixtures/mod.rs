//! Virtual fixtures: the goal never enters a forbidden region, and slows down before it.
//!
//! The rule is the velocity damper (B. Faverjon and P. Tournassoud 1987): the distance `d` to a
//! region falls by at most `d / T` per second, with the time `T` of `slow_down_ms`. The goal comes
//! to rest at the border, and glides along it. A goal that is inside when a region is switched on
//! can move, but not deeper.
//!
//! Several regions at once: the step of a tick is projected on the rule of every region in turn,
//! and the result is then checked with the distances at the new goal. A step that fails the check
//! is halved until it passes; at last the goal stays where it is. So the guarantee does not depend
//! on the projection, and it also holds for the tip, whose motion is not linear in the angles.

mod region;

use serde::{Deserialize, Serialize};

use crate::config::{MAX_REGIONS, VirtualFixtureConfig};
use crate::core::events::fold::EventFold;
use crate::core::motion::joint_filter::GoalStep;
use crate::core::vector;
use crate::model::file::OutputUnit;
use crate::model::kinematic;
use crate::robot::Refusal;
use crate::units::{Nanos, OutputVec};

pub use region::{FixtureSpace, SimpleRegion, SimpleShape};
pub(crate) use region::{Margins, Point, Region};

use region::dot;

/// Rounds of projections. Two regions need two or three.
const ROUNDS: usize = 4;
/// Halvings of a step before the goal stays where it is.
const HALVINGS: usize = 12;
/// Longest step of the goal per tick while regions count: farther than any motor moves.
const LONGEST_STEP_RAD: f64 = 0.035;
const LONGEST_STEP_M: f64 = 1e-4;
/// Part of the margin that setpoints may use before their motors stop. The rest is for braking.
const BRAKING_SHARE: f64 = 0.6;
/// Points on the line of `move_jp` that are looked at.
const LINE_POINTS: u32 = 32;

/// A change of the fixtures by request.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum FixtureChange {
    /// All regions count.
    SwitchOn,
    /// No region counts.
    SwitchOff,
    /// One more region, and all regions count.
    Add(SimpleRegion),
    /// Removes the regions that requests have added.
    RemoveAdded,
}

/// The regions and the goal of the last tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct VirtualFixtures {
    regions: [Option<Region>; MAX_REGIONS],
    /// The first ones come from the configuration.
    configured: u8,
    is_on: bool,
    margins: Margins,
    /// Largest part of a distance that the goal crosses per tick.
    fall: f64,
    /// The goal of the last tick, while goals in joint space are followed.
    last: Option<OutputVec>,
    /// The goal was limited in this tick, by the region with this index.
    limited_by: Option<u8>,
    limits: EventFold,
}

/// The distance of a goal to a region, with the slope in output space.
#[derive(Debug, Clone, Copy)]
struct GoalDistance {
    distance: f64,
    slope: OutputVec,
}

impl VirtualFixtures {
    pub fn new(config: &VirtualFixtureConfig, tick: Nanos) -> Self {
        let mut regions = [None; MAX_REGIONS];
        for (to, from) in regions.iter_mut().zip(&config.regions) {
            *to = Some(Region::new(&from.shape, config));
        }
        let slow_down = Nanos::from_millis(config.slow_down_ms.max(1));
        Self {
            regions,
            configured: config.regions.len().min(MAX_REGIONS) as u8,
            is_on: true,
            margins: Margins::new(config),
            fall: (tick.as_seconds() / slow_down.as_seconds()).min(1.0),
            last: None,
            limited_by: None,
            limits: EventFold::default(),
        }
    }

    /// Some region counts.
    pub fn is_on(&self) -> bool {
        self.is_on && self.regions.iter().any(Option::is_some)
    }

    /// The region that limited the goal in this tick.
    pub fn limited_by(&self) -> Option<u8> {
        self.limited_by
    }

    /// The region that begins to limit the goal in this tick; folded to one per second. Call it
    /// once per tick.
    pub fn begun_limit(&mut self, now: Nanos) -> Option<u8> {
        let is_new = self.limits.update(self.limited_by.is_some(), now);
        self.limited_by.filter(|_| is_new)
    }

    /// The regions that count, as bits.
    pub fn active_bits(&self) -> u32 {
        let set = self.regions.iter().enumerate();
        let bits = set.filter(|(_, region)| self.is_on && region.is_some());
        bits.fold(0, |bits, (index, _)| bits | 1 << index)
    }

    /// Carries out a request.
    ///
    /// # Errors
    ///
    /// [`Refusal::Range`] when there is no place for one more region.
    pub fn change(&mut self, change: &FixtureChange) -> Result<(), Refusal> {
        match change {
            FixtureChange::SwitchOn => self.is_on = true,
            FixtureChange::SwitchOff => self.is_on = false,
            FixtureChange::Add(simple) => {
                let free = self.regions.iter_mut().find(|region| region.is_none());
                *free.ok_or(Refusal::Range)? = Some(Region::grown(simple, &self.margins));
                self.is_on = true;
            }
            FixtureChange::RemoveAdded => {
                let added = self.regions.iter_mut().skip(usize::from(self.configured));
                for region in added {
                    *region = None;
                }
            }
        }
        Ok(())
    }

    /// No goal in joint space is followed in this tick.
    pub fn release_goal(&mut self) {
        self.last = None;
        self.limited_by = None;
    }

    /// Limits the goal of this tick. `start`: where the goal begins after a pause.
    pub fn limit(&mut self, goal: GoalStep, start: OutputVec, unit: OutputUnit) -> GoalStep {
        let was_limited = self.limited_by.take().is_some();
        if !self.is_on() {
            self.last = None;
            return goal;
        }
        let last = self.last.unwrap_or(start);
        let now = self.limited(&last, &goal.now, unit);
        self.last = Some(now);
        // After a limit, the goal of one tick before is not where this goal came from.
        if now == goal.now && !was_limited {
            return goal;
        }
        GoalStep { now, before: last }
    }

    /// Setpoints may move from one pose to another: not nearer to a region than a part of the
    /// margin, or not deeper. Notes the region otherwise.
    pub fn allows_setpoint(&mut self, from: &OutputVec, to: &OutputVec, unit: OutputUnit) -> bool {
        let entered = self.regions.iter().position(|region| {
            let Some(region) = region else { return false };
            let border = -BRAKING_SHARE * self.margins.of(region.space);
            let distance = |pose| goal_distance(region, pose, unit).map(|at| at.distance);
            let (before, now) = (distance(from), distance(to));
            !before.zip(now).is_some_and(|(before, now)| now >= before.min(border))
        });
        if let Some(index) = entered {
            self.limited_by = Some(index as u8);
        }
        entered.is_none()
    }

    /// A straight line from one goal to another meets no region, apart from one that it leaves. On
    /// [`LINE_POINTS`] points: what lies between them is left to [`VirtualFixtures::limit`].
    pub fn allows_line(&self, from: &OutputVec, to: &OutputVec, unit: OutputUnit) -> bool {
        let mut regions = self.regions.iter().flatten().filter(|_| self.is_on);
        regions.all(|region| {
            let mut before = f64::NEG_INFINITY;
            (0..=LINE_POINTS).all(|k| {
                let at = vector::interpolate(from, to, f64::from(k) / f64::from(LINE_POINTS));
                let now = goal_distance(region, &at, unit).map(|at| at.distance);
                let is_allowed = now.is_some_and(|now| now >= before.min(0.0));
                before = now.unwrap_or(before);
                is_allowed
            })
        })
    }

    fn limited(&mut self, last: &OutputVec, goal: &OutputVec, unit: OutputUnit) -> OutputVec {
        let mut step = vector::difference(goal, last);
        for _ in 0..ROUNDS {
            let mut is_changed = false;
            for (index, region) in self.regions.iter().enumerate() {
                let Some(region) = region else { continue };
                let Some(at) = goal_distance(region, last, unit) else {
                    return self.held(index, last);
                };
                let lowest = -self.fall * at.distance.max(0.0);
                let towards = dot(&at.slope, &step);
                let squared = dot(&at.slope, &at.slope);
                if towards < lowest && squared > 0.0 {
                    let push = (lowest - towards) / squared;
                    step = vector::zip_map(&step, &at.slope, |step, slope| step + push * slope);
                    self.limited_by = Some(index as u8);
                    is_changed = true;
                }
            }
            if !is_changed {
                break;
            }
        }
        let length = dot(&step, &step).sqrt();
        let longest = match unit {
            OutputUnit::Deg => LONGEST_STEP_RAD,
            OutputUnit::Mm => LONGEST_STEP_M,
        };
        if length > longest {
            step = step.map(|value| value * longest / length);
        } else if self.limited_by.is_none() && self.first_entered(last, &step, unit).is_none() {
            return *goal;
        }
        for _ in 0..HALVINGS {
            match self.first_entered(last, &step, unit) {
                None => return vector::zip_map(last, &step, |last, step| last + step),
                Some(index) => self.limited_by = Some(index as u8),
            }
            step = step.map(|value| 0.5 * value);
        }
        *last
    }

    fn held(&mut self, index: usize, last: &OutputVec) -> OutputVec {
        self.limited_by = Some(index as u8);
        *last
    }

    /// The first region that a step enters, crosses, or enters deeper.
    fn first_entered(&self, last: &OutputVec, step: &OutputVec, unit: OutputUnit) -> Option<usize> {
        self.regions.iter().position(|region| {
            let is_entered = |region| is_entered(region, last, step, unit);
            region.as_ref().is_some_and(is_entered)
        })
    }
}

/// Comparisons are written so that a distance that is not a number counts as entered.
fn is_entered(region: &Region, last: &OutputVec, step: &OutputVec, unit: OutputUnit) -> bool {
    let Some(before) = goal_distance(region, last, unit) else {
        return true;
    };
    let lowest = before.distance.min(0.0);
    // In the coordinates of the region, no step that keeps to this rule meets the set. The tip
    // moves on a curve, so points on its path are checked, too.
    let is_beside = dot(&before.slope, step) >= -before.distance.max(0.0);
    let parts = if region.space == FixtureSpace::Tip { 4 } else { 1 };
    let is_outside = |part: u32| {
        let share = f64::from(part) / f64::from(parts);
        let next = vector::zip_map(last, step, |last, step| last + share * step);
        goal_distance(region, &next, unit).is_some_and(|now| now.distance >= lowest)
    };
    !(is_beside && (1..=parts).all(is_outside))
}

/// `None`: a region in angles, and outputs that are none.
fn goal_distance(region: &Region, goal: &OutputVec, unit: OutputUnit) -> Option<GoalDistance> {
    let direct = |point: &Point| {
        let at = region.distance(point);
        GoalDistance { distance: at.distance, slope: at.slope }
    };
    match (region.space, unit) {
        (FixtureSpace::Angles, OutputUnit::Deg) => Some(direct(&[goal[0], goal[1], 0.0])),
        (FixtureSpace::Tip, OutputUnit::Mm) => Some(direct(goal)),
        (FixtureSpace::Tip, OutputUnit::Deg) => {
            let tip = kinematic::tip_position(goal[0], goal[1]);
            let at = region.distance(&tip.position_m);
            let along = |slope: &Point| dot(&at.slope, slope);
            let [pitch, yaw] = &tip.slope_m_per_rad;
            Some(GoalDistance { distance: at.distance, slope: [along(pitch), along(yaw), 0.0] })
        }
        (FixtureSpace::Angles, OutputUnit::Mm) => None,
    }
}

#[cfg(test)]
mod tests;
