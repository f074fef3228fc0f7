//! Whether a recording can tell hysteresis from the shape of the curve, judged by the way of the
//! motors alone.
//!
//! A **turning point** is where a motor turns back by more than a dead-band, so that play or
//! friction can show.

use std::fmt;

use crate::motion::{circles, range, turns};
use crate::series::Series;

/// A motor has turned back when it is this part of its range away from its turning point: noise and
/// jitter stay below.
const REVERSAL_PART: f64 = 0.02;

/// Turning points below which there is no loop to see.
const LEAST_TURNING_POINTS: usize = 2;

/// Turning points that lie within this part of the range are the same one.
const SAME_PART: f64 = 0.1;

/// Motors move together where the slower one does at least this part of what the faster one does.
const TOGETHER_PART: f64 = 0.1;

/// Least part of the way on which the motors have to move together to say something of the plane.
const LEAST_TOGETHER: f64 = 0.1;

/// What a recording cannot tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finding {
    /// A motor that hardly ever turns back.
    FewReversals {
        /// Counted from 0.
        motor: usize,
        /// How often it does.
        reversals: usize,
    },
    /// Both motors go round one closed curve in one direction, at one frequency.
    Circulation {
        /// How often they went round.
        turns: f64,
    },
    /// A motor always turns back at the same two places.
    OneLoop {
        /// Counted from 0.
        motor: usize,
    },
    /// The motors hardly ever move together.
    OneAxisAtATime {
        /// Part of the way on which they do, percent.
        percent: f64,
    },
}

impl Finding {
    /// Whether the recording cannot tell hysteresis at all: a model with memory would be made up,
    /// and one without is all that can be had from it. Otherwise such a model can be fitted, and is
    /// limited in the way that the sentence says.
    #[must_use]
    pub fn hides_hysteresis(&self) -> bool {
        matches!(self, Self::FewReversals { .. } | Self::Circulation { .. })
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FewReversals { motor, reversals } => write!(
                f,
                "motor {motor} turns back {reversals} time(s) only, so the recording cannot tell hysteresis from the shape \
                 of the curve; record motion with many reversals"
            ),
            Self::Circulation { turns } => write!(
                f,
                "both motors go round one closed curve in one direction ({turns:.2} turns), so every position is reached \
                 from one side only and hysteresis looks like a shift in phase: the recording cannot tell it from the shape \
                 of the curve; record motion with many reversals"
            ),
            Self::OneLoop { motor } => write!(
                f,
                "motor {motor} always turns back at the same two places, so the recording shows one loop and nothing of the \
                 smaller ones inside; record reversals of many sizes"
            ),
            Self::OneAxisAtATime { percent } => write!(
                f,
                "the motors move together on {percent:.0} % of the way only, so the recording says nothing of the plane \
                 between their axes; record motion of both at once"
            ),
        }
    }
}

/// What the path of a series cannot tell; nothing for one that can tell hysteresis. Where it cannot
/// tell any, lesser findings are left out.
#[must_use]
pub fn findings(series: &Series) -> Vec<Finding> {
    let motors = (0..series.motors()).filter_map(|motor| of_motor(series, motor));
    let all: Vec<Finding> = motors.chain(of_plane(series)).collect();
    let hidden = all.iter().any(Finding::hides_hysteresis);
    all.into_iter()
        .filter(|finding| finding.hides_hysteresis() || !hidden)
        .collect()
}

fn of_motor(series: &Series, motor: usize) -> Option<Finding> {
    let counts = || series.path().iter().map(|counts| counts[motor]);
    let (low, high) = range(counts());
    let points = turning_points(counts(), REVERSAL_PART * (high - low));
    if points.len() < LEAST_TURNING_POINTS {
        return Some(Finding::FewReversals {
            motor,
            reversals: points.len(),
        });
    }
    // Upper and lower turning points alternate.
    let narrow = |first: usize| {
        let (low_point, high_point) = range(points.iter().copied().skip(first).step_by(2));
        high_point - low_point <= SAME_PART * (high - low)
    };
    (narrow(0) && narrow(1)).then_some(Finding::OneLoop { motor })
}

fn of_plane(series: &Series) -> Option<Finding> {
    if series.motors() < 2 {
        return None;
    }
    if let Some(phases) = circles(series.path()) {
        return Some(Finding::Circulation {
            turns: turns(&phases),
        });
    }
    let spans = [0, 1].map(|motor| {
        let (low, high) = range(series.path().iter().map(|counts| counts[motor]));
        (high - low).max(f64::MIN_POSITIVE)
    });
    let (mut together, mut whole) = (0.0, 0.0);
    for pair in series.path().windows(2) {
        let [a, b] = [0, 1].map(|motor| (pair[1][motor] - pair[0][motor]).abs() / spans[motor]);
        let way = a.hypot(b);
        whole += way;
        together += if a.min(b) >= TOGETHER_PART * a.max(b) {
            way
        } else {
            0.0
        };
    }
    let finding = Finding::OneAxisAtATime {
        percent: 100.0 * together / whole,
    };
    (together < LEAST_TOGETHER * whole).then_some(finding)
}

