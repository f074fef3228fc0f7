//! The serial lines of a robot beside each other, in simulated time: `i2ris bench lines`.
//!
//! The port threads and the cycle of the controller run against emulated drives; what the computer
//! needs is not in it (that is `i2ris bench e2e`). Every snake is calibrated once, by a balance of
//! forces, and follows the same goals on every line.

use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use i2ris::config::{self, AxisConfig, Config, PortConfig};
use i2ris::model::Model;
use i2ris::robot::StateCommand;
use i2ris::units::{AUXILIARY, Counts, Nanos};
use i2ris_calibration::fit::{Choice, Family};
use i2ris_calibration::parallel;
use i2ris_report::Failure;
use i2ris_report::statistics::{mean, quantile_of_unsorted, root_mean_square};
use i2ris_simulation::closed_loop::{ClosedLoop, Inputs};
use i2ris_simulation::drive::{Family as DriveFamily, State};
use i2ris_simulation::lines::Lines;
use i2ris_simulation::log::EventKind;
use i2ris_simulation::motion::unseen_motion::{Motion, RATE_HZ, within_reach};
use i2ris_simulation::physics::{DrawnSnake, Physics};
use i2ris_simulation::{EmulatorConfig, LineConfig};
use serde::Serialize;

use super::laboratory::{config, fitted};
use super::modes;
use super::subject::record;
use super::tracking::{Pilot, along, approach, follow};

/// Seed of the snakes and of the motions of a hand.
const SEED: u64 = 3;

/// Ramps and sines, s, deg, and deg/s or Hz.
const DURATION_S: f64 = 12.0;
const AMPLITUDE_DEG: f64 = 6.0;
const SPEED_DEG_S: f64 = 12.0;
const SINES_HZ: [f64; 2] = [0.5, 0.4];

/// What a request to a node behind another takes over CAN, there and back.
const GATEWAY_US: u64 = 600;

/// Ticks: over which the speed of a motor is smoothed, in which a delay is judged, of the longest
/// delay, and for a stop.
const SMOOTH: usize = 50;
const WINDOW: usize = 1000;
const LONGEST_DELAY: usize = 80;
const STOP: usize = 400;

/// How drives and computer are connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Line {
    /// EPOS2 on one USB port, node 1 with the others behind it
    Lab,
    /// An EPOS2 on USB for each motor
    UsbEach,
    /// An EPOS4 on RS232 for each motor
    Rs232,
}

/// Arguments of `i2ris bench lines`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Lines
    #[arg(
        long,
        value_name = "LINE,..",
        value_delimiter = ',',
        default_value = "rs232,usb-each,lab"
    )]
    line: Vec<Line>,
    /// Drives of the laboratory's line; the third turns no joint, and rests
    #[arg(long, value_name = "N,..", value_delimiter = ',', default_value = "2,3",
          value_parser = clap::value_parser!(u8).range(2..=3))]
    axes: Vec<u8>,
    /// Latency timers of USB adapters, milliseconds
    #[arg(long, value_name = "MS,..", value_delimiter = ',', default_value = "1,16")]
    timer_ms: Vec<u64>,
    /// Physics of the snakes
    #[arg(
        long,
        value_name = "NAME,..",
        value_delimiter = ',',
        default_value = "springs,wire,gear"
    )]
    physics: Vec<Physics>,
    /// How long a hand moves on every line, s
    #[arg(long, value_name = "S", default_value_t = 20.0)]
    duration_s: f64,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// What a line does.
#[derive(Debug, Clone, Serialize)]
struct Outcome {
    line: String,
    /// Of each motor while both move evenly, and the share of what a bare loop of setpoint and
    /// position would reach on the line.
    setpoints_per_s: f64,
    share: f64,
    /// From the goal to the tip, ms: median, and 99 of 100.
    delay_ms: [f64; 2],
    /// RMS speed of the motors beside their own mean over 50 ms, in shares of the speed.
    ripple: f64,
    /// From the tick of a stop to the last drive that stops, ms, and exchanges of that line.
    stop_ms: f64,
    stop_exchanges: f64,
    /// RMS error of the tip under a hand's motion, deg, on every snake.
    tracking_deg: Vec<f64>,
}

