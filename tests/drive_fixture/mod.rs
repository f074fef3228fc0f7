//! A line with small drives behind it, in simulated time: exact, and as fast as the processor.
//!
//! It speaks through the controller's own frame codec, so it proves nothing about frames; the
//! emulator does that, with a codec of its own. It exists to place damage, delays and states
//! exactly where a test wants them.
#![allow(dead_code, reason = "every test binary uses its own part")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may")]

mod mini_drive;
pub mod rig;

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard};

use i2ris::config::{AxisConfig, PortConfig};
use i2ris::drive::frame::{Damage, Encoder, Frame, MAX_ENCODED, Parsed, Parser};
use i2ris::drive::transport::Transport;
use i2ris::units::{Counts, Nanos};

pub use mini_drive::*;

pub const SERIAL_NUMBER: u32 = 0x6215_0001;

/// How long the drive thinks about a request.
const PROCESSING: Nanos = Nanos::from_micros(300);

/// What happens to a request or to its reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mischief {
    Nothing,
    /// The request is lost on the way.
    LoseRequest,
    /// A bit of this byte of the request is flipped.
    FlipRequest(usize),
    /// The request is cut after this many bytes.
    CutRequest(usize),
    /// It is carried out, but the reply is lost.
    LoseReply,
    /// It is carried out, but the reply comes this much later.
    DelayReply(Nanos),
    /// A bit of this byte of the reply is flipped.
    FlipReply(usize),
    /// This byte of the reply is dropped.
    DropReplyByte(usize),
    /// This byte of the reply comes twice.
    DoubleReplyByte(usize),
    /// The reply is cut after this many bytes.
    CutReply(usize),
    /// Noise comes before the reply.
    Noise,
    /// A reply to something else comes before the reply.
    Stray,
}

/// A line in simulated time. Clones are handles to the same line.
#[derive(Clone, Debug)]
pub struct Bench(Arc<Mutex<World>>);

#[derive(Debug)]
pub struct World {
    pub now: Nanos,
    pub drives: Vec<MiniDrive>,
    /// What happens to the next requests, in order; nothing when it is empty.
    pub mischief: VecDeque<Mischief>,
    /// Nothing answers any more.
    pub dead: bool,
    /// Nothing answers before this instant.
    pub booting_until: Nanos,
    /// This node answers nothing; the others do.
    pub deaf: Option<u8>,
    /// Happens to the next write of this value to this object.
    pub ambush: Option<(u16, u32, Mischief)>,
    /// The host looks at the line only this long after it meant to.
    pub stall: Nanos,
    /// The cable is pulled.
    pub hung_up: bool,
    /// Requests that were sent before the former one was answered or its time was over.
    pub pipelined: u32,
    /// Opcode, node, index, subindex of every request that arrived whole.
    pub requests: Vec<(Nanos, u8, u8, u16, u8)>,
    byte_time: Nanos,
    busy_until: Nanos,
    inbox: VecDeque<(Nanos, u8)>,
    parser: Parser,
    encoder: Encoder,
}

impl Bench {
    /// A line at 115200 baud with these drives; the first one owns the port.
    pub fn new(drives: Vec<MiniDrive>) -> Self {
        Self(Arc::new(Mutex::new(World {
            now: Nanos::from_millis(1000),
            drives,
            mischief: VecDeque::new(),
            dead: false,
            booting_until: Nanos::ZERO,
            deaf: None,
            ambush: None,
            stall: Nanos::ZERO,
            hung_up: false,
            pipelined: 0,
            requests: Vec::with_capacity(100_000),
            byte_time: Nanos(86_806),
            busy_until: Nanos::ZERO,
            inbox: VecDeque::with_capacity(4 * MAX_ENCODED),
            parser: Parser::default(),
            encoder: Encoder::default(),
        })))
    }

    pub fn world(&self) -> MutexGuard<'_, World> {
        self.0.lock().unwrap()
    }

    /// The present instant of the line.
    pub fn time(&self) -> Nanos {
        self.world().now
    }

    /// Looks at or changes the drive with a node id.
    pub fn drive<R>(&self, node: u8, look: impl FnOnce(&mut MiniDrive) -> R) -> R {
        look(
            self.world()
                .drives
                .iter_mut()
                .find(|drive| drive.node == node)
                .expect("no such node"),
        )
    }

    /// Power off and on again; the drive answers again after `boot`.
    pub fn restart(&self, node: u8, boot: Nanos) {
        self.drive(node, MiniDrive::restart);
        let mut world = self.world();
        world.booting_until = world.now + boot;
        world.inbox.clear();
    }

    /// A request of a controller that died a moment ago: its reply is on the way.
    pub fn leave_a_request(&self) {
        self.world()
            .request(&[0x90, 0x02, 0x60, 0x02, 0x01, 0x64, 0x60, 0x00, 0x29, 0x5A]);
    }

    pub fn misbehave(&self, mischief: impl IntoIterator<Item = Mischief>) {
        self.world().mischief.extend(mischief);
    }
}

impl World {
    fn request(&mut self, bytes: &[u8]) {
        if !self.inbox.is_empty() {
            self.pipelined += 1;
        }
        let mischief = self
            .ambushed(bytes)
            .or_else(|| self.mischief.pop_front())
            .unwrap_or(Mischief::Nothing);
        if self.dead || self.now < self.booting_until || mischief == Mischief::LoseRequest {
            return;
        }
        let mut bytes = bytes.to_vec();
        match mischief {
            Mischief::FlipRequest(place) => flip(&mut bytes, place),
            Mischief::CutRequest(length) => bytes.truncate(length % bytes.len()),
            _ => {}
        }
        let arrival = self.now + Nanos(self.byte_time.0 * bytes.len() as u64);
        for byte in bytes {
            let reply = match self.parser.push(byte) {
                Parsed::Nothing | Parsed::Damaged(Damage::LostSync) => continue,
                Parsed::Damaged(Damage::Crc) => Reply::error(0x0504_0004),
                Parsed::Frame(frame) => {
                    let (opcode, node, index, subindex) = address(&frame);
                    if self.deaf == Some(node) {
                        return;
                    }
                    self.requests
                        .push((self.now, opcode, node, index, subindex));
                    answer(&mut self.drives, &frame)
                }
            };
            self.reply(reply, arrival, mischief);
        }
    }

