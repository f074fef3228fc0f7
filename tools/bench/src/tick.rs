//! A tick of the controller with ideal drives, the same motion every time.

use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use i2ris::config::Config;
use i2ris::core::ServoGoal;
use i2ris::core::rehearsal::Rehearsal;
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
        let mut config = Config::parse(CONFIG, Path::new("config/emulator.toml"))?;
        config.control.rate_hz = (1_000_000_000 / period.0.max(1)) as u32;
        let model = Arc::new(model_of(components, operators)?);
        Ok(Self {
            rehearsal: Rehearsal::new(&config, &model, &[])?,
            seconds: 0.0,
            period_s: period.as_seconds(),
        })
    }

    /// Two frequencies with a long common period: both motors turn at many positions.
    ///
    /// # Errors
    ///
    /// [`BenchError`].
    pub fn step(&mut self) -> Result<(), BenchError> {
        self.seconds += self.period_s;
        let axis = |hz: f64| 5.0_f64.to_radians() * (TAU * hz * self.seconds).sin();
        let goal = ServoGoal::Joint([axis(0.5), axis(0.31), 0.0], 2);
        self.rehearsal.follow(goal)?;
        Ok(())
    }
}
