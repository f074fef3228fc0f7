//! The findings in words.

use i2ris_plot::Page;
use i2ris_plot::number::{fixed, grouped};

use super::data::{FamilyResult, ReportData};
use super::labels::{error, list, unit};
use super::score::{BASELINE, FamilyScore, Scores};

/// A model whose error on unseen rows is this much larger than in training has learned what does
/// not carry over.
const CARRIES_OVER: f64 = 1.5;

/// A model within this factor of the noise leaves nothing to gain.
const AT_THE_NOISE: f64 = 1.25;

pub(super) fn write(page: &mut Page, data: &ReportData, scores: &Scores) {
    if let Some((family, score)) = scores.chosen(data) {
        page.main_result(verdict(data, scores, family, score));
    }
    page.paragraph(what_was_read(data));
    let warnings: Vec<String> =
        data.warnings.iter().cloned().chain(findings(data, scores)).collect();
    if !warnings.is_empty() {
        page.notice("Keep in mind", warnings);
    }
}

fn verdict(
    data: &ReportData,
    scores: &Scores,
    family: &FamilyResult,
    score: &FamilyScore,
) -> String {
    let rows = if score.held_out.is_some() {
        "on the rows held out"
    } else {
        "on the rows used for training"
    };
    let Some(judged) = score.judged() else {
        return format!("The model is of the family {}.", family.name);
    };
    let text = format!("{} {}", error(judged.rms_length), unit(data));
    let said =
        format!("The model is of the family {}: root mean square error {text} {rows}", family.name);
    let baseline =
        scores.baseline(data).and_then(FamilyScore::judged).filter(|_| family.name != BASELINE);
    match baseline.map(|baseline| 100.0 * (1.0 - judged.rms_length / baseline.rms_length)) {
        Some(better) if better >= 0.0 => {
            format!("{said}, {} % below {BASELINE}.", fixed(better, 0))
        }
        Some(worse) => format!("{said}, {} % above {BASELINE}.", fixed(-worse, 0)),
        None => format!("{said}."),
    }
}

fn what_was_read(data: &ReportData) -> String {
    let track = &data.track;
    let outputs: Vec<String> = data.outputs.iter().map(|output| output.name.clone()).collect();
    let span = match track.time.last() {
        Some(seconds) if track.timed => format!(" over {} s", fixed(*seconds, 0)),
        _ => String::new(),
    };
    let held_out = match track.held_out().count() {
        0 => "none were held out".to_owned(),
        rows => format!("{} were held out ({})", grouped(rows), data.recording.held_out),
    };
    format!(
        "Recording {} of robot {}: {} rows of {}{span}, {}. {} rows were used for training, \
         {held_out}.",
        data.recording.name,
        data.recording.robot_id,
        grouped(track.time.len()),
        list(&outputs),
        if data.recording.motors == 1 { "one motor" } else { "two motors" },
        grouped(track.training.len()),
    )
}

/// Warnings that follow from the scores.
fn findings(data: &ReportData, scores: &Scores) -> Vec<String> {
    let mut findings = Vec::new();
    if data.track.holds_nothing_out() {
        findings.push(
            "No rows were held out: nothing here shows how the model does on other motion, and the \
             family with the most parameters looks best."
                .to_owned(),
        );
    }
    let Some((family, score)) = scores.chosen(data) else {
        return findings;
    };
    if data.chosen_by_held_out {
        findings.push(format!(
            "The family was chosen among {} by its error on the rows held out and by its inverse \
             on the others, so that error flatters it. Quote one on another recording, which \
             neither a fit nor the choice has seen.",
            data.families.len()
        ));
    }
    if let (Some(training), Some(held_out)) = (&score.training, &score.held_out) {
        let ratio = held_out.rms_length / training.rms_length;
        if ratio > CARRIES_OVER {
            findings.push(format!(
                "The error of {} on rows held out is {} times that in training: it has learned \
                 what does not carry over, or the robot has changed during the recording.",
                family.name,
                fixed(ratio, 1)
            ));
        }
    }
    let noise: Option<Vec<f64>> = data.outputs.iter().map(|output| output.noise).collect();
    let noise = noise.map(|noise| noise.iter().map(|noise| noise * noise).sum::<f64>().sqrt());
    if let (Some(noise), Some(judged)) = (noise, score.judged())
        && judged.rms_length < AT_THE_NOISE * noise
    {
        findings.push(format!(
            "The error is close to the noise of the measurement itself ({} {}): these data cannot \
             show a better model.",
            error(noise),
            unit(data)
        ));
    }
    let better =
        data.families.iter().zip(&scores.families).filter(|(other, _)| other.name != family.name);
    let better = better.filter(|(_, other)| match (other.judged(), score.judged()) {
        (Some(other), Some(chosen)) => other.rms_length < chosen.rms_length,
        _ => false,
    });
    let better: Vec<String> = better.map(|(other, _)| other.name.clone()).collect();
    if !better.is_empty() {
        findings.push(format!(
            "On these rows {} had less error than {}.",
            list(&better),
            family.name
        ));
    }
    findings
}
