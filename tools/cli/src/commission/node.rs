//! A drive on a line: reading it and cutting its power.

use i2ris::config::{AxisConfig, PortConfig, Streaming};
use i2ris::drive::cia402::{Controlword, DriveState, Statusword};
use i2ris::drive::link::{DriveLink, Retry};
use i2ris::drive::object::{self, Object, Setting, Value};
use i2ris::drive::{DriveFamily, error::AxisError};
use i2ris::drive::{family_selection::family_of_axis, transport::Transport};
use i2ris::units::Nanos;

use super::watch::PowerCutReason;

/// Attempts to cut the power: the first may meet a line out of sync.
const CUTS: usize = 4;
/// Current setpoint of an EPOS2, mA.
const EPOS2_CURRENT: Object<i16> = Object::of(0x2030, 0);
/// Torque setpoint of an EPOS4, thousandths of the torque at the nominal current.
const EPOS4_TORQUE: Object<i16> = Object::of(0x6071, 0);
const EPOS4_NOMINAL_MA: Object<u32> = Object::of(0x3001, 1);

pub struct Node<'a, T> {
    pub link: &'a mut DriveLink<T>,
    pub axis: AxisConfig,
    pub family: &'static dyn DriveFamily,
    pub is_interrupted: &'a dyn Fn() -> bool,
}

impl<'a, T: Transport> Node<'a, T> {
    /// The drive of an axis, in the mode in which every setpoint acts at once.
    pub fn new(
        link: &'a mut DriveLink<T>,
        port: &PortConfig,
        axis: &AxisConfig,
        is_interrupted: &'a dyn Fn() -> bool,
    ) -> Self {
        let axis = AxisConfig { streaming: Streaming::Cyclic, ..axis.clone() };
        Self { family: family_of_axis(port, &axis), link, axis, is_interrupted }
    }

    pub fn is_epos2(&self) -> bool {
        self.family.name() == "EPOS2"
    }

    pub fn read<V: Value>(&mut self, object: Object<V>) -> Result<V, AxisError> {
        let outcome = self.link.read(self.axis.node_id, object);
        outcome.map_err(|error| AxisError::Exchange { object: object.address(), error })
    }

    /// Writes a setting; for [`super::guard`] only. Returns the time of sending.
    pub(super) fn write(&mut self, setting: Setting, retry: Retry) -> Result<Nanos, AxisError> {
        let outcome = self.link.write(self.axis.node_id, setting, retry);
        let object = setting.object;
        outcome.map(|reply| reply.sent).map_err(|error| AxisError::Exchange { object, error })
    }

    pub fn state(&mut self) -> Result<DriveState, AxisError> {
        let statusword = self.read(object::STATUSWORD)?;
        Statusword(statusword).state().ok_or(AxisError::UnknownState(statusword))
    }

    pub fn fault(&mut self) -> u16 {
        self.read(self.family.object_map().error_code).unwrap_or(0)
    }

    pub fn current_unit_ma(&mut self) -> Result<f64, AxisError> {
        if self.is_epos2() {
            return Ok(1.0);
        }
        Ok(f64::from(self.read(EPOS4_NOMINAL_MA)?) / 1000.0)
    }

    /// A current setpoint, in units of the resolution.
    pub(super) fn current(&self, units: f64) -> Setting {
        let units = units.round() as i16;
        if self.is_epos2() { EPOS2_CURRENT.set(units) } else { EPOS4_TORQUE.set(units) }
    }

    /// Acknowledges a fault; the power stays off. Returns the state after it.
    pub fn reset_fault(&mut self) -> Result<DriveState, AxisError> {
        for word in [Controlword::DISABLE_VOLTAGE, Controlword::FAULT_RESET] {
            self.write(object::CONTROLWORD.set(word.0), Retry::Safe)?;
        }
        self.write(object::CONTROLWORD.set(0), Retry::Safe)?;
        self.state()
    }

    /// Cuts the power. `Ok`: the power is confirmed to be off.
    pub fn cut(&mut self) -> Result<(), PowerCutReason> {
        let mut last = PowerCutReason::Interrupted;
        for _ in 0..CUTS {
            let cut = object::CONTROLWORD.set(Controlword::DISABLE_VOLTAGE.0);
            match self.write(cut, Retry::Safe).and_then(|_| self.state()) {
                Ok(state) if state.is_off() || state == DriveState::Fault => return Ok(()),
                Ok(state) => last = PowerCutReason::Switched(state),
                Err(error) => last = PowerCutReason::Drive(error),
            }
        }
        Err(PowerCutReason::NotOff(Box::new(last)))
    }
}
