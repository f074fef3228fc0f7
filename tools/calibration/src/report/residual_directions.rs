//! Residuals by the direction of the motion. A model that averages the two branches of a loop has
//! two peaks here, one for each direction, where a good model has one.

use i2ris_report::mark::FiveNumbers;
use i2ris_report::{Axis, BoxPlot, Color, Dash, Figure, Line, Page, Panel, ReferenceLine, Stroke};

use super::fit::{CalibrationReport, FamilyResult, OutputFacts};
use super::labels::ZERO;
use i2ris_report::statistics::{quantile, quantile_of_unsorted, sort};

/// Bars of a histogram.
const BINS: usize = 41;

/// Height of the histograms; height of a family among the boxes, and of all that is around them.
const HEIGHTS: [f64; 3] = [210.0, 34.0, 66.0];

/// Share of the rows inside the histograms.
const SHOWN: f64 = 0.995;

/// Thickness of a box and its distance from the middle of its family.
const BOX: [f64; 2] = [0.3, 0.19];

pub(super) fn write(page: &mut Page, data: &CalibrationReport) {
    let rows = data.track.judged();
    let outputs = || data.outputs.iter().enumerate();
    let histograms =
        outputs().map(|(index, output)| histogram(data, &rows, index, output)).collect();
    let boxes = outputs().map(|(index, output)| boxes(data, &rows, index, output)).collect();
    let figure = Figure::new(
        "directions",
        "Residuals against direction",
        "For every output: how the residuals are distributed while the counts rise and while they \
         fall; above as histograms for the chosen model and the one it is compared with, below as \
         boxes for all families.",
    )
    .row(HEIGHTS[0], histograms)
    .row(HEIGHTS[1] * data.families.len() as f64 + HEIGHTS[2], boxes);
    let on = if data.track.holds_nothing_out() { "used for training" } else { "held out" };
    let caption = format!(
        "Measured minus predicted while the counts along the output rise and while they fall, on \
         the rows {on}. Boxes: middle half and median; whiskers: 1st to 99th percentile. Where the \
         two directions part, the model leaves part of the loop."
    );
    page.figure(&figure, &caption);
}

fn residuals(
    data: &CalibrationReport,
    rows: &[usize],
    family: &FamilyResult,
    index: usize,
    rising: bool,
) -> Vec<f64> {
    let track = &data.track;
    let residual = |row: &usize| {
        let now = track.rising.get(*row)?[index];
        let residual = track.measured.get(*row)?[index] - family.predicted.get(*row)?[index];
        (now == rising && residual.is_finite()).then_some(residual)
    };
    rows.iter().filter_map(residual).collect()
}

fn histogram(
    data: &CalibrationReport,
    rows: &[usize],
    index: usize,
    output: &OutputFacts,
) -> Panel {
    let families = || data.reference().into_iter().chain(data.chosen());
    let both = [true, false];
    let reach = families()
        .flat_map(|family| both.map(|rising| residuals(data, rows, family, index, rising)));
    let mut sizes: Vec<f64> = reach.flatten().map(f64::abs).collect();
    let reach = quantile_of_unsorted(&mut sizes, SHOWN);
    let reach = reach.filter(|reach| *reach > 0.0).unwrap_or(1.0);
    let edges: Vec<f64> =
        (0..=BINS).map(|i| reach * (2.0 * i as f64 / BINS as f64 - 1.0)).collect();
    let x = Axis::linear(format!("residual ({})", output.unit)).range(-reach, reach);
    let panel = Panel::new(&*output.name, x, Axis::linear("rows (%)").including(0.0))
        .with(ReferenceLine::vertical(0.0, ZERO));
    families().fold(panel, |panel, family| {
        let inks = if family.chosen {
            [Color::BLUE, Color::VERMILION]
        } else {
            [Color::GREY, Color::GREY]
        };
        let width = if family.chosen { 1.5 } else { 1.0 };
        let dashes = [(true, "rising", Dash::Solid), (false, "falling", Dash::Dashed)];
        panel.with_all(dashes.into_iter().zip(inks).map(|((rising, name, dash), ink)| {
            let shares = shares(&residuals(data, rows, family, index, rising), &edges);
            let line = Line::steps(&edges, &shares, Stroke::new(ink, width).dash(dash));
            line.label(format!("{}, {name}", family.name))
        }))
    })
}

/// Share of the values between neighbouring edges, percent of all.
fn shares(values: &[f64], edges: &[f64]) -> Vec<f64> {
    let mut counts = vec![0.0; edges.len().saturating_sub(1)];
    for value in values {
        let bin = edges.partition_point(|edge| edge <= value).wrapping_sub(1);
        if let Some(count) = counts.get_mut(bin) {
            *count += 100.0 / values.len() as f64;
        }
    }
    counts
}

fn boxes(data: &CalibrationReport, rows: &[usize], index: usize, output: &OutputFacts) -> Panel {
    let names = data.families.iter().map(|family| family.name.clone()).collect();
    let x = Axis::linear(format!("residual ({})", output.unit)).including(0.0);
    let panel = Panel::new("all families", x, Axis::names("", names))
        .with(ReferenceLine::vertical(0.0, ZERO));
    let directions = [
        (true, -BOX[1], Color::WHITE, "box: rising"),
        (false, BOX[1], Color::PALE, "box: falling"),
    ];
    panel.with_all(directions.map(|(rising, offset, fill, label)| {
        let families = data.families.iter().enumerate();
        let five = |(place, family): (usize, &FamilyResult)| {
            Some((place as f64 + offset, five(&mut residuals(data, rows, family, index, rising))?))
        };
        BoxPlot::new(families.filter_map(five).collect(), fill, BOX[0]).label(label)
    }))
}

fn five(values: &mut [f64]) -> Option<FiveNumbers> {
    sort(values);
    let quantile = |share| quantile(values, share);
    Some(FiveNumbers {
        whiskers: [quantile(0.01)?, quantile(0.99)?],
        quartiles: [quantile(0.25)?, quantile(0.75)?],
        median: quantile(0.5)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_all_values_and_ends_belong_above() {
        let edges = [-1.0, 0.0, 1.0];
        assert_eq!(shares(&[-0.5, 0.0, 0.5, 7.0], &edges), [25.0, 50.0]);
        assert_eq!(shares(&[-2.0, -1.0], &edges), [50.0, 0.0]);
        assert_eq!(shares(&[], &edges), [0.0, 0.0]);
    }

    #[test]
    fn boxes_hold_the_middle_half() {
        let mut values: Vec<f64> = (1..=100).map(f64::from).collect();
        let five = five(&mut values).unwrap();
        assert_eq!((five.whiskers, five.quartiles, five.median), ([1.0, 99.0], [25.0, 75.0], 50.0));
        assert_eq!(super::five(&mut []), None);
    }
}
