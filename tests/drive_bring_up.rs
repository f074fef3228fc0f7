//! From a port to drives that are known, switched off and limited; and what is said when that does
//! not work.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may")]

mod drive_fixture;

use std::path::Path;

use drive_fixture::rig::{bring_up, one_drive, open};
use drive_fixture::*;
use i2ris::config::PortConfig;
use i2ris::drive::{DriveError, Port};

fn refusal(drive: MiniDrive) -> String {
    bring_up(drive).1.unwrap_err().to_string()
}

#[test]
fn every_limit_stands_in_the_drive() {
    let (bench, end) = bring_up(one_drive());
    end.unwrap();
    for (index, subindex, value) in [
        (0x607D, 1, -2000_i32 as u32),
        (0x607D, 2, 2000),
        (0x607F, 0, 3000),
        (0x6080, 0, 3000),
        (0x6085, 0, 10_000),
        (0x6065, 0, 400),
        (0x3001, 2, 300),
        (0x60C2, 1, 0),
        (0x605A, 0, 6),
        (0x605C, 0, 1),
        (0x605E, 0, 2),
        (0x6060, 0, 8),
        (0x2005, 0, 50),
        (0x2006, 0, 50),
    ] {
        assert_eq!(
            bench.drive(1, |drive| drive.objects[&(index, subindex)]),
            value,
            "0x{index:04X}:{subindex:02X}"
        );
        let read = bench
            .world()
            .requests
            .iter()
            .any(|request| (request.1, request.3, request.4) == (0x60, index, subindex));
        assert!(read, "0x{index:04X}:{subindex:02X} is read back");
    }
}

#[test]
fn the_drive_is_known_by_its_numbers() {
    let (_, _, port) = open(vec![one_drive()]);
    let port = port.identify().unwrap();
    let [axis] = port.axes() else {
        panic!("one axis")
    };
    assert_eq!(
        (axis.motor, axis.node_id, axis.serial_number),
        (0, 1, SERIAL_NUMBER)
    );
    assert_eq!((axis.product_code, axis.firmware), (0x6150_0000, 0x0170));
    assert_eq!(axis.full_serial_number, Some(0x0807_0605_0403_0201));
    assert_eq!(axis.name.as_deref(), Some("EPOS4"));
}

#[test]
fn nothing_is_powered_and_no_target_is_written() {
    let (bench, end) = bring_up(one_drive());
    end.unwrap();
    bench.drive(1, |drive| {
        assert!(drive.written(0x6040, 0).is_empty());
        assert!(drive.written(0x607A, 0).is_empty());
    });
}

#[test]
fn another_serial_number_is_refused_with_both_numbers() {
    let (_, mut config, _) = open(vec![one_drive()]);
    config.axes[0].serial_number = 0x1234_5678;
    let bench = Bench::new(vec![one_drive()]);
    let text = Port::over(bench, &config)
        .bring_up()
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("0x62150001") && text.contains("0x12345678") && text.contains("/dev/bench"),
        "{text}"
    );
}

#[test]
fn two_drives_behind_one_port_must_not_be_swapped() {
    let (_, mut config, _) = open(vec![MiniDrive::new(1, 11), MiniDrive::new(2, 22)]);
    config.axes[0].serial_number = 22;
    config.axes[1].serial_number = 11;
    let bench = Bench::new(vec![MiniDrive::new(1, 11), MiniDrive::new(2, 22)]);
    let text = Port::over(bench, &config)
        .bring_up()
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("node 1") && text.contains("0x00000016") && text.contains("0x0000000B"),
        "{text}"
    );
}

#[test]
fn a_device_of_another_maker_is_refused() {
    let mut drive = one_drive();
    drive.objects.insert((0x1018, 1), 0x9A);
    assert!(refusal(drive).contains("vendor number 0x0000009A"));
}

#[test]
fn a_drive_that_does_not_answer_is_told_with_what_to_check() {
    let (bench, _, port) = open(vec![one_drive()]);
    bench.world().dead = true;
    let text = port.bring_up().unwrap_err().to_string();
    for part in [
        "/dev/bench",
        "115200 baud",
        "node 1",
        "power",
        "`baud`",
        "`node_id`",
    ] {
        assert!(text.contains(part), "{part} is missing in: {text}");
    }
}

#[test]
fn a_missing_node_behind_a_gateway_is_told_apart() {
    let (_, mut config, _) = open(vec![one_drive()]);
    config.axes[0].node_id = 9;
    let text = Port::over(Bench::new(vec![one_drive()]), &config)
        .bring_up()
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("node 9") && text.contains("behind the gateway"),
        "{text}"
    );
}

#[test]
fn limits_may_move_above_the_old_ones() {
    let mut drive = one_drive();
    drive.objects.insert((0x607D, 1), -9000_i32 as u32);
    drive.objects.insert((0x607D, 2), -5000_i32 as u32);
    let (bench, end) = bring_up(drive);
    end.unwrap();
    assert_eq!(bench.drive(1, |drive| drive.objects[&(0x607D, 2)]), 2000);
}

