//! Tests of the drive from the host's side, grouped by kind of request.

mod modes;
mod services;
mod states;

use i2ris::units::Nanos;

use super::event::{EventKind, HostBug, LineTrouble};
use super::*;
use crate::drive::frame::{Incoming, Parser, Request, reply};

const DT_S: f64 = 0.0005;

/// A drive, and a host that exchanges frames with it.
struct DriveUnderTest {
    drive: Drive,
}

impl DriveUnderTest {
    fn new(config: DriveConfig) -> Self {
        Self { drive: Drive::new(&config, 0.0) }
    }

    fn fresh() -> Self {
        Self::new(DriveConfig::default())
    }

    /// A drive in a mode of operation, enabled.
    fn enabled(mode: Mode) -> Self {
        let mut bench = Self::fresh();
        bench.writes([(0x6060, i64::from(mode.number())), (0x6040, 0x06), (0x6040, 0x0F)]);
        assert_eq!(bench.drive.state, State::OperationEnabled);
        bench
    }

    /// The reply to a request, unless the drive is booting.
    fn reply(&mut self, opcode: u8, data: &[u8]) -> Option<Reply> {
        let data = data.to_vec();
        self.drive.reply_at_port(&Incoming::Request(Request { opcode, data }), None)
    }

    /// The data of the reply, through the frame.
    fn request(&mut self, opcode: u8, data: &[u8]) -> Vec<u8> {
        let frame = reply(&self.reply(opcode, data).unwrap().data);
        let mut parser = Parser::default();
        match frame.iter().find_map(|byte| parser.push(*byte)) {
            Some(Incoming::Request(reply)) if reply.opcode == 0 => reply.data,
            other => panic!("not a reply: {other:?}"),
        }
    }

    fn error(&mut self, opcode: u8, data: &[u8]) -> u32 {
        u32::from_le_bytes(self.request(opcode, data)[..4].try_into().unwrap())
    }

    fn try_read(&mut self, index: u16, sub: u8) -> Result<u32, u32> {
        let [low, high] = index.to_le_bytes();
        let reply = self.request(0x60, &[1, low, high, sub]);
        match u32::from_le_bytes(reply[..4].try_into().unwrap()) {
            0 => Ok(u32::from_le_bytes(reply[4..8].try_into().unwrap())),
            abort => Err(abort),
        }
    }

    fn read(&mut self, index: u16, sub: u8) -> u32 {
        self.try_read(index, sub).unwrap()
    }

    fn try_write(&mut self, index: u16, sub: u8, value: i64) -> Result<(), u32> {
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), (value as u32).to_le_bytes());
        let abort = self.error(0x68, &[1, low, high, sub, a, b, c, d]);
        if abort == 0 { Ok(()) } else { Err(abort) }
    }

    fn write(&mut self, index: u16, sub: u8, value: i64) {
        self.try_write(index, sub, value).unwrap();
    }

    /// Writes objects without subindex.
    fn writes<const N: usize>(&mut self, objects: [(u16, i64); N]) {
        objects.into_iter().for_each(|(index, value)| self.write(index, 0, value));
    }

    fn statusword(&mut self) -> u16 {
        self.read(0x6041, 0) as u16
    }

    /// The state bits of the statusword.
    fn state(&mut self) -> u16 {
        self.statusword() & 0x6F
    }

    fn error_code(&mut self) -> u32 {
        self.read(0x603F, 0) & 0xFFFF
    }

    fn position(&mut self) -> i32 {
        self.read(0x6064, 0) as i32
    }

    fn is_at(&mut self, counts: i32) -> bool {
        (self.position() - counts).abs() <= 1
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / DT_S) as usize {
            self.drive.advance(DT_S);
        }
    }

    fn host_bugs(&mut self) -> Vec<EventKind> {
        let mut events = self.drive.take_events();
        events.retain(|event| matches!(event, EventKind::HostBug(_)));
        events
    }
}
