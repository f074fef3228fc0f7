//! Comparison of a robot's serial lines, in simulated time: `i2ris bench lines`.
//!
//! The port threads and the cycle of the controller run against emulated drives. The time of the
//! computer is not included (see `i2ris bench e2e`). All lines have the same snakes, models, goals.

use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use i2ris::config::Config;
use i2ris::model::Model;
use i2ris::robot::StateCommand;
use i2ris::units::AUXILIARY;
use i2ris_calibration::fit::{Choice, Family};
use i2ris_calibration::parallel;
use i2ris_report::Failure;
use i2ris_report::statistics::{mean, quantile_of_unsorted, root_mean_square};
use i2ris_simulation::closed_loop::{ClosedLoop, Inputs};
use i2ris_simulation::drive::State;
use i2ris_simulation::lines::Lines;
use i2ris_simulation::log::EventKind;
use i2ris_simulation::motion::unseen_motion::{Motion, RATE_HZ, within_reach};
use i2ris_simulation::physics::DrawnSnake;
use i2ris_simulation::{EmulatorConfig, Line};

use crate::models::laboratory::{config, fitted};
use crate::models::subject::record;
use crate::models::tracking::{Pilot, along, approach, follow};

/// Ramps and sines: s, deg, deg/s (within the limits of the motors) and Hz.
const DURATION_S: f64 = 12.0;
const AMPLITUDE_DEG: f64 = 6.0;
const SPEED_DEG_S: f64 = 6.0;
/// Whole periods in the duration: every motion ends at the start of the next.
const SINES_HZ: [f64; 2] = [1.0 / 6.0, 1.0 / 12.0];
/// Ticks: smoothing of the motor speed, window of a delay, maximum delay; rest after a command.
const SMOOTH: usize = 50;
const WINDOW: usize = 1000;
const MAX_DELAY: usize = 80;
const REST: usize = 200;

/// Arguments of `i2ris bench lines`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Lines to compare; tracking errors are relative to those on the first
    #[arg(long, value_name = "LINE,..", value_delimiter = ',')]
    #[arg(default_value = "rs232,usb-each,lab")]
    line: Vec<Line>,
    /// Number of drives on the laboratory's line; the third turns no joint and stays at rest
    #[arg(long, value_name = "N,..", value_delimiter = ',', default_value = "2,3",
          value_parser = clap::value_parser!(u8).range(2..=3))]
    axes: Vec<u8>,
    /// Latency timers of USB adapters, milliseconds
    #[arg(long, value_name = "MS,..", value_delimiter = ',', default_value = "1,16")]
    timer_ms: Vec<u64>,
    /// Snakes, by physics and seed
    #[arg(long, value_name = "NAME:SEED,..", value_delimiter = ',')]
    #[arg(default_value = "springs:3,wire:3,dahl:3")]
    snake: Vec<DrawnSnake>,
    /// Duration of the hand's motion on every line, s
    #[arg(long, value_name = "S", default_value_t = 20.0)]
    duration_s: f64,
}

#[derive(Debug, Clone, Copy)]
struct Plan {
    line: Line,
    axes: usize,
    timer_ms: u64,
}

struct Outcome {
    /// Setpoint rate of each motor while both move evenly, and its share of that of a bare loop.
    setpoints_per_s: f64,
    share: f64,
    /// Delay from goal to tip, ms: median and 99th percentile.
    delay_ms: [f64; 2],
    /// RMS deviation of the motor speed from its mean over 50 ms, relative to the speed.
    ripple: f64,
    /// Time from the tick of a stop to the last drive, ms, and in exchanges of the line.
    stop_ms: f64,
    stop_exchanges: f64,
    /// RMS error of the tip under a hand's motion, deg.
    error_deg: f64,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let Arguments { line, axes, timer_ms, snake, duration_s } = arguments;
    let subject = |index: usize| Subject::calibrated(snake[index], *duration_s, folder.path());
    let subjects = parallel::map(snake.len(), subject);
    let subjects = subjects.into_iter().collect::<Result<Vec<_>, Failure>>()?;
    let mut plans = Vec::new();
    for &line in line {
        for &axes in if line == Line::Lab { &axes[..] } else { &[2] } {
            let timers = if line == Line::Rs232 { &[0] } else { &timer_ms[..] };
            let axes = usize::from(axes);
            plans.extend(timers.iter().map(|&timer_ms| Plan { line, axes, timer_ms }));
        }
    }
    println!("line, drives, timer   setpoints/s  share   delay ms p50  p99  ripple   stop ms");
    let mut first = Vec::new();
    for plan in plans {
        let found = parallel::map(subjects.len(), |index| plan.measure(&subjects[index]));
        match found.into_iter().collect::<Result<Vec<_>, Failure>>() {
            Ok(found) => {
                let errors = || found.iter().map(|it| it.error_deg);
                if first.is_empty() {
                    first.extend(errors());
                }
                print_row(plan, &found);
                for ((error, first), snake) in errors().zip(&first).zip(snake) {
                    println!("    {snake:<16} error {error:.4} deg, {:.3} x", error / first);
                }
            }
            Err(reason) => println!("{:<22}{reason}", plan.name()),
        }
    }
    Ok(())
}

