//! The page of a study: what differs between the conditions, in a table and a figure.

use i2ris_report::number::significant;
use i2ris_report::{Axis, Color, Document, Figure, Mark, Panel, Stroke, Table};

use super::comparison::{Effect, Measure, Row, StudyReport};

const ROW_HEIGHT: f64 = 210.0;
/// Maximum number of measures side by side on a sheet.
const MAX_COLUMNS: usize = 5;
const PARTICIPANT: Stroke = Stroke::new(Color::GREY, 0.9);
const MEAN: Stroke = Stroke::new(Color::BLUE, 2.2);

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| significant(value, 3))
}

fn signed(value: f64) -> String {
    format!("{}{}", if value > 0.0 { "+" } else { "" }, significant(value, 2))
}

/// The mean with its interval, or with the differences of all participants.
fn sentence(effect: Option<&Effect>) -> String {
    let Some(Effect { difference, interval, differences }) = effect else {
        return "-".to_owned();
    };
    let (mean, count) = (signed(*difference), differences.len());
    match interval {
        Some(ends) => {
            format!("{mean} [{}], n = {count}", ends.map(|end| significant(end, 2)).join(", "))
        }
        None if count == 1 => format!("{mean}, n = 1"),
        None => {
            let each: Vec<_> = differences.iter().map(|it| signed(*it)).collect();
            format!("{mean} ({}), n = {count}", each.join(", "))
        }
    }
}

/// Two panels in each row.
fn rows(mut figure: Figure, mut panels: impl Iterator<Item = Panel>) -> Figure {
    while let Some(left) = panels.next() {
        figure = figure.row(ROW_HEIGHT, [left].into_iter().chain(panels.next()).collect());
    }
    figure
}

impl StudyReport {
    /// The comparison as text, without figures.
    pub fn text(&self) -> String {
        self.document().text(usize::MAX)
    }

    /// The comparison as an HTML page.
    pub fn html(&self) -> String {
        self.document().html()
    }

    fn document(&self) -> Document {
        let mut page = Document::new(format!("Study {}", self.study));
        let counted = self.trials.iter().filter(|trial| trial.left_out.is_none()).count();
        let participants = self.rows.iter().map(|row| row.by_participant.len()).max().unwrap_or(0);
        page.main_result(format!(
            "{counted} of {} trials count, of {participants} participants under {} conditions.",
            self.trials.len(),
            self.conditions.len()
        ));
        let left_out = self.trials.iter();
        let left_out = left_out
            .filter_map(|trial| Some(format!("{}: {}", trial.name, trial.left_out.as_ref()?)));
        page.notice("Left out", left_out);
        let mixed = self.mixed.iter().map(|sentence| format!("Condition {sentence}"));
        page.notice("More than the condition differs", mixed);
        self.write_conditions(&mut page);
        page.page_only(|page| {
            page.section("Trials");
            self.trial_tables().into_iter().for_each(|table| page.table(table));
        });
        let version = env!("CARGO_PKG_VERSION");
        page.footer(format!("Written by i2ris {version} from the recordings of the study alone."));
        page
    }

    fn write_conditions(&self, page: &mut Document) {
        page.section("Conditions");
        let reference = self.conditions.first().map_or("", String::as_str);
        let others = self.conditions.iter().skip(1);
        let header = ["".to_owned()]
            .into_iter()
            .chain(self.conditions.iter().cloned())
            .chain(others.map(|name| format!("{name} − {reference}")));
        let mut table = Table::new(
            "Means over the participants, and the mean difference within the participants: with \
             its 95 % interval (paired bootstrap), or below eight participants with all \
              differences.",
            header,
        );
        for Row { measure, means, effects, .. } in self.known() {
            let means = means.iter().map(|mean| number(*mean));
            let effects = effects.iter().skip(1).map(|effect| sentence(effect.as_ref()));
            let name = [measure.name().to_owned()];
            table.row(name.into_iter().chain(means).chain(effects));
        }
        page.table(table);
        page.figure(
            self.figure(),
            "Every participant (grey) and the mean of all (blue) under each condition.",
        );
        if self.conditions.len() > 1 {
            let caption = format!(
                "Difference from {reference} within each participant (grey): mean, and 95 % \
                 interval from eight participants or more. An interval across zero does not show \
                 that there is no difference: the study was too small to decide."
            );
            page.figure(self.effect_figure(), caption);
        }
        let about = "Throughput after ISO 9241-411, with the effective width of the end points \
             along the way; the hold time is not part of the movement time. Error: between goal \
             and camera. Lag of a pursuit: where the cross-correlation of target and snake is \
             largest; its first 3 s do not count. Workload: NASA-TLX without weights. Trials \
             that were aborted do not count.";
        page.page_only(|page| page.paragraph(about));
    }

