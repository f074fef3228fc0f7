//! What can be done to drives, lines and wires, and files that say what is done when.
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
//! ```
//!
//! A line of the control socket is what stands in one `[[at]]`, without `ms`:
//! `{axis = 1, kind = "reset"}`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// Something that is done to an axis or to its line. Places are counted from the first byte of a
/// frame and wrap at its end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(
    tag = "kind",
    rename_all = "kebab-case",
    rename_all_fields = "snake_case",
    deny_unknown_fields
)]
pub enum Injection {
    /// The next request is lost.
    LoseRequest,
    /// A byte of the next request is lost.
    DropRequest {
        /// Which byte.
        place: usize,
    },
    /// A bit of the next request is flipped.
    FlipRequest {
        /// Which bit.
        place: usize,
    },
    /// A byte of the next request comes twice.
    DoubleRequest {
        /// Which byte.
        place: usize,
    },
    /// The next request ends early.
    CutRequest {
        /// Before which byte.
        place: usize,
    },
    /// The next reply is lost.
    LoseReply,
    /// A byte of the next reply is lost.
    DropReply {
        /// Which byte.
        place: usize,
    },
    /// A bit of the next reply is flipped.
    FlipReply {
        /// Which bit.
        place: usize,
    },
    /// A byte of the next reply comes twice.
    DoubleReply {
        /// Which byte.
        place: usize,
    },
    /// The next reply ends early.
    CutReply {
        /// Before which byte.
        place: usize,
    },
    /// The next reply ends between the halves of a doubled byte.
    CutReplyInPair,
    /// The next reply comes late.
    LateReply {
        /// By how much, milliseconds.
        delay_ms: u64,
    },
    /// The next reply is an error of a length that no error has.
    WrongLength,
    /// A reply that no one asked for comes before the next one.
    StrayReply,
    /// The port goes away and comes back.
    HangUp {
        /// For how long, milliseconds.
        for_ms: u64,
    },
    /// The drive answers nothing, but carries everything out.
    Mute {
        /// For how long, milliseconds.
        for_ms: u64,
    },
    /// The node is reset: parameters as stored, position lost.
    Reset,
    /// A fault is raised.
    Fault {
        /// Its code.
        code: u16,
    },
    /// The encoder stops counting.
    FreezeEncoder {
        /// For how long, milliseconds.
        for_ms: u64,
    },
    /// The encoder loses or gains counts at once.
    SlipEncoder {
        /// How many.
        counts: i32,
    },
    /// The wire has play.
    SlackWire {
        /// How much, counts.
        counts: u32,
    },
    /// The wire breaks.
    BreakWire,
    /// The wire is as new.
    MendWire,
}

impl Injection {
    /// Every kind, with places and spans drawn at random.
    pub fn all(random: &mut impl Rng) -> Vec<Self> {
        let place = random.random_range(0..64);
        let bit = random.random_range(0..192);
        vec![
            Self::LoseRequest,
            Self::DropRequest { place },
            Self::FlipRequest { place: bit },
            Self::DoubleRequest { place },
            Self::CutRequest { place },
            Self::LoseReply,
            Self::DropReply { place },
            Self::FlipReply { place: bit },
            Self::DoubleReply { place },
            Self::CutReply { place },
            Self::CutReplyInPair,
            Self::LateReply {
                delay_ms: random.random_range(1..300),
            },
            Self::WrongLength,
            Self::StrayReply,
            Self::HangUp {
                for_ms: random.random_range(50..400),
            },
            Self::Mute {
                for_ms: random.random_range(20..600),
            },
            Self::Reset,
            Self::Fault {
                code: [0x2310, 0x3210, 0x3220, 0x8611, 0x4210][random.random_range(0..5)],
            },
            Self::FreezeEncoder {
                for_ms: random.random_range(50..500),
            },
            Self::SlipEncoder {
                counts: random.random_range(-300..300),
            },
            Self::SlackWire {
                counts: random.random_range(20..200),
            },
            Self::BreakWire,
            Self::MendWire,
        ]
    }

