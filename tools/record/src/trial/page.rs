//! The page of a study: what differs between the conditions, in a table and a figure; and its
//! numbers as CSV: what was measured, what was compared, every target.

use i2ris_report::number::significant;
use i2ris_report::{Axis, Color, Document, Figure, Mark, Panel, Stroke, Table};

use super::comparison::{Effect, MEASURES, MadeWith, Row, StudyReport};
use super::journal::Outcome;
use super::participant::SCALES;

const ROW_HEIGHT: f64 = 210.0;
/// Maximum number of measures side by side on a sheet; others are in a second table.
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
    pub fn text(&self) -> String {
        self.document().text(usize::MAX)
    }

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
            let known: Vec<&str> = self.known().map(|row| row.name).collect();
            known.chunks(MAX_COLUMNS).for_each(|names| page.table(self.trial_table(names)));
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
        for Row { name, means, effects, .. } in self.known() {
            let means = means.iter().map(|mean| number(*mean));
            let effects = effects.iter().skip(1).map(|effect| sentence(effect.as_ref()));
            table.row([(*name).to_owned()].into_iter().chain(means).chain(effects));
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
             that are aborted or incomplete do not count.";
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
        let name = row.name;
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
        let name = row.name;
        Panel::new(name, self.axis(0), Axis::linear(name).including(0.0))
            .with_all(all.clone().map(|points| Mark::line(points, PARTICIPANT)))
            .with(Mark::dots(all.flatten().collect(), Color::GREY, 4.0))
            .with(Mark::line(points(&row.means), MEAN))
    }

    fn trial_table(&self, measures: &[&str]) -> Table {
        let fixed = ["trial", "outcome", "marks", "model"];
        let header = fixed.iter().chain(measures).copied();
        let mut table = Table::new("Every trial.", header).text_column(1);
        for trial in &self.trials {
            let outcome = trial.outcome.map_or("-".to_owned(), Outcome::name);
            let model = trial.made_with.model.clone();
            let fixed = [trial.name.clone(), outcome, trial.marks.to_string(), model];
            let values = MEASURES.iter().zip(trial.values);
            let values = values.filter(|(measure, _)| measures.contains(&measure.name));
            table.row(fixed.into_iter().chain(values.map(|(_, it)| number(it))));
        }
        table
    }
}

/// An empty cell: not known.
fn cell(value: Option<f64>) -> String {
    value.map_or(String::new(), |it| it.to_string())
}

fn table(rows: impl IntoIterator<Item = Vec<String>>) -> Result<Vec<u8>, csv::Error> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    rows.into_iter().try_for_each(|row| csv.write_record(row))?;
    csv.into_inner().map_err(|error| error.into_error().into())
}

fn header<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    names.into_iter().map(str::to_owned).collect()
}

impl StudyReport {
    /// The tables, by the end of their file names.
    pub fn tables(&self) -> Result<[(&'static str, Vec<u8>); 3], csv::Error> {
        Ok([
            ("", table(self.trial_rows())?),
            ("-effects", table(self.effect_rows())?),
            ("-targets", table(self.target_rows())?),
        ])
    }

    fn trial_rows(&self) -> Vec<Vec<String>> {
        let fixed =
            ["trial", "participant", "condition", "started", "outcome", "marks", "left_out"];
        let scales = SCALES.map(|(name, ..)| name);
        let measures = MEASURES.map(|measure| measure.name);
        let names = fixed.into_iter().chain(MadeWith::NAMES).chain(measures).chain(scales);
        let mut rows = vec![header(names)];
        for trial in &self.trials {
            let outcome = trial.outcome.map(Outcome::name);
            let mut row = vec![
                trial.name.clone(),
                trial.participant.clone(),
                trial.condition.clone(),
                trial.started.clone(),
                outcome.unwrap_or_default(),
                trial.marks.to_string(),
                trial.left_out.clone().unwrap_or_default(),
            ];
            row.extend(trial.made_with.cells());
            row.extend(trial.values.map(cell));
            let answers = trial.workload.map(|workload| workload.0.map(f64::from).map(Some));
            row.extend(answers.unwrap_or_default().map(cell));
            rows.push(row);
        }
        rows
    }

    fn effect_rows(&self) -> Vec<Vec<String>> {
        let names = "measure,condition,mean,difference,low_95,high_95,participants";
        let mut rows = vec![header(names.split(','))];
        for Row { name, means, effects, .. } in &self.rows {
            for (condition, (mean, effect)) in self.conditions.iter().zip(means.iter().zip(effects))
            {
                let interval = effect.as_ref().and_then(|effect| effect.interval);
                let numbers = [
                    *mean,
                    effect.as_ref().map(|effect| effect.difference),
                    interval.map(|[low, _]| low),
                    interval.map(|[_, high]| high),
                    effect.as_ref().map(|effect| effect.differences.len() as f64),
                ];
                let mut row = vec![(*name).to_owned(), condition.clone()];
                row.extend(numbers.map(cell));
                rows.push(row);
            }
        }
        rows
    }

    fn target_rows(&self) -> Vec<Vec<String>> {
        let names = "trial,target,t_s,from_pitch_deg,from_yaw_deg,to_pitch_deg,to_yaw_deg,\
                     distance_deg,arrived_s,held_s,overshoot_deg,detour";
        let mut rows = vec![header(names.split(','))];
        for trial in &self.trials {
            for target in &trial.targets {
                let [[a, b], [c, d]] = [target.from_deg, target.to_deg];
                let mut row = vec![trial.name.clone(), target.number.to_string()];
                row.extend([target.t_s, a, b, c, d, target.distance_deg].map(Some).map(cell));
                row.extend([target.arrived_s, target.held_s].map(cell));
                row.extend([target.overshoot_deg, target.detour].map(Some).map(cell));
                rows.push(row);
            }
        }
        rows
    }
}