    /// Measures that any trial shows.
    fn known(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| row.means.iter().any(Option::is_some))
    }

    fn figure(&self) -> Figure {
        let figure = Figure::new(
            "conditions",
            "Conditions by participant",
            "Every measure of every participant under each condition.",
        );
        rows(figure, self.known().map(|row| self.panel(row)))
    }

    fn effect_figure(&self) -> Figure {
        let figure = Figure::new(
            "effects",
            "Effect of the condition",
            "Difference of every measure from the first condition, with its interval.",
        );
        let differs = |row: &&Row| row.effects.iter().flatten().any(|it| it.difference.abs() > 0.0);
        rows(figure, self.known().filter(differs).map(|row| self.effect_panel(row)))
    }

    /// The conditions side by side, from the first one that is drawn.
    fn axis(&self, first: usize) -> Axis {
        let names = self.conditions.iter().enumerate().skip(first);
        let last = self.conditions.len().max(1) as f64 - 0.5;
        Axis::linear("condition")
            .range(first as f64 - 0.5, last)
            .marks(names.map(|(place, name)| (place as f64, name.clone())).collect())
    }

    fn effect_panel(&self, row: &Row) -> Panel {
        let effects = row.effects.iter().enumerate();
        let known = effects.filter_map(|(place, effect)| Some((place as f64, effect.as_ref()?)));
        let intervals = known.clone().filter_map(|(x, effect)| {
            let [low, high] = effect.interval?;
            Some(Mark::line(vec![[x, low], [x, high]], MEAN))
        });
        let means = known.clone().map(|(x, effect)| [x, effect.difference]).collect();
        let each = known.clone().flat_map(|(x, it)| it.differences.iter().map(move |it| [x, *it]));
        let name = row.measure.name();
        let y = Axis::linear(format!("difference: {name}")).including(0.0);
        Panel::new(name, self.axis(1), y)
            .with(Mark::horizontal(0.0, PARTICIPANT))
            .with(Mark::dots(each.collect(), Color::GREY, 4.0))
            .with_all(intervals)
            .with(Mark::dots(means, Color::BLUE, 5.0))
    }

    fn panel(&self, row: &Row) -> Panel {
        let points = |means: &[Option<f64>]| -> Vec<[f64; 2]> {
            let places = means.iter().enumerate();
            places.filter_map(|(place, mean)| Some([place as f64, (*mean)?])).collect()
        };
        let all = row.by_participant.values().map(|means| points(means));
        let name = row.measure.name();
        Panel::new(name, self.axis(0), Axis::linear(name).including(0.0))
            .with_all(all.clone().map(|points| Mark::line(points, PARTICIPANT)))
            .with(Mark::dots(all.flatten().collect(), Color::GREY, 4.0))
            .with(Mark::line(points(&row.means), MEAN))
    }

    /// Tables of every trial; a second one if the first is wider than a sheet.
    fn trial_tables(&self) -> Vec<Table> {
        let known: Vec<Measure> = self.known().map(|row| row.measure).collect();
        known.chunks(MAX_COLUMNS).map(|measures| self.trial_table(measures)).collect()
    }

    fn trial_table(&self, measures: &[Measure]) -> Table {
        let fixed = ["trial", "outcome", "marks", "model"];
        let header = fixed.map(str::to_owned);
        let names = measures.iter().map(|measure| measure.name().to_owned());
        let mut table = Table::new("Every trial.", header.into_iter().chain(names)).text_column(1);
        for trial in &self.trials {
            let outcome =
                trial.outcome.map_or("-".to_owned(), |it| format!("{it:?}").to_lowercase());
            let model = trial.made_with.model.clone();
            let fixed = [trial.name.clone(), outcome, trial.marks.to_string(), model];
            let values = Measure::ALL.into_iter().zip(trial.values);
            let values = values.filter(|(measure, _)| measures.contains(measure));
            table.row(fixed.into_iter().chain(values.map(|(_, it)| number(it))));
        }
        table
    }
}
