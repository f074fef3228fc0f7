//! Requirements on tables, row by row and from row to row.

use i2ris::units::MAX_MOTORS;
use i2ris_report::statistics::{median, min_max};

use super::columns::{Column, Layout, TIME_UNITS};
use super::rows::MIN_ROWS;
use super::sheet::{Problem, RecordingError};
use super::table::{ReadRow, Table};

/// Plausible rates, Hz, and the lowest above a number of rows; else stamps are hardly in seconds.
const RATES_HZ: (f64, f64) = (0.5, 10_000.0);
const LONG: (f64, usize) = (2.0, 5000);

/// Minimum number of points of a trajectory whose rate is checked as well.
const POINTS: usize = 10;

/// Rates of controllers and cameras, Hz.
const USUAL_HZ: (f64, f64) = (2.0, 5000.0);

impl Table<'_> {
    /// Checks stamps, and steps of the motors; unwraps their counters if requested.
    pub fn check(&mut self) -> Result<(), RecordingError> {
        if self.wanted.rising {
            self.times_rise()?;
            self.rate_is_usual()?;
        }
        (0..self.layout.counts.len()).try_for_each(|motor| self.steps_are_of_a_motor(motor))
    }

    /// Columns in use: option that leaves it out, meaning if it never changes, cell in a row.
    fn used(&self) -> impl Iterator<Item = (&Column, [&'static str; 2], impl Fn(&ReadRow) -> f64)> {
        let Layout { time, counts, outputs, .. } = &self.layout;
        let time = time.iter().map(|column| (column, ["--time none", ""], 0));
        let counts = counts.iter().zip(1..);
        let counts = counts.map(|(it, cell)| (it, ["--counts", "that motor never moved"], cell));
        let outputs = outputs.iter().zip(1 + MAX_MOTORS..);
        let outputs = outputs.map(|(it, cell)| (&it.0, ["--angles", "nothing was measured"], cell));
        time.chain(counts).chain(outputs).map(|(column, words, cell)| {
            let value = move |row: &ReadRow| {
                let ([a, b], [x, y, z]) = (row.counts, row.outputs);
                [row.time_s.unwrap_or(f64::NAN), a, b, x, y, z][cell]
            };
            (column, words, value)
        })
    }

    fn without(&self, option: &str) -> String {
        match self.columns.options {
            true => format!("leave it out with {option}"),
            false => "remove that column from the table".to_owned(),
        }
    }

    /// Refuses a column that is empty on every row.
    pub fn columns_are_filled(&self) -> Result<(), RecordingError> {
        for (column, [option, _], cell) in self.used() {
            if !self.rows.is_empty() && self.rows.iter().all(|row| cell(row).is_nan()) {
                let (column, remedy) = (column.name.clone(), self.without(option));
                return Err(self.error(Problem::EmptyColumn { column, remedy }));
            }
        }
        Ok(())
    }

    /// Refuses outputs that never change, and motors unless they may stand still.
    pub fn columns_change(&self, still: bool) -> Result<(), RecordingError> {
        for (column, [option, meaning], cell) in self.used() {
            if still && option == "--counts" {
                continue;
            }
            let mut cells = self.rows.iter().filter(|row| row.empty.is_none()).map(cell);
            let value = cells.next().unwrap_or_default();
            if cells.all(|other| other == value) {
                let (column, remedy) = (column.name.clone(), self.without(option));
                return Err(self.error(Problem::ConstantColumn { column, value, meaning, remedy }));
            }
        }
        Ok(())
    }

    fn located(&self) -> impl Iterator<Item = &ReadRow> {
        self.rows.iter().filter(|row| row.located)
    }

    fn times_rise(&self) -> Result<(), RecordingError> {
        let Some(column) = &self.layout.time else { return Ok(()) };
        let stamps = || self.located().map(|row| (row.time_s.unwrap_or_default(), row.line));
        let mut pairs = stamps().zip(stamps().skip(1));
        let Some(((previous, previous_line), (time, line))) = pairs.find(|(a, b)| a.0 >= b.0)
        else {
            return Ok(());
        };
        let what = if time < previous { "goes backwards" } else { "occurs twice" };
        let remedy = if self.columns.options && !self.wanted.time {
            "correct the stamps, cut the recording there, or read it without time (--time none)"
        } else {
            "correct the stamps, or cut the table there"
        };
        let problem = Problem::Time { time, what, previous, previous_line, remedy };
        Err(RecordingError::new(self.place.line(line).column(&column.name), problem))
    }

    /// Checks for a rate that no camera has: stamps are often in ms with a name in seconds.
    fn rate_is_usual(&mut self) -> Result<(), RecordingError> {
        let Some(Column { name, .. }) = &self.layout.time else { return Ok(()) };
        let times: Vec<f64> = self.located().filter_map(|row| row.time_s).collect();
        let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let hz = median(&mut steps).map_or(USUAL_HZ.0, |step| 1.0 / step);
        let (unit, is_certain) = self.layout.seconds;
        let is_slow = hz < RATES_HZ.0 || hz < LONG.0 && steps.len() >= LONG.1;
        // The points of a trajectory may be far apart. A table with many points was recorded.
        let (is_trajectory, is_short) = (self.layout.counts.is_empty(), steps.len() < POINTS);
        if is_certain || !is_slow && hz <= RATES_HZ.1 || is_trajectory && is_short {
            return Ok(());
        }
        let in_unit = |seconds: f64| round(hz * unit / seconds);
        let is_usual = |hz: f64| (USUAL_HZ.0..=USUAL_HZ.1).contains(&hz);
        let other = TIME_UNITS.iter().find(|(_, seconds)| is_usual(in_unit(*seconds)));
        let (guess, seconds) = other.map_or(("s", 1.0), |(names, seconds)| (names[0], *seconds));
        let text = format!(
            "column `{name}`: {} row(s) per second as read, {} if it is in {guess}",
            round(hz),
            in_unit(seconds)
        );
        let quote = if name.contains(' ') { "'" } else { "" };
        let text = match self.columns.options {
            true => format!(
                "{text}; give its unit with --time {quote}{name}={guess}{quote} (s, ms, us or ns)"
            ),
            false => format!("{text}; call it `t_{guess}` if that is its unit (s, ms, us, ns)"),
        };
        if self.columns.options && !is_trajectory {
            return Err(self.error(Problem::Rate(text)));
        }
        self.notes.push(text);
        Ok(())
    }

    /// Refuses counts that wrap, and single wrong counts: no motor makes such a step.
    fn steps_are_of_a_motor(&mut self, motor: usize) -> Result<(), RecordingError> {
        let (counts, lines): (Vec<f64>, Vec<u64>) =
            self.located().map(|row| (row.counts[motor], row.line)).unzip();
        let name = self.layout.counts[motor].name.clone();
        let at = |row: usize| self.place.line(lines[row]).column(&name);
        let remedy = match self.columns.options {
            true => "unwrap it with --unwrap",
            false => "unwrap it, for example with numpy.unwrap(counts, period=...)",
        };
        if let Some(found) = wrap(&counts) {
            let (modulus, jumps) = (found.modulus, found.jumps.len());
            if let (Some(&first), false) = (found.jumps.first(), self.columns.unwrap) {
                let (from, to, before) = (counts[first - 1], counts[first], lines[first - 1]);
                let problem = Problem::Wrap { modulus, from, before, to, jumps, remedy };
                return Err(RecordingError::new(at(first), problem));
            }
            let unwrapped = found.unwrapped(&counts);
            self.notes.push(format!(
                "column `{name}`: a counter of {modulus} steps, unwrapped at {jumps} jump(s) \
                 starting at {}",
                unwrapped[0]
            ));
            let rows = self.rows.iter_mut().filter(|row| row.located);
            rows.zip(unwrapped).for_each(|(row, counts)| row.counts[motor] = counts);
            return Ok(());
        }
        let wrong = glitches(&counts);
        let Some(&first) = wrong.first() else { return Ok(()) };
        let neighbour = counts.get(first.wrapping_sub(1)).or(counts.get(first + 1));
        let (value, usual) = (counts[first], neighbour.copied().unwrap_or_default());
        let all: Vec<String> = wrong.iter().map(|row| lines[*row].to_string()).collect();
        let lines = all.join(", ");
        Err(RecordingError::new(at(first), Problem::Glitch { value, usual, lines }))
    }
}

