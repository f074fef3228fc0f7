//! From what is asked to the reply.

use i2ris::units::Nanos;

use super::code::Abort;
use super::language::{Addressed, Command, understand};
use super::object::Kind;
use super::state::State;
use super::{Drive, Family, factory_settings};
use crate::frame::Incoming;
use crate::log::{EventKind, HostBug, LineTrouble};

/// A reply.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// Its data: an error code, and what follows it.
    pub data: Vec<u8>,
    /// What it takes beyond the usual processing time.
    pub delay: Nanos,
}

/// Segments on their way.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) enum Transfer {
    /// None.
    #[default]
    Idle,
    /// What is left to be read, and the toggle bit that must come next.
    Read(Vec<u8>, bool),
    /// Where to write, how long it will be, what came so far, and the toggle bit that must come
    /// next.
    Write(u16, u8, usize, Vec<u8>, bool),
}

/// What fills the bytes that a short value does not need.
const RUBBISH: [u8; 4] = [0xA5, 0x5A, 0xC3, 0x3C];

/// "save" and "load", the signatures that guard objects 0x1010 and 0x1011.
const SAVE: u32 = 0x6576_6173;
const LOAD: u32 = 0x6461_6F6C;

impl Drive {
    /// The family.
    pub(crate) fn family(&self) -> Family {
        self.config.family
    }

    /// Whether a request with this node id is for this drive: its own, or that of whoever holds the
    /// port.
    pub(crate) fn is_addressed_by(&self, node: Option<u8>) -> bool {
        node.is_none_or(|node| node == 0 || node == self.config.node_id)
    }

    /// Its node id.
    pub(crate) fn node_id(&self) -> u8 {
        self.config.node_id
    }

    /// How long it waits for a node behind it.
    pub(crate) fn gateway_timeout(&self) -> Nanos {
        Nanos::from_millis(self.config.gateway_timeout_ms)
    }

    /// Booting: it neither hears nor answers.
    pub(crate) fn is_deaf(&self) -> bool {
        self.state == State::NotReadyToSwitchOn
    }

    /// Understands a frame that arrived at its own port.
    pub(crate) fn hear(&mut self, incoming: &Incoming) -> Result<Addressed, Abort> {
        let Incoming::Request(request) = incoming else {
            self.events.push(EventKind::Line(LineTrouble::Crc));
            return Err(Abort::Crc);
        };
        understand(self.config.family, request).inspect_err(|abort| {
            if *abort == Abort::IllegalCommand {
                self.events
                    .push(EventKind::HostBug(HostBug::Opcode(request.opcode)));
            }
        })
    }

    /// The reply to a frame at its own port with no other drive behind it, or nothing while
    /// booting.
    pub fn answer(&mut self, incoming: &Incoming) -> Option<Answer> {
        if self.is_deaf() {
            return None;
        }
        match self.hear(incoming) {
            Err(abort) => Some(self.refuse(is_read(incoming), abort)),
            Ok((node, command)) if self.is_addressed_by(node) => {
                let answered = command.is_answered(self.config.family);
                let outcome = self.serve(command);
                answered.then(|| self.reply(outcome, is_read(incoming)))
            }
            Ok(_) => {
                let delay = self.gateway_timeout();
                Some(Answer {
                    delay,
                    ..self.refuse(is_read(incoming), Abort::SdoTimeout)
                })
            }
        }
    }

    /// The reply that tells an outcome.
    pub(crate) fn reply(&self, outcome: Result<Vec<u8>, Abort>, to_read: bool) -> Answer {
        match outcome {
            Ok(data) => Answer {
                data: [&[0; 4], &data[..]].concat(),
                delay: Nanos::ZERO,
            },
            Err(abort) => self.refuse(to_read, abort),
        }
    }

    fn refuse(&self, to_read: bool, abort: Abort) -> Answer {
        let mut data = (abort as u32).to_le_bytes().to_vec();
        if to_read {
            data.resize(2 * usize::from(self.config.error_reply_words.max(2)), 0);
        }
        Answer {
            data,
            delay: Nanos::ZERO,
        }
    }

    /// Carries a command out: what follows the error code in the reply.
    pub(crate) fn serve(&mut self, command: Command) -> Result<Vec<u8>, Abort> {
        match command {
            Command::Read { index, sub } => self.read_object(index, sub),
            Command::Write { index, sub, raw } => {
                self.write(index, sub, raw)?;
                Ok(Vec::new())
            }
            Command::StartReading { index, sub } => self.start_reading(index, sub),
            Command::ReadSegment { toggle } => self.read_segment(toggle),
            Command::StartWriting { index, sub, length } => {
                self.transfer = Transfer::Write(index, sub, length, Vec::new(), false);
                Ok(Vec::new())
            }
            Command::WriteSegment {
                length,
                toggle,
                last,
                bytes,
            } => self.write_segment(length, toggle, last, &bytes),
            Command::Manage { node, command } => self.manage(node, command),
        }
    }

    fn read_object(&self, index: u16, sub: u8) -> Result<Vec<u8>, Abort> {
        let value = self.bytes(index, sub)?;
        if value.len() > 4 {
            return Err(Abort::Length);
        }
        let mut data = if self.config.rubbish { RUBBISH } else { [0; 4] };
        data[..value.len()].copy_from_slice(&value);
        Ok(data.to_vec())
    }