    /// Its name in files and tables.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::LoseRequest => "lose-request",
            Self::DropRequest { .. } => "drop-request",
            Self::FlipRequest { .. } => "flip-request",
            Self::DoubleRequest { .. } => "double-request",
            Self::CutRequest { .. } => "cut-request",
            Self::LoseReply => "lose-reply",
            Self::DropReply { .. } => "drop-reply",
            Self::FlipReply { .. } => "flip-reply",
            Self::DoubleReply { .. } => "double-reply",
            Self::CutReply { .. } => "cut-reply",
            Self::CutReplyInPair => "cut-reply-in-pair",
            Self::LateReply { .. } => "late-reply",
            Self::WrongLength => "wrong-length",
            Self::StrayReply => "stray-reply",
            Self::HangUp { .. } => "hang-up",
            Self::Mute { .. } => "mute",
            Self::Reset => "reset",
            Self::Fault { .. } => "fault",
            Self::FreezeEncoder { .. } => "freeze-encoder",
            Self::SlipEncoder { .. } => "slip-encoder",
            Self::SlackWire { .. } => "slack-wire",
            Self::BreakWire => "break-wire",
            Self::MendWire => "mend-wire",
        }
    }

    /// It befalls one exchange on the line.
    #[must_use]
    pub fn is_of_the_line(&self) -> bool {
        use Injection::{
            CutReply, CutReplyInPair, CutRequest, DoubleReply, DoubleRequest, DropReply,
            DropRequest, FlipReply, FlipRequest, LateReply, LoseReply, LoseRequest, StrayReply,
            WrongLength,
        };
        matches!(
            self,
            LoseRequest
                | DropRequest { .. }
                | FlipRequest { .. }
                | DoubleRequest { .. }
                | CutRequest { .. }
                | LoseReply
                | DropReply { .. }
                | FlipReply { .. }
                | DoubleReply { .. }
                | CutReply { .. }
                | CutReplyInPair
                | LateReply { .. }
                | WrongLength
                | StrayReply
        )
    }
}

/// What is done, and to which axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Aimed {
    /// The axis.
    #[serde(default)]
    pub axis: usize,
    /// What.
    #[serde(flatten)]
    pub what: Injection,
}

/// What is done, and when.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Timed {
    /// Milliseconds after the start.
    pub ms: u64,
    /// The axis.
    #[serde(default)]
    pub axis: usize,
    /// What.
    #[serde(flatten)]
    pub what: Injection,
}

/// What is done again and again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Random {
    /// The mean time between two, milliseconds.
    pub every_ms: u64,
    /// The kinds to choose from; none: all.
    #[serde(default)]
    pub kinds: Vec<String>,
}

/// A file that says what is done when.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// Determines everything random in it. Absent: the seed of the emulator.
    pub seed: Option<u64>,
    /// At fixed times.
    pub at: Vec<Timed>,
    /// At random.
    pub random: Option<Random>,
}

/// Why a scenario is refused.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("cannot read scenario {path}: {source}; name an existing file with --scenario")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Not TOML of this shape.
    #[error("scenario is not valid: {0}")]
    Parse(#[from] Box<toml::de::Error>),
    /// A value that makes no sense.
    #[error("scenario: {0}")]
    Value(String),
}

impl Scenario {
    /// Reads and checks a file.
    ///
    /// # Errors
    ///
    /// When it cannot be read, is not TOML of this shape, or names what there is not.
    pub fn load(path: &Path) -> Result<Self, ScenarioError> {
        let text = fs::read_to_string(path).map_err(|source| ScenarioError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text)
    }

