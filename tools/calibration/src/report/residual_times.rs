//! Residuals over time.

use i2ris_report::{
    Axis, Color, Dash, Figure, Line, Page, Panel, ReferenceLine, ShadedInterval, Stroke,
};

use super::fit::{CalibrationReport, FamilyResult, OutputFacts};
use super::labels::{CHOSEN, NOISE, ZERO};

/// Heights of a panel with both models, and of one with the chosen model alone.
const HEIGHTS: [f64; 2] = [165.0, 150.0];

pub(super) fn write(page: &mut Page, data: &CalibrationReport) {
    let figure = Figure::new(
        "residuals",
        "Residuals over time",
        "For every output: measured minus predicted, from the first to the last row, for the \
         chosen model and the one it is compared with. The stretch that was held out is shaded.",
    );
    let figure = data.outputs.iter().enumerate().fold(figure, |figure, (index, output)| {
        let compared =
            data.reference().map(|family| vec![panel(data, index, output, Some(family))]);
        let figure = figure.row(HEIGHTS[0], compared.unwrap_or_default());
        figure.row(HEIGHTS[1], vec![panel(data, index, output, None)])
    });
    page.figure(
        &figure,
        "Measured minus predicted over time; the chosen model once more alone, on its own scale. \
         Shaded: rows held out. Dotted: two standard deviations of the noise of the measurement. A \
         slope or a step points to drift, a wave in time with the motion to hysteresis or shape \
         that the model does not have.",
    );
}

/// The chosen model, with what it is compared with or alone.
fn panel(
    data: &CalibrationReport,
    index: usize,
    output: &OutputFacts,
    compared: Option<&FamilyResult>,
) -> Panel {
    let track = &data.track;
    let x = Axis::linear(if track.timed { "time (s)" } else { "row" });
    let ends =
        (track.time.first().copied().unwrap_or(0.0), track.time.last().copied().unwrap_or(1.0));
    let x = x.range(ends.0, ends.1);
    let title = match (compared, data.chosen()) {
        (None, Some(family)) => format!("{}, {} alone", output.name, family.name),
        _ => output.name.clone(),
    };
    let mut panel = Panel::new(title, x, Axis::linear(format!("residual ({})", output.unit)));
    for (index, block) in track.held_out.iter().enumerate() {
        let last = block.end.saturating_sub(1);
        if let (Some(from), Some(to)) = (track.time.get(block.start), track.time.get(last)) {
            let shaded = ShadedInterval::new(*from, *to, Color::FAINT);
            panel = panel.with(match index {
                0 => shaded.label("held out"),
                _ => shaded,
            });
        }
    }
    if let Some(family) = compared {
        panel = panel
            .with(line(data, family, index, Stroke::new(Color::PALE, 0.8)).label(&*family.name));
    }
    if let Some(family) = data.chosen() {
        panel = panel
            .with(line(data, family, index, Stroke { width: 0.9, ..CHOSEN }).label(&*family.name));
    }
    panel = panel.with(ReferenceLine::horizontal(0.0, ZERO));
    match output.noise {
        Some(noise) => panel.with_all([-2.0, 2.0].map(|factor| {
            ReferenceLine::horizontal(factor * noise.deviation, NOISE.dash(Dash::Dotted))
        })),
        None => panel,
    }
}

fn line(data: &CalibrationReport, family: &FamilyResult, index: usize, stroke: Stroke) -> Line {
    let rows = data.track.time.iter().zip(&data.track.measured).zip(&family.predicted);
    Line::new(
        rows.map(|((time, measured), predicted)| [*time, measured[index] - predicted[index]])
            .collect(),
        stroke,
    )
}
