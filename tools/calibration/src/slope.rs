//! Whether a model is flat where the robot is not.
//!
//! Where a regression has little slope in some direction of motor space, its inverse takes large
//! steps for small goals. A mixture with too many components gets such places between its data. But
//! a snake may be slack around its straight pose, and a model that says so is right. Hence the
//! rule: a place is **too flat** when the least slope of the model is below [`LEAST_SHARE`] of that
//! of the affine model, and the rows recorded around it do not agree: there are too few, or a local
//! affine regression has more than twice that slope in the direction in question, beyond its
//! uncertainty. A loop of hysteresis widens that uncertainty, as it should: its branches are slack
//! at different counts.

use std::fmt;

use i2ris::model::{Hull, Model};
use i2ris::units::MotorVec;
use nalgebra::{DMatrix, DVector};

use crate::linear::LinearFit;
use crate::table::Table;

/// The least slope, as a part of that of the affine model, that a model may have where no rows show
/// less. The fit of the laboratory's ring with three components has a tenth between its data, that
/// with two components half; mixtures over the echo probe, with its slack zone, have a fifth or
/// more.
pub const LEAST_SHARE: f64 = 0.2;

/// Positions along each motor's range.
const STEPS: usize = 25;

/// Width of the region around a place whose rows count, as a part of each motor's range: well below
/// that of a slack zone.
const WIDTH: f64 = 0.03;

/// Rows that a local regression takes, per number that it finds.
const ROWS_PER_NUMBER: f64 = 5.0;

/// Standard errors that a local slope may be off.
const STANDARD_ERRORS: f64 = 2.0;

/// A place where a model is flat and the recording does not show it.
#[derive(Debug, Clone, PartialEq)]
pub struct FlatSpot {
    /// Where, counts, one per motor.
    pub counts: Vec<f64>,
    /// What a count in the flattest direction moves the outputs there, in their unit.
    pub slope: f64,
    /// The same of the affine model.
    pub straight: f64,
}

impl fmt::Display for FlatSpot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            counts,
            slope,
            straight,
        } = self;
        write!(
            f,
            "it is nearly flat at counts {counts:.0?}, {slope:.2e} per count in one direction where a straight model has \
             {straight:.2e}, and the rows around do not show that"
        )
    }
}

/// The flattest place of a model that the rows it was fitted to do not show, if there is one. Of a
/// model with memory, without any.
#[must_use]
pub fn flat_spot(
    model: &Model,
    inputs: &Table,
    outputs: &Table,
    straight: &LinearFit,
) -> Option<FlatSpot> {
    let unit = model
        .file()
        .outputs
        .first()
        .map_or(1.0, |output| output.unit.si());
    let memory = model.new_memory();
    let slope = |counts: &MotorVec| {
        let jacobian = model.jacobian(counts, &memory);
        DMatrix::from_fn(model.outputs(), model.motors(), |output, motor| {
            jacobian[output][motor] / unit
        })
    };
    find(slope, model.hull(), &Rows::new(inputs, outputs), straight)
}

fn find(
    slope: impl Fn(&MotorVec) -> DMatrix<f64>,
    hull: &Hull,
    rows: &Rows,
    straight: &LinearFit,
) -> Option<FlatSpot> {
    let gain = DMatrix::from_row_iterator(
        straight.gain.len(),
        rows.motors(),
        straight.gain.iter().flatten().copied(),
    );
    let (straight, _) = flattest(gain)?;
    let flat = |counts: MotorVec| {
        let (slope, direction) = flattest(slope(&counts))?;
        let suspicious = slope < LEAST_SHARE * straight;
        let shown = || rows.show_at_most(2.0 * LEAST_SHARE * straight, &counts, &direction);
        (suspicious && !shown()).then(|| FlatSpot {
            counts: counts.iter().take(rows.motors()).copied().collect(),
            slope,
            straight,
        })
    };
    positions(hull, rows.motors())
        .into_iter()
        .filter_map(flat)
        .min_by(|a, b| a.slope.total_cmp(&b.slope))
}

/// The least singular value of a slope, and its direction in motor space; with fewer outputs than
/// motors, of the directions that move anything.
fn flattest(slope: DMatrix<f64>) -> Option<(f64, DVector<f64>)> {
    let svd = slope.svd(false, true);
    let directions = svd.v_t?;
    let (place, least) = svd
        .singular_values
        .iter()
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(b.1))?;
    Some((*least, directions.row(place).transpose()))
}

/// A lattice over the hull.
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
    let lattice = (0..STEPS)
        .flat_map(|i| (0..rows).map(move |j| (i, j)))
        .map(|(i, j)| [at(0, i), at(1, j)]);
    lattice.filter(|counts| hull.contains(counts)).collect()
}

/// What was recorded, and how wide a region around a place is, counts.
struct Rows<'a> {
    inputs: &'a Table,
    outputs: &'a Table,
    widths: Vec<f64>,
}

impl<'a> Rows<'a> {
    fn new(inputs: &'a Table, outputs: &'a Table) -> Self {
        let range = |motor| {
            let ends = |(low, high): (f64, f64), at: f64| (low.min(at), high.max(at));
            let (low, high) = inputs
                .column(motor)
                .fold((f64::INFINITY, f64::NEG_INFINITY), ends);
            (WIDTH * (high - low)).max(1.0)
        };
        Self {
            inputs,
            outputs,
            widths: (0..inputs.width()).map(range).collect(),
        }
    }

    fn motors(&self) -> usize {
        self.inputs.width()
    }

