//! The cycles of a repeating motion.

use std::f64::consts::{PI, TAU};

use i2ris::units::MotorVec;
use i2ris_report::statistics::{median, min_max};

use crate::recording::{Recording, Row};

/// Minimum number of cycles, so that one is left: a recording often stops before it closes.
const MIN_CYCLES: f64 = 1.9;

/// Minimum travel beyond the middle for a crossing, as a part of the range.
const CROSSING_PART: f64 = 0.1;

/// Maximum relative deviation of the length of a cycle in a motion that repeats.
const IRREGULARITY: f64 = 0.25;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cycle {
    /// First row.
    pub start: usize,
    /// Cycles in the whole recording.
    pub cycles: f64,
}

/// The last cycle: one turn before the end if the motors circulate, one period before the end if a
/// motor oscillates regularly. `None` if the motion has no cycles or fewer than about two.
pub(crate) fn last_cycle(recording: &Recording) -> Option<Cycle> {
    let rhythm = rhythm(recording)?;
    Some(Cycle { start: rhythm.start(1.0)?, cycles: rhythm.cycles() })
}

/// Phase or time at every row, and its increase in one cycle.
struct Rhythm {
    progress: Vec<f64>,
    cycle: f64,
}

impl Rhythm {
    fn cycles(&self) -> f64 {
        let ends = self.progress.first().zip(self.progress.last());
        ends.map_or(0.0, |(first, last)| (last - first) / self.cycle)
    }

    /// The first row of the last `cycles` cycles.
    fn start(&self, cycles: f64) -> Option<usize> {
        let from = self.progress.last()? - cycles * self.cycle;
        let before = self.progress.iter().rposition(|progress| *progress <= from)?;
        Some(before + 1)
    }
}

fn rhythm(recording: &Recording) -> Option<Rhythm> {
    let around = circulation(recording).map(|mut progress| {
        if progress.last() < progress.first() {
            for phase in &mut progress {
                *phase = -*phase;
            }
        }
        Rhythm { progress, cycle: TAU }
    });
    let repeats = |rhythm: &Rhythm| rhythm.cycles() >= MIN_CYCLES;
    let back_and_forth = || (0..recording.motors()).find_map(|motor| periods(recording, motor));
    around.filter(repeats).or_else(|| back_and_forth().filter(repeats))
}

fn periods(recording: &Recording, motor: usize) -> Option<Rhythm> {
    let rows = recording.rows();
    // Without time stamps the row index is the time.
    let time = |(index, row): (usize, &Row)| row.time_s.unwrap_or(index as f64);
    let progress: Vec<f64> = rows.iter().enumerate().map(time).collect();
    let counts: Vec<f64> = rows.iter().map(|row| row.counts[motor]).collect();
    let crossings = upward_crossings(&counts);
    let periods = crossings.windows(2).map(|pair| progress[pair[1]] - progress[pair[0]]);
    let mut periods: Vec<f64> = periods.collect();
    let cycle = median(&mut periods)?;
    let regular = |period: &f64| (period - cycle).abs() <= IRREGULARITY * cycle;
    periods.iter().all(regular).then_some(Rhythm { progress, cycle })
}

/// Indices at which the counts rise through the middle, from well below to well above.
fn upward_crossings(counts: &[f64]) -> Vec<usize> {
    let (low, high) = min_max(counts.iter().copied());
    let (middle, band) = (0.5 * (low + high), CROSSING_PART * (high - low));
    let mut crossings = Vec::new();
    let mut below = false;
    let mut crossing = None;
    for (index, count) in counts.iter().copied().enumerate() {
        if count < middle - band {
            (below, crossing) = (true, None);
        } else if below && count >= middle {
            let first = *crossing.get_or_insert(index);
            if count > middle + band {
                crossings.push(first);
                (below, crossing) = (false, None);
            }
        }
    }
    crossings
}

/// Minimum turns of a circulation, and their net over their total: about 0 to and fro.
const MIN_TURNS: f64 = 0.75;
const MIN_STEADINESS: f64 = 0.8;

/// Rows closer to the centre than this part of the half range have no meaningful direction.
const CENTRE_PART: f64 = 0.3;

/// The phase of every row, rad, unwrapped, when the motors circulate: they go around one closed
/// curve in one direction, as on a circle. Every position is then always reached from the same
/// side, and a lag by hysteresis looks the same as a shift in phase.
fn circulation(recording: &Recording) -> Option<Vec<f64>> {
    let counts: Vec<MotorVec> = recording.rows().iter().map(|row| row.counts).collect();
    (recording.motors() >= 2).then(|| circles(&counts)).flatten()
}

