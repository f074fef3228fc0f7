//! Joint space: what the model makes of the motors, and of a goal.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::JointReport;
use crate::core::model_slots::blend::Blend;
use crate::core::model_slots::motion_history::{Mark, Next, Trail};
use crate::core::motion::backlash_dead_band::{Settled, Steady};
use crate::core::motion::joint_filter::{Shape, Step};
use crate::drive::AxisFeedback;
use crate::model::file::OutputUnit;
use crate::model::{Estimate, History, Inverse, Memory, Model, Query};
use crate::units::{MotorVec, Nanos, OutputVec};

/// Time constant of the filter on the measured velocity, seconds. One count is 0.022 deg, and a
/// position is read every 4 ms: unfiltered, one count more or less shows as 5 deg/s; filtered, as 1
/// deg/s. The price is that the velocity is 20 ms late. Nothing in the loop acts on it.
const VELOCITY_FILTER_S: f64 = 0.020;

/// Below this a velocity is none, rad/s: a filter never quite forgets, and its last digits cost
/// time.
const NO_VELOCITY: f64 = 1e-12;

/// Positions that a model which comes late takes in per tick. One takes a microsecond or two.
const CATCH_UP: usize = 8;

/// Where the encoders say the snake is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Measured {
    estimate: Estimate,
    stamp: Nanos,
    /// rad/s.
    velocity: OutputVec,
}

/// Where the set-points say the snake should be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Setpoint {
    mean: OutputVec,
    /// rad/s.
    velocity: OutputVec,
}

/// A model and what it has to remember.
#[derive(Debug, Clone)]
pub(crate) struct Joints {
    model: Arc<Model>,
    compensation: f64,
    /// How long the goal takes to become that of this model alone, once it has taken over.
    blend_span: Nanos,
    state: Remembered,
}

/// What changes from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Remembered {
    /// How far along the trail `seen` is.
    mark: Mark,
    /// What the encoders showed, in order.
    seen: Memory,
    /// The same, and then the set-points that were written since the last positions were read.
    memory: Memory,
    /// Where the search for the inverse starts: the last answer.
    start: MotorVec,
    measured: Option<Measured>,
    setpoint: Option<Setpoint>,
    steady: Steady,
    shape: Shape,
    /// The goal of the last tick after the turning band, while angles are followed.
    settled: Option<OutputVec>,
    blend: Option<Blend>,
}

/// The model gave a value that is not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NotFinite;

impl Joints {
    /// A model that has seen no motion yet, at the beginning of the trail.
    pub fn new(model: Arc<Model>, config: &Config) -> Self {
        Self::with_memory(model, config, Memory::default(), Mark::default())
    }

    /// A model that has seen a history, which ends at a mark of the trail. Not for the control
    /// loop.
    pub fn recalled(model: Arc<Model>, config: &Config, history: &History, mark: Mark) -> Self {
        let memory = model.recall(history);
        Self::with_memory(model, config, memory, mark)
    }

    fn with_memory(model: Arc<Model>, config: &Config, memory: Memory, mark: Mark) -> Self {
        let unit = model
            .file()
            .outputs
            .first()
            .map_or(OutputUnit::Deg, |output| output.unit);
        // Without a memory the inverse does not jump at a turn.
        let jumps = model.wipe_counts() != MotorVec::default();
        let steady = Steady::new(&config.compensation, unit, config.control.period(), jumps);
        let angles = unit == OutputUnit::Deg;
        let shape = Shape::new(
            &config.command,
            &config.joint_limits,
            config.control.period(),
            angles,
        );
        let state = Remembered {
            mark,
            seen: memory,
            memory,
            start: model.hull().centre(),
            measured: None,
            setpoint: None,
            steady,
            shape,
            settled: None,
            blend: None,
        };
        let blend_span = Nanos::from_millis(config.model_swap.blend_ms);
        Self {
            model,
            compensation: config.compensation.factor,
            blend_span,
            state,
        }
    }