/// Prints the mean over all snakes; of delays, the maximum.
fn print_row(plan: Plan, found: &[Outcome]) {
    let over = |of: fn(&Outcome) -> f64| mean(found.iter().map(of)).unwrap_or(f64::NAN);
    let most = |of: fn(&Outcome) -> f64| found.iter().map(of).fold(0.0, f64::max);
    println!(
        "{:<22}{:>11.0} {:>5.0}% {:>14.1} {:>4.1} {:>6.1}% {:>9.1} ({:.1} exchanges)",
        plan.name(),
        over(|it| it.setpoints_per_s),
        100.0 * over(|it| it.share),
        over(|it| it.delay_ms[0]),
        most(|it| it.delay_ms[1]),
        100.0 * over(|it| it.ripple),
        most(|it| it.stop_ms),
        most(|it| it.stop_exchanges)
    );
}

struct Subject {
    snake: DrawnSnake,
    model: Arc<Model>,
    hand: Vec<(Motion, Vec<[f64; 2]>)>,
}

impl Subject {
    fn calibrated(snake: DrawnSnake, duration_s: f64, folder: &Path) -> Result<Self, Failure> {
        let recording = record(snake, false, 0, snake.seed, folder)?;
        let fit = |family| fitted(&recording, Choice::One(family), "i2ris-emulated");
        let hand = Motion::Teleoperation;
        let path = (hand, hand.path(duration_s, snake.seed));
        let hand = within_reach(&[path], &fit(Family::Linear)?.model);
        let model = fit(Family::ForceBalance).map_err(|error| format!("{snake}: {error}"))?.model;
        Ok(Self { snake, model, hand })
    }
}

impl Plan {
    fn name(self) -> String {
        let Self { line, axes, timer_ms } = self;
        match line {
            Line::Lab => format!("lab, {axes}, {timer_ms} ms"),
            Line::UsbEach => format!("usb-each, {axes}, {timer_ms} ms"),
            Line::Rs232 => format!("rs232, {axes}"),
        }
    }

    /// The emulated drives of a snake, and the configuration of a controller for them.
    fn robot(self, subject: &Subject) -> Result<(EmulatorConfig, Config), Failure> {
        let mut emulated = EmulatorConfig::new(subject.snake, Path::new("unused"));
        let mut config = config()?;
        let mut axes: Vec<_> = config.axes().cloned().collect();
        axes.truncate(self.axes);
        config.limits.feedback_stale_ms = 0;
        config.compensation.lead_ms = 10.0;
        emulated.connect(self.line);
        if self.line != Line::Rs232 {
            emulated.line.latency_timer_ms = self.timer_ms;
        }
        config.ports = self.line.ports(axes, |_| "unused".into());
        Ok((emulated, config))
    }

    fn measure(self, subject: &Subject) -> Result<Outcome, Failure> {
        let (emulated, config) = self.robot(subject)?;
        let lines = Lines::start(&emulated, &config.ports)?;
        let mut control = ClosedLoop::new(&config, &subject.model, lines);
        for command in [StateCommand::Home, StateCommand::Enable, StateCommand::Condition] {
            rest(&mut control);
            control.command(command)?;
        }
        let errors = follow(&mut control, &subject.hand)?;
        let end = subject.hand.iter().flat_map(|(_, path)| path.last()).copied().last();
        approach(&mut control, end.unwrap_or_default(), [0.0; 2])?;
        let delay_ms = delays(&mut control)?;
        let (before, begin) = (control.motors.exchanges(), control.now());
        let ripple = ripple(&mut control)?;
        let seconds = control.now().duration_since(begin).as_seconds();
        let events = control.motors.events();
        let setpoints = events.iter().filter(|event| {
            let is_setpoint = matches!(event.kind, EventKind::Setpoint(_));
            event.axis < AUXILIARY && event.stamp > begin && is_setpoint
        });
        let setpoints_per_s = setpoints.count() as f64 / 2.0 / seconds;
        let exchanges = (control.motors.exchanges()[0] - before[0]) as f64 / seconds;
        let moving = if self.line == Line::Lab { 2.0 } else { 1.0 };
        let stop_ms = stop(&mut control)?;
        Ok(Outcome {
            setpoints_per_s,
            share: setpoints_per_s / (exchanges / (2.0 * moving)),
            delay_ms,
            ripple,
            stop_ms,
            stop_exchanges: stop_ms * 1e-3 * exchanges,
            error_deg: mean(errors).unwrap_or(f64::NAN),
        })
    }
}

