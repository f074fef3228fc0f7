//! The homing plan of an axis: method, and settings around it.

use crate::config::{AxisConfig, HomingMethod};
use crate::drive::object::{self, Address, Object, Setting};

/// Method and settings of homing, and the settings that are restored afterwards.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HomingPlan {
    method: i8,
    moves: bool,
    settings: Vec<Setting>,
    restored: Vec<Setting>,
}

/// Motor speed towards the hard stop, rpm.
const HOMING_SPEED_RPM: u32 = 20;

/// Acceleration while searching a hard stop, rpm/s: at homing speed it takes hardly any time.
const HOMING_ACCELERATION_RPM_S: u32 = 1000;

impl HomingPlan {
    /// The plan of an axis with the number of its method. `stop_settings` gives the settings for
    /// searching a hard stop, in addition to speeds, for a motor current in mA; homing at the
    /// present position needs none.
    pub(in crate::drive) fn new(
        axis: &AxisConfig,
        method: i8,
        stop_settings: impl FnOnce(u32) -> [Setting; 3],
    ) -> Self {
        let moves = axis.homing != HomingMethod::Here;
        let mut settings = Vec::new();
        if moves {
            settings.extend(stop_settings(axis.homing_current_ma));
            settings.extend([
                object::HOMING_SPEED.set(HOMING_SPEED_RPM),
                object::HOMING_ZERO_SPEED.set(HOMING_SPEED_RPM).if_present(),
                object::HOMING_ACCELERATION.set(HOMING_ACCELERATION_RPM_S).if_present(),
            ]);
        }
        Self { method, moves, settings, restored: Vec::new() }
    }

    /// Leaves out settings of objects that the drive does not have.
    pub(in crate::drive) fn leave_out(&mut self, objects: &[Address]) {
        self.settings.retain(|setting| !objects.contains(&setting.object));
    }

    /// Restores a setting afterwards, if it was changed.
    pub(in crate::drive) fn with_restored(mut self, setting: Setting) -> Self {
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

    /// The motor moves during homing.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.moves
    }

    /// Written and read back before homing.
    #[must_use]
    pub fn settings(&self) -> &[Setting] {
        &self.settings
    }

    /// Written and read back after homing.
    #[must_use]
    pub fn restored(&self) -> &[Setting] {
        &self.restored
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
