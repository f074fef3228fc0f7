//! Tests of the drive from the host's side: states, modes of operation, services.

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
    fn with(change: impl FnOnce(&mut DriveConfig)) -> Self {
        let mut config = DriveConfig::default();
        change(&mut config);
        Self { drive: Drive::new(&config, 0.0) }
    }

    fn fresh() -> Self {
        Self::with(|_| {})
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

    fn run(&mut self, seconds: f64) -> &mut Self {
        for _ in 0..(seconds / DT_S) as usize {
            self.drive.advance(DT_S);
        }
        self
    }

    fn host_bugs(&mut self) -> Vec<EventKind> {
        let mut events = self.drive.take_events();
        events.retain(|event| matches!(event, EventKind::HostBug(_)));
        events
    }
}

#[test]
fn disabling_operation_ramps_down_before_the_power_goes() {
    let mut bench = DriveUnderTest::enabled(Mode::ProfileVelocity);
    bench.write(0x60FF, 0, 1000);
    bench.run(0.5);
    bench.write(0x6040, 0, 0x07);
    assert_eq!(bench.state(), 0x27, "one command must finish before the next");
    bench.write(0x6040, 0, 0x06);
    assert_eq!(bench.run(0.05).state(), 0x27);
    assert_eq!(bench.run(0.2).state(), 0x21, "the second command waited for the ramp");
    assert!(bench.drive.motor.is_at_standstill());
}

#[test]
fn shutdown_cuts_the_power_or_ramps_as_configured() {
    for (option, masked) in [(0, 0x21), (1, 0x27)] {
        let mut bench = DriveUnderTest::enabled(Mode::ProfileVelocity);
        bench.writes([(0x605B, option), (0x60FF, 1000)]);
        bench.run(0.5);
        bench.write(0x6040, 0, 0x06);
        assert_eq!(bench.state(), masked);
        assert_eq!(bench.run(0.5).state(), 0x21);
    }
}

#[test]
fn a_silent_line_keeps_the_last_demand() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.write(0x607A, 0, 500);
    assert!(bench.run(100.0).is_at(500));
    assert_eq!(bench.state(), 0x27);
}

#[test]
fn homing_needs_the_edge_and_the_enabled_state() {
    let mut bench = DriveUnderTest::fresh();
    bench.writes([(0x6060, 6), (0x6098, 37), (0x6040, 0x1F)]);
    assert_eq!(bench.statusword() & 0x8000, 0);
}

#[test]
fn unsupported_homing_methods_fail() {
    let mut bench = DriveUnderTest::enabled(Mode::Homing);
    bench.writes([(0x6098, -1), (0x6040, 0x1F)]);
    assert_eq!(bench.statusword() & 0xA400, 0x2000);
}

#[test]
fn the_fault_reaction_follows_the_class_and_the_option() {
    for (code, option, immediately) in
        [(0x8611, 2, false), (0x8611, 0, true), (0x8130, 2, false), (0x3220, 2, true)]
    {
        let mut bench = DriveUnderTest::enabled(Mode::ProfileVelocity);
        bench.writes([(0x605E, option), (0x60FF, 1000)]);
        bench.run(0.5);
        bench.drive.raise(Fault(code), false);
        assert_eq!(bench.state(), if immediately { 0x08 } else { 0x0F }, "{code:04X}");
        assert_eq!(bench.run(0.5).state(), 0x08);
    }
}

#[test]
fn the_history_is_newest_first_and_can_be_cleared() {
    let mut bench = DriveUnderTest::with(|config| config.boot_fault = Some(0x8120));
    assert_eq!(bench.state(), 0x08);
    bench.drive.raise(Fault(0x2310), false);
    assert_eq!(bench.read(0x1003, 0) & 0xFF, 2);
    assert_eq!((bench.read(0x1003, 1), bench.read(0x1003, 2)), (0x2310, 0x8120));
    assert_eq!(bench.try_write(0x1003, 0, 7), Err(0x0609_0030));
    bench.write(0x1003, 0, 0);
    assert_eq!(bench.read(0x1003, 0) & 0xFF, 0);
    assert_eq!(bench.read(0x1003, 1), 0);
}

#[test]
fn resetting_a_sensor_fault_loses_the_position() {
    let mut bench = DriveUnderTest::enabled(Mode::Homing);
    bench.writes([(0x6098, 37), (0x6040, 0x1F)]);
    bench.drive.raise(Fault(0x7380), false);
    assert_ne!(bench.statusword() & 0x8000, 0);
    bench.write(0x6040, 0, 0x80);
    assert_eq!(bench.statusword() & 0x806F, 0x0040);
}

#[test]
fn an_old_target_is_a_step_at_enable() {
    let mut bench = DriveUnderTest::fresh();
    bench.writes([(0x607A, 700), (0x6060, 8), (0x6040, 0x06), (0x6040, 0x0F)]);
    assert!(bench.run(0.2).is_at(700));
}

