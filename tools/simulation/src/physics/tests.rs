//! Properties that every drawn snake has.

use super::hysteresis::Hysteresis;
use super::*;
use crate::ageing::{AgeingEffect, Change, Course, Parameter};
use std::f64::consts::FRAC_1_SQRT_2;

/// Amplitude of a stroke, counts, as in a calibration.
const FULL: f64 = 1800.0;
const SEEDS: std::ops::RangeInclusive<u64> = 1..=6;

fn all() -> impl Iterator<Item = DrawnSnake> {
    Physics::ALL
        .iter()
        .flat_map(|physics| SEEDS.map(move |seed| DrawnSnake { physics: *physics, seed }))
}

/// Motor positions that bend in pitch, nearly.
fn pitch(counts: f64) -> [f64; 2] {
    [FRAC_1_SQRT_2 * counts, -FRAC_1_SQRT_2 * counts]
}

/// Moves through places at a constant rate, returns the pitch at the end.
fn go(snake: &mut Snake, places: &[f64], counts_s: f64) -> f64 {
    let dt_s = 0.002;
    for ends in places.windows(2) {
        let (from, to) = (ends[0], ends[1]);
        let steps = ((to - from).abs() / (counts_s * dt_s)).ceil().max(1.0) as usize;
        for step in 1..=steps {
            snake.step(dt_s, pitch(from + (to - from) * step as f64 / steps as f64));
        }
    }
    snake.angles_deg()[0]
}

/// The pitch while rising and while falling, in full cycles.
fn loop_at(snake: &mut Snake, counts: f64, counts_s: f64) -> [f64; 2] {
    let up = go(snake, &[0.0, FULL, -FULL, counts], counts_s);
    let down = go(snake, &[counts, FULL, counts], counts_s);
    go(snake, &[counts, 0.0], counts_s);
    [up, down]
}

#[test]
fn a_stroke_has_range_and_gain_of_the_robot() {
    for drawn in all() {
        let mut snake = drawn.build();
        let top = go(&mut snake, &[0.0, FULL], 500.0);
        let bottom = go(&mut snake, &[FULL, -FULL], 500.0);
        assert!((30.0..52.0).contains(&top), "{drawn}: {top}");
        assert!((30.0..52.0).contains(&-bottom), "{drawn}: {bottom}");
        let middle = go(&mut snake, &[-FULL, 500.0], 500.0) - go(&mut snake, &[500.0, 0.0], 500.0);
        assert!(middle > 3.0, "{drawn}: {middle} deg in 500 counts");
    }
}

#[test]
fn the_loop_is_some_degrees_wide_and_lags() {
    for drawn in all() {
        for counts in [-1200.0, -600.0, 0.0, 600.0, 1200.0] {
            let [up, down] = loop_at(&mut drawn.build(), counts, 500.0);
            let least = if counts == 0.0 { 1.0 } else { 0.6 };
            assert!((least..8.0).contains(&(down - up)), "{drawn} at {counts}: {up} {down}");
        }
    }
}

#[test]
fn the_angle_never_moves_against_the_motors() {
    for drawn in all() {
        let mut snake = drawn.build();
        let mut before = go(&mut snake, &[0.0, -FULL], 500.0);
        for step in 1..=180 {
            let to = -FULL + 20.0 * f64::from(step);
            let now = go(&mut snake, &[to - 20.0, to], 500.0);
            assert!(now > before - 0.02, "{drawn} at {to}: {before} {now}");
            before = now;
        }
    }
}

#[test]
fn a_minor_loop_stays_inside_the_major_one() {
    for drawn in all() {
        let mut snake = drawn.build();
        let [up, down] = loop_at(&mut snake, 600.0, 500.0);
        let inside = go(&mut snake, &[0.0, FULL, -FULL, 800.0, 400.0, 600.0], 500.0);
        let band = up - 0.15..down + 0.15;
        assert!(band.contains(&inside), "{drawn}: {inside} in {up} {down}");
        let again = go(&mut snake, &[600.0, FULL], 500.0);
        let outer = go(&mut drawn.build(), &[0.0, FULL], 500.0);
        assert!((again - outer).abs() < 0.3, "{drawn}: {again} {outer}");
    }
}

