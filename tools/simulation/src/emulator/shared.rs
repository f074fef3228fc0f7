//! The state that the threads of an emulator share.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use i2ris::clock;
use i2ris::units::Nanos;

use super::injection::Injection;
use super::log::{Log, lock};
use super::plant::{Plant, Wire};
use crate::ageing::Change;
use crate::camera::TimedCameraFault;
use crate::drive::event::EventKind;
use crate::drive::{Drive, Fault};

pub(crate) struct Shared {
    plant: Mutex<Plant>,
    pub(crate) log: Arc<Log>,
    pub(crate) stop: AtomicBool,
    /// One for each port.
    lines: Vec<Line>,
    /// The axes of each port.
    layout: Vec<Vec<usize>>,
    /// Times at which the encoders of these axes resume counting.
    frozen: Mutex<Vec<(Nanos, usize)>>,
    /// For the camera's thread: faults to begin; `None`: all of them end.
    pub(crate) camera: Mutex<Vec<Option<TimedCameraFault>>>,
}

/// Counters and pending faults of one line.
#[derive(Debug, Default)]
pub(crate) struct Line {
    pub(crate) requests: AtomicU64,
    pub(crate) replies: AtomicU64,
    pub(crate) muted: AtomicBool,
    pending: Mutex<PendingFaults>,
}

#[derive(Debug, Default)]
struct PendingFaults {
    /// One for each of the next exchanges.
    exchanges: VecDeque<Injection>,
    hang_up: Option<Nanos>,
    muted_until: Nanos,
}

impl Line {
    /// Takes the fault of the next exchange.
    pub(crate) fn take_exchange_fault(&self) -> Option<Injection> {
        lock(&self.pending).exchanges.pop_front()
    }

    /// Takes the duration for which the port disappears now.
    pub(crate) fn take_hang_up(&self) -> Option<Nanos> {
        lock(&self.pending).hang_up.take()
    }

    /// Whether the drive must not reply.
    pub(crate) fn is_muted(&self, now: Nanos) -> bool {
        self.muted.load(Ordering::Relaxed) || now < lock(&self.pending).muted_until
    }
}

impl Shared {
    pub(crate) fn new(plant: Plant, log: Arc<Log>, layout: Vec<Vec<usize>>) -> Self {
        Self {
            plant: Mutex::new(plant),
            log,
            stop: AtomicBool::new(false),
            lines: layout.iter().map(|_| Line::default()).collect(),
            layout,
            frozen: Mutex::default(),
            camera: Mutex::default(),
        }
    }

    pub(crate) fn plant(&self) -> MutexGuard<'_, Plant> {
        lock(&self.plant)
    }

    /// The port of an axis; the first if the axis has none.
    pub(crate) fn port_of(&self, axis: usize) -> usize {
        self.layout.iter().position(|axes| axes.contains(&axis)).unwrap_or(0)
    }

    pub(crate) fn line(&self, axis: usize) -> &Line {
        &self.lines[self.port_of(axis)]
    }

    /// Starts a change of the snake.
    pub(crate) fn begin_ageing(&self, change: Change) {
        let mut plant = self.plant();
        plant.advance_to(clock::now());
        plant.snake.begin_ageing(change);
    }

    /// Injects a fault into an axis, its line or its wire.
    pub(crate) fn inject(&self, axis: usize, injection: Injection) {
        let now = clock::now();
        self.plant().log(axis, now, EventKind::Injected(injection.name()));
        let pending = || lock(&self.line(axis).pending);
        let disturb = |change: &dyn Fn(&mut Drive)| self.plant().disturb(axis, now, change);
        match injection {
            Injection::HangUp { for_ms } => pending().hang_up = Some(Nanos::from_millis(for_ms)),
            Injection::Mute { for_ms } => pending().muted_until = now + Nanos::from_millis(for_ms),
            Injection::Reset => disturb(&Drive::power_cycle),
            Injection::Fault { code } => disturb(&|drive| drive.raise(Fault(code), false)),
            Injection::FreezeEncoder { for_ms } => {
                disturb(&|drive| drive.freeze_encoder(true));
                lock(&self.frozen).push((now + Nanos::from_millis(for_ms), axis));
            }
            Injection::SlipEncoder { counts } => disturb(&|drive| drive.slip_encoder(counts)),
            Injection::SlackWire { counts } => self.change_wire(axis, now, |wire, motor| {
                wire.slacken(motor, f64::from(counts));
            }),
            Injection::BreakWire => self.change_wire(axis, now, Wire::break_at),
            Injection::MendWire => self.change_wire(axis, now, |wire, _| *wire = Wire::Intact),
            of_exchange => pending().exchanges.push_back(of_exchange),
        }
    }

    fn change_wire(&self, axis: usize, now: Nanos, change: impl FnOnce(&mut Wire, f64)) {
        let mut plant = self.plant();
        plant.advance_to(now);
        let motor = plant.drives[axis].motor_counts();
        change(&mut plant.wires[axis], motor);
    }

    /// Advances the plant, and lets frozen encoders resume counting.
    pub(crate) fn advance(&self, now: Nanos) {
        let due: Vec<_> = lock(&self.frozen).extract_if(.., |(until, _)| *until <= now).collect();
        let mut plant = self.plant();
        plant.advance_to(now);
        for (_, axis) in due {
            plant.disturb(axis, now, |drive| drive.freeze_encoder(false));
        }
    }

    /// True pitch and yaw, degrees, and their instant.
    pub(crate) fn true_angles(&self, now: Nanos) -> (Nanos, [f64; 2]) {
        let mut plant = self.plant();
        plant.advance_to(now);
        (plant.time, plant.snake.angles_deg())
    }

    /// Whether the threads have to end.
    pub(crate) fn is_stopping(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
