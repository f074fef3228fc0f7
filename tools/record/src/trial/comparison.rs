//! Compares the conditions of a study within each participant, so that skill is not mistaken for an
//! effect of a condition.
//!
//! Intervals: paired bootstrap of the participants' means (Efron and Tibshirani, An Introduction to
//! the Bootstrap, 1993, chapter 13, percentiles), always with the same random numbers.
//!
//! Throughput: ISO 9241-411, `log2(D / We + 1) / MT`, with the effective width `We = 4.133 s` of
//! the end points along the way to the target. The hold time is not part of the movement time.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use i2ris_report::statistics::{mean, quantile, sort};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::Serialize;

use super::journal::{Outcome, TrialState};
use super::participant::Workload;
use super::{Study, StudyError};
use crate::report::{Pursuit, TargetReach, TrialReport};

const RESAMPLES: usize = 10_000;
const SEED: u64 = 9241;
/// Ratio of the effective width to the standard deviation: 96 % of the end points.
const WIDTH: f64 = 4.133;
/// Fewer participants have no interval: with two, the bootstrap returns just these two.
const MIN_PARTICIPANTS: usize = 8;
/// Fewer targets have no meaningful spread.
const MIN_TARGETS: usize = 5;

/// A compared measure: one number per trial.
#[derive(Clone, Copy)]
pub struct Measure {
    /// Its name in JSON.
    key: &'static str,
    pub name: &'static str,
    /// Its value in a trial; `None`: the trial does not show it.
    of: fn(&TrialState, &TrialReport) -> Option<f64>,
}

const fn measure(
    key: &'static str,
    name: &'static str,
    of: fn(&TrialState, &TrialReport) -> Option<f64>,
) -> Measure {
    Measure { key, name, of }
}

/// Distances in degrees are root mean squares; the error is by the camera if there is one.
pub const MEASURES: [Measure; 10] = [
    measure("held", "held (share)", |_, it| Some(it.targets.as_ref()?.held)),
    measure("time_s", "time to hold (s)", |_, it| of_targets(it, |target| target.held_s)),
    measure("throughput_bit_s", "throughput (bit/s)", |_, it| throughput(it)),
    measure("detour", "path over distance", |_, it| of_targets(it, |target| Some(target.detour))),
    measure("overshoot_deg", "overshoot (deg)", |_, it| {
        of_targets(it, |target| Some(target.overshoot_deg))
    }),
    measure("error_deg", "error, RMS (deg)", |_, it| {
        it.camera.as_ref().or(it.estimate.as_ref()).map(|error| error.length_rms_deg)
    }),
    measure("pursuit_deg", "pursuit, RMS (deg)", |_, it| {
        of_pursuits(it, true, |pursuit| Some(pursuit.rms_deg))
    }),
    measure("pursuit_lag_s", "pursuit, lag (s)", |_, it| {
        of_pursuits(it, true, |pursuit| pursuit.lag_s)
    }),
    measure("hold_still_deg", "holding still, RMS (deg)", |_, it| {
        of_pursuits(it, false, |pursuit| Some(pursuit.rms_deg))
    }),
    measure("workload", "workload (0 to 100)", |trial, _| {
        trial.workload.as_ref().map(Workload::mean)
    }),
];

fn of_targets(report: &TrialReport, value: fn(&TargetReach) -> Option<f64>) -> Option<f64> {
    mean(report.targets.as_ref()?.targets.iter().filter_map(value))
}

/// Pursuits with a target that moves, or with one at rest.
fn of_pursuits(
    report: &TrialReport,
    moves: bool,
    value: fn(&Pursuit) -> Option<f64>,
) -> Option<f64> {
    mean(report.pursuits.iter().filter(|it| it.moves == moves).filter_map(value))
}

fn throughput(report: &TrialReport) -> Option<f64> {
    let score = report.targets.as_ref()?;
    let end = |target: &TargetReach| {
        let held_s = target.held_s?;
        let ends_s = target.t_s + held_s;
        let at = report.observed_mean(ends_s - score.hold_s, ends_s)?;
        let way = [0, 1].map(|axis| target.to_deg[axis] - target.from_deg[axis]);
        let along = (0..2).map(|axis| (at[axis] - target.to_deg[axis]) * way[axis]).sum::<f64>();
        let distance = target.distance_deg;
        (distance > 0.0).then(|| (distance, (held_s - score.hold_s).max(1e-3), along / distance))
    };
    let ends: Vec<_> = score.targets.iter().filter_map(end).collect();
    if ends.len() < MIN_TARGETS {
        return None;
    }
    let centre = mean(ends.iter().map(|(.., end)| *end))?;
    let squares = ends.iter().map(|(.., end)| (end - centre).powi(2)).sum::<f64>();
    let width = WIDTH * (squares / (ends.len() as f64 - 1.0)).sqrt();
    mean(ends.iter().map(|(distance, time_s, _)| (distance / width + 1.0).log2() / time_s))
}

