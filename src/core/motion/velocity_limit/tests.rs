use proptest::prelude::*;

use super::*;
use crate::config::LimitConfig;

const DEFAULT: MotorLimits = MotorLimits {
    velocity: 2000.0,
    acceleration: 40_000.0,
    deceleration: 1_000_000.0,
    lowest: -2000.0,
    highest: 2000.0,
};

const MILLISECOND: Nanos = Nanos::from_millis(1);

/// Rounding of the arithmetic, counts.
const ROUNDING: f64 = 1e-7;

#[derive(Debug, Clone, Copy)]
enum Action {
    Track(MotorTarget),
    Stop,
}

fn limits() -> impl Strategy<Value = MotorLimits> {
    (10.0..1e5_f64, 100.0..1e6_f64, 1.0..50.0_f64, -3000.0..0.0_f64, 1.0..3000.0_f64).prop_map(
        |(velocity, acceleration, ratio, lowest, width)| MotorLimits {
            velocity,
            acceleration,
            deceleration: acceleration * ratio,
            lowest,
            highest: lowest + width,
        },
    )
}

/// Non-round rates from 100 to 4000 Hz.
fn periods() -> impl Strategy<Value = Nanos> {
    (250_000..10_000_000_u64).prop_map(Nanos)
}

fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -4000.0..4000.0_f64,
        1 => prop::sample::select(
            vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 0.0, -0.0]
        ),
    ]
}

fn action() -> impl Strategy<Value = Action> {
    prop_oneof![
        6 => wild().prop_map(|position| Action::Track(MotorTarget::fixed(position))),
        3 => (wild(), prop_oneof![-30.0..30.0_f64, wild()])
            .prop_map(|(position, increment)| Action::Track(MotorTarget { position, increment })),
        1 => Just(Action::Stop),
    ]
}

/// Actions that each last some ticks.
fn script() -> impl Strategy<Value = Vec<(Action, usize)>> {
    prop::collection::vec((action(), 1..40_usize), 1..20)
}

fn act(limiter: &mut VelocityLimiter, action: Action) {
    match action {
        Action::Track(target) => limiter.track(target),
        Action::Stop => limiter.stop(),
    }
}

fn act_for(limiter: &mut VelocityLimiter, action: Action, ticks: usize) {
    for _ in 0..ticks {
        act(limiter, action);
    }
}

/// The most that a velocity may change in one tick, written independently of the limiter: the
/// deceleration comes first and takes its share of the tick.
fn allowed(before: f64, after: f64, a: f64, d: f64) -> bool {
    let (before, after) = if before < 0.0 { (-before, -after) } else { (before, after) };
    let (deceleration, acceleration) = if after >= 0.0 {
        ((before - after).max(0.0), (after - before).max(0.0))
    } else {
        (before, -after)
    };
    deceleration / d + acceleration / a <= 1.0 + 1e-6
}

