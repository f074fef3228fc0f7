//! Bring-up: from a line to a drive that is identified, switched off, and limited.
//!
//! These steps block for many exchanges. They run before the control loop starts, and again on a
//! lost axis that answers again.

use crate::config::{AxisConfig, Family, PortConfig};
use crate::drive::cia402::{DriveState, PowerGoal, PowerStep, Statusword, power_step};
use crate::drive::error::{
    AxisError, DriveError, DriveModel, LinkError, SettingError, SettingRefusal,
};
use crate::drive::family::{DriveFamily, FirmwareVersion};
use crate::drive::family_selection::family_of_port;
use crate::drive::link::{DriveLink, LOCAL_NODE, Retry};
use crate::drive::object::{self, AbortCode, Address, Object, Setting, Value};
use crate::drive::objects;
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// How long a drive may take to switch off, with its ramp.
const OFF_TIMEOUT: Nanos = Nanos::from_millis(2000);

/// Period of reading a state that has not changed yet.
const POLL_PERIOD: Nanos = Nanos::from_millis(2);

/// Frame timeout for the drives, ms; 50 is the smallest value (0x2005, 0x2006). After this silence
/// a drive discards an incomplete request, so it should be short.
const FRAME_TIMEOUT_MS: u16 = 50;

/// Called between two exchanges with a drive.
type Interlude<'a, T> = &'a mut dyn FnMut(&mut DriveLink<T>);

pub(in crate::drive) struct DriveNode<'a, T> {
    link: &'a mut DriveLink<T>,
    node: u8,
    interlude: Option<Interlude<'a, T>>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AxisIdentity {
    pub motor: usize,
    pub node_id: u8,
    pub model: DriveModel,
    /// Objects that the drive does not have; they are left out.
    pub left_out: Vec<Address>,
    pub serial_number: u32,
    /// Full serial number, if the drive has one.
    pub full_serial_number: Option<u64>,
    /// Device name, if the drive has one.
    pub name: Option<String>,
}

impl<'a, T: Transport> DriveNode<'a, T> {
    pub(in crate::drive) fn new(link: &'a mut DriveLink<T>, node: u8) -> Self {
        Self { link, node, interlude: None }
    }

    /// Calls this after every exchange: the line may have other drives that must not wait.
    pub(in crate::drive) fn with_interlude(mut self, interlude: Interlude<'a, T>) -> Self {
        self.interlude = Some(interlude);
        self
    }

    /// Checks that this is the configured drive. Of its number, the lower half counts.
    pub(in crate::drive) fn check_identity(&mut self, expected: u64) -> Result<(), AxisError> {
        // A gateway answers in the place of a node that is off, but only after a time-out of its
        // own. While other axes are served, the thread does not wait for that.
        self.link.wait_for_gateway(self.interlude.is_none());
        let found = self.check_vendor().and_then(|()| self.read(object::SERIAL_NUMBER));
        self.link.wait_for_gateway(false);
        match found? {
            found if found == expected as u32 => Ok(()),
            found => Err(AxisError::SerialNumber { expected, found }),
        }
    }

    fn check_vendor(&mut self) -> Result<(), AxisError> {
        let expected = object::MAXON;
        let found = self.read(object::VENDOR)?;
        if found == expected { Ok(()) } else { Err(AxisError::Vendor { expected, found }) }
    }

    pub(in crate::drive) fn read_identity(
        &mut self,
        axis: &AxisConfig,
        family: &dyn DriveFamily,
    ) -> Result<AxisIdentity, AxisError> {
        let full = family.object_map().full_serial_number;
        let full = full.and_then(|object| self.read_bytes(object));
        let name = self.read_bytes(object::DEVICE_NAME);
        let name = name.and_then(|bytes| String::from_utf8(bytes).ok());
        Ok(AxisIdentity {
            motor: axis.motor,
            node_id: self.node,
            model: self.read_model(family)?,
            left_out: Vec::new(),
            serial_number: axis.short_serial_number(),
            full_serial_number: full
                .and_then(|bytes| bytes.try_into().ok())
                .map(u64::from_le_bytes),
            name: name.map(|name| name.trim_end_matches('\0').to_owned()),
        })
    }

