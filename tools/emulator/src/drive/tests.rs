//! What the drive promises, grouped by what it is asked.

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
        Self { drive: Drive::new(&config, 0.0) }
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
        let request = Incoming::Request(Request { opcode, data: data.to_vec() });
        let frame = self.drive.answer(&request).unwrap().frame;
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
        let data = [&[1][..], &index.to_le_bytes(), &[sub], &(value as u32).to_le_bytes()].concat();
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
        bugs.filter_map(|event| if let EventKind::HostBug(bug) = event { Some(bug) } else { None }).collect()
    }
}

mod service {
    use super::*;

    #[test]
    fn a_wrong_crc_and_an_unknown_opcode_are_answered() {
        let mut bench = Bench::fresh();
        let answer = bench.drive.answer(&Incoming::WrongCrc).unwrap();
        assert_eq!(answer.frame, [0x90, 0x02, 0x00, 0x02, 0x04, 0x00, 0x04, 0x05, 0xF1, 0xE8]);
        assert_eq!(bench.error(0x20, &[0; 12]), 0x0F00_FFBF);
        assert_eq!(bench.error(0x10, &[0x41, 0x60, 0, 1]), 0x0F00_FFBF, "an opcode of the EPOS2");
        let events = bench.drive.take_events();
        assert!(events.contains(&EventKind::Line(LineTrouble::Crc)));
        assert!(events.contains(&EventKind::HostBug(HostBug::Opcode(0x20))));
    }

    #[test]
    fn accesses_that_are_wrong_are_refused_by_their_own_code() {
        let mut bench = Bench::fresh();
        assert_eq!(bench.try_read(0x5000, 0), Err(0x0602_0000));
        assert_eq!(bench.try_read(0x607D, 9), Err(0x0609_0011));
        assert_eq!(bench.try_write(0x6064, 0, 5), Err(0x0601_0002));
        assert_eq!(bench.try_write(0x605A, 0, 5), Err(0x0609_0030));
        assert_eq!(bench.try_write(0x6060, 0, -1), Err(0x0609_0030));
        assert_eq!(bench.error(0x60, &[1, 0x41]), 0x0607_0010);
        assert_eq!(bench.try_read(0x1008, 0), Err(0x0607_0010), "too long for a simple read");
        let mut enabled = Bench::enabled(Mode::CyclicPosition);
        assert_eq!(enabled.try_write(0x3010, 1, 500), Err(0x0800_0022));
    }

    #[test]
    fn an_error_reply_to_a_read_is_as_long_as_configured() {
        for words in [2, 4] {
            let mut bench = Bench::new(DriveConfig { error_reply_words: words, ..DriveConfig::default() });
            assert_eq!(bench.ask(0x60, &[1, 0, 0x50, 0]).len(), 2 * usize::from(words));
        }
    }

    #[test]
    fn short_values_come_with_rubbish_above() {
        let mut bench = Bench::fresh();
        let value = bench.read(0x6041, 0);
        assert_eq!(value & 0xFFFF, 0x0040);
        assert_ne!(value >> 16, 0, "a host that does not mask must not get away with it");
        let mut clean = Bench::new(DriveConfig { rubbish: false, ..DriveConfig::default() });
        assert_eq!(clean.read(0x6041, 0), 0x0040);
    }

    #[test]
    fn other_nodes_time_out_late() {
        let mut bench = Bench::fresh();
        for node in [0, 1] {
            assert_eq!(bench.error(0x60, &[node, 0x41, 0x60, 0]), 0);
        }
        let request = Incoming::Request(Request { opcode: 0x60, data: vec![2, 0x41, 0x60, 0] });
        let answer = bench.drive.answer(&request).unwrap();
        assert!(answer.delay > Nanos::ZERO);
        assert_eq!(bench.error(0x60, &[2, 0x41, 0x60, 0]), 0x0504_0000);
    }

