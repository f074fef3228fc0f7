//! From bytes to cells: the format of a table, detected from the table itself.
//!
//! Cells are separated by commas, semicolons, tabs or blanks; numbers have decimal points, or
//! decimal commas if commas do not separate. Comments begin with `#` or `%`, and one may name the
//! columns. The incomplete end of a file, left by a killed program, is skipped and reported.

use std::fmt::{self, Display, Formatter};
use std::io;
use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Trim};

/// Separators in order of preference. Any number of blanks is one separator.
const SEPARATORS: [u8; 4] = [b'\t', b';', b',', b' '];

#[derive(Debug)]
pub(super) struct Sheet {
    pub header: Vec<String>,
    /// Line in the file, and its cells, as many as in the header.
    pub rows: Vec<(u64, StringRecord)>,
    pub decimal_comma: bool,
    /// A line of units below the header.
    pub units: Option<(u64, StringRecord)>,
    pub notes: Vec<String>,
}

impl Sheet {
    pub fn read(bytes: &[u8], place: &Place) -> Result<Self, RecordingError> {
        let mut notes = Vec::new();
        let (text, ended) = text(bytes, place, &mut notes)?;
        // Old programs end lines by a carriage return alone.
        let unix = (!text.contains('\n')).then(|| text.replace('\r', "\n"));
        let text = unix.as_deref().unwrap_or(text);
        let lines: Vec<&str> = text.lines().collect();
        let (separator, first) = separator(&lines);
        let head = head(&lines, separator, first)
            .ok_or_else(|| RecordingError::new(place.clone(), Problem::NoHeader))?;
        let header = uncommented(lines[head]);
        let mut body = String::with_capacity(text.len());
        for (index, line) in lines.iter().enumerate() {
            if index > head && uncommented(line) == header {
                notes.push(format!("line {} names the columns again and is left out", index + 1));
            } else if index > head && !line.trim_start().starts_with(['#', '%']) {
                body += &separated(line, separator);
            }
            body.push('\n');
        }
        let header: Vec<String> = cells(header, separator).iter().map(str::to_owned).collect();
        let mut rows = records(&body, separator, header.len());
        let width = |(_, cells): &(u64, StringRecord)| cells.len();
        let units = rows.first().filter(|row| width(row) == header.len() && is_text(&row.1));
        let units = units.cloned();
        rows.drain(..usize::from(units.is_some()));
        if rows.last().is_some_and(|row| width(row) < header.len()) || !ended && is_cut(&rows) {
            let line = rows.pop().map_or(0, |(line, _)| line);
            notes.push(format!("line {line}, the last one, is truncated and left out"));
        }
        if let Some(row) = rows.iter().find(|row| width(row) != header.len()) {
            let (found, expected) = (width(row), header.len());
            let remedy = match separator == b',' && found > expected {
                true => "if numbers contain commas, separate all cells by semicolons",
                false => "complete or remove it",
            };
            let problem = Problem::RowLength { found, expected, remedy };
            return Err(RecordingError::new(place.line(row.0), problem));
        }
        let cells = || rows.iter().flat_map(|(_, cells)| cells);
        let is_point = |cell: &&str| cell.contains('.') && cell.parse::<f64>().is_ok();
        let has_commas = cells().any(|cell| cell.contains(',') && number(cell, true).is_some());
        // Between commas, a cell with a comma was quoted.
        let decimal_comma = match has_commas {
            true => cells().filter(is_point).all(is_grouped),
            false => separator != b',' && !cells().any(|cell| is_point(&cell)),
        };
        Ok(Self { header, rows, decimal_comma, units, notes })
    }
}

