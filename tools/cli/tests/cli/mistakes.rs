//! Mistakes of new users: message and exit code of each row in the table of the manual, by real
//! processes. `I2RIS_UPDATE=1` writes the messages; a new row needs no message.

use std::fs;

use i2ris::ipc::Domain;
use i2ris_testing::bench::{
    WorkFolder, expect_stalls, interrupt, repository, run, start, succeeds,
};
use i2ris_testing::{Rig, unique_domain, wait_for, wait_until_idle};

/// The chapter of the manual that has the table.
const CHAPTER: &str = "tools/manual/src/stops-and-faults.md";
const ROBOT: &str = "i2ris-emulated";
const HEAD: &str = "| mistake | command | message | exit code |\n|---|---|---|---|\n";

/// Makes the mistake of a row, and returns the row with its message. The error is an exit code
/// other than that of the row.
fn made(bench: &WorkFolder, domain: &Domain, row: &str) -> Result<String, String> {
    let cells = row.trim_start_matches("| ").trim_end_matches(" |");
    let [what, command, shown, code] = cells.split(" | ").collect::<Vec<_>>()[..] else {
        panic!("{row}")
    };
    let folder = bench.file("");
    let folder = folder.trim_end_matches('/');
    let words = command.trim_matches('`').trim_start_matches("i2ris ");
    let result = run(domain, &words.replace("FOLDER", folder));
    let message = result.error.lines().find_map(|line| line.strip_prefix("error: "));
    if result.code != code.parse().ok() || message.is_none() {
        return Err(format!("{what}: {:?}, not {code}\n{}", result.code, result.error));
    }
    // Other tests serve separate domains.
    let message = message.and_then(|it| it.split(" (served: ").next()).unwrap_or_default();
    let message = message.replace(folder, "FOLDER").replace(domain.name(), "DOMAIN");
    let message = message.replace('|', "\\|");
    let is_same = shown.split(' ').count() == message.split(' ').count()
        && shown.split(' ').zip(message.split(' ')).all(|(shown, word)| is_like(shown, word));
    let message = if is_same { shown } else { &message };
    Ok(format!("| {what} | {command} | {message} | {code} |\n"))
}

/// Whether a word is as shown; measured values, and numbers of processes and users are `N`.
fn is_like(shown: &str, word: &str) -> bool {
    shown == word
        || shown.strip_prefix('N').is_some_and(|end| {
            word.strip_suffix(end).is_some_and(|number| number.parse::<f64>().is_ok())
        })
}

/// Files of the wrong kind, and existing files.
fn write_files(bench: &WorkFolder) {
    let head = "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg";
    let rows = |count: u32, step: u32| {
        let row = |k: u32| format!("{},{k},{},{k},{k}\n", step * k, 2 * k);
        format!("{head}\n{}", (0..count).map(row).collect::<String>())
    };
    let config = include_str!("../../../../config/emulator.toml");
    for (name, text) in [
        ("milliseconds.csv", rows(100, 50)),
        ("short.csv", rows(3, 1)),
        ("angles.csv", "t_s,pitch_deg,yaw_deg\n0,1,2\n1,2,3\n".to_owned()),
        ("waypoints.csv", "pitch_deg,yaw_deg\n0,0\n1,1\n".to_owned()),
        ("there.csv", rows(100, 1)),
        ("there.json", "{}".to_owned()),
        ("typo.toml", config.replacen("robot_id", "robot_name", 1)),
        ("broken.toml", "robot_id = [".to_owned()),
    ] {
        bench.write(name, &text);
    }
    fs::write(bench.path("trial.mcap"), b"\x89MCAP0\r\n\xff\xfe\x00\x01").unwrap();
}

#[test]
fn user_mistakes_end_with_a_message_and_exit_code() {
    let bench = WorkFolder::empty();
    write_files(&bench);
    let mut rig = Rig::start();
    expect_stalls(&mut rig);
    rig.config.robot_id = ROBOT.to_owned();
    rig.config.control.model = Some(rig.sample_model("model.json", ROBOT, 1.0));
    let other = rig.sample_model("other-robot.json", "another-robot", 1.0);
    fs::copy(other, bench.path("other-robot.json")).unwrap();
    let file = repository(CHAPTER);
    let text = fs::read_to_string(&file).unwrap();
    let (before, rest) = text.split_once(HEAD).unwrap();
    let (written, after) = rest.split_once("\n<!-- end -->").unwrap();
    let (mut domain, mut first) = (unique_domain(), None);
    let (mut rows, mut wrong) = (String::new(), String::new());
    for row in written.lines() {
        match row.split(" | ").next().unwrap() {
            "| enable before home" => {
                rig.start_controller_thread();
                domain = rig.domain();
                wait_until_idle(&mut rig.client());
            }
            "| home while enabled" => {
                succeeds(&domain, "home");
                succeeds(&domain, "enable");
            }
            "| a second commander" => {
                first = Some(start(&domain, "command pose"));
                wait_for(&mut rig.client(), |state| state.lease_client_id != 0);
            }
            "| a command while the robot is busy" => {
                interrupt(first.take().unwrap());
                succeeds(&domain, "command state condition --no-wait");
            }
            _ => {}
        }
        match made(&bench, &domain, row) {
            Ok(row) => rows += &row,
            Err(reason) => wrong += &reason,
        }
    }
    assert!(wrong.is_empty() && domain.name() == rig.domain().name(), "{wrong}");
    if std::env::var_os("I2RIS_UPDATE").is_some() {
        fs::write(&file, format!("{before}{HEAD}{rows}\n<!-- end -->{after}")).unwrap();
        return;
    }
    let differs = "the messages differ; look at the difference, and set I2RIS_UPDATE=1";
    assert!(written == rows, "{}: {differs}\n{rows}", file.display());
}