#[test]
fn nothing_moves_at_rest() {
    for drawn in all().filter(|drawn| drawn.physics != Physics::Creep) {
        let mut snake = drawn.build();
        go(&mut snake, &[0.0, 900.0, 700.0], 500.0);
        snake.step(2.0, pitch(700.0));
        let before = snake.angles_deg();
        for _ in 0..600 {
            snake.step(0.1, pitch(700.0));
        }
        let after = snake.angles_deg();
        let moved = (after[0] - before[0]).hypot(after[1] - before[1]);
        assert!(moved < 1e-3, "{drawn}: {moved}");
    }
}

#[test]
fn speed_does_not_matter_where_the_physics_has_no_time() {
    let has_time =
        |it: &DrawnSnake| matches!(it.physics, Physics::Springs | Physics::LuGre | Physics::Creep);
    for drawn in all().filter(|drawn| !has_time(drawn)) {
        let slow = loop_at(&mut drawn.build(), 300.0, 100.0);
        let fast = loop_at(&mut drawn.build(), 300.0, 2000.0);
        let apart = (slow[0] - fast[0]).abs().max((slow[1] - fast[1]).abs());
        assert!(apart < 0.05, "{drawn}: {slow:?} {fast:?}");
    }
}

#[test]
fn the_seed_determines_the_snake() {
    for drawn in all() {
        let end = |drawn: DrawnSnake| {
            let mut snake = drawn.build();
            go(&mut snake, &[0.0, 800.0, 300.0], 500.0);
            snake.angles_deg()
        };
        assert_eq!(end(drawn), end(drawn), "{drawn}");
        let seed = drawn.seed + 1;
        assert_ne!(end(drawn), end(DrawnSnake { seed, ..drawn }), "{drawn}");
    }
}

#[test]
fn a_copy_is_independent() {
    for drawn in all() {
        let mut snake = drawn.build();
        go(&mut snake, &[0.0, 500.0], 500.0);
        let (here, mut copy) = (snake.angles_deg(), snake.clone());
        go(&mut copy, &[500.0, 900.0], 500.0);
        assert_eq!(snake.angles_deg(), here, "{drawn}");
        let there = go(&mut snake, &[500.0, 900.0], 500.0);
        assert_eq!(there, copy.angles_deg()[0], "{drawn}");
    }
}

#[test]
fn invalid_input_does_no_harm() {
    for drawn in all() {
        let mut snake = drawn.build();
        snake.step(0.01, [1e300, -1e300]);
        snake.step(f64::NAN, [f64::NAN, f64::INFINITY]);
        snake.step(-1.0, [0.0, 0.0]);
        let angles = snake.angles_deg();
        assert!(angles.iter().all(|angle| angle.abs() < 1e4), "{drawn}");
    }
}

#[test]
fn names_are_parsed_and_printed() {
    for drawn in all() {
        assert_eq!(drawn.to_string().parse(), Ok(drawn));
    }
    let seed_one: DrawnSnake = "preisach".parse().unwrap();
    assert_eq!(seed_one.to_string(), "preisach:1");
    let refused = |text: &str| text.parse::<DrawnSnake>().unwrap_err().to_string();
    assert!(refused("adder:1").contains("`adder` is not a physics of a snake: use springs, "));
    assert!(refused("preisach:x").contains("`x` is not a seed"));
}

/// The snake, aged at once, after the first step of the grid.
fn aged(drawn: DrawnSnake, changes: &[(Parameter, f64)]) -> Snake {
    let mut snake = drawn.build();
    for (parameter, by) in changes {
        snake.begin_ageing(Change {
            parameter: *parameter,
            by: *by,
            start_s: 0.0,
            motor: None,
            direction: None,
            course: Course::Step {},
        });
    }
    snake.step(0.2, [0.0; 2]);
    snake
}

