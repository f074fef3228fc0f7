//! Errors of ports, lines and drives. A message names the problem, the place and the remedy.

use std::path::PathBuf;
use std::{fmt, io};

use super::cia402::DriveState;
use super::latency_timer;
use super::object::{self, AbortCode, Address, Setting};
use super::objects::{self, Entry};
use super::serial_frame::SerialFrame;
use super::transport::NOT_OUR_TURN;
use crate::units::Nanos;

/// Why a port or its drives could not be brought up.
#[derive(Debug, thiserror::Error)]
pub enum DriveError {
    #[error(
        "serial port {0} does not exist; plug in the drive, or correct `device` in the \
         configuration"
    )]
    NotFound(PathBuf),
    #[error(
        "no permission to open serial port {0}; add the user to its group (often `dialout`) \
         and log in again"
    )]
    NotPermitted(PathBuf),
    #[error(
        "serial port {0} is in use by another program; end it (another controller? a \
         terminal?) and try again"
    )]
    Busy(PathBuf),
    #[error(
        "{device} cannot be used as a serial port: {source}; correct `device` or `baud` in the \
         configuration"
    )]
    NotSerial { device: PathBuf, source: serialport::Error },
    #[error(
        "no reply from a drive on {device} at {baud} baud, node {node}; check power, cable, `baud` \
         and `node_id`; no other program may use the port"
    )]
    NoAnswer { device: PathBuf, baud: u32, node: u8 },
    #[error("node {node} behind {device} {}", missing_node(*node, *object))]
    NoNode { device: PathBuf, node: u8, object: Address },
    #[error(
        "{0} at {1} baud: {2}; {advice}",
        advice = late_or(.2, "check `device`, `baud` and `family`; nothing else may be on the line")
    )]
    InvalidReply(PathBuf, u32, UnexpectedReply),
    /// Commands of the configured family are unknown: device, configured and possible family.
    #[error(
        "the drive on {0} does not know the commands of an {1} (unknown command 0x0F00FFBF); is \
         this an {2}? correct `family`"
    )]
    WrongDriveFamily(PathBuf, &'static str, &'static str),
    /// Replies are held back, as by the latency timer of an FTDI adapter at 16 ms.
    #[error(
        "an exchange over {device} takes {:.1} ms: a latency timer of 16 ms holds the replies \
         back and cuts the exchange rate to a seventh; `{}` fixes it until the adapter is \
         unplugged, config/system/60-i2ris.rules permanently",
        .exchange.as_seconds() * 1e3,
        latency_timer::command(.device)
    )]
    SlowAdapter {
        device: PathBuf,
        /// Lower quartile of the exchange time.
        exchange: Nanos,
    },
    #[error("drive on {device}, node {node}: {error}")]
    Axis { device: PathBuf, node: u8, error: AxisError },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum LinkError {
    #[error("refused: {0}")]
    Refused(AbortCode),
    /// No valid reply; the line is in sync again.
    #[error("not answered{}", suffix(.0))]
    Unanswered(UnexpectedReply),
    #[error("{0}; {advice}", advice = late_or(.0, "check power and cable"))]
    Lost(UnexpectedReply),
    #[error("the port is broken ({0}); check the cable")]
    Broken(io::ErrorKind),
    /// The control loop or this thread was silent, and the line is the watchdog's.
    #[error("the line is the watchdog's")]
    NotOurTurn,
}

/// The remedy: late replies come from the right drive, over a sound cable.
fn late_or(unexpected: &UnexpectedReply, otherwise: &'static str) -> &'static str {
    if unexpected.is_late() {
        "reduce the load on this computer, or raise `reply_timeout_ms`"
    } else {
        otherwise
    }
}

fn suffix(unexpected: &UnexpectedReply) -> String {
    if unexpected.is_silence() { String::new() } else { format!(": {unexpected}") }
}

impl LinkError {
    pub(super) fn broken(error: io::Error) -> Self {
        match error.kind() {
            NOT_OUR_TURN => Self::NotOurTurn,
            kind => Self::Broken(kind),
        }
    }
}

/// Why a drive that answers is not usable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum AxisError {
    #[error("{object}: {error}")]
    Exchange { object: Address, error: LinkError },
    #[error(
        "vendor number 0x{found:08X} instead of 0x{expected:08X}; not a maxon drive; check \
         `device`"
    )]
    Vendor { expected: u32, found: u32 },
    #[error("{}", other_serial_number(*expected, *found))]
    SerialNumber { expected: u64, found: u32 },
    #[error("{0}")]
    Setting(SettingError),
    #[error(
        "power stage does not switch off, state {0:?}; cut its power supply and check the drive"
    )]
    PowerStageStillOn(DriveState),
    #[error("statusword 0x{0:04X} is not a known state; check that the firmware is supported")]
    UnknownState(u16),
}