#[derive(Debug, Clone, Serialize, Default)]
pub struct TrialNumbers {
    pub name: String,
    pub participant: String,
    pub condition: String,
    pub started: String,
    pub outcome: Option<Outcome>,
    pub marks: usize,
    pub workload: Option<Workload>,
    /// Setup of the trial: robot, model, motion scale, number of virtual fixtures.
    pub made_with: MadeWith,
    #[serde(skip)]
    pub targets: Vec<TargetReach>,
    /// In the order of [`MEASURES`].
    pub values: [Option<f64>; MEASURES.len()],
    /// Reason why it does not count; `None`: it does.
    pub left_out: Option<String>,
}

/// Setup of a trial as text; empty where the recording does not contain it.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct MadeWith {
    pub robot: String,
    pub model: String,
    pub scale: String,
    pub fixtures: String,
}

impl MadeWith {
    fn of(report: &TrialReport) -> Self {
        let about = |name: &str| report.about.get(name).cloned().unwrap_or_default();
        let text = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        Self {
            robot: about("robot_id"),
            model: about("model_id").chars().take(8).collect(),
            scale: text(report.scale),
            fixtures: text(report.fixtures.map(f64::from)),
        }
    }

    /// The names of the columns, and the cells of a trial.
    pub const NAMES: [&str; 4] = ["robot", "model", "scale", "fixtures"];
    pub fn cells(&self) -> [String; 4] {
        [&self.robot, &self.model, &self.scale, &self.fixtures].map(Clone::clone)
    }
}

/// A difference with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// Mean over the participants: condition less the first condition.
    pub difference: f64,
    /// 95 % interval, from eight participants or more.
    pub interval: Option<[f64; 2]>,
    pub differences: Vec<f64>,
}

#[derive(Debug, Clone, Serialize)]
pub struct Row {
    pub measure: &'static str,
    /// Name of the measure for readers.
    #[serde(skip)]
    pub name: &'static str,
    /// Mean over the participants, by condition.
    pub means: Vec<Option<f64>>,
    /// Effects relative to the first condition.
    pub effects: Vec<Option<Effect>>,
    /// Values by participant and condition.
    #[serde(skip)]
    pub by_participant: BTreeMap<String, Vec<Option<f64>>>,
}

#[derive(Debug, Serialize)]
pub struct StudyReport {
    pub study: String,
    pub conditions: Vec<String>,
    pub trials: Vec<TrialNumbers>,
    pub rows: Vec<Row>,
    /// Other differences within a condition, one sentence each.
    pub mixed: Vec<String>,
}

impl StudyReport {
    pub fn read(folder: &Path) -> Result<Self, StudyError> {
        let study = Study::open(folder)?;
        let conditions: Vec<_> = study.conditions.iter().map(ToString::to_string).collect();
        let mut trials = Vec::new();
        for trial in study.trials()? {
            let state = &trial.state;
            let mut numbers = TrialNumbers {
                name: trial.name.clone(),
                participant: state.participant.clone(),
                condition: state.condition.clone(),
                started: state.started.clone(),
                outcome: state.outcome,
                marks: state.marks.len(),
                workload: state.workload,
                ..TrialNumbers::default()
            };
            match (state.outcome, TrialReport::read(&trial.recording())) {
                (None, _) => numbers.left_out = Some("still running, or truncated".into()),
                (Some(Outcome::Aborted), _) => numbers.left_out = Some("aborted".into()),
                (_, Err(error)) => numbers.left_out = Some(error.to_string()),
                (_, Ok(TrialReport { cut_off, .. }))
                    if state.failed.is_some() || cut_off.is_some() =>
                {
                    numbers.left_out = state.failed.clone().or(cut_off);
                }
                (_, Ok(report)) => {
                    numbers.values = MEASURES.map(|it| (it.of)(state, &report));
                    numbers.made_with = MadeWith::of(&report);
                    numbers.targets = report.targets.map(|it| it.targets).unwrap_or_default();
                }
            }
            trials.push(numbers);
        }
        let rows = MEASURES.iter().enumerate().map(|(index, measure)| {
            let counted = trials.iter().filter(|trial| trial.left_out.is_none());
            let values = counted.filter_map(|trial| {
                Some((&*trial.participant, &*trial.condition, trial.values[index]?))
            });
            row(measure, &conditions, values)
        });
        let rows = rows.collect();
        let name = folder.canonicalize().unwrap_or_default();
        let study = name.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mixed = mixed(&conditions, &trials);
        Ok(Self { study, conditions, trials, rows, mixed })
    }
}

/// Lists what else differs within a condition: such trials do not show the effect of a condition.
fn mixed(conditions: &[String], trials: &[TrialNumbers]) -> Vec<String> {
    let mut sentences = Vec::new();
    for condition in conditions {
        let of = trials.iter().filter(|it| it.left_out.is_none() && it.condition == *condition);
        let cells: Vec<_> = of.map(|trial| trial.made_with.cells()).collect();
        for (place, name) in MadeWith::NAMES.iter().enumerate() {
            let found: BTreeSet<&str> = cells.iter().map(|cells| &*cells[place]).collect();
            if found.len() > 1 {
                let found = Vec::from_iter(found).join(", ");
                sentences.push(format!("{condition}: more than one {name} ({found})"));
            }
        }
    }
    sentences
}

