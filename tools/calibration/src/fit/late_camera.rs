//! Latency of a camera's stamps, as far as held-out rows confirm it.
//!
//! The estimate of [`crate::quality::latency`] represents hysteresis by plays only; any other delay
//! of a snake looks like a late camera. So a force-balance model is fitted from that estimate, with
//! the latency as one more parameter ([`crate::families::force_balance::latency`]). It must explain
//! held-out rows better than without, those of every motor in both directions.

use i2ris::model::file::FamilyParameters;
use i2ris_report::statistics::min_max;

use super::all_families::balance_of;
use super::metrics::{block_errors, known_from, predictions};
use super::split::{HoldOut, Split};
use crate::families::force_balance::search::{Start, fit_force_balance};
use crate::progress::Silent;
use crate::quality::{Finding, limits_of_path};
use crate::recording::Recording;
use crate::series::Series;

/// Maximum latency of a camera: one 30 Hz frame each of exposure, transfer and processing.
const LATEST_S: f64 = 0.1;

/// Minimum latency: hysteresis of eight emulated physics looked up to 15 ms late.
const MIN_LATENCY_S: f64 = 0.015;

/// Tolerance of an estimate, in deviations; its maximum, as all parts of a recording agree.
const DEVIATIONS: f64 = 2.0;
const UNSURE_S: f64 = 0.01;

/// Fits, each to the recording corrected by the previous one; maximum error of the estimate.
const ROUNDS: usize = 2;
const FURTHEST_S: f64 = 0.03;

/// Maximum number of rows; more hardly improve the result.
const MAX_ROWS: usize = 1500;

/// Stamps that rows held out confirm to be later than those of any camera.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the outputs are stamped {ms:.0} ms late, which rows held out confirm with every motor in both \
     directions, and no camera takes more than three frames: stamp frames at the exposure, and \
     record again; --latency-ms {ms:.0} subtracts it, --latency-ms 0 keeps the stamps"
)]
pub struct LateStamps {
    ms: f64,
}

impl LateStamps {
    /// Warning for a use that keeps the stamps.
    pub fn kept(&self) -> String {
        format!(
            "the outputs are stamped {:.0} ms late, more than any camera takes, so the stamps are \
             kept: results are those of a slower snake; stamp frames at the exposure, and record \
             again",
            self.ms
        )
    }
}

impl Recording {
    /// The recording, corrected by the confirmed part of its latency, and this part, s. Stamps
    /// later than those of any camera are kept and returned as an error.
    pub fn without_latency(self) -> (Self, Result<Option<f64>, LateStamps>) {
        match self.confirmed_latency() {
            None => (self, Ok(None)),
            Some((seconds, unsure_s)) if seconds > LATEST_S + unsure_s => {
                (self, Err(LateStamps { ms: 1e3 * seconds }))
            }
            Some((seconds, _)) => {
                let seconds = seconds.min(LATEST_S);
                (self.shifted(seconds), Ok(Some(seconds)))
            }
        }
    }

    /// The same as a result, which fails for stamps later than those of any camera.
    pub fn aligned(self) -> Result<(Self, Option<f64>), LateStamps> {
        let (recording, latency) = self.without_latency();
        Ok((recording, latency?))
    }

    /// The latency and its tolerance, s. `None` if a motor always reverses at the same two
    /// positions, where latency looks like a wider loop, and if rows held out do not confirm it.
    fn confirmed_latency(&self) -> Option<(f64, f64)> {
        let limits = limits_of_path(&Series::whole(self));
        let hides_plane = Finding::hides_plane;
        let shows = |it: &Finding| hides_plane(it) || matches!(it, Finding::LargeLoops { .. });
        if !limits.iter().all(shows) {
            return None;
        }
        let near = self.latency().filter(|found| found.seconds >= MIN_LATENCY_S)?.seconds;
        let (seconds, deviation_s) = held_out_latency(self, near, !limits.iter().any(hides_plane))?;
        let unsure_s = DEVIATIONS * deviation_s;
        (unsure_s <= UNSURE_S && seconds >= MIN_LATENCY_S).then_some((seconds, unsure_s))
    }
}