    #[test]
    fn identity_is_read_in_segments() {
        let mut bench = Bench::new(DriveConfig { serial_number: 77, segment_bytes: 3, ..DriveConfig::default() });
        assert_eq!(bench.read(0x1018, 1), 0xFB);
        assert_eq!(bench.read(0x1018, 4), 77);
        let first = bench.ask(0x81, &[1, 0x00, 0x21, 1]);
        assert_eq!(first[4..9], [8, 0, 0, 0, 3]);
        let second = bench.ask(0x62, &[0, 0]);
        assert_eq!(second[4..6], [3, 0], "toggle 0, more to come");
        let third = bench.ask(0x62, &[1, 0]);
        assert_eq!(third[4..6], [2, 3], "toggle 1, last");
        let serial = [&first[9..12], &second[6..9], &third[6..8]].concat();
        assert_eq!(u64::from_le_bytes(serial.try_into().unwrap()), 0x1_0000_0000 + 77);
        assert_eq!(bench.error(0x62, &[0, 0]), 0x0503_0000, "nothing left");
        assert_eq!(bench.ask(0x81, &[1, 0x08, 0x10, 0])[4..9], [5, 0, 0, 0, 3]);
        assert_eq!(bench.error(0x62, &[1, 0]), 0x0503_0000, "wrong toggle");
    }

    #[test]
    fn values_are_written_in_segments() {
        let mut bench = Bench::fresh();
        assert_eq!(bench.error(0x69, &[1, 0x7A, 0x60, 0, 4, 0, 0, 0]), 0);
        assert_eq!(bench.ask(0x6A, &[2, 0, 0x39, 0x30])[4..6], [2, 0]);
        assert_eq!(bench.ask(0x6A, &[2, 3, 0, 0])[..4], [0; 4]);
        assert_eq!(bench.read(0x607A, 0), 12345);
    }

    #[test]
    fn storing_needs_its_signature_and_survives_a_reset() {
        let mut bench = Bench::fresh();
        assert_eq!(bench.try_write(0x1010, 1, 1), Err(0x0800_0020));
        bench.write(0x2005, 0, 60);
        bench.write(0x1010, 1, 0x6576_6173);
        bench.write(0x6065, 0, 123);
        bench.drive.power_cycle();
        bench.run(0.5);
        assert_eq!(bench.read(0x2005, 0) & 0xFFFF, 60);
        assert_eq!(bench.read(0x6065, 0), 2000);
        assert_eq!(bench.drive.frame_timeout(), Nanos::from_millis(60));
    }
}

mod states {
    use super::*;

    #[test]
    fn a_booted_drive_is_not_homed_and_not_operational() {
        let mut bench = Bench::fresh();
        assert_eq!(bench.statusword(), 0x0040);
        bench.ask(0x70, &[1, 0, 1, 0]);
        assert_eq!(bench.statusword(), 0x0240);
    }

    #[test]
    fn the_way_up_and_down() {
        let mut bench = Bench::fresh();
        for (controlword, masked) in
            [(0x0F, 0x40), (0x06, 0x21), (0x07, 0x23), (0x0F, 0x27), (0x02, 0x07), (0x0F, 0x27), (0x00, 0x40)]
        {
            bench.write(0x6040, 0, controlword);
            assert_eq!(bench.statusword() & 0x6F, masked, "{controlword:02X}");
        }
    }

    #[test]
    fn disabling_operation_ramps_down_before_the_power_goes() {
        let mut bench = Bench::enabled(Mode::ProfileVelocity);
        bench.write(0x60FF, 0, 1000);
        bench.run(0.5);
        bench.write(0x6040, 0, 0x07);
        assert_eq!(bench.statusword() & 0x6F, 0x27, "one command must finish before the next");
        bench.write(0x6040, 0, 0x06);
        bench.run(0.05);
        assert_eq!(bench.statusword() & 0x6F, 0x27);
        bench.run(0.2);
        assert_eq!(bench.statusword() & 0x6F, 0x21, "the second command waited for the ramp");
        assert!(bench.drive.motor.stands());
    }

