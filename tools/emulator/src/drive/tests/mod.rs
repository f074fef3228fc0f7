//! What the drive promises, grouped by what it is asked.

mod modes;
mod services;
mod states;

use super::*;
use crate::frame::{Incoming, Parser, Request};
use crate::log::{HostBug, LineTrouble};

const DT_S: f64 = 0.0005;

/// A drive, and a host that speaks to it in frames.
struct Bench {
    drive: Drive,
}

impl Bench {
    fn new(config: DriveConfig) -> Self {
        Self {
            drive: Drive::new(&config, 0.0),
        }
    }

    fn fresh() -> Self {
        Self::new(DriveConfig::default())
    }

    /// A drive in a mode of operation, enabled.
    fn enabled(mode: Mode) -> Self {
        let mut bench = Self::fresh();
        bench.write(0x6060, 0, i64::from(mode.number()));
        bench.write(0x6040, 0, 0x06);
        bench.write(0x6040, 0, 0x0F);
        assert_eq!(bench.drive.state, State::OperationEnabled);
        bench
    }

    /// The data of the reply.
    fn ask(&mut self, opcode: u8, data: &[u8]) -> Vec<u8> {
        let request = Incoming::Request(Request {
            opcode,
            data: data.to_vec(),
        });
        let frame = crate::frame::reply(&self.drive.answer(&request).unwrap().data);
        let mut parser = Parser::default();
        match frame.iter().find_map(|byte| parser.push(*byte)) {
            Some(Incoming::Request(reply)) if reply.opcode == 0 => reply.data,
            other => panic!("not a reply: {other:?}"),
        }
    }

    fn error(&mut self, opcode: u8, data: &[u8]) -> u32 {
        u32::from_le_bytes(self.ask(opcode, data)[..4].try_into().unwrap())
    }

    fn try_read(&mut self, index: u16, sub: u8) -> Result<u32, u32> {
        let reply = self.ask(0x60, &[&[1][..], &index.to_le_bytes(), &[sub]].concat());
        match u32::from_le_bytes(reply[..4].try_into().unwrap()) {
            0 => Ok(u32::from_le_bytes(reply[4..8].try_into().unwrap())),
            abort => Err(abort),
        }
    }

    fn read(&mut self, index: u16, sub: u8) -> u32 {
        self.try_read(index, sub).unwrap()
    }

    fn try_write(&mut self, index: u16, sub: u8, value: i64) -> Result<(), u32> {
        let data = [
            &[1][..],
            &index.to_le_bytes(),
            &[sub],
            &(value as u32).to_le_bytes(),
        ]
        .concat();
        let abort = self.error(0x68, &data);
        if abort == 0 { Ok(()) } else { Err(abort) }
    }

    fn write(&mut self, index: u16, sub: u8, value: i64) {
        self.try_write(index, sub, value).unwrap();
    }

    fn statusword(&mut self) -> u16 {
        self.read(0x6041, 0) as u16
    }

    fn position(&mut self) -> i32 {
        self.read(0x6064, 0) as i32
    }

    fn run(&mut self, seconds: f64) {
        (0..(seconds / DT_S) as usize).for_each(|_| self.drive.advance(DT_S));
    }

    fn host_bugs(&mut self) -> Vec<HostBug> {
        let bugs = self.drive.take_events().into_iter();
        bugs.filter_map(|event| {
            if let EventKind::HostBug(bug) = event {
                Some(bug)
            } else {
                None
            }
        })
        .collect()
    }
}
