//! The meaning of each column.
//!
//! Two layouts are recognised: the common one (`t_s`, `q0_counts`, `q1_counts`, `pitch_deg`,
//! `yaw_deg`, or `x_mm`, `y_mm`, `z_mm`) and that of the laboratory's scripts (`Enc TS`,
//! `Encoder counts 0`, `Encoder counts 1`, `pitches`, `yaws`). Columns that are named in a
//! [`ColumnMap`] replace those. Case and characters other than letters and digits are ignored. Time
//! may also be called `time`, `timestamp`, `t_ms`, ...

use std::ops::RangeInclusive;
use std::str::FromStr;

use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS};

use super::sheet::{Place, Problem, RecordingError};

/// Known columns of time stamps, in order of preference; of two clocks that of the encoders.
const TIMES: [&str; 2] = ["t_s", "Enc TS"];

/// Words in a name of time, besides its unit.
const TIME_WORDS: &str =
    "t time times timestamp timestamps stamp ts enc encoder elapsed header ros zeit";

/// Units of time by their names, s.
pub(super) const TIME_UNITS: [(&[&str], f64); 4] = [
    (&["s", "sec", "secs", "second", "seconds"], 1.0),
    (&["ms", "msec", "millis", "millisecond", "milliseconds"], 1e-3),
    (&["us", "\u{b5}s", "\u{3bc}s", "usec", "micros", "microsecond", "microseconds"], 1e-6),
    (&["ns", "nsec", "nanos", "nanosecond", "nanoseconds"], 1e-9),
];

/// Known columns of counts: one row per layout, one entry per motor.
const COUNTS: [[&str; MAX_MOTORS]; 2] =
    [["q0_counts", "q1_counts"], ["Encoder counts 0", "Encoder counts 1"]];

/// Known columns of outputs, their meaning, and their units.
const OUTPUTS: [(&str, &str, OutputUnit); 7] = [
    ("pitch_deg", "pitch", OutputUnit::Deg),
    ("yaw_deg", "yaw", OutputUnit::Deg),
    ("pitches", "pitch", OutputUnit::Deg),
    ("yaws", "yaw", OutputUnit::Deg),
    ("x_mm", "x", OutputUnit::Mm),
    ("y_mm", "y", OutputUnit::Mm),
    ("z_mm", "z", OutputUnit::Mm),
];

/// Columns named by the caller. The default names none: known layouts are recognised.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ColumnMap {
    /// Column of the time stamps.
    pub time: TimeColumn,
    /// The column of each motor, in order of the motors. Empty: found by name.
    pub counts: Vec<String>,
    /// The column of each output. Empty: found by name.
    pub outputs: Vec<OutputColumn>,
    /// Unwrap counters that wrap.
    pub unwrap: bool,
    /// A motor may stand still: a model is judged on any motion.
    pub still: bool,
    /// Remedies may name the options `--counts`, `--angles`, `--time` and `--unwrap`.
    pub options: bool,
}

/// Required content of a table.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Name of the table for messages.
    pub noun: &'static str,
    /// Time is required. Otherwise it is read if available.
    pub time: bool,
    /// Time must increase.
    pub rising: bool,
    /// Number of motors.
    pub motors: RangeInclusive<usize>,
    /// Outputs: none, these, or any (no entry).
    pub outputs: Option<Vec<OutputSpec>>,
}

impl Wanted {
    /// Counts and outputs, and their time if available.
    pub fn recording() -> Self {
        let (noun, motors, outputs) = ("recording", 1..=MAX_MOTORS, Some(Vec::new()));
        Self { noun, time: false, rising: true, motors, outputs }
    }

    /// Counts over time.
    pub fn path() -> Self {
        Self { time: true, outputs: None, ..Self::recording() }
    }

    /// The path of this many motors. Time stamps are ignored.
    pub fn path_of(motors: usize) -> Self {
        Self { time: false, rising: false, motors: motors..=motors, ..Self::path() }
    }

