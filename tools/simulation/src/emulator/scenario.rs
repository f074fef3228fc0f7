//! Injected faults: with their times from scenario files, at once by the control socket.
//!
//! ```toml
//! seed = 7
//! [[at]]
//! ms = 1500
//! axis = 0
//! kind = "late-reply"
//! delay_ms = 60
//! [random]
//! every_ms = 200
//! kinds = ["flip-reply", "lose-request"]
//! [[ageing]]
//! parameter = "gap"
//! by = 0.4
//! course = "ramp"
//! over_s = 600
//! [[camera]]
//! start_s = 60
//! for_s = 30
//! fault = "swapped"
//! ```
//!
//! A line of the control socket is one `[[at]]` as an inline table without `ms`:
//! `{axis = 1, kind = "reset"}`; or one of the other tables by name:
//! `ageing = {parameter = "zero", by = 1, course = "step"}`, `camera = {fault = "frozen"}`. The
//! line `camera = "good"` ends all faults of the camera, `state` returns the state of the drives.

use std::path::{Path, PathBuf};
use std::{fs, io};

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::injection::{AxisInjection, Injection};
use crate::ageing::Change;
use crate::camera::TimedCameraFault;

/// An injection at a fixed time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimedInjection {
    /// Milliseconds after the start.
    pub ms: u64,
    #[serde(default)]
    pub axis: usize,
    #[serde(flatten)]
    pub injection: Injection,
}

/// Repeated injections at random times.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RandomInjections {
    /// The mean interval, milliseconds.
    pub every_ms: u64,
    /// The kinds to choose from; empty: all.
    #[serde(default)]
    pub kinds: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// Determines everything random in it. Absent: the seed of the emulator.
    pub seed: Option<u64>,
    /// At fixed times.
    pub at: Vec<TimedInjection>,
    /// At random times.
    pub random: Option<RandomInjections>,
    /// Changes of the snake with age.
    pub ageing: Vec<Change>,
    pub camera: Vec<TimedCameraFault>,
}

/// A line of the control socket.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum SocketCommand {
    Inject(AxisInjection),
    Age(Change),
    Camera(TimedCameraFault),
    /// Ends all faults of the camera.
    CameraGood,
}

#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    #[error("cannot read scenario {path}: {source}; name an existing file with --scenario")]
    Read { path: PathBuf, source: io::Error },
    #[error("scenario is not valid: {0}")]
    Parse(#[from] Box<toml::de::Error>),
    #[error("scenario: {0}")]
    Value(String),
}

impl Scenario {
    pub fn load(path: &Path) -> Result<Self, ScenarioError> {
        let path_of = |source| ScenarioError::Read { path: path.to_owned(), source };
        Self::parse(&fs::read_to_string(path).map_err(path_of)?)
    }

    /// Parses and checks the text of a file.
    pub fn parse(text: &str) -> Result<Self, ScenarioError> {
        let mut scenario: Self = toml::from_str(text).map_err(Box::new)?;
        for timed in &scenario.at {
            check_axis(timed.axis)?;
        }
        if let Some(random) = &scenario.random {
            random.check().map_err(ScenarioError::Value)?;
        }
        scenario.ageing.iter().try_for_each(check_change)?;
        for fault in &scenario.camera {
            fault.check().map_err(ScenarioError::Value)?;
        }
        scenario.at.sort_by_key(|timed| timed.ms);
        Ok(scenario)
    }
}

/// Parses a line of the control socket.
pub(super) fn parse_line(line: &str) -> Result<SocketCommand, ScenarioError> {
    #[derive(Deserialize)]
    #[serde(rename_all = "kebab-case", deny_unknown_fields)]
    enum Line {
        Inject(AxisInjection),
        Ageing(Change),
        Camera(CameraLine),
    }
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum CameraLine {
        Word(Good),
        Fault(TimedCameraFault),
    }
    #[derive(Deserialize)]
    #[serde(rename_all = "kebab-case")]
    enum Good {
        Good,
    }
    let text = if line.starts_with('{') { format!("inject = {line}") } else { line.to_owned() };
    match toml::from_str(&text).map_err(Box::new)? {
        Line::Inject(inject) => check_axis(inject.axis).map(|()| SocketCommand::Inject(inject)),
        Line::Ageing(change) => check_change(&change).map(|()| SocketCommand::Age(change)),
        Line::Camera(CameraLine::Word(Good::Good)) => Ok(SocketCommand::CameraGood),
        Line::Camera(CameraLine::Fault(fault)) => {
            fault.check().map_err(ScenarioError::Value)?;
            Ok(SocketCommand::Camera(fault))
        }
    }
}

fn check_change(change: &Change) -> Result<(), ScenarioError> {
    change.check().map_err(|error| ScenarioError::Value(error.to_string()))
}

fn check_axis(axis: usize) -> Result<(), ScenarioError> {
    let error = || ScenarioError::Value(format!("axis {axis}: must be 0 or 1"));
    if axis < 2 { Ok(()) } else { Err(error()) }
}