    /// What it remembers.
    pub fn remembered(&self) -> &Remembered {
        &self.state
    }

    /// The same model with another memory.
    pub fn restore(&mut self, state: Remembered) {
        self.state = state;
    }

    /// The memory is known: enough motion has been seen.
    pub fn memory_known(&self) -> bool {
        self.model.knows(&self.state.seen)
    }

    /// Nothing of the trail is left to be taken in.
    pub fn caught_up(&self, trail: &Trail) -> bool {
        self.state.mark == trail.mark()
    }

    /// The same outputs, so that one goal means the same to both.
    pub fn speaks_like(&self, other: &Self) -> bool {
        self.model.file().outputs == other.model.file().outputs
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
        self.model
            .file()
            .outputs
            .first()
            .map_or(OutputUnit::Deg, |output| output.unit)
    }

    /// The model at the last set-points.
    pub fn setpoint(&self) -> Option<OutputVec> {
        self.state.setpoint.map(|setpoint| setpoint.mean)
    }

    /// Takes over from another model at these set-points: the motors stay where they are, the
    /// outputs are computed anew, and what the goal and this model disagree by becomes a [`Blend`].
    pub fn take_over(
        &mut self,
        from: Option<&Self>,
        drives: &[AxisFeedback],
        setpoints: &MotorVec,
        now: Nanos,
    ) -> Result<(), NotFinite> {
        let before = from.map(|from| &from.state);
        self.state.start = *setpoints;
        self.state
            .steady
            .begin_like(before.map(|before| &before.steady));
        if let Some(before) = before {
            self.state.shape = before.shape;
        }
        self.state.settled = before.and_then(|before| before.settled);
        self.state.blend = None;
        self.see(drives)?;
        self.measure(drives, before.and_then(|before| before.measured))?;
        let here = self.pose(setpoints)?;
        self.state.setpoint = Some(Setpoint {
            mean: here,
            velocity: OutputVec::default(),
        });
        self.state.blend = self.state.settled.map(|goal| {
            let mut offset = here;
            offset
                .iter_mut()
                .zip(goal)
                .for_each(|(offset, goal)| *offset -= goal);
            Blend::new(offset, now, self.blend_span)
        });
        Ok(())
    }

    /// Takes the goal of this tick through tremor filter and limits. It begins where the set-points
    /// are.
    pub fn shape(&mut self, step: Step) -> Result<Step, NotFinite> {
        let start = self.setpoint().ok_or(NotFinite)?;
        Ok(self.state.shape.apply(step, start))
    }

    /// Takes the goal of this tick through the turning band.
    pub fn settle(&mut self, goal: &OutputVec) -> Settled {
        let settled = self.state.steady.settle(goal);
        self.state.settled = Some(settled.goal);
        settled
    }

    /// A goal with what the last swap of models still adds to it.
    pub fn blended(&self, mut goal: OutputVec, at: Nanos) -> OutputVec {
        if let Some(offset) = self.state.blend.and_then(|blend| blend.at(at)) {
            goal.iter_mut()
                .zip(offset)
                .for_each(|(goal, offset)| *goal += offset);
        }
        goal
    }

    /// No angles are followed in this tick.
    pub fn release(&mut self) {
        self.state.steady.release();
        self.state.shape.release();
        self.state.settled = None;
        self.state.blend = None;
    }

    /// Goes along the trail, at most [`CATCH_UP`] positions. True if there was one.
    pub fn go_along(&mut self, trail: &Trail) -> bool {
        for taken in 0..CATCH_UP {
            match trail.after(self.state.mark) {
                Next::End => return taken > 0,
                Next::Position(position, mark) => {
                    self.model.advance(&mut self.state.seen, &position);
                    self.state.mark = mark;
                }
                // The zero has moved, so what was remembered belongs to other counts; or too much
                // was missed.
                Next::Lost => {
                    self.forget();
                    self.state.mark = trail.mark();
                    trail
                        .newest()
                        .iter()
                        .for_each(|newest| self.model.advance(&mut self.state.seen, newest));
                    return true;
                }
            }
        }
        true
    }

