//! Opcodes: from a request to its reply (EPOS4 Communication Guide, chapter on the serial line).

use i2ris::units::Nanos;

use super::code::Abort;
use super::object::Kind;
use super::state::State;
use super::{Drive, Mode, factory_settings};
use crate::frame::{self, Incoming, Request};
use crate::log::{EventKind, HostBug, LineTrouble};

/// A reply, ready for the wire.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// The frame.
    pub frame: Vec<u8>,
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
    /// Where to write, how long it will be, what came so far, and the toggle bit that must come next.
    Write(u16, u8, usize, Vec<u8>, bool),
}

const READ_OBJECT: u8 = 0x60;
const SEGMENT_READ: u8 = 0x62;
const WRITE_OBJECT: u8 = 0x68;
const INITIATE_SEGMENTED_WRITE: u8 = 0x69;
const SEGMENT_WRITE: u8 = 0x6A;
const SEND_NMT: u8 = 0x70;
const SEND_LSS: u8 = 0x7A;
const READ_LSS: u8 = 0x7B;
const INITIATE_SEGMENTED_READ: u8 = 0x81;

/// What fills the bytes that a short value does not need.
const RUBBISH: [u8; 4] = [0xA5, 0x5A, 0xC3, 0x3C];

/// "save" and "load", the signatures that guard objects 0x1010 and 0x1011.
const SAVE: u32 = 0x6576_6173;
const LOAD: u32 = 0x6461_6F6C;

impl Drive {
    /// The reply to a frame, or nothing while booting.
    pub fn answer(&mut self, incoming: &Incoming) -> Option<Answer> {
        if self.state == State::NotReadyToSwitchOn {
            return None;
        }
        let Incoming::Request(request) = incoming else {
            self.events.push(EventKind::Line(LineTrouble::Crc));
            return Some(self.refuse(0, Abort::Crc));
        };
        let elsewhere = addressed_node(request).is_some_and(|node| node != 0 && node != self.config.node_id);
        let outcome = if elsewhere { Err(Abort::SdoTimeout) } else { self.serve(request) };
        let mut answer = match outcome {
            Ok(data) => Answer { frame: frame::reply(&[&[0; 4], &data[..]].concat()), delay: Nanos::ZERO },
            Err(abort) => self.refuse(request.opcode, abort),
        };
        if elsewhere {
            answer.delay = Nanos::from_millis(self.config.gateway_timeout_ms);
        }
        Some(answer)
    }

    fn refuse(&self, opcode: u8, abort: Abort) -> Answer {
        let mut data = (abort as u32).to_le_bytes().to_vec();
        if opcode == READ_OBJECT {
            data.resize(2 * usize::from(self.config.error_reply_words.max(2)), 0);
        }
        Answer { frame: frame::reply(&data), delay: Nanos::ZERO }
    }

