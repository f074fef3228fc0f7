//! The steps of the walk.

use std::fmt;

use i2ris_calibration::fit::Choice;

use super::Walk;

/// Length of the recording that no model has seen, s.
const UNSEEN_S: f64 = 30.0;

/// A step, in the order in which they are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    Collect,
    Fit,
    Compare,
    Stage,
    Activate,
    Check,
}

/// All steps.
pub const STEPS: [Step; 6] =
    [Step::Collect, Step::Fit, Step::Compare, Step::Stage, Step::Activate, Step::Check];

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Collect => "collect",
            Self::Fit => "fit",
            Self::Compare => "compare",
            Self::Stage => "stage",
            Self::Activate => "activate",
            Self::Check => "check",
        })
    }
}

impl Step {
    /// What it is for.
    pub fn purpose(self) -> &'static str {
        match self {
            Self::Collect => "the motors move through the plane while the camera measures",
            Self::Fit => "a model is fitted to the recording",
            Self::Compare => "the model is judged on a short recording that it has not seen",
            Self::Stage => "the controller reads and checks the model; the robot stays as it is",
            Self::Activate => "the model takes over, and a conditioning cycle makes it exact",
            Self::Check => "the snake follows a circle, and the camera measures the error",
        }
    }

    /// How long it usually takes, s.
    pub fn usual_s(self, walk: &Walk) -> f64 {
        match self {
            Self::Collect => walk.duration_s + 40.0,
            Self::Fit if walk.family == Choice::Best => 240.0,
            Self::Fit => 30.0,
            Self::Compare => UNSEEN_S + 40.0,
            Self::Stage => 5.0,
            Self::Activate => 30.0,
            Self::Check => 25.0,
        }
    }

    /// The words of its commands.
    pub fn commands(self, walk: &Walk) -> Vec<Vec<String>> {
        let file = |name: &str| walk.path(name).display().to_string();
        let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
        let (recording, unseen) = (file("recording.csv"), file("unseen.csv"));
        let model = file("model.json");
        match self {
            Self::Collect => vec![walk.collect(&recording, walk.duration_s, 1)],
            Self::Fit => {
                let (family, report) = (walk.family.to_string(), file("report.html"));
                let fit = [
                    "calibrate",
                    "fit",
                    &recording,
                    "--family",
                    &family,
                    "--output",
                    &model,
                    "--report",
                    &report,
                    "--overwrite",
                ];
                vec![words(&fit)]
            }
            Self::Compare => {
                let mut commands = Vec::new();
                if !super::progress::is_complete(&walk.path("unseen.csv")) {
                    commands.push(walk.collect(&unseen, UNSEEN_S, 2));
                }
                let compare = ["calibrate", "compare", &model, "--recording", &unseen];
                commands.push(words(&compare));
                commands
            }
            Self::Stage => vec![words(&["model", "stage", &model])],
            // The memory of a model that takes over is unknown; conditioning makes it known.
            Self::Activate => vec![
                words(&["model", "activate", "--force"]),
                words(&["command", "state", "condition"]),
            ],
            Self::Check => {
                let circle = [
                    "command",
                    "circle",
                    "--radius-deg",
                    "5",
                    "--period-s",
                    "6",
                    "--duration-s",
                    "18",
                    "--enable",
                ];
                vec![words(&circle)]
            }
        }
    }
}

impl Walk {
    fn collect(&self, output: &str, duration_s: f64, seed: u64) -> Vec<String> {
        let config = self.config.display().to_string();
        let (duration, seed) = (duration_s.to_string(), seed.to_string());
        let words = [
            "calibrate",
            "collect",
            "--config",
            &config,
            "--domain",
            self.domain.name(),
            "--home",
            "--duration-s",
            &duration,
            "--seed",
            &seed,
            "--output",
            output,
        ];
        words.map(str::to_owned).to_vec()
    }
}
