//! Facts of a calibration: names and values.

use std::iter;

use super::fit::{CalibrationReport, OutputFacts};
use crate::quality::NoiseFloor;

/// Number of recording lines that are listed before the rest is only counted.
const NAMED: usize = 12;

impl CalibrationReport {
    /// The facts that text and page have.
    pub(super) fn facts(&self) -> Vec<(&'static str, String)> {
        let recording = &self.recording;
        let read = &recording.read;
        let at = self.recorded_at.iter().map(|at| format!(", {at}"));
        let last = self.track.time.last().filter(|_| self.track.timed);
        let span = last.map(|seconds| format!(", {seconds:.0} s"));
        let named = iter::once(recording.name.clone()).chain(at).chain(span).collect();
        let motors = read.counts_columns.iter().enumerate();
        let motors = motors.map(|(motor, column)| format!("motor {motor} `{column}`"));
        let outputs = self.outputs.iter().zip(&read.output_columns);
        let outputs = outputs.map(|(output, column)| format!("{} `{column}`", output.name));
        let time = read.time_column.iter().map(|column| format!("time `{column}`"));
        let positions = match read.positions {
            0 => String::new(),
            positions => format!(", {positions} of them without angles"),
        };
        let (rows, dropped) = (read.rows, &read.dropped);
        let lines = dropped.iter().map(|row| format!("{} ({})", row.line, row.column));
        let lines = list(lines);
        let mut facts = vec![
            ("recording", named),
            ("columns", joined(motors.chain(outputs).chain(time))),
            (
                "rows",
                format!("{rows}{positions}; {} dropped for an empty cell{lines}", dropped.len()),
            ),
            ("spikes", self.flagged()),
            ("noise", joined(self.outputs.iter().map(noise))),
            ("axes", self.axes()),
        ];
        facts.extend(self.late().map(|late| ("latency", late)));
        let every = match recording.every {
            1 => String::new(),
            every => format!(": every {every}th row; more hardly improve the fit"),
        };
        facts.push(("training", format!("{} row(s){every}", recording.training)));
        let held_out = match recording.held_out {
            0 => "nothing".to_owned(),
            rows => format!("{rows} row(s): {}", recording.held_out_rows),
        };
        facts.push(("held out", held_out));
        let range = format!("the robot may use {:.1} % of the measured poses", self.usable_percent);
        facts.push(("range", range));
        facts.extend(self.hand.iter().map(|hand| ("limits", format!("as delivered: {hand}"))));
        facts.extend(self.unexplained.iter().map(|it| ("residual", it.to_string())));
        facts.push(("model id", self.model_id.clone()));
        facts
    }

    /// The origin of the models, for the page alone.
    pub(super) fn origin(&self) -> Vec<(String, String)> {
        let recorded = self.recorded_at.clone().unwrap_or_else(|| "no date known".to_owned());
        let fact = |(name, value): (&str, String)| (name.to_owned(), value);
        let first = [
            ("SHA-256 of the recording", self.recording.sha256.clone()),
            ("robot", self.robot_id.clone()),
            ("recorded", recorded),
        ];
        let models = self.families.iter();
        let models =
            models.map(|family| (format!("model {}", family.name), family.model_id.clone()));
        let settings = self.settings.iter();
        let settings = settings.map(|(name, value)| (format!("setting: {name}"), value.clone()));
        let latency = self.latency_taken_off_s.map(|seconds| {
            ("setting: latency corrected".to_owned(), format!("{:+.1} ms", 1e3 * seconds))
        });
        let facts = first.map(fact).into_iter().chain(models).chain(settings).chain(latency);
        facts.chain([fact(("software", self.software.clone()))]).collect()
    }

    fn flagged(&self) -> String {
        let spikes = self.spikes.iter().map(|spike| match self.outputs.get(spike.output) {
            Some(OutputFacts { name, unit, .. }) => {
                let (line, measured, off) = (spike.line, spike.measured, spike.distance);
                format!("{line} ({name} {measured:.2} {unit}, {off:+.2} off)")
            }
            None => spike.line.to_string(),
        });
        format!("{} reading(s) flagged{}", self.spikes.len(), list(spikes))
    }

    fn late(&self) -> Option<String> {
        let latency = self.latency.filter(|_| self.latency_taken_off_s.is_none())?;
        let (ms, deviation) = (1e3 * latency.seconds, 1e3 * latency.deviation_s);
        Some(format!(
            "the stamps of the outputs are kept: rows held out confirm no delay. Plays alone would \
             explain {ms:+.1} ms (standard deviation {deviation:.1} ms), as hysteresis often does; \
             `--latency-ms auto` subtracts it nevertheless"
        ))
    }

    /// Average effect of the motors: it shows swapped columns and mirrored images.
    fn axes(&self) -> String {
        let motor = |motor: usize| {
            let moves = self.outputs.iter().map(|OutputFacts { name, unit, gain, .. }| {
                let gain = gain.get(motor).copied().unwrap_or_default();
                format!("{name} by {gain:+.4} {unit}")
            });
            let moves: Vec<_> = moves.collect();
            format!("one count of motor {motor} moves {}", moves.join(" and "))
        };
        format!(
            "{}; if the robot moves differently, two columns are swapped (--counts, --angles) or \
             the image is mirrored",
            joined((0..self.recording.motors).map(motor))
        )
    }
}

fn noise(OutputFacts { name, unit, noise, .. }: &OutputFacts) -> String {
    match noise {
        Some(NoiseFloor { deviation, method, samples }) => {
            format!("{name} {deviation:.3} {unit} ({samples} {method})")
        }
        None => format!("{name} cannot be estimated from these rows"),
    }
}

fn joined(parts: impl Iterator<Item = String>) -> String {
    parts.collect::<Vec<_>>().join(", ")
}

/// The first of some lines of the recording, below what they are.
fn list(lines: impl ExactSizeIterator<Item = String>) -> String {
    let count = lines.len();
    let more = if count > NAMED { format!(" and {} more", count - NAMED) } else { String::new() };
    match count {
        0 => String::new(),
        _ => format!(":\nline {}{more}", joined(lines.take(NAMED))),
    }
}