fn round(value: f64) -> f64 {
    let scale = 10.0_f64.powf(1.0 - value.abs().log10().floor());
    (value * scale).round() / scale
}

/// Bits of counters. Round numbers are not included: such steps are commanded.
const BITS: std::ops::RangeInclusive<i32> = 10..=32;

/// Range of a signed 32-bit counter; an unsigned one exceeds it.
const BEYOND: f64 = 2_147_483_648.0;

/// Wrong readings: distance in ranges (without outer twentieths) and counts, and rows at most.
const AWAY: (f64, f64, usize) = (2.0, 2000.0, 3);

pub(super) struct Wrap {
    pub modulus: f64,
    /// The rows after a jump.
    pub jumps: Vec<usize>,
}

/// Detects a counter that wraps: counts jump from one end of its range to the other, continue
/// there, and make no other large step. A counter beyond all signed ones wraps without a jump.
pub(super) fn wrap(counts: &[f64]) -> Option<Wrap> {
    let (low, high) = min_max(counts.iter().copied());
    if low >= BEYOND && !counts.is_empty() {
        return Some(Wrap { modulus: 2.0 * BEYOND, jumps: Vec::new() });
    }
    let of = |modulus: f64| {
        let steps = counts.windows(2).map(|pair| (pair[1] - pair[0]).abs()).enumerate();
        let (jumps, others): (Vec<_>, Vec<_>) = steps.partition(|(_, step)| *step > modulus / 2.0);
        let usual = others.iter().fold(0.0, |most: f64, (_, step)| most.max(*step));
        let rest = jumps.iter().fold(0.0, |most: f64, (_, step)| most.max((modulus - step).abs()));
        let is_one = !jumps.is_empty() && usual > 0.0 && usual < modulus / 4.0;
        let jumps = jumps.iter().map(|(step, _)| step + 1).collect();
        (is_one && rest <= 2.0 * usual + 8.0).then_some(Wrap { modulus, jumps })
    };
    let fits = |modulus: &f64| high - low <= *modulus && high - low > modulus / 2.0;
    BITS.map(|bits| f64::from(bits).exp2()).find(fits).and_then(of)
}

