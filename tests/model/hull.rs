//! The calibrated region: no position leaves it.

use i2ris::model::{Hull, MAX_CORNERS, TOLERANCE_COUNTS};
use proptest::prelude::*;

use super::*;

fn polygon(corners: &[[f64; 2]]) -> Result<Hull, String> {
    let corners = corners.iter().map(|corner| corner.to_vec()).collect();
    Hull::new(&HullParameters { corners }, 2).map_err(|error| error.to_string())
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[test]
fn hull_of_points_has_the_outer_points_as_corners() {
    let points = [
        [0.0, 0.0],
        [5.0, 1.0],
        [10.0, 0.0],
        [5.0, 0.0],
        [10.0, 8.0],
        [4.0, 4.0],
        [0.0, 8.0],
        [0.0, 0.0],
    ];
    let hull = Hull::from_points(2, &points).unwrap();
    assert_eq!(
        hull.corners().collect::<Vec<_>>(),
        [[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]]
    );
    assert_eq!(Hull::new(&hull.parameters(), 2).unwrap(), hull);
}

#[test]
fn one_motor_has_an_interval() {
    let hull = Hull::from_points(1, &[[3.0, 0.0], [-7.0, 0.0], [1.0, 0.0]]).unwrap();
    assert_eq!(hull.parameters().corners, [[-7.0], [3.0]]);
    assert_eq!(hull.project(&[9.0, 0.0]), [3.0, 0.0]);
    assert_eq!(hull.project(&[f64::NEG_INFINITY, 0.0]), [-7.0, 0.0]);
    assert_eq!(hull.project(&[-2.5, 0.0]), [-2.5, 0.0]);
    assert_eq!(hull.centre(), [-2.0, 0.0]);
    assert_eq!([3.0, 3.1, f64::NAN].map(|at| hull.contains(&[at, 0.0])), [true, false, false]);
}

#[test]
fn a_point_outside_projects_to_a_side_or_a_corner() {
    let hull = polygon(&[[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]).unwrap();
    assert!(distance(hull.project(&[3.0, 3.0]), [2.0, 2.0]) < 1e-12);
    assert!(distance(hull.project(&[1.5, -2.0]), [1.5, 0.0]) < 1e-12);
    assert!(distance(hull.project(&[9.0, -1.0]), [4.0, 0.0]) < 1e-12);
    assert!(distance(hull.project(&[1.0, 1.0]), [1.0, 1.0]) < 1e-12);
    assert_eq!(hull.project(&[f64::NAN, 0.0]), hull.centre());
}

/// A motor may be anywhere in its slack at no cost: the result lies in the slack box of both
/// motors, or as near to it as possible.
#[test]
fn slack_is_used_before_a_tensioned_motor_moves() {
    let hull = polygon(&[[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]).unwrap();
    let near = |counts, slack| hull.project_with_slack(&counts, &slack);
    let is = |found, wanted| assert!(distance(found, wanted) < 1e-6, "{found:?} for {wanted:?}");
    // Along the slack onto the side, at most to its end.
    is(near([3.0, 3.0], [[3.0, 0.5], [3.0, 4.0]]), [3.0, 1.0]);
    is(near([3.0, 3.0], [[3.0, 2.0], [3.0, 4.0]]), [2.5, 1.5]);
    is(near([3.0, 3.0], [[0.0, 3.0], [3.5, 3.0]]), [1.0, 3.0]);
    // Past the hull: the corner nearest to the slack.
    is(near([5.0, -3.0], [[5.0, -4.0], [5.0, 2.0]]), [4.0, 0.0]);
    // Without any, or along a side, the nearest point.
    is(near([3.0, 3.0], [[3.0; 2]; 2]), [2.0, 2.0]);
    is(near([2.0, -1.0], [[0.5, -1.0], [3.0, -1.0]]), [2.0, 0.0]);
    assert_eq!(near([1.0, 1.0], [[0.0; 2], [2.0; 2]]), [1.0, 1.0]);
    assert_eq!(near([f64::NAN, 0.0], [[0.0; 2], [2.0; 2]]), hull.centre());
}

#[test]
fn hull_of_circle_has_max_corners_and_contains_it() {
    let circle: Vec<_> = (0..5000)
        .map(|i| f64::from(i) * 0.013)
        .map(|t| [1000.0 * t.cos(), 1000.0 * t.sin()])
        .collect();
    let hull = Hull::from_points(2, &circle).unwrap();
    assert_eq!(hull.corners().count(), MAX_CORNERS);
    assert!(circle.iter().all(|point| hull.contains(point)));
    assert!(hull.corners().all(|corner| distance(corner, [0.0; 2]) < 1003.0));
}

#[test]
fn invalid_polygons_are_refused() {
    for (corners, named) in [
        (&[[0.0, 0.0], [0.0, 9.0], [9.0, 0.0]][..], "hull.corners[0] = [0.0, 0.0]"),
        (&[[0.0, 0.0], [0.0, 9.0], [9.0, 0.0]], "counter-clockwise"),
        (&[[0.0, 0.0], [9.0, 0.0], [2.0, 2.0], [0.0, 9.0]], "convex"),
        (&[[0.0, 10.0], [-6.0, -8.0], [9.5, 3.0], [-9.5, 3.0], [6.0, -8.0]], "convex"),
        (&[[0.0, 0.0], [100.0, 0.0], [50.0, 0.5]], "one count wide"),
        (&[[0.0, 0.0], [9.0, 0.0], [9.0, 0.0], [0.0, 9.0]], "must differ from the next"),
        (&[[0.0, 0.0], [9.0, 0.0]], "3 to 64 corners"),
        (&[[0.0, 0.0], [9.0, f64::NAN], [0.0, 9.0]], "hull.corners[1]"),
        (&[[0.0, 0.0], [9e9, 0.0], [0.0, 9.0]], "32 bits"),
    ] {
        let refused = polygon(corners).unwrap_err();
        assert!(refused.contains(named), "{named}: {refused}");
    }
    let backwards = HullParameters { corners: vec![vec![5.0], vec![-5.0]] };
    assert!(Hull::new(&backwards, 1).unwrap_err().to_string().contains("above the first"));
}

#[test]
fn positions_without_area_are_refused() {
    let line: Vec<_> = (0..20).map(|i| [f64::from(i), 2.0 * f64::from(i)]).collect();
    let refused = |points: &[[f64; 2]]| Hull::from_points(2, points).unwrap_err().to_string();
    assert!(refused(&line).contains("record motion of every motor"));
    assert!(Hull::from_points(2, &[]).is_err());
    assert!(Hull::from_points(3, &[[0.0, 0.0], [9.0, 0.0], [0.0, 9.0], [9.0, 9.0]]).is_err());
    assert!(Hull::from_points(1, &[[4.0, 0.0]; 9]).is_err());
    assert!(refused(&[[0.0, 0.0], [1.0, f64::NAN]]).contains("position 1"));
}

/// Whole counts, as in a recording, or real numbers.
fn points() -> impl Strategy<Value = Vec<[f64; 2]>> {
    let whole = (-40..40_i32, -40..40_i32).prop_map(|(a, b)| [f64::from(a), f64::from(b)]);
    let real = (-2000.0..2000.0_f64, -2000.0..2000.0_f64).prop_map(|(a, b)| [a, b]);
    prop_oneof![vec(whole, 3..200), vec(real, 3..200)]
}

proptest! {
    #![proptest_config(i2ris_testing::cases(64))]

    #[test]
    fn hull_contains_its_points_and_reads_back(points in points()) {
        if let Ok(hull) = Hull::from_points(2, &points) {
            prop_assert!(points.iter().all(|point| distance(hull.project(point), *point) < 1e-3));
            prop_assert_eq!(Hull::new(&hull.parameters(), 2).unwrap(), hull);
        }
    }

    #[test]
    fn projection_is_the_nearest_point_inside(
        points in points(),
        a in -1e5..1e5_f64,
        b in -1e5..1e5_f64,
    ) {
        if let Ok(hull) = Hull::from_points(2, &points) {
            let nearest = hull.project(&[a, b]);
            prop_assert!(hull.contains(&nearest));
            prop_assert!(distance(hull.project(&nearest), nearest) <= TOLERANCE_COUNTS);
            let reach = distance(nearest, [a, b]);
            prop_assert!(points.iter().all(|point| reach <= distance(*point, [a, b]) + 1e-6));
            // A projection on a convex region is nearest if no corner lies beyond it that way.
            let ahead =
                |p: &[f64; 2]| {
                    (p[0] - nearest[0]) * (a - nearest[0]) + (p[1] - nearest[1]) * (b - nearest[1])
                };
            prop_assert!(hull.corners().all(|corner| ahead(&corner) <= 1e-6 * (1.0 + reach)));
        }
    }
}
