//! Targets to follow: distance and lag of the snake.
//!
//! The lag is where the cross-correlation of target and snake, of both axes together, is largest.

use i2ris::ipc::payload::ReachTarget;
use i2ris_report::statistics::{TimeSeries, mean, root_mean_square, variance};
use serde::Serialize;

use super::trial::{Followed, Trial, distance};

/// Grid of the correlation, ns.
const STEP_NS: u64 = 10_000_000;
/// Lags that are searched: a person lags, and may anticipate a little.
const LAGS: std::ops::RangeInclusive<i64> = -50..=150;
/// Samples further apart are not interpolated, ns.
const GAP_NS: u64 = 200_000_000;
/// A target that moves less than this rests, deg.
const RESTS_DEG: f64 = 0.02;
/// Minimum correlation: below, the target was not followed.
const MIN_CORRELATION: f64 = 0.5;

/// Score of a target to follow. The run-in does not count.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pursuit {
    /// Source of the snake's pose: `camera` or `estimate`.
    pub by: &'static str,
    pub t_s: f64,
    pub length_s: f64,
    /// Whether the target moved; one at rest was to be held.
    pub moves: bool,
    /// Distance from the target, root mean square, degrees.
    pub rms_deg: f64,
    /// Lag of the snake, seconds; `None`: the target rested, or was not followed.
    pub lag_s: Option<f64>,
    /// RMS distance from the target's position one lag earlier, degrees.
    pub rms_without_lag_deg: Option<f64>,
}

impl Pursuit {
    pub fn line(&self) -> String {
        let Self { by, length_s, rms_deg, .. } = self;
        let what = if self.moves { "pursuit" } else { "held still" };
        let late = match (self.moves, self.lag_s, self.rms_without_lag_deg) {
            (true, Some(lag_s), Some(rms_deg)) => {
                format!("; {lag_s:.2} s late, {rms_deg:.2} deg without the lag")
            }
            (true, ..) => "; no lag: the target was not followed".to_owned(),
            (false, ..) => String::new(),
        };
        format!(
            "{what} for {length_s:.0} s: {rms_deg:.2} deg (RMS) from the target by the {by}{late}"
        )
    }
}

/// Scores every target to follow for which the snake was observed.
pub fn pursuits(trial: &Trial) -> Vec<Pursuit> {
    let (by, snake) = trial.observed();
    { trial.followed.iter() }.filter_map(|followed| pursuit(trial, followed, by, snake)).collect()
}

fn pursuit(
    trial: &Trial,
    followed: &Followed,
    by: &'static str,
    snake: &TimeSeries<2>,
) -> Option<Pursuit> {
    let ReachTarget { shown_ns, stamp_ns, .. } = followed.last;
    let from_ns = shown_ns + ReachTarget::RUN_IN_NS;
    let counts = |stamp: u64| (from_ns..=stamp_ns).contains(&stamp);
    let away = snake.iter().filter(|(stamp, _)| counts(*stamp)).filter_map(|(stamp, at)| {
        let target = followed.curve.value_at(*stamp, GAP_NS)?;
        Some(distance(*at, target))
    });
    let rms_deg = root_mean_square(away)?;
    let at = |stamp| Some((stamp, followed.curve.value_at(stamp, GAP_NS)?));
    let target: Vec<_> = (from_ns..stamp_ns).step_by(STEP_NS as usize).filter_map(at).collect();
    let moves = spread(target.iter().map(|(_, at)| *at)) > RESTS_DEG;
    let late = moves.then(|| lag(&target, snake)).flatten();
    Some(Pursuit {
        by,
        t_s: trial.seconds(shown_ns),
        length_s: stamp_ns.saturating_sub(shown_ns) as f64 * 1e-9,
        moves,
        rms_deg,
        lag_s: late.map(|(lag_s, _)| lag_s),
        rms_without_lag_deg: late.map(|(_, rms_deg)| rms_deg),
    })
}

/// Standard deviation of both axes together.
fn spread(places: impl Iterator<Item = [f64; 2]> + Clone) -> f64 {
    let of = |axis: usize| variance(places.clone().map(|at| at[axis]));
    (of(0).unwrap_or(0.0) + of(1).unwrap_or(0.0)).sqrt()
}

