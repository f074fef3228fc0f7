//! The examination of a model before it may move motors: whether its inverse follows the model
//! itself and whether it has the gain of the robot.
//!
//! A path wanders through the hull: large slow motion with small reversals on it. What the model
//! predicts along the path are the goals, so motors can reach every one of them, with as much
//! travel as the path has. Then the inverse follows the goals, in whole counts and with a limit on
//! the velocity, and with the memory of its own setpoints. A model that folds, chatters or jumps
//! misses them or takes more travel.
//!
//! The work is bounded: some thousand steps of the operators, a fraction of a second.

use nalgebra::DMatrix;

use crate::model::error::ModelError;
use crate::model::estimate::Query;
use crate::model::examination_path::ExaminationPath;
use crate::model::families::memory::Memory;
use crate::model::families::runtime::{Reach, Runtime, Search};
use crate::model::file::ModelFile;
use crate::units::{MotorVec, OutputVec};

/// Steps of the path, and of the decaying turns before it, after which the memory is known.
const STEPS: usize = 600;
const TURNING_STEPS: usize = 200;

/// The motors move by at most this part of half the range in a step: twice what the path takes.
const FASTEST: f64 = 0.1;

/// Share of the difference that the filtered correction takes in a step, as in the control loop.
const FILTER: f64 = 0.2;

/// Goals that move by less than this share of the wide path's goals are in backlash: then the wide
/// path is followed.
const MIN_MOTION: f64 = 0.1;

/// A pose that is missed by less than this part of their deviation is clipped by a rounding only.
const ROUNDING: f64 = 0.005;

/// Maximum error at the goals, relative to their deviation.
const MAX_ERROR: f64 = 0.7;

/// Maximum motor travel, relative to that of the path.
const MAX_TRAVEL: f64 = 6.0;

/// Maximum gain of the model relative to a straight line through the recording; its inverse is the
/// minimum. Both are scaled by the gain that backlash leaves.
const MAX_GAIN: f64 = 3.0;

/// Minimum share of the gain that the widest backlash leaves, for the comparison.
const MIN_REMAINING_GAIN: f64 = 0.1;

/// Directions with less than this share of the strongest direction's gain are not compared.
const MIN_GAIN: f64 = 0.02;

/// Result of an examination.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Examination {
    /// RMS error at the goals over their RMS deviation from their mean.
    pub error: f64,
    /// Travel of the motors over that of the path.
    pub travel: f64,
    /// The least and the greatest gain of the model, relative to the straight line; `None` if the
    /// file has none.
    pub gains: Option<[f64; 2]>,
    /// The part of the poses that the model predicts all over the hull that its inverse does not
    /// clip, 0 to 1.
    pub usable: f64,
    /// Share of a gain left by backlash as wide as the model's memory, 0 to 1.
    pub left: f64,
}

impl Examination {
    pub(in crate::model) fn of(runtime: &dyn Runtime, reach: &Reach, file: &ModelFile) -> Self {
        let subject = Subject::new(runtime, reach, file);
        let (error, travel) = subject.follow();
        let (gains, usable, left) = (subject.gains(), subject.usable(), subject.left_by_backlash());
        Self { error, travel, gains, usable, left }
    }

    /// Refuses a model whose inverse or gain is unusable.
    pub(in crate::model) fn verdict(&self) -> Result<(), ModelError> {
        let most_gain = MAX_GAIN / self.left.max(MIN_REMAINING_GAIN);
        let range = 1.0 / most_gain..=most_gain;
        if let Some([least, most]) = self.gains
            && !(range.contains(&least) && range.contains(&most))
        {
            return Err(ModelError::Gain { least, most });
        }
        if self.error <= MAX_ERROR && self.travel <= MAX_TRAVEL {
            return Ok(());
        }
        if self.error.is_nan() {
            return Err(ModelError::NoMotion);
        }
        Err(ModelError::Rehearsal { error: self.error, travel: self.travel })
    }
}

/// The examination of one model.
struct Subject<'a> {
    runtime: &'a dyn Runtime,
    reach: &'a Reach,
    file: &'a ModelFile,
    motors: usize,
    path: ExaminationPath,
    /// Predictions of the model along the path.
    goals: Vec<OutputVec>,
    /// The same path, as wide as the hull: inside of wide backlash a model has no gain to compare.
    wide: ExaminationPath,
}

impl<'a> Subject<'a> {
    fn new(runtime: &'a dyn Runtime, reach: &'a Reach, file: &'a ModelFile) -> Self {
        let hull = &reach.counts;
        let mut subject = Self {
            runtime,
            reach,
            file,
            motors: file.hull.corners.first().map_or(0, Vec::len),
            path: ExaminationPath::new(hull, TURNING_STEPS, STEPS),
            goals: Vec::new(),
            wide: ExaminationPath::wide(hull, TURNING_STEPS, STEPS),
        };
        subject.goals = subject.along(&subject.path);
        let wide = subject.along(&subject.wide);
        if spread(&subject.goals) < MIN_MOTION.powi(2) * spread(&wide) {
            (subject.path, subject.goals) = (subject.wide.clone(), wide);
        }
        subject
    }