#[test]
fn a_step_beyond_the_window_is_a_following_error() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.writes([(0x6065, 300), (0x607A, 301)]);
    assert_eq!(bench.run(0.001).error_code(), 0x8611);
    assert_eq!(bench.run(0.5).state(), 0x08);
    assert_eq!(bench.read(0x1001, 0) & 0xFF, 0x81);
}

#[test]
fn a_target_beyond_the_limits_is_a_fault() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.write(0x607D, 1, -100);
    bench.write(0x607D, 2, 100);
    bench.write(0x607A, 0, 100);
    assert_eq!(bench.run(0.1).error_code(), 0);
    bench.write(0x607A, 0, 101);
    assert_eq!(bench.run(0.1).error_code(), 0x8A82);
    assert!(bench.position() <= 101);
}

#[test]
fn halt_holds_and_ignores_targets() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.writes([(0x6040, 0x010F), (0x607A, 200)]);
    assert_eq!(bench.run(0.2).position(), 0);
    bench.write(0x6040, 0, 0x000F);
    assert!(bench.run(0.2).is_at(200));
}

#[test]
fn interpolation_expects_set_points_in_time() {
    let mut bench = DriveUnderTest::enabled(Mode::CyclicPosition);
    bench.write(0x60C2, 1, 10);
    bench.write(0x607A, 0, 1);
    assert_eq!(bench.run(0.019).error_code(), 0);
    assert_eq!(bench.run(0.003).error_code(), 0x8250);
}

#[test]
fn the_handshake_moves_the_motor() {
    let mut bench = DriveUnderTest::enabled(Mode::ProfilePosition);
    bench.writes([(0x607A, 1500), (0x6040, 0x3F)]);
    let statusword = bench.statusword();
    assert!(statusword & 0x1000 != 0 && statusword & 0x0400 == 0);
    bench.write(0x6040, 0, 0x0F);
    assert_eq!(bench.statusword() & 0x1000, 0);
    assert!(bench.run(2.0).is_at(1500));
    assert!(bench.statusword() & 0x0400 != 0);
    assert_eq!(bench.host_bugs(), []);
}

#[test]
fn a_target_without_a_new_edge_is_ignored() {
    let mut bench = DriveUnderTest::enabled(Mode::ProfilePosition);
    bench.writes([(0x607A, 100), (0x6040, 0x3F), (0x607A, 900), (0x6040, 0x3F)]);
    assert_eq!(bench.host_bugs(), [EventKind::HostBug(HostBug::SetpointIgnored)]);
    assert!(bench.run(2.0).is_at(100));
}

#[test]
fn targets_queue_or_replace_as_commanded() {
    let mut bench = DriveUnderTest::enabled(Mode::ProfilePosition);
    for (target, controlword) in [(20_000, 0x1F), (100, 0x1F)] {
        bench.writes([(0x607A, target), (0x6040, controlword), (0x6040, 0x0F)]);
    }
    assert!(bench.run(1.0).position() > 5_000, "the second waits for the first");
    bench.writes([(0x607A, -50), (0x6040, 0x3F), (0x6040, 0x0F)]);
    assert!(bench.run(5.0).is_at(-50), "immediately: both are dropped");
}

#[test]
fn relative_targets_start_from_here_and_halt_interrupts() {
    let mut bench = DriveUnderTest::enabled(Mode::ProfilePosition);
    bench.writes([(0x607A, 3000), (0x6040, 0x7F)]);
    bench.run(0.05);
    bench.write(0x6040, 0, 0x010F);
    let stopped = bench.run(1.0).position();
    assert!(stopped > 10 && stopped < 2500, "{stopped}");
    bench.write(0x6040, 0, 0x000F);
    assert!(bench.run(1.0).is_at(3000));
}

#[test]
fn wrong_crc_and_unknown_opcode_give_an_error_reply() {
    let mut bench = DriveUnderTest::fresh();
    let wrong_crc = bench.drive.reply_at_port(&Incoming::WrongCrc, None).unwrap();
    let frame = [0x90, 0x02, 0x00, 0x02, 0x04, 0x00, 0x04, 0x05, 0xF1, 0xE8];
    assert_eq!(reply(&wrong_crc.data), frame);
    assert_eq!(bench.error(0x20, &[0; 12]), 0x0F00_FFBF);
    assert_eq!(bench.error(0x10, &[0x41, 0x60, 0, 1]), 0x0F00_FFBF, "an opcode of the EPOS2");
    let events = bench.drive.take_events();
    assert!(events.contains(&EventKind::Line(LineTrouble::Crc)));
    assert!(events.contains(&EventKind::HostBug(HostBug::Opcode(0x20))));
}

