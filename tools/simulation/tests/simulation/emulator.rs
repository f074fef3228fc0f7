//! The emulator from the host's side: serial ports, camera, control socket.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use i2ris::clock;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::ipc::{Domain, DomainLock, Server, random_id};
use i2ris::units::Nanos;
use i2ris_simulation::drive::State;
use i2ris_simulation::frame::{Incoming, Parser, encode};
use i2ris_simulation::log::{Event, EventKind, HostBug, LineTrouble};
use i2ris_simulation::physics::springs::SnakeConfig;
use i2ris_simulation::{Emulator, EmulatorConfig, EmulatorError, FolderError, SnakeSource};
use serialport::{SerialPort, TTYPort};
use tempfile::TempDir;

/// Longer than any stall of the machine.
const TIMEOUT: Duration = Duration::from_secs(10);

/// "Write 0x6040 = 0x000F to node 1", from the reference.
const WRITE_CONTROLWORD: [u8; 14] =
    [0x90, 0x02, 0x68, 0x04, 0x01, 0x40, 0x60, 0, 0x0F, 0, 0, 0, 0xB3, 0x07];

/// "Read 0x6041 of node 1", from the reference.
const READ_STATUSWORD: [u8; 10] = [0x90, 0x02, 0x60, 0x02, 0x01, 0x41, 0x60, 0, 0x22, 0xD1];

fn config(folder: &Path) -> EmulatorConfig {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/snakes/steel.toml");
    EmulatorConfig::new(SnakeConfig::load(&path).unwrap(), &folder.join("ports"))
}

fn start() -> (Emulator, TempDir) {
    start_with(|_| {})
}

fn start_with(change: impl FnOnce(&mut EmulatorConfig)) -> (Emulator, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let mut config = config(folder.path());
    change(&mut config);
    (Emulator::start(config).unwrap(), folder)
}

/// The controller's end of a line.
struct Host {
    port: TTYPort,
}

impl Host {
    fn open(emulator: &Emulator, axis: usize) -> Self {
        let builder = serialport::new(emulator.device(axis).to_string_lossy(), 115_200);
        // A pseudo-terminal would stay in exclusive use.
        let port = builder.exclusive(false).timeout(TIMEOUT).open_native().unwrap();
        Self { port }
    }

    fn send(&mut self, bytes: &[u8]) -> &mut Self {
        self.port.write_all(bytes).unwrap();
        self
    }

    /// The data of the next reply.
    fn reply(&mut self) -> Option<Vec<u8>> {
        let mut parser = Parser::default();
        let mut byte = [0];
        loop {
            self.port.read_exact(&mut byte).ok()?;
            if let Some(Incoming::Request(reply)) = parser.push(byte[0]) {
                assert_eq!(reply.opcode, 0);
                return Some(reply.data);
            }
        }
    }

    /// The number of replies until the line is silent.
    fn replies(&mut self) -> usize {
        self.port.set_timeout(Duration::from_millis(300)).unwrap();
        let count = std::iter::from_fn(|| self.reply()).count();
        self.port.set_timeout(TIMEOUT).unwrap();
        count
    }

    fn read(&mut self, index: u16, sub: u8) -> i32 {
        let [low, high] = index.to_le_bytes();
        let data = self.send(&encode(0x60, &[0, low, high, sub])).reply().unwrap();
        assert_eq!(data[..4], [0; 4]);
        i32::from_le_bytes(data[4..8].try_into().unwrap())
    }

    fn write(&mut self, index: u16, sub: u8, value: i32) {
        let [low, high] = index.to_le_bytes();
        let [a, b, c, d] = value.to_le_bytes();
        let reply = self.send(&encode(0x68, &[0, low, high, sub, a, b, c, d])).reply();
        assert_eq!(reply.unwrap(), [0; 4], "{index:04X}");
    }

    fn enable_cyclic_position(&mut self) {
        let position = self.read(0x6064, 0);
        self.write(0x607A, 0, position);
        self.write(0x6060, 0, 8);
        self.write(0x6040, 0, 0x06);
        self.write(0x6040, 0, 0x0F);
    }
}

fn wait_for(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < TIMEOUT, "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn control_socket(folder: &TempDir) -> BufReader<UnixStream> {
    let socket = UnixStream::connect(folder.path().join("ports/control")).unwrap();
    socket.set_read_timeout(Some(TIMEOUT)).unwrap();
    BufReader::new(socket)
}

/// Sends a line to the control socket and returns the reply.
fn request(socket: &mut BufReader<UnixStream>, line: &str) -> String {
    writeln!(socket.get_mut(), "{line}").unwrap();
    let mut reply = String::new();
    socket.read_line(&mut reply).unwrap();
    reply.trim().to_owned()
}

fn events(emulator: &Emulator) -> Vec<EventKind> {
    emulator.log().iter().map(|event| event.kind).collect()
}

