//! A tick of the controller with ideal drives, the same motion every time.

use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use i2ris::config::Config;
use i2ris::core::rehearsal::Rehearsal;
use i2ris::core::simulated_loop::{Motors, SimulatedInputs, SimulatedLoop, state_request};
use i2ris::core::{ExternalPose, ServoGoal};
use i2ris::robot::StateCommand;
use i2ris::units::Nanos;

use crate::error::BenchError;
use crate::model::{Operators, model_of};

/// The configuration with limits and filters.
const CONFIG: &str = include_str!("../../../config/emulator.toml");

/// The cycle of the controller, which follows a motion with ideal drives.
#[derive(Debug)]
pub struct Cycle {
    rehearsal: Rehearsal,
    seconds: f64,
    period_s: f64,
}

impl Cycle {
    /// A cycle with a model of so many components and such operators.
    ///
    /// # Errors
    ///
    /// [`BenchError`].
    pub fn new(period: Nanos, components: usize, operators: Operators) -> Result<Self, BenchError> {
        let config = config(period)?;
        let model = Arc::new(model_of(components, operators)?);
        Ok(Self {
            rehearsal: Rehearsal::new(&config, &model, &[])?,
            seconds: 0.0,
            period_s: period.as_seconds(),
        })
    }

    /// One tick.
    ///
    /// # Errors
    ///
    /// [`BenchError`].
    pub fn step(&mut self) -> Result<(), BenchError> {
        self.seconds += self.period_s;
        self.rehearsal.follow(goal(self.seconds))?;
        Ok(())
    }
}

/// The same with adaptation, behind a camera.
#[derive(Debug)]
pub struct AdaptingCycle {
    control: SimulatedLoop,
    seconds: f64,
    period_s: f64,
    /// Frames on their way, with their arrival.
    frames: VecDeque<(Nanos, ExternalPose)>,
    next_frame: Nanos,
}

/// The camera: interval and age of its frames, and how far it is from the calibration, rad.
const FRAME_INTERVAL: Nanos = Nanos::from_millis(33);
const FRAME_AGE: Nanos = Nanos::from_millis(60);
const SHIFT: [f64; 3] = [0.01, -0.006, 0.0];

/// Enabling and conditioning take some ten thousand ticks.
const LONGEST_START_TICKS: u32 = 200_000;

impl AdaptingCycle {
    /// As [`Cycle::new`], with a memory that a conditioning cycle has made known.
    ///
    /// # Errors
    ///
    /// [`BenchError`].
    pub fn new(period: Nanos, components: usize, operators: Operators) -> Result<Self, BenchError> {
        let mut config = config(period)?;
        config.adaptation.enabled = true;
        let model = Arc::new(model_of(components, operators)?);
        let mut control = SimulatedLoop::new(&config, &model);
        for command in [StateCommand::Enable, StateCommand::Condition] {
            control.tick(
                Motors::AtTargets,
                SimulatedInputs {
                    request: Some(state_request(command)),
                    ..SimulatedInputs::default()
                },
            );
            for _ in 0..LONGEST_START_TICKS {
                if !control.report().busy {
                    break;
                }
                control.tick(Motors::AtTargets, SimulatedInputs::default());
            }
        }
        Ok(Self {
            next_frame: control.next(),
            control,
            seconds: 0.0,
            period_s: period.as_seconds(),
            frames: VecDeque::with_capacity(8),
        })
    }

    /// One tick; whether a frame arrived in it.
    pub fn step(&mut self) -> bool {
        self.seconds += self.period_s;
        let now = self.control.next();
        if now >= self.next_frame
            && let Some(joint) = self.control.report().joint
        {
            self.next_frame = now + FRAME_INTERVAL;
            let pose = ExternalPose {
                stamp: now,
                position: [0, 1, 2].map(|output: usize| joint.measured[output] + SHIFT[output]),
                outputs: 2,
                quality: 1.0,
            };
            self.frames.push_back((now + FRAME_AGE, pose));
        }
        let due = self.frames.front().filter(|(arrival, _)| *arrival <= now);
        let external = due.map(|(_, pose)| *pose);
        if external.is_some() {
            self.frames.pop_front();
        }
        let servo = Some(self.control.servo_command(goal(self.seconds)));
        let inputs = SimulatedInputs { servo, external, ..SimulatedInputs::default() };
        self.control.tick(Motors::AtTargets, inputs);
        external.is_some()
    }

    /// Frames that were learned from.
    #[must_use]
    pub fn learned(&self) -> u64 {
        let adaptation = self.control.report().adaptation;
        adaptation.map_or(0, |adaptation| adaptation.frames.used)
    }
}

fn config(period: Nanos) -> Result<Config, BenchError> {
    let mut config = Config::parse(CONFIG, Path::new("config/emulator.toml"))?;
    config.control.rate_hz = (1_000_000_000 / period.0.max(1)) as u32;
    Ok(config)
}

/// Two frequencies with a long common period: both motors turn at many positions.
fn goal(seconds: f64) -> ServoGoal {
    let axis = |hz: f64| 5.0_f64.to_radians() * (TAU * hz * seconds).sin();
    ServoGoal::Joint([axis(0.5), axis(0.31), 0.0], 2)
}
