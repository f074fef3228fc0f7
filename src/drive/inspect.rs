//! Looking at drives without touching them: nothing is written, nothing is switched.

use crate::config::{AxisConfig, PortConfig};
use crate::units::Nanos;

use super::bring_up::{self, identify_only};
use super::cia402::{State, Statusword};
use super::error::{AxisFault, DriveError};
use super::exchange::Link;
use super::family::{self, Fault, Parts};
use super::object::{self, Address, Object, Setting};
use super::port::explain;
use super::serial::SerialTransport;
use super::transport::Transport;

/// The most entries of the error history that are read.
const MOST_ERRORS: u8 = 5;

/// What one drive shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    /// The motor that it turns.
    pub motor: usize,
    /// What it is called by us.
    pub family: &'static str,
    /// Serial number as read.
    pub serial_number: u32,
    /// Firmware version, as maxon writes it in hexadecimal.
    pub firmware: u16,
    /// Where its state machine stands; `None`: nowhere known.
    pub state: Option<State>,
    /// It knows its zero.
    pub homed: bool,
    /// Supply voltage, volts, where it is known which object holds it.
    pub supply_v: Option<f64>,
    /// The newest errors, the last one first.
    pub errors: Vec<Fault>,
    /// Settings that differ from the configuration: what, as configured, as found. The controller
    /// writes them at its start.
    pub differences: Vec<(Address, u32, u32)>,
}

/// What a port shows.
#[derive(Debug, Clone, PartialEq)]
pub struct PortInspection {
    /// What half of the exchanges take at least.
    pub exchange: Nanos,
    /// Its drives in the order of the configuration, or why one is not what it should be.
    pub axes: Vec<Result<Inspection, String>>,
}

/// Opens a port and looks at every drive behind it.
///
/// # Errors
///
/// When the port cannot be opened, or nothing answers.
pub fn inspect(config: &PortConfig) -> Result<PortInspection, DriveError> {
    inspect_over(SerialTransport::open(config)?, config)
}

/// As [`inspect`], over a line that is open already.
///
/// # Errors
///
/// When nothing answers.
pub fn inspect_over<T: Transport>(
    transport: T,
    config: &PortConfig,
) -> Result<PortInspection, DriveError> {
    let mut link = Link::new(transport, family::of_port(config), config);
    let Some(first) = config.axes.first() else {
        return Ok(PortInspection {
            exchange: Nanos::ZERO,
            axes: Vec::new(),
        });
    };
    identify_only(&mut link).map_err(|fault| explain(config, first, fault))?;
    let exchange =
        bring_up::time_exchanges(&mut link).map_err(|fault| explain(config, first, fault))?;
    let look = |axis: &AxisConfig| {
        inspect_axis(&mut link, config, axis)
            .map_err(|fault| explain(config, axis, fault).to_string())
    };
    Ok(PortInspection {
        exchange,
        axes: config.axes.iter().map(look).collect(),
    })
}

fn inspect_axis<T: Transport>(
    link: &mut Link<T>,
    config: &PortConfig,
    axis: &AxisConfig,
) -> Result<Inspection, AxisFault> {
    let (drive, node) = (family::of_axis(config, axis), axis.node_id);
    let parts = drive.parts();
    bring_up::check_identity(link, axis, parts)?;
    let statusword = Statusword(bring_up::read(link, node, parts.statusword)?);
    let supply = match parts.supply_voltage {
        Some(object) => Some(f64::from(bring_up::read(link, node, object)?) / 10.0),
        None => None,
    };
    Ok(Inspection {
        motor: axis.motor,
        family: drive.name(),
        serial_number: axis.serial_number,
        firmware: bring_up::read_firmware(link, node, parts)?,
        state: statusword.state(),
        homed: statusword.homed(),
        supply_v: supply,
        errors: history(link, node)?
            .into_iter()
            .map(|code| drive.fault(code))
            .collect(),
        differences: differences(link, node, &drive.settings(axis), parts)?,
    })
}

fn history<T: Transport>(link: &mut Link<T>, node: u8) -> Result<Vec<u16>, AxisFault> {
    let count = bring_up::read(link, node, object::ERROR_HISTORY)?.min(MOST_ERRORS);
    // The error code is the low word of an entry.
    let entry = |place| {
        Object::<u16>::new(
            object::ERROR_HISTORY.address().index,
            place,
            "error history",
        )
    };
    (1..=count)
        .map(|place| bring_up::read(link, node, entry(place)))
        .collect()
}

fn differences<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    settings: &[Setting],
    parts: &Parts,
) -> Result<Vec<(Address, u32, u32)>, AxisFault> {
    let mut differences = Vec::new();
    for &setting in settings
        .iter()
        .filter(|setting| setting.object != parts.mode.address())
    {
        let found = bring_up::read_back(link, node, setting)?;
        if found != setting.raw {
            differences.push((setting.object, setting.raw, found));
        }
    }
    Ok(differences)
}
