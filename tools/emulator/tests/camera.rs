//! The camera and a controller that starts, stops and starts again.

use std::path::Path;
use std::time::{Duration, Instant};

use i2ris::clock;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::ipc::{Domain, DomainLock, Server, random_id};
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};

/// Waits until the controller has received a frame.
fn next_frame(server: &mut Server) -> ExternalPosition {
    let start = Instant::now();
    loop {
        server.maintain(clock::now());
        if let Some(frame) = server.poll_external() {
            return frame;
        }
        assert!(
            start.elapsed() < Duration::from_secs(10),
            "no frame arrives"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn frames_reach_every_controller_of_the_domain() {
    let folder = tempfile::tempdir().unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/snakes/brass.toml");
    let config = EmulatorConfig::new(
        SnakeConfig::load(&path).unwrap(),
        &folder.path().join("ports"),
    );
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