    /// Takes note of new positions and of set-points written after them. Needs every drive to have
    /// reported.
    pub fn observe(&mut self, trail: &Trail, drives: &[AxisFeedback]) -> Result<(), NotFinite> {
        let new = self.go_along(trail);
        self.see(drives)?;
        let before = self.state.measured;
        if new || before.is_none() {
            self.measure(drives, before)
        } else {
            Ok(())
        }
    }

    /// The counts that bring the outputs to a goal.
    pub fn solve(&self, goal: &OutputVec) -> Result<Inverse, NotFinite> {
        let state = &self.state;
        let query = Query {
            start: state.start,
            correction: state.steady.correction(),
            compensation: self.compensation,
        };
        let answer = self.model.invert(goal, &state.memory, &query);
        if answer.counts.iter().all(|counts| counts.is_finite()) {
            Ok(answer)
        } else {
            Err(NotFinite)
        }
    }

    /// Searches for the next inverse from here.
    pub fn start_from(&mut self, counts: MotorVec) {
        self.state.start = counts;
    }

    /// The outputs at given counts.
    pub fn pose(&self, counts: &MotorVec) -> Result<OutputVec, NotFinite> {
        sound(self.model.predict(counts, &self.state.memory)).map(|estimate| estimate.mean)
    }

    /// Takes note of the set-points of this tick, and of how far they were `moved` in it.
    pub fn place(
        &mut self,
        setpoints: &MotorVec,
        moved: &MotorVec,
        tick: Nanos,
    ) -> Result<(), NotFinite> {
        let mean = self.pose(setpoints)?;
        let mut before = *setpoints;
        before
            .iter_mut()
            .zip(moved)
            .for_each(|(before, moved)| *before -= moved);
        let velocity = rate(&mean, &self.pose(&before)?, tick).unwrap_or_default();
        self.state.setpoint = Some(Setpoint { mean, velocity });
        Ok(())
    }

    /// What this tick shows; `goal` is the set-point where nothing is followed.
    pub fn report(&self, goal: Option<OutputVec>) -> Option<JointReport> {
        let (measured, setpoint) = (self.state.measured?, self.state.setpoint?);
        Some(JointReport {
            model: self.model.id(),
            outputs: self.outputs() as u32,
            goal: goal.unwrap_or(setpoint.mean),
            setpoint: setpoint.mean,
            measured: measured.estimate.mean,
            setpoint_velocity: setpoint.velocity,
            measured_velocity: measured.velocity,
            deviation: measured.estimate.deviation(),
            memory_known: self.memory_known(),
        })
    }

    fn forget(&mut self) {
        self.state.seen = self.model.new_memory();
        self.state.memory = self.state.seen;
        self.state.measured = None;
        self.state.steady.forget();
    }

    /// From what was read to what was written since.
    fn see(&mut self, drives: &[AxisFeedback]) -> Result<(), NotFinite> {
        self.state.memory = self.state.seen;
        if drives.iter().any(|drive| written_since(drive).is_some()) {
            let expected = drives
                .iter()
                .map(|drive| written_since(drive).unwrap_or(drive.position.as_f64()));
            self.model
                .advance(&mut self.state.memory, &vector(expected));
        }
        self.state
            .steady
            .correct(self.model.correction(&self.state.memory))
    }