/// Mean of each participant under each condition, then over the participants.
fn row<'a>(
    measure: &Measure,
    conditions: &[String],
    values: impl Iterator<Item = (&'a str, &'a str, f64)>,
) -> Row {
    let mut all: BTreeMap<&str, Vec<Vec<f64>>> = BTreeMap::new();
    for (participant, condition, value) in values {
        let of_participant =
            all.entry(participant).or_insert_with(|| vec![Vec::new(); conditions.len()]);
        if let Some(place) = conditions.iter().position(|name| name == condition) {
            of_participant[place].push(value);
        }
    }
    let by_participant: BTreeMap<String, Vec<Option<f64>>> = all
        .into_iter()
        .map(|(name, conditions)| (name.to_owned(), conditions.into_iter().map(mean).collect()))
        .collect();
    let of = |place: usize| by_participant.values().filter_map(move |means| means[place]);
    let means = (0..conditions.len()).map(|place| mean(of(place))).collect();
    let effects = (0..conditions.len()).map(|place| {
        let pairs = by_participant.values().filter_map(|means| Some(means[place]? - means[0]?));
        if place == 0 { None } else { effect(&pairs.collect::<Vec<_>>()) }
    });
    let effects = effects.collect();
    Row { measure: measure.key, name: measure.name, means, effects, by_participant }
}

/// Mean of paired differences, and its interval where there are enough.
fn effect(differences: &[f64]) -> Option<Effect> {
    let difference = mean(differences.iter().copied())?;
    let count = differences.len();
    let interval = (count >= MIN_PARTICIPANTS).then(|| {
        let mut random = Pcg64::seed_from_u64(SEED);
        let mut resample = |_| {
            let sum: f64 = (0..count).map(|_| differences[random.random_range(0..count)]).sum();
            sum / count as f64
        };
        let mut means: Vec<f64> = (0..RESAMPLES).map(&mut resample).collect();
        sort(&mut means);
        [0.025, 0.975].map(|share| quantile(&means, share).unwrap_or(difference))
    });
    Some(Effect { difference, interval, differences: differences.to_vec() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_is_found_within_participants_that_differ_a_lot() {
        // Skills from 1 to 8 s, an effect of 0.5 s that varies by 0.1.
        let conditions = ["a".to_owned(), "b".to_owned()];
        let names: Vec<_> = (1..=8).map(|number| format!("P{number}")).collect();
        let values = names.iter().enumerate().flat_map(|(index, name)| {
            let skill = 1.0 + index as f64;
            let noise = if index % 2 == 0 { 0.1 } else { -0.1 };
            [
                (&**name, "a", skill),
                (&**name, "b", skill + 0.4),
                (&**name, "b", skill + 0.6 + noise),
            ]
        });
        let row = row(&MEASURES[1], &conditions, values);
        let effect = row.effects[1].clone().unwrap();
        assert!((effect.difference - 0.5).abs() < 1e-9 && effect.differences.len() == 8);
        let [low, high] = effect.interval.unwrap();
        assert!(low > 0.4 && low < 0.5 && high > 0.5 && high < 0.6, "{low} {high}");
        assert_eq!(row.effects[0], None);
        assert!((row.means[0].unwrap() - 4.5).abs() < 1e-9);
    }

    #[test]
    fn few_participants_have_differences_and_no_interval() {
        for count in 1..MIN_PARTICIPANTS {
            let few = effect(&vec![0.3; count]).unwrap();
            assert_eq!((few.interval, few.differences), (None, vec![0.3; count]));
        }
        assert!(effect(&[0.3; MIN_PARTICIPANTS]).unwrap().interval.is_some());
        assert_eq!(effect(&[]), None);
    }

    #[test]
    fn a_condition_with_two_models_is_named() {
        let trial = |model: &str| TrialNumbers {
            participant: "P1".into(),
            condition: "a".into(),
            made_with: MadeWith { model: model.into(), ..MadeWith::default() },
            ..TrialNumbers::default()
        };
        let found = mixed(&["a".into()], &[trial("11"), trial("22"), trial("11")]);
        assert_eq!(found, ["a: more than one model (11, 22)"]);
        assert!(mixed(&["a".into()], &[trial("11"), trial("11")]).is_empty());
    }

    /// The interval covers a true difference about 95 times in 100.
    #[test]
    fn intervals_cover_what_is_true() {
        let mut random = Pcg64::seed_from_u64(1);
        let mut normal = || (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0;
        let covered = (0..100).filter(|_| {
            let differences: Vec<f64> = (0..20).map(|_| 0.7 + normal()).collect();
            let [low, high] = effect(&differences).unwrap().interval.unwrap();
            low <= 0.7 && 0.7 <= high
        });
        let covered = covered.count();
        assert!((85..=100).contains(&covered), "{covered}");
    }
}
