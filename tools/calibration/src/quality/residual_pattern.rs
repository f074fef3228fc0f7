//! Model errors beyond noise and their patterns: a snake that no parameters of the model represent.
//!
//! Each pattern is a ridge regression of the errors. It is rated by the share that it explains of
//! rows that it has not seen: every fifth of forty blocks is left out in turn.

use std::f64::consts::TAU;
use std::fmt::{self, Display, Formatter};

use i2ris::units::MAX_OUTPUTS;
use i2ris_report::statistics::min_max;
use nalgebra::DMatrix;
use serde::Serialize;

use super::Quality;
use crate::recording::Recording;
use crate::regression::ridge::NormalEquations;
use crate::series::blocks;

/// Maximum ratio of errors to noise: then the remaining error is as large as the noise.
const BEYOND: f64 = std::f64::consts::SQRT_2;

/// Minimum share of the error beyond the noise that a named pattern explains.
const NAMED: f64 = 0.15;

/// Counts per turn of the laboratory's motors, whose encoders have 256 lines.
const COUNTS_PER_TURN: f64 = 1024.0;

const BLOCKS: usize = 40;
const FOLDS: usize = 5;

/// Penalty, relative to features of size 1.
const PENALTY: f64 = 1e-3;

/// Possible patterns of errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pattern {
    /// The turn of a motor, once and twice.
    MotorTurn,
    /// Time: drift and creep.
    Time,
    /// The speeds of the motors.
    Speed,
    /// The positions of the motors.
    Pose,
}

impl Pattern {
    const ALL: [Self; 4] = [Self::MotorTurn, Self::Time, Self::Speed, Self::Pose];

    const fn name(self) -> &'static str {
        match self {
            Self::MotorTurn => "the turn of a motor",
            Self::Time => "time",
            Self::Speed => "speed",
            Self::Pose => "pose",
        }
    }

    const fn advice(self) -> &'static str {
        match self {
            Self::MotorTurn => "look for an eccentric pinion, and check the counts per turn",
            Self::Time => {
                "record again when the robot is warm, and let the adaptation follow it \
                 (adaptation.enabled)"
            }
            Self::Speed => "record and move more slowly, and check the stamps of the camera",
            Self::Pose => "record longer, over the range that is used",
        }
    }

    /// Features of a row at counts, with the speeds there and the share of the recording before it.
    fn features(self, counts: &[f64], scaled: &[f64], speeds: &[f64], share: f64) -> Vec<f64> {
        match self {
            Self::MotorTurn => counts
                .iter()
                .map(|counts| (TAU * counts / COUNTS_PER_TURN).sin_cos())
                .flat_map(|(sin, cos)| [sin, cos, 2.0 * sin * cos, 1.0 - 2.0 * sin * sin])
                .collect(),
            Self::Time => {
                let at = 2.0 * share - 1.0;
                (1..=3)
                    .flat_map(|turn| {
                        let (sin, cos) = (0.25 * TAU * f64::from(turn) * at).sin_cos();
                        [sin, cos]
                    })
                    .collect()
            }
            Self::Speed => {
                speeds.iter().flat_map(|speed| [*speed, speed.abs(), speed.powi(3)]).collect()
            }
            Self::Pose => {
                let [x, y] = [0, 1].map(|i| scaled.get(i).copied().unwrap_or_default());
                let powers = (1..=4_i32).flat_map(|total| (0..=total).map(move |of| (total, of)));
                powers.map(|(total, of)| x.powi(total - of) * y.powi(of)).collect()
            }
        }
    }
}

/// Errors beyond noise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unexplained {
    /// RMS length of the errors, and of the noise of the measurement, unit of the outputs.
    pub error: f64,
    /// See `error`.
    pub noise: f64,
    /// The unit.
    pub unit: String,
    /// Patterns, with the share of the error beyond the noise, the largest first.
    pub patterns: Vec<(Pattern, f64)>,
}

impl Unexplained {
    /// Analyses predictions at some rows; `None` if they are as good as the noise allows, or the
    /// noise is not known.
    #[must_use]
    pub fn find(
        recording: &Recording,
        quality: &Quality,
        predicted: &[[f64; MAX_OUTPUTS]],
        rows: &[usize],
    ) -> Option<Self> {
        let outputs = recording.outputs();
        let noise = quality.noise.iter().map(|noise| Some((*noise)?.deviation.powi(2)));
        let noise = noise.sum::<Option<f64>>()?.sqrt();
        let errors = DMatrix::from_fn(rows.len(), outputs.len(), |row, output| {
            let row = rows[row];
            recording.rows()[row].outputs[output] - predicted[row][output]
        });
        let error = (errors.norm_squared() / rows.len().max(1) as f64).sqrt();
        if error.is_nan() || error <= BEYOND * noise {
            return None;
        }
        let beyond = errors.norm_squared() * (1.0 - (noise / error).powi(2));
        let motion = Motion::new(recording);
        let explained = |pattern: Pattern| {
            let left = left_out(&motion.features(pattern, rows)?, &errors)?;
            Some((pattern, (errors.norm_squared() - left) / beyond))
        };
        let mut patterns: Vec<_> = Pattern::ALL.into_iter().filter_map(explained).collect();
        patterns.retain(|(_, part)| *part >= NAMED);
        patterns.sort_by(|a, b| b.1.total_cmp(&a.1));
        let unit = outputs.first()?.unit.to_string();
        Some(Self { error, noise, unit, patterns })
    }
}