impl RandomInjections {
    fn check(&self) -> Result<(), String> {
        if self.every_ms == 0 {
            return Err("random.every_ms must be above 0".to_owned());
        }
        let is_unknown = |kind: &&String| !Injection::NAMES.contains(&kind.as_str());
        let Some(kind) = self.kinds.iter().find(is_unknown) else { return Ok(()) };
        Err(format!("unknown kind {kind}; known kinds: {}", Injection::NAMES.join(", ")))
    }

    /// Draws an injection of the kinds, and the time until the next one, milliseconds.
    pub fn draw(&self, random: &mut impl Rng) -> (Option<Injection>, u64) {
        let mut kinds = Injection::all(random);
        kinds.retain(|injection| {
            self.kinds.is_empty() || self.kinds.iter().any(|kind| kind == injection.name())
        });
        let chosen = (!kinds.is_empty()).then(|| kinds[random.random_range(0..kinds.len())]);
        (chosen, random.random_range(1..=2 * self.every_ms))
    }
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::camera::CameraFault;

    #[test]
    fn a_file_is_sorted_by_time() {
        let text = "seed = 7\n[[at]]\nms = 900\nkind = \"reset\"\n\
                    [[at]]\nms = 10\naxis = 1\nkind = \"late-reply\"\ndelay_ms = 60\n\
                    [random]\nevery_ms = 50\nkinds = [\"flip-reply\"]";
        let scenario = Scenario::parse(text).unwrap();
        let [first, second] = scenario.at[..] else { panic!("two") };
        assert_eq!((first.ms, first.axis), (10, 1));
        assert_eq!(first.injection, Injection::LateReply { delay_ms: 60 });
        assert_eq!(second.injection, Injection::Reset);
        let (drawn, _) = scenario.random.unwrap().draw(&mut Pcg64Mcg::new(1));
        assert_eq!(drawn.unwrap().name(), "flip-reply");
    }

    #[test]
    fn unknown_kinds_axes_and_missing_values_are_refused() {
        for (text, part) in [
            ("[[at]]\nms = 1\nkind = \"explode\"", "explode"),
            ("[[at]]\nms = 1\naxis = 2\nkind = \"reset\"", "axis 2"),
            ("[[at]]\nms = 1\nkind = \"late-reply\"", "delay_ms"),
            ("[[at]]\nms = 1\nkind = \"cut-reply\"\nplace = 3", "offset"),
            ("[random]\nevery_ms = 5\nkinds = [\"reset\", \"rest\"]", "unknown kind rest"),
            ("[random]\nevery_ms = 0", "above 0"),
        ] {
            let error = Scenario::parse(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn a_line_of_the_socket_is_one_table() {
        let line = parse_line("{axis = 1, kind = \"fault\", code = 0x2310}").unwrap();
        let expected = AxisInjection { axis: 1, injection: Injection::Fault { code: 0x2310 } };
        assert_eq!(line, SocketCommand::Inject(expected));
        assert!(parse_line("reset").is_err());
    }

    #[test]
    fn socket_lines_age_the_snake_or_disturb_the_camera() {
        let line = "ageing = {parameter = \"zero\", by = 1, course = \"step\"}";
        let SocketCommand::Age(change) = parse_line(line).unwrap() else { panic!("{line}") };
        assert_eq!(change.by, 1.0);
        let line = "camera = {fault = \"late-stamps\", ms = 20, for_s = 3}";
        let SocketCommand::Camera(timed) = parse_line(line).unwrap() else { panic!("{line}") };
        assert_eq!(timed.fault, CameraFault::LateStamps { ms: 20.0 });
        assert_eq!(parse_line("camera = \"good\"").unwrap(), SocketCommand::CameraGood);
        for (line, words) in [
            ("ageing = {parameter = \"gap\", by = -2, course = \"step\"}", "above -1"),
            ("camera = {fault = \"outliers\", share = 2, size_deg = 1}", "share"),
            ("camera = \"bad\"", "camera"),
            ("weather = 3", "weather"),
        ] {
            let error = parse_line(line).unwrap_err().to_string();
            assert!(error.contains(words), "{line}: {error}");
        }
    }

    #[test]
    fn a_file_holds_ageing_and_faults_of_the_camera() {
        let text = "[[ageing]]\nparameter = \"gap\"\nby = 0.4\ncourse = \"ramp\"\n\
                    over_s = 600\n[[camera]]\nstart_s = 60\nfault = \"swapped\"";
        let scenario = Scenario::parse(text).unwrap();
        assert_eq!((scenario.ageing.len(), scenario.camera.len()), (1, 1));
        let wrong = text.replace("600", "-1");
        let error = Scenario::parse(&wrong).unwrap_err().to_string();
        assert!(error.contains("over_s = -1"), "{error}");
    }
}
