//! Convex hull of points in the plane, and its simplification.

use crate::model::maths::quadratic::subtract;
use crate::units::MotorVec;

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