fn host_bugs(emulator: &Emulator) -> Vec<EventKind> {
    let mut events = events(emulator);
    events.retain(|event| matches!(event, EventKind::HostBug(_)));
    events
}

const PIPELINED: EventKind = EventKind::HostBug(HostBug::Pipelined);

#[test]
fn frames_of_the_reference_are_answered() {
    let (emulator, _folder) = start();
    let mut host = Host::open(&emulator, 0);
    assert_eq!(host.send(&READ_STATUSWORD).reply().unwrap()[..6], [0, 0, 0, 0, 0x40, 0x00]);
    host.send(&WRITE_CONTROLWORD);
    let mut reply = [0; 10];
    host.port.read_exact(&mut reply).unwrap();
    assert_eq!(reply, [0x90, 0x02, 0x00, 0x02, 0, 0, 0, 0, 0x40, 0x8B]);
    assert_eq!(host_bugs(&emulator), []);
}

#[test]
fn a_host_that_does_not_wait_is_detected() {
    let (emulator, _folder) = start();
    let mut host = Host::open(&emulator, 0);
    // After a stall of the machine the emulator does not report the host.
    wait_for("the host is detected", || {
        host.send(&[READ_STATUSWORD, READ_STATUSWORD].concat());
        let replies = host.replies();
        assert!(replies == 1 || replies == 2);
        replies == 1 && host_bugs(&emulator) == [PIPELINED]
    });
    assert_eq!(host.read(0x1018, 1), 0xFB, "the line recovers");
}

#[test]
fn bytes_during_the_processing_are_detected() {
    let (emulator, _folder) = start_with(|config| config.line.processing_us = 400_000);
    let mut host = Host::open(&emulator, 0);
    host.send(&READ_STATUSWORD);
    wait_for("request is received", || emulator.snapshot().axes[0].requests == 1);
    assert!(host.send(&READ_STATUSWORD).reply().is_some());
    assert_eq!(host.replies(), 0);
    assert_eq!(host_bugs(&emulator), [PIPELINED]);
}

#[test]
fn damaged_and_truncated_frames_have_no_effect() {
    let (emulator, _folder) = start();
    let mut host = Host::open(&emulator, 0);
    host.write(0x2005, 0, 50);
    let mut damaged = READ_STATUSWORD;
    damaged[5] ^= 1;
    assert_eq!(host.send(&damaged).reply().unwrap(), [0x04, 0x00, 0x04, 0x05]);
    assert_eq!(host.send(&WRITE_CONTROLWORD[..9]).replies(), 0);
    let timeout = EventKind::Line(LineTrouble::FrameTimeout);
    wait_for("the truncated frame is dropped", || events(&emulator).contains(&timeout));
    assert_eq!(host.read(0x1018, 1), 0xFB);
    host.send(&WRITE_CONTROLWORD[..9]);
    assert_eq!(host.read(0x1018, 1), 0xFB, "a new frame replaces a truncated one");
    assert_eq!(host.read(0x6040, 0) & 0xFFFF, 0, "no truncated frame was executed");
}

#[test]
fn set_points_follow_each_other_no_faster_than_the_line() {
    let (emulator, _folder) = start_with(|config| config.line.baud = 9_600);
    let mut host = Host::open(&emulator, 0);
    let before = clock::now();
    for counts in 0..6 {
        host.write(0x607A, 0, counts);
    }
    let mut setpoints = emulator.log();
    setpoints.retain(|event| matches!(event.kind, EventKind::Setpoint(_)));
    // At least 24 bytes of ten bits. The first may count as sent slightly before it was read.
    let (exchange, slack) = (Nanos(24 * 10 * 1_000_000_000 / 9_600), Nanos::from_millis(1));
    let mut earliest = before;
    for Event { stamp, .. } in setpoints {
        assert!(stamp + slack > earliest, "{stamp:?} is before {earliest:?}");
        earliest = earliest + exchange;
    }
    assert_eq!(earliest - before, Nanos(6 * exchange.0));
}

#[test]
fn faults_mutes_and_power_cycles_affect_one_axis() {
    let (emulator, _folder) = start();
    let mut host = Host::open(&emulator, 1);
    host.enable_cyclic_position();
    emulator.raise_fault(1, 0x2310, false);
    assert_eq!(host.read(0x6041, 0) & 0x6F, 0x08);
    assert_eq!(host.read(0x603F, 0) & 0xFFFF, 0x2310);
    emulator.mute(1, true);
    assert_eq!(host.send(&READ_STATUSWORD).replies(), 0);
    emulator.mute(1, false);
    assert_eq!(host.read(0x6041, 0) & 0x6F, 0x08);
    emulator.power_cycle(1);
    let state = || emulator.snapshot().axes[1].drive.state;
    wait_for("the drive boots", || state() == State::SwitchOnDisabled);
    assert_eq!(host.read(0x6041, 0) & 0xFFFF, 0x0040);
    assert_eq!(emulator.snapshot().axes[0].drive.error_code, 0, "the other axis");
}