/// The text, and whether its last line is complete. A write cut by a power loss leaves zeros.
fn text<'a>(
    bytes: &'a [u8],
    place: &Place,
    notes: &mut Vec<String>,
) -> Result<(&'a str, bool), RecordingError> {
    let is_tail = |byte: &u8| matches!(byte, 0 | b'\r' | b'\n');
    let end = bytes.iter().rposition(|byte| !is_tail(byte)).map_or(0, |last| last + 1);
    let (bytes, tail) = bytes.split_at(end);
    let zeros = tail.iter().filter(|byte| **byte == 0).count();
    if zeros > 0 {
        notes.push(format!("{zeros} zero bytes at the end are left out: an interrupted write"));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    // UTF-16 without a mark is UTF-8 with zeros.
    let zero = bytes.iter().position(|byte| *byte == 0);
    let text = str::from_utf8(bytes);
    let wrong = text.err().map(|error| error.valid_up_to());
    match text {
        Ok(text) if zero.is_none() && text.trim().is_empty() => {
            Err(RecordingError::new(place.clone(), Problem::Empty))
        }
        Ok(text) if zero.is_none() => Ok((text, tail.first().is_some_and(|byte| *byte != 0))),
        _ => {
            let at = zero.into_iter().chain(wrong).min().unwrap_or_default();
            let before = bytes.iter().take(at).filter(|byte| **byte == b'\n').count();
            Err(RecordingError::new(place.line(1 + before as u64), Problem::NotText))
        }
    }
}

/// Whether a line has no number, and words in half of its cells.
fn is_text(cells: &StringRecord) -> bool {
    let words = cells.iter().filter(|cell| !is_missing(cell));
    2 * words.clone().count() >= cells.len() && words.clone().all(|it| seconds(it, true).is_none())
}

fn uncommented(line: &str) -> &str {
    line.trim().trim_start_matches(['#', '%']).trim()
}

/// The separator with most numbers in the first line with any, and its index or that of the header.
fn separator(lines: &[&str]) -> (u8, usize) {
    let numbers = |line: &str, separator: u8| {
        let found = cells(line, separator);
        let is_number =
            |cell: &&str| !is_missing(cell) && seconds(cell, separator != b',').is_some();
        // Names and dates contain blanks as well.
        let is_whole = found.iter().all(|cell| is_missing(cell) || is_number(&cell));
        if separator != b' ' || is_whole { found.iter().filter(is_number).count() } else { 0 }
    };
    let best = |(index, line): (usize, &&str)| {
        let counted = SEPARATORS.map(|separator| (numbers(line, separator), separator, index));
        counted.into_iter().rev().max_by_key(|(count, ..)| *count).filter(|(count, ..)| *count > 0)
    };
    let read =
        lines.iter().enumerate().filter(|(_, line)| !line.trim_start().starts_with(['#', '%']));
    let mut found = read.filter_map(best).peekable();
    let one = found.peek().copied();
    if let Some((_, separator, index)) = found.find(|(count, ..)| *count > 1).or(one) {
        return (separator, index);
    }
    let line = lines.iter().find(|line| !line.trim().is_empty()).unwrap_or(&"");
    let widest = SEPARATORS[..3].iter().rev().max_by_key(|it| cells(line, **it).len());
    (widest.copied().unwrap_or(b','), lines.len())
}

/// The line that names the columns: the first as wide as the numbers, or the last before them.
fn head(lines: &[&str], separator: u8, first: usize) -> Option<usize> {
    let width = lines.get(first).map_or(0, |line| cells(line, separator).len());
    let mut before = (0..first).filter(|index| !lines[*index].trim().is_empty());
    let of_width =
        before.clone().find(|it| cells(uncommented(lines[*it]), separator).len() == width);
    let is_plain = |index: &usize| uncommented(lines[*index]) == lines[*index].trim();
    of_width.or_else(|| before.clone().rfind(is_plain)).or_else(|| before.next_back())
}

fn separated(line: &str, separator: u8) -> String {
    match separator {
        b' ' => line.split_whitespace().collect::<Vec<_>>().join("\t"),
        _ => line.to_owned(),
    }
}

fn cells(line: &str, separator: u8) -> StringRecord {
    let rows = records(&separated(line, separator), separator, usize::MAX);
    rows.into_iter().next().map(|(_, cells)| cells).unwrap_or_default()
}

/// Lines and their cells, without surplus empty cells, and without blank lines.
fn records(text: &str, separator: u8, width: usize) -> Vec<(u64, StringRecord)> {
    let mut builder = ReaderBuilder::new();
    builder.has_headers(false).flexible(true).trim(Trim::All);
    let delimiter = if separator == b' ' { b'\t' } else { separator };
    let mut reader = builder.delimiter(delimiter).from_reader(text.as_bytes());
    let mut rows = Vec::new();
    // The only error of text in memory is invalid UTF-8, which is checked before.
    for mut record in reader.records().map_while(Result::ok) {
        while record.len() > width && record.iter().next_back() == Some("") {
            record.truncate(record.len() - 1);
        }
        if record.len() > 1 || width == 1 || record.iter().any(|cell| !cell.is_empty()) {
            rows.push((line_of(&record, text.as_bytes()), record));
        }
    }
    rows
}

/// Line of a record; its position is where the search for it began, before blank lines.
fn line_of(record: &StringRecord, bytes: &[u8]) -> u64 {
    let Some(position) = record.position() else { return 0 };
    let from = usize::try_from(position.byte()).unwrap_or(usize::MAX);
    let blank = bytes.iter().skip(from).take_while(|byte| matches!(byte, b'\r' | b'\n'));
    position.line() + blank.filter(|byte| **byte == b'\n').count() as u64
}

/// Whether the last cell has lost decimals that all cells above it have.
fn is_cut(rows: &[(u64, StringRecord)]) -> bool {
    let cell = |(_, cells): &(u64, StringRecord)| cells.iter().next_back().map(str::to_owned);
    let decimals = |cell: String| cell.split_once(['.', ',']).map(|(_, digits)| digits.len());
    let mut decimals = rows.iter().filter_map(cell).filter(|cell| !is_missing(cell)).map(decimals);
    let last = decimals.next_back().flatten();
    let usual = decimals.next().flatten();
    last < usual && decimals.all(|it| it == usual)
}

/// Marks of missing values that programs write, in small letters.
const MISSING: [&str; 11] =
    ["", "nan", "-nan", "nan(ind)", "-nan(ind)", "na", "n/a", "#n/a", "#na", "null", "none"];

pub(super) fn is_missing(cell: &str) -> bool {
    cell.is_empty() || MISSING.contains(&cell.to_lowercase().as_str())
}

/// Parses a number with any minus sign; with decimal commas, points group thousands.
pub(super) fn number(cell: &str, decimal_comma: bool) -> Option<f64> {
    let is_grouped = decimal_comma && is_grouped(cell);
    cell.parse().ok().filter(|_| !is_grouped).or_else(|| {
        let mut plain = cell.replace(['\u{2212}', '\u{2013}'], "-");
        if is_grouped {
            plain = plain.replace('.', "");
        }
        if decimal_comma { plain.replace(',', ".").parse().ok() } else { plain.parse().ok() }
    })
}

/// Whether a number may have points between its thousands: `-1.068` or `1.068.000,5`.
pub(super) fn is_grouped(cell: &str) -> bool {
    let whole = cell.split(',').next().unwrap_or_default();
    let digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    let mut parts = whole.trim_start_matches(['-', '+', '\u{2212}', '\u{2013}']).split('.');
    let first = parts.next().unwrap_or_default();
    let mut groups = parts.peekable();
    (1..=3).contains(&first.len())
        && digits(first)
        && groups.peek().is_some()
        && groups.all(|part| part.len() == 3 && digits(part))
}

/// Parses a time, s: seconds, a date and time as in ISO 8601 from 1970-01-01, or a time of day.
pub fn seconds(cell: &str, decimal_comma: bool) -> Option<f64> {
    number(cell, decimal_comma).or_else(|| match cell.split_once(['T', 't', ' ']) {
        Some((date, clock)) => Some(86_400.0 * days(date)? + clock_s(clock)?),
        None => clock_s(cell),
    })
}

/// `HH:MM:SS`, with an optional fraction.
fn clock_s(text: &str) -> Option<f64> {
    let text = text.trim_end_matches(['Z', 'z']).trim_end_matches("+00:00").replace(',', ".");
    let parts: Option<Vec<f64>> = text.split(':').map(|part| part.parse().ok()).collect();
    match parts?[..] {
        [hours, minutes, seconds] => Some(3600.0 * hours + 60.0 * minutes + seconds),
        _ => None,
    }
}

/// Days from 1970-01-01 to `YYYY-MM-DD`, in the Gregorian calendar.
fn days(date: &str) -> Option<f64> {
    let parts: Option<Vec<i64>> = date.split(['-', '/']).map(|part| part.parse().ok()).collect();
    let [year @ 1000..=9999, month @ 1..=12, day @ 1..=31] = parts?[..] else { return None };
    // A year that begins in March has its leap day at the end.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let leap_days = year / 4 - year / 100 + year / 400;
    Some((365 * year + leap_days + (153 * month + 2) / 5 + day - 719_469) as f64)
}

/// Why a table could not be read: the problem, its place, and the remedy.
#[derive(Debug, thiserror::Error)]
#[error("{}: {}", .0.0, .0.1)]
pub struct RecordingError(Box<(Place, Problem)>);

impl RecordingError {
    pub(super) fn new(place: Place, problem: Problem) -> Self {
        Self(Box::new((place, problem)))
    }
}

#[derive(Debug, Clone)]
pub(super) struct Place {
    table: String,
    line: Option<u64>,
    column: Option<String>,
}

impl Place {
    /// A file. `noun`: its purpose for the reader.
    pub fn new(noun: &str, path: &Path) -> Self {
        Self { table: format!("{noun} {}", path.display()), line: None, column: None }
    }

    pub fn line(&self, line: u64) -> Self {
        Self { line: Some(line), ..self.clone() }
    }

    pub fn column(&self, column: &str) -> Self {
        Self { column: Some(column.to_owned()), ..self.clone() }
    }
}

impl Display for Place {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.table)?;
        self.line.iter().try_for_each(|line| write!(f, ", line {line}"))?;
        self.column.iter().try_for_each(|column| write!(f, ", column `{column}`"))
    }
}

