//! From a line to a drive that is known, switched off, and limited.
//!
//! These steps block, exchange after exchange. They run before the control loop starts, and again
//! on an axis that was lost and answers again.

use crate::config::AxisConfig;
use crate::units::Nanos;

use super::cia402::{Controlword, Goal, State, Statusword, Step, step};
use super::error::{AxisFault, LinkError};
use super::exchange::{LOCAL_NODE, Link, Repeat};
use super::family::{Parts, Version};
use super::object::{Address, Object, Setting, Value};
use super::transport::Transport;

/// How long a drive may take to go off, with its ramp.
const OFF_DEADLINE: Nanos = Nanos::from_millis(2000);

/// Between two looks at a state that has not changed yet.
const LOOK_AGAIN: Nanos = Nanos::from_millis(2);

/// Frame time-out that drives are given, ms: 50 is the least that they take. It is the silence that
/// frees a drive from half a request, so it should be short.
const FRAME_TIMEOUT_MS: u16 = 50;

/// Who answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AxisIdentity {
    /// The motor that it turns.
    pub motor: usize,
    /// Its node id, as configured.
    pub node_id: u8,
    /// Product code.
    pub product_code: u32,
    /// Firmware version, as maxon writes it in hexadecimal.
    pub firmware: u16,
    /// Serial number.
    pub serial_number: u32,
    /// Full serial number, if the drive tells it.
    pub full_serial_number: Option<u64>,
    /// Device name, if the drive tells it.
    pub name: Option<String>,
}

/// Learns the known constant of the line and shortens the frame time-out of the drive that the port
/// belongs to.
pub(super) fn know_line<T: Transport>(link: &mut Link<T>) -> Result<(), AxisFault> {
    let parts = link.drive().parts();
    // A controller that died may have asked something a moment ago.
    link.wait_for_quiet().map_err(|error| AxisFault::Exchange {
        object: parts.vendor.address(),
        error,
    })?;
    check_vendor(link, LOCAL_NODE, parts)?;
    let serial_number = read(link, LOCAL_NODE, parts.serial_number)?;
    link.know_serial_number(serial_number);
    let mut shortened = false;
    for object in parts.frame_timeouts {
        // A drive without this interface refuses its time-out, which is then not needed either.
        match link.write(LOCAL_NODE, object.set(FRAME_TIMEOUT_MS), Repeat::Safe) {
            Ok(_) => shortened |= read(link, LOCAL_NODE, *object)? == FRAME_TIMEOUT_MS,
            Err(LinkError::Refused(_)) => {}
            Err(error) => {
                return Err(AxisFault::Exchange {
                    object: object.address(),
                    error,
                });
            }
        }
    }
    if shortened {
        link.know_frame_timeout(Nanos::from_millis(u64::from(FRAME_TIMEOUT_MS)));
    }
    Ok(())
}

/// Learns the known constants of the line, and changes nothing.
pub(super) fn identify_only<T: Transport>(link: &mut Link<T>) -> Result<(), AxisFault> {
    let parts = link.drive().parts();
    link.wait_for_quiet().map_err(|error| AxisFault::Exchange {
        object: parts.vendor.address(),
        error,
    })?;
    check_vendor(link, LOCAL_NODE, parts)?;
    let serial_number = read(link, LOCAL_NODE, parts.serial_number)?;
    link.know_serial_number(serial_number);
    Ok(())
}

/// Checks that this is the drive that was configured.
pub(super) fn check_identity<T: Transport>(
    link: &mut Link<T>,
    axis: &AxisConfig,
    parts: &Parts,
) -> Result<(), AxisFault> {
    check_vendor(link, axis.node_id, parts)?;
    let expected = axis.serial_number;
    let found = read(link, axis.node_id, parts.serial_number)?;
    if found == expected {
        Ok(())
    } else {
        Err(AxisFault::SerialNumber { expected, found })
    }
}

fn check_vendor<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    parts: &Parts,
) -> Result<(), AxisFault> {
    let expected = parts.vendor_number;
    let found = read(link, node, parts.vendor)?;
    if found == expected {
        Ok(())
    } else {
        Err(AxisFault::Vendor { expected, found })
    }
}

/// Reads what tells drives apart.
pub(super) fn read_identity<T: Transport>(
    link: &mut Link<T>,
    axis: &AxisConfig,
    parts: &Parts,
) -> Result<AxisIdentity, AxisFault> {
    let node = axis.node_id;
    let full = parts
        .full_serial_number
        .and_then(|object| read_text(link, node, object));
    Ok(AxisIdentity {
        motor: axis.motor,
        node_id: node,
        product_code: read(link, node, parts.product)?,
        firmware: read_firmware(link, node, parts)?,
        serial_number: axis.serial_number,
        full_serial_number: full
            .and_then(|bytes| bytes.try_into().ok())
            .map(u64::from_le_bytes),
        name: read_text(link, node, parts.device_name)
            .and_then(|bytes| String::from_utf8(bytes).ok())
            .map(|name| name.trim_end_matches('\0').to_owned()),
    })
}

/// Firmware version, as maxon writes it in hexadecimal.
pub(super) fn read_firmware<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    parts: &Parts,
) -> Result<u16, AxisFault> {
    match parts.version {
        Version::HighWord(object) => Ok((read(link, node, object)? >> 16) as u16),
        Version::Word(object) => read(link, node, object),
    }
}

