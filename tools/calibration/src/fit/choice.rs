//! The choice among the families: by what the robot will do.
//!
//! A model commands counts by its inverse, and the snake is another one than the model believes.
//! So the inverse of every family is run through the other families as plants, and is scored by the
//! worst of them, beside its own error on the rows held out. An inverse that only its own model
//! likes loses. A family whose error on the rows held out is far above the least is no plant.

use i2ris::model::file::OutputUnit;
use i2ris::model::{Model, Query, TrialPath};
use i2ris::units::OutputVec;

use super::family::Family;
use crate::parallel;

/// A family is a plant if its error on the rows held out is at most so many times the least.
const CREDIBLE: f64 = 1.5;

/// A later family has to be better by this part: the errors on five blocks held out scatter by as
/// much.
const LEAST_GAIN: f64 = 0.05;

/// Ticks of a trial, and ticks at its start that do not count.
const TICKS: usize = 4000;
const TURNING_TICKS: usize = 800;
const SETTLING: usize = 400;

/// The motors move by at most this part of the hull in a tick.
const FASTEST: f64 = 0.02;

/// How a family did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// The family.
    pub family: Family,
    /// RMS length of the error on the rows held out, rad (m).
    pub held_out: f64,
    /// RMS length of the tracking error on the worst of the other families, rad (m), and which;
    /// `None` without another credible family.
    pub worst_plant: Option<(f64, Family)>,
    /// Travel of the motors in the trials, relative to that of `linear`.
    pub travel: f64,
}

impl Score {
    /// Both errors together.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.worst_plant.map_or(self.held_out, |(error, _)| self.held_out.hypot(error))
    }
}

impl Score {
    /// The score in a sentence, in a unit.
    #[must_use]
    pub fn sentence(&self, unit: OutputUnit) -> String {
        let (family, held_out) = (self.family, self.held_out / unit.si());
        let tracking = match self.worst_plant {
            Some((error, plant)) => format!(
                "its inverse leaves {:.3} {unit} on {plant}, the worst of the others, with {:.2} \
                 times the travel of linear",
                error / unit.si(),
                self.travel
            ),
            None => "no other family is near enough to test its inverse".to_owned(),
        };
        format!("{family}: {held_out:.3} {unit} on rows held out; {tracking}")
    }
}

/// Scores the families, in the order given.
pub(super) fn scores(models: &[(Family, &Model)]) -> Vec<Score> {
    let held_out: Vec<f64> = models.iter().map(|(_, model)| held_out_error(model)).collect();
    let least = held_out.iter().copied().fold(f64::INFINITY, f64::min);
    let plants: Vec<usize> =
        (0..models.len()).filter(|index| held_out[*index] <= CREDIBLE * least).collect();
    let goals = models.first().map(|(_, model)| Goals::new(model));
    let straight = goals.as_ref().map_or(0.0, |goals| goals.path.travel());
    let trials = parallel::map(models.len(), |index| {
        let others = plants.iter().filter(|plant| **plant != index);
        let trial = |plant: &usize| {
            let goals = goals.as_ref()?;
            Some((*plant, track(models[index].1, models[*plant].1, goals)))
        };
        others.filter_map(trial).collect::<Vec<_>>()
    });
    let score = |(index, (family, _)): (usize, &(Family, &Model))| {
        let worst = trials[index].iter().max_by(|a, b| a.1.error.total_cmp(&b.1.error));
        let travel = trials[index].iter().map(|(_, trial)| trial.travel);
        Score {
            family: *family,
            held_out: held_out[index],
            worst_plant: worst.map(|(plant, trial)| (trial.error, models[*plant].0)),
            travel: travel.fold(0.0, f64::max) / straight.max(f64::MIN_POSITIVE),
        }
    };
    models.iter().enumerate().map(score).collect()
}

/// The family to take: the least score, the simpler family where the difference is small.
pub(super) fn best(scores: &[Score]) -> Option<Family> {
    let mut best: Option<&Score> = None;
    for score in scores {
        let better = |best: &Score| score.total() < best.total() * (1.0 - LEAST_GAIN);
        if best.is_none_or(better) {
            best = Some(score);
        }
    }
    best.map(|score| score.family)
}

/// RMS over the rows held out of the length of the error, in SI units.
pub(super) fn held_out_error(model: &Model) -> f64 {
    let outputs = model.file().outputs.iter().zip(&model.file().metrics);
    let squares = outputs.map(|(output, metrics)| {
        let rmsd = metrics.held_out.as_ref().map_or(0.0, |fit| fit.rmsd);
        (rmsd * output.unit.si()).powi(2)
    });
    let error = squares.sum::<f64>().sqrt();
    if error.is_finite() { error } else { f64::MAX }
}

/// Goals that lie in the reach of the snake, and the path of the motors before them.
struct Goals {
    outputs: usize,
    path: TrialPath,
    goals: Vec<OutputVec>,
}

impl Goals {
    /// From the first model: `linear`.
    fn new(straight: &Model) -> Self {
        let path = TrialPath::new(straight.hull(), TURNING_TICKS, TICKS);
        let none = straight.new_memory();
        let predicted = path.wander.iter();
        let predicted = predicted.map(|counts| straight.predict(counts, &none).mean);
        Self { outputs: straight.outputs(), goals: predicted.collect(), path }
    }
}

struct Trial {
    error: f64,
    travel: f64,
}

/// Tracks the goals with the inverse of a model on another one.
fn track(model: &Model, plant: &Model, goals: &Goals) -> Trial {
    let (mut known, mut real) = (model.new_memory(), plant.new_memory());
    for counts in &goals.path.turns {
        model.advance(&mut known, counts);
        plant.advance(&mut real, counts);
    }
    let mut counts = goals.path.turns.last().copied().unwrap_or_default();
    let (mut squares, mut travel) = (0.0, 0.0);
    for (tick, goal) in goals.goals.iter().enumerate() {
        let target = model.invert(goal, &known, &Query::new(counts)).counts;
        let mut next = counts;
        for motor in 0..2 {
            let fastest = FASTEST * goals.path.half_ranges[motor];
            next[motor] += (target[motor] - counts[motor]).clamp(-fastest, fastest);
        }
        model.advance(&mut known, &next);
        plant.advance(&mut real, &next);
        let reached = plant.predict(&next, &real).mean;
        if tick >= SETTLING {
            travel += TrialPath::distance(&counts, &next);
            let pairs = reached.iter().zip(goal).take(goals.outputs);
            squares += pairs.map(|(reached, goal)| (reached - goal).powi(2)).sum::<f64>();
        }
        counts = next;
    }
    Trial { error: (squares / (TICKS - SETTLING) as f64).sqrt(), travel }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(family: Family, held_out: f64, on_others: f64) -> Score {
        Score { family, held_out, worst_plant: Some((on_others, Family::Linear)), travel: 1.0 }
    }

    #[test]
    fn an_inverse_that_only_its_own_model_likes_loses() {
        let scores = [
            score(Family::Linear, 2.0, 2.0),
            score(Family::GmrPlay, 0.2, 0.3),
            score(Family::GmrStop, 0.19, 0.9),
        ];
        assert_eq!(best(&scores), Some(Family::GmrPlay));
    }

    #[test]
    fn a_small_difference_is_no_reason_for_a_more_complex_family() {
        let scores = [score(Family::GmrPlay, 0.2, 0.2), score(Family::GmrStop, 0.199, 0.199)];
        assert_eq!(best(&scores), Some(Family::GmrPlay));
        assert_eq!(best(&[]), None);
    }
}
