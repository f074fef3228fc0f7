//! User mistakes: the message is one sentence with cause and remedy; nothing moves.

use std::io::{Read, Write};
use std::os::unix::fs::PermissionsExt;

use i2ris::drive::cia402::DriveState;
use i2ris::drive::family_selection::family_of_port;
use i2ris::drive::inspect::inspect;
use i2ris::drive::quick_stop::{STOP_ATTEMPTS, quick_stop_all};
use i2ris::drive::survey::{answering_rate, nodes};
use i2ris_simulation::drive::Mode;
use nix::unistd::{Uid, setfsuid};
use serialport::{SerialPort, TTYPort};

use super::*;

fn refusal(port: &PortConfig) -> String {
    let text = Port::open(port).and_then(Port::bring_up).unwrap_err().to_string();
    assert!(!text.contains('\n') && text.len() < 300, "one sentence: {text}");
    text
}

fn quick(port: PortConfig) -> PortConfig {
    PortConfig { reply_timeout_ms: 100, ..port }
}

#[test]
fn a_wrong_bit_rate_is_reported_with_the_remedy() {
    let bench = TestBench::with(&SETUPS[0], |config| config.line.strict_baud = true);
    let wrong = quick(PortConfig { baud: 38_400, ..bench.port() });
    let text = refusal(&wrong);
    for part in ["no reply from a drive", "38400 baud", "check"] {
        assert!(text.contains(part), "{text}");
    }
    assert_eq!(answering_rate(&wrong), Some(115_200), "tried at the other rates");
    assert!(bench.bring_up().is_ok(), "at the correct bit rate it answers");
}

#[test]
fn nodes_on_line_are_listed_without_writing() {
    for (setup, families) in [
        (&SETUPS[3], &["EPOS2"][..]),
        (&SETUPS[4], &["EPOS2", "EPOS2"]),
        (&SETUPS[5], &["EPOS4", "EPOS2"]),
        (&SETUPS[6], &["EPOS2", "EPOS2", "EPOS2"]),
    ] {
        let bench = TestBench::emulated(setup);
        let before = bench.drive();
        let found = nodes(&bench.port()).unwrap();
        let numbers: Vec<_> = found.iter().map(|node| node.serial_number).collect();
        assert_eq!(numbers, SERIAL_NUMBERS[..families.len()], "{}", setup.name);
        assert!(found.iter().map(|node| node.family).eq(families.iter().copied()), "{found:?}");
        assert!(found.iter().all(|node| node.firmware > 0), "{found:?}");
        assert_eq!(bench.drive(), before);
        bench.assert_no_host_bugs();
    }
}

#[test]
fn a_missing_node_is_named() {
    for setup in [&SETUPS[2], &SETUPS[4]] {
        let bench = TestBench::emulated(setup);
        let text = refusal(&bench.port_with(|axis| axis.node_id = 9));
        assert!(text.contains("node 9"), "{text}");
        assert!(text.contains("gateway") || text.contains("`node_id`"), "{text}");
        assert!(!bench.drive().state.is_powered());
    }
}

/// Messages of controller, doctor and watchdog about a port.
fn messages(port: &PortConfig) -> [String; 3] {
    let mut link = DriveLink::new(SerialTransport::open(port).unwrap(), family_of_port(port), port);
    let stopped = quick_stop_all(&mut link, &[port.axes[0].node_id], &[], STOP_ATTEMPTS);
    drop(link);
    [refusal(port), inspect(port).unwrap_err().to_string(), stopped[0].unwrap_err().to_string()]
}

/// A foreign device on the port: sends `answer` of the received bytes, or of none within 20 ms.
fn talker(answer: fn(&[u8]) -> Vec<u8>) -> (Background, PathBuf) {
    let (mut master, slave) = TTYPort::pair().unwrap();
    master.set_timeout(std::time::Duration::from_millis(20)).unwrap();
    let talker = Background::start(move |stop| {
        let mut bytes = [0; 64];
        while !stop.load(Ordering::Relaxed) {
            let count = master.read(&mut bytes).unwrap_or(0);
            let _ = master.write_all(&answer(&bytes[..count]));
        }
    });
    (talker, slave.name().unwrap().into())
}

