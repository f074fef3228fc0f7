//! What is known so far, in a file of the folder: stages with their results, and what was found with
//! its evidence. A commissioning that was left is taken up again from it.

use std::path::Path;
use std::{fmt, fs};

use i2ris::wall_clock;
use i2ris_report::Failure;
use i2ris_report::files::replace;
use serde::{Deserialize, Serialize};

use super::proposal::Change;

pub const FILE: &str = "commission.json";

/// A stage, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    Identify,
    Settings,
    Power,
    Steps,
    Gear,
    Exchanges,
    Stops,
}

impl Stage {
    pub const ALL: [Self; 7] = {
        use Stage::*;
        [Identify, Settings, Power, Steps, Gear, Exchanges, Stops]
    };

    /// What will happen and move, and how to stop it.
    pub fn announcement(self) -> &'static str {
        match self {
            Self::Identify => "Every drive is asked who it is. Nothing is written, nothing moves.",
            Self::Settings => {
                "Every setting of every drive is read and compared with the configuration. Nothing \
                 is written, nothing moves."
            }
            Self::Power => {
                "Limits are written into every drive as the controller does, a fault of power-up is \
                 acknowledged, and the power of one drive after the other is on for 5 s, with no \
                 current. NOTHING MOVES; more than 2 counts cut the power. One hand on the switch \
                 of the supply: it is the emergency stop. Ctrl-C switches off, too."
            }
            Self::Steps => {
                "EVERY MOTOR MOVES, one after the other, AT MOST 20 COUNTS either way: pulses of \
                 current first, which show that encoder and motor agree, then single counts. \
                 Motors without snake. One hand on the switch of the supply; Ctrl-C switches off."
            }
            Self::Gear => {
                "EVERY MOTOR MOVES, one after the other: AT MOST 20 COUNTS either way, and a whole \
                 turn only where you type a second permission. The current shows the play of the \
                 gear. Motors without snake. One hand on the switch of the supply; Ctrl-C switches \
                 off."
            }
            Self::Exchanges => {
                "The encoders are read 10000 times, which takes half a minute. The drives are off, \
                 nothing moves."
            }
            Self::Stops => {
                "What happens when something fails: the cable is pulled, the controller is killed, \
                 the supply is switched. Drives hold with power for at most 60 s, NOTHING MOVES. \
                 Each has a permission of its own."
            }
        }
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&format!("{self:?}").to_lowercase())
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    Done,
    /// So is the stage, but for what a person did not permit or see.
    Partly,
    Failed,
    /// Nobody permitted it, or it was interrupted.
    Left,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StageRecord {
    pub stage: Stage,
    pub outcome: Outcome,
    /// Local time of its end.
    pub at: String,
    pub text: String,
}

/// What is to be found. Up to `Play` nobody knows it before the first day.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Topic {
    RefusedRead,
    UpperBytes,
    SegmentsBehindGateway,
    PowerUp,
    Silence,
    Halt,
    SoftLimit,
    Interpolation,
    Play,
    Friction,
    Direction,
    CountsPerTurn,
    Exchange,
    CablePulled,
    ControllerKilled,
    SupplySwitched,
}

impl Topic {
    pub const ALL: [(Self, Stage, &'static str); 16] = [
        (Self::RefusedRead, Stage::Identify, "length of a refused read"),
        (Self::UpperBytes, Stage::Identify, "upper bytes of a short read"),
        (Self::SegmentsBehindGateway, Stage::Identify, "segmented reads behind the gateway"),
        (Self::PowerUp, Stage::Identify, "fault at power-up"),
        (Self::Silence, Stage::Power, "behaviour at silence"),
        (Self::Halt, Stage::Steps, "halt while it follows setpoints"),
        (Self::SoftLimit, Stage::Steps, "setpoint beyond the position limits"),
        (Self::Interpolation, Stage::Steps, "interpolation period above 0"),
        (Self::Play, Stage::Gear, "play of the gear"),
        (Self::Friction, Stage::Steps, "current that turns the motor"),
        (Self::Direction, Stage::Gear, "direction of positive counts"),
        (Self::CountsPerTurn, Stage::Gear, "counts per turn of the motor"),
        (Self::Exchange, Stage::Exchanges, "duration of an exchange"),
        (Self::CablePulled, Stage::Stops, "the cable is pulled"),
        (Self::ControllerKilled, Stage::Stops, "the controller is killed"),
        (Self::SupplySwitched, Stage::Stops, "the supply is switched"),
    ];

    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|it| it.0 == self).map_or("", |it| it.2)
    }
}

