//! Mistakes of new users: message and exit code of each, by real processes. The table
//! of the manual is made from them: `I2RIS_UPDATE=1 cargo test -p i2ris-cli --test cli
//! mistakes` writes it.

use std::fs;

use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use i2ris_testing::{Rig, wait_for, wait_until_idle};

use crate::bench::{
    WorkFolder, expect_stalls, interrupt, repository, run, start, succeeds, unused_domain,
};

/// The chapter of the manual that has the table.
const CHAPTER: &str = "tools/manual/src/stops-and-faults.md";
const ROBOT: &str = "i2ris-emulated";
const HEAD: &str = "\
| mistake | command | message | exit code |
|---|---|---|---|
";

/// Mistake, exit code as in the help, and command; without a controller.
const WITHOUT_CONTROLLER: &str = "\
no controller runs | 3 | enable
a wrong domain | 3 | enable --domain elsewhere
a domain with a slash | 2 | enable --domain a/b
a typing error in a command | 2 | comand state pause
an option is missing | 2 | calibrate fit FOLDER/there.csv
a word for a number | 2 | command circle --radius-deg five --period-s 6
no such recording | 1 | calibrate fit FOLDER/none.csv --output FOLDER/new.json
a recording with stamps in ms | 1 | calibrate fit FOLDER/milliseconds.csv --output FOLDER/new.json
an MCAP file for a CSV file | 1 | calibrate fit FOLDER/trial.mcap --output FOLDER/new.json
a recording without counts | 1 | calibrate fit FOLDER/angles.csv --output FOLDER/new.json
a recording of a few rows | 1 | calibrate fit FOLDER/short.csv --output FOLDER/new.json
an existing model file | 1 | calibrate fit FOLDER/there.csv --output FOLDER/there.json
a CSV file for a model | 1 | model show FOLDER/there.csv
a CSV file for an MCAP file | 1 | record info FOLDER/there.csv
a CSV file for a black box | 1 | record replay FOLDER/there.csv
no such configuration | 6 | doctor config check FOLDER/none.toml
a key that does not exist | 6 | doctor config check FOLDER/typo.toml
a configuration that is not TOML | 6 | doctor config check FOLDER/broken.toml
no such snake | 1 | emulate --snake FOLDER/none.toml --ports FOLDER/ports";

/// The same with a controller, before homing.
const BEFORE_HOMING: &str = "\
enable before home | 4 | enable
a circle while the drives are off | 4 | command circle --radius-deg 5 --period-s 6
acknowledge without a fault | 4 | command state acknowledge
resume without pause | 4 | command state resume
all steps in a script, before home | 1 | calibrate --folder FOLDER/here
a missing folder | 1 | calibrate collect --output FOLDER/none/new.csv
an existing recording | 1 | calibrate collect --output FOLDER/there.csv
a missing model file | 4 | model use FOLDER/none.json
a model of another robot | 4 | model use FOLDER/other-robot.json
roll back without a previous model | 4 | model back";

/// Mistakes made so far, as rows of the table.
struct Table {
    bench: WorkFolder,
    rows: Vec<String>,
    wrong: Vec<String>,
}

impl Table {
    fn make_all(&mut self, domain: &Domain, rows: &str) {
        for row in rows.lines() {
            let [what, code, words] = row.split(" | ").collect::<Vec<_>>()[..] else {
                panic!("{row}")
            };
            self.make(domain, what, code.parse().unwrap(), words);
        }
    }

    /// Makes a mistake and records the message. `code`: the exit code stated in the help.
    fn make(&mut self, domain: &Domain, what: &str, code: i32, words: &str) {
        let folder = self.bench.file("");
        let folder = folder.trim_end_matches('/');
        let result = run(domain, &words.replace("FOLDER", folder));
        let (found, error) = (result.code, result.error);
        let generic = |text: &str| {
            let text = text.replace(folder, "FOLDER").replace(domain.name(), "DOMAIN");
            without_numbers(&text).replace('|', "\\|")
        };
        let message = error.lines().find(|line| line.starts_with("error")).unwrap_or("");
        if found != Some(code) || message.is_empty() {
            self.wrong.push(format!("{what}: {found:?}, not {code}\n{error}"));
        }
        let command = generic(words);
        // Other tests serve separate domains.
        let message = message.split(" (served: ").next().unwrap_or(message);
        let message = without_decimals(&generic(message.trim_start_matches("error: ")));
        self.rows.push(format!("| {what} | `i2ris {command}` | {message} | {code} |\n"));
    }
}