    /// These outputs over time.
    pub fn trajectory(outputs: &[OutputSpec]) -> Self {
        let (noun, outputs) = ("table", Some(outputs.to_vec()));
        Self { noun, motors: 0..=0, outputs, ..Self::path() }
    }
}

/// Pitch and yaw, degrees.
pub fn pitch_and_yaw() -> [OutputSpec; 2] {
    ["pitch", "yaw"].map(|name| output(name, OutputUnit::Deg))
}

/// Column of the time stamps.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum TimeColumn {
    /// Found by name; if there is none, the recording has no time.
    #[default]
    Known,
    /// The recording is read without time.
    Ignored,
    /// In this column, s; after `COLUMN=ms`, `=us` or `=ns` in that unit.
    Named(String),
}

/// A column with an output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputColumn {
    /// Name in the header.
    pub column: String,
    /// The output.
    pub output: OutputSpec,
}

/// A text that does not name an output.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not an output: write COLUMN or COLUMN=NAME, with a name of 1 to 16 bytes")]
pub struct ParseColumnError(String);

impl FromStr for OutputColumn {
    type Err = ParseColumnError;

    /// Parses `COLUMN=NAME`, or `COLUMN` alone, whose ending `_deg` or `_mm` then is not part of
    /// the name. The unit is that of the ending of the column, degrees without one.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (column, name) =
            text.rsplit_once('=').map_or((text, None), |(column, name)| (column, Some(name)));
        let (column, name) = (column.trim(), name.map(str::trim));
        let known = OUTPUTS.iter().find(|(known, ..)| *known == column);
        let stem =
            column.strip_suffix("_deg").or_else(|| column.strip_suffix("_mm")).unwrap_or(column);
        let name = name.or(known.map(|(_, name, _)| *name)).unwrap_or(stem);
        if column.is_empty() || !(1..=16).contains(&name.len()) {
            return Err(ParseColumnError(text.to_owned()));
        }
        let unit = if column.ends_with("_mm") { OutputUnit::Mm } else { OutputUnit::Deg };
        Ok(Self { column: column.to_owned(), output: output(name, unit) })
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Column {
    pub index: usize,
    pub name: String,
}

/// The columns in use, found in the header.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    pub time: Option<Column>,
    /// Factor of the time unit, and whether the unit was given.
    pub seconds: (f64, bool),
    pub counts: Vec<Column>,
    pub outputs: Vec<(Column, OutputSpec)>,
    /// Known columns of outputs in another unit.
    pub left_out: Vec<&'static str>,
}

impl Layout {
    pub fn all(&self) -> impl Iterator<Item = &Column> {
        self.time.iter().chain(&self.counts).chain(self.outputs.iter().map(|(column, _)| column))
    }
}

/// Looks up the columns of a map in a header, and known columns for the rest.
pub(super) struct Header<'a> {
    pub names: &'a [String],
    pub map: &'a ColumnMap,
    pub wanted: &'a Wanted,
    pub place: &'a Place,
}

