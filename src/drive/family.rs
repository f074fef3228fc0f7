//! What the port thread needs to know of a family of drives, and nothing more.

use std::fmt;

use crate::config::{AxisConfig, Family, HomingMethod, PortConfig, Streaming};

use super::dialect::Dialect;
use super::epos2::Epos2;
use super::epos4::{Epos4, Epos4Profile};
use super::object::{self, Address, Object, Setting};

/// A family of drives: how it is spoken to, and which of its objects plays which part.
///
/// Implementations are constants without state; everything that changes lives in the port thread.
pub trait Drive: fmt::Debug + Sync {
    /// Name for messages.
    fn name(&self) -> &'static str;

    /// How it is asked when the port belongs to it.
    fn dialect(&self) -> &'static dyn Dialect;

    /// Which object plays which part.
    fn parts(&self) -> &'static Parts;

    /// The limits and options of an axis: written at start, read back and compared.
    fn settings(&self, axis: &AxisConfig) -> Vec<Setting>;

    /// How an axis finds its zero.
    fn homing(&self, axis: &AxisConfig) -> HomingPlan;

    /// What an error code (`Parts::error_code`) means.
    fn fault(&self, code: u16) -> Fault;
}

/// The drive that a port belongs to: it decides how the line speaks.
#[must_use]
pub fn of_port(port: &PortConfig) -> &'static dyn Drive {
    choose(port.family, Streaming::Cyclic)
}

/// The drive of an axis behind a port.
#[must_use]
pub fn of_axis(port: &PortConfig, axis: &AxisConfig) -> &'static dyn Drive {
    choose(axis.family.unwrap_or(port.family), axis.streaming)
}

fn choose(family: Family, streaming: Streaming) -> &'static dyn Drive {
    match (family, streaming) {
        (Family::Epos4, Streaming::Cyclic) => &Epos4,
        (Family::Epos4, Streaming::Profile) => &Epos4Profile,
        (Family::Epos2, _) => &Epos2,
    }
}

/// Which object plays which part in a family.
#[derive(Debug, Clone, Copy)]
pub struct Parts {
    /// The vendor of the drive, and its number: a known constant.
    pub vendor: Object<u32>,
    /// See `vendor`.
    pub vendor_number: u32,
    /// Product code.
    pub product: Object<u32>,
    /// Firmware version.
    pub version: Version,
    /// Serial number.
    pub serial_number: Object<u32>,
    /// Full serial number, 8 bytes; `None` if the family has none.
    pub full_serial_number: Option<Address>,
    /// Device name.
    pub device_name: Address,
    /// How long the drive waits for the rest of a frame, per interface, ms.
    pub frame_timeouts: &'static [Object<u16>],
    /// Commands to the state machine.
    pub controlword: Object<u16>,
    /// State of the state machine.
    pub statusword: Object<u16>,
    /// Mode of operation.
    pub mode: Object<i8>,
    /// Mode of operation in force.
    pub mode_display: Object<i8>,
    /// The mode in which every set-point acts at once.
    pub streaming_mode: i8,
    /// How a set-point takes effect in it.
    pub steering: Steering,
    /// The mode in which the drive looks for its zero.
    pub homing_mode: i8,
    /// How homing finds the zero.
    pub homing_method: Object<i8>,
    /// Set-point in `streaming_mode`, counts.
    pub target: Object<i32>,
    /// Lowest position that the drive goes to, counts; one of [`Drive::settings`].
    pub position_min: Object<i32>,
    /// Highest position that the drive goes to, counts; one of [`Drive::settings`].
    pub position_max: Object<i32>,
    /// Encoder position, counts.
    pub position: Object<i32>,
    /// The last error.
    pub error_code: Object<u16>,
    /// The last error stays there after it is gone.
    pub error_code_is_history: bool,
    /// Motor current, mA, signed.
    pub current: Address,
    /// Supply voltage, tenths of a volt; `None` where it is not known which object holds it.
    pub supply_voltage: Option<Object<u16>>,
}

/// Where the firmware version stands.
#[derive(Debug, Clone, Copy)]
pub enum Version {
    /// In the high word of an object.
    HighWord(Object<u32>),
    /// In an object of its own.
    Word(Object<u16>),
}

