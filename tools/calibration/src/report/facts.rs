//! Facts of a calibration, and reasons of the choice: a sentence, and the scores of all families.

use std::iter;

use i2ris::model::file::OutputUnit;
use i2ris_report::number::fixed;
use i2ris_report::{Document, Table};

use super::fit::{CalibrationReport, ChoiceScore, FamilyResult, OutputFacts};
use crate::fit::choice::{Score, untried};
use crate::fit::{Family, FitOutcome};
use crate::quality::NoiseFloor;

/// Number of recording lines that are listed before the rest is only counted.
const NAMED: usize = 12;

impl CalibrationReport {
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
        let lines = list(dropped.iter().map(|row| format!("{} ({})", row.line, row.column)));
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
        let model = |it: &FamilyResult| (format!("model {}", it.name), it.model_id.clone());
        let models = self.families.iter().map(model);
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
            let moves = moves.collect::<Vec<_>>().join(" and ");
            format!("one count of motor {motor} moves {moves}")
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

/// Relative distance to the chosen score within which another recording may choose otherwise.
const NEAR: f64 = 0.1;

pub(super) const NONE: &str = "–";

pub(super) fn write_choice(page: &mut Document, data: &CalibrationReport) {
    let scores = &data.choice;
    let unit = data.unit();
    let Some(explanation) = explanation(scores, unit) else { return };
    page.paragraph(explanation);
    let [held_out, tracking, score] =
        ["held out", "tracking", "score"].map(|name| format!("{name} ({unit})"));
    let header = ["family", &held_out, &tracking, "worst on", &score, "travel"];
    let caption = "The choice: RMS length of the error on the held-out rows; RMS length of the \
                   tracking error when the inverse of the family moves the other families as \
                   robots, and the family with the largest error; the score is the root of the sum \
                   of squares of both; travel of the motors in these trials, relative to linear. \
                   Between families within one standard error of the best on the held-out rows, \
                   the tracking error on other robots than these decides. A \
                   family whose error on the held-out rows is far above the minimum, or that no \
                   other can follow, is not used as a robot.";
    let mut table = Table::new(caption, header);
    for score in scores {
        let none = || NONE.to_owned();
        let (worst, name) = match &score.tracking {
            Some((error, name)) => (fixed(*error, 3), name.clone()),
            None => (none(), none()),
        };
        let travel = if score.tracking.is_some() { fixed(score.travel, 2) } else { none() };
        let [held_out, total] = [score.held_out, score.total].map(|error| fixed(error, 3));
        let row = table.row([score.family.clone(), held_out, worst, name, total, travel]);
        (row.strong, row.rule) = (score.chosen, true);
    }
    page.table(table);
}

/// Reason of the choice, and its certainty; `None` if no family was chosen.
fn explanation(scores: &[ChoiceScore], unit: &str) -> Option<String> {
    let chosen = scores.iter().find(|score| score.chosen)?;
    let family = &chosen.family;
    let others = scores.iter().filter(|score| !score.chosen);
    let Some(next) = others.min_by(|a, b| a.beside.0.total_cmp(&b.beside.0)) else {
        return Some(format!("{family} is the only family that could be fitted."));
    };
    let (worse, error) = next.beside;
    let percent = |part: f64| fixed(100.0 * (part.exp() - 1.0).abs(), 0);
    let (other, side) = (&next.family, if worse < 0.0 { "below" } else { "above" });
    let is_balance = *family == Family::ForceBalance.to_string();
    let sure = match worse {
        worse if worse < 0.0 && chosen.hides_plane => {
            "but only linear and force-balance hold between the axes of this recording"
        }
        worse if worse < 0.0 && is_balance => "so little that the force balance was chosen",
        worse if worse < 0.0 => "so little that the simpler family was chosen",
        worse if worse < error.max(NEAR) => "so close that another recording may reverse the order",
        _ => "a clear difference",
    };
    let held_out = fixed(chosen.held_out, 3);
    let tracking = match &chosen.tracking {
        Some((error, plant)) => {
            let error = fixed(*error, 3);
            format!("its inverse has an error of {error} {unit} on the others, most on {plant}")
        }
        None => untried(chosen.hides_plane).to_owned(),
    };
    Some(format!(
        "{family} was chosen: on the rows held out its error is {held_out} {unit}, and {tracking}. \
         Over the blocks, that of the next family, {other}, is {} % {side} it, with a standard \
         error of {} %: {sure}.",
        percent(worse),
        percent(error)
    ))
}

/// The score of a family, in the unit of the outputs.
pub(super) fn choice_score(score: &Score, outcome: &FitOutcome) -> ChoiceScore {
    let unit = outcome.model.file().outputs.first().map_or(OutputUnit::Deg, |output| output.unit);
    let si = unit.si();
    let mut scores = outcome.report.scores.iter();
    let chosen = scores.find(|score| score.family == outcome.family);
    ChoiceScore {
        family: score.family.to_string(),
        held_out: score.held_out / si,
        tracking: score.tracking.map(|(error, plant)| (error / si, plant.to_string())),
        beside: chosen.map_or((0.0, 0.0), |chosen| score.beside(chosen)),
        total: score.total() / si,
        travel: score.travel,
        chosen: score.family == outcome.family,
        sentence: score.sentence(unit),
        hides_plane: score.hides_plane,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(family: &str, total: f64, chosen: bool) -> ChoiceScore {
        ChoiceScore {
            family: family.to_owned(),
            held_out: total,
            tracking: None,
            beside: (total.ln(), 0.03),
            total,
            travel: 0.0,
            chosen,
            sentence: String::new(),
            hides_plane: false,
        }
    }

    #[test]
    fn the_sentence_reports_the_certainty_of_the_choice() {
        for (next, part) in [
            (1.5, "force-balance, is 50 % above it, with a standard error of 3 %: a clear"),
            (1.05, "is 5 % above it, with a standard error of 3 %: so close that another"),
            (0.98, "is 2 % below it, with a standard error of 3 %: so little that the simpler"),
        ] {
            let scores = [
                score("linear", 9.0, false),
                score("gmr-play", 1.0, true),
                score("force-balance", next, false),
            ];
            let text = explanation(&scores, "deg").unwrap();
            assert!(text.contains(part), "{text}");
            assert!(text.contains("no other family is near enough"), "{text}");
        }
        let mut alike = [score("gmr-play", 0.98, false), score("force-balance", 1.0, true)];
        let text = explanation(&alike, "deg").unwrap();
        assert!(text.contains("so little that the force balance was chosen"), "{text}");
        alike[1].hides_plane = true;
        let text = explanation(&alike, "deg").unwrap();
        assert!(text.contains("but only linear and force-balance hold between"), "{text}");
        let one = [score("linear", 1.0, true)];
        assert!(explanation(&one, "deg").unwrap().contains("the only family"));
    }
}