impl Display for Unexplained {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { error, noise, unit, patterns } = self;
        write!(
            f,
            "the error of the model on held-out rows is {error:.3} {unit}, the noise is {noise:.3} \
             {unit}"
        )?;
        if patterns.is_empty() {
            return f.write_str(
                "; it depends neither on the turn of a motor nor on time, speed or pose; \
                 use the camera (adaptation.enabled), or record longer with more reversals",
            );
        }
        for (place, (pattern, part)) in patterns.iter().enumerate() {
            let begin = if place == 0 { "; of the difference," } else { "," };
            let (name, advice) = (pattern.name(), pattern.advice());
            write!(f, "{begin} {:.0} % depends on {name}: {advice}", (100.0 * part).min(100.0))?;
        }
        Ok(())
    }
}

/// The motion of a recording, row by row.
struct Motion<'a> {
    recording: &'a Recording,
    /// Middle and half the range of every motor.
    ranges: Vec<(f64, f64)>,
}

impl<'a> Motion<'a> {
    fn new(recording: &'a Recording) -> Self {
        let range = |motor: usize| {
            let (low, high) = min_max(recording.rows().iter().map(|row| row.counts[motor]));
            (0.5 * (low + high), (0.5 * (high - low)).max(1.0))
        };
        Self { recording, ranges: (0..recording.motors()).map(range).collect() }
    }

    /// Half ranges per second, from the rows before and after; `None` without time.
    fn speeds(&self, row: usize) -> Option<Vec<f64>> {
        let rows = self.recording.rows();
        let (before, after) = (&rows[row.saturating_sub(1)], &rows[(row + 1).min(rows.len() - 1)]);
        let seconds = after.time_s? - before.time_s?;
        let speed = |(motor, (_, half)): (usize, &(f64, f64))| {
            (after.counts[motor] - before.counts[motor]) / (seconds.max(1e-6) * half)
        };
        Some(self.ranges.iter().enumerate().map(speed).collect())
    }

    fn features(&self, pattern: Pattern, rows: &[usize]) -> Option<DMatrix<f64>> {
        let features = rows.iter().map(|row| {
            let counts = &self.recording.rows()[*row].counts[..self.ranges.len()];
            let scale = |(counts, (middle, half)): (&f64, &(f64, f64))| (counts - middle) / half;
            let scaled: Vec<f64> = counts.iter().zip(&self.ranges).map(scale).collect();
            let speeds = match pattern {
                Pattern::Speed => self.speeds(*row)?,
                _ => Vec::new(),
            };
            let share = *row as f64 / self.recording.rows().len() as f64;
            Some(pattern.features(counts, &scaled, &speeds, share))
        });
        let features: Vec<Vec<f64>> = features.collect::<Option<_>>()?;
        let width = features.first()?.len();
        Some(DMatrix::from_fn(features.len(), width + 1, |row, column| match column {
            0 => 1.0,
            _ => features[row][column - 1],
        }))
    }
}

/// Sum of squared residuals of a regression on rows that it has not seen.
fn left_out(features: &DMatrix<f64>, errors: &DMatrix<f64>) -> Option<f64> {
    let blocks = blocks(features.nrows(), BLOCKS);
    let of = |fold: usize| -> Vec<usize> {
        blocks.iter().skip(fold).step_by(FOLDS).cloned().flatten().collect()
    };
    let sums: Vec<NormalEquations> = (0..FOLDS)
        .map(|fold| {
            let rows = of(fold);
            NormalEquations::new(&features.select_rows(&rows), &errors.select_rows(&rows))
        })
        .collect();
    let mut left = 0.0;
    for (fold, own) in sums.iter().enumerate() {
        let mut others = sums.iter().enumerate().filter(|(other, _)| *other != fold);
        let first = others.next()?.1.clone();
        let others = others.fold(first, |sum, (_, part)| sum.plus(part, 1.0));
        left += own.error(&others.solve(PENALTY)?);
    }
    Some(left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::{NoiseFloor, NoiseMethod};
    use crate::testing::{assert_contains, noise, one_motor};

    /// Patterns in errors of a motor that moves to and fro, with noise of 0.05 deg.
    fn found(error: impl Fn(f64, f64) -> f64) -> Option<Unexplained> {
        let (mut random, counts) = (noise(5), |time: f64| 1500.0 * (0.13 * time).sin());
        let recording =
            one_motor(2000, |time| (counts(time), error(time, counts(time)) + 0.05 * random()));
        let (method, samples) = (NoiseMethod::Differences, 1998);
        let floor = NoiseFloor { deviation: 0.05, method, samples };
        let (spikes, warnings) = (Vec::new(), Vec::new());
        let quality = Quality { noise: vec![Some(floor)], spikes, latency: None, warnings };
        let rows: Vec<usize> = (0..2000).collect();
        Unexplained::find(&recording, &quality, &[[0.0; MAX_OUTPUTS]; 2000], &rows)
    }

    #[test]
    fn errors_beyond_noise_are_reported_with_their_pattern() {
        assert_eq!(found(|_, _| 0.0), None);
        let turn = |_: f64, counts: f64| 0.2 * (TAU * counts / COUNTS_PER_TURN).sin();
        let drift = |time: f64, _: f64| 0.001 * time;
        let bent = |_: f64, counts: f64| 0.3 * (counts / 1500.0).powi(3);
        for (found, pattern, advice) in [
            (found(turn), Pattern::MotorTurn, "eccentric pinion"),
            (found(drift), Pattern::Time, "adaptation"),
            (found(bent), Pattern::Pose, "record longer"),
        ] {
            let found = found.unwrap();
            assert_eq!(found.patterns[0].0, pattern, "{found}");
            assert_contains(&found, &["the noise is", advice]);
        }
        let alone = found(|time, _| if (time as u32) & 1 == 0 { 0.3 } else { -0.3 }).unwrap();
        assert_contains(&alone, &["neither on the turn of a motor nor"]);
    }
}
