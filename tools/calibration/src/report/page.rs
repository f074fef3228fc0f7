//! The report of a fit: findings in words, tables, and the figures of the other files.

use std::{fmt, iter, mem};

use i2ris_report::number::fixed;
use i2ris_report::{Axis, Color, Document, Figure, Mark, Marker, Panel, Table};

use super::facts::{NONE, write_choice};
use super::figures::{NOISE, error, list, with_unit, write_loops, write_mixtures};
use super::fit::{BASELINE, CalibrationReport, Errors, FamilyResult};

/// Ratio of the errors on unseen and training rows above which a model does not generalise, and
/// ratio to the noise below which a better model cannot be shown.
const CARRIES_OVER: f64 = 1.5;
const AT_THE_NOISE: f64 = 1.25;

/// Height of a family in the figure of errors, and of the rest of the figure.
const HEIGHTS: [f64; 2] = [22.0, 66.0];

/// Characters of a hash that identify a model in a table, and columns of a printed report.
const SHORT: usize = 12;
const WIDTH: usize = 100;

impl fmt::Display for CalibrationReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.document().text(WIDTH))
    }
}

impl CalibrationReport {
    /// The report as a self-contained HTML document.
    pub fn html(&self) -> String {
        self.document().html()
    }

    fn document(&self) -> Document {
        let mut page = Document::new(format!("Calibration of {}", self.robot_id));
        if let Some(family) = self.chosen() {
            page.main_result(self.main_result(family));
        }
        page.facts(self.facts());
        page.notice("Keep in mind", self.notices());
        page.section("Families side by side");
        write_choice(&mut page, self);
        page.page_only(|page| {
            self.families_figure(page);
            page.table(self.overview());
        });
        page.table(self.metrics_table());
        for family in &self.families {
            let note = family.note.iter().map(|note| format!("`{}`: {note}.", family.name));
            note.for_each(|note| page.paragraph(note));
        }
        let readings = self.families.iter();
        let readings = readings.filter_map(|it| Some((&*it.name, it.reading.clone()?)));
        let readings: Vec<_> = readings.collect();
        if !readings.is_empty() {
            page.section("Properties of the robot (lengths in output units)");
            page.facts(readings);
        }
        page.page_only(|page| {
            page.section("Hysteresis");
            write_loops(page, self);
            write_mixtures(page, self);
            page.section("Where it comes from");
            page.facts(self.origin());
            page.paragraph(
                "Predictions come from the code that the controller runs, with its memory \
                 following the whole path of the motors from the first row on.",
            );
        });
        page
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

    fn notices(&self) -> Vec<String> {
        let mut notices = self.warnings.clone();
        let failed = self.failures.iter();
        notices.extend(failed.map(|(of, why)| format!("Family {of} gave no model: {why}.")));
        let flagged = self.recording.held_out_flagged;
        if flagged > 0 {
            notices.push(format!(
                "The held-out rows include {flagged} flagged as spikes; they count in all figures."
            ));
        }
        if self.recording.held_out == 0 {
            notices.push(
                "No rows were held out: these figures do not show the error on other motion, and \
                 the family with the most parameters looks best."
                    .to_owned(),
            );
        }
        if let Some(family) = self.chosen() {
            notices.extend(self.findings(family));
        }
        notices.extend(self.beyond_model.clone());
        notices
    }

    /// Conclusions from the errors of the chosen family.
    fn findings(&self, family: &FamilyResult) -> Vec<String> {
        let mut findings = Vec::new();
        if self.chosen_by_held_out {
            findings.push(format!(
                "The family was chosen among {} by its error on the held-out rows, and by \
                 its inverse where that was tried, so that error is too optimistic. Quote the \
                 error on another recording, which neither a fit nor the choice has seen.",
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

    fn families_figure(&self, page: &mut Document) {
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
            .with(Mark::markers(training, Color::GREY, Marker::Circle).label("training"));
        if !held_out.is_empty() {
            let held_out = Mark::markers(held_out, Color::BLUE, Marker::Diamond);
            panel = panel.with(held_out.label("held out"));
        }
        let mut dotted = "";
        if let Some(noise) = self.noise() {
            panel = panel.with(Mark::vertical(noise, NOISE));
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
        page.figure(figure, caption);
    }

    fn overview(&self) -> Table {
        let unit = self.unit();
        let [training, held_out] =
            ["training", "held out"].map(|rows| format!("RMS, {rows} ({unit})"));
        let header = ["family", &training, &held_out, "below linear", "fit (s)", "model"];
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
            table.row(cells).strong = family.chosen;
        }
        table
    }

    fn metrics_table(&self) -> Table {
        let caption = "Errors: coefficient of determination (R²), root mean square error (RMSD), \
                       the same over the range of the measured values (NRMSD), mean absolute error \
                       (MAE), its 99th percentile (p99), largest error; in the unit of the output.";
        let header = ["output", "family", "rows", "R²", "RMSD", "NRMSD", "MAE", "p99", "max"];
        let mut table = Table::new(caption, header).text_column(1).text_column(2);
        for (index, output) in self.outputs.iter().enumerate() {
            let mut output = with_unit(output);
            for family in &self.families {
                let metrics = family.metrics.get(index);
                let training = metrics.map(|metrics| metrics.training);
                let held_out = metrics.and_then(|metrics| metrics.held_out);
                let sets = [
                    ("training", training, &family.training),
                    ("held out", held_out, &family.held_out),
                ];
                let mut name = family.title.clone();
                for (rows, metrics, errors) in sets {
                    let Some(errors) = errors else { continue };
                    let rule = !name.is_empty();
                    let mut cells = vec![mem::take(&mut output), mem::take(&mut name)];
                    cells.push(rows.to_owned());
                    match metrics.zip(errors.p99.get(index)) {
                        Some((of, p99)) => {
                            let [rmsd, mae, p99, max] =
                                [of.rmsd, of.mae, *p99, of.max].map(|value| fixed(value, 3));
                            let nrmsd = fixed(of.nrmsd, 4);
                            cells.extend([fixed(of.r2, 4), rmsd, nrmsd, mae, p99, max]);
                        }
                        None => {
                            cells.push("constant".to_owned());
                            cells.extend(iter::repeat_n(NONE.to_owned(), 5));
                        }
                    }
                    let row = table.row(cells);
                    (row.strong, row.rule) = (family.chosen, rule);
                }
            }
        }
        table
    }
}