/// Identities and process numbers differ from run to run.
fn without_numbers(text: &str) -> String {
    let is_id = |word: &str| word.len() == 16 && word.chars().all(|c| c.is_ascii_hexdigit());
    let mut after_name = false;
    let words = text.split(' ').map(|word| {
        let bare = word.trim_end_matches([',', ';', ':', '.']);
        let is_number = after_name && bare.chars().all(|c| c.is_ascii_digit());
        after_name = matches!(bare, "process" | "user" | "id");
        if is_id(bare) {
            word.replace(bare, "ID")
        } else if is_number {
            word.replace(bare, "N")
        } else {
            word.to_owned()
        }
    });
    words.collect::<Vec<_>>().join(" ")
}

/// Measured values differ from run to run.
fn without_decimals(text: &str) -> String {
    let is_measured = |word: &&str| word.contains('.') && word.parse::<f64>().is_ok();
    let words = text.split(' ');
    let hidden = words.map(|word| Some(word).filter(|it| !is_measured(it)).unwrap_or("N"));
    hidden.collect::<Vec<_>>().join(" ")
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
    let bench = WorkFolder::new();
    write_files(&bench);
    let mut table = Table { bench, rows: Vec::new(), wrong: Vec::new() };
    table.make_all(&unused_domain(), WITHOUT_CONTROLLER);
    let mut rig = Rig::start();
    expect_stalls(&mut rig);
    rig.config.robot_id = ROBOT.to_owned();
    rig.config.control.model = Some(rig.sample_model("model.json", ROBOT, 1.0));
    rig.start_controller_thread();
    let (domain, mut client) = (rig.domain(), rig.client());
    wait_until_idle(&mut client);
    let other = rig.sample_model("other-robot.json", "another-robot", 1.0);
    fs::copy(other, table.bench.path("other-robot.json")).unwrap();
    table.make_all(&domain, BEFORE_HOMING);
    while_enabled(&mut table, &domain, &mut rig.client());
    assert!(table.wrong.is_empty(), "{}", table.wrong.join("\n"));
    compare(&format!("{HEAD}{}", table.rows.concat()));
}

fn while_enabled(table: &mut Table, domain: &Domain, client: &mut Client) {
    succeeds(domain, "home");
    succeeds(domain, "enable");
    table.make(domain, "home while enabled", 4, "home");
    table.make(domain, "a table without time", 1, "command file FOLDER/waypoints.csv");
    table.make(
        domain,
        "a pose out of reach",
        7,
        "command pose 60 0 --speed-deg-s 30 --duration-s 0.5",
    );
    let first = start(domain, "command pose");
    wait_for(client, |state| state.lease_client_id != 0);
    table.make(domain, "a second commander", 4, "command pose 1 1 --duration-s 0.5");
    interrupt(first);
    succeeds(domain, "command state condition --no-wait");
    table.make(domain, "a command while the robot is busy", 4, "command state condition --no-wait");
}

fn compare(table: &str) {
    let file = repository(CHAPTER);
    let text = fs::read_to_string(&file).unwrap();
    let (head, rest) = text.split_once("<!-- mistakes:").unwrap();
    let (mark, rest) = rest.split_once("-->\n\n").unwrap();
    let (written, tail) = rest.split_once("\n<!-- end -->").unwrap();
    if std::env::var_os("I2RIS_UPDATE").is_some() {
        let text = format!("{head}<!-- mistakes:{mark}-->\n\n{table}\n<!-- end -->{tail}");
        fs::write(&file, text).unwrap();
        return;
    }
    assert!(
        written == table,
        "the messages differ from {}; look at the difference, and set I2RIS_UPDATE=1\n{table}",
        file.display()
    );
}
