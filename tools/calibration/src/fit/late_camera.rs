//! Latency of a camera's stamps, as far as held-out rows confirm it.
//!
//! The estimate of [`crate::quality::latency`] represents hysteresis by plays only; any other delay
//! of a snake looks like a late camera. So a force-balance model is fitted from that estimate, with
//! the latency as an additional parameter ([`crate::families::force_balance::latency`]), and it
//! must explain held-out rows better than without the latency.

use i2ris::model::file::FamilyParameters;

use super::all_families::balance_of;
use super::evidence::{block_errors, known_from, rms};
use super::metrics::predictions;
use super::split::{HoldOut, Split};
use crate::families::force_balance::search::fit_force_balance;
use crate::progress::Silent;
use crate::quality::latency::Latency;
use crate::quality::{Finding, limits_of_path};
use crate::recording::Recording;
use crate::series::Series;

/// Maximum latency of a camera: one 30 Hz frame of exposure, one of transfer and one of processing.
/// A larger delay is in the snake.
const LATEST_S: f64 = 0.1;

/// Minimum latency: hysteresis outside all families looks like as much. On emulated snakes of eight
/// physics without latency the estimate was up to 15 ms.
const MIN_LATENCY_S: f64 = 0.015;

/// Tolerance of an estimate, in standard deviations.
const DEVIATIONS: f64 = 2.0;

/// Maximum uncertainty of a camera latency: it is the same on every part of a recording.
const UNSURE_S: f64 = 0.01;

/// Number of fits, each to the recording corrected by the previous one.
const ROUNDS: usize = 2;

/// Maximum error of the initial estimate.
const FURTHEST_S: f64 = 0.03;

/// Maximum number of rows; more hardly improve the result.
const MAX_ROWS: usize = 1500;

impl Recording {
    /// The recording, corrected by the confirmed part of its latency, and that part, s.
    #[must_use]
    pub fn without_latency(self) -> (Self, Option<f64>) {
        match self.confirmed_latency() {
            Some(seconds) => (self.shifted(seconds), Some(seconds)),
            None => (self, None),
        }
    }

    /// Returns `None` if a motor always reverses at the same two positions, where latency looks
    /// like a wider loop; if no camera can have the latency; and if held-out rows do not confirm
    /// it.
    fn confirmed_latency(&self) -> Option<f64> {
        let limits = limits_of_path(&Series::whole(self));
        let hides_plane = Finding::hides_plane;
        let shows = |it: &Finding| hides_plane(it) || matches!(it, Finding::LargeLoops { .. });
        if !limits.iter().all(shows) {
            return None;
        }
        let Latency { seconds, deviation_s, .. } = self.latency()?;
        if seconds < MIN_LATENCY_S || seconds - DEVIATIONS * deviation_s > LATEST_S {
            return None;
        }
        let (seconds, deviation_s) =
            held_out_latency(self, seconds, !limits.iter().any(hides_plane))?;
        let unsure_s = DEVIATIONS * deviation_s;
        let possible = MIN_LATENCY_S..=LATEST_S + unsure_s;
        let is_camera = unsure_s <= UNSURE_S && possible.contains(&seconds);
        is_camera.then_some(seconds.min(LATEST_S))
    }
}

/// The latency of a recording, near an estimate, and its standard deviation, s; `None` if the
/// held-out rows are not explained better with it.
fn held_out_latency(recording: &Recording, near: f64, plane: bool) -> Option<(f64, f64)> {
    let (mut found, mut deviation_s) = (near, 0.0);
    let mut family: Option<FamilyParameters> = None;
    for _ in 0..ROUNDS {
        let shifted = recording.shifted(found);
        let every = shifted.rows().len().div_ceil(MAX_ROWS);
        let rows: Vec<usize> = (0..shifted.rows().len()).step_by(every).collect();
        let known = match &family {
            Some(FamilyParameters::ForceBalance { balance, .. }) => Some(balance),
            _ => None,
        };
        let fit = fit_force_balance(&Series::new(&shifted, &rows), plane, known, &Silent).ok()?;
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
        let rows = || 0..shifted.rows().len();
        let of = |row: &usize| shifted.rows()[*row].line;
        let every = rows().len().div_ceil(MAX_ROWS);
        let is_seen = |row: &usize| !blocks.iter().any(|block| block.contains(&of(row)));
        let training = rows().filter(is_seen).step_by(every).collect();
        let model = balance_of(&shifted, training, known)?;
        let held_out = blocks.iter().map(|block| rows().filter(|row| block.contains(&of(row))));
        let held_out: Vec<Vec<usize>> = held_out.map(Iterator::collect).collect();
        Some(block_errors(&predictions(&model, &shifted), &shifted, &held_out))
    };
    // Each from its own optimum: parameters found with a latency would not fit without.
    let helps = rms(&left(found, family.as_ref())?) < rms(&left(0.0, None)?);
    (helps && (found - near).abs() <= FURTHEST_S).then_some((found, deviation_s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_near, one_motor, recording, straight, wander};

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
        for recording in [creeping(strokes, 0.5), creeping(many, 0.6)] {
            assert_eq!(recording.without_latency().1, None);
        }
    }

    #[test]
    fn latency_corrected_at_60_ms_but_not_at_250_ms() {
        let taken_off = |seconds: f64| {
            let snake = recording(1000, |time| (wander(time), straight(wander(time - seconds))));
            snake.without_latency().1.unwrap_or_default()
        };
        assert_near(taken_off(0.0), 0.0, 0.004);
        assert_near(taken_off(0.06), 0.06, 0.01);
        // No camera has this latency: the delay is in the snake.
        assert_near(taken_off(0.25), 0.0, 0.0);
    }
}