/// Good to know and no more: gateways do not carry it, and a drive may not have it.
fn read_text<T: Transport>(link: &mut Link<T>, node: u8, object: Address) -> Option<Vec<u8>> {
    link.read_long(node, object)
        .ok()
        .map(|read| read.bytes().to_vec())
}

/// Brings a drive that may still be enabled, by a controller that died, to power off, in order. A
/// drive that holds a fault is off, and the fault is left for the operator.
pub(super) fn switch_off<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    parts: &Parts,
) -> Result<State, AxisFault> {
    match drive_to(link, node, parts, Goal::Off) {
        Err(AxisFault::StillOn { .. }) => drive_to(link, node, parts, Goal::Cut),
        end => end,
    }
}

pub(super) fn drive_to<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    parts: &Parts,
    goal: Goal,
) -> Result<State, AxisFault> {
    let deadline = link.now() + OFF_DEADLINE;
    let mut commanded = None;
    loop {
        let state = read_state(link, node, parts)?;
        match step(state, goal) {
            Step::Reached | Step::Blocked => return Ok(state),
            // One command must take effect before the next.
            Step::Command(controlword) if commanded != Some(controlword) => {
                command(link, node, parts, controlword)?;
                commanded = Some(controlword);
            }
            Step::Command(_) | Step::Wait if link.now() > deadline => {
                return Err(AxisFault::StillOn { state });
            }
            Step::Command(_) | Step::Wait => link.sleep_until(link.now() + LOOK_AGAIN),
        }
    }
}

pub(super) fn read_state<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    parts: &Parts,
) -> Result<State, AxisFault> {
    let statusword = read(link, node, parts.statusword)?;
    Statusword(statusword)
        .state()
        .ok_or(AxisFault::UnknownState { statusword })
}

fn command<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    parts: &Parts,
    controlword: Controlword,
) -> Result<(), AxisFault> {
    write(link, node, parts.controlword.set(controlword.0))
}

/// Why a drive could not be stopped from outside the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StopError {
    /// The port is not open.
    #[error("the port could not be opened; cut the power of the drive")]
    NotHeld,
    /// Nothing answers.
    #[error("the drive does not answer; cut its power")]
    NoAnswer,
}

/// Stops a drive with its quick-stop ramp, whatever it is doing; it holds with power then. One
/// without power is left so.
pub(crate) fn quick_stop<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    parts: &Parts,
) -> Result<State, StopError> {
    // The command comes first, and blind: it does no harm to a drive without power but to make it
    // harder to switch on.
    let stop = parts.controlword.set(Controlword::QUICK_STOP.0);
    let _ = link.write(node, stop, Repeat::Safe);
    match drive_to(link, node, parts, Goal::Stopped) {
        Ok(state) | Err(AxisFault::StillOn { state }) => Ok(state),
        Err(_) => Err(StopError::NoAnswer),
    }
}

/// Exchanges that are timed at start.
const TIMED: usize = 21;

/// What half of the exchanges take at least, on a line that has nothing else to do.
pub(super) fn time_exchanges<T: Transport>(link: &mut Link<T>) -> Result<Nanos, AxisFault> {
    let vendor = link.drive().parts().vendor;
    let mut spans = [Nanos::ZERO; TIMED];
    for span in &mut spans {
        let begin = link.now();
        read(link, LOCAL_NODE, vendor)?;
        *span = link.now() - begin;
    }
    spans.sort_unstable();
    Ok(spans[TIMED / 2])
}

/// Writes all settings, then reads every one back and compares.
///
/// A setting may depend on another (the lowest limit must be below the highest), so a refusal
/// counts only once all the others stand.
pub(super) fn configure<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    settings: &[Setting],
) -> Result<(), AxisFault> {
    for &setting in settings {
        match write(link, node, setting) {
            Ok(())
            | Err(AxisFault::Exchange {
                error: LinkError::Refused(_),
                ..
            }) => {}
            Err(fault) => return Err(fault),
        }
    }
    for &setting in settings {
        if read_back(link, node, setting)? == setting.raw {
            continue;
        }
        write(link, node, setting)?;
        let (object, written, found) =
            (setting.object, setting.raw, read_back(link, node, setting)?);
        if found != written {
            return Err(AxisFault::ReadBack {
                object,
                written,
                found,
            });
        }
    }
    Ok(())
}

pub(super) fn read<T: Transport, V: Value>(
    link: &mut Link<T>,
    node: u8,
    object: Object<V>,
) -> Result<V, AxisFault> {
    link.read(node, object)
        .map_err(|error| AxisFault::Exchange {
            object: object.address(),
            error,
        })
}

pub(super) fn read_back<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    setting: Setting,
) -> Result<u32, AxisFault> {
    let object = setting.object;
    link.read_raw(node, object)
        .map(|answer| answer.value)
        .map_err(|error| AxisFault::Exchange { object, error })
}

fn write<T: Transport>(link: &mut Link<T>, node: u8, setting: Setting) -> Result<(), AxisFault> {
    link.write(node, setting, Repeat::Safe)
        .map(|_| ())
        .map_err(|error| AxisFault::Exchange {
            object: setting.object,
            error,
        })
}
