//! Whether the path of the motors can separate hysteresis from the shape of the curve.
//!
//! A **turning point**: a motor turns back by more than a dead-band, so that friction can show.

use std::f64::consts::PI;
use std::fmt;

use super::cycle::{circles, turns};
use crate::series::Series;
use i2ris::units::MotorVec;
use i2ris_report::statistics::min_max;

/// Minimum return after a turning point, beyond jitter, in ranges; minimum number of such points.
const REVERSAL_PART: f64 = 0.02;
const MIN_TURNING_POINTS: usize = 2;

/// Turning points this near are the same, as a part of the range; largest stroke of a small loop.
const SAME_PART: f64 = 0.1;
const SMALL_PART: f64 = 0.5;

/// Motors move together if the slower one moves at least this part of the faster one. They cover
/// the plane if they do so on the other part of the path.
const TOGETHER_PART: f64 = 0.1;
const MIN_TOGETHER: f64 = 0.1;

/// Directions in which a line is looked for.
const DIRECTIONS: usize = 60;

/// A position shows a line this far from the middle and this near the line, in half ranges.
const AWAY: f64 = 0.4;
const ON_LINE: f64 = 0.12;

/// Two lines carry at least this part of those positions together, and each at least the other.
const ON_BOTH: f64 = 0.95;
const ON_EACH: f64 = 0.2;

/// A limit of the information in a recording; not an error. Motors are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum Finding {
    /// A motor that hardly ever reverses.
    FewReversals { motor: usize, reversals: usize },
    /// Both motors move along one closed curve in one direction, at one frequency.
    Circulation { turns: f64 },
    /// A motor that always reverses at the same two positions.
    OneLoop { motor: usize },
    /// The smallest stroke, percent of the range.
    LargeLoops { motor: usize, percent: f64 },
    /// Part of the path on which the motors move together, percent.
    OneAxisAtATime { percent: f64 },
    /// Part of the positions away from the middle that lie on two lines, percent.
    TwoLines { percent: f64 },
    /// Part of the motion that is independent, percent.
    HardlySeparable { percent: f64 },
    /// The largest angle, as recorded.
    MaybeRadians { furthest: f64 },
}

impl Finding {
    /// Whether the recording cannot show hysteresis at all, so that only memoryless models can be
    /// fitted. Otherwise a model with memory can be fitted, with the limit in the sentence.
    pub fn hides_hysteresis(&self) -> bool {
        matches!(self, Self::FewReversals { .. } | Self::Circulation { .. })
    }

    /// Whether the recording does not show what both motors do together.
    pub fn hides_plane(&self) -> bool {
        matches!(self, Self::OneAxisAtATime { .. } | Self::TwoLines { .. })
    }

    /// Whether the recording contains no small loops inside the large ones.
    pub fn hides_small_loops(&self) -> bool {
        matches!(self, Self::OneLoop { .. } | Self::LargeLoops { .. })
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FewReversals { motor, reversals } => write!(
                f,
                "motor {motor} reverses only {reversals} time(s), so the recording cannot \
                 separate hysteresis from the shape of the curve; record motion with many reversals"
            ),
            Self::Circulation { turns } => write!(
                f,
                "both motors move along one closed curve in one direction ({turns:.2} turns), so \
                 every position is reached from one side only and hysteresis looks like a shift in \
                 phase: the recording cannot separate it from the shape of the curve; record \
                 motion with many reversals"
            ),
            Self::OneLoop { motor } => write!(
                f,
                "motor {motor} always reverses at the same two positions, so the recording shows \
                 one loop but none of the smaller ones inside; record reversals of many sizes"
            ),
            Self::LargeLoops { motor, percent } => write!(
                f,
                "motor {motor} never reverses within {percent:.0} % of its range, so the \
                 recording shows no smaller loops; record reversals of many sizes"
            ),
            Self::OneAxisAtATime { percent } => write!(
                f,
                "the motors move together on only {percent:.0} % of the path, so the recording \
                 does not show the plane between their axes; record motion of both at once"
            ),
            Self::TwoLines { percent } => write!(
                f,
                "the motors keep to two lines for {percent:.0} % of the path: the plane between \
                 them is not shown; fit `force-balance`, or record motion all over that plane"
            ),
            Self::HardlySeparable { percent } => write!(
                f,
                "the motors move nearly together ({percent:.1} % of their motion is independent): \
                 their effects are hard to separate; record motion in which they move separately"
            ),
            Self::MaybeRadians { furthest } => write!(
                f,
                "no angle is further from 0 than {furthest:.3} deg; if they are radians, multiply \
                 them by 57.29578 and fit again"
            ),
        }
    }
}

