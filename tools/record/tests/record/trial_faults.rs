//! Faults during a trial, and the participant's workload.

use std::fs;
use std::io::Write;
use std::process::Stdio;

use i2ris::clock;
use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::payload::{TrialMsg, unpadded_text};
use i2ris::units::Nanos;
use i2ris_record::report::TrialReport;
use i2ris_record::trial::Study;
use i2ris_record::trial::comparison::StudyReport;
use i2ris_record::trial::journal::Journal;
use i2ris_testing::bench::{assert_says, repository, succeeds};
use i2ris_testing::{Controller, TIMEOUT, wait_until};

use crate::programs::{limit_files, runs_with};
use crate::trial::{START, StudyRig, newest, recorder_of};

const FIRST: &str = "P07-joystick-01";

#[test]
fn workload_is_stored_with_the_last_ended_trial() {
    let controller = Controller::enabled();
    let bench = StudyRig::new(&controller.domain);
    bench.fails("workload --answers 55,30,25,60,50,20", "no trial has ended yet");
    bench.succeeds(START);
    let early = format!("workload {FIRST} --answers 55,30,25,60,50,20");
    bench.fails(&early, "is running: end it with");
    bench.fails("start --participant P7 --condition keyboard", "P07-joystick-01 is running");
    bench.succeeds("stop --outcome success");
    bench.fails("start --participant P7 --condition keyboard", "reads like P07");
    bench.fails("workload --answers 55,30", "2 answers for six scales");
    bench.fails("workload P01-joystick-01 --answers 5,5,5,5,5,5", "is not a trial of this study");
    let answer = |lines: &str| {
        let mut form = bench.command("workload");
        form.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut form = form.spawn().unwrap();
        form.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
        let output = form.wait_with_output().unwrap();
        let printed = [output.stdout, output.stderr].concat();
        (output.status.success(), String::from_utf8(printed).unwrap())
    };
    let (is_stored, printed) = answer("55\n30\n");
    assert!(!is_stored && printed.contains("nothing is stored"), "{printed}");
    let (is_stored, printed) = answer("55\nmany\n30\n25\n60\n50\n20\n");
    assert!(is_stored, "{printed}");
    let parts = ["mental: How mentally", "`many` is not an answer", "-01: workload 40 of"];
    assert_says(&printed, &parts);
    let show = bench.succeeds(&format!("list {FIRST}"));
    assert!(show.contains("workload 40 of 100: mental 55, physical 30"), "{show}");
    // In page and tables.
    let folder = &bench.folder;
    folder.succeeds("record report study");
    assert_says(&folder.read("study/report.html"), &["workload (0 to 100)"]);
    let table = folder.read("study/report.csv");
    assert!(table.lines().next().unwrap().ends_with("performance,effort,frustration"), "{table}");
    assert_says(&table, &[",40,55,30,25,60,50,20"]);
    let effects = folder.read("study/report-effects.csv");
    assert_says(&effects, &["workload (0 to 100),joystick,40,,,,"]);
    assert!(folder.exists("study/report-targets.csv"));
}

#[test]
fn restarted_controller_is_a_new_run_of_the_trial() {
    let controller = Controller::enabled();
    let bench = StudyRig::new(&controller.domain);
    bench.succeeds(START);
    let controller = controller.restart();
    let boots = || Journal::read(&bench.trial(FIRST)).unwrap().unwrap().boots;
    wait_until("the second run is recorded", || boots().len() == 2);
    bench.succeeds("mark after");
    clock::sleep(Nanos::from_millis(300));
    bench.succeeds("stop --outcome recovery");
    let show = bench.succeeds(&format!("list {FIRST}"));
    assert!(show.contains("the controller was started 2 times during the trial"), "{show}");
    assert_ne!(boots()[0], boots()[1]);
    let report = TrialReport::read(&bench.trial(FIRST).join("recording.mcap")).unwrap();
    assert!(report.cut_off.is_none() && report.length_s > 0.2, "{}", report.length_s);
    drop(controller);
}