/// Cause and remedy of a gateway timeout. Two drives with the same node id answer alike to the
/// first read, the vendor.
fn missing_node(node: u8, object: Address) -> String {
    if object != object::VENDOR.address() {
        return format!(
            "answered before, but not the request for {object} (0x05040000): two drives may have \
             node {node}, or a CAN plug is loose; set unique DIP switches on every drive, and \
             press the plugs in"
        );
    }
    format!(
        "does not answer: the gateway timed out (0x05040000); check that its drive has power, that \
         its DIP switches and `node_id` are {node} and unique, and that the CAN plugs are firm"
    )
}

/// Cause and remedy of another serial number. Tools print it in hexadecimal, without `0x`.
fn other_serial_number(expected: u64, found: u32) -> String {
    let write = format!("write `serial_number = {found}`");
    if expected == 0 {
        return format!(
            "`serial_number` is not filled in: this drive is {found} (0x{found:08X}); {write}, or \
             let `i2ris commission --apply` do it"
        );
    }
    let remedy = match u64::from_str_radix(&expected.to_string(), 16) {
        Ok(number) if number as u32 == found => {
            format!("this is the drive if read as hexadecimal: write 0x{expected}")
        }
        _ => format!(
            "if the configuration names {found} for another motor, swap the cables back; if this \
             drive replaces the old one, {write}"
        ),
    };
    format!(
        "serial number {found} (0x{found:08X}) instead of {expected} (0x{expected:08X}); {remedy}"
    )
}

/// Names of models by the upper half of the product code.
const MODELS: [(u32, &str); 5] =
    [(0x6050, "24/1.5"), (0x6150, "50/5"), (0x6420, "70/10"), (0x6551, "50/8"), (0x6552, "50/15")];

/// A drive as messages name it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DriveModel {
    pub family: &'static str,
    pub product_code: u32,
    /// Firmware version, in hexadecimal as maxon writes it.
    pub firmware: u16,
}

impl fmt::Display for DriveModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.family)?;
        match (self.product_code >> 16, self.product_code) {
            (_, 0) => {}
            (upper, code) => match MODELS.iter().find(|(model, _)| *model == upper) {
                Some((_, name)) => write!(f, " {name}")?,
                None => write!(f, ", product 0x{code:08X}")?,
            },
        }
        write!(f, ", firmware 0x{:04X}", self.firmware)
    }
}

/// A setting that a drive does not take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SettingError {
    pub setting: Setting,
    pub drive: DriveModel,
    pub why: SettingRefusal,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SettingRefusal {
    AtMost(i64),
    AtLeast(i64),
    Refused(AbortCode),
    Missing,
    /// It acknowledges the value but keeps this one.
    Keeps(i64),
}

impl fmt::Display for SettingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { setting, drive, why } = self;
        let object = setting.object;
        let Entry { kind, key, since, .. } = *objects::first(object.index, object.subindex);
        let name = if key.is_empty() { object.name } else { key };
        write!(f, "`{name} = {}`: this drive ({drive}) ", kind.decode(setting.raw))?;
        match why {
            SettingRefusal::AtMost(most) => write!(f, "takes at most {most} in {object}")?,
            SettingRefusal::AtLeast(least) => write!(f, "takes at least {least} in {object}")?,
            SettingRefusal::Refused(code) => write!(f, "refuses {object}: {code}")?,
            SettingRefusal::Missing => write!(f, "has no {object}")?,
            SettingRefusal::Keeps(kept) => write!(f, "keeps {kept} in {object}")?,
        }
        match (why, key.is_empty()) {
            (SettingRefusal::Missing, _) if since > drive.firmware => {
                write!(f, "; firmware 0x{since:04X} has it: update the drive")
            }
            (SettingRefusal::Missing, _) => f.write_str("; use another firmware, or another drive"),
            (_, false) => write!(f, "; correct `{key}` in the configuration"),
            (_, true) => f.write_str("; the controller needs this value: use another firmware"),
        }
    }
}

/// Bytes that are kept: a short reply, or a word of text.
const KEPT: usize = 12;

