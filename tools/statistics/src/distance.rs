//! Distances between points. If the points have different dimensions, the shorter one counts.

/// The Euclidean distance. It is NaN if a coordinate is NaN.
#[must_use]
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

/// The largest difference of a coordinate (Chebyshev distance).
#[must_use]
pub fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max)
}

/// The distance of a point of the plane to the straight line from one point to another.
#[must_use]
pub fn distance_to_segment(point: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let square = dx * dx + dy * dy;
    let share = if square > 0.0 {
        (((point[0] - from[0]) * dx + (point[1] - from[1]) * dy) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (point[0] - from[0] - share * dx).hypot(point[1] - from[1] - share * dy)
}

/// The point on the straight line between two points: `from` at a share of 0, `to` at 1.
#[must_use]
pub fn interpolate<const N: usize>(from: &[f64; N], to: &[f64; N], share: f64) -> [f64; N] {
    std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_follow_their_formulas() {
        assert_eq!(distance(&[1.0, 2.0, 0.0], &[4.0, 6.0, 0.0]), 5.0);
        assert_eq!(largest_difference(&[1.0, 2.0], &[4.0, -2.0]), 4.0);
        assert!(distance(&[f64::NAN], &[0.0]).is_nan());
        assert_eq!(interpolate(&[0.0, 10.0], &[4.0, 20.0], 0.25), [1.0, 12.5]);
    }

    #[test]
    fn beyond_the_ends_of_a_segment_its_end_is_nearest() {
        let [from, to] = [[0.0, 0.0], [10.0, 0.0]];
        assert_eq!(distance_to_segment([5.0, 3.0], from, to), 3.0);
        assert_eq!(distance_to_segment([13.0, 4.0], from, to), 5.0);
        assert_eq!(distance_to_segment([3.0, 4.0], from, from), 5.0);
    }
}