/// Latency near an estimate, and its deviation, s; `None` if held-out rows do not confirm it.
fn held_out_latency(recording: &Recording, near: f64, plane: bool) -> Option<(f64, f64)> {
    let (mut found, mut deviation_s) = (near, 0.0);
    let mut family: Option<FamilyParameters> = None;
    for _ in 0..ROUNDS {
        let shifted = recording.shifted(found);
        let every = shifted.rows().len().div_ceil(MAX_ROWS);
        let rows: Vec<usize> = (0..shifted.rows().len()).step_by(every).collect();
        let start = match &family {
            Some(FamilyParameters::ForceBalance { balance, .. }) => Start::Known(balance),
            _ => Start::Typical,
        };
        let fit = fit_force_balance(&Series::new(&shifted, &rows), plane, start, &Silent).ok()?;
        let late = fit.latency?;
        found += late.seconds.clamp(-FURTHEST_S, FURTHEST_S);
        (deviation_s, family) = (late.deviation_s, Some(fit.family));
    }
    let split = Split::new(recording, HoldOut::Blocks).ok()?;
    let line = |row: usize| recording.rows()[row].line;
    let known = line(known_from(recording).min(recording.rows().len() - 1));
    let blocks = split.blocks().iter().map(|block| line(block.start)..line(block.end));
    let blocks: Vec<_> = blocks.filter(|block| block.start >= known).collect();
    let left = |shift: f64, known: Option<&FamilyParameters>| {
        let shifted = recording.shifted(shift);
        let rows = 0..shifted.rows().len();
        let is_held_out =
            |row: &usize| blocks.iter().any(|block| block.contains(&shifted.rows()[*row].line));
        let every = rows.len().div_ceil(MAX_ROWS);
        let training = rows.clone().filter(|row| !is_held_out(row)).step_by(every).collect();
        let model = balance_of(&shifted, training, known)?;
        let held_out: Vec<usize> = rows.filter(is_held_out).collect();
        let parts = by_motion(&shifted, &held_out);
        Some(block_errors(&predictions(&model, &shifted), &shifted, &parts))
    };
    // Each from its own optimum: parameters found with a latency would not fit without.
    let (with, without) = (left(found, family.as_ref())?, left(0.0, None)?);
    // Of a motor that never moves in a direction there is no error.
    let helps = with.iter().zip(&without).all(|(with, without)| with < without || with.is_nan());
    (helps && (found - near).abs() <= FURTHEST_S).then_some((found, deviation_s))
}

/// Rows by the motor that moves most of its range there, and by its direction: a gap or friction
/// looks like latency, but not the same with every motor and in both directions.
fn by_motion(recording: &Recording, rows: &[usize]) -> Vec<Vec<usize>> {
    let all = recording.rows();
    let limits = [0, 1].map(|motor| min_max(all.iter().map(|row| row.counts[motor])));
    let ranges = limits.map(|(low, high)| (high - low).max(1.0));
    let mut parts = vec![Vec::new(); 2 * recording.motors()];
    for row in rows {
        let (before, after) = (&all[row.saturating_sub(1)], &all[(row + 1).min(all.len() - 1)]);
        let moved = [0, 1].map(|at| (after.counts[at] - before.counts[at]) / ranges[at]);
        let motor = usize::from(moved[1].abs() > moved[0].abs());
        if moved[motor] != 0.0 {
            parts[2 * motor + usize::from(moved[motor] > 0.0)].push(*row);
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_contains, assert_near, noise, one_motor, wander};

    /// A snake of one motor with a gap, whose tip creeps after the motor with a time constant.
    fn creeping(counts: impl Fn(f64) -> f64, constant_s: f64) -> Recording {
        let (mut played, mut tip) = (0.0_f64, 0.0);
        one_motor(1500, |time| {
            let at = counts(time);
            played = played.clamp(at - 40.0, at + 40.0);
            tip += (played - tip) * (0.2 / constant_s).min(1.0);
            (at, 0.02 * tip)
        })
    }

    #[test]
    fn hysteresis_and_creep_are_not_latency() {
        let strokes = |time: f64| 300.0 * (0.7 * time + 0.9 * (0.11 * time).sin()).sin();
        let many = |time: f64| wander(time)[0];
        assert_eq!(creeping(strokes, 0.5).without_latency().1, Ok(None));
        assert_eq!(creeping(many, 0.6).without_latency().1, Ok(None));
    }

    #[test]
    fn latency_corrected_at_60_ms_but_not_at_250_ms() {
        let late_by = |seconds: f64| {
            let (mut random, at) = (noise(2), |time| wander(time)[0]);
            one_motor(1000, |time| (at(time), 0.02 * at(time - seconds) + 0.02 * random()))
        };
        let taken_off = |seconds: f64| late_by(seconds).aligned().unwrap().1.unwrap_or_default();
        assert_near(taken_off(0.0), 0.0, 0.004);
        assert_near(taken_off(0.06), 0.06, 0.01);
        // No camera has this latency: it is refused, and not subtracted.
        let (kept, refused) = late_by(0.25).without_latency();
        assert_eq!(kept.rows(), late_by(0.25).rows());
        let refused = refused.unwrap_err();
        assert_contains(&refused.kept(), &[" ms late", "the stamps are kept"]);
        assert_contains(&refused, &["at the exposure", "--latency-ms 0 keeps"]);
        assert_near(refused.ms, 250.0, 5.0);
    }
}
