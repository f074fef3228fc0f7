//! The page of a fit: findings in words, tables, and the figures of the other files.

use i2ris_report::number::{fixed, grouped};
use i2ris_report::page::TableRow;
use i2ris_report::{Axis, Color, Figure, Marker, Page, Panel, ReferenceLine, Scatter, Table};

use super::choice::{self, NONE};
use super::fit::{BASELINE, CalibrationReport, Errors, FamilyResult, OutputFacts};
use super::labels::{NOISE, error, list, with_unit};
use super::{hysteresis_loops, mixture_figure};

/// Ratio of the errors on unseen and training rows above which a model does not generalise.
const CARRIES_OVER: f64 = 1.5;

/// Ratio to the noise below which a better model cannot be shown.
const AT_THE_NOISE: f64 = 1.25;

/// Height of a family in the figure of errors, and of the rest of the figure.
const HEIGHTS: [f64; 2] = [22.0, 66.0];

/// Characters of a hash that identify a model in a table.
const SHORT: usize = 12;

impl CalibrationReport {
    /// The report as a self-contained HTML document.
    #[must_use]
    pub fn html(&self) -> String {
        let mut page = Page::new(format!("Calibration of {}", self.robot_id));
        if let Some(family) = self.chosen() {
            page.main_result(self.main_result(family));
        }
        page.paragraph(self.what_was_read_in_words());
        let warnings: Vec<String> = self.notices();
        if !warnings.is_empty() {
            page.notice("Keep in mind", warnings);
        }
        page.section("Families side by side");
        choice::write(&mut page, self);
        self.families_figure(&mut page);
        page.table(&self.overview());
        for (index, output) in self.outputs.iter().enumerate() {
            page.table(&self.metrics_table(index, output));
        }
        page.section("Hysteresis");
        hysteresis_loops::write(&mut page, self);
        mixture_figure::write(&mut page, self);
        page.section("Where it comes from");
        page.facts(self.facts());
        page.paragraph(
            "Predictions come from the code that the controller runs, with its memory following \
             the whole path of the motors from the first row on.",
        );
        page.to_string()
    }

    fn baseline(&self) -> Option<&Errors> {
        self.family(BASELINE).and_then(FamilyResult::judged)
    }

    fn main_result(&self, family: &FamilyResult) -> String {
        let held_out = family.held_out.is_some();
        let rows = if held_out { "rows held out" } else { "rows used for training" };
        let name = &family.title;
        let Some(judged) = family.judged() else {
            return format!("The model is of the family {name}.");
        };
        let text = format!("{} {}", error(judged.rms_length), self.unit());
        let result = format!(
            "The model is of the family {name}: root mean square error {text} on the {rows}"
        );
        let baseline = self.baseline().filter(|_| family.name != BASELINE);
        match baseline.map(|baseline| 100.0 * (1.0 - judged.rms_length / baseline.rms_length)) {
            Some(better) if better >= 0.0 => {
                format!("{result}, {} % below {BASELINE}.", fixed(better, 0))
            }
            Some(worse) => format!("{result}, {} % above {BASELINE}.", fixed(-worse, 0)),
            None => format!("{result}."),
        }
    }

    fn what_was_read_in_words(&self) -> String {
        let (track, recording) = (&self.track, &self.recording);
        let outputs: Vec<String> = self.outputs.iter().map(|output| output.name.clone()).collect();
        let span = match track.time.last() {
            Some(seconds) if track.timed => format!(" over {} s", fixed(*seconds, 0)),
            _ => String::new(),
        };
        let held_out = match track.held_out().count() {
            0 => "none were held out".to_owned(),
            rows => format!("{} were held out ({})", grouped(rows), recording.held_out_rows),
        };
        format!(
            "Recording {} of robot {}: {} rows of {}{span}, {}. {} rows were used for training, \
             {held_out}.",
            recording.name,
            self.robot_id,
            grouped(track.time.len()),
            list(&outputs),
            if recording.motors == 1 { "one motor" } else { "two motors" },
            grouped(track.training.len()),
        )
    }

    fn notices(&self) -> Vec<String> {
        let mut notices: Vec<String> = self.warnings.iter().map(|words| sentence(words)).collect();
        notices.extend(
            self.failures
                .iter()
                .map(|(family, reason)| format!("Family {family} gave no model: {reason}.")),
        );
        let flagged = self.recording.held_out_flagged;
        if flagged > 0 {
            notices.push(format!(
                "The held-out rows include {flagged} flagged as spikes; they count in all figures."
            ));
        }
        if self.track.holds_nothing_out() {
            notices.push(
                "No rows were held out: these figures do not show the error on other motion, and \
                 the family with the most parameters looks best."
                    .to_owned(),
            );
        }
        if let Some(family) = self.chosen() {
            notices.extend(self.findings(family));
        }
        let unexplained = self.unexplained.as_ref().map(ToString::to_string);
        notices.extend(self.beyond_model.iter().chain(&unexplained).map(|words| sentence(words)));
        notices
    }

