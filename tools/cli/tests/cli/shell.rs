//! Interfaces for scripts, shells, editors and systemd: exit codes, closed readers, JSON,
//! completions, units. Help and size of the command line.

use std::process::{Command, Stdio};
use std::{collections::BTreeSet, fs};

use i2ris::ipc::{Domain, Fault, OperatingState, Refusal};
use i2ris_needs::needs;
use i2ris_report::{program::DESCRIBE, programs::PROGRAMS};
use i2ris_testing::bench::{WorkFolder, assert_says, repository, robot, run, succeeds};
use i2ris_testing::{Controller, cycle::balance_model};
use i2ris_testing::{program, sizes::require_at_most, unique_domain};
use serde_json::Value;

fn code(domain: &Domain, words: &str) -> Option<i32> {
    let result = run(domain, words);
    let is_told = result.code == Some(0) || !result.error.is_empty();
    assert!(is_told, "{words} fails without a word: {}", result.output);
    result.code
}

#[test]
fn the_exit_code_reports_what_kind_of_failure_it_was() {
    let unused = unique_domain();
    let controller = Controller::start();
    let domain = &controller.domain;
    for (domain, words, expected) in [
        (&unused, "--completions bash", 0),
        (&unused, "command", 2),
        (&unused, "model show", 3),
        (domain, "command pose", 4),
    ] {
        assert_eq!(code(domain, words), Some(expected), "{words}");
    }
    controller.robot().state = OperatingState::Enabled;
    controller.robot().homed = true;
    controller.robot().refuse = Some(Refusal::Range);
    assert_eq!(code(domain, "command pose 1 1"), Some(4), "every command refused");
    controller.robot().fault = Fault::Drive;
    controller.robot().state = OperatingState::Fault;
    assert_eq!(code(domain, "command pose"), Some(5));
}

/// A full disk, a limit on the size of files, and a terminal that was closed.
#[test]
fn output_that_goes_nowhere_ends_in_order_and_is_said() {
    let config = repository("config/robot.toml");
    let print =
        format!("{} doctor config --all {}", program::path("i2ris").display(), config.display());
    let bench = WorkFolder::empty();
    let printed = fs::File::create(bench.file("printed")).unwrap();
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let closed = nix::pty::openpty(None, None).unwrap().slave;
    for (output, code, result) in [
        (Stdio::from(full), 1, "No space left on device"),
        (Stdio::from(printed), 1, "File too large"),
        (Stdio::from(closed), 130, "Input/output error"),
    ] {
        let mut command = Command::new("sh");
        command.args(["-c", &format!("ulimit -f 1; exec {print}")]).stdout(output);
        let ended = command.stderr(Stdio::piped()).spawn().unwrap().wait_with_output().unwrap();
        let error = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(code), "{result}: {error}");
        assert!(error.contains(result) && !error.contains("panicked"), "{error}");
    }
}

/// `| head -0`: the output is not read.
#[test]
fn closed_reader_is_not_an_error() {
    let config = repository("config/robot.toml");
    let config = config.to_str().unwrap();
    for arguments in [
        &["doctor", "config", "schema"][..],
        &["doctor", "config", "print", config],
        &["--completions", "zsh"],
        &["doctor", "--config", config, "--no-drives"],
    ] {
        let mut command = program::command(arguments);
        command.env("I2RIS_DOMAIN", unique_domain().name()).stdin(Stdio::null());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr);
        let panicked = error.contains("panic") || output.status.code() == Some(101);
        assert!(!panicked, "{arguments:?}: {error}");
    }
}

/// Gaps of 60 counts and friction that stretches the wires by 20 to either side: 100 counts, from
/// rest to rest at 500 counts/s and 5000 counts/s^2. A motor moves the tip by 0.022 deg a count.
#[test]
fn configuration_with_a_model_reports_permitted_hand_motion() {
    let config = fs::read_to_string(repository("config/emulator.toml")).unwrap();
    let config = config.replace("\"i2ris-emulated\"", "\"bench\"");
    let bench = WorkFolder::empty();
    balance_model().file().write(&bench.path("model.json")).unwrap();
    let model = "priority = 80\nmodel = \"model.json\"";
    bench.write("robot.toml", &config.replace("priority = 80", model));
    let output = bench.succeeds("doctor config robot.toml");
    assert_says(&output, &["a reversal takes 300 ms; a hand of up to 11.0 deg/s is followed"]);
    let slow = format!("{config}\n[joint_limits]\nvelocity_deg_s = 4.0");
    bench.write("robot.toml", &slow.replace("priority = 80", model));
    assert_says(&bench.succeeds("doctor config robot.toml"), &["of up to 4.0 deg/s"]);
}

/// The units, with the programs of this build instead of the installed ones.
#[needs("program: systemd-analyze")]
#[test]
fn the_units_of_systemd_are_valid() {
    let bench = WorkFolder::empty();
    let units = ["i2ris-control@.service", "i2ris-watchdog@.service"].map(|name| {
        let text = fs::read_to_string(repository("config/system").join(name)).unwrap();
        assert!(text.contains("ExecStart=/usr/local/bin/i2ris-"), "{name}");
        let program = text.lines().find_map(|line| line.strip_prefix("ExecStart=")).unwrap();
        let installed = program.split(' ').next().unwrap();
        bench.write(name, &text.replace(installed, env!("CARGO_BIN_EXE_i2ris")));
        bench.path(name)
    });
    let output = Command::new("systemd-analyze").arg("verify").args(&units).output().unwrap();
    let result = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    let ours: Vec<&str> = result.lines().filter(|line| line.contains("i2ris")).collect();
    assert!(ours.is_empty(), "{ours:?}");
}

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

/// Examples that run unattended and end, as printed. The sample model is too far off for a camera.
#[test]
fn examples_of_the_help_run_as_printed() {
    let (rig, _client) = robot(|rig| rig.config.limits.plausibility_deg = 0.0);
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

#[derive(Debug, Default)]
struct Surface {
    leaves: BTreeSet<String>,
    options: BTreeSet<String>,
}

impl Surface {
    /// A leaf is what runs: it has no subcommands, or arguments of its own.
    fn add(&mut self, command: &Value, words: &str) {
        let arguments = command["arguments"].as_array().unwrap().iter();
        let is_own = |it: &&Value| !["help", "version"].contains(&it["id"].as_str().unwrap());
        let own: Vec<&Value> = arguments.filter(is_own).collect();
        let subcommands = subcommands(command);
        if subcommands.is_empty() || !own.is_empty() {
            self.leaves.insert(words.to_owned());
        }
        self.options.extend(own.iter().filter_map(|it| Some(it["long"].as_str()?.to_owned())));
        for subcommand in subcommands {
            let name = subcommand["name"].as_str().unwrap();
            self.add(subcommand, format!("{words} {name}").trim());
        }
    }
}

fn subcommands(command: &Value) -> Vec<&Value> {
    let all = command["subcommands"].as_array().unwrap().iter();
    all.filter(|it| it["name"] != "help").collect()
}

#[test]
fn the_command_line_grows_by_nothing_that_is_not_counted() {
    let output = program::command(&[DESCRIBE]).output().unwrap();
    let description: Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut surface = Surface::default();
    surface.add(&description, "");
    surface.leaves.remove("");
    require_at_most("commands", subcommands(&description).len());
    require_at_most("leaves", surface.leaves.len());
    require_at_most("options", surface.options.len());
    // The programs were found and described.
    for leaf in ["record trial start", "start ros master", "vision", "bench loop", "status"] {
        assert!(surface.leaves.contains(leaf), "{leaf}");
    }
}
