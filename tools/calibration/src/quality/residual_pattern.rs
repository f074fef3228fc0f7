//! Model errors beyond noise and their patterns: a snake that no parameters of the model represent.
//!
//! Each pattern is a ridge regression of the errors. It is rated by the share that it explains of
//! rows that it has not seen: every fifth of forty blocks is left out in turn. Patterns are taken
//! one after the other, each for what those before it leave, so that the shares are parts of one
//! whole. What no snake does comes first: a camera that repeats itself, a step, a missing side.

use std::f64::consts::TAU;
use std::fmt::{self, Display, Formatter};

use i2ris::units::MAX_OUTPUTS;
use i2ris_report::statistics::min_max;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::Quality;
use crate::recording::Recording;
use crate::regression::ridge::NormalEquations;
use crate::series::blocks;

/// Errors up to this ratio to the noise are noise; minimum share that a named pattern explains.
const BEYOND: f64 = std::f64::consts::SQRT_2;
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
    /// Outputs that stay equal from row to row while the motors move.
    Repeats,
    /// A step that lasts, at this line of the recording.
    Step(u64),
    /// Slopes that differ between the two sides of a motor.
    Side,
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
    const SNAKE: [Self; 4] = [Self::MotorTurn, Self::Time, Self::Speed, Self::Pose];

    fn name(self) -> String {
        match self {
            Self::Repeats => "equal rows while the motors move".to_owned(),
            Self::Step(line) => format!("a step at line {line}"),
            Self::Side => "the side of a motor".to_owned(),
            Self::MotorTurn => "the turn of a motor".to_owned(),
            Self::Time => "time".to_owned(),
            Self::Speed => "speed".to_owned(),
            Self::Pose => "pose".to_owned(),
        }
    }

    const fn advice(self) -> &'static str {
        match self {
            Self::Repeats => "the camera repeats itself: leave those rows out",
            Self::Step(_) => {
                "look whether the camera was moved, or a motor was homed or has slipped there, and \
                 cut the recording there"
            }
            Self::Side => "look for a broken or slack wire, or a stop",
            Self::MotorTurn => "look for an eccentric pinion, and check the counts per turn",
            Self::Time => {
                "record again when the robot is warm, and let the adaptation follow it \
                 (adaptation.enabled)"
            }
            Self::Speed => "record and move more slowly, and check the stamps of the camera",
            Self::Pose => "record longer, over the range that is used",
        }
    }

    /// The pattern of a snake that a defect resembles: it must explain less than the defect does.
    const fn rival(self) -> Self {
        if matches!(self, Self::Step(_)) { Self::Time } else { Self::Pose }
    }

    fn features(self, place: &Place<'_>) -> Vec<f64> {
        let Place { counts, scaled, speeds, share, line } = place;
        match self {
            Self::Repeats => Vec::new(),
            Self::Step(first) => vec![f64::from(u8::from(*line >= first))],
            Self::Side => scaled.iter().flat_map(|at| [at.max(0.0), at.min(0.0)]).collect(),
            Self::MotorTurn => counts
                .iter()
                .map(|counts| (TAU * counts / COUNTS_PER_TURN).sin_cos())
                .flat_map(|(sin, cos)| [sin, cos, 2.0 * sin * cos, 1.0 - 2.0 * sin * sin])
                .collect(),
            Self::Time => {
                let at = 2.0 * share - 1.0;
                let angles = (1..=3).map(|turn| 0.25 * TAU * f64::from(turn) * at);
                angles.flat_map(|angle| [angle.sin(), angle.cos()]).collect()
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
    pub noise: f64,
    pub unit: String,
    /// Patterns, with the share of the error beyond the noise: at most 1 together.
    pub patterns: Vec<(Pattern, f64)>,
}

impl Unexplained {
    /// Analyses predictions at some rows; `None` if they are as good as the noise allows, or the
    /// noise is not known. Without memory, a model errs by hysteresis, which no speed avoids.
    pub fn find(
        recording: &Recording,
        quality: &Quality,
        predicted: &[[f64; MAX_OUTPUTS]],
        rows: &[usize],
        has_memory: bool,
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
        let (repeats, kept): (Vec<usize>, Vec<usize>) =
            (0..rows.len()).partition(|at| motion.is_repeat(rows[*at]));
        let least = NAMED * beyond;
        let repeated = errors.select_rows(&repeats).norm_squared();
        let (kept, mut patterns) = match repeated >= least {
            true => (kept, vec![(Pattern::Repeats, repeated)]),
            false => ((0..rows.len()).collect(), Vec::new()),
        };
        let rows: Vec<usize> = kept.iter().map(|at| rows[*at]).collect();
        patterns.extend(motion.explained(&rows, &errors.select_rows(&kept), least, has_memory));
        let mut rest = 1.0;
        for (_, share) in &mut patterns {
            *share = (*share / beyond).min(rest);
            rest -= *share;
        }
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
            write!(f, "{begin} {:.0} % depends on {name}: {advice}", 100.0 * part)?;
        }
        Ok(())
    }
}

/// A row as patterns see it.
struct Place<'a> {
    counts: &'a [f64],
    /// Counts in half ranges from the middle.
    scaled: Vec<f64>,
    /// Half ranges per second.
    speeds: Vec<f64>,
    /// Share of the recording before it.
    share: f64,
    line: u64,
}

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

    /// Whether a row has the outputs of the row before it, and other counts.
    fn is_repeat(&self, row: usize) -> bool {
        let rows = self.recording.rows();
        let (before, here) = (&rows[row.saturating_sub(1)], &rows[row]);
        before.counts != here.counts && before.outputs == here.outputs
    }

    /// The patterns in the order in which they are taken, each with the square error, `least` or
    /// more, that it explains of what those before it leave.
    fn explained(
        &self,
        rows: &[usize],
        errors: &DMatrix<f64>,
        least: f64,
        has_memory: bool,
    ) -> Vec<(Pattern, f64)> {
        let left = |known: &DMatrix<f64>, pattern: Pattern| {
            let all = joined(known, &self.features(pattern, rows)?);
            Some((pattern, left_out(&all, errors)?, all))
        };
        let mut known = DMatrix::from_element(rows.len(), 1, 1.0);
        // The mean error does not show a pattern.
        let without = left_out(&known, errors).unwrap_or_else(|| errors.norm_squared());
        let (mut rest, mut found) = (without, Vec::new());
        let mut defects: Vec<Pattern> = self.step(rows, errors).into_iter().collect();
        defects.push(Pattern::Side);
        defects.retain(|defect| {
            let [own, rival] = [*defect, defect.rival()].map(|pattern| left(&known, pattern));
            let is_rather = |own: f64| rival.is_none_or(|rival| own < rival.1);
            own.is_some_and(|own| without - own.1 >= least && is_rather(own.1))
        });
        let mut snake = Pattern::SNAKE.to_vec();
        snake.retain(|pattern| has_memory || *pattern != Pattern::Speed);
        loop {
            let open = if defects.is_empty() { &mut snake } else { &mut defects };
            let tried = open.iter().filter_map(|pattern| left(&known, *pattern));
            let Some((pattern, now, all)) = tried.min_by(|a, b| a.1.total_cmp(&b.1)) else {
                return found;
            };
            open.retain(|it| *it != pattern);
            if rest - now >= least {
                found.push((pattern, rest - now));
                (known, rest) = (all, now);
            }
        }
    }

    /// The place of the largest step of the mean error, if it can be one.
    fn step(&self, rows: &[usize], errors: &DMatrix<f64>) -> Option<Pattern> {
        let sum = |part: std::ops::Range<usize>| -> DVector<f64> {
            errors.rows(part.start, part.len()).row_sum().transpose()
        };
        let explained = |at: usize| {
            let (before, after) = (at as f64, (rows.len() - at) as f64);
            let apart = sum(0..at) / before - sum(at..rows.len()) / after;
            before * after / rows.len() as f64 * apart.norm_squared()
        };
        // A tenth of the rows on either side.
        let places = rows.len() / 10..rows.len() - rows.len() / 10;
        let every = places.len().div_ceil(1000).max(1);
        let places = places.filter(|at| *at > 0).step_by(every);
        let place = places.max_by(|a, b| explained(*a).total_cmp(&explained(*b)))?;
        Some(Pattern::Step(self.recording.rows()[rows[place]].line))
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
        let features = rows.iter().map(|index| {
            let row = &self.recording.rows()[*index];
            let counts = &row.counts[..self.ranges.len()];
            let scale = |(counts, (middle, half)): (&f64, &(f64, f64))| (counts - middle) / half;
            let is_speed = pattern == Pattern::Speed;
            let speeds = if is_speed { self.speeds(*index)? } else { Vec::new() };
            Some(pattern.features(&Place {
                counts,
                scaled: counts.iter().zip(&self.ranges).map(scale).collect(),
                speeds,
                share: *index as f64 / self.recording.rows().len() as f64,
                line: row.line,
            }))
        });
        let features: Vec<Vec<f64>> = features.collect::<Option<_>>()?;
        let width = features.first()?.len();
        Some(DMatrix::from_fn(features.len(), width, |row, column| features[row][column]))
    }
}