/// How a set-point takes effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Steering {
    /// By being written.
    Direct,
    /// By a rising edge of bit 4 of the controlword after it was written; the bit is lowered again
    /// before the next.
    Edge,
}

/// What homing needs to be told beforehand, and what is put back afterwards.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HomingPlan {
    method: i8,
    moves: bool,
    settings: Vec<Setting>,
    restored: Vec<Setting>,
}

/// Acceleration while the hard stop is looked for, rpm/s: at the slow speeds of homing it takes no
/// time.
const HOMING_ACCELERATION_RPM_S: u32 = 1000;

impl HomingPlan {
    /// The plan of an axis with its method. `at_stop` gives what a hard stop needs beside speeds,
    /// for a motor current in mA; an axis that is at home where it stands needs nothing.
    pub(super) fn new(
        axis: &AxisConfig,
        method: i8,
        at_stop: impl FnOnce(u32) -> [Setting; 3],
    ) -> Self {
        let moves = axis.homing != HomingMethod::Here;
        let mut settings = Vec::new();
        if moves {
            settings.extend(at_stop(axis.homing_current_ma));
            settings.extend([
                object::HOMING_SPEED.set(axis.homing_speed_rpm),
                object::HOMING_ZERO_SPEED.set(axis.homing_speed_rpm),
                object::HOMING_ACCELERATION.set(HOMING_ACCELERATION_RPM_S),
            ]);
        }
        Self {
            method,
            moves,
            settings,
            restored: Vec::new(),
        }
    }

    /// What is put back afterwards, if anything was changed.
    pub(super) fn with_restored(mut self, setting: Setting) -> Self {
        if self.moves {
            self.restored.push(setting);
        }
        self
    }

    /// The number of the method.
    #[must_use]
    pub fn method(&self) -> i8 {
        self.method
    }

    /// The motor moves.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.moves
    }

    /// Written and read back before.
    #[must_use]
    pub fn settings(&self) -> &[Setting] {
        &self.settings
    }

    /// Written and read back after.
    #[must_use]
    pub fn restored(&self) -> &[Setting] {
        &self.restored
    }
}

/// The position that an axis has when homing ends, counts.
pub(super) fn home_position(axis: &AxisConfig) -> i32 {
    if axis.homing == HomingMethod::Here {
        0
    } else {
        axis.homing_stop_counts.0
    }
}

/// A row of a table of errors: first and last code, name, reaction, and whether resetting it clears
/// the position.
pub(super) type Row = (u16, u16, &'static str, Reaction, bool);

/// Looks a code up.
pub(super) fn look_up(table: &[Row], code: u16) -> Fault {
    if code == 0 {
        return Fault {
            code,
            name: "no error",
            reaction: Reaction::Unknown,
            clears_position: false,
        };
    }
    match table
        .iter()
        .find(|(first, last, ..)| (*first..=*last).contains(&code))
    {
        Some(&(.., name, reaction, clears_position)) => Fault {
            code,
            name,
            reaction,
            clears_position,
        },
        None => Fault {
            code,
            name: "unknown error",
            reaction: Reaction::Unknown,
            clears_position: false,
        },
    }
}

/// What an error code means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// The code.
    pub code: u16,
    /// Its name.
    pub name: &'static str,
    /// What the drive does about it.
    pub reaction: Reaction,
    /// Resetting it clears the position: the axis must be homed again.
    pub clears_position: bool,
}

/// What a drive does about a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reaction {
    /// Power off at once, without a controlled stop.
    Off,
    /// As the fault-reaction option says: quick-stop ramp, then off.
    Ramp,
    /// As the abort-connection option says.
    ConnectionLost,
    /// Nothing: a warning.
    Warning,
    /// Not known for this code.
    Unknown,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} ({})", self.code, self.name)?;
        match self.reaction {
            Reaction::Off => write!(f, ", power off at once")?,
            Reaction::Ramp => write!(f, ", stopped by the ramp")?,
            Reaction::ConnectionLost => write!(f, ", stopped as its abort-connection option says")?,
            Reaction::Warning => write!(f, ", a warning only")?,
            Reaction::Unknown => {}
        }
        if self.clears_position {
            write!(f, "; the position is lost: home the axis")
        } else {
            Ok(())
        }
    }
}