    fn ambushed(&mut self, bytes: &[u8]) -> Option<Mischief> {
        let (index, value, mischief) = self.ambush?;
        let mut parser = Parser::default();
        let hit = bytes.iter().any(|byte| match parser.push(*byte) {
            Parsed::Frame(Frame {
                opcode: 0x68,
                data: [_, low, high, _, written @ ..],
            }) => {
                (
                    u16::from_le_bytes([*low, *high]),
                    u32::from_le_bytes(written.try_into().unwrap()),
                ) == (index, value)
            }
            _ => false,
        });
        if hit {
            self.ambush = None;
        }
        hit.then_some(mischief)
    }

    fn reply(&mut self, reply: Reply, arrival: Nanos, mischief: Mischief) {
        let wire = self
            .encoder
            .encode(Frame {
                opcode: 0,
                data: reply.data(),
            })
            .unwrap();
        let mut wire = wire.to_vec();
        let mut begin = arrival.max(self.busy_until) + PROCESSING;
        match mischief {
            Mischief::LoseReply => return,
            Mischief::DelayReply(span) => begin = begin + span,
            Mischief::FlipReply(place) => flip(&mut wire, place),
            Mischief::DropReplyByte(place) => drop(wire.remove(place % wire.len())),
            Mischief::DoubleReplyByte(place) => {
                wire.insert(place % wire.len(), wire[place % wire.len()])
            }
            Mischief::CutReply(length) => wire.truncate(length % wire.len()),
            Mischief::Noise => drop(wire.splice(0..0, [0x00, 0x90, 0x41])),
            Mischief::Stray => {
                let stray = self
                    .encoder
                    .encode(Frame {
                        opcode: 0,
                        data: &[0, 0, 0, 0, 9, 9, 0, 0],
                    })
                    .unwrap();
                drop(wire.splice(0..0, stray.iter().copied()));
            }
            _ => {}
        }
        self.busy_until = begin;
        for (place, byte) in wire.into_iter().enumerate() {
            self.inbox
                .push_back((begin + Nanos(self.byte_time.0 * (place as u64 + 1)), byte));
        }
    }
}

fn flip(bytes: &mut [u8], place: usize) {
    let length = bytes.len();
    bytes[place % length] ^= 1 << (place % 8);
}

fn address(frame: &Frame<'_>) -> (u8, u8, u16, u8) {
    match *frame.data {
        [node, low, high, subindex, ..] => (
            frame.opcode,
            node,
            u16::from_le_bytes([low, high]),
            subindex,
        ),
        _ => (frame.opcode, 0, 0, 0),
    }
}

fn answer(drives: &mut [MiniDrive], frame: &Frame<'_>) -> Reply {
    let (opcode, node, index, subindex) = address(frame);
    let place = if node == 0 {
        Some(0)
    } else {
        drives.iter().position(|drive| drive.node == node)
    };
    let Some(drive) = place.and_then(|place| drives.get_mut(place)) else {
        return Reply::error(0x0504_0000);
    };
    match (opcode, frame.data) {
        (0x60, [_, _, _, _]) => drive.read(index, subindex),
        (0x68, [_, _, _, _, value @ ..]) => drive.write(
            index,
            subindex,
            u32::from_le_bytes(value.try_into().unwrap()),
        ),
        (0x81, [_, _, _, _]) => drive.read_long(index, subindex),
        _ => Reply::error(0x0F00_FFBF),
    }
}

impl Transport for Bench {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut world = self.world();
        if world.hung_up {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        world.request(bytes);
        Ok(())
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        let mut world = self.world();
        if world.hung_up {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let stall = if deadline > world.now {
            world.stall
        } else {
            Nanos::ZERO
        };
        world.now = world.now + stall;
        match world.inbox.front() {
            Some(&(arrival, _)) if arrival <= deadline => world.now = world.now.max(arrival),
            Some(&(arrival, _)) if arrival <= world.now => {}
            _ => {
                world.now = world.now.max(deadline);
                return Ok(0);
            }
        }
        let now = world.now;
        let mut count = 0;
        while let (Some(place), Some(&(arrival, byte))) = (into.get_mut(count), world.inbox.front())
            && arrival <= now
        {
            *place = byte;
            count += 1;
            world.inbox.pop_front();
        }
        Ok(count)
    }

    fn now(&self) -> Nanos {
        self.world().now
    }

    fn sleep_until(&mut self, until: Nanos) {
        let mut world = self.world();
        world.now = world.now.max(until);
    }
}

/// A port with one axis per drive.
pub fn port_config(drives: &[MiniDrive]) -> PortConfig {
    let axes = drives
        .iter()
        .enumerate()
        .map(|(motor, drive)| AxisConfig {
            node_id: drive.node,
            ..AxisConfig::new(motor, drive.serial_number, [Counts(-2000), Counts(2000)])
        })
        .collect();
    // Tests write a request when something changes, and no others.
    PortConfig {
        loop_timeout_ms: 0,
        ..PortConfig::new("/dev/bench".into(), axes)
    }
}
