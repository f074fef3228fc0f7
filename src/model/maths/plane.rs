//! The plane of two motors: vectors, quadratic functions of them, and convex polygons.

use crate::units::{MAX_MOTORS, MotorVec};

/// A convex quadratic of a step `d` in motor space, `gradient . d + d . hessian d / 2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::model) struct Quadratic {
    gradient: MotorVec,
    /// Symmetric, positive definite.
    hessian: [MotorVec; MAX_MOTORS],
    /// The step with the least value.
    pub minimum: MotorVec,
}

impl Quadratic {
    /// Half the squared length of the step.
    pub(in crate::model) const DISTANCE: Self = Self {
        gradient: [0.0; MAX_MOTORS],
        hessian: [[1.0, 0.0], [0.0, 1.0]],
        minimum: [0.0; MAX_MOTORS],
    };

    /// The quadratic with `lift` added to the diagonal of the Hessian. An absent motor has an empty
    /// row in the Hessian. `None` if the result is not positive definite.
    pub(in crate::model) fn new(
        gradient: MotorVec,
        hessian: [MotorVec; MAX_MOTORS],
        lift: f64,
    ) -> Option<Self> {
        let [[a, b], [_, c]] = hessian;
        let a = a + lift;
        // Any positive number is valid for an absent motor: its gradient is 0.
        let c = c + lift;
        // Elimination: c - b^2 / a is the second pivot.
        let ratio = b / a;
        let pivot = c - ratio * b;
        if !(a > 0.0 && pivot > 0.0) {
            return None;
        }
        let second = -(gradient[1] - ratio * gradient[0]) / pivot;
        let first = -gradient[0] / a - ratio * second;
        let finite = first.is_finite() && second.is_finite();
        finite.then_some(Self { gradient, hessian: [[a, b], [b, c]], minimum: [first, second] })
    }

    pub(in crate::model) fn value(&self, step: MotorVec) -> f64 {
        dot(self.gradient, step) + 0.5 * dot(step, self.bend(step))
    }

    /// The change of the gradient over a step.
    pub(in crate::model) fn bend(&self, step: MotorVec) -> MotorVec {
        let [first, second] = self.hessian;
        [dot(first, step), dot(second, step)]
    }

    /// The gradient after a step.
    pub(in crate::model) fn slope(&self, step: MotorVec) -> MotorVec {
        add(self.gradient, self.bend(step))
    }
}

pub(in crate::model) fn add(a: MotorVec, b: MotorVec) -> MotorVec {
    [a[0] + b[0], a[1] + b[1]]
}

pub(in crate::model) fn subtract(a: MotorVec, b: MotorVec) -> MotorVec {
    [a[0] - b[0], a[1] - b[1]]
}

pub(in crate::model) fn dot(a: MotorVec, b: MotorVec) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Tolerance of the containment test, in counts: the rounding error of the arithmetic, far below
/// the resolution of a motor.
pub const TOLERANCE_COUNTS: f64 = 1e-6;

/// The points with the lowest and the highest first coordinate, if there are two.
pub(in crate::model) fn interval(points: &[MotorVec]) -> Vec<MotorVec> {
    match sorted(points).as_slice() {
        [low, .., high] => vec![*low, *high],
        _ => Vec::new(),
    }
}

/// The corners of the convex hull, counter-clockwise, without corners that protrude by less than
/// the tolerance. There are fewer than three if the points lie on a line. Coordinates must be
/// finite.
///
/// Andrew's monotone chain (A. M. Andrew, Information Processing Letters 9, 1979).
pub(in crate::model) fn convex_hull(points: &[MotorVec]) -> Vec<MotorVec> {
    let sorted = sorted(points);
    let mut lower = chain(sorted.iter());
    let mut upper = chain(sorted.iter().rev());
    // The end of each chain is the start of the other.
    lower.pop();
    upper.pop();
    lower.append(&mut upper);
    lower
}

