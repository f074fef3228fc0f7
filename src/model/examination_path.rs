//! A path of the motors on which models are tried, without a robot.

use std::f64::consts::TAU;

use crate::model::maths::hull::Hull;
use crate::units::MotorVec;

/// Decaying turns through the hull, after which the memory of a model is known, and then large slow
/// motion with small faster reversals on it. Counts.
#[derive(Debug, Clone, PartialEq)]
pub struct ExaminationPath {
    /// The turns.
    pub turns: Vec<MotorVec>,
    /// The motion after them.
    pub wander: Vec<MotorVec>,
    /// Half the hull width of every motor.
    pub half_ranges: MotorVec,
}

impl ExaminationPath {
    /// Creates a path of `steps` steps inside a hull.
    #[must_use]
    pub fn new(hull: &Hull, turning_steps: usize, steps: usize) -> Self {
        Self::sized(hull, turning_steps, steps, [0.45, 0.12])
    }

    /// The same path, but over the whole width of the hull.
    #[must_use]
    pub fn wide(hull: &Hull, turning_steps: usize, steps: usize) -> Self {
        Self::sized(hull, turning_steps, steps, [0.8, 0.2])
    }

    /// `sizes` are those of the slow and of the fast part of the motion.
    fn sized(hull: &Hull, turning_steps: usize, steps: usize, [slow, fast]: [f64; 2]) -> Self {
        let [low, high] = hull.bounds();
        let centre = hull.centre();
        let half_ranges: MotorVec = std::array::from_fn(|motor| (high[motor] - low[motor]) / 2.0);
        let at = |part: MotorVec| {
            hull.project(&std::array::from_fn(|motor| {
                centre[motor] + part[motor] * half_ranges[motor]
            }))
        };
        let turn = |step: usize| {
            let part = step as f64 / turning_steps as f64;
            let (sin, cos) = (4.0 * TAU * part).sin_cos();
            let size = 0.95 * (1.0 - part);
            at([size * sin, size * cos])
        };
        let wander = |step: usize| {
            let part = step as f64 / steps as f64;
            let wave = |turns: f64, phase: f64| (TAU * turns * part + phase).sin();
            at([
                slow * wave(3.0, 0.0) + fast * wave(19.0, 1.0),
                slow * wave(4.0, 0.5) + fast * wave(23.0, 2.0),
            ])
        };
        Self {
            turns: (0..turning_steps).map(turn).collect(),
            wander: (0..steps).map(wander).collect(),
            half_ranges,
        }
    }

    /// Travel of the motors after the turns, counts.
    #[must_use]
    pub fn travel(&self) -> f64 {
        let steps = self.wander.windows(2);
        steps.map(|pair| Self::distance(&pair[0], &pair[1])).sum()
    }

    /// Travel of the motors between two positions, counts.
    #[must_use]
    pub fn distance(from: &MotorVec, to: &MotorVec) -> f64 {
        from.iter().zip(to).map(|(from, to)| (to - from).abs()).sum()
    }
}
