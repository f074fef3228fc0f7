//! The shape behind the operator where a recording shows one axis at a time.
//!
//! The plane between the axes was never visited, so a free surface would invent it. Instead every
//! output is a curve of its own straight prediction (a ridge function; J. H. Friedman and W.
//! Stuetzle, "Projection pursuit regression", 1981): joints that stiffen and pictures that are
//! distorted act on an angle, whichever motor causes it. The line of each motor shows the curve by
//! itself, so the assumption can be tested: the curve of one line has to predict the other line
//! better than a straight one does, or the output stays straight.

use i2ris::model::{Hull, ModelError};
use i2ris::units::MotorVec;
use nalgebra::{DMatrix, DVector};

use super::weight_search::lines;
use crate::families::operator_trace::TracePoint;
use crate::regression::polynomial::Polynomial;
use i2ris_report::statistics::min_max;

/// A curve has to lower the mean square error on the line that it has not seen by this part.
const LEAST_GAIN: f64 = 0.05;

/// Fewest samples on the line of a motor.
const LEAST_SAMPLES: usize = 60;

/// Points that stand for the plane between the axes.
const POINTS: usize = 2500;

/// Points all over the region of the virtual counts, with the outputs of the curves that `points`
/// on the axes show, and with their scatter. `None` where every output is straight: points on the
/// axes are then enough.
pub(super) fn points_between_axes(
    points: &[TracePoint],
    centre: &[f64],
    outputs: usize,
) -> Result<Option<Vec<TracePoint>>, ModelError> {
    let motors = centre.len();
    let (rows, first) = (points.len(), points.first());
    let (Some(first), true) = (first, motors == 2) else {
        return Ok(None);
    };
    let counts = |counts: &MotorVec, motor: usize| counts[motor] - centre[motor];
    let at =
        DMatrix::from_fn(rows, motors, |row, motor| counts(&points[row].virtual_counts, motor));
    let measured = DMatrix::from_fn(rows, outputs, |row, output| points[row].outputs[output]);
    let shape = OutputShape::new(&at, &measured, &lines(&at));
    let Some(shape) = shape.filter(|shape| !shape.is_straight()) else {
        return Ok(None);
    };
    let scatter = measured - shape.at(&at);
    let visited: Vec<MotorVec> = points.iter().map(|point| point.virtual_counts).collect();
    let hull = Hull::from_points(motors, &visited)?;
    let places: Vec<MotorVec> = spread(&hull).collect();
    let bent =
        shape.at(&DMatrix::from_fn(places.len(), motors, |row, motor| counts(&places[row], motor)));
    let point = |(row, place): (usize, &MotorVec)| {
        let mut point = TracePoint { virtual_counts: *place, ..*first };
        for output in 0..outputs {
            point.outputs[output] = bent[(row, output)] + scatter[(row % rows, output)];
        }
        point
    };
    Ok(Some(places.iter().enumerate().map(point).collect()))
}

/// The corners of a region, and points evenly inside (J. H. Halton 1960).
fn spread(hull: &Hull) -> impl Iterator<Item = MotorVec> + '_ {
    let ranges = [0, 1].map(|motor: usize| min_max(hull.corners().map(|corner| corner[motor])));
    let inside = (1..=POINTS).map(move |index| {
        [0, 1].map(|motor: usize| {
            let (low, high) = ranges[motor];
            low + (high - low) * radical_inverse(index, [2, 3][motor])
        })
    });
    hull.corners().chain(inside.filter(|place| hull.contains(place)))
}

/// The digits of a number in a base, mirrored behind the point.
fn radical_inverse(mut index: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0);
    while index > 0 {
        digit /= base as f64;
        value += digit * (index % base) as f64;
        index /= base;
    }
    value
}

/// Curves of straight predictions.
pub(super) struct OutputShape {
    /// Row: output, column: motor.
    slope: DMatrix<f64>,
    offset: DVector<f64>,
    /// One per output; `None` where it is straight.
    curves: Vec<Option<Curve>>,
}

impl OutputShape {
    /// Fits the curves to virtual counts and outputs, a row per sample. `lines` is the motor on
    /// whose line each sample is. `None` when nothing can be regressed on the virtual counts.
    pub fn new(
        virtual_counts: &DMatrix<f64>,
        outputs: &DMatrix<f64>,
        lines: &[usize],
    ) -> Option<Self> {
        let inputs = virtual_counts.clone().insert_column(0, 1.0);
        let normal = inputs.tr_mul(&inputs).cholesky()?;
        let straight = normal.solve(&inputs.tr_mul(outputs)).transpose();
        let predicted = inputs * straight.transpose();
        let curve = |output: usize| {
            let line = |motor: usize| -> Vec<usize> {
                (0..lines.len()).filter(|row| lines[*row] == motor).collect()
            };
            let pairs = |rows: &[usize]| {
                let predicted = predicted.select_rows(rows).column(output).into_owned();
                (predicted, outputs.select_rows(rows).column(output).into_owned())
            };
            let both = [pairs(&line(0)), pairs(&line(1))];
            is_common(&both).then(|| {
                let (predicted, output) = (predicted.column(output), outputs.column(output));
                Curve::new(&predicted.into_owned(), &output.into_owned(), usize::MAX)
            })?
        };
        Some(Self {
            curves: (0..outputs.ncols()).map(curve).collect(),
            offset: straight.column(0).into_owned(),
            slope: straight.remove_column(0),
        })
    }

    pub fn is_straight(&self) -> bool {
        self.curves.iter().all(Option::is_none)
    }

