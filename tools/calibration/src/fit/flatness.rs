//! Models that are flat where the robot is not.
//!
//! Where a regression has a small slope in some direction of motor space, its inverse takes large
//! steps for small goals. A mixture with too many components gets such places between its data. But
//! a snake may be slack around its straight pose, and then a flat model is correct. Hence the rule:
//! a position is **too flat** if the smallest slope of the model is below `MIN_SHARE` of that of
//! the affine model, and the rows around it do not agree: there are too few, or a local affine
//! regression has more than twice that slope in that direction, beyond its uncertainty. A
//! hysteresis loop correctly widens that uncertainty: its branches are slack at different counts.

use std::fmt;

use i2ris::model::{Hull, Model};
use i2ris::units::MotorVec;
use nalgebra::{DMatrix, DVector};

use crate::regression::linear::LinearFit;
use crate::table::DataTable;
use i2ris_report::statistics::min_max;

/// Minimum slope of a model, as a part of the affine model's slope, if no rows show a smaller one.
/// The fit of the laboratory's ring with three components has a tenth between its data, with two
/// components half; mixtures over the echo probe, with its slack zone, have a fifth or more.
const MIN_SHARE: f64 = 0.2;

/// Positions along each motor's range.
const STEPS: usize = 25;

/// Width of the region around a place, as a part of each range: well below a slack zone.
const WIDTH: f64 = 0.03;

/// Rows of a local regression per parameter, and tolerance of its slope, in standard errors.
const ROWS_PER_NUMBER: f64 = 5.0;
const STANDARD_ERRORS: f64 = 2.0;

/// A position at which a model is flat and the recording does not show it.
#[derive(Debug, Clone, PartialEq)]
pub struct FlatSpot {
    /// Position, counts, one per motor.
    pub counts: Vec<f64>,
    /// Motion of the outputs per count in the flattest direction, in their unit.
    pub slope: f64,
    /// The same for the affine model.
    pub straight: f64,
}

impl fmt::Display for FlatSpot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { counts, slope, straight } = self;
        write!(
            f,
            "it is nearly flat at counts {counts:.0?}: {slope:.2e} per count in one direction, \
             but {straight:.2e} in a straight model, and the rows around it do not confirm that"
        )
    }
}

/// The flattest place that its rows do not show, if any; models with memory without it.
pub fn flat_spot(
    model: &Model,
    inputs: &DataTable,
    outputs: &DataTable,
    straight: &LinearFit,
) -> Option<FlatSpot> {
    let unit = model.file().outputs.first();
    let unit = unit.map_or(1.0, |output| output.unit.si());
    let memory = model.new_memory();
    let slope = |counts: &MotorVec| {
        let jacobian = model.jacobian(counts, &memory);
        DMatrix::from_fn(model.outputs(), model.motors(), |output, motor| {
            jacobian[output][motor] / unit
        })
    };
    find(&slope, model.hull(), &Rows::new(inputs, outputs), straight)
}

fn find(
    slope: &dyn Fn(&MotorVec) -> DMatrix<f64>,
    hull: &Hull,
    rows: &Rows,
    straight: &LinearFit,
) -> Option<FlatSpot> {
    let gains = straight.gain.iter().flatten().copied();
    let gain = DMatrix::from_row_iterator(straight.gain.len(), rows.motors(), gains);
    let (straight, _) = flattest(gain)?;
    let flat = |counts: MotorVec| {
        let (slope, direction) = flattest(slope(&counts))?;
        let suspicious = slope < MIN_SHARE * straight;
        let shown = || rows.show_at_most(2.0 * MIN_SHARE * straight, &counts, &direction);
        let place = || counts.iter().take(rows.motors()).copied().collect();
        (suspicious && !shown()).then(|| FlatSpot { counts: place(), slope, straight })
    };
    let spots = positions(hull, rows.motors()).into_iter().filter_map(flat);
    spots.min_by(|a, b| a.slope.total_cmp(&b.slope))
}

/// The smallest singular value of a slope, and its direction among those that move anything.
fn flattest(slope: DMatrix<f64>) -> Option<(f64, DVector<f64>)> {
    let svd = slope.svd(false, true);
    let directions = svd.v_t?;
    let values = svd.singular_values.iter().enumerate();
    let (index, least) = values.min_by(|a, b| a.1.total_cmp(b.1))?;
    Some((*least, directions.row(index).transpose()))
}

fn positions(hull: &Hull, motors: usize) -> Vec<MotorVec> {
    let (mut low, mut high) = (hull.centre(), hull.centre());
    for corner in hull.corners() {
        for motor in 0..motors {
            low[motor] = low[motor].min(corner[motor]);
            high[motor] = high[motor].max(corner[motor]);
        }
    }
    let at = |motor: usize, step: usize| {
        low[motor] + (high[motor] - low[motor]) * step as f64 / (STEPS - 1) as f64
    };
    let rows = if motors == 1 { 1 } else { STEPS };
    let lattice =
        (0..STEPS).flat_map(|i| (0..rows).map(move |j| (i, j))).map(|(i, j)| [at(0, i), at(1, j)]);
    lattice.filter(|counts| hull.contains(counts)).collect()
}

/// The recorded rows, and the width of the region around a place, counts.
struct Rows<'a> {
    inputs: &'a DataTable,
    outputs: &'a DataTable,
    widths: Vec<f64>,
}

impl<'a> Rows<'a> {
    fn new(inputs: &'a DataTable, outputs: &'a DataTable) -> Self {
        let range = |motor| {
            let (low, high) = min_max(inputs.column(motor));
            (WIDTH * (high - low)).max(1.0)
        };
        Self { inputs, outputs, widths: (0..inputs.width()).map(range).collect() }
    }

