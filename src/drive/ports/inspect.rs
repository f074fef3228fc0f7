//! Inspection of drives: reads their state, and writes nothing.

use crate::config::{AxisConfig, PortConfig};
use crate::drive::bring_up::{DriveNode, explain, learn_constants, time_exchanges};
use crate::drive::cia402::{DriveState, Statusword};
use crate::drive::drive_fault::DriveFault;
use crate::drive::error::{AxisError, DriveError, DriveModel, SettingError, SettingRefusal};
use crate::drive::family_selection::{family_of_axis, family_of_port};
use crate::drive::link::DriveLink;
use crate::drive::object::{self, Address, Value};
use crate::drive::serial_transport::SerialTransport;
use crate::drive::survey::unhurried;
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// At most this many entries of the error history are read.
const MAX_ERRORS: u8 = 5;

#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    pub motor: usize,
    pub family: &'static str,
    pub serial_number: u32,
    /// Firmware version, in hexadecimal as maxon writes it.
    pub firmware: u16,
    /// State of its state machine; `None`: unknown.
    pub state: Option<DriveState>,
    pub homed: bool,
    /// Supply voltage, volts; `None` if its object is unknown.
    pub supply_v: Option<f64>,
    /// The newest errors, the last one first.
    pub errors: Vec<DriveFault>,
    /// Settings that the controller would change: object, as configured, as read.
    pub differences: Vec<(Address, u32, u32)>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct PortInspection {
    /// Median duration of an exchange.
    pub exchange: Nanos,
    /// The drives in the order of the configuration, or why one is not the configured drive.
    pub axes: Vec<Result<Inspection, String>>,
}

/// Opens a port and inspects its drives. Fails when the port cannot be opened, or nothing answers.
pub fn inspect(config: &PortConfig) -> Result<PortInspection, DriveError> {
    let (line, config) = (SerialTransport::open(config)?, &unhurried(config));
    inspect_link(&mut DriveLink::new(line, family_of_port(config), config), config)
}

/// Inspects the drives on an open line, see [`inspect`]. Fails when nothing answers.
pub fn inspect_link(
    link: &mut DriveLink<impl Transport>,
    config: &PortConfig,
) -> Result<PortInspection, DriveError> {
    let Some(first) = config.axes.first() else {
        return Ok(PortInspection { exchange: Nanos::ZERO, axes: Vec::new() });
    };
    let [_, exchange] = learn_constants(link)
        .and_then(|()| time_exchanges(link))
        .map_err(|error| explain(config, first, error))?;
    let inspect_axis = |axis: &AxisConfig| {
        inspect_axis(link, config, axis).map_err(|error| explain(config, axis, error).to_string())
    };
    Ok(PortInspection { exchange, axes: config.axes.iter().map(inspect_axis).collect() })
}

fn inspect_axis(
    link: &mut DriveLink<impl Transport>,
    config: &PortConfig,
    axis: &AxisConfig,
) -> Result<Inspection, AxisError> {
    let family = family_of_axis(config, axis);
    let map = family.object_map();
    let mut drive = DriveNode::new(link, axis.node_id);
    drive.check_identity(axis.serial_number)?;
    let statusword = Statusword(drive.read(object::STATUSWORD)?);
    let supply = map.supply_voltage.map(|object| drive.read_if_present(object.address()));
    let supply_v = supply.transpose()?.flatten().map(|raw| f64::from(u16::from_raw(raw)) / 10.0);
    let firmware = drive.read_firmware(map.firmware_version)?;
    let mut errors = Vec::new();
    let count = drive.read_if_present(object::ERROR_HISTORY.address())?.unwrap_or(0);
    for subindex in 1..=u8::from_raw(count).min(MAX_ERRORS) {
        let entry = Address { subindex, ..object::NEWEST_ERROR.address() };
        // The error code is the low word of an entry.
        let code = drive.read_if_present(entry)?.map(u16::from_raw);
        errors.extend(code.map(|code| family.fault(code)));
    }
    let mut differences = Vec::new();
    for setting in family.settings(axis) {
        if setting.object == object::MODE.address() {
            continue;
        }
        match drive.read_if_present(setting.object)? {
            Some(found) if found == setting.raw => {}
            Some(found) => differences.push((setting.object, setting.raw, found)),
            None if setting.optional => {}
            None => {
                let product_code = drive.read(object::PRODUCT)?;
                let drive = DriveModel { family: family.name(), product_code, firmware };
                let why = SettingRefusal::Missing;
                return Err(AxisError::Setting(SettingError { setting, drive, why }));
            }
        }
    }
    Ok(Inspection {
        motor: axis.motor,
        family: family.name(),
        serial_number: axis.short_serial_number(),
        firmware,
        state: statusword.state(),
        homed: statusword.homed(),
        supply_v,
        errors,
        differences,
    })
}
