//! H13, H16, H17: a logger that blocks, false trips, a step of the wall clock.

use std::fs;
use std::io::PipeReader;
use std::path::Path;
use std::process::Stdio;

use i2ris::ipc::OperatingState;
use i2ris::ipc::client::Client;
use i2ris_testing::program::{c_library, full_pipe};
use i2ris_testing::{Rig, enable, home, stream_angles, stream_counts, wait_until, wait_until_idle};
use nix::sys::signal::Signal;

use super::documents::map::sources;

/// A controller whose standard error is a full pipe, with its end that no one reads.
fn enabled_with_blocked_log(rig: &mut Rig) -> (PipeReader, Client) {
    let (reader, writer) = full_pipe();
    rig.start_controller_with(Stdio::from(writer));
    let mut client = rig.client();
    home(&mut client);
    enable(&mut client);
    (reader, client)
}

/// Standard error is a full pipe without a reader; the folder of the black boxes is a file.
#[test]
fn h13_blocked_log_and_missing_record_folder_do_not_stop_loop() {
    let mut rig = Rig::start();
    fs::write(rig.folder.path().join("records"), "in the way").unwrap();
    let (reader, mut client) = enabled_with_blocked_log(&mut rig);
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
    assert_eq!(client.operating_state().unwrap().unwrap().state, OperatingState::Enabled.number());
    // The controller ends although the log is never read.
    rig.signal(Signal::SIGTERM);
    assert_eq!(rig.wait_for_end().code(), Some(0));
    drop(reader);
}

/// The run log is complete although the log for the operator is blocked.
#[test]
fn h13_blocked_log_does_not_block_run_log_or_shutdown() {
    let mut rig = Rig::start();
    let (_reader, _client) = enabled_with_blocked_log(&mut rig);
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

/// A controller that cannot start logs it and ends, even if the log is not read.
#[test]
fn h13_blocked_log_does_not_block_exit_after_failed_start() {
    let mut rig = Rig::start();
    rig.config.control.model = Some("absent.json".into());
    let (_reader, writer) = full_pipe();
    rig.start_controller_with(Stdio::from(writer));
    assert_eq!(rig.wait_for_end().code(), Some(1));
}

/// The black box waits for its disk forever, and the drives no longer reply: at its end the
/// controller does not report them off.
#[test]
fn h13_hung_disk_does_not_confirm_power_off() {
    let mut rig = Rig::start();
    let library = c_library(rig.folder.path(), include_str!("hanging_disk.c"));
    rig.environment = vec![("LD_PRELOAD".into(), library.into())];
    for port in &mut rig.config.ports {
        port.reply_timeout_ms = 300;
    }
    let _client = rig.enabled();
    rig.emulator.mute(0, true);
    rig.signal(Signal::SIGTERM);
    let (status, log) = (rig.wait_for_end(), rig.log_text("controller"));
    assert!(!log.contains("the drives are off"), "{log}");
    assert!(log.contains("have not confirmed power-off"), "{log}");
    assert!(log.contains("thread black box did not end in time"), "{log}");
    assert_eq!(status.code(), Some(8), "{log}");
}

fn soak(seconds: f64) {
    let mut rig = Rig::with_model();
    let mut client = rig.enabled();
    stream_angles(&client, |t| {
        (t < seconds).then(|| [8.0 * (0.8 * t).sin(), 6.0 * (1.2 * t).sin()])
    });
    let (state, log) = (wait_until_idle(&mut client), rig.log_text("controller"));
    assert_eq!(state.state, OperatingState::Enabled.number(), "{log}");
    assert!(!log.contains("FAULT"), "{log}");
    let (accepted, stops) = (state.accepted, state.stale_stops);
    println!("{seconds} s, {accepted} commands, {stops} stops for a late commander, no fault");
}

#[test]
fn h16_ten_seconds_with_real_processes_raise_no_fault() {
    soak(10.0);
}

/// For `cargo test --test real_time -- --ignored --nocapture h16_soak`; seconds in `I2RIS_SOAK_S`,
/// default one hour.
#[test]
#[ignore = "takes an hour"]
fn h16_soak() {
    soak(std::env::var("I2RIS_SOAK_S").map_or(3600.0, |seconds| seconds.parse().unwrap()));
}

/// Names of functions and types that read a clock that can be set.
const WALL_CLOCKS: [&str; 5] =
    ["SystemTime", "CLOCK_REALTIME", "gettimeofday", "time::OffsetDateTime", "chrono::"];

/// A test cannot set the clock of the machine, so it checks the sources: one file reads the wall
/// clock, and only files for records use it.
#[test]
fn h17_only_file_names_and_headers_use_the_wall_clock() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let files = sources(&folder);
    assert!(files.len() > 100, "{}", files.len());
    let (mut readers, mut users) = (Vec::new(), Vec::new());
    for file in &files {
        let text = fs::read_to_string(file).unwrap();
        let name = file.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned();
        if WALL_CLOCKS.iter().any(|clock| text.contains(clock)) {
            readers.push(name.clone());
        }
        if text.contains("wall_clock::") {
            users.push(name);
        }
    }
    users.sort();
    assert_eq!(readers, ["wall_clock.rs"]);
    assert_eq!(users, ["process/black_box/recorder.rs", "process/run_log.rs"]);
}
