//! The choice among the families: by what the robot will do.
//!
//! The rows held out decide, block by block: what the recording does not show of the robot, and
//! noise, is alike in all families and falls out of the difference. A family is **as good as**
//! another if it is worse by at most one standard error of that difference (L. Breiman et al.,
//! "Classification and Regression Trees", 1984, 3.4.3).
//!
//! A model commands counts by its inverse, but the snake differs from the model. So the inverse of
//! every family is run through the other families as plants. Between families that are as good as
//! the best on the rows held out, what it leaves there decides, on plants outside this group: a
//! plant in it would favour itself. Families with a much larger error on the rows held out, and
//! those that no other can follow, are not plants: they would favour the dullest family.
//!
//! Of those as good as the best, `force-balance` is taken, because a mechanism also holds in other
//! motion; otherwise the simplest.
//!
//! A recording of one axis at a time says nothing of the plane between. There a mixture may be tens
//! of degrees wrong, so it is neither a candidate nor a plant.

use std::ops::Range;

use i2ris::model::file::OutputUnit;
use i2ris::model::{ExaminationPath, Model, Query};
use i2ris::units::OutputVec;

use super::metrics::{Evidence, block_errors, predictions, rms};
use super::options::Family;
use crate::{parallel, series};

/// A family is credible, and a plant, if its error on the rows held out is at most so many times
/// the least: without the noise of the measurement, of which a part is not known.
const CREDIBLE: f64 = 1.7;
const UNKNOWN_NOISE: f64 = 0.5;

/// A family is no plant if the best of the others leaves this many times their held-out errors.
const FOLLOWED: f64 = 3.0;

/// Ticks of a trial, and ticks at its start that do not count.
const TICKS: usize = 4000;
const TURNING_TICKS: usize = 800;
const SETTLING: usize = 400;

const TICK_S: f64 = 0.02;

/// The motors move by at most this part of the hull in a tick.
const FASTEST: f64 = 0.02;

#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    pub family: Family,
    /// RMS length of the error on the rows held out, rad (m).
    pub held_out: f64,
    /// Mean square length of the error in every block held out, rad^2 (m^2).
    pub blocks: Vec<f64>,
    /// The same in parts of the trials that decide; none where the held-out rows decide alone.
    pub parts: Vec<f64>,
    /// RMS tracking error on the other plants, rad (m), and the worst one; `None` without another.
    pub tracking: Option<(f64, Family)>,
    /// The least of these errors, and where.
    pub nearest: Option<(f64, Family)>,
    /// Travel of the motors in the trials, relative to that of `linear`.
    pub travel: f64,
    /// Whether the recording hides what both motors do together, so that there were no trials.
    pub hides_plane: bool,
}

impl Score {
    pub fn total(&self) -> f64 {
        self.held_out.hypot(self.tracking.map_or(0.0, |(error, _)| error))
    }

    /// Logarithm of the error over that of another family, over all pieces: mean, standard error.
    pub fn beside(&self, other: &Self) -> (f64, f64) {
        let is_tried = !self.parts.is_empty() && !other.parts.is_empty();
        let logarithm = |score: &Self, piece: usize| {
            let part = score.parts.get(piece).filter(|_| is_tried).unwrap_or(&0.0);
            0.5 * (score.blocks[piece] + part).max(f64::MIN_POSITIVE).ln()
        };
        // Blocks differ in what moves: of ratios each counts the same.
        let pieces = 0..self.blocks.len().min(other.blocks.len());
        let ratios: Vec<f64> =
            pieces.map(|piece| logarithm(self, piece) - logarithm(other, piece)).collect();
        let count = ratios.len() as f64;
        let mean = ratios.iter().sum::<f64>() / count;
        let squares: f64 = ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum();
        let of_mean = (squares / (count - 1.0) / count).sqrt();
        (mean, if of_mean.is_finite() { of_mean } else { 0.0 })
    }

    pub fn sentence(&self, unit: OutputUnit) -> String {
        let (family, held_out) = (self.family, self.held_out / unit.si());
        let tracking = match self.tracking {
            Some((error, plant)) => format!(
                "its inverse leaves {:.3} {unit} on the others, most on {plant}, with {:.2} times \
                 the travel of linear",
                error / unit.si(),
                self.travel
            ),
            None => untried(self.hides_plane).to_owned(),
        };
        format!("{family}: {held_out:.3} {unit} on rows held out; {tracking}")
    }
}