/// Limits of a path. If it cannot show hysteresis at all, lesser findings are left out.
pub(crate) fn limits_of_path(series: &Series) -> Vec<Finding> {
    let motors = (0..series.motors()).filter_map(|motor| motor_finding(series, motor));
    let mut findings: Vec<Finding> = motors.chain(plane_finding(series)).collect();
    if findings.iter().any(Finding::hides_hysteresis) {
        findings.retain(Finding::hides_hysteresis);
    }
    findings
}

fn motor_finding(series: &Series, motor: usize) -> Option<Finding> {
    let counts = || series.path().iter().map(|counts| counts[motor]);
    let (low, high) = min_max(counts());
    let points = turning_points(counts(), REVERSAL_PART * (high - low));
    if points.len() < MIN_TURNING_POINTS {
        return Some(Finding::FewReversals { motor, reversals: points.len() });
    }
    // Upper and lower turning points alternate.
    let narrow = |first: usize| {
        let (low_point, high_point) = min_max(points.iter().copied().skip(first).step_by(2));
        high_point - low_point <= SAME_PART * (high - low)
    };
    if narrow(0) && narrow(1) {
        return Some(Finding::OneLoop { motor });
    }
    let strokes = points.windows(2).map(|pair| (pair[1] - pair[0]).abs() / (high - low));
    let smallest = strokes.fold(f64::INFINITY, f64::min);
    let found = Finding::LargeLoops { motor, percent: 100.0 * smallest };
    (smallest >= SMALL_PART).then_some(found)
}

fn plane_finding(series: &Series) -> Option<Finding> {
    if series.motors() < 2 {
        return None;
    }
    if let Some(phases) = circles(series.path()) {
        return Some(Finding::Circulation { turns: turns(&phases) });
    }
    let axes = [0, 1].map(|motor| {
        let (low, high) = min_max(series.path().iter().map(|counts| counts[motor]));
        (0.5 * (low + high), (high - low).max(f64::MIN_POSITIVE))
    });
    let (mut together, mut whole) = (0.0, 0.0);
    for pair in series.path().windows(2) {
        let [a, b] = [0, 1].map(|motor| (pair[1][motor] - pair[0][motor]).abs() / axes[motor].1);
        let length = a.hypot(b);
        whole += length;
        if a.min(b) >= TOGETHER_PART * a.max(b) {
            together += length;
        }
    }
    let percent = 100.0 * together / whole;
    if together < MIN_TOGETHER * whole {
        return Some(Finding::OneAxisAtATime { percent });
    }
    let on_lines = on_two_lines(series, axes)?;
    (on_lines >= ON_BOTH).then_some(Finding::TwoLines { percent: 100.0 * on_lines })
}

/// The part of the positions away from the middle that lie on two straight lines through it; `None`
/// if one of them has hardly any. `axes` are middles and spans of the motors.
fn on_two_lines(series: &Series, axes: [(f64, f64); 2]) -> Option<f64> {
    let at = |counts: &MotorVec| [0, 1].map(|i| (counts[i] - axes[i].0) / (0.5 * axes[i].1));
    let mut left: Vec<[f64; 2]> = series.path().iter().map(at).collect();
    left.retain(|at| at[0].hypot(at[1]) > AWAY);
    let all = left.len() as f64;
    let mut on_both = 0.0;
    for _ in 0..2 {
        let is_on = |direction: usize, at: &[f64; 2]| {
            let (sin, cos) = (PI * direction as f64 / DIRECTIONS as f64).sin_cos();
            (at[0] * sin - at[1] * cos).abs() < ON_LINE
        };
        let on = |direction: &usize| left.iter().filter(|at| is_on(*direction, at)).count();
        let line = (0..DIRECTIONS).max_by_key(on)?;
        let on_line = on(&line) as f64 / all;
        if on_line < ON_EACH {
            return None;
        }
        on_both += on_line;
        left.retain(|at| !is_on(line, at));
    }
    Some(on_both)
}

