//! A simulated line with simple drives, in simulated time: exact, and as fast as the processor.
//!
//! It uses the controller's own frame encoder and parser, so it does not test frames; the emulator
//! does, with its own. It places disturbances, delays and states exactly where a test needs them.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};
use std::{fmt, io};

use i2ris::config::{AxisConfig, PortConfig};
use i2ris::drive::serial_frame::{FrameEncoder, MAX_ENCODED, SerialFrame};
use i2ris::drive::serial_frame::{FrameError, FrameParser, ParserEvent};
use i2ris::drive::transport::Transport;
use i2ris::units::{Counts, Nanos};
use i2ris_simulation::drive::Gateway;

use super::mini_drive::{MiniDrive, Reply};
use crate::fast_axis;

pub const SERIAL_NUMBER: u32 = 0x6215_0001;
/// Processing time of a request in the drive.
const PROCESSING: Nanos = Nanos::from_micros(300);

/// A disturbance of a request or its reply. Numbers are byte positions, modulo the length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Disturbance {
    Nothing,
    LoseRequest,
    FlipRequest(usize),
    TruncateRequest(usize),
    /// The request is carried out, but the reply is lost; and so on.
    LoseReply,
    DelayReply(Nanos),
    FlipReply(usize),
    DropReplyByte(usize),
    DuplicateReplyByte(usize),
    TruncateReply(usize),
    Noise,
    /// A reply to something else before the reply.
    StrayReply,
}

/// A line in simulated time. Clones are handles to the same line.
#[derive(Clone, Debug)]
pub struct SimulatedLine(Arc<Mutex<LineState>>);

#[derive(Debug, Clone, Copy)]
pub struct ReceivedRequest {
    pub opcode: u8,
    pub node: u8,
    pub index: u16,
    pub subindex: u8,
    /// The value of a write.
    pub value: u32,
    pub arrived: Nanos,
}

type Act = Box<dyn FnOnce() + Send>;

#[derive(Debug)]
pub struct LineState {
    pub now: Nanos,
    pub drives: Vec<MiniDrive>,
    pub disturbances: VecDeque<Disturbance>,
    pub silent: bool,
    pub booting_until: Nanos,
    /// This node does not answer; the others do, unless it is the gateway to them.
    pub silent_node: Option<u8>,
    pub gateway: Gateway,
    pub adapter_hold: Nanos,
    /// Disturbs the next write of this value to this object.
    pub disturb_write: Option<(u16, u32, Disturbance)>,
    /// Delay of the host when it waits for bytes.
    pub host_delay: Nanos,
    pub hung_up: bool,
    /// The line belongs to the watchdog.
    pub is_taken: bool,
    /// Requests that were sent before the reply to the previous one was read.
    pub pipelined: u32,
    pub requests: Vec<ReceivedRequest>,
    /// Forwarded requests, with a flag for a reply of the node.
    pub forwarded: Vec<(ReceivedRequest, bool)>,
    byte_time: Nanos,
    busy_until: Nanos,
    /// The gateway takes nothing before this instant.
    gateway_busy_until: Nanos,
    planned: Planned,
    inbox: VecDeque<(Nanos, u8)>,
    parser: FrameParser,
    encoder: FrameEncoder,
}

impl SimulatedLine {
    /// A line at 115200 baud with these drives; the first one owns the port.
    pub fn new(drives: Vec<MiniDrive>) -> Self {
        let (round_trip, timeout) = (Nanos::from_micros(600), Nanos::from_millis(50));
        let gateway = Gateway { round_trip, timeout };
        Self(Arc::new(Mutex::new(LineState {
            now: Nanos::from_millis(1000),
            drives,
            disturbances: VecDeque::new(),
            silent: false,
            booting_until: Nanos::ZERO,
            silent_node: None,
            gateway,
            adapter_hold: Nanos::ZERO,
            disturb_write: None,
            host_delay: Nanos::ZERO,
            hung_up: false,
            is_taken: false,
            pipelined: 0,
            requests: Vec::with_capacity(100_000),
            forwarded: Vec::with_capacity(100_000),
            byte_time: Nanos(86_806),
            busy_until: Nanos::ZERO,
            gateway_busy_until: Nanos::ZERO,
            planned: Planned::default(),
            inbox: VecDeque::with_capacity(4 * MAX_ENCODED),
            parser: FrameParser::default(),
            encoder: FrameEncoder::default(),
        })))
    }