    fn motors(&self) -> usize {
        self.inputs.width()
    }

    /// Whether rows at a place, or up to two widths off in a direction, agree with a motion by at
    /// most `slope` per count in it. At the edge of a slack zone half of the rows are beyond it.
    fn show_at_most(&self, slope: f64, counts: &MotorVec, direction: &DVector<f64>) -> bool {
        (-2..=2).any(|steps| {
            let mut near = *counts;
            for (motor, width) in self.widths.iter().enumerate() {
                near[motor] += f64::from(steps) * width * direction[motor];
            }
            let least = self.least_slope(&near, direction);
            least.is_some_and(|least| least <= slope)
        })
    }

    /// The smallest slope in a direction that the nearby rows allow. `None` if too few.
    fn least_slope(&self, counts: &MotorVec, direction: &DVector<f64>) -> Option<f64> {
        let numbers = self.motors() + 1;
        let zeros = || DMatrix::zeros(numbers, numbers);
        let (mut squares, mut weighted) = (zeros(), zeros());
        let mut cross = DMatrix::zeros(numbers, self.outputs.width());
        let (mut sum, mut sum_of_squares) = (0.0, 0.0);
        let mut near = Vec::new();
        for (input, output) in self.inputs.rows().zip(self.outputs.rows()) {
            let x = DVector::from_fn(numbers, |i, _| match input.get(i) {
                Some(input) => (input - counts[i]) / self.widths[i],
                None => 1.0,
            });
            let w = (-0.5 * (x.norm_squared() - 1.0)).exp();
            if w > 1e-4 {
                let y = DVector::from_column_slice(output);
                (sum, sum_of_squares) = (sum + w, sum_of_squares + w * w);
                squares += &x * x.transpose() * w;
                weighted += &x * x.transpose() * (w * w);
                cross += &x * y.transpose() * w;
                near.push((w, x, y));
            }
        }
        if near.is_empty() || sum * sum / sum_of_squares < ROWS_PER_NUMBER * numbers as f64 {
            return None;
        }
        let inverse = squares.cholesky()?.inverse();
        let coefficients = &inverse * cross;
        let error = |(w, x, y): &(f64, DVector<f64>, DVector<f64>)| {
            w * (y - coefficients.tr_mul(x)).norm_squared()
        };
        let variance_of_rows = near.iter().map(error).sum::<f64>() / sum;
        let along = DVector::from_fn(numbers, |i, _| {
            self.widths.get(i).map_or(0.0, |width| direction[i] / width)
        });
        let shape = along.dot(&(&inverse * weighted * &inverse * &along));
        let variance = (shape * variance_of_rows).max(0.0);
        Some(coefficients.tr_mul(&along).norm() - STANDARD_ERRORS * variance.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regression::linear::fit_linear;
    use crate::testing::{assert_contains, assert_near, noise};

    /// Slack between -100 and 100 counts.
    fn slack(counts: f64) -> f64 {
        0.05 * (counts.abs() - 100.0).max(0.0) * counts.signum()
    }

    fn slack_slope(counts: f64) -> f64 {
        if counts.abs() > 100.0 { 0.05 } else { 0.0 }
    }

    fn steep(counts: f64) -> f64 {
        0.05 * counts
    }

    /// The flattest spot for a robot whose outputs were measured outside a range.
    fn spot(
        slope: fn(f64) -> f64,
        outputs: fn(f64) -> f64,
        unmeasured: std::ops::Range<i32>,
    ) -> Option<FlatSpot> {
        let mut random = noise(1);
        let counts = (-500..=500).filter(|counts| !unmeasured.contains(counts));
        let counts: Vec<f64> = counts.map(f64::from).collect();
        let inputs = DataTable::from_rows(1, counts.iter().map(|counts| [*counts]));
        let outputs = counts.iter().map(|counts| [outputs(*counts) + 0.1 * random()]);
        let outputs = DataTable::from_rows(1, outputs);
        let hull = Hull::from_points(1, &[[-500.0, 0.0], [500.0, 0.0]]).unwrap();
        let slope = |counts: &MotorVec| DMatrix::from_element(1, 1, slope(counts[0]));
        let straight = fit_linear(&inputs, &outputs).unwrap();
        find(&slope, &hull, &Rows::new(&inputs, &outputs), &straight)
    }

    #[test]
    fn recorded_slack_zone_and_steep_model_are_accepted() {
        assert_eq!(spot(slack_slope, slack, 0..0), None);
        assert_eq!(spot(|_| 0.03, steep, -99..99), None);
    }

    #[test]
    fn a_flat_position_without_supporting_rows_is_too_flat() {
        let spot_against = spot(slack_slope, steep, 0..0).unwrap();
        assert!(spot_against.slope == 0.0 && spot_against.counts[0].abs() <= 100.0);
        assert_contains(&spot_against, &["nearly flat at counts"]);
        let spot_without = spot(slack_slope, slack, -99..99).unwrap();
        assert!(spot_without.counts[0].abs() < 90.0, "{spot_without}");
    }

    #[test]
    fn of_two_motors_the_flattest_direction_counts() {
        let slope = DMatrix::from_row_slice(2, 2, &[0.02, 0.02, 0.001, -0.001]);
        let (least, direction) = flattest(slope).unwrap();
        assert_near(least, 0.001 * 2.0_f64.sqrt(), 1e-12);
        assert_near(direction[0] + direction[1], 0.0, 1e-9);
    }
}