#[test]
fn each_wrong_access_has_its_own_abort_code() {
    let mut bench = DriveUnderTest::fresh();
    assert_eq!(bench.try_read(0x5000, 0), Err(0x0602_0000));
    assert_eq!(bench.try_read(0x607D, 9), Err(0x0609_0011));
    assert_eq!(bench.try_write(0x6064, 0, 5), Err(0x0601_0002));
    assert_eq!(bench.try_write(0x605A, 0, 5), Err(0x0609_0030));
    assert_eq!(bench.try_write(0x6060, 0, -1), Err(0x0609_0030));
    assert_eq!(bench.error(0x60, &[1, 0x41]), 0x0607_0010);
    assert_eq!(bench.try_read(0x1008, 0), Err(0x0607_0010), "too long for a simple read");
    let mut enabled = DriveUnderTest::enabled(Mode::CyclicPosition);
    assert_eq!(enabled.try_write(0x3010, 1, 500), Err(0x0800_0022));
}

#[test]
fn the_error_reply_to_a_read_has_the_configured_length() {
    for words in [2, 4] {
        let mut bench = DriveUnderTest::with(|config| config.error_reply_words = words);
        assert_eq!(bench.request(0x60, &[1, 0, 0x50, 0]).len(), 2 * usize::from(words));
    }
}

#[test]
fn the_unused_bytes_of_short_values_are_garbage() {
    let mut bench = DriveUnderTest::fresh();
    let value = bench.read(0x6041, 0);
    assert_eq!(value & 0xFFFF, 0x0040);
    assert_ne!(value >> 16, 0, "a host has to mask the value");
    let mut clean = DriveUnderTest::with(|config| config.fill_unused_bytes = false);
    assert_eq!(clean.read(0x6041, 0), 0x0040);
}

#[test]
fn other_nodes_time_out_late() {
    let mut bench = DriveUnderTest::fresh();
    for node in [0, 1] {
        assert_eq!(bench.error(0x60, &[node, 0x41, 0x60, 0]), 0);
    }
    let reply = bench.reply(0x60, &[2, 0x41, 0x60, 0]).unwrap();
    assert!(reply.delay > Nanos::ZERO);
    assert_eq!(bench.error(0x60, &[2, 0x41, 0x60, 0]), 0x0504_0000);
}

#[test]
fn identity_is_read_in_segments() {
    let mut bench =
        DriveUnderTest::with(|config| (config.serial_number, config.segment_bytes) = (77, 3));
    assert_eq!(bench.read(0x1018, 1), 0xFB);
    assert_eq!(bench.read(0x1018, 4), 77);
    let first = bench.request(0x81, &[1, 0x00, 0x21, 1]);
    assert_eq!(first[4..9], [8, 0, 0, 0, 3]);
    let second = bench.request(0x62, &[0, 0]);
    assert_eq!(second[4..6], [3, 0], "toggle 0, more to come");
    let third = bench.request(0x62, &[1, 0]);
    assert_eq!(third[4..6], [2, 3], "toggle 1, last");
    let serial = [&first[9..12], &second[6..9], &third[6..8]].concat();
    assert_eq!(u64::from_le_bytes(serial.try_into().unwrap()), 0x1_0000_0000 + 77);
    assert_eq!(bench.error(0x62, &[0, 0]), 0x0503_0000, "nothing left");
    assert_eq!(bench.request(0x81, &[1, 0x08, 0x10, 0])[4..9], [5, 0, 0, 0, 3]);
    assert_eq!(bench.error(0x62, &[1, 0]), 0x0503_0000, "wrong toggle");
}

#[test]
fn values_are_written_in_segments() {
    let mut bench = DriveUnderTest::fresh();
    assert_eq!(bench.error(0x69, &[1, 0x7A, 0x60, 0, 4, 0, 0, 0]), 0);
    assert_eq!(bench.request(0x6A, &[2, 0, 0x39, 0x30])[4..6], [2, 0]);
    assert_eq!(bench.request(0x6A, &[2, 3, 0, 0])[..4], [0; 4]);
    assert_eq!(bench.read(0x607A, 0), 12345);
}

#[test]
fn storing_needs_its_signature_and_survives_a_reset() {
    let mut bench = DriveUnderTest::fresh();
    assert_eq!(bench.try_write(0x1010, 1, 1), Err(0x0800_0020));
    bench.write(0x2005, 0, 60);
    bench.write(0x1010, 1, 0x6576_6173);
    bench.write(0x6065, 0, 123);
    bench.drive.power_cycle();
    assert_eq!(bench.run(0.5).read(0x2005, 0) & 0xFFFF, 60);
    assert_eq!(bench.read(0x6065, 0), 2000);
    assert_eq!(bench.drive.frame_timeout(), Nanos::from_millis(60));
}