    pub fn state(&self) -> MutexGuard<'_, LineState> {
        self.0.lock().unwrap()
    }

    pub fn time(&self) -> Nanos {
        self.state().now
    }

    pub fn drive<R>(&self, node: u8, access: impl FnOnce(&mut MiniDrive) -> R) -> R {
        let mut state = self.state();
        let mut drives = state.drives.iter_mut();
        access(drives.find(|drive| drive.node == node).expect("no such node"))
    }

    /// Power off and on again; the drive answers again after `boot`.
    pub fn restart(&self, node: u8, boot: Nanos) {
        self.drive(node, MiniDrive::restart);
        let mut state = self.state();
        state.booting_until = state.now + boot;
        state.inbox.clear();
    }

    /// A request of a controller that was just killed: its reply is on the way.
    pub fn send_stale_request(&self) {
        self.state().request(&[0x90, 0x02, 0x60, 0x02, 0x01, 0x64, 0x60, 0x00, 0x29, 0x5A]);
    }

    /// A request of a killed controller to any node.
    pub fn send_stale_request_to(&self, node: u8) {
        let data = [node, 0x64, 0x60, 0x00];
        let mut encoder = FrameEncoder::default();
        let request = encoder.encode(SerialFrame { opcode: 0x60, data: &data }).unwrap().to_vec();
        self.state().request(&request);
    }

    /// Schedules an action, also in the middle of an exchange.
    pub fn plan(&self, at: Nanos, act: impl FnOnce() + Send + 'static) {
        self.state().planned.0.push((at, Box::new(act)));
    }

    pub fn disturb(&self, disturbances: impl IntoIterator<Item = Disturbance>) {
        self.state().disturbances.extend(disturbances);
    }
}

impl LineState {
    fn request(&mut self, bytes: &[u8]) {
        if !self.inbox.is_empty() {
            self.pipelined += 1;
        }
        let matching = self.matching_disturbance(bytes);
        let disturbance = matching.or_else(|| self.disturbances.pop_front());
        let disturbance = disturbance.unwrap_or(Disturbance::Nothing);
        let is_deaf = self.silent || self.now < self.booting_until.max(self.gateway_busy_until);
        if is_deaf || disturbance == Disturbance::LoseRequest {
            return;
        }
        let mut bytes = bytes.to_vec();
        match disturbance {
            Disturbance::FlipRequest(index) => flip(&mut bytes, index),
            Disturbance::TruncateRequest(length) => bytes.truncate(length % bytes.len()),
            _ => {}
        }
        let arrival = self.now + Nanos(self.byte_time.0 * bytes.len() as u64);
        for byte in bytes {
            let mut begin = arrival;
            let reply = match self.parser.push(byte) {
                ParserEvent::None | ParserEvent::Error(FrameError::LostSync) => continue,
                ParserEvent::Error(FrameError::Crc) => Reply::error(0x0504_0004),
                ParserEvent::Frame(frame) => {
                    let request = header(&frame);
                    let port = self.drives.first().map_or(0, |drive| drive.node);
                    if self.silent_node == Some(port) {
                        return;
                    }
                    let received = ReceivedRequest { arrived: arrival, ..request };
                    if request.node == 0 || request.node == port {
                        self.requests.push(received);
                        answer(&mut self.drives, &frame)
                    } else {
                        let mut drives = self.drives.iter();
                        let answers = self.silent_node != Some(request.node)
                            && drives.any(|drive| drive.node == request.node);
                        let (delay, abort) = self.gateway.forward(answers);
                        self.forwarded.push((received, answers));
                        if answers {
                            self.requests.push(received);
                        }
                        begin = begin + delay;
                        self.gateway_busy_until = begin;
                        match abort {
                            Some(abort) => Reply::error(abort as u32),
                            None => answer(&mut self.drives, &frame),
                        }
                    }
                }
            };
            self.reply(reply, begin, disturbance);
        }
    }

    fn matching_disturbance(&mut self, bytes: &[u8]) -> Option<Disturbance> {
        let (index, value, disturbance) = self.disturb_write?;
        let mut parser = FrameParser::default();
        let is_match = bytes.iter().any(|byte| match parser.push(*byte) {
            ParserEvent::Frame(SerialFrame {
                opcode: 0x68,
                data: [_, low, high, _, written @ ..],
            }) => u16::from_le_bytes([*low, *high]) == index && written == value.to_le_bytes(),
            _ => false,
        });
        if is_match {
            self.disturb_write = None;
        }
        is_match.then_some(disturbance)
    }