    /// The outputs at virtual counts, a row per sample.
    pub fn at(&self, virtual_counts: &DMatrix<f64>) -> DMatrix<f64> {
        let mut outputs = virtual_counts * self.slope.transpose();
        for (mut column, (offset, curve)) in
            outputs.column_iter_mut().zip(self.offset.iter().zip(&self.curves))
        {
            column.add_scalar_mut(*offset);
            if let Some(curve) = curve {
                let bent = curve.at(&column.clone_owned());
                column.copy_from(&bent);
            }
        }
        outputs
    }

    /// The mean slope of the outputs: row: output, column: motor.
    pub fn mean_slope(&self) -> DMatrix<f64> {
        let mut slope = self.slope.clone();
        for (mut row, curve) in slope.row_iter_mut().zip(&self.curves) {
            row *= curve.as_ref().map_or(1.0, |curve| curve.mean_slope);
        }
        slope
    }
}

/// Whether the curve of each line predicts the other one better than a straight line does. A pair
/// is the straight predictions and the outputs on a line.
fn is_common(lines: &[(DVector<f64>, DVector<f64>); 2]) -> bool {
    if lines.iter().any(|(inputs, _)| inputs.len() < LEAST_SAMPLES) {
        return false;
    }
    let error = |degree: usize| -> Option<f64> {
        let mut squares = 0.0;
        for (seen, unseen) in [(0, 1), (1, 0)] {
            let curve = Curve::new(&lines[seen].0, &lines[seen].1, degree)?;
            let (inputs, outputs) = &lines[unseen];
            squares += (outputs - curve.at(inputs)).norm_squared();
        }
        Some(squares)
    };
    let errors = error(1).zip(error(usize::MAX));
    errors.is_some_and(|(straight, curved)| curved < straight * (1.0 - LEAST_GAIN))
}

/// An output over its straight prediction.
struct Curve {
    polynomial: Polynomial,
    coefficients: DMatrix<f64>,
    /// Range of the straight predictions; beyond it the curve goes on with slope 1.
    range: (f64, f64),
    scale: f64,
    mean_slope: f64,
}

impl Curve {
    /// A polynomial of at most a degree; `None` when nothing can be regressed.
    fn new(inputs: &DVector<f64>, outputs: &DVector<f64>, degree: usize) -> Option<Self> {
        let scale = inputs.amax().max(f64::MIN_POSITIVE);
        let scaled = DMatrix::from_column_slice(inputs.len(), 1, (inputs / scale).as_slice());
        let polynomial = Polynomial::up_to(&scaled, degree)?;
        let outputs = DMatrix::from_column_slice(outputs.len(), 1, outputs.as_slice());
        let coefficients = polynomial.coefficients(&outputs);
        let mean_slope = polynomial.slope(&scaled, 0, &coefficients).mean() / scale;
        Some(Self {
            polynomial,
            coefficients,
            range: min_max(inputs.iter().copied()),
            scale,
            mean_slope,
        })
    }

    fn at(&self, inputs: &DVector<f64>) -> DVector<f64> {
        let (low, high) = self.range;
        let inside = inputs.map(|input| input.clamp(low, high));
        let scaled = DMatrix::from_column_slice(inside.len(), 1, (&inside / self.scale).as_slice());
        let values = self.polynomial.at(&scaled, &self.coefficients);
        values.column(0) + (inputs - inside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{noise, straight};

    /// Samples along both axes of the motors, and which axis it is.
    fn cross() -> (DMatrix<f64>, Vec<usize>) {
        let at = |row: usize, motor: usize| {
            let along = 400.0 * (0.37 * row as f64).sin();
            if row % 2 == motor { along } else { 0.0 }
        };
        (DMatrix::from_fn(600, 2, at), (0..600).map(|row| row % 2).collect())
    }

    /// Angles whose distance from those at the centre is bent by a function of it and of the row.
    fn outputs(counts: &DMatrix<f64>, bend: impl Fn(f64, usize) -> f64) -> DMatrix<f64> {
        let mut random = noise(3);
        let centre = straight([0.0; 2]);
        DMatrix::from_fn(counts.nrows(), 2, |row, output| {
            let angle = straight([counts[(row, 0)], counts[(row, 1)]])[output];
            centre[output] + bend(angle - centre[output], row) + 0.05 * random()
        })
    }

    #[test]
    fn a_curve_that_both_lines_share_holds_between_them() {
        let (counts, lines) = cross();
        let bend = |angle: f64| angle + 0.02 * angle * angle;
        let shape = OutputShape::new(&counts, &outputs(&counts, |a, _| bend(a)), &lines).unwrap();
        assert!(!shape.is_straight());
        let between = DMatrix::from_row_slice(2, 2, &[150.0, 150.0, -120.0, 160.0]);
        let (found, centre) = (shape.at(&between), straight([0.0; 2]));
        for row in 0..2 {
            let angles = straight([between[(row, 0)], between[(row, 1)]]);
            for output in 0..2 {
                let expected = centre[output] + bend(angles[output] - centre[output]);
                let error = found[(row, output)] - expected;
                assert!(error.abs() < 0.1, "{error} deg");
            }
        }
    }

    #[test]
    fn curves_that_differ_from_line_to_line_are_not_taken() {
        let (counts, lines) = cross();
        let bend = |angle: f64, row: usize| {
            let sign = if row.is_multiple_of(2) { 1.0 } else { -1.0 };
            angle + sign * 0.02 * angle * angle
        };
        let shape = OutputShape::new(&counts, &outputs(&counts, bend), &lines).unwrap();
        assert!(shape.is_straight());
        let none = OutputShape::new(&counts, &outputs(&counts, |a, _| a), &lines).unwrap();
        assert!(none.is_straight());
    }
}
