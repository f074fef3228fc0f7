//! The meaning of each column.
//!
//! Two layouts are recognised: the common one (`t_s`, `q0_counts`, `q1_counts`,
//! `pitch_deg`, `yaw_deg`, or `x_mm`, `y_mm`, `z_mm`) and the one that the laboratory's scripts
//! write (`Enc TS`, `Encoder counts 0`, `Encoder counts 1`, `pitches`, `yaws`). Columns that
//! are named in a [`ColumnMap`] replace those.

use std::path::Path;
use std::str::FromStr;

use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS};

use super::error::RecordingError;

/// Known columns of time stamps, in order of preference. Of the laboratory's two clocks, that of
/// the encoders.
const TIMES: [&str; 2] = ["t_s", "Enc TS"];

/// Known columns of counts: one row per layout, one entry per motor.
const COUNTS: [[&str; MAX_MOTORS]; 2] =
    [["q0_counts", "q1_counts"], ["Encoder counts 0", "Encoder counts 1"]];

/// Known columns of outputs, what they are, and their units.
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
    /// Where the time stamps are.
    pub time: TimeColumn,
    /// The column of each motor, in order of the motors. Empty: found by name.
    pub counts: Vec<String>,
    /// The column of each output. Empty: found by name.
    pub outputs: Vec<OutputColumn>,
}

/// Where the time stamps are.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum TimeColumn {
    /// Found by name; without one the recording has no time.
    #[default]
    Known,
    /// The recording is to be read without time.
    Ignored,
    /// In this column, s.
    Named(String),
}

/// A column that holds an output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputColumn {
    /// As the header names it.
    pub column: String,
    /// What it is.
    pub output: OutputSpec,
}

/// Text that names no output.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` names no output: write COLUMN or COLUMN=NAME, with a name of 1 to 16 bytes")]
pub struct ParseColumnError {
    text: String,
}

impl FromStr for OutputColumn {
    type Err = ParseColumnError;

    /// `COLUMN=NAME`, or `COLUMN` alone, whose ending `_deg` or `_mm` then is not part of the name.
    /// The unit is that of the ending of the column, degrees without one.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (column, name) =
            text.rsplit_once('=').map_or((text, None), |(column, name)| (column, Some(name)));
        let (column, name) = (column.trim(), name.map(str::trim));
        let known = OUTPUTS.iter().find(|(known, ..)| *known == column);
        let stem =
            column.strip_suffix("_deg").or_else(|| column.strip_suffix("_mm")).unwrap_or(column);
        let name = name.or(known.map(|(_, name, _)| *name)).unwrap_or(stem);
        if column.is_empty() || !(1..=16).contains(&name.len()) {
            return Err(ParseColumnError { text: text.to_owned() });
        }
        let unit = match column.ends_with("_mm") {
            true => OutputUnit::Mm,
            false => OutputUnit::Deg,
        };
        Ok(Self { column: column.to_owned(), output: output(name, unit) })
    }
}

/// A column of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Column {
    pub index: usize,
    pub name: String,
}

/// The columns that matter, found in the header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Layout {
    pub time: Option<Column>,
    pub counts: Vec<Column>,
    pub outputs: Vec<(Column, OutputSpec)>,
}

impl Layout {
    /// Looks up in a header what `map` names, and what is known where it names nothing.
    pub fn find(header: &[String], map: &ColumnMap, path: &Path) -> Result<Self, RecordingError> {
        let header = Header { names: header, path };
        let (time, counts) = (header.time(map)?, header.counts(map)?);
        let outputs = header.outputs(map)?;
        let layout = Self { time, counts, outputs };
        layout.check(path)?;
        Ok(layout)
    }

    fn check(&self, path: &Path) -> Result<(), RecordingError> {
        let too_many = |what, found, most| RecordingError::Columns {
            path: path.to_owned(),
            what,
            found,
            most,
        };
        if self.counts.len() > MAX_MOTORS {
            return Err(too_many("motors", self.counts.len(), MAX_MOTORS));
        }
        if self.outputs.len() > MAX_OUTPUTS {
            return Err(too_many("outputs", self.outputs.len(), MAX_OUTPUTS));
        }
        let mut used: Vec<&Column> = self.all().collect();
        used.sort_by_key(|column| column.index);
        let twice = used.windows(2).find(|pair| pair[0].index == pair[1].index);
        twice.map_or(Ok(()), |pair| {
            Err(RecordingError::UsedTwice { path: path.to_owned(), column: pair[0].name.clone() })
        })
    }

