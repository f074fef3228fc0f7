//! H13: logger, terminal or disk blocks. The loop uses none of them; other threads drop and count.

use std::fs;
use std::os::fd::AsFd;
use std::process::Stdio;

use i2ris::ipc::OperatingState;
use i2ris_testing::{Rig, enable, home, stream_counts, wait_until};
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::sys::signal::Signal;

/// Standard error is a full pipe that nobody reads; the folder of the black boxes is a file.
#[test]
fn h13_a_blocked_log_and_a_missing_record_folder_do_not_stop_the_loop() {
    let mut rig = Rig::start();
    fs::write(rig.folder.path().join("records"), "in the way").unwrap();
    let (reader, writer) = std::io::pipe().unwrap();
    fill(&writer);
    rig.start_controller_with(Stdio::from(writer));
    let mut client = rig.client();
    home(&mut client);
    enable(&mut client);
    stream_counts(&client, 1.0, |t| [(200.0 * t) as i32, 0]);
    let mut statistics = client.watcher().period_statistics();
    for _ in 0..3 {
        wait_until("a second with ticks of the loop", || {
            let newest = statistics.newest().unwrap();
            newest.filter(|message| message.ticks > 100)
        });
    }
    let error = client.write_black_box().unwrap_err().to_string();
    assert!(error.contains("cannot write black box"), "{error}");
    let state = client.operating_state().unwrap().unwrap();
    assert_eq!(state.state, OperatingState::Enabled.number());
    // The controller ends although nobody ever reads the log.
    rig.signal(Signal::SIGTERM);
    assert_eq!(rig.wait_for_end().code(), Some(0));
    drop(reader);
}

/// The run log is complete although the log for the operator is blocked.
#[test]
fn h13_a_blocked_log_stops_neither_the_run_log_nor_the_end() {
    let mut rig = Rig::start();
    let (_reader, writer) = std::io::pipe().unwrap();
    fill(&writer);
    rig.start_controller_with(Stdio::from(writer));
    let mut client = rig.client();
    home(&mut client);
    enable(&mut client);
    let runs = rig.folder.path().join("records/runs.jsonl");
    let read = || fs::read_to_string(&runs).unwrap_or_default();
    wait_until("the change of state is in the run log", || {
        read().contains(r#""to":"ENABLED""#).then_some(())
    });
    rig.signal(Signal::SIGTERM);
    assert_eq!(rig.wait_for_end().code(), Some(0));
    let text = read();
    assert!(text.contains(r#""event":"end""#), "{text}");
}

/// A controller that cannot start says so and ends, read or not.
#[test]
fn h13_a_blocked_log_does_not_stop_the_end_of_a_start_that_failed() {
    let mut rig = Rig::start();
    rig.config.control.model = Some("absent.json".into());
    let (_reader, writer) = std::io::pipe().unwrap();
    fill(&writer);
    rig.start_controller_with(Stdio::from(writer));
    assert_eq!(rig.wait_for_end().code(), Some(1));
}

fn fill(pipe: &std::io::PipeWriter) {
    let set_flags = |flags| fcntl(pipe.as_fd(), FcntlArg::F_SETFL(flags)).unwrap();
    set_flags(OFlag::O_NONBLOCK);
    while nix::unistd::write(pipe.as_fd(), &[b' '; 4096]).is_ok() {}
    while nix::unistd::write(pipe.as_fd(), b" ").is_ok() {}
    set_flags(OFlag::empty());
}