/// The phase of every position of two motors, rad, unwrapped, when they circulate.
pub(crate) fn circles(path: &[MotorVec]) -> Option<Vec<f64>> {
    let axes = [0, 1].map(|motor| {
        let (low, high) = min_max(path.iter().map(|counts| counts[motor]));
        (0.5 * (low + high), 0.5 * (high - low))
    });
    let scaled =
        |counts: &MotorVec| [0, 1].map(|motor| (counts[motor] - axes[motor].0) / axes[motor].1);
    let points: Vec<[f64; 2]> = path.iter().map(scaled).collect();
    let central = points.iter().filter(|[x, y]| x.hypot(*y) < CENTRE_PART);
    if central.count() * 20 > points.len() {
        return None;
    }
    let phases = unwrapped(points.iter().map(|[x, y]| y.atan2(*x)));
    let total: f64 = phases.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
    let net = turns(&phases);
    (net >= MIN_TURNS && net * TAU >= MIN_STEADINESS * total).then_some(phases)
}

/// Turns between the first and the last phase.
pub(crate) fn turns(phases: &[f64]) -> f64 {
    let ends = phases.first().zip(phases.last());
    ends.map_or(0.0, |(first, last)| (last - first).abs() / TAU)
}

fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut last: Option<f64> = None;
    let unwrap = |angle: f64| {
        let unwrapped = last.map_or(angle, |last| last + (angle - last + PI).rem_euclid(TAU) - PI);
        last = Some(unwrapped);
        unwrapped
    };
    angles.map(unwrap).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_near, circle, one_motor, recording, straight, wandering};

    #[test]
    fn the_last_turn_of_a_circle_is_found() {
        // 4 turns of 12.57 s; a row every 0.2 s.
        let found = last_cycle(&circle(251)).unwrap();
        assert_near(found.cycles, 50.0 * 0.5 / TAU, 0.01);
        assert_eq!(found.start, 251 - 63);
    }

    #[test]
    fn the_periods_of_a_triangle_are_found() {
        let triangle = one_motor(200, |time| {
            let phase = (time / 10.0).fract();
            (1000.0 * (0.5 - (phase - 0.5).abs()), phase)
        });
        let last = last_cycle(&triangle).unwrap();
        assert_near(last.cycles, 3.98, 0.03);
        assert!((149..=151).contains(&last.start), "{last:?}");
    }

    #[test]
    fn irregular_or_short_motion_has_no_cycles() {
        let growing = |time: f64| (0.02 * time * time).sin() * 500.0;
        let once = |time: f64| (0.4 * time).sin() * 500.0;
        let motions: [(usize, &dyn Fn(f64) -> f64); 3] =
            [(300, &growing), (100, &once), (100, &|time| time)];
        for (rows, counts) in motions {
            assert_eq!(last_cycle(&one_motor(rows, |time| (counts(time), time))), None);
        }
    }

    #[test]
    fn jitter_in_the_middle_is_one_crossing() {
        let counts = [-10.0, -1.0, 0.5, -0.5, 0.7, 10.0, -10.0, 3.0, -10.0, 10.0];
        assert_eq!(upward_crossings(&counts), [2, 7, 9]);
    }

    fn motion(rows: usize, counts: impl Fn(f64) -> [f64; 2]) -> Recording {
        recording(rows, |time| (counts(time), straight(counts(time))))
    }

    #[test]
    fn circles_circulate_but_motion_to_and_fro_does_not() {
        let circle = motion(200, |time| {
            let jitter = 3.0 * (17.0 * time).sin();
            let (sin, cos) = (0.5 * time).sin_cos();
            [350.0 * cos + jitter, 40.0 + 350.0 * sin - jitter]
        });
        assert_near(turns(&circulation(&circle).unwrap()), 3.17, 0.05);
        let both_directions = motion(200, |time| {
            let phase = if time < 20.0 { 0.5 * time } else { 20.0 - 0.5 * time };
            [350.0 * phase.cos(), 350.0 * phase.sin()]
        });
        assert_eq!(circulation(&both_directions), None);
        assert_eq!(circulation(&wandering(300)), None);
    }

    #[test]
    fn phases_do_not_jump() {
        let phase = |i: u32| (0.3 * f64::from(i)).sin_cos();
        let phases = unwrapped((0..100).map(phase).map(|(sin, cos)| sin.atan2(cos)));
        for pair in phases.windows(2) {
            assert_near(pair[1] - pair[0], 0.3, 1e-9);
        }
    }
}
