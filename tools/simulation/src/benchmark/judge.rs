//! One snake, from the recording to the errors.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use i2ris::model::{Model, Query};
use i2ris_calibration::fit::{Choice, Family, FitOutcome};
use i2ris_calibration::recording::Recording;
use serde::Serialize;

use super::laboratory::Laboratory;
use super::tracking::{ExactPilot, Tracking, follow};
use super::{Arguments, Brought, Failure};
use crate::closed_loop::ClosedLoop;
use crate::motion::unseen_motion::Motion;
use crate::physics::DrawnSnake;
use crate::robot::Robot;

/// Offset of the seeds of motions: no calibration has the same seed.
pub const MOTION_SEEDS: u64 = 1000;

/// How a model follows a motion on a snake.
#[derive(Debug, Clone, Serialize)]
pub struct Judgement {
    pub physics: String,
    pub seed: u64,
    /// As asked for: `best` or the name of a family.
    pub family: String,
    /// The family of the model, or why there is none.
    pub model: String,
    /// Seconds of the fit. `best` fits all families.
    pub fit_s: f64,
    pub motion: String,
    /// Absent: there is no model, or the robot could not follow.
    pub tracking: Option<Tracking>,
    pub linear: Option<Tracking>,
    pub exact: Tracking,
}

/// A motion and its goals, deg.
pub type Path = (Motion, Vec<[f64; 2]>);

/// A goal has to be this much inside the reach of the linear model: gaps need room, too.
const MARGIN: f64 = 1.15;

/// The motions, made smaller where the calibrated hull does not reach: what is judged is the model,
/// not the size of the hull.
pub fn within_reach(motions: &[Path], linear: &Model) -> Vec<Path> {
    let memory = linear.new_memory();
    let reached = |goal: &[f64; 2], size: f64| {
        let goal = [goal[0], goal[1], 0.0].map(|angle| (angle * size * MARGIN).to_radians());
        !linear.invert(&goal, &memory, &Query::new([0.0; 2])).clipped
    };
    let smaller = |(motion, path): &Path| {
        let sizes = (4..=20).rev().map(|step| f64::from(step) / 20.0);
        let size = sizes
            .into_iter()
            .find(|size| path.iter().all(|goal| reached(goal, *size)))
            .unwrap_or(0.2);
        let scaled = path.iter().map(|goal| goal.map(|angle| angle * size));
        (*motion, scaled.collect())
    };
    motions.iter().map(smaller).collect()
}

/// Everything that is the same for all snakes.
pub struct Judge {
    laboratory: Laboratory,
    families: Vec<Choice>,
    brought: Vec<Brought>,
    each: bool,
    motions: Vec<Path>,
}

struct Candidate {
    family: String,
    model: Result<Arc<Model>, String>,
    fit_s: f64,
    name: String,
}

impl Judge {
    pub fn new(arguments: &Arguments, folder: PathBuf) -> Result<Self, Failure> {
        let seed = arguments.first_seed;
        let path = |motion: &Motion| {
            let path = motion.path(arguments.motion_s, MOTION_SEEDS + seed);
            (*motion, path)
        };
        Ok(Self {
            laboratory: Laboratory::new(arguments, folder)?,
            families: arguments.families.clone(),
            brought: arguments.models.clone(),
            each: arguments.each,
            motions: arguments.motions.iter().map(path).collect(),
        })
    }