/// Why an inverse was not tried.
pub(crate) fn untried(hides_plane: bool) -> &'static str {
    match hides_plane {
        true => "its inverse was not tried: the recording hides the plane between the axes",
        false => "no other family is near enough to test its inverse",
    }
}

/// Scores the families, in the order given.
pub(super) fn scores(models: &[(Family, &Model)], evidence: &Evidence<'_>) -> Vec<Score> {
    let &Evidence { recording, rows, noise, hides_plane } = evidence;
    let errors = parallel::map(models.len(), |index| {
        block_errors(&predictions(models[index].1, recording), recording, rows)
    });
    let held_out: Vec<f64> = errors.iter().map(|blocks| rms(blocks)).collect();
    let plants = credible(&held_out, noise).into_iter().map(|it| it && !hides_plane);
    let trials = trials(models, &held_out, &plants.collect::<Vec<_>>());
    let score = |(index, (family, _)): (usize, &(Family, &Model))| {
        let trials = &trials[index];
        let mut order: Vec<_> =
            trials.iter().map(|(plant, trial)| (trial.error(), models[*plant].0)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mean = parts(trials.iter(), 1).first().map(|square| square.sqrt());
        Score {
            family: *family,
            held_out: held_out[index],
            blocks: errors[index].clone(),
            parts: Vec::new(),
            tracking: mean.zip(order.last().map(|(_, worst)| *worst)),
            nearest: order.first().copied(),
            travel: trials.iter().map(|(_, trial)| trial.travel).fold(0.0, f64::max),
            hides_plane,
        }
    };
    decided(models.iter().enumerate().map(score).collect(), &trials)
}

/// Scores with the trials that decide: of the families as good as the best, on other plants.
fn decided(mut scores: Vec<Score>, trials: &[Vec<(usize, Candidate)>]) -> Vec<Score> {
    let good = as_good(&scores);
    for index in good.iter().copied() {
        let others = trials[index].iter().filter(|(plant, _)| !good.contains(plant));
        scores[index].parts = parts(others, scores[index].blocks.len());
    }
    scores
}

/// The mean over some trials, in this number of parts.
fn parts<'a>(trials: impl Iterator<Item = &'a (usize, Candidate)>, count: usize) -> Vec<f64> {
    let trials: Vec<&[f64]> = trials.map(|(_, trial)| trial.squares.as_slice()).collect();
    let ticks = trials.first().map_or(0, |squares| squares.len());
    let mean = |part: Range<usize>| {
        let sum: f64 = trials.iter().flat_map(|squares| &squares[part.clone()]).sum();
        sum / (trials.len() * part.len()) as f64
    };
    let parts = series::blocks(ticks, count).into_iter();
    parts.filter(|part| !part.is_empty()).map(mean).collect()
}

/// Indices of the scores that are as good as the best, which has the least error over all.
fn as_good(scores: &[Score]) -> Vec<usize> {
    let better = |a: &usize, b: &usize| scores[*a].beside(&scores[*b]).0.total_cmp(&0.0);
    let Some(best) = (0..scores.len()).min_by(better) else { return Vec::new() };
    let is_good = |index: &usize| {
        let (worse, error) = scores[*index].beside(&scores[best]);
        worse <= error
    };
    (0..scores.len()).filter(is_good).collect()
}

/// Which families explain the rows held out about as well as the best one.
fn credible(held_out: &[f64], noise: f64) -> Vec<bool> {
    let beyond =
        |error: &f64| (error.powi(2) - noise.powi(2)).max((UNKNOWN_NOISE * noise).powi(2)).sqrt();
    let least = held_out.iter().map(beyond).fold(f64::INFINITY, f64::min);
    held_out.iter().map(|error| beyond(error) <= CREDIBLE * least).collect()
}

/// Of every family, how its inverse does on the others that are plants.
fn trials(
    models: &[(Family, &Model)],
    held_out: &[f64],
    credible: &[bool],
) -> Vec<Vec<(usize, Candidate)>> {
    let plants: Vec<usize> = (0..models.len()).filter(|index| credible[*index]).collect();
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
            trial.error() <= FOLLOWED * held_out[index].hypot(held_out[*plant])
        };
        trials.iter().filter(follows).map(|(plant, _)| *plant)
    });
    good.collect()
}

