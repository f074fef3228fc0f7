//! The state so far, in a file of the folder: stages with their results, and findings with their
//! evidence. An interrupted commissioning resumes from it.

use std::{collections::BTreeMap, fmt, fs, path::Path};

use i2ris::wall_clock;
use i2ris_report::{Failure, files};
use serde::{Deserialize, Serialize};

pub const FILE: &str = "commission.json";

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

    pub fn announcement(self) -> &'static str {
        match self {
            Self::Identify => {
                "The identity of every drive is read. Nothing is written, nothing moves."
            }
            Self::Settings => {
                "Every setting of every drive is read and compared with the configuration. Nothing \
                 is written, nothing moves."
            }
            Self::Power => {
                "Limits are written into every drive, a power-up fault is acknowledged, and one \
                 drive after the other has power for 5 s, without current. NOTHING MOVES; a motion \
                 of more than 2 counts cuts the power. Keep one hand on the supply switch: it is \
                 the emergency stop. Ctrl-C also switches off."
            }
            Self::Steps => {
                "EVERY MOTOR MOVES, one after the other, AT MOST 20 COUNTS either way: first \
                 current pulses, which show that encoder and motor agree, then single counts. \
                 Detach the snake. Keep one hand on the supply switch; Ctrl-C switches off."
            }
            Self::Gear => {
                "EVERY MOTOR MOVES, one after the other: AT MOST 20 COUNTS either way, and one \
                 whole turn only after a second typed permission. The current shows the gear play. \
                 Detach the snake. Keep one hand on the supply switch; Ctrl-C switches off."
            }
            Self::Exchanges => {
                "The encoders are read 10000 times, in about half a minute. The drives are off, \
                 nothing moves."
            }
            Self::Stops => {
                "Failure tests: the cable is pulled, the controller is killed, the supply is \
                 switched. Drives hold with power for at most 60 s, NOTHING MOVES. Each test needs \
                 a separate permission."
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
    /// Done, except for tests that the operator did not permit or observe.
    Partly,
    Failed,
    /// Not permitted, or interrupted.
    Left,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StageRecord {
    pub stage: Stage,
    pub outcome: Outcome,
    pub at: String,
    pub text: String,
}

/// The findings. Those up to `Play` are unknown before the first day.
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

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    pub topic: Topic,
    pub place: String,
    pub value: String,
    pub evidence: String,
}

/// Value of a test that was not done; the evidence gives the reason.
pub const NOT_ASKED: &str = "not asked";
/// Value where the drive lacks the feature.
pub const NOT_THERE: &str = "does not apply";

/// Currents on the way back: counts from the start, and mA in the direction of motion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Sweep {
    pub place: String,
    pub back: Vec<(i32, i32)>,
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Record {
    pub robot_id: String,
    pub software: String,
    pub config: String,
    pub stages: Vec<StageRecord>,
    pub findings: Vec<Finding>,
    pub differences: Vec<String>,
    /// Histograms of the exchange duration per port, microseconds.
    pub exchanges: Vec<(String, Vec<(u32, u32)>)>,
    pub sweeps: Vec<Sweep>,
    #[serde(default)]
    pub frictions_ma: BTreeMap<String, f64>,
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
        Ok(files::write(&folder.join(FILE), serde_json::to_string_pretty(self)?)?)
    }

    pub fn is_done(&self, stage: Stage) -> bool {
        self.stages.iter().any(|it| it.stage == stage && it.outcome == Outcome::Done)
    }

    pub fn end_stage(&mut self, stage: Stage, outcome: Outcome, text: String) {
        let at = wall_clock::now().to_string();
        let goes_on = matches!(outcome, Outcome::Done | Outcome::Partly);
        self.stages.retain(|it: &StageRecord| it.stage < stage || it.stage > stage && goes_on);
        self.stages.push(StageRecord { stage, outcome, at, text });
        self.stages.sort_by_key(|it| it.stage);
    }

    pub fn find(&mut self, topic: Topic, place: &str, value: &str, evidence: String) {
        self.findings.retain(|it| (it.topic, it.place.as_str()) != (topic, place));
        let (place, value) = (place.to_owned(), value.to_owned());
        self.findings.push(Finding { topic, place, value, evidence });
        self.findings.sort_by(|a, b| (a.topic, &a.place).cmp(&(b.topic, &b.place)));
    }

    pub fn skip(&mut self, topic: Topic, place: &str, why: &str) {
        self.find(topic, place, NOT_ASKED, format!("because {why}"));
    }

    /// Summary: number of completed stages, and reasons for the others.
    pub fn sum(&self) -> String {
        let done = Stage::ALL.into_iter().filter(|stage| self.is_done(*stage)).count();
        let open = self.stages.iter().filter(|it| it.outcome != Outcome::Done);
        let open: Vec<String> = open.map(|it| format!("; {}: {}", it.stage, it.text)).collect();
        let again = if open.is_empty() { "" } else { "; run the same command for the rest" };
        format!("{done} of {} stages are done{}{again}.", Stage::ALL.len(), open.concat())
    }

    pub fn not_asked(&self, stage: Stage) -> Vec<String> {
        let is_of = |topic| Topic::ALL.iter().any(|it| (it.0, it.1) == (topic, stage));
        let open = self.findings.iter().filter(|it| it.value == NOT_ASKED && is_of(it.topic));
        open.map(|it| format!("{} ({})", it.topic.name(), it.place)).collect()
    }

    pub fn all_findings(&self) -> Vec<Finding> {
        let mut all = self.findings.clone();
        for (topic, stage, _) in Topic::ALL {
            if !all.iter().any(|it| it.topic == topic) {
                let evidence = format!("because the stage `{stage}` did not get that far");
                let (place, value) = ("-".to_owned(), NOT_ASKED.to_owned());
                all.push(Finding { topic, place, value, evidence });
            }
        }
        all.sort_by_key(|it| it.topic);
        all
    }
}

/// A key of a port, or of one of its axes, and its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Change {
    pub port: usize,
    pub axis: Option<usize>,
    pub key: String,
    pub value: String,
}