    #[test]
    fn shutdown_cuts_the_power_at_once_unless_told_to_ramp() {
        for (option, masked) in [(0, 0x21), (1, 0x27)] {
            let mut bench = Bench::enabled(Mode::ProfileVelocity);
            bench.write(0x605B, 0, option);
            bench.write(0x60FF, 0, 1000);
            bench.run(0.5);
            bench.write(0x6040, 0, 0x06);
            assert_eq!(bench.statusword() & 0x6F, masked);
            bench.run(0.5);
            assert_eq!(bench.statusword() & 0x6F, 0x21);
        }
    }

    #[test]
    fn quick_stop_ramps_and_stays_powered() {
        let mut bench = Bench::enabled(Mode::CyclicPosition);
        bench.write(0x6085, 0, 2000);
        for step in 0..400 {
            bench.write(0x607A, 0, 5 * step);
            bench.run(0.001);
        }
        let before = bench.position();
        bench.write(0x6040, 0, 0x02);
        assert_eq!(bench.statusword() & 0x6F, 0x07);
        bench.write(0x607A, 0, 0);
        bench.run(0.5);
        let after = bench.position();
        assert!(bench.drive.state.is_powered() && bench.drive.motor.stands());
        // v^2 / 2a: 5000 counts/s against 2000 rpm/s of 1024 counts.
        let braking = 5000.0f64.powi(2) / (2.0 * 2000.0 / 60.0 * 1024.0);
        assert!((f64::from(after - before) - braking).abs() < 20.0, "{before} {after}");
    }

    #[test]
    fn silence_keeps_the_last_demand() {
        let mut bench = Bench::enabled(Mode::CyclicPosition);
        bench.write(0x607A, 0, 500);
        bench.run(100.0);
        assert!((bench.position() - 500).abs() <= 1);
        assert_eq!(bench.statusword() & 0x6F, 0x27);
    }

    #[test]
    fn nothing_is_answered_while_booting() {
        let mut bench = Bench::enabled(Mode::CyclicPosition);
        bench.write(0x6098, 0, 37);
        bench.ask(0x70, &[1, 0, 129, 0]);
        let request = Incoming::Request(Request { opcode: 0x60, data: vec![1, 0x41, 0x60, 0] });
        assert_eq!(bench.drive.answer(&request), None);
        bench.run(0.4);
        assert_eq!(bench.statusword(), 0x0040);
        assert_eq!(bench.read(0x6061, 0) & 0xFF, 1, "parameters are the stored ones again");
    }
}

mod cyclic_position {
    use super::*;

    #[test]
    fn an_old_target_is_a_step_at_enable() {
        let mut bench = Bench::fresh();
        bench.write(0x607A, 0, 700);
        bench.write(0x6060, 0, 8);
        bench.write(0x6040, 0, 0x06);
        bench.write(0x6040, 0, 0x0F);
        bench.run(0.2);
        assert!((bench.position() - 700).abs() <= 1);
    }

    #[test]
    fn a_step_beyond_the_window_is_a_following_error() {
        let mut bench = Bench::enabled(Mode::CyclicPosition);
        bench.write(0x6065, 0, 300);
        bench.write(0x607A, 0, 301);
        bench.run(0.001);
        assert_eq!(bench.read(0x603F, 0) & 0xFFFF, 0x8611);
        bench.run(0.5);
        assert_eq!(bench.statusword() & 0x6F, 0x08);
        assert_eq!(bench.read(0x1001, 0) & 0xFF, 0x81);
    }

