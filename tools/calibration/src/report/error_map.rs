//! The plane of the first two outputs: the rows of the recording, and the error of the chosen
//! model.

use std::collections::BTreeMap;

use i2ris_report::number::fixed;
use i2ris_report::{Axis, Color, Figure, Heatmap, Page, Panel, Scatter};

use super::fit::{CalibrationReport, FamilyResult};
use super::labels::with_unit;
use i2ris_report::statistics::{distance, min_max, root_mean_square};

const HEIGHT: f64 = 330.0;

/// Cells across the larger of the two ranges.
const ACROSS: f64 = 18.0;

/// The least number of rows in a cell for an error.
const LEAST_ROWS: usize = 3;

pub(super) fn write(page: &mut Page, data: &CalibrationReport) {
    let ([first, second, ..], Some(family)) = (data.outputs.as_slice(), data.chosen()) else {
        return;
    };
    let axes = || (Axis::linear(with_unit(first)), Axis::linear(with_unit(second)));
    let ((x1, y1), (x2, y2)) = (axes(), axes());
    let point =
        |row: usize| data.track.measured.get(row).map(|measured| [measured[0], measured[1]]);
    let training = data.track.training.iter().filter_map(|row| point(*row)).collect();
    let held_out: Vec<_> = data.track.held_out().filter_map(point).collect();
    let mut visited = Panel::new("visited", x1, y1)
        .with(Scatter::new(training, Color::PALE, 1.8).label("training"))
        .equal();
    if !held_out.is_empty() {
        visited = visited.with(Scatter::new(held_out, Color::BLUE, 1.8).label("held out"));
    }
    let clipped: Vec<_> = data.track.clipped.iter().filter_map(|row| point(*row)).collect();
    if !clipped.is_empty() {
        visited = visited.with(Scatter::new(clipped, Color::VERMILION, 1.8).label("clipped"));
    }
    let title = format!("error of {} ({})", family.name, data.unit());
    let errors = Panel::new(title, x2, y2).with(cells(data, family)).equal();
    let figure = Figure::new(
        "map",
        format!("{} and {}", first.name, second.name),
        "Left: where in the plane of the first two outputs the recording went. Right: the root \
         mean square error of the chosen model in cells of that plane; dark cells have large \
         errors.",
    )
    .row(HEIGHT, vec![visited, errors]);
    let caption = format!(
        "The plane of {} and {}. Left: the rows of the recording; the robot may use \
         {} % of them. Right: root mean square length \
         of the error of {} over all rows in a cell, training and held out; cells with fewer than \
         {LEAST_ROWS} rows are left white.",
        first.name,
        second.name,
        fixed(data.usable_percent, 1),
        family.name
    );
    page.figure(&figure, &caption);
}

fn cells(data: &CalibrationReport, family: &FamilyResult) -> Heatmap {
    let measured = &data.track.measured;
    let range = |output: usize| min_max(measured.iter().map(|measured| measured[output]));
    let (x, y) = (range(0), range(1));
    let side = ((x.1 - x.0).max(y.1 - y.0) / ACROSS).max(f64::MIN_POSITIVE);
    let mut errors: BTreeMap<(i64, i64), Vec<f64>> = BTreeMap::new();
    for (measured, predicted) in measured.iter().zip(&family.predicted) {
        let cell = (
            ((measured[0] - x.0) / side).floor() as i64,
            ((measured[1] - y.0) / side).floor() as i64,
        );
        let outputs = data.outputs.len();
        let error = distance(&measured[..outputs], &predicted[..outputs]);
        errors.entry(cell).or_default().push(error);
    }
    let mean = |(place, errors): ((i64, i64), Vec<f64>)| {
        let enough = errors.len() >= LEAST_ROWS;
        let corner = [x.0 + place.0 as f64 * side, y.0 + place.1 as f64 * side];
        Some((corner, root_mean_square(errors)?)).filter(|_| enough)
    };
    let cells: Vec<_> = errors.into_iter().filter_map(mean).collect();
    let (bounds, labels) = classes(cells.iter().map(|(_, error)| *error).fold(0.0, f64::max));
    Heatmap::new(cells, [side, side], bounds, labels)
}

/// Five classes of equal width from 0 to at least the largest error, with round ends.
fn classes(largest: f64) -> ([f64; 4], [String; 5]) {
    let rough = (largest / 5.0).max(1e-6);
    let power = 10f64.powf(rough.log10().floor());
    let step =
        [1.0, 1.5, 2.0, 3.0, 5.0, 10.0].into_iter().find(|m| m * power >= rough).unwrap_or(10.0)
            * power;
    let decimals = (1.0 - step.log10().floor()).clamp(0.0, 6.0) as usize;
    let end = |i: usize| fixed(step * i as f64, decimals);
    let label = |i: usize| format!("{}–{}", end(i), end(i + 1));
    (std::array::from_fn(|i| step * (i + 1) as f64), std::array::from_fn(label))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_round_and_reach_the_largest_error() {
        for largest in [0.0003, 0.37, 0.5, 1.01, 23.0] {
            let (bounds, labels) = classes(largest);
            assert!(
                bounds[0] * 5.0 >= largest && bounds[0] * 5.0 <= 2.0 * largest.max(5e-6) + 1e-9,
                "{largest}: {bounds:?}"
            );
            assert!(labels.windows(2).all(|pair| pair[0] != pair[1]));
        }
        assert_eq!(classes(0.9).1[1], "0.20–0.40");
    }
}