/// A problem with a remedy that the reader has: not every command has options for columns.
#[derive(Debug, thiserror::Error)]
pub(super) enum Problem {
    #[error("cannot be read: {0}; give the path of a CSV file")]
    Read(io::Error),
    #[error("is empty; its first line must name the columns")]
    Empty,
    #[error("is not text in UTF-8; save the file as plain CSV in UTF-8")]
    NotText,
    #[error(
        "begins with numbers; its first line must name the columns, as in \
         `t_s,q0_counts,q1_counts,pitch_deg,yaw_deg`"
    )]
    NoHeader,
    #[error("has {found} cells, but the header names {expected} columns; {remedy}")]
    RowLength { found: usize, expected: usize, remedy: &'static str },
    #[error("column {wanted} is missing; the columns are {present}; {remedy}")]
    MissingColumn { wanted: String, present: String, remedy: String },
    #[error("two columns are named `{0}`; rename one")]
    Ambiguous(String),
    #[error("column `{0}` is named for two purposes; name each column once")]
    UsedTwice(String),
    #[error("{found} columns are named as {what}; a model has at most {most}")]
    Columns { what: &'static str, found: usize, most: usize },
    #[error("`{value}` {reason}")]
    Cell { value: String, reason: &'static str },
    #[error("time {time} s {what} ({previous} s in line {previous_line}); {remedy}")]
    Time { time: f64, what: &'static str, previous: f64, previous_line: u64, remedy: &'static str },
    #[error("column `{column}` is empty on every row; record it, or {remedy}")]
    EmptyColumn { column: String, remedy: String },
    #[error(
        "column `{column}` is {value} on every row: {meaning}; record data in which it changes, \
         or {remedy}"
    )]
    ConstantColumn { column: String, value: f64, meaning: &'static str, remedy: String },
    #[error("{rows} complete row(s), but a model needs at least {least}; record more")]
    TooFewRows { rows: usize, least: usize },
    #[error("has no complete row; fill the empty cells")]
    NoRows,
    #[error("{0}")]
    Rate(String),
    #[error(
        "counts jump by about {modulus} (from {from} in line {before} to {to}), {jumps} \
         time(s) in all: a counter that wraps; {remedy}"
    )]
    Wrap { modulus: f64, from: f64, before: u64, to: f64, jumps: usize, remedy: &'static str },
    #[error(
        "counts are {value}, but {usual} in the adjacent line: an encoder glitch that no \
         motor makes (line {lines}); empty the cell, or remove the line"
    )]
    Glitch { value: f64, usual: f64, lines: String },
    #[error(
        "the order of the rows is not a path of a motor (median step {step} counts); give them in \
         the order of time, with a column of time"
    )]
    Order { step: f64 },
    #[error("angle {to} after {from}: it wraps from one end of its scale to the other; unwrap it")]
    AngleWrap { from: f64, to: f64 },
    #[error("spans {span:.3} mm over all rows; if these are metres, multiply them by 1000")]
    Metres { span: f64 },
    #[error(
        "spans {span:.3} counts over all rows; if these are turns of the motor, multiply them by \
         the counts of a turn"
    )]
    Turns { span: f64 },
    #[error(
        "counts step by {step} after line {before} and the outputs do not: homed, restarted or \
         slipped there; cut the recording there"
    )]
    Zero { step: f64, before: u64 },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_match_the_command_date() {
        for (cell, read) in [
            ("1970-01-01T00:00:00Z", Some(0.0)),
            // Output of `date -u -d ... +%s`.
            ("2026-01-02T03:04:00.050Z", Some(1_767_323_040.05)),
            ("2000/02/29 23:59:59", Some(951_868_799.0)),
            ("03:04:00,5", Some(11_040.5)),
            ("1970-01-01T00:00:02.5+00:00", Some(2.5)),
            ("2026-13-02T03:04:00", None),
            ("2026-01-02T03:04:00+01:00", None),
            ("1,234,5", None),
        ] {
            assert_eq!(seconds(cell, true), read, "{cell}");
        }
    }
}
