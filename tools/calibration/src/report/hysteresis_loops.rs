//! Counts against angle: the measured loop, and the branches of the models.

use i2ris_report::{Axis, Color, Dash, Document, Figure, Mark, Marker, Panel, Stroke};

use super::fit::{Branches, CalibrationReport, FamilyResult, OutputFacts};
use super::labels::{ZERO, along};

/// Heights of the two rows of panels.
const HEIGHTS: [f64; 2] = [250.0, 220.0];

/// The falling branch of the chosen model.
const FALLING: Stroke = Stroke::new(Color::VERMILION, 1.6).dash(Dash::Dashed);
/// The rising branch of the chosen model.
const RISING: Stroke = Stroke::new(Color::BLUE, 1.6);
/// Both branches of the reference model.
const OTHER: Stroke = Stroke::new(Color::BLACK, 1.2).dash(Dash::Dotted);

pub(super) fn write(page: &mut Document, data: &CalibrationReport) {
    let outputs = || data.outputs.iter().enumerate();
    let angles = outputs().map(|(index, output)| panel(data, index, output, false)).collect();
    let deviations = outputs().map(|(index, output)| panel(data, index, output, true)).collect();
    let figure = Figure::new(
        "loops",
        "Counts against angle",
        "For every output: the measured values against encoder counts, with the branches of the \
         chosen model for rising and for falling counts; above the output itself, below its \
         distance from the straight line.",
    )
    .row(HEIGHTS[0], angles)
    .row(HEIGHTS[1], deviations);
    page.figure(
        figure,
        "Measured outputs against the counts along each of them: the counts, projected on the \
         direction in which the output changes most. Lines: predictions of the models on one sweep \
         back and forth through the middle of the calibrated region. Top: the output. Bottom: its \
         distance from the straight line, where the loop shows. Measured rows need not lie on that \
         loop: they come from other motion, with inner loops and with the other axis elsewhere.",
    );
}

fn panel(data: &CalibrationReport, index: usize, output: &OutputFacts, deviation: bool) -> Panel {
    let direction = output.straight.direction();
    let x = Axis::linear(format!("{} (counts)", along(&direction, data.recording.motors)));
    let y = if deviation {
        Axis::linear(format!("{} − line ({})", output.name, output.unit))
    } else {
        Axis::linear(format!("{} ({})", output.name, output.unit))
    };
    let title = if deviation {
        format!("{}, from the straight line", output.name)
    } else {
        output.name.clone()
    };
    let mut panel = Panel::new(title, x, y).with(Mark::horizontal(0.0, ZERO));
    for (rising, ink, label) in
        [(true, Color::PALE, "measured, rising"), (false, Color::GREY, "measured, falling")]
    {
        panel = panel.with(
            Mark::dots(measured(data, index, output, rising, deviation), ink, 1.5).label(label),
        );
    }
    if let Some((family, branches)) =
        data.reference().and_then(|family| Some((family, family.branches.get(index)?)))
    {
        panel = panel.with(line(&branches.rising, OTHER, deviation).label(&*family.name));
        if !one_line(branches) {
            panel = panel.with(line(&branches.falling, OTHER, deviation));
        }
    }
    match data.chosen().and_then(|family| Some((family, family.branches.get(index)?))) {
        Some((family, branches)) => panel.with_all(both(family, branches, deviation)),
        None => panel,
    }
}

/// Without memory both branches are the same; drawn twice, dots would run together.
fn one_line(branches: &Branches) -> bool {
    let back = branches.falling.iter().rev();
    branches
        .rising
        .iter()
        .zip(back)
        .all(|(there, back)| (there[1] - back[1]).abs() <= 1e-9 * there[1].abs().max(1.0))
}

fn both(family: &FamilyResult, branches: &Branches, deviation: bool) -> [Mark; 2] {
    let rising = line(&branches.rising, RISING, deviation).marker(Marker::Triangle);
    let falling = line(&branches.falling, FALLING, deviation).marker(Marker::Square);
    [
        rising.label(format!("{}, rising", family.name)),
        falling.label(format!("{}, falling", family.name)),
    ]
}

fn line(branch: &[[f64; 3]], stroke: Stroke, deviation: bool) -> Mark {
    let point = |[along, value, straight]: &[f64; 3]| {
        [*along, if deviation { value - straight } else { *value }]
    };
    Mark::line(branch.iter().map(point).collect(), stroke)
}

fn measured(
    data: &CalibrationReport,
    index: usize,
    output: &OutputFacts,
    rising: bool,
    deviation: bool,
) -> Vec<[f64; 2]> {
    let track = &data.track;
    let rows = track.counts.iter().zip(&track.measured).zip(&track.rising);
    let rows = rows.filter(|(_, now)| now[index] == rising);
    let point = |((counts, measured), _): ((&[f64; 2], &[f64; 3]), &[bool; 3])| {
        let straight = if deviation { output.straight.at(counts) } else { 0.0 };
        [output.straight.along(counts), measured[index] - straight]
    };
    rows.map(point).collect()
}
