//! Reach-and-hold tasks: every target that was shown to a person, scored as a reach.
//!
//! A target counts from the moment it was shown. It is held when the snake stays within its
//! tolerance for its time; whether it does is evaluated again here, from the recorded angles.

use i2ris::ipc::payload::ReachTarget;
use i2ris_plot::number::fixed;
use i2ris_plot::page::TableRow;
use i2ris_plot::{Page, Table};
use serde::Serialize;

use super::reaches::{
    ARRIVED_DEG, ARRIVED_NS, Sample, arrival, distance, mean, median_and_p95, observed,
    overshoot_deg, path_deg,
};
use super::summary::TrialSummary;
use super::trial::{Trial, degrees};

/// A nearer target has no direction, deg.
const NEAREST_DEG: f64 = 1e-3;
/// Samples with a longer gap do not show that the snake stayed.
const LONGEST_GAP_NS: u64 = 500_000_000;

/// One target.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TargetReach {
    /// Number in its task, from 1.
    pub number: u32,
    /// When it was shown, seconds.
    pub t_s: f64,
    /// Pitch and yaw of the snake then, degrees.
    pub from_deg: [f64; 2],
    /// Pitch and yaw of the target, degrees.
    pub to_deg: [f64; 2],
    /// Distance of the two.
    pub distance_deg: f64,
    /// Time until the snake was within 0.15 deg of it, as for a reach; `None`: never.
    pub arrived_s: Option<f64>,
    /// Time until it had stayed within the tolerance for the time of the task; `None`: never.
    pub held_s: Option<f64>,
    /// How far the snake went beyond it, along the line from where it was, degrees.
    pub overshoot_deg: f64,
    /// Length of the path of the goal divided by the distance: 1 is straight.
    pub detour: f64,
}

/// All targets of a trial.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetScore {
    /// What observed the snake: `camera` or `estimate`.
    pub by: &'static str,
    /// Distance within which a target counts, degrees, of the last target.
    pub tolerance_deg: f64,
    /// Time for which it is to be held, seconds, of the last target.
    pub hold_s: f64,
    /// Share of the targets that were held.
    pub held: f64,
    /// Time until the target had been held, seconds: median and 95 %, of those that were.
    pub held_s: Option<[f64; 2]>,
    /// Time until the snake arrived, seconds: median and 95 %, of those where it did.
    pub arrived_s: Option<[f64; 2]>,
    /// Overshoot, degrees: median and 95 %.
    pub overshoot_deg: [f64; 2],
    /// The targets.
    pub targets: Vec<TargetReach>,
}

impl TargetScore {
    /// The score in one line.
    #[must_use]
    pub fn line(&self) -> String {
        let times = self
            .held_s
            .map(|[median, p95]| format!(", after {median:.2} s (median), {p95:.2} s (95 %)"));
        format!(
            "{} targets: {:.0} % held for {:.1} s within {:.2} deg by the {}{}; overshoot \
             {:.2} deg (95 %)",
            self.targets.len(),
            100.0 * self.held,
            self.hold_s,
            self.tolerance_deg,
            self.by,
            times.unwrap_or_default(),
            self.overshoot_deg[1]
        )
    }
}

/// Scores the targets of a trial; `None`: there were none, or nothing observed the snake.
pub fn target_score(trial: &Trial) -> Option<TargetScore> {
    let (by, series) = observed(trial);
    let samples: Vec<Sample> = series.iter().copied().collect();
    let scored = { trial.targets.iter() }.filter_map(|target| reach(trial, &samples, target));
    let targets: Vec<TargetReach> = scored.collect();
    let last = trial.targets.last()?;
    let mut held_s: Vec<f64> = targets.iter().filter_map(|target| target.held_s).collect();
    let mut arrived_s: Vec<f64> = targets.iter().filter_map(|reach| reach.arrived_s).collect();
    let mut overshoots: Vec<f64> = targets.iter().map(|reach| reach.overshoot_deg).collect();
    Some(TargetScore {
        by,
        tolerance_deg: last.tolerance.to_degrees(),
        hold_s: last.hold_ns as f64 * 1e-9,
        held: held_s.len() as f64 / targets.len() as f64,
        held_s: median_and_p95(&mut held_s),
        arrived_s: median_and_p95(&mut arrived_s),
        overshoot_deg: median_and_p95(&mut overshoots)?,
        targets,
    })
}

fn reach(trial: &Trial, samples: &[Sample], target: &ReachTarget) -> Option<TargetReach> {
    let (shown, ended) = (target.shown_ns, target.stamp_ns);
    let first = samples.partition_point(|(stamp, _)| *stamp < shown);
    let after = samples.partition_point(|(stamp, _)| *stamp <= ended);
    let seen = samples.get(first..after)?;
    let (_, from_deg) = *seen.first()?;
    let to_deg = degrees(target.position);
    let distance_deg = distance(from_deg, to_deg);
    let seconds = |stamp: u64| stamp.saturating_sub(shown) as f64 * 1e-9;
    let is_apart = distance_deg > NEAREST_DEG;
    Some(TargetReach {
        number: target.number,
        t_s: trial.seconds(shown),
        from_deg,
        to_deg,
        distance_deg,
        arrived_s: arrival(seen, to_deg).map(seconds),
        held_s: held_at(seen, to_deg, target).map(seconds),
        overshoot_deg: if is_apart { overshoot_deg(seen, from_deg, to_deg) } else { 0.0 },
        detour: if is_apart { path_deg(&trial.goal, shown, ended) / distance_deg } else { 1.0 },
    })
}