impl Wrap {
    /// The counts without jumps, starting at the first count, or at 0 if they leave 32 bits.
    pub fn unwrapped(&self, counts: &[f64]) -> Vec<f64> {
        let mut turns = if counts.first() >= Some(&BEYOND) { -1.0 } else { 0.0 };
        let unwrap = |(row, count): (usize, &f64)| {
            if self.jumps.binary_search(&row).is_ok() {
                turns -= (count - counts[row - 1]).signum();
            }
            count + turns * self.modulus
        };
        let mut counts: Vec<f64> = counts.iter().enumerate().map(unwrap).collect();
        if counts.iter().any(|counts| counts.abs() >= BEYOND) {
            let first = counts[0];
            counts.iter_mut().for_each(|counts| *counts -= first);
        }
        counts
    }
}

/// Rows whose count is far from those of all others, for a few rows.
pub(super) fn glitches(counts: &[f64]) -> Vec<usize> {
    if counts.len() < MIN_ROWS {
        return Vec::new();
    }
    let mut sorted = counts.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (low, high) = (sorted[counts.len() / 20], sorted[counts.len() - 1 - counts.len() / 20]);
    let away = (AWAY.0 * (high - low)).max(AWAY.1);
    let is_usual = |row: &usize| (low - away..=high + away).contains(&counts[*row]);
    let is_glitch = |row: &usize| {
        let before = (row.saturating_sub(AWAY.2)..*row).rev().find(is_usual);
        let after = (row + 1..counts.len().min(row + 1 + AWAY.2)).find(is_usual);
        let is_far = |other: &usize| (counts[*other] - counts[*row]).abs() >= away;
        let is_edge = *row == 0 || row + 1 == counts.len();
        (is_edge || before.is_some() && after.is_some()) && before.iter().chain(&after).all(is_far)
    };
    (0..counts.len()).filter(|row| !is_usual(row)).filter(is_glitch).collect()
}
