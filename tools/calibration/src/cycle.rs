//! Where the last cycle of a repeating motion begins.

use std::f64::consts::TAU;

use crate::motion::{circulation, counts, range, turns};
use crate::recording::Recording;

/// Cycles that a motion needs, so that at least about one is left when the last is taken away. A little less than two,
/// because a recording often stops just before it closes.
const LEAST_CYCLES: f64 = 1.9;

/// How far a motor has to go beyond the middle of its range to count as across, as a part of its range.
const CROSSING_PART: f64 = 0.1;

/// How far the length of a cycle may be from the usual one, as a part of it, in a motion that repeats.
const IRREGULARITY: f64 = 0.25;

/// The last cycle of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cycle {
    /// Index of its first row.
    pub start: usize,
    /// Cycles in the whole recording.
    pub cycles: f64,
}

/// The last cycle: one turn before the end where the motors go round, one period before the end where a motor comes and
/// goes regularly. `None` when the motion has no cycles or fewer than about two.
pub(crate) fn last_cycle(recording: &Recording) -> Option<Cycle> {
    let round = || circulation(recording).and_then(|phases| last_turn(&phases));
    round().or_else(|| (0..recording.motors()).find_map(|motor| last_period(recording, motor)))
}

fn last_turn(phases: &[f64]) -> Option<Cycle> {
    let cycles = turns(phases);
    let end = phases.last()?;
    let start = phases.iter().rposition(|phase| (end - phase).abs() > TAU)? + 1;
    (cycles >= LEAST_CYCLES).then_some(Cycle { start, cycles })
}

fn last_period(recording: &Recording, motor: usize) -> Option<Cycle> {
    let rows = recording.rows();
    // Without time stamps the rows themselves are the clock.
    let clock: Vec<f64> = rows.iter().enumerate().map(|(index, row)| row.time_s.unwrap_or(index as f64)).collect();
    let crossings = upward_crossings(counts(recording, motor));
    let mut periods: Vec<f64> = crossings.windows(2).map(|pair| clock[pair[1]] - clock[pair[0]]).collect();
    periods.sort_by(f64::total_cmp);
    let usual = *periods.get(periods.len() / 2)?;
    let regular = periods.iter().all(|period| (period - usual).abs() <= IRREGULARITY * usual);
    let (first, last) = (clock.first()?, clock.last()?);
    let cycles = (last - first) / usual;
    let start = clock.iter().rposition(|time| *time <= last - usual)? + 1;
    (regular && cycles >= LEAST_CYCLES).then_some(Cycle { start, cycles })
}

/// Where the counts come up through the middle of their range, having been well below, and go on to well above.
fn upward_crossings(counts: impl Iterator<Item = f64> + Clone) -> Vec<usize> {
    let (low, high) = range(counts.clone());
    let (middle, band) = (0.5 * (low + high), CROSSING_PART * (high - low));
    let mut crossings = Vec::new();
    let mut below = false;
    let mut crossing = None;
    for (index, count) in counts.enumerate() {
        if count < middle - band {
            (below, crossing) = (true, None);
        } else if below && count >= middle {
            let at = *crossing.get_or_insert(index);
            if count > middle + band {
                crossings.push(at);
                (below, crossing) = (false, None);
            }
        }
    }
    crossings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{one_motor, recording, straight};

    #[test]
    fn the_last_turn_of_a_circle_is_found() {
        // 4 turns of 12.57 s; a row every 0.2 s.
        let circle = recording(251, |time| {
            let counts = [350.0 * (0.5 * time).cos(), 350.0 * (0.5 * time).sin()];
            (counts, straight(counts))
        });
        let Cycle { start, cycles } = last_cycle(&circle).unwrap();
        assert!((cycles - 50.0 * 0.5 / TAU).abs() < 0.01, "{cycles}");
        assert_eq!(start, 251 - 63);
    }

    #[test]
    fn the_last_period_of_a_triangle_is_found() {
        let triangle = one_motor(200, |time| {
            let phase = (time / 10.0).fract();
            (1000.0 * (0.5 - (phase - 0.5).abs()), phase)
        });
        let Cycle { start, cycles } = last_cycle(&triangle).unwrap();
        assert!((cycles - 3.98).abs() < 0.03, "{cycles}");
        assert!((149..=151).contains(&start), "{start}");
    }

    #[test]
    fn irregular_or_short_motion_has_no_cycles() {
        let growing = one_motor(300, |time| ((0.02 * time * time).sin() * 500.0, time));
        assert_eq!(last_cycle(&growing), None);
        let once = one_motor(100, |time| ((0.4 * time).sin() * 500.0, time));
        assert_eq!(last_cycle(&once), None);
        let ramp = one_motor(100, |time| (time, time));
        assert_eq!(last_cycle(&ramp), None);
    }

    #[test]
    fn jitter_in_the_middle_is_one_crossing() {
        let counts = [-10.0, -1.0, 0.5, -0.5, 0.7, 10.0, -10.0, 3.0, -10.0, 10.0];
        assert_eq!(upward_crossings(counts.into_iter()), [2, 7, 9]);
    }
}
