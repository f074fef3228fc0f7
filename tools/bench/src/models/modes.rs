//! Steps at the motor: modes of operation beside each other, in simulated time: `i2ris bench
//! modes`.
//!
//! One motor follows a sine by setpoints as they come over a line. How many come depends on the
//! mode, because a line carries only so many exchanges:
//!
//! | mode | exchanges for a setpoint | between two setpoints |
//! |---|---|---|
//! | position (EPOS2 -1, EPOS4 8 without interpolation) | 1: the value | a step |
//! | profile position (1) | 3: the value, bit 4 of the controlword up and down | a profile that ends at rest |
//! | interpolated position (EPOS2 7) | 2: begin and segment of a record of 8 bytes (0x20C1) | a cubic |
//!
//! The last needs two records in the drive's buffer, or it faults (maxon, application note
//! "Interpolation Position Mode", 2008), so it is late by as many; and maxon's gateway forwards no
//! segmented write (Communication Guide, 2.1.2.2), so only the drive at the port can have it.

use std::f64::consts::TAU;

use i2ris_report::statistics::{mean, root_mean_square};
use i2ris_simulation::drive::{Demand, Limits, Motor, MotorConfig, ProfileLimits};

/// Steps of the motor, s, and how long it moves.
const STEP_S: f64 = 0.5e-3;
const DURATION_S: f64 = 8.0;

/// The sine, counts and Hz.
const AMPLITUDE: f64 = 300.0;
const FREQUENCY_HZ: f64 = 0.5;

/// Counts per second of one unit of speed in a record: 1 rpm of 1024 counts.
const RPM: f64 = 1024.0 / 60.0;

/// Records that are in the buffer.
const RECORDS: f64 = 2.0;

/// The drive's own limits of a profile, counts and seconds.
const PROFILE: ProfileLimits =
    ProfileLimits { speed: 2000.0, acceleration: 160_000.0, deceleration: 160_000.0 };

/// Steps over which a speed is smoothed, and of the longest delay.
const SMOOTH: usize = 100;
const LONGEST_DELAY: usize = 200;

/// Arguments of `i2ris bench modes`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Exchanges a second that a motor has for setpoints
    #[arg(long, value_name = "N,..", value_delimiter = ',', default_value = "125,250")]
    exchanges: Vec<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    Position,
    ProfilePosition,
    Interpolated,
}

#[derive(Debug)]
struct Outcome {
    setpoints_per_s: f64,
    /// RMS speed beside its own mean over 50 ms, in shares of the speed.
    ripple: f64,
    /// The motor behind the sine, ms, and the RMS error that is left without it, counts.
    delay_ms: f64,
    error_counts: f64,
}

/// Measures and prints all modes.
pub fn run(arguments: &Arguments) {
    println!("mode                   setpoints/s   ripple    delay   error left");
    for exchanges in &arguments.exchanges {
        for mode in [Mode::Position, Mode::ProfilePosition, Mode::Interpolated] {
            let it = measure(mode, *exchanges);
            println!(
                "{:<22} {:>11.0} {:>7.1}% {:>5.1} ms {:>5.1} counts",
                format!("{mode:?}"),
                it.setpoints_per_s,
                100.0 * it.ripple,
                it.delay_ms,
                it.error_counts
            );
        }
    }
}

fn goal(time_s: f64) -> f64 {
    AMPLITUDE * (TAU * FREQUENCY_HZ * time_s).sin()
}

fn speed(time_s: f64) -> f64 {
    AMPLITUDE * TAU * FREQUENCY_HZ * (TAU * FREQUENCY_HZ * time_s).cos()
}

/// The cubic from one record to the next, `share` of the way.
fn cubic(from: [f64; 2], to: [f64; 2], span_s: f64, share: f64) -> f64 {
    let (square, rest) = (share * share, 1.0 - share);
    let [at, until] = [from[0], to[0]];
    let weight = square * (3.0 - 2.0 * share);
    at + weight * (until - at) + span_s * share * rest * (rest * from[1] - share * to[1])
}

fn measure(mode: Mode, exchanges: f64) -> Outcome {
    let setpoints_per_s = exchanges
        / match mode {
            Mode::Position => 1.0,
            Mode::ProfilePosition => 3.0,
            Mode::Interpolated => 2.0,
        };
    let span_s = 1.0 / setpoints_per_s;
    let (config, mut motor) = (MotorConfig::default(), Motor::default());
    let limits = Limits { current_ma: 300.0, speed: 51_200.0 };
    let (mut profile, mut positions) = (Demand::default(), Vec::new());
    for step in 0..(DURATION_S / STEP_S) as usize {
        let time_s = step as f64 * STEP_S;
        // What was sent last, rounded as it is sent; a record waits in the buffer.
        let sent_s = (time_s / span_s).floor() * span_s;
        let record = |back: f64| {
            let at = (sent_s - back * span_s).max(0.0);
            [goal(at).round(), (speed(at) / RPM).round() * RPM]
        };
        let demand = match mode {
            Mode::Position => goal(sent_s).round(),
            Mode::ProfilePosition => {
                profile.approach(goal(sent_s).round(), PROFILE, STEP_S);
                profile.position
            }
            Mode::Interpolated => {
                let share = (time_s - sent_s) / span_s;
                cubic(record(RECORDS), record(RECORDS - 1.0), span_s, share)
            }
        };
        motor.follow(&config, demand, limits, STEP_S);
        positions.push(motor.position);
    }
    let (delay, error_counts) = delay(&positions);
    let delay_ms = delay as f64 * STEP_S * 1e3;
    Outcome { setpoints_per_s, ripple: ripple(&positions, SMOOTH), delay_ms, error_counts }
}

/// RMS of the speed beside its own mean over `smooth` steps, as a share of it.
pub(super) fn ripple(positions: &[f64], smooth: usize) -> f64 {
    let speeds: Vec<f64> = positions.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = |near: &[f64]| mean(near.iter().copied()).unwrap_or_default();
    let beside: Vec<f64> =
        speeds.windows(smooth).map(|near| near[smooth / 2] - middle(near)).collect();
    let rms = |values: Vec<f64>| root_mean_square(values).unwrap_or(f64::NAN);
    rms(beside) / rms(speeds)
}

/// Steps behind the sine, and the RMS error that is left.
fn delay(positions: &[f64]) -> (usize, f64) {
    let left = |delay: usize| {
        let late = positions.iter().enumerate().skip(2 * LONGEST_DELAY);
        let errors: Vec<f64> =
            late.map(|(step, at)| at - goal((step - delay) as f64 * STEP_S)).collect();
        root_mean_square(errors).unwrap_or(f64::NAN)
    };
    let all = (0..LONGEST_DELAY).map(|delay| (delay, left(delay)));
    all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_smooth_and_late_and_a_profile_that_ends_at_rest_is_rough() {
        let [position, profile, cubic] =
            [Mode::Position, Mode::ProfilePosition, Mode::Interpolated]
                .map(|mode| measure(mode, 125.0));
        assert!(cubic.ripple < 0.5 * position.ripple && position.ripple < profile.ripple);
        assert!(cubic.delay_ms > position.delay_ms + 10.0, "{cubic:?} {position:?}");
    }
}