    #[test]
    fn a_target_beyond_the_limits_is_a_fault() {
        let mut bench = Bench::enabled(Mode::CyclicPosition);
        bench.write(0x607D, 1, -100);
        bench.write(0x607D, 2, 100);
        bench.write(0x607A, 0, 100);
        bench.run(0.1);
        assert_eq!(bench.read(0x603F, 0) & 0xFFFF, 0);
        bench.write(0x607A, 0, 101);
        bench.run(0.1);
        assert_eq!(bench.read(0x603F, 0) & 0xFFFF, 0x8A82);
        assert!(bench.position() <= 101);
    }

    #[test]
    fn halt_holds_and_ignores_targets() {
        let mut bench = Bench::enabled(Mode::CyclicPosition);
        bench.write(0x6040, 0, 0x010F);
        bench.write(0x607A, 0, 200);
        bench.run(0.2);
        assert_eq!(bench.position(), 0);
        bench.write(0x6040, 0, 0x000F);
        bench.run(0.2);
        assert!((bench.position() - 200).abs() <= 1);
    }

    #[test]
    fn interpolation_wants_set_points_in_time() {
        let mut bench = Bench::enabled(Mode::CyclicPosition);
        bench.write(0x60C2, 1, 10);
        bench.write(0x607A, 0, 1);
        bench.run(0.019);
        assert_eq!(bench.read(0x603F, 0) & 0xFFFF, 0);
        bench.run(0.003);
        assert_eq!(bench.read(0x603F, 0) & 0xFFFF, 0x8250);
    }
}

mod profile_position {
    use super::*;

    #[test]
    fn the_handshake_moves_the_motor() {
        let mut bench = Bench::enabled(Mode::ProfilePosition);
        bench.write(0x607A, 0, 1500);
        bench.write(0x6040, 0, 0x3F);
        let statusword = bench.statusword();
        assert!(statusword & 0x1000 != 0 && statusword & 0x0400 == 0);
        bench.write(0x6040, 0, 0x0F);
        assert_eq!(bench.statusword() & 0x1000, 0);
        bench.run(2.0);
        assert!((bench.position() - 1500).abs() <= 1);
        assert!(bench.statusword() & 0x0400 != 0);
        assert_eq!(bench.host_bugs(), []);
    }

    #[test]
    fn a_second_target_behind_a_raised_bit_is_ignored() {
        let mut bench = Bench::enabled(Mode::ProfilePosition);
        bench.write(0x607A, 0, 100);
        bench.write(0x6040, 0, 0x3F);
        bench.write(0x607A, 0, 900);
        bench.write(0x6040, 0, 0x3F);
        assert_eq!(bench.host_bugs(), [HostBug::SetpointIgnored]);
        bench.run(2.0);
        assert!((bench.position() - 100).abs() <= 1);
    }

    #[test]
    fn targets_queue_or_replace_as_asked() {
        let mut bench = Bench::enabled(Mode::ProfilePosition);
        for (target, controlword) in [(20_000, 0x1F), (100, 0x1F)] {
            bench.write(0x607A, 0, target);
            bench.write(0x6040, 0, controlword);
            bench.write(0x6040, 0, 0x0F);
        }
        bench.run(1.0);
        assert!(bench.position() > 5_000, "the second waits for the first");
        bench.write(0x607A, 0, -50);
        bench.write(0x6040, 0, 0x3F);
        bench.write(0x6040, 0, 0x0F);
        bench.run(5.0);
        assert!((bench.position() + 50).abs() <= 1, "immediately: both are dropped");
    }

    #[test]
    fn relative_targets_start_from_here_and_halt_interrupts() {
        let mut bench = Bench::enabled(Mode::ProfilePosition);
        bench.write(0x607A, 0, 3000);
        bench.write(0x6040, 0, 0x7F);
        bench.run(0.05);
        bench.write(0x6040, 0, 0x010F);
        bench.run(1.0);
        let stopped = bench.position();
        assert!(stopped > 10 && stopped < 2500, "{stopped}");
        bench.write(0x6040, 0, 0x000F);
        bench.run(1.0);
        assert!((bench.position() - 3000).abs() <= 1);
    }
}