    fn along(&self, path: &ExaminationPath) -> Vec<OutputVec> {
        let mut memory = self.memory_after_turns();
        let predict = |counts: &MotorVec| {
            self.advance(&mut memory, counts);
            self.runtime.predict(counts, &memory).mean
        };
        path.wander.iter().map(predict).collect()
    }

    fn advance(&self, memory: &mut Memory, counts: &MotorVec) {
        memory.note(*counts);
        self.runtime.advance(memory, counts, 0.0);
    }

    fn memory_after_turns(&self) -> Memory {
        let mut memory = Memory::default();
        for counts in &self.path.turns {
            self.advance(&mut memory, counts);
        }
        memory
    }

    /// Error and travel of the inverse on the goals, relative to those of the path.
    fn follow(&self) -> (f64, f64) {
        let Self { path, goals, .. } = self;
        let mut memory = self.memory_after_turns();
        let mut counts = path.turns.last().copied().unwrap_or_default();
        let fastest = path.half_ranges.map(|half| FASTEST * half);
        let mut correction = self.runtime.memory_terms(&memory).correction;
        let (mut squares, mut travel) = (0.0, 0.0);
        for goal in goals {
            let query = Query { correction: Some(correction), ..Query::new(counts) };
            let search = Search { memory: &memory, reach: self.reach, query: &query };
            let target = self.runtime.invert(goal, search).counts;
            let mut next = counts;
            for (motor, next) in next.iter_mut().enumerate().take(self.motors) {
                let step = (target[motor] - *next).clamp(-fastest[motor], fastest[motor]);
                *next = (*next + step).round();
            }
            self.advance(&mut memory, &next);
            let unfiltered = self.runtime.memory_terms(&memory).correction;
            for (filtered, now) in correction.iter_mut().zip(&unfiltered) {
                *filtered += FILTER * (now - *filtered);
            }
            travel += ExaminationPath::distance(&counts, &next);
            squares += square(&self.runtime.predict(&next, &memory).mean, goal);
            counts = next;
        }
        ((squares / spread(goals)).sqrt(), travel / path.travel().max(1.0))
    }

    /// The least and the greatest gain of the model along the wide path, relative to the straight
    /// line through the recording.
    fn gains(&self) -> Option<[f64; 2]> {
        let path = &self.wide.wander;
        let goals = self.along(&self.wide);
        let line = self.file.training.linear_gain.as_ref()?;
        let unit = self.file.outputs.first()?.unit.si();
        let (motors, outputs) = (self.motors, self.file.outputs.len());
        let line = DMatrix::from_fn(outputs, motors, |output, motor| {
            line.get(output).and_then(|row| row.get(motor)).copied().unwrap_or(f64::NAN) * unit
        });
        let rows = path.len();
        let mut inputs = DMatrix::from_fn(rows, motors, |row, motor| path[row][motor]);
        let mut angles = DMatrix::from_fn(rows, outputs, |row, output| goals[row][output]);
        for mut column in inputs.column_iter_mut().chain(angles.column_iter_mut()) {
            let mean = column.mean();
            column.add_scalar_mut(-mean);
        }
        if !angles.iter().chain(line.iter()).all(|value| value.is_finite()) {
            return Some([f64::NAN; 2]);
        }
        let gram = inputs.tr_mul(&inputs).try_inverse()?;
        let gain = (gram * inputs.tr_mul(&angles)).transpose();
        relative_gains(&gain, &line)
    }

    /// See [`Examination::usable`]: along the wide path, whose corners lie on the hull.
    fn usable(&self) -> f64 {
        let path = &self.wide.wander;
        let goals = self.along(&self.wide);
        let rounding = ROUNDING * (spread(&goals) / goals.len() as f64).sqrt();
        let mut memory = self.memory_after_turns();
        let is_reached = |(counts, goal): &(&MotorVec, &OutputVec)| {
            self.advance(&mut memory, counts);
            let (memory, query) = (&memory, &Query::new(**counts));
            let found = self.runtime.invert(goal, Search { memory, reach: self.reach, query });
            !found.clipped || found.residual <= rounding
        };
        path.iter().zip(&goals).filter(is_reached).count() as f64 / goals.len() as f64
    }