/// The stamp at which the means of short windows have been within the tolerance for the time of the
/// task.
fn held_at(samples: &[Sample], to: [f64; 2], target: &ReachTarget) -> Option<u64> {
    let tolerance_deg = target.tolerance.to_degrees();
    let mut since: Option<u64> = None;
    let mut last = 0;
    for (first, (stamp, _)) in samples.iter().enumerate() {
        let is_within = mean(samples, first, ARRIVED_NS)
            .is_some_and(|mean| distance(mean, to) <= tolerance_deg);
        if !is_within || stamp.saturating_sub(last) > LONGEST_GAP_NS {
            since = None;
        }
        last = *stamp;
        if is_within {
            let begun = *since.get_or_insert(*stamp);
            if stamp - begun + ARRIVED_NS >= target.hold_ns {
                return Some(begun + target.hold_ns);
            }
        }
    }
    None
}

/// Writes the section of the page.
pub fn write(page: &mut Page, summary: &TrialSummary) {
    let Some(score) = &summary.targets else {
        return;
    };
    page.section("Reach and hold");
    page.paragraph(format!("{}.", score.line()));
    let header = "number/shown at (s)/from (deg)/target (deg)/arrived (s)/held (s)/overshoot (deg)/\
                  detour";
    let mut table = Table::new(
        format!(
            "Every target, with the time since it was shown. Arrived: within {ARRIVED_DEG} deg; \
             detour: path of the goal divided by the distance."
        ),
        header.split('/'),
    );
    for reach in &score.targets {
        let pose = |[pitch, yaw]: [f64; 2]| format!("{pitch:+.2} {yaw:+.2}");
        let time = |time: Option<f64>| time.map_or_else(|| "no".to_owned(), |s| fixed(s, 2));
        table.row(TableRow::new([
            reach.number.to_string(),
            fixed(reach.t_s, 2),
            pose(reach.from_deg),
            pose(reach.to_deg),
            time(reach.arrived_s),
            time(reach.held_s),
            fixed(reach.overshoot_deg, 2),
            fixed(reach.detour, 2),
        ]));
    }
    page.table(&table);
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// A snake that goes 4 deg in the first second, 0.5 deg too far until 1.4 s, and then is there
    /// until 2 s; afterwards it is `later_deg` away.
    fn trial(later_deg: f64) -> Trial {
        let mut trial = Trial::default();
        for ms in 0..5000 {
            let goal = 4.0 * (ms as f64 * 1e-3).min(1.0);
            let beyond = if (1000..1400).contains(&ms) { 0.5 } else { 0.0 };
            let away = if ms > 2000 { later_deg } else { 0.0 };
            trial.goal.push(ms * MS, [goal, 1.0]);
            { &mut trial.measured }.push(ms * MS, [goal + beyond, 1.0 + away]);
        }
        trial.targets.push(ReachTarget {
            shown_ns: 0,
            stamp_ns: 4900 * MS,
            hold_ns: 1000 * MS,
            position: [4.0_f64.to_radians(), 1.0_f64.to_radians(), 0.0],
            tolerance: 0.15_f64.to_radians(),
            number: 1,
            total: 1,
            count: 2,
            ..ReachTarget::default()
        });
        trial
    }

    #[test]
    fn a_target_is_held_when_the_snake_stays_and_overshoot_counts_along_the_line() {
        let score = target_score(&trial(0.0)).unwrap();
        let reach = score.targets[0];
        assert_eq!((score.by, score.held, reach.number), ("estimate", 1.0, 1));
        assert!((reach.distance_deg - 4.0).abs() < 1e-9 && (reach.detour - 1.0).abs() < 0.01);
        assert!((reach.overshoot_deg - 0.5).abs() < 1e-6);
        // Means of 200 ms are within 0.15 deg from 1.34 s on.
        let held = reach.held_s.unwrap();
        assert!((2.3..2.41).contains(&held), "{held}");
        let arrived = reach.arrived_s.unwrap();
        assert!((1.3..1.41).contains(&arrived), "{arrived}");
    }

    #[test]
    fn a_snake_that_leaves_too_early_arrives_but_does_not_hold() {
        let score = target_score(&trial(0.3)).unwrap();
        let reach = score.targets[0];
        assert!(reach.arrived_s.is_some() && reach.held_s.is_none());
        assert_eq!((score.held, score.held_s), (0.0, None));
        assert!(score.line().contains("1 targets: 0 % held for 1.0 s within 0.15 deg"));
    }

    #[test]
    fn frames_with_a_gap_do_not_show_that_the_snake_stayed() {
        let mut gap = trial(0.0);
        gap.measured = i2ris_statistics::TimeSeries::default();
        for ms in (0..5000).filter(|ms| *ms < 1700 || *ms > 4400) {
            gap.measured.push(ms * MS, [4.0, 1.0 + if ms < 1200 { 1.0 } else { 0.0 }]);
        }
        assert_eq!(target_score(&gap).unwrap().targets[0].held_s, None);
    }

    #[test]
    fn without_targets_there_is_no_score() {
        let mut none = trial(0.0);
        none.targets.clear();
        assert_eq!(target_score(&none), None);
    }
}