/// One line of the table.
#[derive(Debug, Clone, Copy)]
struct Plan {
    line: Line,
    axes: usize,
    timer_ms: u64,
}

impl Arguments {
    fn plans(&self) -> Vec<Plan> {
        let of = |line: &Line| {
            let line = *line;
            let axes = if line == Line::Lab { &self.axes[..] } else { &[2] };
            let timers = if line == Line::Rs232 { &[0] } else { &self.timer_ms[..] };
            let with = move |axes: &u8| {
                let axes = usize::from(*axes);
                timers.iter().map(move |&timer_ms| Plan { line, axes, timer_ms })
            };
            axes.iter().flat_map(with).collect::<Vec<_>>()
        };
        self.line.iter().flat_map(of).collect()
    }
}

/// Measures all lines and prints them as a table or as JSON.
///
/// # Errors
///
/// A snake that cannot be calibrated.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let snakes: Vec<_> =
        arguments.physics.iter().map(|&physics| DrawnSnake { physics, seed: SEED }).collect();
    let subjects = parallel::map(snakes.len(), |index| {
        Subject::calibrated(snakes[index], arguments.duration_s, folder.path())
    });
    let subjects = subjects.into_iter().collect::<Result<Vec<_>, String>>()?;
    let plans = arguments.plans();
    let outcomes = parallel::map(plans.len(), |index| plans[index].measure(&subjects));
    if arguments.json {
        let outcomes: Vec<_> = outcomes.into_iter().flatten().collect();
        println!("{}", serde_json::to_string_pretty(&outcomes)?);
        return Ok(());
    }
    let names = arguments.physics.iter().map(|physics| format!("{physics:>15}"));
    println!(
        "{:<22} setpoints/s  share  delay ms p50 p99  ripple  stop ms (exchanges)  error, deg:{}",
        "line, drives, timer",
        names.collect::<String>()
    );
    let first = outcomes.first().and_then(|first| first.as_ref().ok()).cloned();
    for (plan, outcome) in plans.iter().zip(&outcomes) {
        match outcome {
            Ok(outcome) => println!("{}", outcome.row(first.as_ref())),
            Err(reason) => println!("{:<22} {reason}", plan.name()),
        }
    }
    Ok(())
}

impl Outcome {
    fn row(&self, first: Option<&Self>) -> String {
        let beside = |index: usize| first.and_then(|first| first.tracking_deg.get(index).copied());
        let errors = self.tracking_deg.iter().enumerate().map(|(index, error)| {
            format!("{error:>7.3} ({:>4.2}x)", error / beside(index).unwrap_or(f64::NAN))
        });
        let [median, late] = self.delay_ms;
        format!(
            "{:<22} {:>11.0} {:>5.0}% {median:>12.1} {late:>4.1} {:>6.1}% {:>8.1} ({:.1}) {:>22}",
            self.line,
            self.setpoints_per_s,
            100.0 * self.share,
            100.0 * self.ripple,
            self.stop_ms,
            self.stop_exchanges,
            errors.collect::<String>()
        )
    }
}

/// A snake with its model, and the motion of a hand.
struct Subject {
    snake: DrawnSnake,
    model: Arc<Model>,
    hand: [(Motion, Vec<[f64; 2]>); 1],
}

