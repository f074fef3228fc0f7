//! Benches in the states of the controller.

use std::sync::Arc;

use i2ris::config::Config;
use i2ris::ipc::{Fault, OperatingState, Refusal, StateCommand};
use i2ris::model::Model;

use super::bench::Bench;
use super::sample_models::{config, standard_model};
use super::simulated_drive::Quirk;

impl Bench {
    pub fn homed() -> Self {
        let mut bench = Self::standard();
        bench.home();
        bench
    }

    pub fn home(&mut self) {
        assert_eq!(self.ask(StateCommand::Home), Refusal::None);
        self.idle();
        assert!(self.report().homed);
    }

    pub fn enable(&mut self) {
        assert_eq!(self.ask(StateCommand::Enable), Refusal::None);
        self.until("ENABLED", |bench| bench.state() == OperatingState::Enabled);
    }

    pub fn enabled() -> Self {
        Self::with("")
    }

    /// Enabled with additional tables and the standard model.
    pub fn with(tables: &str) -> Self {
        Self::enabled_with(config(tables), Some(standard_model()))
    }

    pub fn enabled_with(config: Config, model: Option<Arc<Model>>) -> Self {
        let mut bench = Self::new(config, model);
        bench.home();
        bench.enable();
        bench
    }

    /// Enabled and moving to a far goal, at full speed, with a command that has just been
    /// accepted.
    pub fn moving() -> Self {
        let mut bench = Self::enabled();
        for _ in 0..7 {
            bench.run(9);
            assert_eq!(bench.actuator([250, 250]), Refusal::None);
        }
        let before = bench.targets();
        bench.tick();
        assert_eq!(bench.targets(), before.map(|target| target + 2), "2000 counts/s");
        bench
    }

    pub fn paused() -> Self {
        let mut bench = Self::enabled();
        assert_eq!(bench.ask(StateCommand::Pause), Refusal::None);
        bench.idle();
        bench
    }

    /// Drive 0 at fault.
    pub fn faulted() -> Self {
        let mut bench = Self::enabled();
        bench.fault(0);
        bench
    }

    pub fn fault(&mut self, axis: usize) {
        self.drives[axis].fail(0x8611);
        self.run(2);
        assert_eq!((self.state(), self.report().fault), (OperatingState::Fault, Fault::Drive));
    }

    pub fn quirk(&mut self, axis: usize, quirk: Quirk) {
        self.drives[axis].quirk = quirk;
    }
}