/// Bytes received instead of a valid reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct UnexpectedReply {
    family: &'static str,
    bytes: u32,
    frames: u32,
    /// A frame came after the wait for it had ended.
    late: bool,
    /// The beginning of the last frame, or the last bytes if there was none.
    last: [u8; KEPT],
    kept: u8,
}

impl UnexpectedReply {
    /// Nothing received yet from a drive of this family.
    pub(in crate::drive) fn none_from(family: &'static str) -> Self {
        Self { family, ..Self::default() }
    }

    pub(crate) fn is_silence(&self) -> bool {
        (self.bytes, self.frames) == (0, 0)
    }

    pub fn is_frame(&self) -> bool {
        self.frames > 0
    }

    pub(in crate::drive) fn note_bytes(&mut self, bytes: &[u8]) {
        self.bytes = self.bytes.saturating_add(bytes.len() as u32);
        if self.is_frame() {
            return;
        }
        for &byte in &bytes[bytes.len().saturating_sub(KEPT)..] {
            if usize::from(self.kept) == KEPT {
                self.last.rotate_left(1);
                self.kept -= 1;
            }
            self.keep(byte);
        }
    }

    /// Records a whole frame that is not a reply to the request, or one that `is_late`: it may be
    /// the reply to an earlier request, which timed out.
    pub(in crate::drive) fn note_frame(&mut self, frame: &SerialFrame<'_>, is_late: bool) {
        if is_late {
            self.late = true;
            return;
        }
        self.frames = self.frames.saturating_add(1);
        self.kept = 0;
        // The opcode of every reply is 0 and says nothing.
        let opcode = (frame.opcode != 0).then_some(frame.opcode);
        opcode.iter().chain(frame.data).take(KEPT).for_each(|&byte| self.keep(byte));
    }

    /// Whether replies came, but after the wait for them.
    pub fn is_late(&self) -> bool {
        self.frames == 0 && self.late
    }

    fn keep(&mut self, byte: u8) {
        if let Some(free) = self.last.get_mut(usize::from(self.kept)) {
            *free = byte;
            self.kept += 1;
        }
    }
}

impl fmt::Display for UnexpectedReply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { family, bytes, frames, late, .. } = self;
        match (bytes, frames) {
            (0, 0) => return f.write_str("the line is silent"),
            (_, 0) if *late => return f.write_str("a reply came too late"),
            (1, 0) => f.write_str("received 1 byte, not a drive frame:")?,
            (_, 0) => write!(f, "received {bytes} bytes, not a drive frame:")?,
            (_, 1) => write!(f, "received a frame, but not a reply of {family}:")?,
            _ => write!(f, "received {frames} frames, but not a reply of {family}, the last:")?,
        }
        let last = self.last.get(..usize::from(self.kept)).unwrap_or_default();
        last.iter().try_for_each(|byte| write!(f, " {byte:02X}"))?;
        let is_text = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
        if !self.is_frame() && last.iter().all(is_text) {
            write!(f, " (text: {:?})", String::from_utf8_lossy(last).trim())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn received_bytes_are_described_in_one_clause() {
        let mut unexpected = UnexpectedReply::none_from("EPOS2");
        assert_eq!(unexpected.to_string(), "the line is silent");
        let mut late = unexpected;
        late.note_bytes(&[0; 14]);
        late.note_frame(&SerialFrame { opcode: 0, data: &[6, 0] }, true);
        assert!(late.is_late() && late.to_string() == "a reply came too late", "{late}");
        unexpected.note_bytes(b"roll=0.1 pitch=-3.4\r\n");
        assert_eq!(
            unexpected.to_string(),
            "received 21 bytes, not a drive frame: 70 69 74 63 68 3D 2D 33 2E \
             34 0D 0A (text: \"pitch=-3.4\")"
        );
        unexpected.note_frame(&SerialFrame { opcode: 0, data: &[6, 0] }, false);
        assert_eq!(unexpected.to_string(), "received a frame, but not a reply of EPOS2: 06 00");
        unexpected.note_frame(&SerialFrame { opcode: 0x60, data: &[1; 300] }, false);
        unexpected.note_bytes(&[7; 300]);
        let echo =
            "2 frames, but not a reply of EPOS2, the last: 60 01 01 01 01 01 01 01 01 01 01 01";
        assert!(unexpected.to_string().ends_with(echo), "{unexpected}");
    }
}