fn rest(control: &mut ClosedLoop<Lines>) {
    for _ in 0..REST {
        control.tick(Inputs::default());
    }
}

fn path(goal: impl Fn(f64) -> [f64; 2]) -> Vec<[f64; 2]> {
    (0..(DURATION_S * RATE_HZ) as usize).map(|sample| goal(sample as f64 / RATE_HZ)).collect()
}

/// The delay of the tip in sines, ms, with the least error: median and 99th percentile, by second.
fn delays(control: &mut ClosedLoop<Lines>) -> Result<[f64; 2], Failure> {
    let path = path(|time| SINES_HZ.map(|hz| AMPLITUDE_DEG * (TAU * hz * time).sin()));
    let mut seen = Vec::new();
    along(control, &path, |control, goal| seen.push((goal, control.tip())))?;
    let mut delays = Vec::new();
    for axis in 0..2 {
        for begin in (WINDOW..seen.len().saturating_sub(WINDOW)).step_by(100) {
            let left = |delay: usize| {
                let error = |tick: usize| seen[tick].1[axis] - seen[tick - delay].0[axis];
                let middle = mean((begin..begin + WINDOW).map(error)).unwrap_or_default();
                root_mean_square((begin..begin + WINDOW).map(|tick| error(tick) - middle))
                    .unwrap_or_default()
            };
            let least = (0..MAX_DELAY).min_by(|a, b| left(*a).total_cmp(&left(*b)));
            delays.extend(least.map(|delay| delay as f64));
        }
    }
    Ok([0.5, 0.99].map(|share| quantile_of_unsorted(&mut delays, share).unwrap_or(f64::NAN)))
}

/// The motors' speed ripple while the goal moves to and fro at constant speed.
fn ripple(control: &mut ClosedLoop<Lines>) -> Result<f64, Failure> {
    let period_s = 4.0 * AMPLITUDE_DEG / SPEED_DEG_S;
    let triangle = |time: f64| 1.0 - 4.0 * ((time / period_s + 0.75).fract() - 0.5).abs();
    let path = path(|time| [AMPLITUDE_DEG * triangle(time); 2]);
    let mut positions = [Vec::new(), Vec::new()];
    along(control, &path, |control, _| {
        let at = control.motors.motors();
        positions.iter_mut().zip(at).for_each(|(positions, at)| positions.push(at));
    })?;
    let [first, second] = positions.map(|positions| ripple_of(&positions));
    Ok((first + second) / 2.0)
}

/// RMS deviation of the speed from its short-time mean, relative to the speed.
fn ripple_of(positions: &[f64]) -> f64 {
    let speeds: Vec<f64> = positions.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = |near: &[f64]| mean(near.iter().copied()).unwrap_or_default();
    let deviations = speeds.windows(SMOOTH).map(|near| near[SMOOTH / 2] - middle(near)).collect();
    let rms = |values: Vec<f64>| root_mean_square(values).unwrap_or(f64::NAN);
    rms(deviations) / rms(speeds)
}

/// Time from the tick of a fault to the last drive that stops, ms.
fn stop(control: &mut ClosedLoop<Lines>) -> Result<f64, Failure> {
    control.tick(Inputs { missed: u32::MAX, ..Inputs::default() });
    let begin = control.now();
    rest(control);
    let is_stop = |kind| matches!(kind, EventKind::State { to: State::QuickStopActive, .. });
    let events = control.motors.events();
    let stops = events.iter().filter(|event| event.stamp > begin && is_stop(event.kind));
    let last = stops.map(|event| event.stamp).max().ok_or("no drive was stopped")?;
    Ok(last.duration_since(begin).as_seconds() * 1e3)
}