proptest! {
    #[test]
    fn velocity_acceleration_and_position_limits_hold_whatever_is_requested(
        limits in limits(), period in periods(), start in 0.0..1.0_f64, script in script()
    ) {
        let tick = period.as_seconds();
        let mut limiter = VelocityLimiter::new(&limits, period);
        limiter.restart(limits.lowest + start * (limits.highest - limits.lowest));
        for (action, ticks) in script {
            for _ in 0..ticks {
                let before = limiter;
                act(&mut limiter, action);
                let step = limiter.position() - before.position();
                prop_assert!((step - limiter.velocity()).abs() <= ROUNDING);
                prop_assert!(step.abs() <= limits.velocity * tick + ROUNDING);
                let (a, d) = (limits.acceleration * tick * tick, limits.deceleration * tick * tick);
                let is_allowed = allowed(before.velocity(), limiter.velocity(), a, d);
                prop_assert!(is_allowed, "{before:?} {limiter:?}");
                prop_assert!(limiter.position() >= limits.lowest - ROUNDING);
                prop_assert!(limiter.position() <= limits.highest + ROUNDING);
            }
        }
    }

    #[test]
    fn from_rest_a_fixed_target_is_reached_and_never_passed(
        limits in limits(), period in periods(), start in 0.0..1.0_f64, goal in 0.0..1.0_f64
    ) {
        let width = limits.highest - limits.lowest;
        let (start, goal) = (limits.lowest + start * width, limits.lowest + goal * width);
        let tick = period.as_seconds();
        // Time of a trapezoidal profile, and a few ticks for rounding up to whole ones.
        let distance = (goal - start).abs();
        let bound = 2.0 * (distance / limits.acceleration).sqrt() + distance / limits.velocity;
        let most = (bound / tick) as usize + 10;
        let mut limiter = VelocityLimiter::new(&limits, period);
        limiter.restart(start);
        for _ in 0..most {
            let before = limiter.position();
            limiter.track(MotorTarget::fixed(goal));
            let (low, high) = if start < goal { (before, goal) } else { (goal, before) };
            let range = low - ROUNDING..=high + ROUNDING;
            prop_assert!(range.contains(&limiter.position()));
        }
        prop_assert!((limiter.position() - goal).abs() <= ROUNDING, "{limiter:?} short of {goal}");
    }

    #[test]
    fn fixed_target_is_reached_from_any_motion(
        limits in limits(), period in periods(), script in script(), goal in 0.0..1.0_f64
    ) {
        let goal = limits.lowest + goal * (limits.highest - limits.lowest);
        let mut limiter = VelocityLimiter::new(&limits, period);
        limiter.restart((limits.lowest + limits.highest) / 2.0);
        for (action, ticks) in script {
            act_for(&mut limiter, action, ticks);
        }
        let seconds = 1.0 + 6000.0 / limits.velocity + 4.0 * (6000.0 / limits.acceleration).sqrt();
        for _ in 0..(seconds / period.as_seconds()) as usize {
            limiter.track(MotorTarget::fixed(goal));
        }
        prop_assert!((limiter.position() - goal).abs() <= ROUNDING, "{limiter:?} short of {goal}");
    }

    #[test]
    fn moving_target_within_limits_is_followed_without_lag(
        limits in limits(), period in periods(), share in -0.9..0.9_f64
    ) {
        let limits = MotorLimits { lowest: -1e9, highest: 1e9, ..limits };
        let tick = period.as_seconds();
        let increment = share * limits.velocity * tick;
        let mut limiter = VelocityLimiter::new(&limits, period);
        // Speeding up takes `t = v / A` and loses `v t / 2`; the tenth of V that is left regains
        // it.
        let start_up = limits.velocity / limits.acceleration;
        let ticks = (30.0 * start_up / tick) as usize + 30;
        for k in 1..=ticks {
            limiter.track(MotorTarget { position: increment * k as f64, increment });
        }
        let target = increment * ticks as f64;
        let error = (limiter.position() - target).abs();
        prop_assert!(error <= 1e-6 * target.abs() + ROUNDING, "{limiter:?} {target}");
    }

    #[test]
    fn a_stop_ends_as_soon_as_the_deceleration_allows(
        limits in limits(), period in periods(), script in script()
    ) {
        let mut limiter = VelocityLimiter::new(&limits, period);
        limiter.restart((limits.lowest + limits.highest) / 2.0);
        for (action, ticks) in script {
            act_for(&mut limiter, action, ticks);
        }
        let per_tick = limits.deceleration * period.as_seconds().powi(2);
        let ticks = (limiter.velocity().abs() / per_tick).ceil() as usize;
        let rest = limiter.rest_position();
        act_for(&mut limiter, Action::Stop, ticks.max(1));
        prop_assert!(limiter.is_at_rest(), "{limiter:?} after {ticks} ticks");
        prop_assert!((limiter.position() - rest).abs() <= ROUNDING, "{limiter:?} not at {rest}");
    }
}

#[test]
fn full_speed_stop_takes_two_ticks_by_default() {
    let mut limiter = VelocityLimiter::new(&DEFAULT, MILLISECOND);
    act_for(&mut limiter, Action::Track(MotorTarget::fixed(2000.0)), 200);
    assert!((limiter.velocity() - 2.0).abs() < ROUNDING);
    let from = limiter.position();
    limiter.stop();
    limiter.stop();
    assert!(limiter.is_at_rest());
    assert!((limiter.position() - from - 1.0).abs() < ROUNDING, "it stops within one count");
}

#[test]
fn nan_target_stops() {
    let moving = || {
        let mut limiter = VelocityLimiter::new(&DEFAULT, MILLISECOND);
        act_for(&mut limiter, Action::Track(MotorTarget::fixed(1000.0)), 100);
        assert!(!limiter.is_at_rest());
        limiter
    };
    let mut stopped = moving();
    act_for(&mut stopped, Action::Stop, 10);
    assert!(stopped.is_at_rest());
    for (position, increment) in
        [(f64::NAN, 0.0), (500.0, f64::NAN), (500.0, f64::INFINITY), (500.0, f64::NEG_INFINITY)]
    {
        let mut limiter = moving();
        let target = MotorTarget { position, increment };
        act_for(&mut limiter, Action::Track(target), 10);
        assert_eq!(limiter.position(), stopped.position(), "{target:?}");
        assert!(limiter.is_at_rest());
    }
}

