//! The help of every subcommand and of every program.

use i2ris_report::programs::PROGRAMS;
use i2ris_testing::bench::{WorkFolder, assert_says, repository, robot, succeeds};

use std::fs;

#[test]
fn commands_have_examples_and_help_lists_exit_codes() {
    let own = "start emulate demo doctor home enable disable command teleop calibrate model";
    let inner = ["doctor drives", "doctor wire"];
    for name in own.split(' ').chain(inner).chain(PROGRAMS.map(|program| program.words)) {
        let help = WorkFolder::empty().succeeds(&format!("{name} --help"));
        assert_says(&help, &["Example", &format!("i2ris {name}")]);
    }
    let help = WorkFolder::empty().succeeds("--help");
    for name in own.split(' ') {
        assert_says(&help, &[&format!("\n  {name} ")]);
    }
    for code in ["0 ", "1 ", "2 ", "3 ", "4 ", "5 ", "6 ", "7 ", "8 ", "130 "] {
        assert!(help.lines().any(|line| line.trim_start().starts_with(code)), "{code}: {help}");
    }
}

/// Examples that run unattended and end, as printed, on a robot with emulated drives.
#[test]
fn examples_of_the_help_run_as_printed() {
    let (rig, _client) = robot(|_| ());
    let (bench, domain) = (WorkFolder::empty(), rig.domain());
    let here = |words: &str| {
        let files = ["steel.json", "newer.json", "snake.json", "desired.csv", "before.csv"];
        let files = files.iter().chain(&["path.csv", "robot.toml", "counts.csv", "angles.csv"]);
        files.fold(words.replace("config/models/", ""), |words, name| {
            words.replace(&format!(" {name}"), &format!(" {}", bench.file(name)))
        })
    };
    let model = rig.sample_model("sample.json", "rig", 1.0);
    for name in ["steel.json", "newer.json", "snake.json"] {
        fs::copy(&model, bench.path(name)).unwrap();
    }
    bench.write("desired.csv", "t_s,pitch_deg,yaw_deg\n0,0,0\n1,1,-1\n");
    let counts = "t_s,q0_counts,q1_counts\n0,0,0\n1,20,-30\n";
    bench.write("before.csv", counts);
    bench.write("path.csv", counts);
    let config = fs::read_to_string(repository("config/emulator.toml")).unwrap();
    bench.write("robot.toml", &config.replace("i2ris-emulated", "rig"));
    let mut ran = 0;
    for command in
        ["home", "model use", "model back", "model show", "model invert", "model predict"]
    {
        let help = bench.succeeds(&format!("{command} --help"));
        let examples = help.lines().filter_map(|line| line.strip_prefix("  i2ris "));
        for words in examples.flat_map(|line| line.split("   ").next().unwrap().split("&& i2ris "))
        {
            succeeds(&domain, &here(&format!(" {words}")));
            ran += 1;
        }
    }
    assert!(ran >= 10, "{ran}");
}
