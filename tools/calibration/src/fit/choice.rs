//! The choice among the families: by what the robot will do.
//!
//! A model commands counts by its inverse, and the snake is another one than the model believes.
//! So the inverse of every family is run through the other families as plants, and is scored by
//! what it leaves there, beside its own error on the rows held out. An inverse that only its own
//! model likes loses. A family whose error on the rows held out is far above the least is no plant,
//! and neither is one that no other family can follow: that would decide for whichever family is
//! the dullest.
//!
//! The errors held out are those of blocks all over the recording, so that their spread tells how
//! sure the choice is.

use i2ris::model::file::OutputUnit;
use i2ris::model::{ExaminationPath, Model, Query};
use i2ris::units::OutputVec;

use super::evidence::{Evidence, block_errors, rms};
use super::family::Family;
use super::metrics::predictions;
use crate::parallel;

/// A family is credible, and a plant, if its error on the rows held out is at most so many times
/// the least.
const CREDIBLE: f64 = 1.7;

/// A family is no plant if even the best of the others leaves so many times what both of them leave
/// of the rows held out.
const FOLLOWED: f64 = 2.0;

/// A later family has to be better by this part: the errors on five blocks held out scatter by as
/// much.
const LEAST_GAIN: f64 = 0.05;

/// A balance of forces may be worse by this part: what others make up for it holds in motion like
/// that of the recording, and what it knows of the mechanism also elsewhere.
const TIE: f64 = 0.15;

/// Ticks of a trial, and ticks at its start that do not count.
const TICKS: usize = 4000;
const TURNING_TICKS: usize = 800;
const SETTLING: usize = 400;

/// The motors move by at most this part of the hull in a tick.
const FASTEST: f64 = 0.02;

/// How a family did.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// The family.
    pub family: Family,
    /// RMS length of the error on the rows held out, rad (m).
    pub held_out: f64,
    /// The same on the rows used for training whose state is known. A model that is worse there has
    /// gone wrong somewhere where nothing was held out.
    pub training: f64,
    /// Mean square length of the error in every block held out, rad^2 (m^2).
    pub blocks: Vec<f64>,
    /// RMS length of the tracking error on the other families that are plants, rad (m), and the one
    /// where it is worst; `None` without another plant.
    pub tracking: Option<(f64, Family)>,
    /// Travel of the motors in the trials, relative to that of `linear`.
    pub travel: f64,
}

impl Score {
    /// Both errors together.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.fitted().hypot(self.tracking.map_or(0.0, |(error, _)| error))
    }

    /// The error on measured rows.
    fn fitted(&self) -> f64 {
        self.held_out.max(self.training)
    }

    /// The standard deviation of the difference between the errors of two families, by their
    /// blocks.
    #[must_use]
    pub fn uncertainty_beside(&self, other: &Self) -> f64 {
        let differences: Vec<f64> =
            self.blocks.iter().zip(&other.blocks).map(|(own, other)| own - other).collect();
        let count = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / count;
        let squares = differences.iter().map(|difference| (difference - mean).powi(2));
        let of_mean = (squares.sum::<f64>() / (count - 1.0) / count).sqrt();
        let size = self.held_out + other.held_out;
        if of_mean.is_finite() && size > 0.0 { of_mean / size } else { 0.0 }
    }

    /// The score in a sentence, in a unit.
    #[must_use]
    pub fn sentence(&self, unit: OutputUnit) -> String {
        let (family, held_out) = (self.family, self.held_out / unit.si());
        let tracking = match self.tracking {
            Some((error, plant)) => format!(
                "its inverse leaves {:.3} {unit} on the others, most on {plant}, with {:.2} times \
                 the travel of linear",
                error / unit.si(),
                self.travel
            ),
            None => "no other family is near enough to test its inverse".to_owned(),
        };
        let worse = match self.training > self.held_out {
            true => {
                format!(" ({:.3} {unit} on those used for training)", self.training / unit.si())
            }
            false => String::new(),
        };
        format!("{family}: {held_out:.3} {unit} on rows held out{worse}; {tracking}")
    }
}

