//! The Python client against a controller without drives and a whole one.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::{fs, path::Path, thread, time::Duration};

use i2ris::ipc::{StateCommand, find_client_process};
use i2ris::{ipc::client::Client, units::Nanos};
use i2ris_needs::needs;
use i2ris_testing::bench::{expect_stalls, robot};
use i2ris_testing::{Controller, Rig, SetOnDrop, python, run_python, wait_for};

#[track_caller]
fn runs(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success(), "{out}{err}");
    out
}

#[needs("python: iceoryx2, numpy")]
#[test]
fn python_session_enables_moves_watches_and_releases_the_lease() {
    let controller = Controller::start();
    run_python(include_str!("python/session.py"), &[controller.domain.name()]);
    let robot = controller.robot();
    assert_eq!((robot.lease, robot.requested.last()), (0, Some(&StateCommand::Release)));
    let [pitch, yaw] = robot.pose;
    assert!((pitch - 5.0).abs() < 1e-9 && (yaw + 3.0).abs() < 1e-9, "{pitch} {yaw}");
}

#[needs("python: iceoryx2, numpy")]
#[test]
fn forked_child_leaves_the_connection_to_its_parent() {
    let controller = Controller::start();
    run_python(include_str!("python/fork.py"), &[controller.domain.name()]);
}

#[needs("python: iceoryx2, numpy")]
#[test]
fn notebook_has_values_at_once_and_releases_the_lease() {
    let mut command = python();
    let mut rig = Rig::with_model();
    expect_stalls(&mut rig);
    let mut client = rig.enabled();
    let recording = rig.folder.path().join("notebook.mcap");
    let programs = Path::new(env!("CARGO_BIN_EXE_i2ris")).parent().unwrap().display();
    let path = format!("{programs}:{}", std::env::var("PATH").unwrap_or_default());
    command.args(["-c", include_str!("python/notebook.py"), rig.domain().name()]);
    runs(command.arg(&recording).env("PATH", path));
    wait_for(&mut client, |state| state.lease_client_id == 0);
}

#[needs("python: iceoryx2, numpy")]
#[test]
fn who_commands_from_python_is_known_by_name() {
    let mut command = python();
    let controller = Controller::enabled();
    command.args(["-c", include_str!("python/holder.py"), controller.domain.name()]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert_eq!(line, "commanding\n");
    controller.wait("the lease", |robot| robot.lease != 0);
    let lease = controller.robot().lease;
    let mut client = Client::connect(&controller.domain, Nanos::from_millis(5000)).unwrap();
    let boot_id = client.version().unwrap().boot_id;
    let caller = || find_client_process(&controller.domain, boot_id, lease);
    let found = caller().unwrap();
    assert_eq!((found.pid, found.program.starts_with("python")), (child.id(), true), "{found}");
    drop(child.stdin.take());
    assert!(child.wait().unwrap().success());
    assert_eq!(caller(), None, "gone with the client");
}

#[needs("python: iceoryx2, numpy")]
#[test]
fn domain_is_from_environment_and_refused_stream_raises() {
    let mut command = python();
    let controller = Controller::enabled();
    controller.robot().refuse = Some(i2ris::ipc::Refusal::Range);
    command.args(["-c", include_str!("python/environment.py")]);
    runs(command.env("I2RIS_DOMAIN", controller.domain.name()));
}

#[needs("python: iceoryx2, numpy")]
#[test]
fn a_controller_of_another_version_is_refused_plainly() {
    let controller = Controller::start();
    let ready = controller.domain.directory().join("ready");
    fs::write(ready, "000000000000b007 99 1\n").unwrap();
    run_python(include_str!("python/foreign.py"), &[controller.domain.name()]);
}

#[needs("python: iceoryx2, numpy")]
#[test]
fn models_are_swapped_from_python_while_the_snake_moves() {
    let mut command = python();
    let (rig, _client) = robot(|_| ());
    let second = rig.sample_model("second.json", "rig", 1.1);
    let broken = rig.folder.path().join("broken.json");
    fs::write(&broken, "{}").unwrap();
    command.args(["-c", include_str!("python/swap.py"), rig.domain().name()]);
    let out = runs(command.args([&second, &broken]));
    assert!(out.contains("swapped and back"), "{out}");
}

#[needs("python: iceoryx2, numpy")]
#[test]
fn refusals_of_another_client_do_not_end_python_stream() {
    let mut rig = Rig::with_model();
    expect_stalls(&mut rig);
    let _client = rig.enabled();
    let (stray, done) = (rig.client(), AtomicBool::new(false));
    thread::scope(|scope| {
        let _stop = SetOnDrop(&done);
        let (mut commander, done) = (stray.commander(), &done);
        scope.spawn(move || {
            while !done.load(Ordering::Relaxed) {
                let _ = commander.servo_jp(&[f64::NAN, 0.0]);
                thread::sleep(Duration::from_millis(10));
            }
        });
        run_python(include_str!("python/stray.py"), &[rig.domain().name()]);
    });
}

#[needs("python: numpy")]
#[test]
fn python_judges_command_effects_by_the_rust_table() {
    run_python(include_str!("python/progress.py"), &[]);
}

/// Fits, networks, benchmark, environment, notebook, and files equal to those of the command line.
#[needs("python: pytest, numpy, i2ris.model, i2ris_native")]
#[test]
fn the_wheel_does_what_the_command_line_does() {
    let mut pytest = python();
    // The source tree has no compiled part.
    pytest.env("PYTHONSAFEPATH", "1").env("I2RIS_CLI", env!("CARGO_BIN_EXE_i2ris"));
    println!("{}", runs(pytest.args(["-m", "pytest", "-q", "tests/test_model.py"])));
}
