//! Requests to replies, and the state of a segmented read or write.

use i2ris::drive::objects::Kind;
use i2ris::units::Nanos;

use super::command_set::{Abort, Addressed, Service, decode};
use super::device::{Drive, factory_settings};
use super::event::{EventKind, HostBug, LineTrouble};
use super::family::{Address, Family};
use super::frame::{Incoming, Request};
use super::state::State;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reply {
    /// Error code, then the data.
    pub data: Vec<u8>,
    /// Delay in addition to the usual processing time.
    pub delay: Nanos,
}

/// Bytes beyond a short value: garbage, and the upper word that public code read from an EPOS2.
const UNUSED_BYTES: [u8; 4] = [0xA5, 0x5A, 0x90, 0x80];
/// "save" and "load", the signatures that protect objects 0x1010 and 0x1011.
const SAVE: u32 = 0x6576_6173;
const LOAD: u32 = 0x6461_6F6C;

impl Drive {
    /// Whether the drive boots. It neither receives nor replies.
    pub(crate) fn is_booting(&self) -> bool {
        self.state == State::NotReadyToSwitchOn
    }

    /// The reply at its own port; none while booting or silent. `others`: its CAN bus, round trip.
    pub fn reply_at_port(
        &mut self,
        incoming: &Incoming,
        others: Option<(Vec<&mut Self>, Nanos)>,
    ) -> Option<Reply> {
        let is_lost = self.lost & 1 == 1;
        self.lost >>= 1;
        if self.is_booting() || self.silent || is_lost {
            return None;
        }
        // The error reply to a read may have the length of its data.
        let is_read = matches!(incoming, Incoming::Request(Request { opcode: 0x10 | 0x60, .. }));
        let (node, service) = match self.decode(incoming) {
            Ok(addressed) => addressed,
            Err(abort) => return Some(self.reply(Err(abort), is_read)),
        };
        // Segments of an EPOS2 name no node: they go to the node of the initial transfer.
        let is_next = node.is_none() && service.is_segmented();
        let node = if is_next { self.transfer_node } else { node };
        self.transfer_node = node.filter(|_| service.is_segmented());
        // 0 and no node address the drive at the port.
        if node.is_none_or(|node| node == 0 || node == self.config.node_id) {
            let has_reply = service.has_reply(self.config.family);
            let outcome = self.execute(service);
            return has_reply.then(|| self.reply(outcome, is_read));
        }
        let timeout = Nanos::from_millis(self.config.gateway_timeout_ms);
        let (others, round_trip) = others.unwrap_or_default();
        let is_addressed = |other: &&mut Self| Some(other.config.node_id) == node;
        let is_mute = |other: &&mut Self| other.is_booting() || other.silent;
        let (mute, mut addressed): (Vec<_>, Vec<_>) =
            others.into_iter().filter(is_addressed).partition(is_mute);
        for other in mute {
            other.events.push(EventKind::Line(LineTrouble::NoAnswer));
        }
        let (delay, abort) = Gateway { round_trip, timeout }.forward(!addressed.is_empty());
        let (outcome, delay) = match (abort, addressed.split_first_mut()) {
            (None, Some(_)) if service.is_segmented() && !self.config.forwards_segments => {
                (Err(Abort::UnsupportedAccess), Nanos::ZERO)
            }
            (None, Some((first, more))) => {
                let outcome = first.execute(service.clone());
                // Two nodes with one id send at once: differences destroy both frames.
                let is_same =
                    more.iter_mut().all(|other| other.execute(service.clone()) == outcome);
                if is_same { (outcome, delay) } else { (Err(Abort::SdoTimeout), timeout) }
            }
            (abort, _) => (Err(abort.unwrap_or(Abort::SdoTimeout)), delay),
        };
        Some(Reply { delay, ..self.reply(outcome, is_read) })
    }

    /// Decodes a frame that arrived at its own port.
    fn decode(&mut self, incoming: &Incoming) -> Result<Addressed, Abort> {
        let Incoming::Request(request) = incoming else {
            self.events.push(EventKind::Line(LineTrouble::Crc));
            return Err(Abort::Crc);
        };
        decode(self.config.family, request).inspect_err(|abort| {
            if *abort == Abort::IllegalCommand {
                self.events.push(EventKind::HostBug(HostBug::Opcode(request.opcode)));
            }
        })
    }

    /// The reply with this outcome of a request.
    fn reply(&self, outcome: Result<Vec<u8>, Abort>, is_read: bool) -> Reply {
        let data = match outcome {
            Ok(data) => [&[0; 4], &data[..]].concat(),
            Err(abort) => {
                let mut data = (abort as u32).to_le_bytes().to_vec();
                if is_read {
                    data.resize(2 * usize::from(self.config.error_reply_words.max(2)), 0);
                }
                data
            }
        };
        Reply { data, delay: Nanos::ZERO }
    }