    /// Every column that matters.
    pub fn all(&self) -> impl Iterator<Item = &Column> {
        self.time.iter().chain(&self.counts).chain(self.outputs.iter().map(|(column, _)| column))
    }
}

struct Header<'a> {
    names: &'a [String],
    path: &'a Path,
}

impl Header<'_> {
    fn time(&self, map: &ColumnMap) -> Result<Option<Column>, RecordingError> {
        match &map.time {
            TimeColumn::Ignored => Ok(None),
            TimeColumn::Named(name) => self.named(name, "--time").map(Some),
            TimeColumn::Known => {
                let mut known = TIMES.iter();
                known.find_map(|name| self.column(name).transpose()).transpose()
            }
        }
    }

    fn counts(&self, map: &ColumnMap) -> Result<Vec<Column>, RecordingError> {
        if !map.counts.is_empty() {
            let names = map.counts.iter();
            return names.map(|name| self.named(name, "--counts")).collect();
        }
        let Some(layout) = COUNTS.iter().find(|layout| self.has(layout[0])) else {
            let option = "--counts COLUMN or --counts COLUMN,COLUMN";
            return Err(self.missing(&COUNTS.map(|layout| layout[0]), option));
        };
        let present = layout.iter().filter_map(|name| self.column(name).transpose());
        present.collect()
    }

    /// Angles before positions: a model has one kind only.
    fn outputs(&self, map: &ColumnMap) -> Result<Vec<(Column, OutputSpec)>, RecordingError> {
        if !map.outputs.is_empty() {
            let named =
                |o: &OutputColumn| Ok((self.named(&o.column, "--angles")?, o.output.clone()));
            return map.outputs.iter().map(named).collect();
        }
        let present = || OUTPUTS.iter().filter(|(column, ..)| self.has(column));
        let Some(&(.., unit)) = present().next() else {
            let known = ["pitch_deg", "yaw_deg", "pitches", "yaws"];
            let option = "--angles COLUMN=NAME or --angles COLUMN=NAME,COLUMN=NAME";
            return Err(self.missing(&known, option));
        };
        let of_one_unit = present().filter(|(.., other)| *other == unit);
        let column = |(column, name, unit): &(&str, &str, OutputUnit)| {
            Ok((self.named(column, "--angles")?, output(name, *unit)))
        };
        of_one_unit.map(column).collect()
    }

    fn has(&self, name: &str) -> bool {
        self.names.iter().any(|other| other == name)
    }

    fn named(&self, name: &str, option: &'static str) -> Result<Column, RecordingError> {
        self.column(name)?.ok_or_else(|| self.missing(&[name], option))
    }

    fn column(&self, name: &str) -> Result<Option<Column>, RecordingError> {
        let columns = self.names.iter().enumerate();
        let mut found = columns.filter(|(_, other)| *other == name);
        let column = |(index, name): (usize, &String)| Column { index, name: name.clone() };
        let first = found.next().map(column);
        match found.next() {
            None => Ok(first),
            Some(_) => Err(RecordingError::Ambiguous {
                path: self.path.to_owned(),
                column: name.to_owned(),
            }),
        }
    }

    fn missing(&self, wanted: &[&str], option: &'static str) -> RecordingError {
        let list = |names: &mut dyn Iterator<Item = &str>, between: &str| {
            let quoted: Vec<String> = names.map(|name| format!("`{name}`")).collect();
            quoted.join(between)
        };
        RecordingError::MissingColumn {
            path: self.path.to_owned(),
            wanted: list(&mut wanted.iter().copied(), " or "),
            present: list(&mut self.names.iter().map(String::as_str), ", "),
            option,
        }
    }
}

fn output(name: &str, unit: OutputUnit) -> OutputSpec {
    OutputSpec { name: name.to_owned(), unit }
}
