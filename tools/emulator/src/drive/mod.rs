//! An emulated EPOS4 or EPOS2: objects, state machine, modes of operation, motor. No clock, no
//! line: requests and time steps in, replies and motor positions out.
//!
//! Sources: `epos4-serial.md`, sections 1 and 3, which names maxon's documents clause by clause.
//! Where a fact is not known, the drive here does what hurts a careless host most.
//!
//! | file | holds |
//! |---|---|
//! | `config` | what can be set about a drive |
//! | `family` | EPOS4 and EPOS2: which objects they have, and where they keep what |
//! | `object`, `object_epos2` | the tables of objects |
//! | `dictionary` | their values, and the checks on access |
//! | `state` | the CiA 402 state machine |
//! | `control` | what a controlword sets in motion, and faults |
//! | `mode`, `motion` | the modes of operation, and what they do from step to step |
//! | `profile`, `motor` | the moving demand, and the motor that follows it |
//! | `status` | statusword and all other objects that are computed when they are read |
//! | `language` | opcodes: what a request asks for |
//! | `service` | from what is asked to the reply |
//! | `code` | numbers of answers and faults |

mod code;
mod config;
mod control;
mod dictionary;
mod family;
mod language;
mod mode;
mod motion;
mod motor;
mod object;
mod object_epos2;
mod profile;
mod service;
mod state;
mod status;
#[cfg(test)]
mod tests;

use i2ris::units::Nanos;

pub use code::{Abort, Fault, Reaction};
pub use config::DriveConfig;
pub use family::Family;
pub use mode::Mode;
pub use motor::{Motor, MotorConfig};
pub use service::Answer;
pub(crate) use service::is_read;
pub use state::State;

use crate::log::EventKind;
use dictionary::Dictionary;
use motion::Task;
use profile::Demand;
use service::Transfer;

/// How homing went.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Homing {
    /// Not started since the mode was chosen.
    #[default]
    Idle,
    /// Done.
    Attained,
    /// Started with a method that cannot be carried out.
    Failed,
}

/// Set-points of the profile position mode, in counts of the motor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Setpoints {
    /// Where it goes.
    active: Option<f64>,
    /// Where it goes after that.
    queued: Option<f64>,
    /// The acknowledge bit.
    acknowledged: bool,
    /// The set-point that was taken last, as written.
    taken: Option<i64>,
}

/// An emulated drive.
#[derive(Debug, Clone)]
pub struct Drive {
    config: DriveConfig,
    dictionary: Dictionary,
    /// What a reset restores.
    stored: Dictionary,
    state: State,
    mode: Mode,
    controlword: u16,
    task: Task,
    demand: Demand,
    motor: Motor,
    /// The encoder does not count: it shows this position of the motor.
    frozen: Option<f64>,
    /// What the encoder did not count.
    lost_counts: f64,
    /// Encoder count of the motor at the drive's zero.
    origin: i64,
    homed: bool,
    homing: Homing,
    setpoints: Setpoints,
    since_setpoint_s: f64,
    fault: Option<Fault>,
    /// The cause of the fault is still there.
    cause: bool,
    warning: bool,
    /// NMT state is operational.
    operational: bool,
    boot_left_s: f64,
    transfer: Transfer,
    events: Vec<EventKind>,
}

/// What a drive shows to tests.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveSnapshot {
    /// State.
    pub state: State,
    /// Mode of operation.
    pub mode: Mode,
    /// Statusword.
    pub statusword: u16,
    /// Error code.
    pub error_code: u16,
    /// Position as the drive reports it, counts.
    pub position: i32,
    /// Position demand, counts.
    pub demand: i32,
    /// The set-point that acts at once (object 0x607A; EPOS2 0x2062), counts.
    pub target: i32,
    /// True position of the motor since the start of the emulator, counts. Homing does not change
    /// it.
    pub motor_counts: f64,
    /// The drive knows its zero.
    pub homed: bool,
}

impl Drive {
    /// A drive that has just booted, its motor at `motor_counts`.
    #[must_use]
    pub fn new(config: &DriveConfig, motor_counts: f64) -> Self {
        let dictionary = factory_settings(config);
        let mut drive = Self {
            config: config.clone(),
            stored: dictionary.clone(),
            dictionary,
            state: State::NotReadyToSwitchOn,
            mode: Mode::ProfilePosition,
            controlword: 0,
            task: Task::Off,
            demand: Demand::default(),
            motor: Motor {
                position: motor_counts,
                ..Motor::default()
            },
            frozen: None,
            lost_counts: 0.0,
            origin: 0,
            homed: false,
            homing: Homing::Idle,
            setpoints: Setpoints::default(),
            since_setpoint_s: 0.0,
            fault: None,
            cause: false,
            warning: false,
            operational: false,
            boot_left_s: 0.0,
            transfer: Transfer::default(),
            events: Vec::new(),
        };
        drive.lose_position();
        drive.finish_boot();
        drive
    }