#[test]
fn links_and_log_file_live_as_long_as_the_emulator() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = config(folder.path());
    let log: PathBuf = folder.path().join("log.csv");
    config.log = Some(log.clone());
    let emulator = Emulator::start(config.clone()).unwrap();
    let device = emulator.device(1).to_owned();
    assert!(device.exists() && device.is_symlink());
    config.log = None;
    let second = Emulator::start(config).err();
    assert!(matches!(second, Some(EmulatorError::Folder(FolderError::InUse { .. }))));
    Host::open(&emulator, 1).write(0x607A, 0, -7);
    drop(emulator);
    assert!(!device.is_symlink() && !folder.path().join("ports").exists());
    let text = std::fs::read_to_string(log).unwrap();
    assert!(text.lines().any(|line| line.ends_with(",1,setpoint,-7,")), "{text}");
}

#[test]
fn the_control_socket_injects_faults_and_reports_the_state() {
    let (emulator, folder) = start();
    let mut host = Host::open(&emulator, 0);
    let mut socket = control_socket(&folder);
    let mut send = |line: &str| request(&mut socket, line);
    assert!(send("state").starts_with("switch-on-disabled position 0 error 0x0000 homed false; "));
    assert_eq!(send("{axis = 0, kind = \"fault\", code = 0x2310}"), "ok");
    assert_eq!(host.read(0x603F, 0) & 0xFFFF, 0x2310);
    assert_eq!(send("{kind = \"cut-reply-in-pair\"}"), "ok");
    assert_eq!(host.send(&READ_STATUSWORD).replies(), 0, "the reply was cut");
    assert_eq!(host.read(0x1018, 1), 0xFB);
    assert!(send("{kind = \"explode\"}").starts_with("error: "));
    assert!(events(&emulator).contains(&EventKind::Injected("cut-reply-in-pair")));
}

#[test]
fn a_scenario_is_played() {
    let text = "[[at]]\nms = 50\naxis = 1\nkind = \"fault\"\ncode = 0x3210";
    let scenario = i2ris_simulation::Scenario::parse(text).unwrap();
    let (emulator, _folder) = start_with(|config| config.scenario = scenario);
    let error_code = |axis: usize| emulator.snapshot().axes[axis].drive.error_code;
    wait_for("the fault", || error_code(1) == 0x3210);
    assert_eq!(error_code(0), 0);
}

#[test]
fn frames_reach_every_controller_of_the_domain() {
    let (mut emulator, _folder) = start();
    let domain = Domain::new(&format!("t{:016x}", random_id())).unwrap();
    emulator.publish_camera(&domain).unwrap();
    let mut last = 0;
    for _ in 0..2 {
        let mut server = Server::create(DomainLock::acquire(&domain).unwrap()).unwrap();
        for _ in 0..3 {
            let mut frame = None;
            wait_for("a frame arrives", || {
                server.maintain(clock::now());
                frame = server.poll_external();
                frame.is_some()
            });
            let frame = frame.unwrap();
            assert_eq!((frame.count, frame.flags), (2, ExternalPosition::VALID));
            assert!(frame.stamp_ns > last && frame.stamp_ns < clock::now().0);
            assert!(frame.deviation[0] > 0.0 && frame.position[2] == 0.0);
            last = frame.stamp_ns;
        }
    }
}

#[test]
fn the_control_socket_ages_the_snake_and_disturbs_the_camera() {
    let source = SnakeSource::load("preisach:2").unwrap();
    let (mut emulator, folder) = start_with(|config| config.snake = source);
    let (sender, frames) = channel();
    let send = move |frame: ExternalPosition| {
        let [pitch, yaw, _] = frame.position.map(f64::to_degrees);
        let _ = sender.send([pitch, yaw]);
    };
    emulator.start_camera(move || send).unwrap();
    let request = |line: &str| request(&mut control_socket(&folder), line);
    let wait_for = |what: &str, is_met: &dyn Fn([f64; 2]) -> bool| {
        wait_for(what, || is_met(frames.recv_timeout(TIMEOUT).unwrap()));
    };
    let zero = "ageing = {parameter = \"zero\", by = 5, direction = [1, 0], course = \"step\"}";
    wait_for("straight", &|[pitch, yaw]| pitch.abs() + yaw.abs() < 1.0);
    assert_eq!(request(zero), "ok");
    wait_for("slipped", &|[pitch, yaw]| pitch > 4.0 && yaw.abs() < 1.0);
    assert_eq!(request("camera = {fault = \"swapped\"}"), "ok");
    wait_for("swapped", &|[pitch, yaw]| yaw > 4.0 && pitch.abs() < 1.0);
    assert_eq!(request("camera = \"good\""), "ok");
    wait_for("good again", &|[pitch, _]| pitch > 4.0);
    let refused = request("ageing = {parameter = \"teeth\", by = 1, course = \"step\"}");
    assert!(refused.starts_with("error: ") && refused.contains("teeth"), "{refused}");
}