/// Scores the families, in the order given.
pub(super) fn scores(models: &[(Family, &Model)], evidence: &Evidence<'_>) -> Vec<Score> {
    let &Evidence { recording, rows, training } = evidence;
    let training = [training.to_vec()];
    let errors = parallel::map(models.len(), |index| {
        let predicted = predictions(models[index].1, recording);
        [rows, &training].map(|rows| block_errors(&predicted, recording, rows))
    });
    let held_out: Vec<f64> = errors.iter().map(|[blocks, _]| rms(blocks)).collect();
    let trials = trials(models, &held_out);
    let score = |(index, (family, _)): (usize, &(Family, &Model))| {
        let trials = &trials[index];
        let worst = trials.iter().max_by(|a, b| a.1.error.total_cmp(&b.1.error));
        let squares: f64 = trials.iter().map(|(_, trial)| trial.error.powi(2)).sum();
        let error = (squares / trials.len() as f64).sqrt();
        Score {
            family: *family,
            held_out: held_out[index],
            training: rms(&errors[index][1]),
            blocks: errors[index][0].clone(),
            tracking: worst.map(|(plant, _)| (error, models[*plant].0)),
            travel: trials.iter().map(|(_, trial)| trial.travel).fold(0.0, f64::max),
        }
    };
    models.iter().enumerate().map(score).collect()
}

/// Of every family, how its inverse does on the others that are plants.
fn trials(models: &[(Family, &Model)], held_out: &[f64]) -> Vec<Vec<(usize, Candidate)>> {
    let least = held_out.iter().copied().fold(f64::INFINITY, f64::min);
    let credible = |index: &usize| held_out[*index] <= CREDIBLE * least;
    let plants: Vec<usize> = (0..models.len()).filter(credible).collect();
    let goals = models.first().map(|(_, model)| Goals::new(model));
    let mut trials = parallel::map(models.len(), |index| {
        let others = plants.iter().filter(|plant| **plant != index);
        let trial = |plant: &usize| {
            let goals = goals.as_ref()?;
            Some((*plant, track(models[index].1, models[*plant].1, goals)))
        };
        others.filter_map(trial).collect::<Vec<_>>()
    });
    let followed = followed(&trials, held_out);
    for trials in &mut trials {
        trials.retain(|(plant, _)| followed.contains(plant));
    }
    trials
}

/// The plants that at least one other family can follow, as far as both know the robot.
fn followed(trials: &[Vec<(usize, Candidate)>], held_out: &[f64]) -> Vec<usize> {
    let families = trials.iter().enumerate();
    let good = families.flat_map(|(index, trials)| {
        let follows = move |(plant, trial): &&(usize, Candidate)| {
            trial.error <= FOLLOWED * held_out[index].hypot(held_out[*plant])
        };
        trials.iter().filter(follows).map(|(plant, _)| *plant)
    });
    good.collect()
}

