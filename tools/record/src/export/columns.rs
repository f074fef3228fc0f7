//! The columns of a payload, and the cells of a message.

use i2ris::ipc::payload::{FIXTURES, Field, FieldType, PayloadLayout, unpadded_text};
use i2ris::robot::{AxisPhase, Fault, OperatingState, Refusal};
use i2ris::units::MAX_OUTPUTS;

use crate::messages::cdr::{Number, numbers};
use crate::report::Trial;

#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Unix time, ns.
    Time(u64),
    Seconds(f64),
    Number(Number),
    Text(String),
}

/// Form of a field's entries in a table.
#[derive(Clone, Copy)]
enum Meaning {
    /// Bytes as hexadecimal digits.
    Hash,
    /// This many texts.
    Texts(usize),
    /// A random number, written as everywhere else: 16 hexadecimal digits.
    Identity,
    /// The number of a value with a name.
    Name(fn(u32) -> Option<&'static str>),
    /// One entry for each output of the model, with the suffixes of the output's name.
    Outputs(&'static str, &'static str),
    Numbers,
}

impl Meaning {
    fn of(field: &Field) -> Self {
        let is_bytes = field.kind == FieldType::U8 && field.count > 2;
        let is_outputs = field.kind == FieldType::F64 && field.count == MAX_OUTPUTS;
        match field.name {
            "model_id" => Self::Hash,
            "name" if is_bytes => Self::Texts(FIXTURES),
            _ if is_bytes => Self::Texts(1),
            "boot_id" | "client_id" | "lease_client_id" | "refused_client_id" => Self::Identity,
            "state" => Self::Name(|it| OperatingState::from_number(it).map(OperatingState::text)),
            "fault" => Self::Name(|it| Fault::from_number(it).map(Fault::text)),
            "last_refusal" | "refused_reason" => {
                Self::Name(|it| Refusal::from_number(it).map(Refusal::text))
            }
            "phase" => Self::Name(|it| AxisPhase::from_number(it).map(AxisPhase::text)),
            "position" if is_outputs => Self::Outputs("", ""),
            "velocity" if is_outputs => Self::Outputs("_velocity", "_s"),
            "deviation" if is_outputs => Self::Outputs("_deviation", ""),
            _ => Self::Numbers,
        }
    }
}

/// Unit in tables: degrees for models with two outputs (angles), metres for models of the tip.
pub fn unit_of(outputs: &[String]) -> &'static str {
    if outputs.len() < MAX_OUTPUTS { "deg" } else { "m" }
}

/// The names of all columns of a payload, for a model with outputs of these names.
pub fn columns(layout: &PayloadLayout, outputs: &[String]) -> Vec<String> {
    let mut columns = ["time", "t_s", "received_s"].map(str::to_owned).to_vec();
    for (name, field) in &layout.numbers() {
        let numbered = |count| match count {
            1 => vec![name.clone()],
            count => (0..count).map(|index| format!("{name}_{index}")).collect(),
        };
        columns.extend(match Meaning::of(field) {
            Meaning::Hash => numbered(1),
            Meaning::Texts(count) => numbered(count),
            Meaning::Outputs(quantity, per) => {
                let unit = unit_of(outputs);
                outputs.iter().map(|output| format!("{output}{quantity}_{unit}{per}")).collect()
            }
            _ => numbered(field.count),
        });
    }
    columns
}

/// One cell for every column, instants in ns of Unix time; `None` if the layout differs.
pub fn cells(
    layout: &PayloadLayout,
    outputs: &[String],
    start: u64,
    [stamp, received]: [u64; 2],
    message: &[u8],
) -> Option<Vec<Cell>> {
    let mut cells = vec![Cell::Time(stamp), seconds(stamp, start), seconds(received, start)];
    let numbers = numbers(layout, message)?;
    let valid = valid_entries(layout, &numbers);
    let mut numbers = numbers.into_iter();
    for (_, field) in &layout.numbers() {
        let entries: Vec<Number> = numbers.by_ref().take(field.count).collect();
        match Meaning::of(field) {
            Meaning::Hash => {
                let digits = entries.into_iter().map(|byte| format!("{:02x}", unsigned(byte)));
                cells.push(Cell::Text(digits.collect()));
            }
            Meaning::Texts(count) => {
                let bytes: Vec<u8> = entries.into_iter().map(|it| unsigned(it) as u8).collect();
                let texts = bytes.chunks(bytes.len() / count);
                cells.extend(texts.map(|text| Cell::Text(unpadded_text(text))));
            }
            Meaning::Identity => {
                let digits = |number| Cell::Text(format!("{:016x}", unsigned(number)));
                cells.extend(entries.into_iter().map(digits));
            }
            Meaning::Name(name) => cells.extend(entries.into_iter().map(|number| {
                let name = name(unsigned(number) as u32).map(str::to_owned);
                Cell::Text(name.unwrap_or_else(|| number.to_string()))
            })),
            Meaning::Outputs(..) => {
                let is_valid = valid == outputs.len();
                let cell = |entry| output(entry, is_valid, unit_of(outputs));
                cells.extend(entries.into_iter().take(outputs.len()).map(cell));
            }
            Meaning::Numbers if field.count > 1 && field.kind == FieldType::F64 => {
                let cell = |(index, entry)| if index < valid { entry } else { NO_NUMBER };
                cells.extend(entries.into_iter().enumerate().map(cell).map(Cell::Number));
            }
            Meaning::Numbers => cells.extend(entries.into_iter().map(Cell::Number)),
        }
    }
    Some(cells)
}

