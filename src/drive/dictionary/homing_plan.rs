//! The homing plan of an axis: method, and settings around it.

use crate::config::{AxisConfig, HomingMethod};
use crate::drive::object::{self, Address, Object, Setting};

/// Method and settings of homing, and the settings that are restored afterwards.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HomingPlan {
    /// The number of the method.
    pub method: i8,
    /// The motor moves during homing.
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

/// The position that an axis gets at the end of homing: 0 is also that of a drive without the
/// object.
pub(in crate::drive) fn home_position(object: Object<i32>, axis: &AxisConfig) -> Setting {
    match axis.homing {
        HomingMethod::Here => object.set(0).if_present(),
        HomingMethod::StopPositive | HomingMethod::StopNegative => {
            object.set(axis.homing_stop_counts.0)
        }
    }
}