    fn reply(&mut self, reply: Reply, arrival: Nanos, disturbance: Disturbance) {
        let mut wire = self.encode(reply.data());
        let mut begin = arrival.max(self.busy_until) + PROCESSING;
        match disturbance {
            Disturbance::LoseReply => return,
            Disturbance::DelayReply(span) => begin = begin + span,
            Disturbance::FlipReply(index) => flip(&mut wire, index),
            Disturbance::DropReplyByte(index) => drop(wire.remove(index % wire.len())),
            Disturbance::DuplicateReplyByte(index) => {
                wire.insert(index % wire.len(), wire[index % wire.len()])
            }
            Disturbance::TruncateReply(length) => wire.truncate(length % wire.len()),
            Disturbance::Noise => drop(wire.splice(0..0, [0x00, 0x90, 0x41])),
            Disturbance::StrayReply => {
                let stray = self.encode(&[0, 0, 0, 0, 9, 9, 0, 0]);
                drop(wire.splice(0..0, stray));
            }
            _ => {}
        }
        self.busy_until = begin;
        for (index, byte) in wire.into_iter().enumerate() {
            let instant = begin + Nanos(self.byte_time.0 * (index as u64 + 1)) + self.adapter_hold;
            self.inbox.push_back((instant, byte));
        }
    }

    fn encode(&mut self, data: &[u8]) -> Vec<u8> {
        let frame = SerialFrame { opcode: 0, data };
        self.encoder.encode(frame).unwrap().to_vec()
    }
}

fn flip(bytes: &mut [u8], index: usize) {
    let length = bytes.len();
    bytes[index % length] ^= 1 << (index % 8);
}

fn header(frame: &SerialFrame<'_>) -> ReceivedRequest {
    let (node, index, subindex, value) = match *frame.data {
        [node, low, high, subindex, ref value @ ..] => {
            let value = value.try_into().map_or(0, u32::from_le_bytes);
            (node, u16::from_le_bytes([low, high]), subindex, value)
        }
        _ => (0, 0, 0, 0),
    };
    ReceivedRequest { opcode: frame.opcode, node, index, subindex, value, arrived: Nanos::ZERO }
}

fn answer(drives: &mut [MiniDrive], frame: &SerialFrame<'_>) -> Reply {
    let ReceivedRequest { node, index, subindex, .. } = header(frame);
    let mut drives = drives.iter_mut();
    let Some(drive) = drives.find(|drive| node == 0 || drive.node == node) else {
        return Reply::error(0x0504_0000);
    };
    match (frame.opcode, frame.data) {
        (0x60, [_, _, _, _]) => drive.read(index, subindex),
        (0x68, &[_, _, _, _, a, b, c, d]) => {
            drive.write(index, subindex, u32::from_le_bytes([a, b, c, d]))
        }
        (0x81, [_, _, _, _]) => drive.read_long(index, subindex),
        _ => Reply::error(0x0F00_FFBF),
    }
}

impl Transport for SimulatedLine {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut state = self.state();
        if state.hung_up {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        state.request(bytes);
        Ok(())
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        let mut state = self.state();
        if state.hung_up {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let delay = if deadline > state.now { state.host_delay } else { Nanos::ZERO };
        state.now = state.now + delay;
        match state.inbox.front() {
            Some(&(arrival, _)) if arrival <= deadline => state.now = state.now.max(arrival),
            Some(&(arrival, _)) if arrival <= state.now => {}
            _ => {
                let now = state.now.max(deadline);
                advance(state, now);
                return Ok(0);
            }
        }
        let now = state.now;
        advance(state, now);
        let mut state = self.state();
        let mut count = 0;
        while let (Some(free), Some(&(arrival, byte))) = (into.get_mut(count), state.inbox.front())
            && arrival <= now
        {
            *free = byte;
            count += 1;
            state.inbox.pop_front();
        }
        Ok(count)
    }

    fn is_our_turn(&mut self) -> bool {
        !self.state().is_taken
    }

    fn now(&self) -> Nanos {
        self.state().now
    }

    fn sleep_until(&mut self, until: Nanos) {
        let state = self.state();
        let now = state.now.max(until);
        advance(state, now);
    }
}

/// Runs scheduled actions, before the host continues.
#[derive(Default)]
struct Planned(Vec<(Nanos, Act)>);

impl fmt::Debug for Planned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} planned", self.0.len())
    }
}

fn advance(mut state: MutexGuard<'_, LineState>, now: Nanos) {
    state.now = now;
    let due: Vec<_> = state.planned.0.extract_if(.., |(at, _)| *at <= now).collect();
    drop(state);
    due.into_iter().for_each(|(_, act)| act());
}

pub fn port_config(drives: &[MiniDrive]) -> PortConfig {
    let axis = |(motor, drive): (usize, &MiniDrive)| AxisConfig {
        node_id: drive.node,
        ..fast_axis(motor, drive.serial_number, [Counts(-2000), Counts(2000)])
    };
    let axes = drives.iter().enumerate().map(axis).collect();
    PortConfig::new("/dev/simulated".into(), axes)
}
