//! Tables: all families side by side, and where everything comes from.

use i2ris_plot::number::{fixed, grouped};
use i2ris_plot::page::TableRow;
use i2ris_plot::{Page, Table};

use super::data::{FamilyResult, ReportData};
use super::labels::{error, unit, with_unit};
use super::score::{FamilyScore, OutputScore, Score, Scores};

/// A cell without a value.
const NONE: &str = "–";

/// Characters of a hash that identify a model in a table.
const SHORT: usize = 12;

pub(super) fn write(page: &mut Page, data: &ReportData, scores: &Scores) {
    page.table(&overview(data, scores));
    for (index, output) in data.outputs.iter().enumerate() {
        let unit = &output.unit;
        let rmsd = ["RMSD", "MAE", "p99", "max"].map(|name| format!("{name} ({unit})"));
        let [rmsd, mae, p99, max] = rmsd;
        let header = [
            "family".to_owned(),
            "rows".to_owned(),
            "R²".to_owned(),
            rmsd,
            "NRMSD".to_owned(),
            mae,
            p99,
            max,
        ];
        let caption = format!(
            "{}: coefficient of determination (R²), root mean square error (RMSD), the same over \
             the range of the measured values (NRMSD), mean absolute error (MAE), its 99th \
             percentile (p99), largest error.",
            with_unit(output)
        );
        let mut table = Table::new(caption, header);
        for (family, score) in data.families.iter().zip(&scores.families) {
            let sets = [("training", &score.training), ("held out", &score.held_out)];
            let sets = sets.into_iter().filter_map(|(name, score)| Some((name, score.as_ref()?)));
            for (place, (name, score)) in sets.enumerate() {
                let of_output = score.outputs.get(index).and_then(Option::as_ref);
                let named = if place == 0 { family.name.clone() } else { String::new() };
                table.row(output_row(named, name, of_output, family.chosen, place == 0));
            }
        }
        page.table(&table);
    }
}

fn output_row(
    family: String,
    rows: &str,
    score: Option<&OutputScore>,
    strong: bool,
    rule: bool,
) -> TableRow {
    let numbers = match score {
        Some(OutputScore { metrics, p99 }) => {
            let [rmsd, mae, p99, max] =
                [metrics.rmsd, metrics.mae, *p99, metrics.max].map(|value| fixed(value, 3));
            vec![fixed(metrics.r2, 4), rmsd, fixed(metrics.nrmsd, 4), mae, p99, max]
        }
        None => vec![NONE.to_owned(); 6],
    };
    TableRow { cells: [family, rows.to_owned()].into_iter().chain(numbers).collect(), strong, rule }
}

fn overview(data: &ReportData, scores: &Scores) -> Table {
    let unit = unit(data);
    let header = [
        "family".to_owned(),
        format!("RMS, training ({unit})"),
        format!("RMS, held out ({unit})"),
        "below linear".to_owned(),
        "K".to_owned(),
        "log-likelihood (nats/row)".to_owned(),
        "BIC".to_owned(),
        "fit (s)".to_owned(),
        "model".to_owned(),
    ];
    let mut table = Table::new(
        "All families; the chosen one in bold. RMS: root mean square length of the error over all \
         outputs. K: components of the mixture. Log-likelihood and BIC compare mixtures of the \
         same variables only: those of families with memory see other inputs. Model: the first \
         digits of its SHA-256.",
        header,
    );
    let baseline =
        scores.baseline(data).and_then(FamilyScore::judged).map(|score| score.rms_length);
    for (family, score) in data.families.iter().zip(&scores.families) {
        table.row(overview_row(family, score, baseline));
    }
    table
}

fn overview_row(family: &FamilyResult, score: &FamilyScore, baseline: Option<f64>) -> TableRow {
    let none = || NONE.to_owned();
    let rms =
        |score: &Option<Score>| score.as_ref().map_or_else(none, |score| error(score.rms_length));
    let below = match (score.judged(), baseline) {
        (Some(score), Some(baseline)) => {
            format!("{} %", fixed(100.0 * (1.0 - score.rms_length / baseline), 1))
        }
        _ => none(),
    };
    let cells = vec![
        if family.chosen { format!("{} (chosen)", family.name) } else { family.name.clone() },
        rms(&score.training),
        rms(&score.held_out),
        below,
        family.components.map_or_else(none, |components| components.to_string()),
        family.log_likelihood.map_or_else(none, |value| fixed(value, 3)),
        family.bic.map_or_else(none, |value| fixed(value, 0)),
        family.fit_seconds.map_or_else(none, |value| {
            if value < 0.01 { "< 0.01".to_owned() } else { fixed(value, 2) }
        }),
        family.model_id.chars().take(SHORT).collect(),
    ];
    TableRow { cells, strong: family.chosen, rule: false }
}

pub(super) fn provenance(page: &mut Page, data: &ReportData) {
    let recording = &data.recording;
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let models = data
        .families
        .iter()
        .map(|family| fact(&format!("model {}", family.name), family.model_id.clone()));
    let noise = data.outputs.iter().map(|output| {
        let noise = output.noise.map_or_else(
            || "not known".to_owned(),
            |noise| format!("{} {}", error(noise), output.unit),
        );
        fact(&format!("noise of {}", output.name), noise)
    });
    page.facts(
        [
            fact("recording", recording.name.clone()),
            fact("its SHA-256", recording.sha256.clone()),
            fact("robot", recording.robot_id.clone()),
            fact("rows", grouped(data.track.time.len())),
        ]
        .into_iter()
        .chain(recording.more.iter().cloned())
        .chain(noise)
        .chain(models)
        .chain(data.settings.iter().cloned())
        .chain([fact("software", data.software.clone())]),
    );
    page.paragraph(
        "Predictions come from the code that the controller runs, with its memory following the \
         whole path of the motors from the first row on.",
    );
}
