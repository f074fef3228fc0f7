//! Leaves out points that cannot be seen. Functions take pixels, tenths of a unit of the figure.

use std::collections::HashSet;

use crate::statistics::distance_to_segment;

/// A deviation of the line that cannot be seen.
const TOLERANCE: f64 = 2.0;

/// Width of a column in which a line that only goes forward keeps its first, lowest, highest and
/// last point.
const COLUMN: f64 = 5.0;

/// A line without the points that cannot be seen. It keeps its ends, and all extremes if it only
/// goes forward.
pub fn line(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let is_forward = points.windows(2).all(|pair| pair[0][0] <= pair[1][0]);
    if is_forward { simplified(&column_extremes(points)) } else { simplified(points) }
}

/// First, lowest, highest and last point of every column, in their order (U. Jugel et al., "M4: a
/// visualization-oriented time series data aggregation", VLDB 2014).
fn column_extremes(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let column = |point: &[f64; 2]| (point[0] / COLUMN).floor();
    let mut kept = Vec::new();
    for run in points.chunk_by(|a, b| column(a) == column(b)) {
        let by_height = |a: &usize, b: &usize| run[*a][1].total_cmp(&run[*b][1]);
        let lowest = (0..run.len()).min_by(by_height).unwrap_or(0);
        let highest = (0..run.len()).max_by(by_height).unwrap_or(0);
        let mut indices = [0, lowest, highest, run.len() - 1].to_vec();
        indices.sort_unstable();
        indices.dedup();
        kept.extend(indices.into_iter().map(|index| run[index]));
    }
    kept
}

/// The method of Ramer, Douglas and Peucker without recursion: a section whose points are all near
/// its chord becomes the chord.
fn simplified(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let Some(last) = points.len().checked_sub(1) else {
        return Vec::new();
    };
    let mut keep = vec![false; points.len()];
    (keep[0], keep[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((from, to)) = open.pop() {
        let distance = |i: &usize| distance_to_segment(points[*i], points[from], points[to]);
        let furthest = (from + 1..to).max_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(furthest) = furthest.filter(|index| distance(index) > TOLERANCE) {
            keep[furthest] = true;
            open.extend([(from, furthest), (furthest, to)]);
        }
    }
    let kept = points.iter().zip(keep).filter(|(_, keep)| *keep);
    kept.map(|(point, _)| *point).collect()
}

/// A point cloud without the points that others hide: the first point of every square cell stays.
/// The cells grow until at most `most` points are left, so a dense cloud gets thinner and its
/// outliers stay.
pub fn cloud(points: &[[f64; 2]], most: usize) -> Vec<[f64; 2]> {
    let mut size = 10.0;
    loop {
        let mut taken = HashSet::new();
        let cell = |point: &[f64; 2]| point.map(|x| (x / size).floor() as i64);
        let kept = points.iter().filter(|point| taken.insert(cell(point)));
        let kept: Vec<_> = kept.copied().collect();
        // A figure has only a few cells above this size.
        if kept.len() <= most || size > 1e5 {
            return kept;
        }
        size *= 1.25;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn points_on_a_straight_line_are_left_out() {
        let straight: Vec<_> = (0..1000).map(|i| [0.3, 0.1].map(|k| k * f64::from(i))).collect();
        assert_eq!(line(&straight), [straight[0], straight[999]]);
        assert!(line(&[]).is_empty());
        assert_eq!(line(&[[1.0, 2.0]]), [[1.0, 2.0]]);
    }

    #[test]
    fn a_long_noisy_line_becomes_short_and_keeps_its_spikes() {
        let noise = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 20) * 0.01;
        let mut noisy: Vec<_> = (0..100_000).map(|i| [f64::from(i) * 0.006, noise(i)]).collect();
        noisy.extend([[600.0, 777.0], [600.001, 0.0]]);
        let short = line(&noisy);
        assert!(short.len() < 5000, "{}", short.len());
        assert!(short.iter().any(|point| point[1] == 777.0));
    }

    fn points() -> impl Strategy<Value = Vec<[f64; 2]>> {
        prop::collection::vec([0.0..300.0_f64, 0.0..200.0_f64], 2..150)
    }

    proptest! {
        #[test]
        fn every_point_left_out_is_near_the_line(points in points()) {
            let short = simplified(&points);
            let is_near = |point: &[f64; 2]| short.windows(2).any(|pair| {
                distance_to_segment(*point, pair[0], pair[1]) <= TOLERANCE + 1e-9
            });
            prop_assert!(points.iter().all(is_near));
        }

        #[test]
        fn a_cloud_keeps_at_most_the_given_count(points in points(), most in 5..200_usize) {
            let thin = cloud(&points, most);
            prop_assert!(thin.len() <= most && !thin.is_empty());
            prop_assert!(thin.iter().all(|point| points.contains(point)));
        }
    }
}