    fn read_model(&mut self, family: &dyn DriveFamily) -> Result<DriveModel, AxisError> {
        Ok(DriveModel {
            family: family.name(),
            product_code: self.read(object::PRODUCT)?,
            firmware: self.read_firmware(family.object_map().firmware_version)?,
        })
    }

    /// Firmware version, in hexadecimal as maxon writes it.
    pub(in crate::drive) fn read_firmware(
        &mut self,
        version: FirmwareVersion,
    ) -> Result<u16, AxisError> {
        match version {
            FirmwareVersion::HighWord(object) => Ok((self.read(object)? >> 16) as u16),
            FirmwareVersion::Word(object) => self.read(object),
        }
    }

    /// An optional value: gateways forward no segmented reads, and drives may lack the object.
    fn read_bytes(&mut self, object: Address) -> Option<Vec<u8>> {
        let read = self.link.read_segmented(self.node, object).ok()?;
        Some(read.bytes().to_vec())
    }

    /// Switches the drive off by its ramp: a killed controller may have left it enabled. A drive
    /// with a fault is already off; the operator resets the fault.
    pub(in crate::drive) fn switch_off(&mut self) -> Result<(), AxisError> {
        match self.go_to(PowerGoal::Off) {
            Err(AxisError::PowerStageStillOn(_)) => self.go_to(PowerGoal::Cut)?,
            outcome => outcome?,
        };
        Ok(())
    }

    /// Brings a drive that has power to a quick stop, in which it holds. Whether it does.
    pub(in crate::drive) fn hold(&mut self) -> Result<bool, AxisError> {
        match self.go_to(PowerGoal::Stopped) {
            Ok(state) => Ok(state == DriveState::QuickStopActive),
            Err(AxisError::PowerStageStillOn(_)) => Ok(false),
            Err(error) => Err(error),
        }
    }

    fn go_to(&mut self, goal: PowerGoal) -> Result<DriveState, AxisError> {
        let deadline = self.link.now() + OFF_TIMEOUT;
        let mut commanded = None;
        loop {
            let statusword = self.read(object::STATUSWORD)?;
            let state = Statusword(statusword).state();
            let state = state.ok_or(AxisError::UnknownState(statusword))?;
            match power_step(state, goal) {
                PowerStep::Reached | PowerStep::Blocked => return Ok(state),
                // A command must take effect before the next one.
                PowerStep::Command(controlword) if commanded != Some(controlword) => {
                    self.write(object::CONTROLWORD.set(controlword.0))?;
                    commanded = Some(controlword);
                }
                PowerStep::Command(_) | PowerStep::Wait if self.link.now() > deadline => {
                    return Err(AxisError::PowerStageStillOn(state));
                }
                PowerStep::Command(_) | PowerStep::Wait => {
                    self.link.sleep_until(self.link.now() + POLL_PERIOD);
                }
            }
        }
    }

    /// Writes all settings, then reads every setting back and compares. `left_out` receives the
    /// missing objects that the drive can do without. A setting may depend on another (the lower
    /// limit must be below the upper), so a refusal counts only after all others were written.
    pub(in crate::drive) fn configure(
        &mut self,
        settings: &[Setting],
        drive: DriveModel,
        left_out: &mut dyn FnMut(Address),
    ) -> Result<(), AxisError> {
        for &setting in settings {
            self.try_write(setting)?;
        }
        for &setting in settings {
            match self.settle(setting)? {
                None => {}
                Some(SettingRefusal::Missing) if setting.optional => left_out(setting.object),
                Some(why) => {
                    return Err(AxisError::Setting(SettingError { setting, drive, why }));
                }
            }
        }
        Ok(())
    }