#[test]
fn full_disk_is_reported_and_robot_and_data_stay() {
    let controller = Controller::enabled();
    let bench = StudyRig::new(&controller.domain);
    bench.succeeds(START);
    bench.succeeds("stop --outcome success");
    let before = fs::read(bench.trial(FIRST).join("recording.mcap")).unwrap();
    let client = Client::connect(&controller.domain, TIMEOUT).unwrap();
    let mut stream = client.watcher().trial();
    let mut measured = Latest::new(client.watcher().measured_js());
    let mut start = bench.command(START);
    limit_files(&mut start, 1 << 40);
    let output = start.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut published = TrialMsg::default();
    wait_until("the trial is published", || {
        published = newest(&mut stream).unwrap_or(published);
        unpadded_text(&published.trial) == "P07-joystick-02"
    });
    // From here on the disk is full; files of the shared memory already exist.
    let limit = nix::libc::rlimit { rlim_cur: 20_000, rlim_max: 20_000 };
    let recorder = recorder_of(&bench.trial("P07-joystick-02")).as_raw();
    // SAFETY: reads the value that it is given, and writes nothing.
    let limited = unsafe {
        let none = std::ptr::null_mut();
        nix::libc::prlimit(recorder, nix::libc::RLIMIT_FSIZE, &raw const limit, none)
    };
    assert_eq!(limited, 0);
    wait_until("the failed recording is published", || {
        published = newest(&mut stream).unwrap_or(published);
        published.flags & TrialMsg::FAILED != 0
    });
    assert_eq!(published.flags, TrialMsg::FAILED, "it continues unrecorded");
    let why = succeeds(&controller.domain, "status");
    assert_says(&why, &["P07-joystick-02 is no longer recorded"]);
    assert_says(&bench.succeeds("list"), &["running, but no longer recorded"]);
    // Other commands do not take it for ended, and marks are kept if they fit.
    bench.fails(START, "P07-joystick-02 is running");
    bench.succeeds("mark still-here");
    let mut first = 0;
    wait_until("the state continues", || {
        let stamp = measured.refresh().unwrap().map_or(0, |it| it.stamp_ns);
        first = if first == 0 { stamp } else { first };
        stamp > first
    });
    bench.succeeds("stop --outcome success");
    let show = bench.succeeds("list P07-joystick-02");
    assert!(show.contains("not recorded to its end") && show.contains("still-here"), "{show}");
    let kept = TrialReport::read(&bench.trial("P07-joystick-02").join("recording.mcap")).unwrap();
    assert!(kept.cut_off.is_some() && kept.length_s > 0.0, "{:?}", kept.cut_off);
    assert_eq!(fs::read(bench.trial(FIRST).join("recording.mcap")).unwrap(), before);
    // In the study it does not count, as any recording that is not complete.
    let left_out =
        |trial: usize| StudyReport::read(&bench.study()).unwrap().trials[trial].left_out.is_some();
    assert!(!left_out(0) && left_out(1));
    fs::write(bench.trial(FIRST).join("recording.mcap"), &before[..before.len() / 2]).unwrap();
    assert!(left_out(0));
    bench.succeeds(START);
    bench.succeeds("stop --outcome success");
}

#[test]
fn a_study_of_another_robot_is_refused_and_leaves_nothing() {
    let config = repository("config/emulator.toml");
    let controller = Controller::enabled();
    runs_with(&controller, &config);
    let bench = StudyRig::new(&controller.domain);
    bench.succeeds(START);
    bench.succeeds("stop --outcome success");
    let another = bench.study().join("another.toml");
    let text = fs::read_to_string(&config).unwrap();
    fs::write(&another, text.replace("i2ris-emulated", "i2ris-two")).unwrap();
    runs_with(&controller, &another);
    let controller = controller.restart();
    bench.fails(START, "of robot `i2ris-emulated`, this controller serves `i2ris-two`");
    let list = bench.succeeds("list");
    assert_eq!(list.matches("P07-joystick-").count(), 1, "{list}");
    assert!(!bench.trial("P07-joystick-02").exists());
    drop(controller);
}

#[test]
fn a_hundred_marks_a_second_are_all_recorded() {
    let controller = Controller::enabled();
    let bench = StudyRig::new(&controller.domain);
    bench.succeeds(START);
    let study = Study::open(&bench.study()).unwrap();
    let mut next = clock::now();
    for number in 1..=100_u32 {
        clock::sleep_until(next);
        next = next + Nanos::from_millis(10);
        assert_eq!(study.mark(clock::now(), "press").unwrap().1, number);
    }
    // The recorder reads its journal every 50 ms.
    clock::sleep(Nanos::from_millis(500));
    bench.succeeds("stop --outcome success");
    let marks = Journal::read(&bench.trial(FIRST)).unwrap().unwrap().marks;
    assert_eq!(marks.len(), 100);
    assert!(marks.windows(2).all(|pair| pair[0].monotonic_ns < pair[1].monotonic_ns));
    let recording = format!("study/{FIRST}/recording.mcap");
    bench.folder.succeeds(&format!("record export {recording} --output tables"));
    let mut table = csv::Reader::from_path(bench.folder.path("tables/trial.csv")).unwrap();
    let column = table.headers().unwrap().iter().position(|name| name == "mark_number").unwrap();
    let mut numbers: Vec<u32> =
        table.records().map(|row| row.unwrap()[column].parse().unwrap()).collect();
    numbers.dedup();
    numbers.retain(|number| *number > 0);
    assert_eq!(numbers, (1..=100).collect::<Vec<_>>());
}
