//! Opcodes, objects and their errors.

use super::*;

#[test]
fn wrong_crc_and_unknown_opcode_give_an_error_reply() {
    let mut bench = DriveUnderTest::fresh();
    let wrong_crc = bench.drive.reply_at_port(&Incoming::WrongCrc, None).unwrap();
    assert_eq!(
        reply(&wrong_crc.data),
        [0x90, 0x02, 0x00, 0x02, 0x04, 0x00, 0x04, 0x05, 0xF1, 0xE8]
    );
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
        let mut bench =
            DriveUnderTest::new(DriveConfig { error_reply_words: words, ..DriveConfig::default() });
        assert_eq!(bench.request(0x60, &[1, 0, 0x50, 0]).len(), 2 * usize::from(words));
    }
}

#[test]
fn the_unused_bytes_of_short_values_are_garbage() {
    let mut bench = DriveUnderTest::fresh();
    let value = bench.read(0x6041, 0);
    assert_eq!(value & 0xFFFF, 0x0040);
    assert_ne!(value >> 16, 0, "a host has to mask the value");
    let mut clean =
        DriveUnderTest::new(DriveConfig { fill_unused_bytes: false, ..DriveConfig::default() });
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
    let mut bench = DriveUnderTest::new(DriveConfig {
        serial_number: 77,
        segment_bytes: 3,
        ..DriveConfig::default()
    });
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
    bench.run(0.5);
    assert_eq!(bench.read(0x2005, 0) & 0xFFFF, 60);
    assert_eq!(bench.read(0x6065, 0), 2000);
    assert_eq!(bench.drive.frame_timeout(), Nanos::from_millis(60));
}