/// Seconds between two instants in ns.
pub fn seconds(ns: u64, start: u64) -> Cell {
    Cell::Seconds((i128::from(ns) - i128::from(start)) as f64 * 1e-9)
}

/// Value of a missing entry, to tell it from 0.
const NO_NUMBER: Number = Number::Float(f64::NAN);

/// An angle, rad in messages, or a position.
fn output(entry: Number, is_valid: bool, unit: &str) -> Cell {
    Cell::Number(match entry {
        Number::Float(rad) if is_valid && unit == "deg" => Number::Float(rad.to_degrees()),
        entry if is_valid => entry,
        _ => NO_NUMBER,
    })
}

/// Number of entries that are valid in the arrays of a message.
fn valid_entries(layout: &PayloadLayout, numbers: &[Number]) -> usize {
    let mut before = 0;
    for (_, field) in layout.numbers() {
        if field.name == "count" {
            return numbers.get(before).map_or(usize::MAX, |count| unsigned(*count) as usize);
        }
        before += field.count;
    }
    usize::MAX
}

fn unsigned(number: Number) -> u64 {
    match number {
        Number::Unsigned(number) => number,
        Number::Signed(_) | Number::Float(_) => u64::MAX,
    }
}

/// The unit of a column; empty for numbers without one.
pub fn unit(column: &str) -> &'static str {
    let name = column.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_');
    let ends = |end: &str| name.ends_with(end);
    match name {
        "time" => "UTC",
        "tolerance" => "rad (m for a model of the tip)",
        _ if ends("_deg_s") => "deg/s",
        _ if ends("_deg") => "deg",
        _ if ends("_m_s") => "m/s",
        _ if ends("_m") => "m",
        _ if ends("_ns") => "ns",
        _ if ends("_counts") => "counts",
        _ if ends("_ma") => "mA",
        _ if ends("_s") => "s",
        _ => "",
    }
}

/// Distance of two rows, ns: a spreadsheet can hold three hours.
const GRID_NS: usize = 10_000_000;
/// Samples further apart than this are not interpolated: a slow camera sends ten a second.
const GAP_NS: u64 = 110_000_000;

/// The columns of the table for people: goal, setpoint, estimate, camera and state on one grid.
pub fn overview_columns() -> Vec<String> {
    let mut columns = ["time", "t_s", "state"].map(str::to_owned).to_vec();
    for (name, _) in Trial::default().angles() {
        for axis in ["pitch", "yaw"] {
            columns.push(format!("{name}_{axis}_deg"));
        }
    }
    columns
}

/// Angles are interpolated between samples, and empty without samples nearby.
pub fn overview_rows(trial: &Trial) -> impl Iterator<Item = Vec<Cell>> + '_ {
    (trial.start_ns..=trial.end_ns).step_by(GRID_NS).map(|stamp| {
        let state = Cell::Text(trial.state_at(stamp).unwrap_or_default().to_owned());
        let time = Cell::Time(trial.unix_ns(stamp));
        let mut cells = vec![time, seconds(stamp, trial.start_ns), state];
        for (_, series) in trial.angles() {
            let angles = series.value_at(stamp, GAP_NS).unwrap_or([f64::NAN; 2]);
            cells.extend(angles.map(|angle| Cell::Number(Number::Float(angle))));
        }
        cells
    })
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{JointState, Payload, PeriodStatistics, VirtualFixturesMsg};

    use super::*;
    use crate::messages::cdr::encode;

    fn angles() -> [String; 2] {
        ["pitch", "yaw"].map(str::to_owned)
    }

    #[test]
    fn every_column_has_a_cell() {
        let joints = (JointState::LAYOUT, encode(JointState::default().bytes()));
        let windows = (PeriodStatistics::LAYOUT, encode(PeriodStatistics::default().bytes()));
        let regions = (VirtualFixturesMsg::LAYOUT, encode(VirtualFixturesMsg::default().bytes()));
        for (layout, message) in [joints, windows, regions] {
            let columns = columns(&layout, &angles());
            let cells = cells(&layout, &angles(), 5, [7, 9], &message).unwrap();
            assert_eq!(columns.len(), cells.len(), "{}", layout.name);
            assert_eq!(cells[..2], [Cell::Time(7), seconds(7, 5)], "{}", layout.name);
            let named = |name: &str| Some(&cells[columns.iter().position(|it| it == name)?]);
            let [boot, sequence, model] = ["boot_id", "sequence", "model_id"].map(named);
            assert!(matches!(boot, Some(Cell::Text(digits)) if digits.len() == 16));
            assert!(matches!(sequence, Some(Cell::Number(Number::Unsigned(0)))));
            assert!(model.is_none_or(|it| *it == Cell::Text("00".repeat(32))));
        }
        assert_eq!(cells(&JointState::LAYOUT, &angles(), 0, [0, 0], &[0, 1, 0, 0, 7]), None);
    }
}
