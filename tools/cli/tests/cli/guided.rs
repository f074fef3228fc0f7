//! `i2ris calibrate` without a command, against a whole controller with emulated drives: all steps
//! in a pipe, an interruption, and going on where it was.

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::Command;

use i2ris::ipc::OperatingState;
use i2ris::model::Model;
use i2ris_testing::{Rig, settle_in, wait_until};
use nix::sys::signal::{Signal, kill};

use crate::bench::{Bench, assert_says, end, expect_stalls, start};

#[test]
#[ignore = "two minutes of motion"]
fn it_says_every_step_goes_on_after_an_interruption_and_ends_with_a_model_in_use() {
    let mut rig = Rig::with_model();
    expect_stalls(&mut rig);
    rig.config.command.max_step_counts = 250;
    rig.start_controller_thread();
    let (domain, mut client) = (rig.domain(), rig.client());
    let bench = Bench::with("robot.toml", &toml::to_string(&rig.config).unwrap());
    let (config, folder) = (bench.file("robot.toml"), bench.file("here"));
    let words = format!(
        "calibrate --config {config} --folder {folder} --home --duration-s 20 --family gmr-play"
    );

    // Ctrl-C while it records: what was recorded is put aside, and nothing else is lost.
    let mut first = start(&domain, &words);
    let mut lines = BufReader::new(first.child().stdout.take().unwrap()).lines();
    let line = lines.next().unwrap().unwrap();
    assert!(line.starts_with("step 1 of 6: collect: ") && line.contains(" to go"), "{line}");
    settle_in(&mut client, OperatingState::Enabled);
    wait_until("it records", || {
        fs::metadata(bench.path("here/recording.csv")).is_ok_and(|data| data.len() > 2000)
    });
    // Ctrl-C reaches every process of a terminal, so the step as well.
    let children = Command::new("pgrep").args(["-P", &first.child().id().to_string()]).output();
    let step: i32 = String::from_utf8_lossy(&children.unwrap().stdout).trim().parse().unwrap();
    first.interrupt();
    kill(nix::unistd::Pid::from_raw(step), Signal::SIGINT).unwrap();
    let _rest = lines.by_ref().count();
    let said = end(first);
    assert_ne!(said.code, Some(0));
    assert_says(&said.error, &["run `i2ris calibrate` again: it goes on"]);

    let said = end(start(&domain, &words));
    assert_eq!(said.code, Some(0), "{}{}", said.output, said.error);
    let steps = [
        "step 1 of 6: collect: ",
        "step 1 of 6 done; next: fit",
        "$ i2ris calibrate fit ",
        "step 3 of 6 done; next: stage",
        "$ i2ris model stage ",
        "$ i2ris model activate --force",
        "$ i2ris command state condition",
        "$ i2ris command circle ",
        "done: the robot runs with ",
    ];
    assert_says(&said.output, &steps);
    let [active, ..] = client.models().unwrap().slots;
    assert_eq!(active.model_id, Model::load(&bench.path("here/model.json")).unwrap().id().0);
    let mut left = fs::read_dir(bench.path("here")).unwrap();
    assert!(left.any(|entry| entry.unwrap().path().extension() == Some("part".as_ref())));

    // Nothing is left to do, and nothing is done again.
    let said = end(start(&domain, &words));
    assert_eq!((said.code, said.output.matches(": done before").count()), (Some(0), 6));
}
