//! Joint space: what the model makes of the motors, and of a goal.

use std::sync::Arc;

use super::JointReport;
use super::steady::{Settled, Steady};
use crate::config::CompensationConfig;
use crate::drive::AxisFeedback;
use crate::model::file::OutputUnit;
use crate::model::{Estimate, Inverse, Memory, Model, Query};
use crate::units::{MAX_MOTORS, MotorVec, Nanos, OutputVec};

/// Time constant of the filter on the measured velocity, seconds. One count is 0.022 deg, and a position is read every
/// 4 ms: unfiltered, one count more or less shows as 5 deg/s; filtered, as 1 deg/s. The price is that the velocity is
/// 20 ms late. Nothing in the loop acts on it.
const VELOCITY_FILTER_S: f64 = 0.020;

/// Below this a velocity is none, rad/s: a filter never quite forgets, and its last digits cost time.
const NO_VELOCITY: f64 = 1e-12;

/// Where the encoders say the snake is.
#[derive(Debug, Clone, Copy)]
struct Measured {
    estimate: Estimate,
    stamp: Nanos,
    /// rad/s.
    velocity: OutputVec,
}

/// Where the set-points say the snake should be.
#[derive(Debug, Clone, Copy)]
struct Setpoint {
    mean: OutputVec,
    /// rad/s.
    velocity: OutputVec,
}

/// A model and what it has to remember. A model swap replaces all of it.
#[derive(Debug)]
pub(super) struct Joints {
    model: Arc<Model>,
    /// What the encoders showed, in order.
    seen: Memory,
    /// The same, and then the set-points that were written since the last positions were read.
    memory: Memory,
    /// Where the search for the inverse starts: the last answer.
    start: MotorVec,
    /// Positions read, per motor, so that a position counts once.
    sequences: [u64; MAX_MOTORS],
    measured: Option<Measured>,
    setpoint: Option<Setpoint>,
    steady: Steady,
    compensation: f64,
}

/// The model gave a value that is not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NotFinite;

impl Joints {
    /// A model that has seen no motion yet.
    pub fn new(model: Arc<Model>, config: &CompensationConfig, tick: Nanos) -> Self {
        let memory = model.new_memory();
        let unit = model.file().outputs.first().map_or(OutputUnit::Deg, |output| output.unit);
        // Without a memory the inverse does not jump at a turn.
        let jumps = model.wipe_counts() != MotorVec::default();
        let steady = Steady::new(config, unit, tick, jumps);
        Self {
            start: model.hull().centre(),
            model,
            seen: memory,
            memory,
            sequences: Default::default(),
            measured: None,
            setpoint: None,
            steady,
            compensation: config.factor,
        }
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.model.outputs()
    }

    /// Unit of the outputs in files: angles, or a position of the tip.
    pub fn unit(&self) -> OutputUnit {
        self.model.file().outputs.first().map_or(OutputUnit::Deg, |output| output.unit)
    }

    /// The model at the last set-points.
    pub fn setpoint(&self) -> Option<OutputVec> {
        self.setpoint.map(|setpoint| setpoint.mean)
    }

    /// The zero has moved, so what was remembered belongs to other counts.
    pub fn forget(&mut self) {
        self.seen = self.model.new_memory();
        self.memory = self.seen;
        self.measured = None;
        self.steady.forget();
    }

    /// Takes the goal of this tick through the turning band.
    pub fn settle(&mut self, goal: &OutputVec) -> Settled {
        self.steady.settle(goal)
    }

    /// No angles are followed in this tick.
    pub fn release(&mut self) {
        self.steady.release();
    }

    /// Takes note of new positions and of set-points written after them. Needs every drive to have reported.
    pub fn observe(&mut self, drives: &[AxisFeedback]) -> Result<(), NotFinite> {
        let positions = vector(drives.iter().map(|drive| drive.position.as_f64()));
        let new = self.sequences.iter().zip(drives).any(|(sequence, drive)| *sequence != drive.sequence);
        if new {
            self.model.advance(&mut self.seen, &positions);
            self.sequences.iter_mut().zip(drives).for_each(|(sequence, drive)| *sequence = drive.sequence);
        }
        self.memory = self.seen;
        if drives.iter().any(|drive| written_since(drive).is_some()) {
            let expected = drives.iter().map(|drive| written_since(drive).unwrap_or(drive.position.as_f64()));
            self.model.advance(&mut self.memory, &vector(expected));
        }
        self.steady.correct(self.model.correction(&self.memory))?;
        let stamp = drives.iter().map(|drive| drive.stamp).max().unwrap_or_default();
        if new || self.measured.is_none() { self.measure(&positions, stamp) } else { Ok(()) }
    }

    /// The counts that bring the outputs to a goal.
    pub fn solve(&self, goal: &OutputVec) -> Result<Inverse, NotFinite> {
        let query = Query { start: self.start, correction: self.steady.correction(), compensation: self.compensation };
        let answer = self.model.invert(goal, &self.memory, &query);
        if answer.counts.iter().all(|counts| counts.is_finite()) { Ok(answer) } else { Err(NotFinite) }
    }