    /// What follows the error code in the reply.
    fn serve(&mut self, request: &Request) -> Result<Vec<u8>, Abort> {
        let data = &request.data[..];
        match (request.opcode, data) {
            (READ_OBJECT, &[_, low, high, sub]) => self.read_object(u16::from_le_bytes([low, high]), sub),
            (WRITE_OBJECT, &[_, low, high, sub, a, b, c, d]) => {
                self.write(u16::from_le_bytes([low, high]), sub, u32::from_le_bytes([a, b, c, d]))?;
                Ok(Vec::new())
            }
            (INITIATE_SEGMENTED_READ, &[_, low, high, sub]) => self.start_reading(u16::from_le_bytes([low, high]), sub),
            (SEGMENT_READ, &[control, _]) => self.read_segment(control & 1 != 0),
            (INITIATE_SEGMENTED_WRITE, &[_, low, high, sub, a, b, c, d]) => {
                let length = u32::from_le_bytes([a, b, c, d]) as usize;
                self.transfer = Transfer::Write(u16::from_le_bytes([low, high]), sub, length, Vec::new(), false);
                Ok(Vec::new())
            }
            (SEGMENT_WRITE, &[length, control, ref bytes @ ..]) => self.write_segment(length, control, bytes),
            (SEND_NMT, &[node, 0, command, 0]) => self.manage(node, command),
            (SEND_LSS | READ_LSS, _) => Err(Abort::UnsupportedAccess),
            (opcode, _) if is_known(opcode) => Err(Abort::Length),
            (opcode, _) => {
                self.events.push(EventKind::HostBug(HostBug::Opcode(opcode)));
                Err(Abort::IllegalCommand)
            }
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
        if stored.kind == Kind::Text {
            return Ok(b"EPOS4".to_vec());
        }
        let value = self.live(index, sub).unwrap_or(stored.value);
        Ok(value.to_le_bytes()[..stored.kind.size()].to_vec())
    }

    /// Writes an object and lets it take effect.
    fn write(&mut self, index: u16, sub: u8, raw: u32) -> Result<(), Abort> {
        let value = self.dictionary.check_write(index, sub, raw, self.state.is_powered())?;
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
                if let Some(mode) = Mode::from_number(value) {
                    self.change_mode(mode);
                }
            }
            (0x607A, 0) => {
                self.since_setpoint_s = 0.0;
                self.events.push(EventKind::Setpoint(value as i32));
            }
            _ => {}
        }
        Ok(())
    }

    fn start_reading(&mut self, index: u16, sub: u8) -> Result<Vec<u8>, Abort> {
        let mut value = self.bytes(index, sub)?;
        let total = value.len() as u32;
        let rest = value.split_off(value.len().min(usize::from(self.config.segment_bytes.max(1))));
        self.transfer = if rest.is_empty() { Transfer::Idle } else { Transfer::Read(rest, false) };
        Ok([&total.to_le_bytes()[..], &[value.len() as u8], &value].concat())
    }

    fn read_segment(&mut self, toggle: bool) -> Result<Vec<u8>, Abort> {
        let Transfer::Read(mut value, expected) = std::mem::take(&mut self.transfer) else {
            return Err(Abort::Toggle);
        };
        if toggle != expected {
            return Err(Abort::Toggle);
        }
        let rest = value.split_off(value.len().min(usize::from(self.config.segment_bytes.max(1))));
        let control = u8::from(toggle) | u8::from(rest.is_empty()) << 1;
        if !rest.is_empty() {
            self.transfer = Transfer::Read(rest, !toggle);
        }
        Ok([&[value.len() as u8, control], &value[..]].concat())
    }

    fn write_segment(&mut self, length: u8, control: u8, bytes: &[u8]) -> Result<Vec<u8>, Abort> {
        let Transfer::Write(index, sub, total, mut held, expected) = std::mem::take(&mut self.transfer) else {
            return Err(Abort::Toggle);
        };
        let (toggle, last) = (control & 1 != 0, control & 2 != 0);
        if toggle != expected {
            return Err(Abort::Toggle);
        }
        held.extend_from_slice(bytes.get(..usize::from(length)).ok_or(Abort::Length)?);
        if last {
            let fits = held.len() == total && (1..=4).contains(&total);
            let mut raw = [0; 4];
            raw.get_mut(..held.len()).filter(|_| fits).ok_or(Abort::Length)?.copy_from_slice(&held);
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

/// The node that a request is for, where it names one.
fn addressed_node(request: &Request) -> Option<u8> {
    let names = [READ_OBJECT, WRITE_OBJECT, INITIATE_SEGMENTED_READ, INITIATE_SEGMENTED_WRITE];
    names.contains(&request.opcode).then(|| request.data.first().copied()).flatten()
}

fn is_known(opcode: u8) -> bool {
    matches!(
        opcode,
        READ_OBJECT
            | SEGMENT_READ
            | WRITE_OBJECT
            | INITIATE_SEGMENTED_WRITE
            | SEGMENT_WRITE
            | SEND_NMT
            | INITIATE_SEGMENTED_READ
    )
}