#[test]
fn larger_gaps_and_more_friction_widen_the_loop() {
    for drawn in all() {
        let width = |changes: &[(Parameter, f64)]| {
            let [up, down] = loop_at(&mut aged(drawn, changes), 0.0, 500.0);
            down - up
        };
        let (new, loose) = (width(&[]), width(&[(Parameter::Gap, 0.4)]));
        assert!(loose > 1.04 * new, "{drawn}: {new} {loose}");
        let rough = width(&[(Parameter::Friction, 0.25)]);
        let has_friction = !matches!(drawn.physics, Physics::PrandtlIshlinskii | Physics::Preisach);
        assert_eq!(rough > 1.04 * new, has_friction, "{drawn}: {new} {rough}");
    }
}

#[test]
fn gain_and_zero_of_the_angles_change_without_memory() {
    for drawn in all() {
        let end = |changes: &[(Parameter, f64)]| {
            let mut snake = aged(drawn, changes);
            go(&mut snake, &[0.0, 900.0], 500.0);
            snake.angles_deg()
        };
        let (new, shifted) = (end(&[]), end(&[(Parameter::Zero, 1.0)]));
        let moved = [0, 1].map(|axis: usize| shifted[axis] - new[axis]);
        assert!((moved[0].hypot(moved[1]) - 1.0).abs() < 1e-9, "{drawn}");
        let weaker = end(&[(Parameter::Gain, -0.1)]);
        let ratio = weaker[0] / new[0];
        assert!((0.8..0.95).contains(&ratio), "{drawn}: {ratio}");
    }
}

#[test]
fn the_load_follows_the_bend_and_vanishes_in_a_play() {
    for drawn in all() {
        let mut snake = aged(drawn, &[(Parameter::Gap, 0.4)]);
        go(&mut snake, &[0.0, 1500.0], 500.0);
        let pulled = snake.load();
        assert!(pulled[0] > 1.0 && pulled[1] < -1.0, "{drawn}: {pulled:?}");
        // Back through the middle the load changes its sign.
        go(&mut snake, &[1500.0, -1500.0], 500.0);
        let pushed = snake.load();
        assert!(pushed[0] < -1.0 && pushed[1] > 1.0, "{drawn}: {pushed:?}");
    }
    for drawn in all().filter(|drawn| drawn.physics == Physics::Dahl) {
        let mut snake = aged(drawn, &[(Parameter::Gap, 0.4)]);
        go(&mut snake, &[0.0, 1500.0, 1497.0], 500.0);
        assert_eq!(snake.load(), [0.0; 2], "{drawn}");
    }
}

#[test]
fn creep_transmission_and_vector_friction_have_their_effect() {
    for seed in SEEDS {
        let mut snake = DrawnSnake { physics: Physics::Creep, seed }.build();
        go(&mut snake, &[0.0, 1500.0], 500.0);
        let before = snake.angles_deg()[0];
        (0..600).for_each(|_| snake.step(0.1, pitch(1500.0)));
        let crept = snake.angles_deg()[0] - before;
        assert!((0.2..2.0).contains(&crept), "{seed}: {crept}");

        let error = transmission::TransmissionError::draw(&mut Draw::new(seed, 0));
        let turned = |counts: f64| error.turned([counts; 2])[0] - counts;
        assert!((turned(300.0) - turned(300.0 - 1024.0)).abs() < 1e-9);
        assert!((turned(256.0) - turned(-256.0)).abs() > 0.1, "{seed}");

        let mut draw = Draw::new(seed, 0);
        let mut disc = friction::VectorFriction::draw(&mut draw, [0.025; 2]);
        let mut go = |travel| {
            disc.advance(0.01, travel, &AgeingEffect::NONE);
            disc.bend(&AgeingEffect::NONE)[0]
        };
        let (held, freed) = (go([10.0, 0.0]), go([10.0, 8.0]));
        assert!(freed > held + 0.3, "{seed}: {held} {freed}");
    }
}
