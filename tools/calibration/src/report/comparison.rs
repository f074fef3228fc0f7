//! The error of every family in one figure.

use i2ris_plot::{Axis, Color, Figure, Marker, Page, Panel, ReferenceLine, Scatter};

use super::data::ReportData;
use super::labels::{NOISE, unit};
use super::score::{FamilyScore, Score, Scores};

/// Height of a family, and of all that is around them.
const HEIGHTS: [f64; 2] = [22.0, 66.0];

pub(super) fn write(page: &mut Page, data: &ReportData, scores: &Scores) {
    let unit = unit(data);
    let x =
        Axis::linear(format!("root mean square error over all outputs ({unit})")).including(0.0);
    let y = Axis::names("", data.families.iter().map(|family| family.name.clone()).collect());
    let dots = |of: fn(&FamilyScore) -> &Option<Score>| -> Vec<[f64; 2]> {
        let scores = scores.families.iter().enumerate();
        scores
            .filter_map(|(place, score)| Some([of(score).as_ref()?.rms_length, place as f64]))
            .collect()
    };
    let (training, held_out) = (dots(|score| &score.training), dots(|score| &score.held_out));
    let mut panel = Panel::new("", x, y)
        .with(Scatter::markers(training, Color::GREY, Marker::Circle).label("training"));
    if !held_out.is_empty() {
        panel =
            panel.with(Scatter::markers(held_out, Color::BLUE, Marker::Diamond).label("held out"));
    }
    let noise: Option<Vec<f64>> = data.outputs.iter().map(|output| output.noise).collect();
    let noise = noise.map(|noise| noise.iter().map(|noise| noise * noise).sum::<f64>().sqrt());
    if let Some(noise) = noise {
        panel = panel.with(ReferenceLine::vertical(noise, NOISE));
    }
    let height = HEIGHTS[0] * data.families.len() as f64 + HEIGHTS[1];
    let figure = Figure::new(
        "families",
        "Error of all families",
        "Root mean square length of the error of every family of models, on the rows used for \
         training and on the rows held out.",
    )
    .row(height, vec![panel]);
    let dotted = if noise.is_some() { " Dotted: the noise of the measurement." } else { "" };
    let caption = format!(
        "Root mean square length of the error over all outputs, for every family of models.{dotted}"
    );
    page.figure(&figure, &caption);
}