    /// Whether the drive holds a setting; if not, it is written once more. Why it does not take it.
    fn settle(&mut self, setting: Setting) -> Result<Option<SettingRefusal>, AxisError> {
        let held = match self.read_raw(setting.object) {
            Ok(held) if held == setting.raw => return Ok(None),
            Ok(held) => held,
            Err(error) => {
                return match refusal(&error) {
                    Some(code) if code.is_missing() => Ok(Some(SettingRefusal::Missing)),
                    Some(code) => Ok(Some(SettingRefusal::Refused(code))),
                    None => Err(error),
                };
            }
        };
        match self.try_write(setting)? {
            Some(code) if code.is_range() => return self.find_limit(setting, held, code).map(Some),
            Some(code) => return Ok(Some(SettingRefusal::Refused(code))),
            None => {}
        }
        let found = self.read_raw(setting.object)?;
        let kind = objects::first(setting.object.index, setting.object.subindex).kind;
        Ok((found != setting.raw).then_some(SettingRefusal::Keeps(kind.decode(found))))
    }

    /// The limit of the drive between the value that it holds and the one that it refused, found by
    /// writing: no object reports it. Afterwards the drive holds its former value, with power off.
    fn find_limit(
        &mut self,
        setting: Setting,
        held: u32,
        code: AbortCode,
    ) -> Result<SettingRefusal, AxisError> {
        let kind = objects::first(setting.object.index, setting.object.subindex).kind;
        let with = |raw: u32| Setting { raw: setting.object.truncate(raw), ..setting };
        if self.try_write(with(held))?.is_some() {
            // It refuses whatever the value is.
            return Ok(SettingRefusal::Refused(code));
        }
        let (mut taken, mut refused) = (kind.decode(held), kind.decode(setting.raw));
        while taken.abs_diff(refused) > 1 {
            let middle = taken.midpoint(refused);
            match self.try_write(with(middle as u32))? {
                None => taken = middle,
                Some(_) => refused = middle,
            }
        }
        self.try_write(with(held))?;
        let is_upper = taken < refused;
        Ok(if is_upper { SettingRefusal::AtMost(taken) } else { SettingRefusal::AtLeast(taken) })
    }

    /// Writes a setting; `Some`: the drive refused it.
    fn try_write(&mut self, setting: Setting) -> Result<Option<AbortCode>, AxisError> {
        match self.write(setting) {
            Ok(()) => Ok(None),
            Err(error) => refusal(&error).map(Some).ok_or(error),
        }
    }

    /// Reads an object; `None`: the drive does not have it.
    pub(in crate::drive) fn read_if_present(
        &mut self,
        object: Address,
    ) -> Result<Option<u32>, AxisError> {
        match self.read_raw(object) {
            Err(error) if refusal(&error).is_some_and(AbortCode::is_missing) => Ok(None),
            outcome => outcome.map(Some),
        }
    }

    pub(in crate::drive) fn read<V: Value>(&mut self, object: Object<V>) -> Result<V, AxisError> {
        self.read_raw(object.address()).map(V::from_raw)
    }

    fn read_raw(&mut self, object: Address) -> Result<u32, AxisError> {
        let outcome = match self.interlude {
            Some(_) => self.link.read_promptly(self.node, object),
            None => self.link.read_raw(self.node, object),
        };
        self.end_exchange(object, outcome.map(|reply| reply.value))
    }

    fn write(&mut self, setting: Setting) -> Result<(), AxisError> {
        let others_wait = self.interlude.is_some();
        let retry = if others_wait { self.link.prompt(Retry::Safe) } else { Retry::Safe };
        let outcome = self.link.write(self.node, setting, retry);
        self.end_exchange(setting.object, outcome.map(|_| ()))
    }

    fn end_exchange<R>(
        &mut self,
        object: Address,
        outcome: Result<R, LinkError>,
    ) -> Result<R, AxisError> {
        if let Some(interlude) = &mut self.interlude {
            interlude(self.link);
        }
        outcome.map_err(|error| AxisError::Exchange { object, error })
    }
}

/// Why the drive refused a request, if that is the error.
fn refusal(error: &AxisError) -> Option<AbortCode> {
    match error {
        AxisError::Exchange { error: LinkError::Refused(code), .. } => Some(*code),
        _ => None,
    }
}