impl Header<'_> {
    pub fn layout(&self) -> Result<Layout, RecordingError> {
        let (time, seconds) = self.time()?;
        let (counts, outputs) = (self.counts()?, self.outputs()?);
        let left_out = self.left_out(&outputs);
        let layout = Layout { time, seconds, counts, outputs, left_out };
        for (what, found, most) in [
            ("motors", layout.counts.len(), *self.wanted.motors.end()),
            ("outputs", layout.outputs.len(), MAX_OUTPUTS),
        ] {
            if found > most {
                return Err(self.error(Problem::Columns { what, found, most }));
            }
        }
        let mut used: Vec<&Column> = layout.all().collect();
        used.sort_by_key(|column| column.index);
        match used.windows(2).find(|pair| pair[0].index == pair[1].index) {
            Some(pair) => Err(self.error(Problem::UsedTwice(pair[0].name.clone()))),
            None => Ok(layout),
        }
    }

    fn time(&self) -> Result<(Option<Column>, (f64, bool)), RecordingError> {
        let found = match &self.map.time {
            TimeColumn::Ignored => None,
            TimeColumn::Named(name) => {
                let (column, unit) = name.rsplit_once('=').unwrap_or((name, "s"));
                let unit = unit_s(unit).filter(|_| !self.has(name));
                let column = if unit.is_some() { column } else { name };
                return Ok((Some(self.named(column, "--time")?), (unit.unwrap_or(1.0), true)));
            }
            TimeColumn::Known => {
                let known = TIMES.iter().find_map(|name| self.column(name).transpose());
                let named = || self.names.iter().find(|name| seconds_of(name).is_some());
                known
                    .or_else(|| named().and_then(|name| self.column(name).transpose()))
                    .transpose()?
            }
        };
        if found.is_none() && self.wanted.time {
            return Err(self.missing(&["t_s", "time", "Enc TS"], "--time COLUMN"));
        }
        let seconds = found.as_ref().and_then(|column| seconds_of(&column.name)).unwrap_or(1.0);
        Ok((found, (seconds, false)))
    }

    fn counts(&self) -> Result<Vec<Column>, RecordingError> {
        let (least, most) = (*self.wanted.motors.start(), *self.wanted.motors.end());
        if most == 0 {
            return Ok(Vec::new());
        }
        let option = "--counts COLUMN or --counts COLUMN,COLUMN";
        let columns: Vec<Column> = if self.map.counts.is_empty() {
            let Some(layout) = COUNTS.iter().find(|layout| self.has(layout[0])) else {
                return Err(self.missing(&COUNTS.map(|layout| layout[0]), option));
            };
            let present = layout.iter().filter_map(|name| self.column(name).transpose());
            present.take(most).collect::<Result<_, _>>()?
        } else {
            let names = self.map.counts.iter();
            names.map(|name| self.named(name, "--counts")).collect::<Result<_, _>>()?
        };
        match columns.len() < least {
            true => Err(self.missing(&COUNTS.map(|layout| layout[columns.len()]), option)),
            false => Ok(columns),
        }
    }

    /// Finds angles before positions: a model has one kind only.
    fn outputs(&self) -> Result<Vec<(Column, OutputSpec)>, RecordingError> {
        let Some(wanted) = &self.wanted.outputs else { return Ok(Vec::new()) };
        let option = "--angles COLUMN=NAME or --angles COLUMN=NAME,COLUMN=NAME";
        let named = &self.map.outputs;
        let of = |spec: &OutputSpec| {
            let own = column_of(spec);
            let is_known =
                |known: &&(&str, &str, OutputUnit)| (known.1, known.2) == (&spec.name, spec.unit);
            let mut names: Vec<&str> = match named.is_empty() {
                true => OUTPUTS.iter().filter(is_known).map(|(column, ..)| *column).collect(),
                false => {
                    named.iter().filter(|it| it.output == *spec).map(|it| &*it.column).collect()
                }
            };
            if names.is_empty() {
                names.push(&own);
            }
            let column = names.iter().find_map(|name| self.column(name).transpose());
            Ok((column.unwrap_or_else(|| Err(self.missing(&names, option)))?, spec.clone()))
        };
        if !wanted.is_empty() {
            return wanted.iter().map(of).collect();
        }
        if !named.is_empty() {
            return named.iter().map(|it| of(&it.output)).collect();
        }
        let present = || OUTPUTS.iter().filter(|(column, ..)| self.has(column));
        let Some(&(.., unit)) = present().next() else {
            return Err(self.missing(&["pitch_deg", "yaw_deg", "pitches", "yaws"], option));
        };
        let of_one_unit = present().filter(|(.., other)| *other == unit);
        let column = |(column, name, unit): &(&str, &str, OutputUnit)| {
            Ok((self.named(column, "--angles")?, output(name, *unit)))
        };
        of_one_unit.map(column).collect()
    }

    fn left_out(&self, outputs: &[(Column, OutputSpec)]) -> Vec<&'static str> {
        let is_other = |unit: OutputUnit| outputs.iter().all(|(_, output)| output.unit != unit);
        let known = OUTPUTS.iter().filter(|(name, _, unit)| is_other(*unit) && self.has(name));
        if outputs.is_empty() { Vec::new() } else { known.map(|(name, ..)| *name).collect() }
    }

    fn has(&self, name: &str) -> bool {
        !matches!(self.column(name), Ok(None))
    }

    fn named(&self, name: &str, option: &'static str) -> Result<Column, RecordingError> {
        self.column(name)?.ok_or_else(|| self.missing(&[name], option))
    }

    /// The column with this name, or else one with an equivalent name.
    fn column(&self, name: &str) -> Result<Option<Column>, RecordingError> {
        let columns = || self.names.iter().enumerate();
        let exact = columns().filter(|(_, other)| *other == name);
        let same = columns().filter(|(_, other)| *other != name && words(other) == words(name));
        let mut found = exact.chain(same);
        let (first, second) = (found.next(), found.next());
        if second.is_some_and(|(_, other)| Some(other) == first.map(|(_, name)| name)) {
            return Err(self.error(Problem::Ambiguous(name.to_owned())));
        }
        Ok(first.map(|(index, name)| Column { index, name: name.clone() }))
    }

    fn missing(&self, wanted: &[&str], option: &str) -> RecordingError {
        let list = |names: &mut dyn Iterator<Item = &str>, between: &str| {
            let quoted: Vec<String> = names.map(|name| format!("`{name}`")).collect();
            quoted.join(between)
        };
        let in_radians = self.names.iter().find(|name| {
            let of_angles = wanted.iter().any(|wanted| wanted.ends_with("_deg"));
            of_angles && words(name).iter().any(|word| word == "rad" || word == "radians")
        });
        let remedy = match (in_radians, self.map.options) {
            (Some(name), _) => {
                format!("`{name}` is in radians: multiply it by 57.29578 and name it `..._deg`")
            }
            (None, true) => format!("select the columns with {option}"),
            (None, false) => "rename the columns in the header line".to_owned(),
        };
        self.error(Problem::MissingColumn {
            wanted: list(&mut wanted.iter().copied(), " or "),
            present: list(&mut self.names.iter().map(String::as_str), ", "),
            remedy,
        })
    }

    fn error(&self, problem: Problem) -> RecordingError {
        RecordingError::new(self.place.clone(), problem)
    }
}

fn words(name: &str) -> Vec<String> {
    let words = name.split(|letter: char| !letter.is_alphanumeric());
    words.filter(|word| !word.is_empty()).map(str::to_lowercase).collect()
}

pub(super) fn unit_s(unit: &str) -> Option<f64> {
    TIME_UNITS.iter().find(|(names, _)| names.contains(&unit)).map(|(_, seconds)| *seconds)
}

/// Unit of a column whose name means time, s.
fn seconds_of(name: &str) -> Option<f64> {
    let mut words = words(name);
    let unit = words.last().and_then(|word| unit_s(word));
    words.truncate(words.len() - usize::from(unit.is_some()));
    let is_time = words.iter().all(|word| TIME_WORDS.split(' ').any(|known| known == word));
    (is_time && (unit.is_some() || !words.is_empty())).then(|| unit.unwrap_or(1.0))
}

/// Name of an output in a table.
pub fn column_of(OutputSpec { name, unit }: &OutputSpec) -> String {
    match unit {
        OutputUnit::Deg => format!("{name}_deg"),
        OutputUnit::Mm => format!("{name}_mm"),
    }
}

fn output(name: &str, unit: OutputUnit) -> OutputSpec {
    OutputSpec { name: name.to_owned(), unit }
}