#[test]
fn zero_distance_gives_no_motion() {
    let mut limiter = VelocityLimiter::new(&DEFAULT, MILLISECOND);
    limiter.restart(123.25);
    for _ in 0..100 {
        limiter.track(MotorTarget::fixed(123.25));
        assert_eq!((limiter.position(), limiter.velocity()), (123.25, 0.0));
    }
}

#[test]
fn setpoint_outside_limits_only_returns() {
    let mut limiter = VelocityLimiter::new(&DEFAULT, MILLISECOND);
    limiter.restart(2003.0);
    limiter.track(MotorTarget::fixed(5000.0));
    let mut last = limiter.position();
    assert!(last <= 2003.0);
    limiter.restart(2003.0);
    for _ in 0..100 {
        limiter.track(MotorTarget::fixed(1990.0));
        assert!(limiter.position() <= last);
        last = limiter.position();
    }
    assert!((last - 1990.0).abs() < ROUNDING);
}

/// 10 deg at 0.5 Hz is 450 counts: 1414 counts/s and 4442 counts/s^2, within the default limits.
#[test]
fn sine_within_limits_is_followed_below_one_count() {
    let at = |k: i32| 450.0 * (std::f64::consts::PI * f64::from(k) * 1e-3).sin();
    let mut limiter = VelocityLimiter::new(&DEFAULT, MILLISECOND);
    let mut worst = 0.0_f64;
    for k in 1..4000 {
        limiter.track(MotorTarget { position: at(k), increment: at(k) - at(k - 1) });
        // The first 100 ms: from rest to the speed of a sine that starts at full speed.
        if k > 100 {
            worst = worst.max((limiter.position() - at(k)).abs());
        }
    }
    assert!(worst < 1e-6, "{worst} counts");
}

proptest! {
    /// Goals that jump, and stops, through the limiter of a motor.
    #[test]
    fn the_jerk_of_a_motor_stays_within_its_limit(
        acts in prop::collection::vec(
            (prop::option::of(-300.0..300.0_f64), 1..60_u32), 1..20
        ),
        jerk in 7e7..1e9_f64,
    ) {
        let tick = Nanos::from_millis(1);
        let config = LimitConfig { jerk_counts_s3: Some(jerk), ..LimitConfig::default() };
        let limits = MotorLimits {
            velocity: config.velocity_counts_s,
            acceleration: config.acceleration_counts_s2,
            deceleration: config.stop_deceleration_counts_s2,
            lowest: -200.0,
            highest: 200.0,
        };
        let mut limiter = VelocityLimiter::new(&limits, tick);
        let mut jerk_limiter = JerkLimiter::new(config.window_ticks(tick).unwrap());
        let (mut moved, mut change) = (0.0, 0.0);
        for (goal, ticks) in acts {
            for _ in 0..ticks {
                match goal {
                    Some(goal) => limiter.track(MotorTarget::fixed(goal)),
                    None => limiter.stop(),
                }
                jerk_limiter.update(limiter.position());
                let third = jerk_limiter.increment - moved - change;
                prop_assert!(third.abs() <= jerk * 1e-9 * (1.0 + 1e-9) + 1e-9, "{third}");
                prop_assert!(jerk_limiter.output.abs() <= 200.0 + 1e-9);
                (moved, change) = (jerk_limiter.increment, jerk_limiter.increment - moved);
            }
        }
    }
}

#[test]
fn a_ramp_lags_by_half_the_window_and_ends_exactly() {
    let mut jerk_limiter = JerkLimiter::new(9);
    jerk_limiter.restart(0.1);
    assert!(jerk_limiter.is_at_rest());
    for k in 0..40 {
        jerk_limiter.update(0.1 + f64::from(k.min(20)));
        let late = 0.1 + (f64::from(k) - 4.0);
        assert!(!(8..=20).contains(&k) || (jerk_limiter.output - late).abs() < 1e-12);
        assert_eq!(jerk_limiter.is_at_rest(), k == 0 || k > 28, "{k}");
    }
    assert_eq!(jerk_limiter.output, 20.1);
}

#[test]
fn a_window_of_one_changes_nothing() {
    let mut jerk_limiter = JerkLimiter::new(1);
    for value in [0.3, -7.1, 0.1 + 0.2] {
        jerk_limiter.update(value);
        assert_eq!(jerk_limiter.output, value);
    }
}