/// Where a motor turns back by more than a band.
fn turning_points(counts: impl Iterator<Item = f64>, band: f64) -> Vec<f64> {
    let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut rising = None;
    let mut points = Vec::new();
    for count in counts {
        (lowest, highest) = (lowest.min(count), highest.max(count));
        let now = if count > lowest + band && rising != Some(true) {
            true
        } else if count < highest - band && rising != Some(false) {
            false
        } else {
            continue;
        };
        if rising.is_some() {
            points.push(if now { lowest } else { highest });
        }
        rising = Some(now);
        (lowest, highest) = (count, count);
    }
    points
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::recording::{ColumnMap, Recording};
    use crate::testing::{one_motor, recording, straight, wander};

    fn of(recording: &Recording) -> Vec<Finding> {
        findings(&Series::new(
            recording,
            &(0..recording.rows().len()).collect::<Vec<_>>(),
        ))
    }

    #[test]
    fn many_reversals_of_many_sizes_in_the_plane_tell_hysteresis() {
        assert_eq!(
            of(&recording(600, |time| (
                wander(time),
                straight(wander(time))
            ))),
            []
        );
    }

    #[test]
    fn a_motor_that_hardly_turns_back_hides_it() {
        let up = of(&one_motor(100, |time| {
            (100.0 * time + 10.0 * (9.0 * time).sin(), time)
        }));
        assert_eq!(
            up,
            [Finding::FewReversals {
                motor: 0,
                reversals: 0
            }]
        );
        assert!(
            up[0].hides_hysteresis()
                && up[0]
                    .to_string()
                    .contains("motor 0 turns back 0 time(s) only")
        );
    }

    #[test]
    fn a_circle_hides_it() {
        let circle = recording(200, |time| {
            let counts = [350.0 * (0.5 * time).cos(), 350.0 * (0.5 * time).sin()];
            (counts, straight(counts))
        });
        let found = of(&circle);
        let [circulation @ Finding::Circulation { .. }] = &found[..] else {
            panic!("{found:?}")
        };
        assert!(
            circulation.hides_hysteresis() && circulation.to_string().contains("one side only"),
            "{found:?}"
        );
    }

    #[test]
    fn equal_sweeps_show_one_loop() {
        let found = of(&one_motor(300, |time| (500.0 * (0.8 * time).sin(), time)));
        assert_eq!(found, [Finding::OneLoop { motor: 0 }]);
        assert!(!found[0].hides_hysteresis());
        let growing = of(&one_motor(300, |time| {
            (10.0 * time * (0.8 * time).sin(), time)
        }));
        assert_eq!(growing, []);
    }

    #[test]
    fn one_axis_at_a_time_says_nothing_of_the_plane() {
        let cross = recording(600, |time| {
            let [a, b] = wander(time);
            let counts = if time < 60.0 { [a, 0.0] } else { [0.0, b] };
            (counts, straight(counts))
        });
        let found = of(&cross);
        assert!(
            matches!(found[..], [Finding::OneAxisAtATime { percent }] if percent < 2.0),
            "{found:?}"
        );
    }

    #[test]
    fn turning_points_are_the_extremes() {
        let counts = [0.0, 100.0, 99.0, 101.0, 50.0, 51.0, 49.0, 0.0, 70.0];
        assert_eq!(turning_points(counts.into_iter(), 2.0), [101.0, 0.0]);
    }

    /// The recordings lie beside the repository; see the example `recordings`.
    #[test]
    #[ignore = "needs the recordings beside the repository"]
    fn real_recordings_are_judged_as_they_are_known() {
        let read = |name: &str| {
            let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
                .join("../../../shared/data")
                .join(name);
            of(&Recording::read(&path, &ColumnMap::default()).unwrap().0)
        };
        assert!(
            read("i2ris/output_w_angles.csv")
                .iter()
                .any(Finding::hides_hysteresis)
        );
        assert!(
            !read("dvrk_wrist/random_first70.csv")
                .iter()
                .any(Finding::hides_hysteresis)
        );
        assert_eq!(
            read("tee_probe/motor1_first.csv"),
            [Finding::OneLoop { motor: 0 }]
        );
    }
}