/// What was found, and by what.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    pub topic: Topic,
    /// A motor, or a port.
    pub place: String,
    pub value: String,
    pub evidence: String,
}

/// The value of what was not asked; the evidence says why.
pub const NOT_ASKED: &str = "not asked";
/// The value of what this drive does not have.
pub const NOT_THERE: &str = "does not apply";

/// Currents along a way and back: counts from the start, and mA in the direction of the motion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Sweep {
    pub place: String,
    pub back: Vec<(i32, i32)>,
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Record {
    pub robot_id: String,
    pub software: String,
    /// The configuration as it was.
    pub config: String,
    pub stages: Vec<StageRecord>,
    pub findings: Vec<Finding>,
    /// Settings that differ from the configuration or the file of the drive.
    pub differences: Vec<String>,
    /// Ports, and how many of their exchanges took so long, microseconds.
    pub exchanges: Vec<(String, Vec<(u32, u32)>)>,
    pub sweeps: Vec<Sweep>,
    pub changes: Vec<Change>,
}

impl Record {
    pub fn load(folder: &Path) -> Result<Option<Self>, Failure> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Ok(None);
        }
        let named = |error: String| format!("{}: {error}; use another --folder", path.display());
        let text = fs::read_to_string(&path).map_err(|error| named(error.to_string()))?;
        Ok(Some(serde_json::from_str(&text).map_err(|error| named(error.to_string()))?))
    }

    pub fn save(&self, folder: &Path) -> Result<(), Failure> {
        let path = folder.join(FILE);
        replace(&path, serde_json::to_string_pretty(self)?.as_bytes())
            .map_err(|error| format!("cannot write {}: {error}", path.display()).into())
    }

    pub fn is_done(&self, stage: Stage) -> bool {
        self.stages.iter().any(|it| it.stage == stage && it.outcome == Outcome::Done)
    }

    /// Notes how a stage ended. What comes behind it has to be done again.
    pub fn end_stage(&mut self, stage: Stage, outcome: Outcome, text: String) {
        let at = wall_clock::now().to_string();
        let goes_on = matches!(outcome, Outcome::Done | Outcome::Partly);
        let is_valid = |it: &StageRecord| it.stage < stage || it.stage > stage && goes_on;
        self.stages.retain(is_valid);
        self.stages.push(StageRecord { stage, outcome, at, text });
        self.stages.sort_by_key(|it| it.stage);
    }

    /// Notes what was found, in the place of what was known before.
    pub fn find(&mut self, topic: Topic, place: &str, value: &str, evidence: String) {
        self.findings.retain(|it| (it.topic, it.place.as_str()) != (topic, place));
        let (place, value) = (place.to_owned(), value.to_owned());
        self.findings.push(Finding { topic, place, value, evidence });
        self.findings.sort_by(|a, b| (a.topic, &a.place).cmp(&(b.topic, &b.place)));
    }

    pub fn skip(&mut self, topic: Topic, place: &str, why: &str) {
        self.find(topic, place, NOT_ASKED, format!("because {why}"));
    }

    /// How many stages are done, and what stands against the others.
    pub fn sum(&self) -> String {
        let done = Stage::ALL.into_iter().filter(|stage| self.is_done(*stage)).count();
        let open = self.stages.iter().filter(|it| it.outcome != Outcome::Done);
        let open: Vec<String> = open.map(|it| format!("; {}: {}", it.stage, it.text)).collect();
        let again = if open.is_empty() { "" } else { "; the same command asks again" };
        format!("{done} of {} stages are done{}{again}.", Stage::ALL.len(), open.concat())
    }

    /// What a stage did not ask, with the places.
    pub fn not_asked(&self, stage: Stage) -> Vec<String> {
        let is_of = |topic| Topic::ALL.iter().any(|it| (it.0, it.1) == (topic, stage));
        let open = self.findings.iter().filter(|it| it.value == NOT_ASKED && is_of(it.topic));
        open.map(|it| format!("{} ({})", it.topic.name(), it.place)).collect()
    }

    /// What was found, and what was not, with the reason.
    pub fn all_findings(&self) -> Vec<Finding> {
        let mut all = self.findings.clone();
        for (topic, stage, _) in Topic::ALL {
            if !all.iter().any(|it| it.topic == topic) {
                let evidence = format!("because the stage `{stage}` did not come so far");
                let (place, value) = ("-".to_owned(), NOT_ASKED.to_owned());
                all.push(Finding { topic, place, value, evidence });
            }
        }
        all.sort_by_key(|it| it.topic);
        all
    }
}
