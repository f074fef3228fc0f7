use proptest::prelude::*;

use super::*;
use crate::config::FixtureShape;
use crate::core::inputs::SimpleRegion;

const TICK: Nanos = Nanos::from_millis(1);
const SPACE: GoalSpace<'_> = GoalSpace { unit: OutputUnit::Deg, view: None, bounds: None };

fn fixtures(shapes: &[FixtureShape]) -> VirtualFixtures {
    let region = |shape: &FixtureShape| FixtureRegionConfig {
        name: "region".to_owned(),
        shape: shape.clone(),
    };
    let regions: Vec<_> = shapes.iter().map(region).collect();
    VirtualFixtures::new(&regions, TICK)
}

fn degrees(pitch: f64, yaw: f64) -> OutputVec {
    [pitch.to_radians(), yaw.to_radians(), 0.0]
}

fn run(fixtures: &mut VirtualFixtures, goals: &[OutputVec], start: OutputVec) -> Vec<OutputVec> {
    let mut before = start;
    let steps = goals.iter().map(|goal| {
        let step = GoalStep { now: *goal, before };
        before = *goal;
        fixtures.limit(step, start, &SPACE).now
    });
    steps.collect()
}

fn wall(offset_deg: f64) -> FixtureShape {
    FixtureShape::HalfPlane { normal: [1.0, 0.0], offset_deg }
}

#[test]
fn without_regions_a_goal_passes_unchanged() {
    let step = GoalStep { now: degrees(3.0, 4.0), before: degrees(3.1, 4.2) };
    let mut none = fixtures(&[]);
    assert_eq!(none.limit(step, [9.0; 3], &SPACE), step);
    for far in [wall(30.0), FixtureShape::Ball { centre_mm: [5.0, 0.0, 0.0], radius_mm: 0.1 }] {
        let mut far = fixtures(&[far]);
        let passed = far.limit(step, step.before, &SPACE);
        assert_eq!((passed, far.limited_by), (step, None));
    }
}

#[test]
fn speed_falls_towards_a_wall_not_along_it() {
    let mut fixtures = fixtures(&[wall(10.0)]);
    // 20 deg/s to the wall, 5 deg/s along it, for 3 s.
    let goals: Vec<_> =
        (1..=3000).map(|k| degrees(0.02 * f64::from(k), 0.005 * f64::from(k))).collect();
    let out = run(&mut fixtures, &goals, degrees(0.0, 0.0));
    let border = 9.5_f64.to_radians();
    for pair in out.windows(2) {
        let speed = (pair[1][0] - pair[0][0]) * 1e3;
        let distance = border - pair[0][0];
        assert!(distance > 0.0 && speed <= distance / 0.2 + 1e-9);
        assert!((pair[1][1] - pair[0][1] - 0.005_f64.to_radians()).abs() < 1e-12);
    }
    let end = out[2999][0].to_degrees();
    assert!((9.4..9.5).contains(&end), "{end}");
    assert_eq!(fixtures.limited_by, Some(0));
}

#[test]
fn a_goal_inside_may_leave_but_not_go_deeper() {
    let mut fixtures = fixtures(&[wall(10.0)]);
    let start = degrees(14.0, 0.0);
    let deeper = run(&mut fixtures, &[degrees(15.0, 1.0)], start);
    assert!((deeper[0][0].to_degrees() - 14.0).abs() < 1e-9);
    let out = run(&mut fixtures, &[degrees(13.6, 0.2)], start);
    assert!((out[0][0].to_degrees() - 13.6).abs() < 1e-9);
    assert!(fixtures.allows_line(&start, &degrees(0.0, 0.0), &SPACE));
    assert!(!fixtures.allows_line(&degrees(0.0, 0.0), &start, &SPACE));
    let circle = FixtureShape::Circle { centre_deg: [5.0, 0.0], radius_deg: 2.0 };
    let line = [degrees(0.0, 0.0), degrees(10.0, 0.0)];
    assert!(!self::fixtures(&[circle]).allows_line(&line[0], &line[1], &SPACE));
}

