//! Both drives, the snake and the wires between them, advanced in fixed small time steps.

use std::sync::Arc;

use i2ris::units::Nanos;

use super::config::EmulatorConfig;
use super::log::{Event, Log};
use crate::drive::event::EventKind;
use crate::drive::frame::Incoming;
use crate::drive::{Drive, Reply};
use crate::physics::Snake;

/// Time step of the plant: a tenth of the time constant of a position loop.
const STEP: Nanos = Nanos::from_micros(500);
/// After a longer stall (a suspended machine) the missed time is skipped.
const MAX_CATCH_UP: Nanos = Nanos::from_millis(2000);

#[derive(Debug)]
pub(crate) struct Plant {
    /// Drives of the motors, then that of the auxiliary axis, if there is one.
    pub(crate) drives: Vec<Drive>,
    pub(crate) snake: Snake,
    /// The wires between motors and snake.
    pub(crate) wires: [Wire; 2],
    /// The first drive of a port forwards requests to the others over CAN, in this round trip.
    gateways: (Vec<Vec<usize>>, Nanos),
    /// The instant of the present state.
    pub(crate) time: Nanos,
    log: Arc<Log>,
}

impl Plant {
    /// Starts at `now` with a straight snake and the motors at 0.
    pub(crate) fn new(config: &EmulatorConfig, log: Arc<Log>, now: Nanos) -> Self {
        let drives = config.drives.iter().chain(&config.auxiliary);
        let trip = Nanos::from_micros(config.gateway_us.unwrap_or_default());
        let mut plant = Self {
            drives: drives.map(|config| Drive::new(config, 0.0)).collect(),
            snake: config.snake.build(config.seed),
            wires: Default::default(),
            gateways: (config.ports(), trip),
            time: now,
            log,
        };
        plant.record(now);
        plant
    }

    /// Advances to `now`. Does nothing if `now` has passed: two threads may come in either order.
    pub(crate) fn advance_to(&mut self, now: Nanos) {
        if now - self.time > MAX_CATCH_UP {
            self.time = now - MAX_CATCH_UP;
        }
        while self.time + STEP <= now {
            self.time = self.time + STEP;
            let mut pulled = [0.0; 2];
            for (axis, pulled) in pulled.iter_mut().enumerate() {
                self.drives[axis].advance(STEP.as_seconds());
                *pulled = self.wires[axis].pull(self.drives[axis].motor_counts());
            }
            for auxiliary in self.drives.iter_mut().skip(self.wires.len()) {
                auxiliary.advance(STEP.as_seconds());
            }
            self.snake.step(STEP.as_seconds(), pulled);
            let load = self.snake.load();
            for ((drive, wire), load) in self.drives.iter_mut().zip(&self.wires).zip(load) {
                let is_pulled = !matches!(wire, Wire::Broken(_));
                drive.motor.load = if is_pulled { load } else { 0.0 };
            }
            self.record(self.time);
        }
    }

    /// The reply of a drive to a frame that was complete at `arrived`.
    pub(crate) fn reply(
        &mut self,
        axis: usize,
        incoming: &Incoming,
        arrived: Nanos,
    ) -> Option<Reply> {
        self.advance_to(arrived);
        let (layout, trip) = &self.gateways;
        let port_axes = layout.iter().find(|axes| axes.first() == Some(&axis));
        let (mut port, mut others) = (None, Vec::new());
        for (other, drive) in self.drives.iter_mut().enumerate() {
            if other == axis {
                port = Some(drive);
            } else if port_axes.is_some_and(|axes| axes.contains(&other)) {
                others.push(drive);
            }
        }
        let gateway = (!others.is_empty()).then_some((others, *trip));
        let reply = port?.reply_at_port(incoming, gateway);
        // A late thread cannot change the past: its setpoints act from the present time.
        self.record(self.time.max(arrived));
        reply
    }

    pub(crate) fn disturb(&mut self, axis: usize, now: Nanos, change: impl FnOnce(&mut Drive)) {
        self.advance_to(now);
        change(&mut self.drives[axis]);
        self.record(self.time.max(now));
    }