fn joined(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let mut all = left.clone().resize_horizontally(left.ncols() + right.ncols(), 0.0);
    all.columns_mut(left.ncols(), right.ncols()).copy_from(right);
    all
}

/// Sum of squared residuals of a regression on rows that it has not seen.
fn left_out(features: &DMatrix<f64>, errors: &DMatrix<f64>) -> Option<f64> {
    let blocks = blocks(features.nrows(), BLOCKS);
    let equations = |fold: usize| {
        let rows: Vec<usize> = blocks.iter().skip(fold).step_by(FOLDS).cloned().flatten().collect();
        NormalEquations::new(&features.select_rows(&rows), &errors.select_rows(&rows))
    };
    let sums: Vec<_> = (0..FOLDS).map(equations).collect();
    NormalEquations::left_out(&sums, PENALTY, NormalEquations::error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::noise::{NoiseFloor, NoiseMethod};
    use crate::testing::{assert_contains, noise, one_motor};

    /// Patterns in errors of a motor that moves to and fro, with noise of 0.05 deg.
    fn found(error: impl Fn(f64, f64) -> f64) -> Option<Unexplained> {
        found_of(error, true)
    }

    fn found_of(error: impl Fn(f64, f64) -> f64, has_memory: bool) -> Option<Unexplained> {
        let (mut random, counts) = (noise(5), |time: f64| 1500.0 * (0.13 * time).sin());
        let seen = |time: f64| (counts(time), error(time, counts(time)) + 0.05 * random());
        of_recording(&one_motor(2000, seen), has_memory)
    }

    fn of_recording(recording: &Recording, has_memory: bool) -> Option<Unexplained> {
        let (method, samples) = (NoiseMethod::Differences, 1998);
        let floor = NoiseFloor { deviation: 0.05, method, samples };
        let (spikes, warnings) = (Vec::new(), Vec::new());
        let quality = Quality { noise: vec![Some(floor)], spikes, latency: None, warnings };
        let rows: Vec<usize> = (0..2000).collect();
        Unexplained::find(recording, &quality, &[[0.0; MAX_OUTPUTS]; 2000], &rows, has_memory)
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

    #[test]
    fn defects_come_first_and_shares_are_of_one_whole() {
        let step = |time: f64, _: f64| if time < 240.0 { 0.0 } else { 0.6 };
        let side = |_: f64, counts: f64| 0.5 * (counts / 1500.0).max(0.0);
        let mixed =
            |time: f64, counts: f64| 0.001 * time + 0.3 * (TAU * counts / COUNTS_PER_TURN).sin();
        let stands = |time: f64, _: f64| if time < 100.0 { 1.0 } else { 0.0 };
        for (found, pattern, advice) in [
            (found(step).unwrap(), Pattern::Step(1202), "cut the recording there"),
            (found(side).unwrap(), Pattern::Side, "slack wire"),
            (found(mixed).unwrap(), Pattern::MotorTurn, "eccentric pinion"),
            (found(stands).unwrap(), Pattern::Step(502), "was moved"),
        ] {
            assert_eq!(found.patterns[0].0, pattern, "{found}");
            assert_contains(&found, &[advice]);
            let whole: f64 = found.patterns.iter().map(|(_, share)| share).sum();
            assert!(whole <= 1.0 + 1e-12, "{found}");
        }
    }

    #[test]
    fn equal_rows_are_named_and_no_line_blames_speed() {
        let mut random = noise(6);
        let stutters = one_motor(2000, |time| {
            let seen = if (5.0 * time).round() % 20.0 < 4.0 { 3.0 } else { 0.05 * random() };
            (1500.0 * (0.13 * time).sin(), seen)
        });
        let found = of_recording(&stutters, true).unwrap();
        assert!(found.patterns[0].0 == Pattern::Repeats && found.patterns[0].1 > 0.7, "{found}");
        let speed = |time: f64, _: f64| 0.3 * (0.13 * time).cos();
        let has = |found: Option<Unexplained>| {
            found.unwrap().patterns.iter().any(|(pattern, _)| *pattern == Pattern::Speed)
        };
        assert!(has(found_of(speed, true)) && !has(found_of(speed, false)));
    }
}
