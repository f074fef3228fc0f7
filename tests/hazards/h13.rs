//! H13: logger, terminal or disk blocks. The loop has nothing of that in it: it drops and counts.

use std::fs;
use std::io::Read;
use std::process::Stdio;

use i2ris::clock;
use i2ris::ipc::OperatingState;
use i2ris::units::Nanos;

use crate::live::stream_counts;
use crate::rig::{PATIENCE, Rig, enable, home};

/// Standard error is a pipe that nobody reads and that is full already; the folder of the black
/// boxes is a file.
#[test]
fn h13_a_log_that_nobody_reads_and_a_folder_that_is_none_do_not_stop_the_loop() {
    let mut rig = Rig::new();
    fs::write(rig.folder.path().join("records"), "in the way").unwrap();
    let (mut reader, writer) = std::io::pipe().unwrap();
    fill(&writer);
    rig.start_controller_with(Stdio::from(writer));
    let mut client = rig.client();
    home(&mut client);
    enable(&mut client);
    stream_counts(&client, 1.0, |t| [(200.0 * t) as i32, 0]);
    let mut statistics = client.watcher().period_statistics();
    let start = clock::now();
    let mut windows = 0;
    while windows < 3 {
        windows += u32::from(
            statistics
                .newest()
                .unwrap()
                .is_some_and(|message| message.ticks > 100),
        );
        assert!(
            clock::now().since(start) < PATIENCE,
            "the loop does not tick"
        );
        clock::sleep(Nanos::from_millis(20));
    }
    assert!(
        client
            .write_black_box()
            .unwrap_err()
            .to_string()
            .contains("cannot write black box")
    );
    let state = client.operating_state().unwrap().unwrap();
    assert_eq!(state.state, OperatingState::Enabled.number());
    // Read at last, it says what it had to say.
    std::thread::spawn(move || {
        let mut text = Vec::new();
        let _ = reader.read_to_end(&mut text);
    });
    rig.signal(nix::sys::signal::Signal::SIGTERM);
    assert_eq!(rig.wait_for_end().code(), Some(0));
}

/// Fills a pipe to its brim.
fn fill(pipe: &std::io::PipeWriter) {
    use std::os::fd::AsFd;
    let flags =
        |flags| nix::fcntl::fcntl(pipe.as_fd(), nix::fcntl::FcntlArg::F_SETFL(flags)).unwrap();
    flags(nix::fcntl::OFlag::O_NONBLOCK);
    while nix::unistd::write(pipe.as_fd(), &[b' '; 4096]).is_ok() {}
    while nix::unistd::write(pipe.as_fd(), b" ").is_ok() {}
    flags(nix::fcntl::OFlag::empty());
}