    /// Logs an event of an axis.
    pub(crate) fn log(&self, axis: usize, stamp: Nanos, kind: EventKind) {
        self.log.push(Event { stamp, axis, kind });
    }

    fn record(&mut self, stamp: Nanos) {
        for axis in 0..self.drives.len() {
            for kind in self.drives[axis].take_events() {
                self.log(axis, stamp, kind);
            }
        }
    }
}

/// A wire. Positions are counts of the motor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum Wire {
    #[default]
    Intact,
    /// It follows the motor with play.
    Slack {
        /// Total play of both directions, counts.
        counts: f64,
        position: f64,
    },
    /// It stays at this position.
    Broken(f64),
}

impl Wire {
    /// Adds play at the present position.
    pub(crate) fn slacken(&mut self, motor: f64, counts: f64) {
        *self = Self::Slack { counts, position: self.position(motor) };
    }

    /// Breaks it at the present position.
    pub(crate) fn break_at(&mut self, motor: f64) {
        *self = Self::Broken(self.position(motor));
    }

    fn position(self, motor: f64) -> f64 {
        match self {
            Self::Intact => motor,
            Self::Slack { position, .. } | Self::Broken(position) => position,
        }
    }

    /// Moves the motor to `motor`. Returns the motor position that the snake experiences.
    pub(crate) fn pull(&mut self, motor: f64) -> f64 {
        if let Self::Slack { counts, position } = self {
            *position = position.clamp(motor - *counts / 2.0, motor + *counts / 2.0);
        }
        self.position(motor)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::drive::frame::Request;
    use crate::physics::springs::tests::config;

    fn plant(log: &Arc<Log>) -> Plant {
        let config = EmulatorConfig::new(config("steel"), Path::new(""));
        Plant::new(&config, Arc::clone(log), Nanos::ZERO)
    }

    fn write(plant: &mut Plant, now: Nanos, index: u16, value: u8) {
        let [low, high] = index.to_le_bytes();
        let (opcode, data) = (0x68, vec![1, low, high, 0, value, 0, 0, 0]);
        let request = Incoming::Request(Request { opcode, data });
        assert!(plant.reply(0, &request, now).is_some());
    }

    #[test]
    fn requests_do_not_change_the_time_steps_of_the_plant() {
        let positions = [10_000u64, 1_300].map(|period_us| {
            let mut plant = plant(&Arc::default());
            for (index, value) in [(0x6060, 3), (0x6040, 6), (0x6040, 15), (0x60FF, 50)] {
                write(&mut plant, Nanos::ZERO, index, value);
            }
            for step in 1..=1_000_000 / period_us {
                write(&mut plant, Nanos::from_micros(step * period_us), 0x60FF, 50);
            }
            plant.advance_to(Nanos::from_millis(1000));
            plant.drives[0].motor_counts()
        });
        let [idle, busy] = positions;
        assert!(idle > 500.0 && (idle - busy).abs() < 2.0, "{positions:?}");
    }

    #[test]
    fn a_late_request_is_stamped_when_it_takes_effect() {
        let log = Arc::new(Log::default());
        let mut plant = plant(&log);
        plant.advance_to(Nanos::from_millis(20));
        write(&mut plant, Nanos::from_millis(5), 0x607A, 9);
        write(&mut plant, Nanos::from_micros(20_300), 0x607A, 9);
        let mut events = log.events();
        events.retain(|event| event.kind == EventKind::Setpoint(9));
        let stamps: Vec<Nanos> = events.iter().map(|event| event.stamp).collect();
        assert_eq!(stamps, [Nanos::from_millis(20), Nanos::from_micros(20_300)]);
    }

    #[test]
    fn slack_wires_lag_by_their_play_and_broken_wires_stay() {
        let mut wire = Wire::default();
        assert_eq!(wire.pull(100.0), 100.0);
        wire.slacken(100.0, 40.0);
        let pulled = [110.0, 120.0, 150.0, 140.0].map(|motor| wire.pull(motor));
        assert_eq!(pulled, [100.0, 100.0, 130.0, 130.0]);
        wire.break_at(140.0);
        assert_eq!(wire.pull(900.0), 130.0);
    }
}