#[test]
fn requests_keep_the_configured_regions() {
    let mut fixtures = fixtures(&[wall(10.0)]);
    let added = SimpleRegion::new(&wall(5.0)).unwrap();
    fixtures.change(&FixtureChange::SwitchOff).unwrap();
    assert!(!fixtures.is_on());
    fixtures.change(&FixtureChange::Add(added)).unwrap();
    assert_eq!(fixtures.active_bits(), 0b11);
    for _ in 2..MAX_REGIONS {
        fixtures.change(&FixtureChange::Add(added)).unwrap();
    }
    assert_eq!(fixtures.change(&FixtureChange::Add(added)), Err(Refusal::Range));
    fixtures.change(&FixtureChange::RemoveAdded).unwrap();
    assert_eq!(fixtures.active_bits(), 0b1);
}

fn shape() -> impl Strategy<Value = FixtureShape> {
    let angle = || -30.0..30.0_f64;
    prop_oneof![
        (angle(), angle(), 1.0..15.0_f64).prop_map(|(pitch, yaw, radius_deg)| {
            FixtureShape::Circle { centre_deg: [pitch, yaw], radius_deg }
        }),
        (0.0..6.3_f64, -5.0..25.0_f64).prop_map(|(direction, offset_deg)| {
            FixtureShape::HalfPlane { normal: [direction.cos(), direction.sin()], offset_deg }
        }),
        (angle(), angle(), 0.0..6.3_f64, 3_u32..=8, 1.0..15.0_f64).prop_map(
            |(pitch, yaw, turn, corners, radius)| {
                let corner = |k: u32| {
                    let at = turn + std::f64::consts::TAU * f64::from(k) / f64::from(corners);
                    [pitch + radius * at.cos(), yaw + radius * at.sin()]
                };
                FixtureShape::Polygon { corners_deg: (0..corners).map(corner).collect() }
            }
        ),
        (-1.0..1.0_f64, -1.0..1.0_f64, 0.1..0.6_f64).prop_map(|(x, y, radius_mm)| {
            FixtureShape::Ball { centre_mm: [x, y, 1.7], radius_mm }
        }),
        (0.0..6.3_f64, 0.1..0.8_f64).prop_map(|(direction, offset_mm)| FixtureShape::HalfSpace {
            normal: [direction.cos(), direction.sin(), 0.0],
            offset_mm,
        }),
    ]
}

proptest! {
    /// Any goals, also jumps, and up to eight regions of any kind: never through, never in.
    #[test]
    fn no_goal_enters_a_region(
        shapes in prop::collection::vec(shape(), 1..=MAX_REGIONS),
        goals in prop::collection::vec((-40.0..40.0_f64, -40.0..40.0_f64), 1..40),
        stretch in 1_usize..20,
        start in (-40.0..40.0_f64, -40.0..40.0_f64),
    ) {
        prop_assert!(shapes.iter().all(|shape| shape.problem().is_none()));
        let mut fixtures = fixtures(&shapes);
        let mut at = degrees(start.0, start.1);
        let mut seen = fixtures.seen(&at, &SPACE);
        // Every goal for some ticks, on a straight line or at once.
        let goals = goals.iter().flat_map(|goal| std::iter::repeat_n(goal, stretch));
        for goal in goals {
            let goal = GoalStep { now: degrees(goal.0, goal.1), before: at };
            let next = fixtures.limit(goal, at, &SPACE).now;
            let now = fixtures.seen(&next, &SPACE);
            for (before, now) in seen.iter().zip(now.iter()) {
                let (before, now) = (before.distance, now.distance);
                prop_assert!(now >= before.min(0.0), "{before} {now}");
            }
            (at, seen) = (next, now);
        }
    }

    /// Goals that are not numbers hold the last goal.
    #[test]
    fn a_goal_that_is_not_a_number_moves_nothing(shape in shape()) {
        let mut fixtures = fixtures(&[shape]);
        let start = degrees(0.0, 0.0);
        let goal = GoalStep { now: [f64::NAN, 0.1, 0.0], before: start };
        prop_assert_eq!(fixtures.limit(goal, start, &SPACE).now, start);
    }
}
