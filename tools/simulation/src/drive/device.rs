//! The drive: its state, start-up, encoder and snapshot.

use i2ris::units::Nanos;

use super::command_set::SegmentedTransfer;
use super::dictionary::{Dictionary, ObjectMap};
use super::event::{EventKind, Fault};
use super::family::{Address, Mode};
use super::motor::{Demand, DriveConfig, Motor};
use super::state::{State, Task};

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Homing {
    /// Not started since the mode was chosen.
    #[default]
    Idle,
    Attained,
    /// Started with a method that cannot be executed.
    Failed,
}

/// Setpoints of the profile position mode, in counts of the motor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Setpoints {
    pub(super) active: Option<f64>,
    /// The setpoint after the active one.
    pub(super) queued: Option<f64>,
    pub(super) acknowledged: bool,
    /// The last accepted setpoint, as written.
    pub(super) taken: Option<i64>,
}

#[derive(Debug, Clone, Default)]
pub struct Drive {
    pub(super) config: DriveConfig,
    pub(super) dictionary: Dictionary,
    /// The parameters after a reset.
    pub(super) stored: Dictionary,
    pub(super) state: State,
    pub(super) mode: Mode,
    pub(super) controlword: u16,
    pub(super) task: Task,
    pub(super) demand: Demand,
    pub(crate) motor: Motor,
    /// The encoder does not count: it reports this position of the motor.
    pub(super) frozen: Option<f64>,
    /// Counts that the encoder has missed.
    lost_counts: f64,
    /// Encoder count of the motor at the drive's zero.
    pub(super) origin: i64,
    pub(super) homed: bool,
    pub(super) homing: Homing,
    pub(super) setpoints: Setpoints,
    pub(super) since_setpoint_s: f64,
    pub(super) since_request_s: f64,
    pub(super) fault: Option<Fault>,
    /// The cause of the fault is still present.
    pub(super) cause_persists: bool,
    pub(super) warning: bool,
    /// NMT state is operational.
    pub(super) operational: bool,
    pub(super) boot_left_s: f64,
    /// The drive is cut off from its line and keeps running.
    pub(super) silent: bool,
    /// See [`Drive::lose`].
    pub(super) lost: u16,
    pub(super) transfer: SegmentedTransfer,
    /// The other node on this port whose segments are read.
    pub(super) transfer_node: Option<u8>,
    pub(super) events: Vec<EventKind>,
}

/// State of a drive for tests.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveSnapshot {
    pub state: State,
    pub mode: Mode,
    pub statusword: u16,
    pub error_code: u16,
    /// Position as the drive reports it, counts.
    pub position: i32,
    /// Position demand, counts.
    pub demand: i32,
    /// The setpoint that acts at once (object 0x607A; EPOS2 0x2062), counts.
    pub target: i32,
    /// True position of the motor since the start, counts: unchanged by homing.
    pub motor_counts: f64,
    pub homed: bool,
}

impl Drive {
    /// A drive that has just booted, its motor at `motor_counts`.
    pub fn new(config: &DriveConfig, motor_counts: f64) -> Self {
        let dictionary = factory_settings(config);
        let mut drive = Self {
            config: config.clone(),
            stored: dictionary.clone(),
            dictionary,
            motor: Motor::at(motor_counts),
            ..Self::default()
        };
        drive.lose_position();
        drive.finish_boot();
        drive
    }

    /// True position of the motor since the start of the emulator, counts.
    pub fn motor_counts(&self) -> f64 {
        self.motor.position
    }

    /// The lowest and the highest true position of the motor so far, counts.
    pub fn reached(&self) -> [f64; 2] {
        self.motor.reached
    }

    /// Timeout of an incomplete frame (object 0x2005).
    pub fn frame_timeout(&self) -> Nanos {
        Nanos::from_millis(self.dictionary.get(0x2005, 0).unsigned_abs())
    }

