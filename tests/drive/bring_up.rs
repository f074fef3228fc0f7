//! Bring-up of a port until its drives are identified, off and limited; and messages of failures.

use std::path::Path;

use i2ris::config::PortConfig;
use i2ris::drive::{AxisRequest, DriveError, Port, PortEventKind};
use i2ris::units::Nanos;
use i2ris_testing::drive::{bring_up, one_drive, open, *};

/// Brings up a drive with this change.
fn brought_up(change: impl FnOnce(&mut MiniDrive)) -> SimulatedLine {
    let mut drive = one_drive();
    change(&mut drive);
    let (line, outcome) = bring_up(drive);
    outcome.unwrap();
    line
}

fn assert_parts(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part} is missing in: {text}");
    }
}

/// The message for drives that are configured differently.
fn refusal(drives: fn() -> Vec<MiniDrive>, configure: fn(&mut PortConfig)) -> String {
    let (line, mut config, _) = open(drives());
    configure(&mut config);
    Port::over(line, &config).bring_up().unwrap_err().to_string()
}

#[test]
fn every_limit_is_written_and_read_back() {
    let line = brought_up(|_| {});
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
        let object = format!("0x{index:04X}:{subindex:02X}");
        assert_eq!(line.drive(1, |drive| drive.objects[&(index, subindex)]), value, "{object}");
        let state = line.state();
        let is_read = state.requests.iter().any(|request| {
            (request.opcode, request.index, request.subindex) == (0x60, index, subindex)
        });
        assert!(is_read, "{object} is read back");
    }
}

#[test]
fn the_identity_of_the_drive_is_read() {
    let (_, _, port) = open(vec![one_drive()]);
    let port = port.bring_up().unwrap();
    let [axis] = &port.axes[..] else { panic!("one axis") };
    assert_eq!((axis.motor, axis.node_id), (0, 1));
    assert_eq!(axis.serial_number, SERIAL_NUMBER);
    assert_eq!((axis.model.product_code, axis.model.firmware), (0x6150_0000, 0x0170));
    assert_eq!(axis.full_serial_number, Some(0x0807_0605_0403_0201));
    assert_eq!(axis.name.as_deref(), Some("EPOS4"));
}

#[test]
fn nothing_is_powered_and_no_target_is_written() {
    brought_up(|_| {}).drive(1, |drive| {
        assert!(drive.written(0x6040, 0).is_empty());
        assert!(drive.written(0x607A, 0).is_empty());
    });
}

#[test]
fn wrong_drive_is_refused_with_both_serial_numbers() {
    let text = refusal(|| vec![one_drive()], |config| config.axes[0].serial_number = 0x1234_5678);
    assert_parts(&text, &["0x62150001", "0x12345678", "/dev/simulated"]);
    let text = refusal(
        || vec![MiniDrive::new(1, 11), MiniDrive::new(2, 22)],
        |config| {
            config.axes[0].serial_number = 22;
            config.axes[1].serial_number = 11;
        },
    );
    assert_parts(&text, &["node 1", "0x00000016", "0x0000000B"]);
    // Hexadecimal digits as tools print them, typed as a decimal number.
    for typed in [602_060_003_005, 60_003_005] {
        let (line, mut config, _) = open(vec![MiniDrive::new(1, 0x6000_3005)]);
        config.axes[0].serial_number = typed;
        let text = Port::over(line, &config).bring_up().unwrap_err().to_string();
        let remedy = format!("this is the drive if read as hexadecimal: write 0x{typed}");
        assert_parts(&text, &[&format!("instead of {typed} "), &remedy]);
    }
}

#[test]
fn a_silent_drive_is_reported_with_the_remedy() {
    let (line, _, port) = open(vec![one_drive()]);
    line.state().silent = true;
    let text = port.bring_up().unwrap_err().to_string();
    assert_parts(&text, &["/dev/simulated", "115200 baud", "node 1", "power"]);
    assert_parts(&text, &["`baud`", "`node_id`"]);
}

#[test]
fn unusable_drive_is_refused_with_reason() {
    let vendor: fn(&mut MiniDrive) = |drive| {
        drive.objects.insert((0x1018, 1), 0x9A);
    };
    let ignored: fn(&mut MiniDrive) = |drive| drive.ignores.push((0x3001, 2));
    let refused: fn(&mut MiniDrive) = |drive| {
        drive.refuses.insert((0x6065, 0), 0x0609_0030);
    };
    for (change, parts) in [
        (vendor, &["vendor number 0x0000009A"][..]),
        (ignored, &["`current_limit_ma = 300`", "keeps 15000 in output current limit (0x3001:02)"]),
        (refused, &["following error window", "value out of range"]),
    ] {
        let mut drive = one_drive();
        change(&mut drive);
        assert_parts(&bring_up(drive).1.unwrap_err().to_string(), parts);
    }
}