#[test]
fn a_limit_that_does_not_read_back_is_an_error() {
    let mut drive = one_drive();
    drive.ignores.push((0x3001, 2));
    let text = refusal(drive);
    assert!(
        text.contains("output current limit (0x3001:02)") && text.contains("0x00003A98"),
        "{text}"
    );
}

#[test]
fn a_limit_that_is_refused_is_an_error() {
    let mut drive = one_drive();
    drive.refuses.insert((0x6065, 0), 0x0609_0030);
    let text = refusal(drive);
    assert!(
        text.contains("following error window") && text.contains("value out of range"),
        "{text}"
    );
}

#[test]
fn a_drive_without_long_names_is_fine() {
    // The frame time-out of an interface that the drive does not have.
    let mut drive = one_drive();
    drive.objects.remove(&(0x2005, 0));
    bring_up(drive).1.unwrap();
}

#[test]
fn a_drive_left_enabled_is_switched_off_in_order() {
    let mut drive = one_drive();
    drive.state = OPERATION_ENABLED;
    let (bench, end) = bring_up(drive);
    end.unwrap();
    assert_eq!(
        bench.drive(1, |drive| (drive.written(0x6040, 0), drive.state)),
        (vec![0x0007, 0x0006], READY)
    );
}

#[test]
fn a_drive_left_in_quick_stop_is_switched_off() {
    let mut drive = one_drive();
    drive.state = QUICK_STOP_ACTIVE;
    let (bench, end) = bring_up(drive);
    end.unwrap();
    assert_eq!(bench.drive(1, |drive| drive.state), SWITCH_ON_DISABLED);
}

#[test]
fn a_reply_to_a_controller_that_died_is_not_taken_for_ours() {
    let (bench, _, port) = open(vec![one_drive()]);
    bench.leave_a_request();
    port.bring_up().unwrap();
}

#[test]
fn a_drive_in_fault_is_left_so_for_the_operator() {
    let mut drive = one_drive();
    drive.fail(0x8611);
    let (bench, end) = bring_up(drive);
    end.unwrap();
    assert_eq!(
        bench.drive(1, |drive| (drive.written(0x6040, 0), drive.state)),
        (vec![], FAULT)
    );
}

#[test]
fn a_drive_that_does_not_go_off_is_refused() {
    let mut drive = one_drive();
    drive.state = OPERATION_ENABLED;
    drive.stuck = true;
    let (bench, end) = bring_up(drive);
    let text = end.unwrap_err().to_string();
    assert!(text.contains("power stage does not go off"), "{text}");
    assert_eq!(
        bench.drive(1, |drive| drive.written(0x6040, 0)),
        [0x0007, 0x0000],
        "in order, then at once"
    );
}

#[test]
fn an_unreliable_line_is_brought_up_all_the_same() {
    for place in 0..60 {
        let (bench, _, port) = open(vec![one_drive()]);
        bench.misbehave(
            (0..place)
                .map(|_| Mischief::Nothing)
                .chain([Mischief::FlipReply(place), Mischief::LoseReply]),
        );
        port.bring_up()
            .unwrap_or_else(|error| panic!("damage at request {place}: {error}"));
        assert_eq!(bench.drive(1, |drive| drive.objects[&(0x607D, 2)]), 2000);
    }
}

fn config_of(device: &Path) -> PortConfig {
    let (_, mut config, _) = open(vec![one_drive()]);
    config.device = device.to_owned();
    config
}

#[test]
fn a_port_that_does_not_exist_is_named() {
    let error = Port::open(&config_of(Path::new("/dev/i2ris-no-such-port"))).unwrap_err();
    assert!(matches!(error, DriveError::NotFound { .. }), "{error:?}");
    assert!(
        error
            .to_string()
            .contains("/dev/i2ris-no-such-port does not exist"),
        "{error}"
    );
}

#[test]
fn a_file_that_is_no_serial_port_is_named() {
    let error = Port::open(&config_of(Path::new("/dev/null"))).unwrap_err();
    assert!(matches!(error, DriveError::NotSerial { .. }), "{error:?}");
    assert!(
        error
            .to_string()
            .contains("/dev/null cannot be used as a serial port"),
        "{error}"
    );
}

#[test]
fn a_port_in_use_is_refused() {
    let (_master, slave) = serialport::TTYPort::pair().unwrap();
    let device = serialport::SerialPort::name(&slave).unwrap();
    drop(slave);
    let config = config_of(Path::new(&device));
    let first = Port::open(&config).unwrap();
    let error = Port::open(&config).unwrap_err();
    assert!(matches!(error, DriveError::Busy { .. }), "{error:?}");
    drop(first);
    Port::open(&config).unwrap();
}