    /// Parses and checks the text of a file.
    ///
    /// # Errors
    ///
    /// When it is not TOML of this shape, or names what there is not.
    pub fn parse(text: &str) -> Result<Self, ScenarioError> {
        let mut scenario: Self = toml::from_str(text).map_err(Box::new)?;
        scenario
            .at
            .iter()
            .try_for_each(|timed| check_axis(timed.axis))?;
        if let Some(random) = &scenario.random {
            let known = Injection::all(&mut rand_pcg::Pcg64Mcg::new(1)).map_names();
            if random.every_ms == 0 {
                return Err(ScenarioError::Value(
                    "random.every_ms must be above 0".to_owned(),
                ));
            }
            if let Some(kind) = random
                .kinds
                .iter()
                .find(|kind| !known.contains(&kind.as_str()))
            {
                return Err(ScenarioError::Value(format!(
                    "no kind {kind}; there are {}",
                    known.join(", ")
                )));
            }
        }
        scenario.at.sort_by_key(|timed| timed.ms);
        Ok(scenario)
    }
}

/// Parses a line of the control socket.
///
/// # Errors
///
/// When it is no inline table of this shape, or names an axis that there is not.
pub fn parse_line(line: &str) -> Result<Aimed, ScenarioError> {
    #[derive(Deserialize)]
    struct Line {
        inject: Aimed,
    }
    let Line { inject } = toml::from_str(&format!("inject = {line}")).map_err(Box::new)?;
    check_axis(inject.axis)?;
    Ok(inject)
}

fn check_axis(axis: usize) -> Result<(), ScenarioError> {
    if axis < 2 {
        Ok(())
    } else {
        Err(ScenarioError::Value(format!(
            "axis {axis}: there are 0 and 1"
        )))
    }
}

trait Names {
    fn map_names(&self) -> Vec<&'static str>;
}

impl Names for Vec<Injection> {
    fn map_names(&self) -> Vec<&'static str> {
        self.iter().map(Injection::name).collect()
    }
}

impl Random {
    /// Something of the kinds, and how long until the next, milliseconds.
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

    #[test]
    fn a_file_is_read_in_order_of_time() {
        let scenario = Scenario::parse(
            "seed = 7\n[[at]]\nms = 900\nkind = \"reset\"\n[[at]]\nms = 10\naxis = 1\nkind = \"late-reply\"\n\
             delay_ms = 60\n[random]\nevery_ms = 50\nkinds = [\"flip-reply\"]",
        )
        .unwrap();
        assert_eq!(
            scenario.at[0],
            Timed {
                ms: 10,
                axis: 1,
                what: Injection::LateReply { delay_ms: 60 }
            }
        );
        assert_eq!(scenario.at[1].what, Injection::Reset);
        let (drawn, _) = scenario.random.unwrap().draw(&mut Pcg64Mcg::new(1));
        assert_eq!(drawn.unwrap().name(), "flip-reply");
    }

    #[test]
    fn what_there_is_not_is_refused() {
        for (text, part) in [
            ("[[at]]\nms = 1\nkind = \"explode\"", "explode"),
            ("[[at]]\nms = 1\naxis = 2\nkind = \"reset\"", "axis 2"),
            ("[[at]]\nms = 1\nkind = \"late-reply\"", "delay_ms"),
            (
                "[random]\nevery_ms = 5\nkinds = [\"reset\", \"rest\"]",
                "no kind rest",
            ),
            ("[random]\nevery_ms = 0", "above 0"),
        ] {
            let error = Scenario::parse(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn a_line_of_the_socket_is_one_table() {
        let line = parse_line("{axis = 1, kind = \"fault\", code = 0x2310}").unwrap();
        assert_eq!(
            line,
            Aimed {
                axis: 1,
                what: Injection::Fault { code: 0x2310 }
            }
        );
        assert!(parse_line("reset").is_err());
    }

    #[test]
    fn every_kind_is_named_as_in_files() {
        for injection in Injection::all(&mut Pcg64Mcg::new(3)) {
            let text = toml::to_string(&Aimed {
                axis: 0,
                what: injection,
            })
            .unwrap();
            assert!(
                text.contains(&format!("kind = \"{}\"", injection.name())),
                "{text}"
            );
            assert_eq!(toml::from_str::<Aimed>(&text).unwrap().what, injection);
        }
    }
}