    /// Power off and on, or reset: parameters as stored, position lost, no reply until booted.
    pub fn power_cycle(&mut self) {
        self.lose_position();
        self.dictionary = self.stored.clone();
        let mode = self.config.family.mode(self.dictionary.get(0x6060, 0));
        self.mode = mode.unwrap_or(Mode::ProfilePosition);
        self.controlword = 0;
        self.fault = None;
        self.cause_persists = false;
        self.warning = false;
        self.operational = false;
        self.homing = Homing::Idle;
        self.transfer = SegmentedTransfer::default();
        self.boot_left_s = self.config.boot_ms as f64 * 1e-3;
        self.power_off(State::NotReadyToSwitchOn);
    }

    pub fn snapshot(&self) -> DriveSnapshot {
        DriveSnapshot {
            state: self.state,
            mode: self.mode,
            statusword: self.statusword(),
            error_code: self.fault.map_or(0, |fault| fault.0),
            position: self.position(),
            demand: self.to_drive(self.demand.position),
            target: self.stored(self.map().direct_target) as i32,
            motor_counts: self.motor.position,
            homed: self.homed,
        }
    }

    /// Takes the events since the last call.
    pub fn take_events(&mut self) -> Vec<EventKind> {
        std::mem::take(&mut self.events)
    }

    pub(super) fn finish_boot(&mut self) {
        self.events.push(EventKind::Boot);
        self.enter(State::SwitchOnDisabled);
        if let Some(code) = self.config.boot_fault {
            self.raise(Fault(code), false);
        }
    }

    pub(super) fn map(&self) -> &'static ObjectMap {
        self.config.family.map()
    }

    /// The value of an object in the family's map.
    pub(super) fn stored(&self, (index, sub): Address) -> i64 {
        self.dictionary.get(index, sub)
    }

    /// Cuts the drive off from its line, or connects it again.
    pub fn set_silent(&mut self, silent: bool) {
        self.silent = silent;
    }

    /// Loses requests on the way: one bit for each of the next requests, the first the lowest.
    pub fn lose(&mut self, requests: u16) {
        self.lost = requests;
    }

    /// Stops the encoder, or lets it resume counting where it stopped, like an incremental encoder.
    pub fn freeze_encoder(&mut self, freeze: bool) {
        match (self.frozen, freeze) {
            (None, true) => self.frozen = Some(self.motor.position),
            (Some(frozen), false) => {
                self.lost_counts += self.motor.position - frozen;
                self.frozen = None;
            }
            _ => {}
        }
    }

    /// Lets the encoder lose or gain counts.
    pub fn slip_encoder(&mut self, counts: i32) {
        self.lost_counts -= f64::from(counts);
    }

    /// Position of the motor as the encoder shows it, counts of the motor.
    pub(super) fn measured(&self) -> f64 {
        self.frozen.unwrap_or(self.motor.position) - self.lost_counts
    }

    /// Encoder count since the start of the emulator.
    pub(super) fn encoder(&self) -> i64 {
        self.measured().round() as i64
    }

    /// Position actual value (object 0x6064).
    pub(super) fn position(&self) -> i32 {
        clamp_i32(self.encoder() - self.origin)
    }

    /// Converts counts of the motor to counts of the drive.
    pub(super) fn to_drive(&self, motor: f64) -> i32 {
        clamp_i32(motor.round() as i64 - self.origin)
    }

    /// Converts counts of the drive to counts of the motor.
    pub(super) fn to_motor(&self, counts: i64) -> f64 {
        (counts + self.origin) as f64
    }

    /// Lets the encoder count from 0 again, wherever the motor is.
    pub(super) fn lose_position(&mut self) {
        self.origin = self.encoder();
        self.homed = false;
    }
}

fn clamp_i32(value: i64) -> i32 {
    value.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
}

/// The objects of a drive as delivered.
pub(super) fn factory_settings(config: &DriveConfig) -> Dictionary {
    let mut dictionary = Dictionary::new(config.family, config.device.as_ref());
    let map = config.family.map();
    let serial_number = i64::from(config.serial_number);
    for ((index, sub), value) in [
        ((0x2000, 0), i64::from(config.node_id)),
        ((0x1014, 0), 0x80 + i64::from(config.node_id)),
        ((0x1018, 4), serial_number),
        (map.full_serial_number, 0x1_0000_0000 + serial_number),
        (map.encoder_pulses, i64::from(config.motor.encoder_pulses)),
    ] {
        dictionary.set(index, sub, value);
    }
    dictionary
}