    /// Share of a gain along the wide path left by a play as wide as the conditioning range: the
    /// minimum over the motors.
    fn left_by_backlash(&self) -> f64 {
        let ranges = self.runtime.conditioning_range();
        let left = |motor: usize| {
            let path = self.wide.wander.iter().map(|counts| counts[motor]);
            slope_of_play(path, 0.5 * ranges[motor])
        };
        (0..self.motors).map(left).fold(1.0, f64::min)
    }
}

/// The slope of a straight line through what a play of a half-width makes of a path.
fn slope_of_play(path: impl ExactSizeIterator<Item = f64> + Clone, half_width: f64) -> f64 {
    let mean = path.clone().sum::<f64>() / path.len().max(1) as f64;
    let mut play = mean;
    let (mut product, mut square) = (0.0, 0.0);
    for at in path {
        play = play.max(at - half_width).min(at + half_width);
        product += (play - mean) * (at - mean);
        square += (at - mean).powi(2);
    }
    if square > 0.0 { product / square } else { 1.0 }
}

/// Gain of the model relative to the straight line, in each direction in which the line moves the
/// outputs: minimum and maximum.
fn relative_gains(gain: &DMatrix<f64>, line: &DMatrix<f64>) -> Option<[f64; 2]> {
    let parts = line.clone().svd(true, true);
    let (left, right) = (parts.u?, parts.v_t?);
    let strongest = parts.singular_values.max();
    let mut range: Option<[f64; 2]> = None;
    for (index, value) in parts.singular_values.iter().enumerate() {
        if *value > MIN_GAIN * strongest {
            let moved = gain * right.row(index).transpose();
            let relative = left.column(index).dot(&moved) / value;
            let [least, most] = range.unwrap_or([relative; 2]);
            range = Some([least.min(relative), most.max(relative)]);
        }
    }
    range
}

/// Sum of the squared distances from the mean.
fn spread(goals: &[OutputVec]) -> f64 {
    let mut mean = OutputVec::default();
    for goal in goals {
        for (mean, goal) in mean.iter_mut().zip(goal) {
            *mean += goal / goals.len() as f64;
        }
    }
    goals.iter().map(|goal| square(goal, &mean)).sum()
}

fn square(from: &OutputVec, to: &OutputVec) -> f64 {
    from.iter().zip(to).map(|(from, to)| (to - from).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found_with(error: f64, travel: f64, gains: Option<[f64; 2]>) -> Examination {
        Examination { error, travel, gains, usable: 1.0, left: 1.0 }
    }

    #[test]
    fn gains_are_compared_along_the_directions_of_the_line() {
        let line = DMatrix::from_row_slice(2, 2, &[0.02, 0.01, -0.01, 0.02]);
        let same = relative_gains(&line, &line).unwrap();
        assert!(same.iter().all(|gain| (gain - 1.0).abs() < 1e-12), "{same:?}");
        let mirrored = relative_gains(&-&line, &line).unwrap();
        assert!(mirrored.iter().all(|gain| (gain + 1.0).abs() < 1e-12), "{mirrored:?}");
        let weak = DMatrix::from_row_slice(2, 2, &[0.02, 0.0, 0.0, 0.0005]);
        let strong = DMatrix::from_row_slice(2, 2, &[0.02, 0.0, 0.0, 0.02]);
        let [least, most] = relative_gains(&weak, &strong).unwrap();
        assert!((least - 0.025).abs() < 1e-9 && (most - 1.0).abs() < 1e-9);
        let found = |gains| found_with(0.0, 1.0, Some(gains));
        assert!(matches!(found([least, most]).verdict(), Err(ModelError::Gain { .. })));
        assert!(found([most; 2]).verdict().is_ok());
    }

    #[test]
    fn direction_without_line_motion_is_not_compared() {
        let line = DMatrix::from_row_slice(1, 2, &[0.02, 0.0]);
        let gain = DMatrix::from_row_slice(1, 2, &[0.03, 0.01]);
        let [least, most] = relative_gains(&gain, &line).unwrap();
        assert!((least - 1.5).abs() < 1e-9 && (most - 1.5).abs() < 1e-9);
    }

    #[test]
    fn an_inverse_that_misses_or_chatters_is_refused() {
        let found = |error, travel| found_with(error, travel, None);
        assert!(found(0.01, 1.0).verdict().is_ok());
        for (error, travel) in [(0.8, 1.0), (0.01, 9.0), (0.01, f64::NAN)] {
            let refusal = found(error, travel).verdict();
            assert!(matches!(refusal, Err(ModelError::Rehearsal { .. })));
        }
        assert!(matches!(found(f64::NAN, 1.0).verdict(), Err(ModelError::NoMotion)));
        let sentence = found(0.8, 9.0).verdict().unwrap_err().to_string();
        assert!(sentence.contains("misses 80 % of the motion"), "{sentence}");
        assert!(sentence.contains("with 9.0 times the motor travel"), "{sentence}");
    }
}
