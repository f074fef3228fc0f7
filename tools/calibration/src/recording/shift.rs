//! Outputs whose stamps are late, brought to the counts of their true instant.

use i2ris::units::MotorVec;

use super::{Position, Recording, Row};
use crate::latency::{Latency, Place, Seen, estimate};

/// Positions further apart than this many times the usual are a gap, and nothing is put between
/// them.
const GAP: f64 = 5.0;

impl Recording {
    /// How late the outputs are stamped against the counts; `None` without time stamps and where
    /// the motion does not tell, see [`estimate`].
    #[must_use]
    pub fn latency(&self) -> Option<Latency> {
        let path: Option<Vec<Place>> = self
            .path
            .iter()
            .map(|at| {
                Some(Place {
                    time_s: at.time_s?,
                    counts: at.counts,
                })
            })
            .collect();
        let seen: Option<Vec<Seen>> = self
            .rows
            .iter()
            .map(|row| {
                Some(Seen {
                    time_s: row.time_s?,
                    outputs: row.outputs,
                })
            })
            .collect();
        estimate(&path?, &seen?, self.motors)
    }

    /// The recording with all outputs `seconds` earlier, at the counts that the motors had then.
    /// Rows that leave the recording or come into a gap are left out; a recording without time
    /// stamps stays as it is.
    #[must_use]
    pub fn shifted(&self, seconds: f64) -> Self {
        let Some(timed) = self
            .path
            .iter()
            .map(|at| Some((at.time_s?, at.counts)))
            .collect::<Option<Vec<_>>>()
        else {
            return self.clone();
        };
        let gap = GAP * usual_step(&timed);
        let moved = self.rows.iter().filter_map(|row| {
            let time_s = row.time_s? - seconds;
            Some(Row {
                time_s: Some(time_s),
                counts: counts_at(&timed, time_s, gap)?,
                ..*row
            })
        });
        let (mut path, mut rows) = (
            Vec::with_capacity(2 * self.path.len()),
            Vec::with_capacity(self.rows.len()),
        );
        let mut old = self.path.iter().peekable();
        for row in moved {
            while let Some(position) = old.next_if(|position| position.time_s <= row.time_s) {
                path.push(*position);
            }
            if path
                .last()
                .is_none_or(|last: &Position| last.time_s != row.time_s)
            {
                path.push(Position {
                    line: row.line,
                    time_s: row.time_s,
                    counts: row.counts,
                });
            }
            rows.push(Row {
                place: path.len() - 1,
                ..row
            });
        }
        path.extend(old);
        Self {
            path,
            rows,
            ..self.clone()
        }
    }
}

/// The median time between two positions, s.
fn usual_step(path: &[(f64, MotorVec)]) -> f64 {
    let mut steps: Vec<f64> = path.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or_default()
}

/// The counts at an instant, on the straight line between two positions of a path in order of time
/// (s, counts); `None` beyond its ends and where those two lie more than `gap_s` apart.
#[must_use]
pub fn counts_at(path: &[(f64, MotorVec)], time_s: f64, gap_s: f64) -> Option<MotorVec> {
    let after = path.partition_point(|(time, _)| *time < time_s);
    let (t1, b) = path.get(after)?;
    if *t1 == time_s {
        return Some(*b);
    }
    let (t0, a) = path.get(after.checked_sub(1)?)?;
    let share = (time_s - t0) / (t1 - t0);
    (t1 - t0 <= gap_s)
        .then(|| std::array::from_fn(|motor| a[motor] + share * (b[motor] - a[motor])))
}

#[cfg(test)]
mod tests {
    use crate::testing::{recording, straight, wander};

    #[test]
    fn a_late_camera_is_found_and_brought_back() {
        let late = recording(1500, |time| (wander(time), straight(wander(time - 0.15))));
        let found = late.latency().unwrap();
        assert!((found.seconds - 0.15).abs() < 0.02, "{found:?}");
        let aligned = late.shifted(0.15);
        assert!(aligned.rows().len() >= 1498, "{}", aligned.rows().len());
        let error = |row: &crate::recording::Row| (row.outputs[0] - straight(row.counts)[0]).abs();
        let worst = aligned.rows().iter().map(error).fold(0.0, f64::max);
        let before = late.rows().iter().map(error).fold(0.0, f64::max);
        assert!(worst < 0.2 * before, "{worst} of {before}");
        for row in aligned.rows() {
            assert_eq!(aligned.path()[row.place].counts, row.counts);
        }
        assert!(
            aligned
                .path()
                .windows(2)
                .all(|pair| pair[0].time_s < pair[1].time_s)
        );
    }
}