#[test]
fn reply_from_non_drive_is_shown_not_reported_as_silence() {
    let short_frame = |request: &[u8]| match request {
        [] => Vec::new(),
        _ => i2ris_simulation::frame::encode(0, &[6, 0]),
    };
    let bench = TestBench::emulated(&SETUPS[0]);
    for (answer, parts) in [
        // A terminal server, or a wire loop.
        (<[u8]>::to_vec as fn(&[u8]) -> Vec<u8>, ["but not a reply of EPOS4", " 60 "]),
        (|_| b"roll=0.1 pitch=-3.4\r\n".to_vec(), ["received ", "bytes, not a drive frame: "]),
        (short_frame, ["but not a reply of EPOS4", " 06 00"]),
    ] {
        let (_talker, device) = talker(answer);
        for text in messages(&quick(PortConfig { device, ..bench.port() })) {
            assert!(text.contains("received "), "{text}");
            parts.iter().for_each(|part| assert!(text.contains(part), "{part}: {text}"));
        }
    }
}

#[test]
fn a_drive_of_the_other_family_is_named() {
    for (setup, family, question) in
        [(0, Family::Epos2, "is this an EPOS4?"), (3, Family::Epos4, "is this an EPOS2?")]
    {
        let bench = TestBench::emulated(&SETUPS[setup]);
        // On a loaded machine the emulator may answer the single question of the watchdog too late.
        let mut attempts = (0..5).map(|_| messages(&PortConfig { family, ..bench.port() }));
        let answered = attempts.find(|[.., last]| !last.contains("does not answer"));
        let [controller, doctor, watchdog] = answered.unwrap();
        assert!(controller.contains(question) && controller.contains("`family`"), "{controller}");
        assert_eq!(doctor, controller);
        assert!(watchdog.contains("unknown command"), "{watchdog}");
        assert!(!bench.drive().state.is_powered());
    }
}

#[test]
fn drive_left_running_in_other_mode_is_disabled_and_configured() {
    let bench = TestBench::emulated(&SETUPS[0]);
    {
        let host = serialport::new(bench.port().device.to_string_lossy(), 115_200);
        let mut host = host.exclusive(false).open_native().unwrap();
        host.set_timeout(std::time::Duration::from_secs(5)).unwrap();
        let writes = [(0x6060u16, 3u8), (0x60FF, 20), (0x6040, 0x06), (0x6040, 0x0F)];
        for (index, value) in writes {
            let [low, high] = index.to_le_bytes();
            let request = [0, low, high, 0, value, 0, 0, 0];
            host.write_all(&i2ris_simulation::frame::encode(0x68, &request)).unwrap();
            host.read_exact(&mut [0; 10]).unwrap();
        }
    }
    assert_eq!(bench.drive().state, State::OperationEnabled);
    let port = bench.bring_up().unwrap();
    assert!(!bench.drive().state.is_powered());
    drop(port);
    let _axis = bench.enabled();
    assert_eq!(bench.drive().mode, Mode::CyclicPosition);
}

#[test]
fn with_one_axis_refused_the_other_is_left_safe() {
    let bench = TestBench::emulated(&SETUPS[4]);
    let running = bench.enabled();
    // At the next start the axis on the gateway is still enabled.
    running.abandon();
    let text = refusal(&bench.port_with(|axis| axis.serial_number = 1));
    assert!(text.contains("instead of 1 "), "{text}");
    let first = bench.emulator().snapshot().axes[0].drive;
    assert!(!first.state.is_powered(), "the correct axis is off");
}

#[test]
fn an_inspection_changes_nothing_and_finds_differences() {
    for setup in &SETUPS {
        let bench = TestBench::emulated(setup);
        let axis = setup.drives_before;
        bench.emulator().raise_fault(bench.axis, 0x3210, false);
        let before = bench.drive();
        let seen = inspect(&bench.port()).unwrap();
        let axis = seen.axes[axis].as_ref().unwrap();
        assert_eq!(axis.state, Some(DriveState::Fault), "{}", setup.name);
        assert_eq!(axis.errors[0].name, "overvoltage");
        let mut differences = axis.differences.iter();
        assert!(differences.any(|(object, ..)| object.index == 0x607D));
        assert_eq!(bench.drive(), before);
    }
}

#[test]
fn a_port_without_permission_is_reported_with_the_remedy() {
    let bench = TestBench::emulated(&SETUPS[0]);
    let port =
        PortConfig { device: fs::canonicalize(bench.port().device).unwrap(), ..bench.port() };
    fs::set_permissions(&port.device, fs::Permissions::from_mode(0o000)).unwrap();
    // Root may open everything, so this thread accesses files as `nobody`.
    let before = setfsuid(Uid::from_raw(65_534));
    let text = refusal(&port);
    setfsuid(before);
    assert!(text.contains("no permission") && text.contains("dialout"), "{text}");
}