    /// True position of the motor since the start of the emulator, counts.
    #[must_use]
    pub fn motor_counts(&self) -> f64 {
        self.motor.position
    }

    /// How long it waits for the rest of a frame (object 0x2005).
    #[must_use]
    pub fn frame_timeout(&self) -> Nanos {
        Nanos::from_millis(self.dictionary.get(0x2005, 0).unsigned_abs())
    }

    /// Power off and on again, or a reset: parameters as stored, position lost, deaf for a while.
    pub fn power_cycle(&mut self) {
        self.power_off();
        self.lose_position();
        self.dictionary = self.stored.clone();
        self.mode = self
            .config
            .family
            .mode(self.dictionary.get(0x6060, 0))
            .unwrap_or(Mode::ProfilePosition);
        self.controlword = 0;
        self.fault = None;
        self.cause = false;
        self.warning = false;
        self.operational = false;
        self.homing = Homing::Idle;
        self.transfer = Transfer::default();
        self.boot_left_s = self.config.boot_ms as f64 * 1e-3;
        self.enter(State::NotReadyToSwitchOn);
    }

    /// What it shows to tests.
    #[must_use]
    pub fn snapshot(&self) -> DriveSnapshot {
        DriveSnapshot {
            state: self.state,
            mode: self.mode,
            statusword: self.statusword(),
            error_code: self.fault.map_or(0, |fault| fault.0),
            position: self.position(),
            demand: self.to_drive(self.demand.position),
            target: self.stored(self.config.family.places().direct_target) as i32,
            motor_counts: self.motor.position,
            homed: self.homed,
        }
    }

    /// What happened since the last call.
    pub fn take_events(&mut self) -> Vec<EventKind> {
        std::mem::take(&mut self.events)
    }

    fn finish_boot(&mut self) {
        self.events.push(EventKind::Boot);
        self.enter(State::SwitchOnDisabled);
        if let Some(code) = self.config.boot_fault {
            self.raise(Fault(code), false);
        }
    }

    /// The value of an object that the family keeps where it likes.
    fn stored(&self, (index, sub): family::Place) -> i64 {
        self.dictionary.get(index, sub)
    }

    /// Stops the encoder where it is, or lets it count again: from where it stopped, as an
    /// incremental one does.
    pub fn freeze_encoder(&mut self, freeze: bool) {
        match (self.frozen, freeze) {
            (None, true) => self.frozen = Some(self.motor.position),
            (Some(held), false) => {
                self.lost_counts += self.motor.position - held;
                self.frozen = None;
            }
            _ => {}
        }
    }

    /// The encoder loses or gains counts.
    pub fn slip_encoder(&mut self, counts: i32) {
        self.lost_counts -= f64::from(counts);
    }

    /// Where the encoder says that the motor is, counts of the motor.
    fn measured(&self) -> f64 {
        self.frozen.unwrap_or(self.motor.position) - self.lost_counts
    }

    /// The encoder, as it counts since the start of the emulator.
    fn encoder(&self) -> i64 {
        self.measured().round() as i64
    }

    /// Position actual value (object 0x6064).
    fn position(&self) -> i32 {
        clamp_i32(self.encoder() - self.origin)
    }

    /// From counts of the motor to counts of the drive.
    fn to_drive(&self, motor: f64) -> i32 {
        clamp_i32(motor.round() as i64 - self.origin)
    }

    /// From counts of the drive to counts of the motor.
    fn to_motor(&self, counts: i64) -> f64 {
        (counts + self.origin) as f64
    }

    /// The encoder counts from 0 again, wherever the motor stands.
    fn lose_position(&mut self) {
        self.origin = self.encoder();
        self.homed = false;
    }
}

fn clamp_i32(value: i64) -> i32 {
    value.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
}

/// The objects as they are when a drive is delivered.
fn factory_settings(config: &DriveConfig) -> Dictionary {
    let mut dictionary = Dictionary::new(config.family);
    let places = config.family.places();
    let at = |(index, sub): family::Place, value: i64| (index, sub, value);
    for (index, sub, value) in [
        (0x2000, 0, i64::from(config.node_id)),
        (0x1014, 0, 0x80 + i64::from(config.node_id)),
        (0x1018, 4, i64::from(config.serial_number)),
        at(
            places.full_serial_number,
            0x1_0000_0000 + i64::from(config.serial_number),
        ),
        at(
            places.encoder_pulses,
            i64::from(config.motor.encoder_pulses),
        ),
    ] {
        dictionary.set(index, sub, value);
    }
    dictionary
}