/// Writes the limits of an axis whose power stage is off, reads them back and compares. Returns the
/// objects that the drive does not have and can do without. Fails when the drive does not answer,
/// or does not take a limit.
pub fn configure_axis(
    link: &mut DriveLink<impl Transport>,
    family: &dyn DriveFamily,
    axis: &AxisConfig,
) -> Result<Vec<Address>, AxisError> {
    let mut drive = DriveNode::new(link, axis.node_id);
    let model = drive.read_model(family)?;
    let mut left_out = Vec::new();
    drive.configure(&family.settings(axis), model, &mut |object| left_out.push(object))?;
    Ok(left_out)
}

/// Switches a drive off by its ramp, or cuts its power. Fails when it is silent, or stays on.
pub fn switch_off(link: &mut DriveLink<impl Transport>, node: u8) -> Result<(), AxisError> {
    DriveNode::new(link, node).switch_off()
}

/// Learns the constants of the line and shortens the frame timeout of its first drive.
pub(in crate::drive) fn prepare_line(
    link: &mut DriveLink<impl Transport>,
) -> Result<(), AxisError> {
    learn_constants(link)?;
    let mut drive = DriveNode::new(link, LOCAL_NODE);
    let mut is_short = false;
    for object in object::FRAME_TIMEOUTS {
        // A drive without this interface refuses its timeout.
        if drive.try_write(object.set(FRAME_TIMEOUT_MS))?.is_none() {
            is_short |= drive.read(object)? == FRAME_TIMEOUT_MS;
        }
    }
    if is_short {
        link.set_frame_timeout(Nanos::from_millis(u64::from(FRAME_TIMEOUT_MS)));
    }
    Ok(())
}

/// Learns the known constants of the line: vendor and serial number. Writes nothing.
pub(in crate::drive) fn learn_constants(
    link: &mut DriveLink<impl Transport>,
) -> Result<(), AxisError> {
    let mut drive = DriveNode::new(link, LOCAL_NODE);
    let object = object::VENDOR.address();
    // The reply to a request of a previous controller may still arrive.
    let quiet = drive.link.wait_for_quiet();
    quiet.map_err(|error| AxisError::Exchange { object, error })?;
    drive.check_vendor()?;
    let serial_number = drive.read(object::SERIAL_NUMBER)?;
    link.set_serial_number(serial_number);
    Ok(())
}

/// Exchanges that are timed at start.
const TIMED_EXCHANGES: usize = 21;

/// Lower quartile and median of the exchange time on a line without other traffic.
pub(in crate::drive) fn time_exchanges(
    link: &mut DriveLink<impl Transport>,
) -> Result<[Nanos; 2], AxisError> {
    let mut drive = DriveNode::new(link, LOCAL_NODE);
    let mut spans = [Nanos::ZERO; TIMED_EXCHANGES];
    for span in &mut spans {
        let begin = drive.link.now();
        drive.read(object::VENDOR)?;
        *span = drive.link.now() - begin;
    }
    spans.sort_unstable();
    Ok([spans[TIMED_EXCHANGES / 4], spans[TIMED_EXCHANGES / 2]])
}

/// The error of the port for an error of an axis.
pub(in crate::drive) fn explain(
    port: &PortConfig,
    axis: &AxisConfig,
    error: AxisError,
) -> DriveError {
    let (device, node) = (port.device.clone(), axis.node_id);
    match error {
        AxisError::Exchange {
            error: LinkError::Lost(unexpected) | LinkError::Unanswered(unexpected),
            ..
        } => {
            let baud = port.baud;
            if unexpected.is_silence() {
                DriveError::NoAnswer { device, baud, node }
            } else {
                DriveError::InvalidReply(device, baud, unexpected)
            }
        }
        AxisError::Exchange { object, error: LinkError::Refused(AbortCode::NO_NODE) } => {
            DriveError::NoNode { device, node, object }
        }
        AxisError::Exchange { error: LinkError::Refused(AbortCode::UNKNOWN_COMMAND), .. } => {
            let family = family_of_port(port).name();
            let other = if port.family == Family::Epos4 { "EPOS2" } else { "EPOS4" };
            DriveError::WrongDriveFamily(device, family, other)
        }
        error => DriveError::Axis { device, node, error },
    }
}