/// Removes the side beyond which the sides next to it meet with the least area until `limit` sides
/// are left. The result contains the polygon: what was measured must not be lost for being round.
pub(in crate::model) fn thin(mut corners: Vec<MotorVec>, limit: usize) -> Vec<MotorVec> {
    while corners.len() > limit.max(3) {
        let n = corners.len();
        let beyond = |side: usize| {
            let [before, from, to, after] =
                [n - 1, 0, 1, 2].map(|offset| corners[(side + offset) % n]);
            let tip = tip([before, from], [after, to])?;
            Some((side, tip, area(from, tip, to)))
        };
        let least = (0..n).filter_map(beyond).min_by(|a, b| a.2.total_cmp(&b.2));
        let Some((side, tip, _)) = least else { break };
        corners[side] = tip;
        corners.remove((side + 1) % n);
    }
    corners
}

/// Intersection of two extended sides; `None` if they do not meet.
fn tip([a, b]: [MotorVec; 2], [c, d]: [MotorVec; 2]) -> Option<MotorVec> {
    let cross = |u: MotorVec, v: MotorVec| u[0] * v[1] - u[1] * v[0];
    let (first, second, apart) = (subtract(b, a), subtract(d, c), subtract(d, b));
    let both = cross(first, second);
    let [along_first, along_second] = [cross(apart, second) / both, cross(apart, first) / both];
    let meets = along_first >= 0.0 && along_second >= 0.0 && along_first.is_finite();
    meets.then(|| [0, 1].map(|i| b[i] + along_first * first[i]))
}

fn sorted(points: &[MotorVec]) -> Vec<MotorVec> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    sorted
}

/// Convex chain below points sorted from left to right, or above points sorted from right to left.
fn chain<'a>(points: impl Iterator<Item = &'a MotorVec>) -> Vec<MotorVec> {
    let mut chain: Vec<MotorVec> = Vec::new();
    for point in points {
        while let [.., before, last] = chain.as_slice()
            && !turns_left(*before, *last, *point)
        {
            chain.pop();
        }
        chain.push(*point);
    }
    chain
}

fn turns_left(a: MotorVec, b: MotorVec, c: MotorVec) -> bool {
    let chord = subtract(c, a);
    2.0 * area(a, b, c) > TOLERANCE_COUNTS * chord[0].hypot(chord[1])
}

/// Area of a triangle, positive when `a`, `b`, `c` go counter-clockwise.
fn area(a: MotorVec, b: MotorVec, c: MotorVec) -> f64 {
    let (ab, ac) = (subtract(b, a), subtract(c, a));
    0.5 * (ab[0] * ac[1] - ab[1] * ac[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_vanishes_at_the_minimum() {
        let quadratic = Quadratic::new([3.0, -1.0], [[4.0, 1.0], [1.0, 2.0]], 0.5).unwrap();
        let least = quadratic.minimum;
        assert!(quadratic.slope(least).iter().all(|s| s.abs() < 1e-12));
        assert_eq!(quadratic.value([0.0, 0.0]), 0.0);
        assert!(quadratic.value(least) < quadratic.value(add(least, [0.01, 0.0])));
        assert!(quadratic.value(least) < quadratic.value(add(least, [-0.01, 0.02])));
    }

    #[test]
    fn non_convex_or_non_finite_input_has_no_minimum() {
        assert_eq!(Quadratic::new([1.0, 0.0], [[0.0, 0.0], [0.0, 0.0]], 0.0), None);
        assert_eq!(Quadratic::new([1.0, 0.0], [[1.0, 2.0], [2.0, 1.0]], 0.5), None);
        assert_eq!(Quadratic::new([1.0, f64::NAN], [[1.0, 0.0], [0.0, 1.0]], 0.0), None);
        assert_eq!(Quadratic::new([1.0, 0.0], [[f64::NAN, 0.0], [0.0, 1.0]], 0.0), None);
    }

    #[test]
    fn an_absent_motor_gets_a_zero_step() {
        let quadratic = Quadratic::new([-6.0, 0.0], [[2.0, 0.0], [0.0, 0.0]], 1.0).unwrap();
        assert_eq!(quadratic.minimum, [2.0, 0.0]);
    }
}
