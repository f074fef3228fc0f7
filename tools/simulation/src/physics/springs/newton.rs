//! Newton's method for a force balance, the gradient of a strictly convex potential.
//!
//! The slopes of the laws have kinks, so a full step can overshoot. Along the direction of a step
//! the force of a convex potential is monotonic: the step is shortened by regula falsi until it
//! overshoots little.

use super::config::MAX_SEGMENTS;

/// Maximum number of unknowns: two pulleys, and segments that bend in two directions.
pub(super) const SIZE: usize = 2 + 2 * MAX_SEGMENTS;

pub(super) type Vector = [f64; SIZE];

/// Slopes of the forces: symmetric, positive definite in its first rows and columns.
pub(super) type Matrix = [[f64; SIZE]; SIZE];

/// Forces whose sum must be 0, and their slopes.
pub(super) trait ForceBalance {
    /// Number of unknowns, at most [`SIZE`].
    fn unknowns(&self) -> usize;

    /// The residual forces at `at`, and their slopes.
    fn evaluate(&self, at: &Vector) -> (Vector, Matrix);
}

/// Sufficient for the worst start in the tests, and a bound on the time.
const ITERATIONS: usize = 60;

/// Forces below this share of the largest force at the start count as 0.
const RELATIVE_TOLERANCE: f64 = 1e-12;

/// Forces below this (degrees of wire stretch) count as 0: a millionth of an encoder count.
const TOLERANCE: f64 = 1e-8;

/// Solves the balance from the guess `start`. Returns the best point found; it is finite if `start`
/// is.
pub(super) fn solve(balance: &impl ForceBalance, start: Vector) -> Vector {
    let size = balance.unknowns();
    let mut at = start;
    let (mut force, mut slope) = balance.evaluate(&at);
    let tolerance = TOLERANCE.max(RELATIVE_TOLERANCE * largest(&force, size));
    for _ in 0..ITERATIONS {
        if largest(&force, size) <= tolerance {
            break;
        }
        let Some(step) = newton_step(slope, &force, size) else {
            break;
        };
        let next = line_search(balance, &at, &step, dot(&force, &step, size), size);
        if !next.1.iter().all(|value| value.is_finite()) {
            break;
        }
        (at, force, slope) = next;
    }
    at
}

/// Shortens `step` until the force along it is small: that point, its forces and their slopes.
/// `before` is that force at the start, below 0.
fn line_search(
    balance: &impl ForceBalance,
    from: &Vector,
    step: &Vector,
    before: f64,
    size: usize,
) -> (Vector, Vector, Matrix) {
    let mut share = 1.0;
    loop {
        let mut at = *from;
        for (value, step) in at.iter_mut().zip(step) {
            *value += share * step;
        }
        let (force, slope) = balance.evaluate(&at);
        let after = dot(&force, step, size);
        if after <= -0.5 * before || share < 1e-6 {
            return (at, force, slope);
        }
        share *= (before / (before - after)).clamp(0.1, 0.9);
    }
}

/// `-slope^-1 force` by Cholesky's factorisation, or `None` if the matrix is not positive definite.
fn newton_step(mut slope: Matrix, force: &Vector, size: usize) -> Option<Vector> {
    for column in 0..size {
        for row in column..size {
            let done: f64 = (0..column).map(|k| slope[row][k] * slope[column][k]).sum();
            let rest = slope[row][column] - done;
            if row > column {
                slope[row][column] = rest / slope[column][column];
            } else if rest > 0.0 {
                slope[row][column] = rest.sqrt();
            } else {
                return None;
            }
        }
    }
    let mut step = [0.0; SIZE];
    for row in 0..size {
        let done: f64 = (0..row).map(|k| slope[row][k] * step[k]).sum();
        step[row] = (-force[row] - done) / slope[row][row];
    }
    for row in (0..size).rev() {
        let done: f64 = (row + 1..size).map(|k| slope[k][row] * step[k]).sum();
        step[row] = (step[row] - done) / slope[row][row];
    }
    Some(step)
}

fn dot(a: &Vector, b: &Vector, size: usize) -> f64 {
    a.iter().zip(b).take(size).map(|(a, b)| a * b).sum()
}

fn largest(values: &Vector, size: usize) -> f64 {
    values[..size].iter().fold(0.0, |most, value| most.max(value.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two unknowns tied by a spring, one of them against a stiff stop: a kink that a bare Newton
    /// step jumps over.
    struct Stop;

    impl ForceBalance for Stop {
        fn unknowns(&self) -> usize {
            2
        }

        fn evaluate(&self, at: &Vector) -> (Vector, Matrix) {
            let (mut force, mut slope) = ([0.0; SIZE], [[0.0; SIZE]; SIZE]);
            let stop = if at[0] > 1.0 { 1e4 } else { 0.0 };
            force[0] = at[0] - at[1] + stop * (at[0] - 1.0);
            force[1] = at[1] - at[0] + 0.1 * (at[1] - 5.0);
            slope[0][..2].copy_from_slice(&[1.0 + stop, -1.0]);
            slope[1][..2].copy_from_slice(&[-1.0, 1.1]);
            (force, slope)
        }
    }

    #[test]
    fn the_solution_across_a_kink_is_found() {
        for start in [-1e6, 0.0, 3.0, 1e6] {
            let at = solve(&Stop, [start; SIZE]);
            let (force, _) = Stop.evaluate(&at);
            assert!(largest(&force, 2) < 1e-6, "{start}: {force:?}");
            assert!(at[0] > 1.0 && at[0] < 1.001);
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_step() {
        let mut slope = [[0.0; SIZE]; SIZE];
        slope[0][0] = -1.0;
        assert_eq!(newton_step(slope, &[1.0; SIZE], 1), None);
    }
}