    /// Records, fits and follows. The error says why there is nothing to judge.
    pub fn judge(&self, snake: DrawnSnake) -> Result<Vec<Judgement>, String> {
        let name = format!("{}-{}.csv", snake.physics, snake.seed);
        let recording = self.laboratory.record(snake, Robot::new(snake.build()), &name)?;
        let candidates = self.candidates(snake, &recording)?;
        let linear = candidates.first().and_then(|first| first.model.as_ref().ok());
        let motions = within_reach(&self.motions, linear.ok_or("there is no linear model")?);
        let exact = self.exact(snake, &motions)?;
        let follow = |candidate: &Candidate| self.follow(snake, candidate, &motions);
        let linear = candidates.first().map(follow);
        let linear = linear.and_then(|(_, tracked)| tracked);
        let mut judgements = Vec::new();
        for candidate in &candidates {
            let (model, tracked) = match &linear {
                Some(tracked) if candidate.family == "linear" => {
                    (candidate.name.clone(), Some(tracked.clone()))
                }
                _ => follow(candidate),
            };
            for (number, (motion, _)) in self.motions.iter().enumerate() {
                judgements.push(Judgement {
                    physics: snake.physics.to_string(),
                    seed: snake.seed,
                    family: candidate.family.clone(),
                    model: model.clone(),
                    fit_s: candidate.fit_s,
                    motion: motion.to_string(),
                    tracking: tracked.as_ref().map(|tracked| tracked[number]),
                    linear: linear.as_ref().map(|linear| linear[number]),
                    exact: exact[number],
                });
            }
        }
        Ok(judgements)
    }

    /// The first is `linear`.
    fn candidates(
        &self,
        snake: DrawnSnake,
        recording: &Recording,
    ) -> Result<Vec<Candidate>, String> {
        let attempt = |choice: Choice| {
            let begun = Instant::now();
            let outcome = self.laboratory.fit(recording, choice);
            (outcome, begun.elapsed().as_secs_f64())
        };
        let (linear, seconds) = attempt(Choice::One(Family::Linear));
        let linear = linear.map_err(|error| format!("cannot fit: {error}"))?;
        let mut found = vec![Candidate::new("linear", Ok(&linear), seconds)];
        for choice in self.families.iter().copied() {
            if choice == Choice::One(Family::Linear) {
                continue;
            }
            let (outcome, seconds) = attempt(choice);
            let name = choice.to_string();
            found.push(Candidate::new(&name, outcome.as_ref(), seconds));
            if let (Choice::Best, true, Ok(outcome)) = (choice, self.each, &outcome) {
                found.extend(Candidate::each(outcome));
            }
        }
        found.extend(self.brought.iter().map(|brought| {
            let begun = Instant::now();
            let model = self.laboratory.brought(&brought.folder, snake, recording);
            Candidate {
                family: brought.name.clone(),
                name: if model.is_ok() { brought.name.clone() } else { "none".to_owned() },
                model,
                fit_s: begun.elapsed().as_secs_f64(),
            }
        }));
        Ok(found)
    }

    fn exact(&self, snake: DrawnSnake, motions: &[Path]) -> Result<Vec<Tracking>, String> {
        let robot = Robot::new(snake.build());
        follow(&mut ExactPilot::new(&self.laboratory.config, robot), motions)
    }

    /// The model, or why it does not follow.
    fn follow(
        &self,
        snake: DrawnSnake,
        candidate: &Candidate,
        motions: &[Path],
    ) -> (String, Option<Vec<Tracking>>) {
        let tracked = candidate.model.clone().and_then(|model| {
            let robot = Robot::new(snake.build());
            let control = ClosedLoop::conditioned(&self.laboratory.config, &model, robot);
            follow(&mut control.map_err(|error| error.to_string())?, motions)
        });
        match tracked {
            Ok(tracked) => (candidate.name.clone(), Some(tracked)),
            Err(reason) => (reason, None),
        }
    }
}

impl Candidate {
    fn new(family: &str, outcome: Result<&FitOutcome, &String>, fit_s: f64) -> Self {
        Self {
            family: family.to_owned(),
            model: outcome.map(|outcome| Arc::clone(&outcome.model)).map_err(Clone::clone),
            fit_s,
            name: outcome.map_or_else(|_| "none".to_owned(), |found| found.family.to_string()),
        }
    }

    /// All families of one fit but `linear`.
    fn each(outcome: &FitOutcome) -> Vec<Self> {
        let families = outcome.families.iter();
        families
            .filter(|found| found.family != Family::Linear)
            .map(|found| Self {
                family: found.family.to_string(),
                model: match &found.result {
                    Ok(model) => Ok(Arc::clone(model)),
                    Err(error) => Err(error.to_string()),
                },
                fit_s: found.seconds,
                name: found.family.to_string(),
            })
            .collect()
    }
}