/// The family to take: the least score, the simpler family where the difference is small, and the
/// balance of forces where it is hardly worse than that. Where a family has no other to try its
/// inverse on, only the errors on measured rows are alike.
pub(super) fn best(scores: &[Score]) -> Option<Family> {
    let tried = scores.iter().filter(|score| score.tracking.is_some()).count();
    let is_alike = tried == 0 || tried == scores.len();
    let value = |score: &Score| if is_alike { score.total() } else { score.fitted() };
    let mut best: Option<&Score> = None;
    for score in scores {
        let least_gain = if score.family == Family::ForceBalance { -TIE } else { LEAST_GAIN };
        if best.is_none_or(|best| value(score) < value(best) * (1.0 - least_gain)) {
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
    path: ExaminationPath,
    goals: Vec<OutputVec>,
}

impl Goals {
    /// From the first model: `linear`.
    fn new(straight: &Model) -> Self {
        let path = ExaminationPath::new(straight.hull(), TURNING_TICKS, TICKS);
        let none = straight.new_memory();
        let predicted = path.wander.iter();
        let predicted = predicted.map(|counts| straight.predict(counts, &none).mean);
        Self { outputs: straight.outputs(), goals: predicted.collect(), path }
    }
}

struct Candidate {
    error: f64,
    /// Relative to the path of the goals.
    travel: f64,
}

/// Tracks the goals with the inverse of a model on another one.
fn track(model: &Model, plant: &Model, goals: &Goals) -> Candidate {
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
            travel += ExaminationPath::distance(&counts, &next);
            let pairs = reached.iter().zip(goal).take(goals.outputs);
            squares += pairs.map(|(reached, goal)| (reached - goal).powi(2)).sum::<f64>();
        }
        counts = next;
    }
    let straight = goals.path.travel().max(f64::MIN_POSITIVE);
    Candidate { error: (squares / (TICKS - SETTLING) as f64).sqrt(), travel: travel / straight }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_near;

    fn score(family: Family, held_out: f64, on_others: f64) -> Score {
        Score {
            family,
            held_out,
            training: held_out,
            blocks: vec![held_out.powi(2); 5],
            tracking: Some((on_others, Family::Linear)),
            travel: 1.0,
        }
    }

    #[test]
    fn an_inverse_that_only_its_own_model_likes_loses() {
        let scores = [
            score(Family::Linear, 2.0, 2.0),
            score(Family::GmrPlay, 0.2, 0.3),
            score(Family::ForceBalance, 0.19, 0.9),
        ];
        assert_eq!(best(&scores), Some(Family::GmrPlay));
    }

    /// The numbers of a cable arm, of `linear`, `gmr` and a balance of friction.
    #[test]
    fn a_family_that_no_other_can_follow_does_not_vote() {
        let held_out = [2.05, 1.23, 0.97];
        let on = |plant, error| (plant, Candidate { error, travel: 1.0 });
        let trials = [vec![on(1, 1.62), on(2, 14.26)], vec![on(2, 14.66)], vec![on(1, 25.71)]];
        assert_eq!(followed(&trials, &held_out), [1]);
    }

    /// The numbers of a wide instrument: the inverse of the plays was tried on no other family.
    #[test]
    fn scores_that_are_not_alike_are_not_compared() {
        let mut plays = score(Family::GmrPlay, 1.56, 0.0);
        plays.tracking = None;
        let scores = [score(Family::Gmr, 1.94, 5.4), plays, score(Family::ForceBalance, 1.7, 5.4)];
        assert_eq!(best(&scores), Some(Family::ForceBalance));
    }

    /// A snake with a noisy camera: the balance follows three times better.
    #[test]
    fn of_plays_and_a_balance_of_forces_that_are_alike_the_balance_is_taken() {
        let plays = score(Family::GmrPlay, 0.447, 0.111);
        let balance = |held_out| [plays.clone(), score(Family::ForceBalance, held_out, 0.113)];
        assert_eq!(best(&balance(0.429)), Some(Family::ForceBalance));
        assert_eq!(best(&balance(0.46)), Some(Family::ForceBalance));
        assert_eq!(best(&balance(0.6)), Some(Family::GmrPlay));
    }

    #[test]
    fn a_model_that_is_worse_where_it_was_trained_is_judged_by_that() {
        let mut wild = score(Family::GmrPlay, 0.2, 0.2);
        wild.training = 5.0;
        let scores = [score(Family::Gmr, 1.0, 0.2), wild];
        assert_eq!(best(&scores), Some(Family::Gmr));
        let sentence = scores[1].sentence(OutputUnit::Deg);
        assert!(sentence.contains("on those used for training"), "{sentence}");
    }

    #[test]
    fn the_blocks_report_how_sure_a_difference_is() {
        let [one, mut other] = [Family::Gmr, Family::GmrPlay].map(|f| score(f, 1.0, 1.0));
        assert_eq!(one.uncertainty_beside(&other), 0.0);
        other.blocks = vec![0.5, 1.5, 0.5, 1.5, 1.0];
        // Differences of squares with a variance of 0.25, five of them, over the sum of the errors.
        assert_near(one.uncertainty_beside(&other), 0.05_f64.sqrt() / 2.0, 1e-12);
    }

    #[test]
    fn a_small_difference_is_no_reason_for_a_more_complex_family() {
        let scores = [score(Family::Gmr, 0.2, 0.2), score(Family::GmrPlay, 0.199, 0.199)];
        assert_eq!(best(&scores), Some(Family::Gmr));
        assert_eq!(best(&[]), None);
    }
}