/// The lag in seconds, between the steps of the grid by a parabola; and the distance without it.
fn lag(target: &[(u64, [f64; 2])], snake: &TimeSeries<2>) -> Option<(f64, f64)> {
    let at = |lag: i64| -> Vec<([f64; 2], [f64; 2])> {
        let shifted = |stamp: u64| stamp.checked_add_signed(lag * STEP_NS.cast_signed());
        let pairs = target.iter().filter_map(|(stamp, target)| {
            Some((*target, snake.value_at(shifted(*stamp)?, GAP_NS)?))
        });
        pairs.collect()
    };
    let all: Vec<(i64, f64)> = LAGS.filter_map(|lag| Some((lag, correlation(&at(lag))?))).collect();
    let best = (0..all.len()).max_by(|a, b| all[*a].1.total_cmp(&all[*b].1))?;
    let (lag, most) = all[best];
    let (before, after) = (all.get(best.checked_sub(1)?)?.1, all.get(best + 1)?.1);
    if most < MIN_CORRELATION {
        return None;
    }
    let bend = before - 2.0 * most + after;
    let offset = if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    let away = at(lag).into_iter().map(|(a, b)| distance(a, b));
    Some(((lag as f64 + offset) * STEP_NS as f64 * 1e-9, root_mean_square(away)?))
}

fn correlation(pairs: &[([f64; 2], [f64; 2])]) -> Option<f64> {
    let (mut product, mut squares) = (0.0, [0.0; 2]);
    for axis in 0..2 {
        let first = mean(pairs.iter().map(|(first, _)| first[axis]))?;
        let second = mean(pairs.iter().map(|(_, second)| second[axis]))?;
        for (a, b) in pairs {
            let (a, b) = (a[axis] - first, b[axis] - second);
            product += a * b;
            squares[0] += a * a;
            squares[1] += b * b;
        }
    }
    let size = (squares[0] * squares[1]).sqrt();
    (size > 0.0).then(|| product / size)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A target on a curve for 20 s, and a snake that lags by `lag_s` and is off by `offset`.
    fn followed(lag_s: f64, offset: f64, swing: f64) -> Pursuit {
        let curve = |t: f64| [swing * (0.9 * t).sin(), swing * (1.7 * t + 1.0).sin()];
        let mut trial = Trial::default();
        for ms in (0..20_000_u64).step_by(10) {
            let t_s = ms as f64 * 1e-3;
            let [pitch, yaw] = curve(t_s).map(f64::to_radians);
            let ended = if ms == 19_990 { ReachTarget::ENDED } else { 0 };
            trial.add_target(ReachTarget {
                stamp_ns: ms * 1_000_000 + 1,
                shown_ns: 1,
                position: [pitch, yaw, 0.0],
                flags: ReachTarget::FOLLOW | ended,
                ..ReachTarget::default()
            });
            // The camera's exposure is 4 ms after the target.
            let [pitch, yaw] = curve(t_s + 0.004 - lag_s);
            trial.camera.push(ms * 1_000_000 + 4_000_001, [pitch + offset, yaw]);
        }
        let all = pursuits(&trial);
        let [pursuit] = all[..] else { panic!("{all:?}") };
        assert!(trial.targets.is_empty(), "no target to reach");
        pursuit
    }

    #[test]
    fn late_snake_has_a_lag_and_no_error_without_it() {
        for lag_s in [0.0, 0.123, 0.5] {
            let found = followed(lag_s, 0.0, 3.0);
            assert!((found.lag_s.unwrap() - lag_s).abs() < 2e-3, "{lag_s}: {found:?}");
            assert!(found.rms_without_lag_deg.unwrap() < 0.05, "{lag_s}: {found:?}");
            assert!(found.moves && found.by == "camera");
            assert!((found.rms_deg > 0.3) == (lag_s > 0.1), "{found:?}");
        }
        assert!((followed(0.0, 0.4, 3.0).rms_deg - 0.4).abs() < 0.01);
    }

    #[test]
    fn a_target_that_rests_has_an_error_and_no_lag() {
        let found = followed(0.0, 0.3, 0.0);
        assert!((found.rms_deg - 0.3).abs() < 1e-6 && !found.moves && found.lag_s.is_none());
        let line = found.line();
        assert!(line.starts_with("held still for 20 s: 0.30 deg (RMS)"), "{line}");
    }

    #[test]
    fn motionless_snake_has_no_lag() {
        let mut trial = Trial::default();
        for ms in (0..20_000_u64).step_by(10) {
            trial.add_target(ReachTarget {
                stamp_ns: ms * 1_000_000,
                position: [(ms as f64 * 1e-3).sin(), 0.0, 0.0],
                flags: ReachTarget::FOLLOW,
                ..ReachTarget::default()
            });
            trial.camera.push(ms * 1_000_000, [1.0, 1.0]);
        }
        let found = pursuits(&trial)[0];
        assert_eq!(found.lag_s, None);
        assert!(found.line().ends_with("was not followed"), "{}", found.line());
    }
}