    /// The bytes of an object.
    fn bytes(&self, index: u16, sub: u8) -> Result<Vec<u8>, Abort> {
        let stored = self.dictionary.read(index, sub)?;
        // An EPOS2 without an error has no entry; a host that takes what it finds for an error must
        // not get away with it.
        if self.config.family == Family::Epos2
            && index == 0x1003
            && i64::from(sub) > self.dictionary.get(0x1003, 0)
        {
            return Err(Abort::NoSubindex);
        }
        if stored.kind == Kind::Text {
            return Ok(self.config.family.places().name.as_bytes().to_vec());
        }
        let value = self.live(index, sub).unwrap_or(stored.value);
        Ok(value.to_le_bytes()[..stored.kind.size()].to_vec())
    }

    /// Writes an object and lets it take effect.
    fn write(&mut self, index: u16, sub: u8, raw: u32) -> Result<(), Abort> {
        let value = self
            .dictionary
            .check_write(index, sub, raw, self.state.is_powered())?;
        match (index, sub) {
            (0x1010, 1) => {
                if raw != SAVE {
                    return Err(Abort::CannotStore);
                }
                self.stored = self.dictionary.clone();
                return Ok(());
            }
            (0x1011, 1) => {
                if raw != LOAD {
                    return Err(Abort::CannotStore);
                }
                // Takes effect with the next reset.
                self.stored = factory_settings(&self.config);
                return Ok(());
            }
            (0x1003, 0) => (1..=5).for_each(|entry| self.dictionary.set(0x1003, entry, 0)),
            _ => {}
        }
        self.dictionary.set(index, sub, value);
        match (index, sub) {
            (0x6040, 0) => self.write_controlword(value as u16),
            (0x6060, 0) => {
                if let Some(mode) = self.config.family.mode(value) {
                    self.change_mode(mode);
                }
            }
            place if place == (0x607A, 0) || place == self.config.family.places().direct_target => {
                self.since_setpoint_s = 0.0;
                self.events.push(EventKind::Setpoint(value as i32));
            }
            _ => {}
        }
        Ok(())
    }

    fn start_reading(&mut self, index: u16, sub: u8) -> Result<Vec<u8>, Abort> {
        let mut value = self.bytes(index, sub)?;
        if self.config.family == Family::Epos2 {
            self.transfer = Transfer::Read(value, false);
            return Ok(Vec::new());
        }
        let total = value.len() as u32;
        let rest = value.split_off(
            value
                .len()
                .min(usize::from(self.config.segment_bytes.max(1))),
        );
        self.transfer = if rest.is_empty() {
            Transfer::Idle
        } else {
            Transfer::Read(rest, false)
        };
        Ok([&total.to_le_bytes()[..], &[value.len() as u8], &value].concat())
    }

    fn read_segment(&mut self, toggle: bool) -> Result<Vec<u8>, Abort> {
        let Transfer::Read(mut value, expected) = std::mem::take(&mut self.transfer) else {
            return Err(Abort::Toggle);
        };
        if toggle != expected {
            return Err(Abort::Toggle);
        }
        let most = usize::from(self.config.segment_bytes.max(1));
        let most = if self.config.family == Family::Epos2 {
            most.min(63)
        } else {
            most
        };
        let rest = value.split_off(value.len().min(most));
        let (length, last) = (value.len() as u8, rest.is_empty());
        if !last {
            self.transfer = Transfer::Read(rest, !toggle);
        }
        let head = match self.config.family {
            Family::Epos4 => vec![length, u8::from(toggle) | u8::from(last) << 1],
            Family::Epos2 => vec![length | u8::from(toggle) << 6 | u8::from(!last) << 7],
        };
        Ok([&head[..], &value].concat())
    }

    fn write_segment(
        &mut self,
        length: u8,
        toggle: bool,
        last: bool,
        bytes: &[u8],
    ) -> Result<Vec<u8>, Abort> {
        let Transfer::Write(index, sub, total, mut held, expected) =
            std::mem::take(&mut self.transfer)
        else {
            return Err(Abort::Toggle);
        };
        if toggle != expected {
            return Err(Abort::Toggle);
        }
        held.extend_from_slice(bytes.get(..usize::from(length)).ok_or(Abort::Length)?);
        if last {
            let fits = held.len() == total && (1..=4).contains(&total);
            let mut raw = [0; 4];
            raw.get_mut(..held.len())
                .filter(|_| fits)
                .ok_or(Abort::Length)?
                .copy_from_slice(&held);
            self.write(index, sub, u32::from_le_bytes(raw))?;
        } else {
            self.transfer = Transfer::Write(index, sub, total, held, !toggle);
        }
        Ok(vec![length, u8::from(toggle)])
    }

    /// Network management. The reply goes out before a reset takes hold.
    fn manage(&mut self, node: u8, command: u8) -> Result<Vec<u8>, Abort> {
        if node != 0 && node != self.config.node_id {
            return Ok(Vec::new());
        }
        match command {
            1 => self.operational = true,
            2 | 128 | 130 => self.operational = false,
            129 => self.power_cycle(),
            _ => return Err(Abort::Range),
        }
        Ok(Vec::new())
    }
}

/// A refused read may be answered at the length of a read.
pub(crate) fn is_read(incoming: &Incoming) -> bool {
    matches!(incoming, Incoming::Request(request) if matches!(request.opcode, 0x10 | 0x60))
}