    /// Executes a service. Returns the data after the error code of the reply.
    fn execute(&mut self, service: Service) -> Result<Vec<u8>, Abort> {
        self.since_request_s = 0.0;
        match service {
            Service::ReadObject(address) => return self.read_object(address),
            Service::WriteObject(address, raw) => self.write(address, raw)?,
            Service::InitiateSegmentedRead(address) => return self.initiate_read(address),
            Service::SegmentRead { toggle } => return self.read_segment(toggle),
            Service::InitiateSegmentedWrite(address, length) => {
                self.transfer.start_write(address, length);
            }
            Service::SegmentedWrite(segment) => {
                if let Some((address, raw)) = self.transfer.write(&segment)? {
                    self.write(address, raw)?;
                }
                return Ok(vec![segment.length, u8::from(segment.toggle)]);
            }
            Service::ManageNetwork { node, command } => self.manage(node, command)?,
        }
        Ok(Vec::new())
    }

    fn read_object(&self, address: Address) -> Result<Vec<u8>, Abort> {
        let value = self.bytes(address)?;
        if value.len() > 4 {
            return Err(Abort::Length);
        }
        let mut data = if self.config.fill_unused_bytes { UNUSED_BYTES } else { [0; 4] };
        data[..value.len()].copy_from_slice(&value);
        let is_one_word = self.config.one_word_reads && value.len() <= 2;
        Ok(data[..if is_one_word { 2 } else { 4 }].to_vec())
    }

    /// The bytes of an object.
    fn bytes(&self, (index, sub): Address) -> Result<Vec<u8>, Abort> {
        let stored = self.dictionary.read(index, sub)?;
        // An EPOS2 without an error has no entry. A host must not take an empty entry for an error.
        let is_empty_entry = index == 0x1003 && i64::from(sub) > self.dictionary.get(0x1003, 0);
        if self.config.family == Family::Epos2 && is_empty_entry {
            return Err(Abort::NoSubindex);
        }
        if stored.kind == Kind::Text {
            return Ok(self.map().name.as_bytes().to_vec());
        }
        let value = self.computed_value(index, sub).unwrap_or(stored.value);
        Ok(value.to_le_bytes()[..usize::from(stored.kind.size())].to_vec())
    }

    /// Writes an object and applies the value.
    fn write(&mut self, (index, sub): Address, raw: u32) -> Result<(), Abort> {
        let value = self.dictionary.check_write(index, sub, raw, self.state.is_powered())?;
        match (index, sub, raw) {
            (0x1010, 1, SAVE) => {
                self.stored = self.dictionary.clone();
                return Ok(());
            }
            // Takes effect with the next reset.
            (0x1011, 1, LOAD) => {
                self.stored = factory_settings(&self.config);
                return Ok(());
            }
            (0x1010 | 0x1011, 1, _) => return Err(Abort::CannotStore),
            (0x1003, 0, _) => {
                for entry in 1..=5 {
                    self.dictionary.set(0x1003, entry, 0);
                }
            }
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
            address if address == (0x607A, 0) || address == self.map().direct_target => {
                self.since_setpoint_s = 0.0;
                self.events.push(EventKind::Setpoint(value as i32));
            }
            _ => {}
        }
        Ok(())
    }

    /// EPOS4: the reply carries the length and the first segment. EPOS2: neither.
    fn initiate_read(&mut self, address: Address) -> Result<Vec<u8>, Abort> {
        let mut value = self.bytes(address)?;
        if self.config.family == Family::Epos2 {
            self.transfer.start_read(value);
            return Ok(Vec::new());
        }
        let length = value.len() as u32;
        let rest = value.split_off(value.len().min(self.max_segment()));
        self.transfer.start_read(rest);
        Ok([&length.to_le_bytes()[..], &[value.len() as u8], &value].concat())
    }

    fn read_segment(&mut self, toggle: bool) -> Result<Vec<u8>, Abort> {
        let most = self.max_segment();
        let (value, last) = self.transfer.read(toggle, most)?;
        let length = value.len() as u8;
        let head = match self.config.family {
            Family::Epos4 => vec![length, u8::from(toggle) | u8::from(last) << 1],
            Family::Epos2 => vec![length | u8::from(toggle) << 6 | u8::from(!last) << 7],
        };
        Ok([&head[..], &value].concat())
    }

    /// Maximum bytes of a segment. The length field of the EPOS2 has 6 bits.
    fn max_segment(&self) -> usize {
        let most = usize::from(self.config.segment_bytes.max(1));
        if self.config.family == Family::Epos2 { most.min(63) } else { most }
    }

    /// Executes a network management command. The reply goes out before a reset takes effect.
    fn manage(&mut self, node: u8, command: u8) -> Result<(), Abort> {
        if node != 0 && node != self.config.node_id {
            return Ok(());
        }
        match command {
            1 => self.operational = true,
            2 | 128 | 130 => self.operational = false,
            129 => self.power_cycle(),
            _ => return Err(Abort::Range),
        }
        Ok(())
    }
}

/// How a gateway treats the host. Until it has answered a request for another node it accepts
/// nothing else: bytes that arrive in the meantime are lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gateway {
    /// Round trip over CAN to a node that answers.
    pub round_trip: Nanos,
    /// Timeout for a node that does not answer.
    pub timeout: Nanos,
}

impl Gateway {
    /// Additional time for a request to a node, and the abort code if it does not answer.
    pub fn forward(self, node_answers: bool) -> (Nanos, Option<Abort>) {
        if node_answers { (self.round_trip, None) } else { (self.timeout, Some(Abort::SdoTimeout)) }
    }
}