    fn measure(
        &mut self,
        drives: &[AxisFeedback],
        before: Option<Measured>,
    ) -> Result<(), NotFinite> {
        let positions = vector(drives.iter().map(|drive| drive.position.as_f64()));
        let stamp = drives
            .iter()
            .map(|drive| drive.stamp)
            .max()
            .unwrap_or_default();
        let estimate = sound(self.model.predict(&positions, &self.state.seen))
            .inspect_err(|_| self.state.measured = None)?;
        let velocity = before.map_or(OutputVec::default(), |before| {
            filtered(&before, &estimate, stamp)
        });
        self.state.measured = Some(Measured {
            estimate,
            stamp,
            velocity,
        });
        Ok(())
    }
}

/// The set-point that reached the drive after its position was read.
fn written_since(drive: &AxisFeedback) -> Option<f64> {
    drive
        .written
        .filter(|written| written.stamp > drive.stamp)
        .map(|written| written.target.as_f64())
}

/// An estimate that can be acted on.
fn sound(estimate: Estimate) -> Result<Estimate, NotFinite> {
    let mut values = estimate
        .mean
        .iter()
        .chain(estimate.covariance.iter().flatten());
    if values.all(|value| value.is_finite()) {
        Ok(estimate)
    } else {
        Err(NotFinite)
    }
}

/// Rate of change; `None` if no time has passed.
fn rate(after: &OutputVec, before: &OutputVec, span: Nanos) -> Option<OutputVec> {
    let seconds = span.as_seconds();
    let mut rate = *after;
    rate.iter_mut()
        .zip(before)
        .for_each(|(rate, before)| *rate = (*rate - before) / seconds);
    (span != Nanos::ZERO).then_some(rate)
}

/// First-order low-pass on the rate of change, by backward Euler.
fn filtered(before: &Measured, estimate: &Estimate, stamp: Nanos) -> OutputVec {
    let span = stamp.since(before.stamp);
    let Some(raw) = rate(&estimate.mean, &before.estimate.mean, span) else {
        return before.velocity;
    };
    let share = span.as_seconds() / (VELOCITY_FILTER_S + span.as_seconds());
    let mut velocity = before.velocity;
    velocity
        .iter_mut()
        .zip(raw)
        .for_each(|(velocity, raw)| *velocity += share * (raw - *velocity));
    velocity.map(|velocity| {
        if velocity.abs() < NO_VELOCITY {
            0.0
        } else {
            velocity
        }
    })
}

/// An array of fixed size, filled up with 0.
fn vector(values: impl Iterator<Item = f64>) -> MotorVec {
    let mut vector = MotorVec::default();
    vector
        .iter_mut()
        .zip(values)
        .for_each(|(to, from)| *to = from);
    vector
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_that_is_not_finite_is_not_acted_on() {
        assert!(sound(Estimate::default()).is_ok());
        let mut estimate = Estimate {
            mean: [0.0, f64::NAN, 0.0],
            ..Estimate::default()
        };
        assert_eq!(sound(estimate), Err(NotFinite));
        estimate.mean = [0.0; 3];
        estimate.covariance[1][1] = f64::INFINITY;
        assert_eq!(sound(estimate), Err(NotFinite));
    }

    #[test]
    fn the_filter_reaches_a_steady_velocity_and_forgets_half_of_it_in_its_half_life() {
        let mut measured = Measured {
            estimate: Estimate::default(),
            stamp: Nanos(0),
            velocity: [0.0; 3],
        };
        let mut step = |moved: f64, samples: u64| {
            for _ in 0..samples {
                let mut estimate = measured.estimate;
                estimate.mean[0] += moved;
                let stamp = measured.stamp + Nanos::from_micros(100);
                let velocity = filtered(&measured, &estimate, stamp);
                measured = Measured {
                    estimate,
                    stamp,
                    velocity,
                };
            }
            measured.velocity[0]
        };
        assert!(
            (step(1e-4, 3000) - 1.0).abs() < 1e-3,
            "1e-4 rad every 100 us"
        );
        // ln 2 * 20 ms = 13.9 ms.
        assert!((step(0.0, 139) - 0.5).abs() < 0.01);
    }
}
