//! `i2ris calibrate` without a command, against a whole controller with emulated drives: all steps
//! in a pipe, an interruption, and going on where it was.
#![allow(clippy::unwrap_used)]

#[path = "commands/live.rs"]
#[allow(dead_code)]
mod live;

use std::fs;
use std::io::{BufRead, BufReader};

use i2ris::ipc::client::Client;
use i2ris::units::Nanos;
use i2ris_testing::Program;
use live::Robot;

#[test]
#[ignore = "two minutes of motion"]
fn the_walk_says_every_step_goes_on_after_an_interruption_and_ends_with_a_model_in_use() {
    let mut robot = Robot::start();
    robot.publish_camera();
    let mut client = Client::connect(&robot.domain, Nanos::from_millis(60_000)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    fs::write(path("robot.toml"), toml::to_string(&robot.config).unwrap()).unwrap();
    let (config, walk) = (path("robot.toml"), path("walk"));
    let words = [
        "calibrate",
        "--config",
        &config,
        "--folder",
        &walk,
        "--home",
        "--duration-s",
        "20",
        "--family",
        "gmr-play",
    ];

    // Ctrl-C while it records: what was recorded is put aside, and nothing else is lost.
    let mut first = Program::start(&robot.domain, &words);
    let mut lines = BufReader::new(first.child().stdout.take().unwrap()).lines();
    let line = lines.next().unwrap().unwrap();
    assert!(line.starts_with("step 1 of 6: collect: ") && line.contains(" to go"), "{line}");
    let busy = |state: &i2ris::ipc::payload::OperatingStateMsg| state.state == 1;
    if client.wait_for(Nanos::from_millis(30_000), busy).is_err() {
        first.interrupt();
        let rest: Vec<String> = lines.by_ref().map_while(Result::ok).collect();
        panic!("it does not enable the robot: {rest:?} {:?}", first.code());
    }
    while fs::metadata(path("walk/recording.csv")).map_or(0, |data| data.len()) < 2000 {
        i2ris::clock::sleep(Nanos::from_millis(20));
    }
    // Ctrl-C reaches every process of a terminal, so the step as well.
    let children = std::process::Command::new("pgrep")
        .args(["-P", &first.child().id().to_string()])
        .output()
        .unwrap();
    let child: i32 = String::from_utf8_lossy(&children.stdout).trim().parse().unwrap();
    first.interrupt();
    let step = nix::unistd::Pid::from_raw(child);
    nix::sys::signal::kill(step, nix::sys::signal::Signal::SIGINT).unwrap();
    let _rest = lines.by_ref().count();
    let (code, _, error) = first.code();
    assert!(
        code != Some(0) && error.contains("run `i2ris calibrate` again: it goes on"),
        "{code:?} {error}"
    );

    let (code, output, error) = Program::start(&robot.domain, &words).code();
    assert_eq!(code, Some(0), "{output}{error}");
    for part in [
        "step 1 of 6: collect: ",
        "step 1 of 6 done; next: fit",
        "$ i2ris calibrate fit ",
        "step 3 of 6 done; next: stage",
        "$ i2ris model stage ",
        "$ i2ris model activate --force",
        "$ i2ris command state condition",
        "$ i2ris command circle ",
        "done: the robot runs with ",
    ] {
        assert!(output.contains(part), "{part}\n{output}");
    }
    let [active, ..] = client.models().unwrap().slots;
    let model = i2ris::model::Model::load(path("walk/model.json").as_ref()).unwrap();
    assert_eq!(active.model_id, model.id().0);
    let parts = fs::read_dir(path("walk")).unwrap();
    let parts = parts.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert!(parts.filter(|name| name.ends_with(".part")).count() >= 1);

    // Nothing is left to do, and nothing is done again.
    let (code, output, error) = Program::start(&robot.domain, &words).code();
    assert_eq!(code, Some(0), "{output}{error}");
    assert_eq!(output.matches(": done before").count(), 6, "{output}");
}