impl Subject {
    fn calibrated(snake: DrawnSnake, duration_s: f64, folder: &Path) -> Result<Self, String> {
        let recording = record(snake, false, SEED, folder)?;
        let fit = |family| fitted(&recording, Choice::One(family), "i2ris-emulated");
        let hand = Motion::Teleoperation;
        let path = (hand, hand.path(duration_s, SEED));
        let within = within_reach(&[path], &fit(Family::Linear)?.model);
        let hand = <[_; 1]>::try_from(within).map_err(|_| "no motion is within reach")?;
        Ok(Self { snake, model: fit(Family::ForceBalance)?.model, hand })
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
    fn robot(self, subject: &Subject) -> Result<(EmulatorConfig, Config), String> {
        let mut emulated = EmulatorConfig::new(subject.snake, Path::new("unused"));
        let mut config = config().map_err(|error| error.to_string())?;
        let axes = config.ports.iter().flat_map(|port| port.axes.clone());
        let mut axes: Vec<AxisConfig> = axes.filter(|axis| axis.motor < AUXILIARY).collect();
        config.limits.feedback_stale_ms = 0;
        config.compensation.lead_ms = 10.0;
        if self.line != Line::Rs232 {
            let latency_timer_ms = self.timer_ms;
            emulated.line = LineConfig { latency_timer_ms, ..LineConfig::usb() };
            emulated.drives.iter_mut().for_each(|drive| drive.family = DriveFamily::Epos2);
        }
        if self.line == Line::Lab {
            emulated.add_auxiliary(GATEWAY_US);
            let third = emulated.auxiliary.as_ref().map_or(0, |drive| drive.serial_number);
            let limits = [-2400, 2400].map(Counts);
            let auxiliary_counts_per_deg = Some(10.0);
            axes.push(AxisConfig {
                auxiliary_counts_per_deg,
                ..AxisConfig::new(AUXILIARY, third, limits)
            });
            axes.truncate(self.axes);
            (0..).zip(&mut axes).for_each(|(node, axis)| axis.node_id = node + 1);
        }
        let port = |axes| PortConfig {
            baud: emulated.line.baud,
            family: match self.line {
                Line::Rs232 => config::Family::Epos4,
                Line::Lab | Line::UsbEach => config::Family::Epos2,
            },
            reply_timeout_ms: 100,
            ..PortConfig::new("unused".into(), axes)
        };
        config.ports = match self.line {
            Line::Lab => vec![port(axes)],
            Line::UsbEach | Line::Rs232 => axes.into_iter().map(|it| port(vec![it])).collect(),
        };
        Ok((emulated, config))
    }

    fn measure(self, subjects: &[Subject]) -> Result<Outcome, String> {
        let found = parallel::map(subjects.len(), |index| self.measure_on(&subjects[index]));
        let found = found.into_iter().collect::<Result<Vec<_>, String>>()?;
        let over = |of: fn(&Outcome) -> f64| mean(found.iter().map(of)).unwrap_or(f64::NAN);
        let most = |of: fn(&Outcome) -> f64| found.iter().map(of).fold(0.0, f64::max);
        Ok(Outcome {
            line: self.name(),
            setpoints_per_s: over(|it| it.setpoints_per_s),
            share: over(|it| it.share),
            delay_ms: [over(|it| it.delay_ms[0]), most(|it| it.delay_ms[1])],
            ripple: over(|it| it.ripple),
            stop_ms: most(|it| it.stop_ms),
            stop_exchanges: most(|it| it.stop_exchanges),
            tracking_deg: found.iter().flat_map(|it| it.tracking_deg.clone()).collect(),
        })
    }

    fn measure_on(self, subject: &Subject) -> Result<Outcome, String> {
        let (emulated, config) = self.robot(subject)?;
        let lines = Lines::start(&emulated, &config.ports)?;
        let mut control = ClosedLoop::new(&config, &subject.model, lines);
        for command in [StateCommand::Home, StateCommand::Enable, StateCommand::Condition] {
            (0..200).for_each(|_| _ = control.tick(Inputs::default()));
            control.command(command).map_err(|error| error.to_string())?;
        }
        let tracking_deg = follow(&mut control, &subject.hand)?;
        let end = subject.hand[0].1.last().copied().unwrap_or_default();
        approach(&mut control, end, [0.0; 2])?;
        let delay_ms = delays(&mut control)?;
        let (before, begin) = (control.motors.exchanges(), control.now());
        let ripple = ripple(&mut control)?;
        let seconds = control.now().duration_since(begin).as_seconds();
        let count = |motor: usize| {
            let is_it = |kind: &EventKind| matches!(kind, EventKind::Setpoint(_));
            let since = |stamp: Nanos| stamp > begin;
            let events = control.motors.events();
            events
                .iter()
                .filter(|it| it.axis == motor && since(it.stamp) && is_it(&it.kind))
                .count()
        };
        let setpoints_per_s = (count(0) + count(1)) as f64 / 2.0 / seconds;
        let exchanges = (control.motors.exchanges()[0] - before[0]) as f64 / seconds;
        let bare = exchanges / if self.line == Line::Lab { 4.0 } else { 2.0 };
        let stop_ms = stop(&mut control)?;
        Ok(Outcome {
            line: self.name(),
            setpoints_per_s,
            share: setpoints_per_s / bare,
            delay_ms,
            ripple,
            stop_ms,
            stop_exchanges: stop_ms * 1e-3 * exchanges,
            tracking_deg,
        })
    }
}

/// The delay of the tip behind sines, ms: median, and 99 of 100 windows of a second.
fn delays(control: &mut ClosedLoop<Lines>) -> Result<[f64; 2], String> {
    let sine = |time: f64, hz: f64| AMPLITUDE_DEG * (TAU * hz * time).sin();
    let path = path(|time| SINES_HZ.map(|hz| sine(time, hz)));
    let (mut goals, mut tips) = (Vec::new(), Vec::new());
    along(control, &path, |control, goal| {
        goals.push(goal);
        tips.push(control.tip());
    })?;
    let mut delays = Vec::new();
    for axis in 0..2 {
        for begin in (WINDOW..goals.len().saturating_sub(WINDOW)).step_by(100) {
            // What is left of the error without its mean.
            let left = |delay: usize| {
                let error = |tick: usize| tips[tick][axis] - goals[tick - delay][axis];
                let errors = (begin..begin + WINDOW).map(error);
                let middle = mean(errors.clone()).unwrap_or_default();
                root_mean_square(errors.map(|error| error - middle)).unwrap_or_default()
            };
            let least = (0..LONGEST_DELAY).min_by(|a, b| left(*a).total_cmp(&left(*b)));
            delays.extend(least.map(|delay| delay as f64));
        }
    }
    Ok([0.5, 0.99].map(|share| quantile_of_unsorted(&mut delays, share).unwrap_or(f64::NAN)))
}

/// The ripple of the speed of the motors while the goal moves at an even speed, as a share of it.
fn ripple(control: &mut ClosedLoop<Lines>) -> Result<f64, String> {
    let period_s = 4.0 * AMPLITUDE_DEG / SPEED_DEG_S;
    let triangle = |time: f64| {
        let share = (time / period_s).fract();
        AMPLITUDE_DEG * (1.0 - (4.0 * ((share + 0.75).fract() - 0.5).abs()))
    };
    let path = path(|time| [triangle(time); 2]);
    let mut positions = Vec::new();
    along(control, &path, |control, _| positions.push(control.motors.motors()))?;
    let of = |motor: usize| {
        let positions: Vec<f64> = positions.iter().map(|at: &[f64; 2]| at[motor]).collect();
        modes::ripple(&positions, SMOOTH)
    };
    Ok((of(0) + of(1)) / 2.0)
}

fn path(goal: impl Fn(f64) -> [f64; 2]) -> Vec<[f64; 2]> {
    (0..(DURATION_S * RATE_HZ) as usize).map(|sample| goal(sample as f64 / RATE_HZ)).collect()
}

/// From the tick of a fault to the last drive that stops, ms.
fn stop(control: &mut ClosedLoop<Lines>) -> Result<f64, String> {
    control.tick(Inputs { missed: u32::MAX, ..Inputs::default() });
    let begin = control.now();
    (0..STOP).for_each(|_| _ = control.tick(Inputs::default()));
    let events = control.motors.events();
    let stops = events.iter().filter(|event| {
        event.stamp > begin
            && matches!(event.kind, EventKind::State { to: State::QuickStopActive, .. })
    });
    let last = stops.map(|event| event.stamp).max().ok_or("no drive was stopped")?;
    Ok(last.duration_since(begin).as_seconds() * 1e3)
}