/// Positions at which a motor reverses by more than a band.
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
    use i2ris_needs::needs;
    use std::path::PathBuf;

    use super::*;
    use crate::recording::{ColumnMap, Recording};
    use crate::testing::{
        assert_contains, circle, one_motor, recording, straight, wander, wandering,
    };

    fn findings_of(recording: &Recording) -> Vec<Finding> {
        limits_of_path(&Series::whole(recording))
    }

    /// Findings of one motor.
    fn findings_of_motor(rows: usize, counts: impl Fn(f64) -> f64) -> Vec<Finding> {
        findings_of(&one_motor(rows, |time| (counts(time), time)))
    }

    #[test]
    fn many_reversals_of_many_sizes_in_the_plane_show_hysteresis() {
        assert_eq!(findings_of(&wandering(600)), []);
        assert_eq!(findings_of_motor(300, |time| 10.0 * time * (0.8 * time).sin()), []);
    }

    #[test]
    fn few_reversals_and_circles_hide_hysteresis() {
        let up = findings_of_motor(100, |time| 100.0 * time + 10.0 * (9.0 * time).sin());
        assert!(up.len() == 1 && up[0].hides_hysteresis());
        assert_contains(&up[0], &["motor 0 reverses only 0 time(s)"]);
        let circle = findings_of(&circle(200));
        assert!(circle.len() == 1 && circle[0].hides_hysteresis());
        assert_contains(&circle[0], &["one closed curve", "one side only"]);
    }

    #[test]
    fn equal_sweeps_and_single_axes_limit_the_findings() {
        let sweeps = findings_of_motor(300, |time| 500.0 * (0.8 * time).sin());
        assert_eq!(sweeps, [Finding::OneLoop { motor: 0 }]);
        assert!(!sweeps[0].hides_hysteresis());
        let size = |time: f64| 0.8 + 0.2 * (0.31 * time).sin();
        let strokes = findings_of_motor(300, |time| 500.0 * size(time) * (0.8 * time).sin());
        let large = matches!(strokes[..], [found @ Finding::LargeLoops { motor: 0, percent }]
            if found.hides_small_loops() && (50.0..90.0).contains(&percent));
        assert!(large, "{strokes:?}");
        let cross = recording(600, |time| {
            let [a, b] = wander(time);
            let counts = if time < 60.0 { [a, 0.0] } else { [0.0, b] };
            (counts, straight(counts))
        });
        let found = findings_of(&cross);
        let one_axis = matches!(found[..], [Finding::OneAxisAtATime { percent }] if percent < 2.0);
        assert!(one_axis, "{found:?}");
        let turned = recording(600, |time| {
            let [a, b] = wander(time);
            let counts = if time < 60.0 { [a, 0.8 * a] } else { [-0.7 * b, b] };
            (counts, straight(counts))
        });
        let found = findings_of(&turned);
        assert!(matches!(found[..], [lines @ Finding::TwoLines { .. }] if lines.hides_plane()));
    }

    #[test]
    fn turning_points_are_the_extremes() {
        let counts = [0.0, 100.0, 99.0, 101.0, 50.0, 51.0, 49.0, 0.0, 70.0];
        assert_eq!(turning_points(counts.into_iter(), 2.0), [101.0, 0.0]);
    }

    /// The recordings are next to the repository; see the example `recordings`.
    #[needs("file: ../../../shared/data/i2ris")]
    #[test]
    fn known_recordings_are_classified() {
        let read = |name: &str| {
            let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
            let columns = ColumnMap::default();
            findings_of(&Recording::read(&folder.join(name), &columns).unwrap().0)
        };
        let hides = |name: &str| read(name).iter().any(Finding::hides_hysteresis);
        assert!(hides("i2ris/output_w_angles.csv"));
        assert!(!hides("dvrk_wrist/random_first70.csv"));
        assert_eq!(read("tee_probe/motor1_first.csv"), [Finding::OneLoop { motor: 0 }]);
    }
}
