//! A family of drives: its command set, its objects, its settings and its errors.

use std::fmt;

use crate::config::{AxisConfig, Family, HomingMethod};
use crate::drive::command_set::CommandSet;
use crate::drive::drive_fault::{DriveFault, family_name};
use crate::drive::object::{self, Address, Object, Setting};

/// A family of drives. Implementations are constants: all state is in the port thread.
pub trait DriveFamily: fmt::Debug + Sync {
    /// The objects and modes that differ between families.
    fn object_map(&self) -> &'static ObjectMap;

    /// The limits and options of an axis: written at start, read back and compared.
    fn settings(&self, axis: &AxisConfig) -> Vec<Setting>;

    fn homing(&self, axis: &AxisConfig) -> HomingPlan;

    /// Name for messages.
    fn name(&self) -> &'static str {
        family_name(self.object_map().family)
    }

    /// The command set, for a port that belongs to a drive of this family.
    fn command_set(&self) -> &'static CommandSet {
        self.object_map().command_set
    }

    /// The meaning of an error code (`ObjectMap::error_code`).
    fn fault(&self, code: u16) -> DriveFault {
        DriveFault::look_up(self.object_map().family, code)
    }
}

/// The objects and modes that differ between families. The common objects are in `object`.
#[derive(Debug, Clone, Copy)]
pub struct ObjectMap {
    pub family: Family,
    pub command_set: &'static CommandSet,
    pub firmware_version: FirmwareVersion,
    /// Full serial number, 8 bytes; `None` if the family has none.
    pub full_serial_number: Option<Address>,
    /// The mode of operation that follows setpoints.
    pub streaming_mode: i8,
    pub setpoint_trigger: SetpointTrigger,
    /// Setpoint in `streaming_mode`, counts.
    pub target: Object<i32>,
    pub error_code: Object<u16>,
    /// The last error remains after the fault is cleared.
    pub error_code_is_history: bool,
    /// Motor current, mA, signed.
    pub current: Address,
    /// Supply voltage, tenths of a volt; `None` if its object is unknown.
    pub supply_voltage: Option<Object<u16>>,
}

#[derive(Debug, Clone, Copy)]
pub enum FirmwareVersion {
    HighWord(Object<u32>),
    Word(Object<u16>),
}

/// Event at which a setpoint takes effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SetpointTrigger {
    Write,
    /// On a rising edge of controlword bit 4 after writing; the bit is lowered afterwards.
    Edge,
}

/// Method and settings of homing, and the settings that are restored afterwards.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HomingPlan {
    pub method: i8,
    pub moves: bool,
    /// Written and read back before homing.
    pub settings: Vec<Setting>,
    /// Written and read back after homing.
    pub restored: Vec<Setting>,
}

/// Motor speed towards the hard stop, rpm.
const HOMING_SPEED_RPM: u32 = 20;

/// Acceleration while searching a hard stop, rpm/s: at homing speed it takes hardly any time.
const HOMING_ACCELERATION_RPM_S: u32 = 1000;

impl HomingPlan {
    /// The plan of an axis. `here`: the number of the method that takes the present position as
    /// home. `stop_settings` gives the settings for searching a hard stop, in addition to speeds,
    /// for a motor current in mA, and `restored` the one that is restored afterwards; homing at the
    /// present position needs none.
    pub(in crate::drive) fn new(
        axis: &AxisConfig,
        here: i8,
        stop_settings: impl FnOnce(u32) -> [Setting; 3],
        restored: Setting,
    ) -> Self {
        // At a hard stop found by the current, without an index.
        let (method, moves) = match axis.homing {
            HomingMethod::Here => (here, false),
            HomingMethod::StopPositive => (-3, true),
            HomingMethod::StopNegative => (-4, true),
        };
        let (mut settings, mut after) = (Vec::new(), Vec::new());
        if moves {
            after.push(restored);
            settings.extend(stop_settings(axis.homing_current_ma));
            settings.extend([
                object::HOMING_SPEED.set(HOMING_SPEED_RPM),
                object::HOMING_ZERO_SPEED.set(HOMING_SPEED_RPM).if_present(),
                object::HOMING_ACCELERATION.set(HOMING_ACCELERATION_RPM_S).if_present(),
            ]);
        }
        Self { method, moves, settings, restored: after }
    }

    /// Leaves out settings of objects that the drive does not have.
    pub(in crate::drive) fn leave_out(&mut self, objects: &[Address]) {
        self.settings.retain(|setting| !objects.contains(&setting.object));
    }
}

/// The position at the end of homing: 0 is also that of a drive without the object.
pub(in crate::drive) fn home_position(object: Object<i32>, axis: &AxisConfig) -> Setting {
    match axis.homing {
        HomingMethod::Here => object.set(0).if_present(),
        HomingMethod::StopPositive | HomingMethod::StopNegative => {
            object.set(axis.homing_stop_counts.0)
        }
    }
}