    /// Conclusions from the errors of the chosen family.
    fn findings(&self, family: &FamilyResult) -> Vec<String> {
        let mut findings = Vec::new();
        if self.chosen_by_held_out {
            findings.push(format!(
                "The family was chosen among {} by its error on the held-out rows and by its \
                 inverse on the others, so that error is too optimistic. Quote the error on \
                 another recording, which neither a fit nor the choice has seen.",
                self.families.len()
            ));
        }
        if let (Some(training), Some(held_out)) = (&family.training, &family.held_out) {
            let ratio = held_out.rms_length / training.rms_length;
            if ratio > CARRIES_OVER {
                findings.push(format!(
                    "The error of {} on rows held out is {} times that in training: it does not \
                     generalise, or the robot has changed during the recording.",
                    family.name,
                    fixed(ratio, 1)
                ));
            }
        }
        let Some(judged) = family.judged() else { return findings };
        if let Some(noise) = self.noise()
            && judged.rms_length < AT_THE_NOISE * noise
        {
            findings.push(format!(
                "The error is close to the noise of the measurement itself ({} {}): these data \
                 cannot show a better model.",
                error(noise),
                self.unit()
            ));
        }
        let is_better = |other: &&FamilyResult| {
            other.name != family.name
                && other.judged().is_some_and(|other| other.rms_length < judged.rms_length)
        };
        let better: Vec<String> =
            self.families.iter().filter(is_better).map(|other| other.name.clone()).collect();
        if !better.is_empty() {
            findings.push(format!(
                "On these rows {} had less error than {}.",
                list(&better),
                family.name
            ));
        }
        findings
    }

    /// The error of every family in one figure.
    fn families_figure(&self, page: &mut Page) {
        let label = format!("root mean square error over all outputs ({})", self.unit());
        let names = self.families.iter().map(|family| family.name.clone()).collect();
        let dots = |of: fn(&FamilyResult) -> &Option<Errors>| -> Vec<[f64; 2]> {
            let families = self.families.iter().enumerate();
            let dot = |(place, family)| Some([of(family).as_ref()?.rms_length, place as f64]);
            families.filter_map(dot).collect()
        };
        let training = dots(|family| &family.training);
        let held_out = dots(|family| &family.held_out);
        let (x, y) = (Axis::linear(label).including(0.0), Axis::names("", names));
        let mut panel = Panel::new("", x, y)
            .with(Scatter::markers(training, Color::GREY, Marker::Circle).label("training"));
        if !held_out.is_empty() {
            let held_out = Scatter::markers(held_out, Color::BLUE, Marker::Diamond);
            panel = panel.with(held_out.label("held out"));
        }
        let mut dotted = "";
        if let Some(noise) = self.noise() {
            panel = panel.with(ReferenceLine::vertical(noise, NOISE));
            dotted = " Dotted: the noise of the measurement.";
        }
        let figure = Figure::new(
            "families",
            "Error of all families",
            "Root mean square length of the error of every family of models, on the rows used for \
             training and on the rows held out.",
        )
        .row(HEIGHTS[0] * self.families.len() as f64 + HEIGHTS[1], vec![panel]);
        let caption = format!(
            "Root mean square length of the error over all outputs, for every family of \
             models.{dotted}"
        );
        page.figure(&figure, &caption);
    }

    fn overview(&self) -> Table {
        let unit = self.unit();
        let header = [
            "family",
            &format!("RMS, training ({unit})"),
            &format!("RMS, held out ({unit})"),
            "below linear",
            "fit (s)",
            "model",
        ];
        let mut table = Table::new(
            "All families; the chosen one in bold. RMS: root mean square length of the error over \
             all outputs. Model: the first digits of its SHA-256.",
            header,
        );
        let or_none = |value: Option<String>| value.unwrap_or_else(|| NONE.to_owned());
        for family in &self.families {
            let rms = |errors: &Option<Errors>| {
                or_none(errors.as_ref().map(|errors| error(errors.rms_length)))
            };
            let below = family.judged().zip(self.baseline()).map(|(own, baseline)| {
                format!("{} %", fixed(100.0 * (1.0 - own.rms_length / baseline.rms_length), 1))
            });
            let seconds = family.fit_seconds;
            let cells = vec![
                format!("{}{}", family.title, if family.chosen { " (chosen)" } else { "" }),
                rms(&family.training),
                rms(&family.held_out),
                or_none(below),
                if seconds < 0.01 { "< 0.01".to_owned() } else { fixed(seconds, 2) },
                family.model_id.chars().take(SHORT).collect(),
            ];
            table.row(TableRow { cells, strong: family.chosen, rule: false });
        }
        table
    }

