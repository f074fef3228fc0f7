//! A family of drives: its command set, its objects, its settings and its errors.

use std::fmt;

use crate::config::AxisConfig;
use crate::drive::command_set::CommandSet;
use crate::drive::drive_fault::DriveFault;
use crate::drive::homing_plan::HomingPlan;
use crate::drive::object::{Address, Object, Setting};

/// A family of drives.
///
/// Implementations are constants without state; all state is in the port thread.
pub trait DriveFamily: fmt::Debug + Sync {
    /// Name for messages.
    fn name(&self) -> &'static str;

    /// The command set, for a port that belongs to a drive of this family.
    fn command_set(&self) -> &'static CommandSet;

    /// The objects and modes that differ between families.
    fn object_map(&self) -> &'static ObjectMap;

    /// The limits and options of an axis: written at start, read back and compared.
    fn settings(&self, axis: &AxisConfig) -> Vec<Setting>;

    /// How an axis is homed.
    fn homing(&self, axis: &AxisConfig) -> HomingPlan;

    /// The meaning of an error code (`ObjectMap::error_code`).
    fn fault(&self, code: u16) -> DriveFault;
}

/// The objects and modes that differ between families. The common objects are in `object`.
#[derive(Debug, Clone, Copy)]
pub struct ObjectMap {
    pub firmware_version: FirmwareVersion,
    /// Full serial number, 8 bytes; `None` if the family has none.
    pub full_serial_number: Option<Address>,
    /// The mode of operation that follows setpoints.
    pub streaming_mode: i8,
    /// How a setpoint takes effect in it.
    pub setpoint_trigger: SetpointTrigger,
    /// Setpoint in `streaming_mode`, counts.
    pub target: Object<i32>,
    /// The last error.
    pub error_code: Object<u16>,
    /// The last error remains after the fault is cleared.
    pub error_code_is_history: bool,
    /// Motor current, mA, signed.
    pub current: Address,
    /// Supply voltage, tenths of a volt; `None` if its object is unknown.
    pub supply_voltage: Option<Object<u16>>,
}

/// Location of the firmware version.
#[derive(Debug, Clone, Copy)]
pub enum FirmwareVersion {
    /// The high word of an object.
    HighWord(Object<u32>),
    /// An object of its own.
    Word(Object<u16>),
}

/// Event at which a setpoint takes effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SetpointTrigger {
    /// When it is written.
    Write,
    /// On a rising edge of controlword bit 4 after writing; the bit is lowered again before the
    /// next setpoint.
    Edge,
}