/// The family to take. Scores are in the order of [`Family::ALL`], the simplest first.
pub(super) fn best(scores: &[Score]) -> Option<Family> {
    let extends = |it: &&Score| !it.hides_plane || it.family.extends();
    let scores: Vec<Score> = scores.iter().filter(extends).cloned().collect();
    // Those that were not tried are worse on the rows held out.
    let tried: Vec<Score> = scores.iter().filter(|it| !it.parts.is_empty()).cloned().collect();
    let scores = if tried.is_empty() { scores } else { tried };
    let mut good = as_good(&scores).into_iter().map(|index| scores[index].family);
    let simplest = good.next();
    good.find(|family| *family == Family::ForceBalance).or(simplest)
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
        let goals = path.wander.iter().map(|counts| straight.predict(counts, &none).mean).collect();
        Self { outputs: straight.outputs(), goals, path }
    }
}

struct Candidate {
    /// Square length of the error in every tick that counts.
    squares: Vec<f64>,
    /// Relative to the path of the goals.
    travel: f64,
}

impl Candidate {
    fn error(&self) -> f64 {
        (self.squares.iter().sum::<f64>() / self.squares.len() as f64).sqrt()
    }
}

/// Tracks the goals with the inverse of a model on another one.
fn track(model: &Model, plant: &Model, goals: &Goals) -> Candidate {
    let (mut known, mut real) = (model.new_memory(), plant.new_memory());
    for counts in &goals.path.turns {
        model.advance_over(&mut known, counts, TICK_S);
        plant.advance_over(&mut real, counts, TICK_S);
    }
    let mut counts = goals.path.turns.last().copied().unwrap_or_default();
    let (mut squares, mut travel) = (Vec::with_capacity(TICKS), 0.0);
    for (tick, goal) in goals.goals.iter().enumerate() {
        let target = model.invert(goal, &known, &Query::new(counts)).counts;
        let mut next = counts;
        for motor in 0..2 {
            let fastest = FASTEST * goals.path.half_ranges[motor];
            next[motor] += (target[motor] - counts[motor]).clamp(-fastest, fastest);
        }
        model.advance_over(&mut known, &next, TICK_S);
        plant.advance_over(&mut real, &next, TICK_S);
        let reached = plant.predict(&next, &real).mean;
        if tick >= SETTLING {
            travel += ExaminationPath::distance(&counts, &next);
            let pairs = reached.iter().zip(goal).take(goals.outputs);
            squares.push(pairs.map(|(reached, goal)| (reached - goal).powi(2)).sum());
        }
        counts = next;
    }
    let straight = goals.path.travel().max(f64::MIN_POSITIVE);
    Candidate { squares, travel: travel / straight }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(family: Family, held_out: [f64; 4]) -> Score {
        Score {
            family,
            held_out: rms(&held_out.map(|error| error.powi(2))),
            blocks: held_out.map(|error| error.powi(2)).to_vec(),
            parts: Vec::new(),
            tracking: None,
            nearest: None,
            travel: 1.0,
            hides_plane: false,
        }
    }

    /// A trial on a plant, with the same error throughout.
    fn on(plant: usize, error: f64) -> (usize, Candidate) {
        (plant, Candidate { squares: vec![error.powi(2); 4], travel: 1.0 })
    }

    #[test]
    fn an_inverse_that_only_its_own_model_likes_loses() {
        let scores = vec![
            score(Family::Linear, [2.0; 4]),
            score(Family::GmrPlay, [0.2, 0.18, 0.21, 0.19]),
            score(Family::ForceBalance, [0.19; 4]),
        ];
        let trials = [vec![on(1, 2.0)], vec![on(0, 0.3)], vec![on(0, 0.9)]];
        assert_eq!(best(&scores), Some(Family::ForceBalance));
        assert_eq!(best(&decided(scores, &trials)), Some(Family::GmrPlay));
    }

    /// The numbers of a tendon in a sheath: each of the two was run on the other alone.
    #[test]
    fn plant_that_is_itself_in_question_decides_nothing() {
        let scores = vec![
            score(Family::GmrPlay, [0.8, 0.7, 0.83, 0.77]),
            score(Family::ForceBalance, [0.5, 0.42, 0.47, 0.48]),
        ];
        let trials = [vec![on(1, 0.9)], vec![on(0, 3.1)]];
        assert_eq!(best(&decided(scores, &trials)), Some(Family::ForceBalance));
    }

    /// The numbers of a snake recorded along pitch, then along yaw: the plays, half as wrong on the
    /// rows held out, are 10 deg wrong between the axes, and the balance 1.6 deg.
    #[test]
    fn of_one_axis_at_a_time_no_mixture_is_chosen() {
        let families = [(Family::Linear, 2.5), (Family::GmrPlay, 0.1), (Family::ForceBalance, 0.2)];
        let mut scores = families.map(|(family, error)| score(family, [error; 4]));
        assert_eq!(best(&scores), Some(Family::GmrPlay));
        scores.iter_mut().for_each(|it| it.hides_plane = true);
        assert_eq!(best(&scores), Some(Family::ForceBalance));
    }

    /// The numbers of a cable arm, of `linear`, `gmr` and a balance of friction.
    #[test]
    fn a_family_that_no_other_can_follow_does_not_vote() {
        let held_out = [2.05, 1.23, 0.97];
        let trials = [vec![on(1, 1.62), on(2, 14.26)], vec![on(2, 14.66)], vec![on(1, 25.71)]];
        assert_eq!(followed(&trials, &held_out), [1]);
    }

    /// Of the balance the same block is the worst, but a little better: that is no chance.
    #[test]
    fn only_what_is_not_sure_goes_to_the_balance() {
        let plays = score(Family::GmrPlay, [0.4, 0.9, 0.5, 0.6]);
        let chosen = |balance: [f64; 4]| {
            let scores = vec![plays.clone(), score(Family::ForceBalance, balance)];
            best(&decided(scores, &[vec![on(1, 0.3)], vec![on(0, 0.3)]]))
        };
        assert_eq!(chosen([0.5, 0.7, 0.6, 0.6]), Some(Family::ForceBalance));
        assert_eq!(chosen([0.43, 0.98, 0.53, 0.65]), Some(Family::GmrPlay));
        // Without the balance the simpler one is taken.
        let gmr = score(Family::Gmr, [0.5, 0.7, 0.6, 0.6]);
        assert_eq!(best(&[gmr, plays.clone()]), Some(Family::Gmr));
        assert_eq!(best(&[]), None);
    }

    /// The numbers of a cable arm: the inverse of the mixture was tried on no other family.
    #[test]
    fn no_three_families_beat_each_other_in_a_ring() {
        let scores = vec![
            score(Family::Linear, [2.1, 2.0, 1.9, 2.2]),
            score(Family::Gmr, [1.3, 1.2, 1.1, 1.3]),
            score(Family::ForceBalance, [1.0, 0.9, 1.0, 1.1]),
        ];
        let trials = [vec![on(1, 1.6)], Vec::new(), vec![on(1, 14.7)]];
        let scores = decided(scores, &trials);
        let ring = [[1, 0], [2, 1], [2, 0]];
        for [better, worse] in ring {
            assert!(scores[better].beside(&scores[worse]).0 < 0.0, "{better} {worse}");
        }
        assert_eq!(best(&scores), Some(Family::ForceBalance));
    }

    /// The numbers of a snake of springs, by strokes of both axes, deg: plays that leave half as
    /// much again as there is noise, and a balance that leaves hardly more than that.
    #[test]
    fn what_is_beyond_the_noise_makes_a_family_credible() {
        assert_eq!(credible(&[2.745, 0.175, 0.106], 0.098), [false, false, true]);
        assert_eq!(credible(&[2.745, 0.175, 0.106], 0.0), [false, true, true]);
        assert_eq!(credible(&[0.11, 0.1, 0.098], 0.098), [true; 3]);
    }

    /// The numbers of a wide instrument: the inverse of the plays was tried on no other family.
    #[test]
    fn different_scores_are_compared_by_rows_held_out() {
        let plays = score(Family::GmrPlay, [1.02, 2.27, 0.68, 1.77]);
        let balance = score(Family::ForceBalance, [0.91, 2.54, 2.41, 1.0]);
        let scores = decided(vec![plays, balance], &[Vec::new(), vec![on(0, 5.4)]]);
        let (worse, error) = scores[1].beside(&scores[0]);
        assert!(worse > 0.0 && worse < error, "{worse} +- {error}");
        assert_eq!(best(&scores), Some(Family::ForceBalance));
    }
}
