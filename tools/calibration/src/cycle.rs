//! Where the cycles of a repeating motion begin.

use std::f64::consts::TAU;

use crate::motion::{circulation, counts, range};
use crate::recording::Recording;

/// Cycles that a motion needs, so that at least about one is left when the last is taken away. A
/// little less than two, because a recording often stops just before it closes.
const LEAST_CYCLES: f64 = 1.9;

/// How far a motor has to go beyond the middle of its range to count as across, as a part of its
/// range.
const CROSSING_PART: f64 = 0.1;

/// How far the length of a cycle may be from the usual one, as a part of it, in a motion that
/// repeats.
const IRREGULARITY: f64 = 0.25;

/// The last cycle of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cycle {
    /// Index of its first row.
    pub start: usize,
    /// Cycles in the whole recording.
    pub cycles: f64,
}

/// The last cycle: one turn before the end where the motors go round, one period before the end
/// where a motor comes and goes regularly. `None` when the motion has no cycles or fewer than about
/// two.
pub(crate) fn last_cycle(recording: &Recording) -> Option<Cycle> {
    let rhythm = rhythm(recording)?;
    Some(Cycle {
        start: rhythm.start(1.0)?,
        cycles: rhythm.cycles(),
    })
}

/// Where every whole cycle begins, counted back from the end, in order; nothing where there are no
/// cycles.
pub(crate) fn starts(recording: &Recording) -> Vec<usize> {
    let Some(rhythm) = rhythm(recording) else {
        return Vec::new();
    };
    // The first one may lack a little.
    let whole = (rhythm.cycles() + 0.1).floor() as u32;
    (1..=whole)
        .rev()
        .map(|back| rhythm.start(f64::from(back)).unwrap_or_default())
        .collect()
}

/// How far the motion has come at every row, and how far that is in one cycle.
struct Rhythm {
    progress: Vec<f64>,
    cycle: f64,
}

impl Rhythm {
    fn cycles(&self) -> f64 {
        self.progress
            .first()
            .zip(self.progress.last())
            .map_or(0.0, |(first, last)| (last - first) / self.cycle)
    }

    /// The first row of the last so many cycles.
    fn start(&self, cycles: f64) -> Option<usize> {
        let from = self.progress.last()? - cycles * self.cycle;
        Some(
            self.progress
                .iter()
                .rposition(|progress| *progress <= from)?
                + 1,
        )
    }
}

fn rhythm(recording: &Recording) -> Option<Rhythm> {
    let round = circulation(recording).map(|phases| {
        let backwards = phases
            .first()
            .zip(phases.last())
            .is_some_and(|(first, last)| last < first);
        let progress = phases
            .iter()
            .map(|phase| if backwards { -phase } else { *phase })
            .collect();
        Rhythm {
            progress,
            cycle: TAU,
        }
    });
    let to_and_fro = || (0..recording.motors()).find_map(|motor| periods(recording, motor));
    round
        .filter(Rhythm::repeats)
        .or_else(|| to_and_fro().filter(Rhythm::repeats))
}

impl Rhythm {
    fn repeats(&self) -> bool {
        self.cycles() >= LEAST_CYCLES
    }
}

fn periods(recording: &Recording, motor: usize) -> Option<Rhythm> {
    let rows = recording.rows();
    // Without time stamps the rows themselves are the clock.
    let progress: Vec<f64> = rows
        .iter()
        .enumerate()
        .map(|(index, row)| row.time_s.unwrap_or(index as f64))
        .collect();
    let crossings = upward_crossings(counts(recording, motor));
    let mut periods: Vec<f64> = crossings
        .windows(2)
        .map(|pair| progress[pair[1]] - progress[pair[0]])
        .collect();
    periods.sort_by(f64::total_cmp);
    let cycle = *periods.get(periods.len() / 2)?;
    let regular = periods
        .iter()
        .all(|period| (period - cycle).abs() <= IRREGULARITY * cycle);
    regular.then_some(Rhythm { progress, cycle })
}

/// Where the counts come up through the middle of their range, having been well below, and go on to
/// well above.
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
    fn all_cycles_begin_one_after_the_other() {
        let triangle = one_motor(200, |time| {
            let phase = (time / 10.0).fract();
            (1000.0 * (0.5 - (phase - 0.5).abs()), phase)
        });
        let starts = starts(&triangle);
        assert!(starts.len() == 4 && starts[0] <= 1, "{starts:?}");
        assert!(
            starts
                .windows(2)
                .all(|pair| (49..=51).contains(&(pair[1] - pair[0]))),
            "{starts:?}"
        );
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
