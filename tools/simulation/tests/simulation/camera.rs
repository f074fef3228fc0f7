//! The camera and a controller that starts, stops and starts again; faults by the control socket.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use i2ris::clock;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::ipc::{Domain, DomainLock, Server, random_id};
use i2ris_simulation::physics::springs::SnakeConfig;
use i2ris_simulation::{Emulator, EmulatorConfig, SnakeSource};

/// Waits until the controller has received a frame.
fn next_frame(server: &mut Server) -> ExternalPosition {
    let start = Instant::now();
    loop {
        server.maintain(clock::now());
        if let Some(frame) = server.poll_external() {
            return frame;
        }
        assert!(start.elapsed() < Duration::from_secs(10), "no frame arrives");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn frames_reach_every_controller_of_the_domain() {
    let folder = tempfile::tempdir().unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/snakes/brass.toml");
    let config =
        EmulatorConfig::new(SnakeConfig::load(&path).unwrap(), &folder.path().join("ports"));
    let mut emulator = Emulator::start(config).unwrap();
    let domain = Domain::new(&format!("t{:016x}", random_id())).unwrap();
    emulator.publish_camera(&domain).unwrap();
    let mut last = 0;
    for _ in 0..2 {
        let mut server = Server::create(DomainLock::acquire(&domain).unwrap()).unwrap();
        for _ in 0..3 {
            let frame = next_frame(&mut server);
            assert_eq!((frame.count, frame.flags), (2, ExternalPosition::VALID));
            assert!(frame.stamp_ns > last && frame.stamp_ns < clock::now().0);
            assert!(frame.deviation[0] > 0.0 && frame.position[2] == 0.0);
            last = frame.stamp_ns;
        }
    }
}

/// Sends a line to the control socket and returns the reply.
fn request(socket: &Path, line: &str) -> String {
    let mut stream = UnixStream::connect(socket).unwrap();
    writeln!(stream, "{line}").unwrap();
    let mut reply = String::new();
    BufReader::new(stream).read_line(&mut reply).unwrap();
    reply.trim().to_owned()
}

/// Waits until a newer frame fulfils a condition.
fn wait_for(frames: &Receiver<[f64; 2]>, what: &str, is_met: impl Fn([f64; 2]) -> bool) {
    let start = Instant::now();
    while !is_met(frames.recv_timeout(Duration::from_secs(10)).unwrap()) {
        assert!(start.elapsed() < Duration::from_secs(10), "{what}");
    }
}

#[test]
fn the_control_socket_ages_the_snake_and_disturbs_the_camera() {
    let folder = tempfile::tempdir().unwrap();
    let ports = folder.path().join("ports");
    let source = SnakeSource::load("preisach:2").unwrap();
    let mut emulator = Emulator::start(EmulatorConfig::new(source, &ports)).unwrap();
    let (sender, frames) = channel();
    let send = move |frame: ExternalPosition| {
        let [pitch, yaw, _] = frame.position.map(f64::to_degrees);
        let _ = sender.send([pitch, yaw]);
    };
    emulator.start_camera(move || send).unwrap();
    let socket = ports.join("control");
    let zero = "ageing = {parameter = \"zero\", by = 5, direction = [1, 0], course = \"step\"}";
    wait_for(&frames, "straight", |[pitch, yaw]| pitch.abs() + yaw.abs() < 1.0);
    assert_eq!(request(&socket, zero), "ok");
    wait_for(&frames, "slipped", |[pitch, yaw]| pitch > 4.0 && yaw.abs() < 1.0);
    assert_eq!(request(&socket, "camera = {fault = \"swapped\"}"), "ok");
    wait_for(&frames, "swapped", |[pitch, yaw]| yaw > 4.0 && pitch.abs() < 1.0);
    assert_eq!(request(&socket, "camera = \"good\""), "ok");
    wait_for(&frames, "good again", |[pitch, _]| pitch > 4.0);
    let refused = request(&socket, "ageing = {parameter = \"teeth\", by = 1, course = \"step\"}");
    assert!(refused.starts_with("error: ") && refused.contains("teeth"), "{refused}");
}