    fn metrics_table(&self, index: usize, output: &OutputFacts) -> Table {
        let [rmsd, mae, p99, max] =
            ["RMSD", "MAE", "p99", "max"].map(|name| format!("{name} ({})", output.unit));
        let caption = format!(
            "{}: coefficient of determination (R²), root mean square error (RMSD), the same over \
             the range of the measured values (NRMSD), mean absolute error (MAE), its 99th \
             percentile (p99), largest error.",
            with_unit(output)
        );
        let mut table =
            Table::new(caption, ["family", "rows", "R²", &rmsd, "NRMSD", &mae, &p99, &max]);
        for family in &self.families {
            let metrics = family.metrics.get(index);
            let training = metrics.map(|metrics| metrics.training);
            let held_out = metrics.and_then(|metrics| metrics.held_out);
            let sets = [
                ("training", training, &family.training),
                ("held out", held_out, &family.held_out),
            ];
            let sets = sets
                .into_iter()
                .filter_map(|(rows, fit, errors)| Some((rows, fit, errors.as_ref()?)));
            for (place, (rows, metrics, errors)) in sets.enumerate() {
                let name = if place == 0 { family.title.clone() } else { String::new() };
                let mut cells = vec![name, rows.to_owned()];
                match metrics.zip(errors.p99.get(index)) {
                    Some((of, p99)) => {
                        let [rmsd, mae, p99, max] =
                            [of.rmsd, of.mae, *p99, of.max].map(|value| fixed(value, 3));
                        cells.extend([fixed(of.r2, 4), rmsd, fixed(of.nrmsd, 4), mae, p99, max]);
                    }
                    None => cells.extend(std::iter::repeat_n(NONE.to_owned(), 6)),
                }
                table.row(TableRow { cells, strong: family.chosen, rule: place == 0 });
            }
        }
        table
    }

    /// Origin of the models: names and values.
    fn facts(&self) -> Vec<(String, String)> {
        let (recording, read) = (&self.recording, &self.recording.read);
        let mut facts: Vec<(String, String)> = Vec::new();
        let mut fact = |name: &str, value: String| facts.push((name.to_owned(), value));
        fact("recording", recording.name.clone());
        fact("its SHA-256", recording.sha256.clone());
        fact("robot", self.robot_id.clone());
        fact("recorded", self.recorded_at.clone().unwrap_or_else(|| "no date known".to_owned()));
        fact("rows", grouped(self.track.time.len()));
        fact("columns of counts", read.counts_columns.join(", "));
        fact("columns of outputs", read.output_columns.join(", "));
        read.time_column.iter().for_each(|column| fact("column of time", column.clone()));
        fact("rows dropped for an empty cell", read.dropped.len().to_string());
        fact("rows with positions only", read.positions.to_string());
        let usable = format!("{} % of the measured range", fixed(self.usable_percent, 1));
        fact("range that the robot may use", usable);
        self.hand.iter().for_each(|hand| fact("limits as delivered", hand.to_string()));
        fact("readings flagged as spikes", self.spikes.len().to_string());
        if let Some(latency) = self.latency {
            let (ms, deviation) = (1e3 * latency.seconds, 1e3 * latency.deviation_s);
            let late = format!("{ms:.1} ms (standard deviation {deviation:.1} ms)");
            fact("latency of the outputs", late);
        }
        for family in &self.families {
            if let Some(lines) = &family.reading {
                let lines = lines.trim_end().replace('\n', "; ");
                fact(&format!("reading of {}", family.name), lines);
            }
        }
        for OutputFacts { name, unit, noise, .. } in &self.outputs {
            let noise = noise.map(|noise| format!("{} {unit}", error(noise.deviation)));
            let noise = noise.unwrap_or_else(|| "not known".to_owned());
            fact(&format!("noise of {name}"), noise);
        }
        for family in &self.families {
            fact(&format!("model {}", family.name), family.model_id.clone());
        }
        for (name, value) in &self.settings {
            fact(&format!("setting: {name}"), value.clone());
        }
        if let Some(seconds) = self.latency_taken_off_s {
            fact("setting: latency corrected", format!("{:+.1} ms", 1e3 * seconds));
        }
        fact("software", self.software.clone());
        facts
    }
}

/// With a capital letter at the beginning and a full stop at the end.
fn sentence(words: &str) -> String {
    let mut characters = words.chars();
    let first = characters.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", characters.as_str().trim_end_matches('.'))
}