mod homing {
    use super::*;

    #[test]
    fn method_37_makes_here_the_home_position() {
        let mut bench = Bench::enabled(Mode::CyclicPosition);
        bench.write(0x607A, 0, 400);
        bench.run(0.2);
        bench.write(0x6060, 0, 6);
        bench.write(0x6098, 0, 37);
        bench.write(0x30B0, 0, 10);
        bench.write(0x6040, 0, 0x1F);
        assert_eq!(bench.statusword() & 0xB400, 0x9400, "homed, attained, reached, no error");
        assert_eq!(bench.position(), 10);
        let motor = bench.drive.motor_counts();
        assert!((motor - 400.0).abs() < 1.0, "nothing moved");
        bench.drive.power_cycle();
        bench.run(0.5);
        assert_eq!(bench.statusword() & 0x8000, 0, "the zero does not survive");
        assert_eq!(bench.position(), 0);
    }

    #[test]
    fn homing_needs_the_edge_and_the_enabled_state() {
        let mut bench = Bench::fresh();
        bench.write(0x6060, 0, 6);
        bench.write(0x6098, 0, 37);
        bench.write(0x6040, 0, 0x1F);
        assert_eq!(bench.statusword() & 0x8000, 0);
    }

    #[test]
    fn other_methods_fail() {
        let mut bench = Bench::enabled(Mode::Homing);
        bench.write(0x6098, 0, -1);
        bench.write(0x6040, 0, 0x1F);
        assert_eq!(bench.statusword() & 0xA400, 0x2000);
    }
}

mod faults {
    use super::*;

    #[test]
    fn reset_needs_a_rising_edge_and_the_cause_gone() {
        let mut bench = Bench::enabled(Mode::CyclicPosition);
        bench.drive.raise(Fault(0x2310), true);
        assert_eq!(bench.statusword() & 0x6F, 0x08, "an overcurrent switches off at once");
        bench.write(0x6040, 0, 0x0F);
        bench.write(0x6040, 0, 0x80);
        assert_eq!(bench.statusword() & 0x6F, 0x08);
        bench.drive.remove_cause();
        bench.write(0x6040, 0, 0x80);
        assert_eq!(bench.statusword() & 0x6F, 0x08, "no edge");
        bench.write(0x6040, 0, 0x00);
        bench.write(0x6040, 0, 0x80);
        assert_eq!(bench.statusword() & 0x6F, 0x40);
        assert_eq!(bench.read(0x603F, 0) & 0xFFFF, 0);
    }

    #[test]
    fn reactions_follow_the_class_and_the_option() {
        for (code, option, immediately) in
            [(0x8611, 2, false), (0x8611, 0, true), (0x8130, 2, false), (0x3220, 2, true)]
        {
            let mut bench = Bench::enabled(Mode::ProfileVelocity);
            bench.write(0x605E, 0, option);
            bench.write(0x60FF, 0, 1000);
            bench.run(0.5);
            bench.drive.raise(Fault(code), false);
            assert_eq!(bench.statusword() & 0x6F, if immediately { 0x08 } else { 0x0F }, "{code:04X}");
            bench.run(0.5);
            assert_eq!(bench.statusword() & 0x6F, 0x08);
        }
    }

    #[test]
    fn the_history_is_newest_first_and_can_be_cleared() {
        let mut bench = Bench::new(DriveConfig { boot_fault: Some(0x8120), ..DriveConfig::default() });
        assert_eq!(bench.statusword() & 0x6F, 0x08);
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
        let mut bench = Bench::enabled(Mode::Homing);
        bench.write(0x6098, 0, 37);
        bench.write(0x6040, 0, 0x1F);
        bench.drive.raise(Fault(0x7380), false);
        assert_ne!(bench.statusword() & 0x8000, 0);
        bench.write(0x6040, 0, 0x80);
        assert_eq!(bench.statusword() & 0x806F, 0x0040);
    }
}