    /// Whether there are rows at a place, or up to two widths off in a direction, that agree with a
    /// count in that direction moving the outputs by at most so much. At the edge of a slack zone
    /// half of the rows around are beyond it.
    fn show_at_most(&self, slope: f64, counts: &MotorVec, direction: &DVector<f64>) -> bool {
        (-2..=2).any(|steps| {
            let mut near = *counts;
            for (motor, width) in self.widths.iter().enumerate() {
                near[motor] += f64::from(steps) * width * direction[motor];
            }
            self.least_slope(&near, direction)
                .is_some_and(|least| least <= slope)
        })
    }

    /// The least that the rows around a place let a count in a direction move the outputs. `None`
    /// where they are too few.
    fn least_slope(&self, counts: &MotorVec, direction: &DVector<f64>) -> Option<f64> {
        let numbers = self.motors() + 1;
        let mut near = Vec::new();
        for (input, output) in self.inputs.rows().zip(self.outputs.rows()) {
            let apart = input
                .iter()
                .zip(counts)
                .zip(&self.widths)
                .map(|((at, centre), width)| (at - centre) / width);
            let features = DVector::from_iterator(numbers, apart.chain([1.0]));
            let weight = (-0.5 * (features.norm_squared() - 1.0)).exp();
            if weight > 1e-4 {
                near.push((weight, features, DVector::from_column_slice(output)));
            }
        }
        let sums = near.iter().fold((0.0, 0.0), |(sum, squares), (w, ..)| {
            (sum + w, squares + w * w)
        });
        if near.is_empty() || sums.0 * sums.0 / sums.1 < ROWS_PER_NUMBER * numbers as f64 {
            return None;
        }
        let zeros = || DMatrix::zeros(numbers, numbers);
        let squares = near
            .iter()
            .fold(zeros(), |sum, (w, x, _)| sum + x * x.transpose() * *w);
        let weighted = near
            .iter()
            .fold(zeros(), |sum, (w, x, _)| sum + x * x.transpose() * (w * w));
        let cross = DMatrix::zeros(numbers, self.outputs.width());
        let cross = near
            .iter()
            .fold(cross, |sum, (w, x, y)| sum + x * y.transpose() * *w);
        let inverse = squares.cholesky()?.inverse();
        let coefficients = &inverse * cross;
        let left = near
            .iter()
            .map(|(w, x, y)| w * (y - coefficients.tr_mul(x)).norm_squared())
            .sum::<f64>()
            / sums.0;
        let along = DVector::from_fn(numbers, |i, _| {
            self.widths.get(i).map_or(0.0, |width| direction[i] / width)
        });
        let variance = along.dot(&(&inverse * weighted * &inverse * &along)) * left;
        Some(coefficients.tr_mul(&along).norm() - STANDARD_ERRORS * variance.max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::fit_linear;
    use crate::testing::noise;

    /// Slack between -100 and 100 counts.
    fn slack(at: f64) -> (f64, f64) {
        let beyond = (at.abs() - 100.0).max(0.0);
        (
            0.05 * beyond * at.signum(),
            if beyond > 0.0 { 0.05 } else { 0.0 },
        )
    }

    fn swept(value: impl Fn(f64) -> f64, skip: std::ops::Range<i32>) -> (Table, Table) {
        let mut random = noise(1);
        let places: Vec<f64> = (-500..=500)
            .filter(|at| !skip.contains(at))
            .map(f64::from)
            .collect();
        let outputs: Vec<_> = places
            .iter()
            .map(|at| [value(*at) + 0.1 * random()])
            .collect();
        (
            Table::from_rows(1, places.iter().map(|at| [*at])),
            Table::from_rows(1, outputs),
        )
    }

    fn spot(slope: impl Fn(f64) -> f64, (inputs, outputs): &(Table, Table)) -> Option<FlatSpot> {
        let hull = Hull::from_points(1, &[[-500.0, 0.0], [500.0, 0.0]]).unwrap();
        let slope = |counts: &MotorVec| DMatrix::from_element(1, 1, slope(counts[0]));
        find(
            slope,
            &hull,
            &Rows::new(inputs, outputs),
            &fit_linear(inputs, outputs).unwrap(),
        )
    }

    #[test]
    fn a_slack_zone_that_the_rows_show_is_honest() {
        assert_eq!(spot(|at| slack(at).1, &swept(|at| slack(at).0, 0..0)), None);
    }

    #[test]
    fn a_flat_place_that_the_rows_contradict_is_too_flat() {
        let spot = spot(|at| slack(at).1, &swept(|at| 0.05 * at, 0..0)).unwrap();
        assert!(spot.slope == 0.0 && spot.counts[0].abs() <= 100.0, "{spot}");
        assert!(spot.to_string().contains("nearly flat at counts"), "{spot}");
    }

    #[test]
    fn a_flat_place_without_rows_is_too_flat() {
        let spot = spot(|at| slack(at).1, &swept(|at| slack(at).0, -99..99)).unwrap();
        assert!(spot.counts[0].abs() < 90.0, "{spot}");
    }

    #[test]
    fn a_model_that_is_steep_everywhere_needs_no_rows() {
        assert_eq!(spot(|_| 0.03, &swept(|at| 0.05 * at, -99..99)), None);
    }

    #[test]
    fn of_two_motors_the_flattest_direction_counts() {
        let (least, direction) =
            flattest(DMatrix::from_row_slice(2, 2, &[0.02, 0.02, 0.001, -0.001])).unwrap();
        assert!((least - 0.001 * 2.0_f64.sqrt()).abs() < 1e-12);
        assert!((direction[0] + direction[1]).abs() < 1e-9, "{direction}");
    }
}
