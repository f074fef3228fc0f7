//! What fails or is lost is published, and so is the log.

use i2ris::clock;
use i2ris::ipc::payload::{Health, unpadded_text};
use i2ris_simulation::Injection;
use i2ris_testing::{Rig, wait_until};

#[test]
fn link_errors_are_published_as_health() {
    let mut rig = Rig::start();
    let client = rig.enabled();
    let mut health = client.watcher().health();
    let mut newest = |condition: &dyn Fn(&Health) -> bool| {
        wait_until("a record of health", || health.newest().unwrap().filter(condition))
    };
    let before = newest(&|_| true);
    assert!(before.stamp_ns <= clock::now().0);
    assert_eq!((before.ipc_failures, before.lost_replies), (0, 0));
    for _ in 0..3 {
        rig.emulator.inject(1, Injection::FlipReply { offset: 4 });
    }
    let errors = |health: &Health| {
        health.crc_errors[1] + health.timeouts[1] + health.resynchronisations[1] + health.retries[1]
    };
    let after = newest(&|health| errors(health) > errors(&before));
    assert!(after.sequence > before.sequence);
}

#[test]
fn the_log_is_published_line_by_line() {
    let mut rig = Rig::start();
    let client = rig.enabled();
    // A client that comes late gets the last lines.
    let mut events = client.watcher().events();
    let mut lines = Vec::new();
    wait_until("the line of the change to ENABLED", || {
        events.drain(|event| lines.push(unpadded_text(&event.text))).unwrap();
        lines.iter().any(|line| line.contains("-> ENABLED")).then_some(())
    });
    let log = rig.log_text("controller");
    assert!(lines.iter().all(|line| log.contains(line)), "{lines:?}\n{log}");
}
