//! Leaving out what cannot be seen.
//!
//! All of this works on places on paper, not on values: what counts is whether the eye can tell the
//! difference.

use std::collections::HashSet;

/// Distance on paper that the eye does not miss.
const TOLERANCE: f64 = 0.2;

/// Width of a column in which a line that only goes forward keeps its first, lowest, highest and
/// last point.
const COLUMN: f64 = 0.5;

/// A line without the points that do not show. The first and the last stay, and so do all extremes
/// of a line that only goes forward.
#[must_use]
pub fn line(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let forward = points.windows(2).all(|pair| pair[0][0] <= pair[1][0]);
    if forward {
        simplified(&columns(points))
    } else {
        simplified(points)
    }
}

/// First, lowest, highest and last point of every column, in order (U. Jugel and others, "M4: a
/// visualization-oriented time series data aggregation", 2014).
fn columns(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let column = |point: &[f64; 2]| (point[0] / COLUMN).floor();
    let mut kept = Vec::new();
    for run in points.chunk_by(|a, b| column(a) == column(b)) {
        let by_height = |a: &usize, b: &usize| run[*a][1].total_cmp(&run[*b][1]);
        let (lowest, highest) = (
            (0..run.len()).min_by(by_height),
            (0..run.len()).max_by(by_height),
        );
        let mut four = [Some(0), lowest, highest, run.len().checked_sub(1)]
            .map(Option::unwrap_or_default)
            .to_vec();
        four.sort_unstable();
        four.dedup();
        kept.extend(four.into_iter().map(|index| run[index]));
    }
    kept
}

/// The method of Ramer, Douglas and Peucker, without recursion: a stretch whose points all lie near
/// its chord becomes the chord.
fn simplified(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let Some(last) = points.len().checked_sub(1) else {
        return Vec::new();
    };
    let mut keep = vec![false; points.len()];
    (keep[0], keep[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((from, to)) = open.pop() {
        let distance = |index: &usize| from_chord(points[*index], points[from], points[to]);
        let furthest = (from + 1..to).max_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(furthest) = furthest.filter(|index| distance(index) > TOLERANCE) {
            keep[furthest] = true;
            open.extend([(from, furthest), (furthest, to)]);
        }
    }
    points
        .iter()
        .zip(keep)
        .filter_map(|(point, keep)| keep.then_some(*point))
        .collect()
}

/// Distance of a point from the stretch between two others.
fn from_chord([x, y]: [f64; 2], [ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    let (dx, dy) = (bx - ax, by - ay);
    let length = dx * dx + dy * dy;
    let share = if length > 0.0 {
        (((x - ax) * dx + (y - ay) * dy) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (x - ax - share * dx).hypot(y - ay - share * dy)
}

/// A cloud without the dots that others hide: the first one of every small square stays. The
/// squares grow until at most `most` dots are left, so a dense cloud gets thinner and its outliers
/// stay.
#[must_use]
pub fn cloud(points: &[[f64; 2]], most: usize) -> Vec<[f64; 2]> {
    let mut side = 1.0;
    loop {
        let mut taken = HashSet::new();
        let place = |point: &[f64; 2]| {
            (
                (point[0] / side).floor() as i64,
                (point[1] / side).floor() as i64,
            )
        };
        let kept: Vec<_> = points
            .iter()
            .filter(|point| taken.insert(place(point)))
            .copied()
            .collect();
        // Beyond this size of the squares a figure has no more than a handful.
        if kept.len() <= most || side > 1e4 {
            return kept;
        }
        side *= 1.25;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_lies_on_a_straight_line_goes() {
        let straight: Vec<_> = (0..1000)
            .map(|i| [0.3 * f64::from(i), 0.1 * f64::from(i)])
            .collect();
        assert_eq!(line(&straight), [straight[0], straight[999]]);
        assert!(line(&[]).is_empty());
        assert_eq!(line(&[[1.0, 2.0]]), [[1.0, 2.0]]);
    }

    #[test]
    fn a_long_noisy_line_becomes_short_and_keeps_its_spikes() {
        let noisy: Vec<_> = (0..100_000_u32)
            .map(|i| {
                [
                    f64::from(i) * 0.006,
                    f64::from(i.wrapping_mul(2_654_435_761) >> 20) * 0.01,
                ]
            })
            .chain([[600.0, 777.0], [600.001, 0.0]])
            .collect();
        let thin = line(&noisy);
        assert!(thin.len() < 5000, "{}", thin.len());
        assert!(thin.iter().any(|point| point[1] == 777.0));
    }

    fn points() -> impl Strategy<Value = Vec<[f64; 2]>> {
        prop::collection::vec(
            (0.0..300.0_f64, 0.0..200.0_f64).prop_map(|(x, y)| [x, y]),
            2..150,
        )
    }

    proptest! {
        /// Every point left out lies near the line that is left.
        #[test]
        fn a_line_stays_what_it_was(points in points()) {
            let thin = simplified(&points);
            let near = |point: &[f64; 2]| {
                thin.windows(2).any(|pair| from_chord(*point, pair[0], pair[1]) <= TOLERANCE + 1e-9)
            };
            prop_assert!(points.iter().all(near));
        }

        #[test]
        fn a_cloud_keeps_to_its_bound_and_its_shape(points in points(), most in 5..200_usize) {
            let thin = cloud(&points, most);
            prop_assert!(thin.len() <= most && !thin.is_empty());
            prop_assert!(thin.iter().all(|point| points.contains(point)));
        }
    }
}
