//! Why the family was chosen: a sentence, and the scores of all families.

use i2ris::model::file::OutputUnit;
use i2ris_report::number::fixed;
use i2ris_report::page::TableRow;
use i2ris_report::{Page, Table};

use super::fit::{CalibrationReport, ChoiceScore};
use crate::fit::choice::Score;
use crate::fit::{Family, FitOutcome};

/// Another family this near, relative to the score of the chosen one, would do as well on another
/// recording.
const NEAR: f64 = 0.1;

/// A cell without a value.
pub(super) const NONE: &str = "–";

pub(super) fn write(page: &mut Page, data: &CalibrationReport) {
    let scores = &data.choice;
    let unit = data.unit();
    let Some(explanation) = explanation(scores, unit) else {
        return;
    };
    page.paragraph(explanation);
    let header = [
        "family".to_owned(),
        format!("held out ({unit})"),
        format!("tracking ({unit})"),
        "worst on".to_owned(),
        format!("score ({unit})"),
        "travel".to_owned(),
    ];
    let caption = "The choice: RMS length of the error on the rows held out; RMS length of the \
                   tracking error when the inverse of the family moves the other families as a \
                   robot, and the one where that goes worst; the score is both together, the root \
                   of the sum of squares; travel of the motors in these trials, relative to that \
                   of linear. Where a family has no tracking, scores are no comparison, and the \
                   error on the rows held out counts. A family whose error on the rows held out is far above the least, or \
                   that no other can follow, is no robot to be tried on.";
    let mut table = Table::new(caption.to_owned(), header);
    for score in scores {
        let none = || NONE.to_owned();
        let (worst, name) = match &score.tracking {
            Some((error, name)) => (fixed(*error, 3), name.clone()),
            None => (none(), none()),
        };
        table.row(TableRow {
            cells: vec![
                score.family.clone(),
                fixed(score.held_out, 3),
                worst,
                name,
                if are_alike(scores) { fixed(score.total, 3) } else { none() },
                if score.tracking.is_some() { fixed(score.travel, 2) } else { none() },
            ],
            strong: score.chosen,
            rule: true,
        });
    }
    page.table(&table);
}

/// Whether the scores compare the same errors: where a family has no other to try its inverse on,
/// its score is its error on the rows held out alone, and only those are alike.
fn are_alike(scores: &[ChoiceScore]) -> bool {
    let tried = scores.iter().filter(|score| score.tracking.is_some()).count();
    tried == 0 || tried == scores.len()
}

/// Why this one, and how sure that is; `None` where none was chosen.
pub(super) fn explanation(scores: &[ChoiceScore], unit: &str) -> Option<String> {
    let chosen = scores.iter().find(|score| score.chosen)?;
    let family = &chosen.family;
    let others = scores.iter().filter(|score| !score.chosen);
    let is_alike = are_alike(scores);
    let (scored, what) = match is_alike {
        true => ("score", "The score"),
        false => ("error on the rows held out", "That error"),
    };
    let value = |score: &ChoiceScore| if is_alike { score.total } else { score.held_out };
    let next = others.min_by(|a, b| value(a).total_cmp(&value(b)));
    let Some(next) = next else {
        return Some(format!("{family} is the only family that could be fitted."));
    };
    let part = value(next) / value(chosen) - 1.0;
    let percent = fixed(100.0 * part.abs(), 0);
    let (other, side) = (&next.family, if part < 0.0 { "below" } else { "above" });
    let uncertainty = fixed(next.uncertainty, 3);
    let is_balance = *family == Family::ForceBalance.to_string();
    let sure = match part {
        part if part < 0.0 && is_balance => "so little that the balance of forces was taken",
        part if part < 0.0 => "so little that the simpler family was taken",
        part if part < NEAR => "so near that another recording may turn it round",
        _ => "a clear difference",
    };
    let held_out = fixed(chosen.held_out, 3);
    let tracking = match &chosen.tracking {
        Some((error, plant)) => {
            format!("its inverse leaves {} {unit} on the others, most on {plant}", fixed(*error, 3))
        }
        None => "no other family is near enough to try its inverse on".to_owned(),
    };
    Some(format!(
        "{family} was chosen for its {scored}: on the rows held out its error is {held_out} \
         {unit}, and {tracking}. {what} of the next family, {other}, is {percent} % {side} it, {sure}. \
         By the blocks held out, the difference of their errors has a standard deviation of \
         {uncertainty} {unit}."
    ))
}

/// The unit of the outputs.
fn unit(outcome: &FitOutcome) -> OutputUnit {
    let output = outcome.model.file().outputs.first();
    output.map_or(OutputUnit::Deg, |output| output.unit)
}

/// The score of a family, in the unit of the outputs.
pub(super) fn choice_score(score: &Score, outcome: &FitOutcome) -> ChoiceScore {
    let unit = unit(outcome);
    let si = unit.si();
    ChoiceScore {
        family: score.family.to_string(),
        held_out: score.held_out / si,
        tracking: score.tracking.map(|(error, plant)| (error / si, plant.to_string())),
        uncertainty: uncertainty(score, outcome) / si,
        total: score.total() / si,
        travel: score.travel,
        chosen: score.family == outcome.family,
        sentence: score.sentence(unit),
    }
}

/// How sure the difference of a family to the chosen one is.
fn uncertainty(score: &Score, outcome: &FitOutcome) -> f64 {
    let mut scores = outcome.report.scores.iter();
    let chosen = scores.find(|score| score.family == outcome.family);
    chosen.map_or(0.0, |chosen| score.uncertainty_beside(chosen))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(family: &str, total: f64, chosen: bool) -> ChoiceScore {
        ChoiceScore {
            family: family.to_owned(),
            held_out: total,
            tracking: None,
            uncertainty: 0.03 * total,
            total,
            travel: 0.0,
            chosen,
            sentence: String::new(),
        }
    }

    #[test]
    fn the_sentence_reports_how_sure_the_choice_is() {
        for (next, part) in [
            (1.5, "force-balance, is 50 % above it, a clear difference"),
            (1.05, "is 5 % above it, so near that another recording may turn it round"),
            (0.98, "is 2 % below it, so little that the simpler family was taken"),
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
        let alike = [score("gmr-play", 1.0, false), score("force-balance", 1.02, true)];
        let text = explanation(&alike, "deg").unwrap();
        assert!(text.contains("so little that the balance of forces was taken"), "{text}");
        // The chosen one has nobody to try its inverse on: its score has no tracking in it.
        let tried = |score: ChoiceScore, error: f64| ChoiceScore {
            tracking: Some((error, "gmr-play".to_owned())),
            total: score.total.hypot(error),
            ..score
        };
        let scores = [
            tried(score("linear", 9.0, false), 5.0),
            score("gmr-play", 1.0, true),
            tried(score("force-balance", 1.05, false), 5.0),
        ];
        let text = explanation(&scores, "deg").unwrap();
        assert!(
            text.contains("That error of the next family, force-balance, is 5 % above it"),
            "{text}"
        );
        let one = [score("linear", 1.0, true)];
        assert!(explanation(&one, "deg").unwrap().contains("the only family"));
    }
}