    /// Searches for the next inverse from here.
    pub fn start_from(&mut self, counts: MotorVec) {
        self.start = counts;
    }

    /// The outputs at given counts.
    pub fn pose(&self, counts: &MotorVec) -> Result<OutputVec, NotFinite> {
        sound(self.model.predict(counts, &self.memory)).map(|estimate| estimate.mean)
    }

    /// Takes note of the set-points of this tick, and of how far they were `moved` in it.
    pub fn place(&mut self, setpoints: &MotorVec, moved: &MotorVec, tick: Nanos) -> Result<(), NotFinite> {
        let mean = self.pose(setpoints)?;
        let mut before = *setpoints;
        before.iter_mut().zip(moved).for_each(|(before, moved)| *before -= moved);
        let velocity = rate(&mean, &self.pose(&before)?, tick).unwrap_or_default();
        self.setpoint = Some(Setpoint { mean, velocity });
        Ok(())
    }

    /// What this tick shows; `goal` is the set-point where nothing is followed.
    pub fn report(&self, goal: Option<OutputVec>) -> Option<JointReport> {
        let (measured, setpoint) = (self.measured?, self.setpoint?);
        Some(JointReport {
            goal: goal.unwrap_or(setpoint.mean),
            setpoint: setpoint.mean,
            measured: measured.estimate.mean,
            setpoint_velocity: setpoint.velocity,
            measured_velocity: measured.velocity,
            deviation: measured.estimate.deviation(),
            memory_known: self.model.knows(&self.seen),
        })
    }

    fn measure(&mut self, positions: &MotorVec, stamp: Nanos) -> Result<(), NotFinite> {
        let estimate = sound(self.model.predict(positions, &self.seen)).inspect_err(|_| self.measured = None)?;
        let velocity = self.measured.map_or(OutputVec::default(), |before| filtered(&before, &estimate, stamp));
        self.measured = Some(Measured { estimate, stamp, velocity });
        Ok(())
    }
}

/// The set-point that reached the drive after its position was read.
fn written_since(drive: &AxisFeedback) -> Option<f64> {
    drive.written.filter(|written| written.stamp > drive.stamp).map(|written| written.target.as_f64())
}

/// An estimate that can be acted on.
fn sound(estimate: Estimate) -> Result<Estimate, NotFinite> {
    let mut values = estimate.mean.iter().chain(estimate.covariance.iter().flatten());
    if values.all(|value| value.is_finite()) { Ok(estimate) } else { Err(NotFinite) }
}

/// Rate of change; `None` if no time has passed.
fn rate(after: &OutputVec, before: &OutputVec, span: Nanos) -> Option<OutputVec> {
    let seconds = span.as_seconds();
    let mut rate = *after;
    rate.iter_mut().zip(before).for_each(|(rate, before)| *rate = (*rate - before) / seconds);
    (span != Nanos::ZERO).then_some(rate)
}

/// First-order low-pass on the rate of change, by backward Euler.
fn filtered(before: &Measured, estimate: &Estimate, stamp: Nanos) -> OutputVec {
    let span = stamp.since(before.stamp);
    let Some(raw) = rate(&estimate.mean, &before.estimate.mean, span) else { return before.velocity };
    let share = span.as_seconds() / (VELOCITY_FILTER_S + span.as_seconds());
    let mut velocity = before.velocity;
    velocity.iter_mut().zip(raw).for_each(|(velocity, raw)| *velocity += share * (raw - *velocity));
    velocity.map(|velocity| if velocity.abs() < NO_VELOCITY { 0.0 } else { velocity })
}

/// An array of fixed size, filled up with 0.
fn vector(values: impl Iterator<Item = f64>) -> MotorVec {
    let mut vector = MotorVec::default();
    vector.iter_mut().zip(values).for_each(|(to, from)| *to = from);
    vector
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_that_is_not_finite_is_not_acted_on() {
        assert!(sound(Estimate::default()).is_ok());
        let mut estimate = Estimate { mean: [0.0, f64::NAN, 0.0], ..Estimate::default() };
        assert_eq!(sound(estimate), Err(NotFinite));
        estimate.mean = [0.0; 3];
        estimate.covariance[1][1] = f64::INFINITY;
        assert_eq!(sound(estimate), Err(NotFinite));
    }

    #[test]
    fn the_filter_reaches_a_steady_velocity_and_forgets_half_of_it_in_its_half_life() {
        let mut measured = Measured { estimate: Estimate::default(), stamp: Nanos(0), velocity: [0.0; 3] };
        let mut step = |moved: f64, samples: u64| {
            for _ in 0..samples {
                let mut estimate = measured.estimate;
                estimate.mean[0] += moved;
                let stamp = measured.stamp + Nanos::from_micros(100);
                let velocity = filtered(&measured, &estimate, stamp);
                measured = Measured { estimate, stamp, velocity };
            }
            measured.velocity[0]
        };
        assert!((step(1e-4, 3000) - 1.0).abs() < 1e-3, "1e-4 rad every 100 us");
        // ln 2 * 20 ms = 13.9 ms.
        assert!((step(0.0, 139) - 0.5).abs() < 0.01);
    }
}
