//! `i2ris doctor wire` and `i2ris doctor drives`: serial traffic and drive settings.

use std::{fs, path::Path};

use i2ris::drive::objects::{self, Entry};
use i2ris::{config::Family, drive::fingerprint::key};
use i2ris::{model::file::ModelFile, robot::DriveFingerprint};
use i2ris_simulation::Line;
use i2ris_testing::Rig;
use i2ris_testing::bench::{WorkFolder, assert_says, expect_stalls, fails, run, succeeds};
use nix::sys::signal::Signal;
use serde_json::Value;

/// A robot with a running controller, and a folder for files.
fn robot() -> (Rig, WorkFolder) {
    let mut rig = Rig::on(Line::Rs232);
    rig.config.control.model = Some(rig.sample_model("model.json", "rig", 1.0));
    expect_stalls(&mut rig);
    rig.start_controller();
    rig.client();
    (rig, WorkFolder::empty())
}

#[test]
fn capture_is_shown_replayed_and_compared_up_to_truncation() {
    let (mut rig, bench) = robot();
    let domain = rig.domain();
    let replayed = succeeds(&domain, "record replay");
    assert_says(&replayed, &["identical bit for bit"]);
    let path = Path::new(replayed.lines().next().unwrap()).with_extension("pcapng");
    rig.signal(Signal::SIGTERM);
    rig.wait_for_end();
    fs::copy(&path, bench.path("a.pcapng")).unwrap();
    let shown = bench.succeeds("doctor wire a.pcapng");
    let says = [
        "read statusword (0x6041:00)",
        "read actual position (0x6064:00)",
        "axis0, Epos4, 115200 baud",
        "write lowest position limit (0x607D:01) = -",
        "done",
        "90 02 ",
    ];
    assert_says(&shown, &says);
    assert_eq!(shown.matches(" 0 differences").count(), 2, "{shown}");
    assert_says(&bench.succeeds("doctor wire a.pcapng a.pcapng"), &["differ     0 of"]);

    let whole = fs::read(bench.path("a.pcapng")).unwrap();
    fs::write(bench.path("cut.pcapng"), &whole[..whole.len() / 2 + 1]).unwrap();
    for words in ["cut.pcapng", "a.pcapng cut.pcapng"] {
        let result = bench.run(&format!("doctor wire {words}"));
        assert_eq!(result.code, Some(10), "{words}: {}", result.error);
        assert_says(&result.error, &["cut.pcapng is truncated", "complete events"]);
        assert!(result.output.lines().count() > 1, "{words}");
    }
    fs::write(bench.path("other.pcapng"), "t_s,q0_counts\n").unwrap();
    bench.fails("doctor wire other.pcapng", &["other.pcapng is not a capture"]);
}

#[test]
fn drive_settings_are_dumped_compared_and_stored_in_models() {
    let (mut rig, bench) = robot();
    let domain = rig.domain();
    let now = succeeds(&domain, "doctor drives");
    let drives: Vec<DriveFingerprint> = serde_json::from_str(&now).unwrap();
    assert_eq!(drives.iter().map(|drive| drive.motor).collect::<Vec<_>>(), [0, 1]);
    let limit = i64::from(rig.config.ports[0].axes[0].current_limit_ma);
    assert_eq!(drives[0].settings["0x3001:02"], limit);
    bench.write("now.json", &now);
    let same = succeeds(&domain, &bench.words("doctor drives @now.json"));
    assert_says(&same, &["no differences"]);
    let mut other = drives.clone();
    *other[1].settings.get_mut("0x3010:01").unwrap() += 1;
    let pulses = drives[1].settings["0x3010:01"];
    bench.write("other.json", &serde_json::to_string(&other).unwrap());
    let named = format!("motor 1: encoder pulses (0x3010:01) {} -> {pulses}", pulses + 1);
    let result = bench.run("doctor drives other.json now.json");
    assert_eq!((result.code, result.output.trim()), (Some(1), named.as_str()), "{}", result.error);

    // As maxon's tool writes the settings of one drive of any motor.
    let value = |entry: &Entry| drives[0].settings.get(&key(entry)).copied();
    let row = |entry: &Entry| {
        let kind = format!("{:?}", entry.kind).replace("Text", "STR");
        let access = format!("{:?}", entry.access).to_lowercase();
        let value = value(entry).unwrap_or(entry.default);
        format!("0x{:04X},{},{kind},{access},,,,{value}\n", entry.index, entry.subindex)
    };
    let rows: String = objects::of_family(Family::Epos4).map(row).collect();
    let table = format!("index,subindex,type,access,low,high,default,value\n{rows}");
    bench.write("motor_fw0170.csv", &table);
    let same = bench.succeeds("doctor drives motor_fw0170.csv now.json");
    assert_says(&same, &["no differences: 2 drives"]);
    let changed = table.replace("0x3001,2,U32,rw,,,,300", "0x3001,2,U32,rw,,,,301");
    assert_ne!(table, changed, "{table}");
    bench.write("changed_fw0170.csv", &changed);
    let result = bench.run("doctor drives changed_fw0170.csv now.json");
    let named_both = "motor 0: output current limit (0x3001:02) 301 -> 300\nmotor 1: output";
    assert_says(&result.output, &[named_both]);

    // A model of that drive needs --other-drive; one with other configured limits does not.
    let sample = rig.sample_model("sample.json", "rig", 1.0);
    let mut file = ModelFile::parse(&fs::read_to_string(&sample).unwrap()).unwrap();
    let mut limited = drives.clone();
    for key in ["0x3001:02", "0x607D:01", "0x607D:02"] {
        *limited[1].settings.get_mut(key).unwrap() -= 1;
    }
    file.training.drives = limited;
    let same = sample.with_file_name("same.json");
    file.write(&same).unwrap();
    succeeds(&domain, &format!("model use {} --no-activate", same.display()));
    file.training.drives = other;
    let strange = sample.with_file_name("strange.json");
    file.write(&strange).unwrap();
    let strange = strange.display();
    let words = format!("model use {strange} --no-activate");
    let refused = ["calibrated with different drive settings", &named, "--other-drive"];
    fails(&domain, &words, 4, &refused);
    succeeds(&domain, &format!("{words} --other-drive"));
    succeeds(&domain, &bench.words("record --duration-s 0.5 --output @a.mcap"));
    assert_says(&bench.succeeds("record info a.mcap"), &["0x3001:02"]);

    // Without a controller the ports are read; with that model it does not start.
    rig.signal(Signal::SIGTERM);
    rig.wait_for_end();
    let config = rig.folder.path().join("robot.toml");
    let read = bench.succeeds(&format!("doctor drives --config {}", config.display()));
    let read: Vec<DriveFingerprint> = serde_json::from_str(&read).unwrap();
    assert_eq!(read, drives);
    rig.config.control.model = Some(strange.to_string().into());
    let mut child = rig.spawn_controller("strange");
    assert_eq!(i2ris_testing::wait_for_end(&mut child).code(), Some(1));
    assert_says(&rig.log_text("strange"), &[&named, "--other-drive"]);
    let log = fs::read_to_string(rig.folder.path().join("records/runs.jsonl")).unwrap();
    let begin: Value = serde_json::from_str(log.lines().next().unwrap()).unwrap();
    assert_eq!(begin["drives"][0]["settings"]["0x3001:02"], limit);
    assert_eq!(run(&domain, "doctor drives").code, Some(3));
}