#[test]
fn limits_may_move_above_the_old_ones() {
    let line = brought_up(|drive| {
        drive.objects.insert((0x607D, 1), -9000_i32 as u32);
        drive.objects.insert((0x607D, 2), -5000_i32 as u32);
    });
    assert_eq!(line.drive(1, |drive| drive.objects[&(0x607D, 2)]), 2000);
}

#[test]
fn a_drive_without_rs232_is_accepted() {
    // It refuses the frame timeout of that interface.
    brought_up(|drive| {
        drive.objects.remove(&(0x2005, 0));
    });
}

#[test]
fn bring_up_switches_powered_drive_off_and_keeps_fault() {
    type Case<'a> = (fn(&mut MiniDrive), &'a [u32], u16);
    let cases: [Case<'_>; 3] = [
        (|drive| drive.state = OPERATION_ENABLED, &[0x0007, 0x0006], READY),
        (|drive| drive.state = QUICK_STOP_ACTIVE, &[0x0000], SWITCH_ON_DISABLED),
        (|drive| drive.fail(0x8611), &[], FAULT),
    ];
    for (change, controlwords, state) in cases {
        brought_up(change).drive(1, |drive| {
            assert_eq!(drive.written(0x6040, 0), controlwords);
            assert_eq!(drive.state, state);
        });
    }
}

#[test]
fn a_drive_that_does_not_switch_off_is_refused() {
    let mut drive = one_drive();
    drive.state = OPERATION_ENABLED;
    drive.stuck = true;
    let (line, outcome) = bring_up(drive);
    assert_parts(&outcome.unwrap_err().to_string(), &["power stage does not switch off"]);
    let controlwords = line.drive(1, |drive| drive.written(0x6040, 0));
    assert_eq!(controlwords, [0x0007, 0x0000], "cleanly, then at once");
}

#[test]
fn slow_line_is_reported_relative_to_its_baud_rate() {
    for (baud, is_slow) in [(57_600, false), (115_200, true)] {
        let (line, config, _) = open(vec![one_drive()]);
        line.state().adapter_hold = Nanos::from_micros(2400);
        let port = Port::over(line, &PortConfig { baud, ..config }).bring_up().unwrap();
        let (mut runner, _links) = port.split::<AxisRequest>();
        let mut is_reported = false;
        runner.report_ready(&mut |event| {
            is_reported |= matches!(event.kind, PortEventKind::SlowLine(_));
        });
        assert_eq!(is_reported, is_slow, "{baud} baud");
    }
}

#[test]
fn a_reply_to_a_killed_controller_is_not_accepted() {
    let (line, _, port) = open(vec![one_drive()]);
    line.send_stale_request();
    port.bring_up().unwrap();
}

#[test]
fn an_unreliable_line_is_brought_up() {
    for position in 0..60 {
        let (line, _, port) = open(vec![one_drive()]);
        line.disturb(vec![Disturbance::Nothing; position]);
        line.disturb([Disturbance::FlipReply(position), Disturbance::LoseReply]);
        port.bring_up().unwrap_or_else(|error| panic!("damage at request {position}: {error}"));
        assert_eq!(line.drive(1, |drive| drive.objects[&(0x607D, 2)]), 2000);
    }
}

fn config_of(device: &Path) -> PortConfig {
    let (_, config, _) = open(vec![one_drive()]);
    PortConfig { device: device.to_owned(), ..config }
}

#[test]
fn missing_or_non_serial_device_is_named() {
    let error = Port::open(&config_of(Path::new("/dev/i2ris-no-such-port"))).unwrap_err();
    assert!(matches!(error, DriveError::NotFound(_)), "{error:?}");
    assert_parts(&error.to_string(), &["/dev/i2ris-no-such-port does not exist"]);
    let error = Port::open(&config_of(Path::new("/dev/null"))).unwrap_err();
    assert!(matches!(error, DriveError::NotSerial { .. }), "{error:?}");
    assert_parts(&error.to_string(), &["/dev/null cannot be used as a serial port"]);
}

#[test]
fn a_port_in_use_is_refused() {
    let (_master, slave) = serialport::TTYPort::pair().unwrap();
    let device = serialport::SerialPort::name(&slave).unwrap();
    drop(slave);
    let config = config_of(Path::new(&device));
    let first = Port::open(&config).unwrap();
    let error = Port::open(&config).unwrap_err();
    assert!(matches!(error, DriveError::Busy(_)), "{error:?}");
    drop(first);
    Port::open(&config).unwrap();
}
