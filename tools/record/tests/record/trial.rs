//! The trials of a study, by the programs that a person runs, against a controller.

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{fs, io};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::{Client, Subscription};
use i2ris::ipc::payload::{TeleopMsg, TrialMsg, unpadded_text};
use i2ris::units::Nanos;
use i2ris_record::trial::Study;
use i2ris_record::trial::journal::{Journal, Outcome};
use i2ris_testing::bench::{WorkFolder, assert_says};
use i2ris_testing::{Controller, Rig, TIMEOUT, program, wait_until};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};

/// Runs `i2ris record trial` in a study: exit code and what it printed.
pub struct StudyRig {
    pub folder: WorkFolder,
    domain: Domain,
}

impl StudyRig {
    pub fn new(domain: &Domain) -> Self {
        let bench = Self { folder: WorkFolder::empty(), domain: domain.clone() };
        bench.succeeds("new STUDY --condition joystick,keyboard");
        bench
    }

    pub fn study(&self) -> PathBuf {
        self.folder.path("study")
    }

    fn run(&self, words: &str) -> (Option<i32>, String) {
        let output = self.command(words).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(text).unwrap())
    }

    /// `i2ris record trial` with these words; STUDY is its folder.
    pub fn command(&self, words: &str) -> Command {
        let study = self.folder.file("study");
        let words = format!("record trial {}", words.replace("STUDY", &study));
        let mut command = program::command(&words.split_whitespace().collect::<Vec<_>>());
        command.env("I2RIS_STUDY", study).env("I2RIS_DOMAIN", self.domain.name());
        command
    }

    #[track_caller]
    pub fn succeeds(&self, words: &str) -> String {
        let (code, printed) = self.run(words);
        assert_eq!(code, Some(0), "{words}: {printed}");
        printed
    }

    #[track_caller]
    pub fn fails(&self, words: &str, part: &str) {
        let (code, printed) = self.run(words);
        assert!(code != Some(0) && printed.contains(part), "{words}: {code:?} {printed}");
    }

    pub fn trial(&self, name: &str) -> PathBuf {
        self.study().join(name)
    }
}

impl Drop for StudyRig {
    /// A recorder that a failed test left running would wait for its controller for ever.
    fn drop(&mut self) {
        if std::thread::panicking() {
            let _ = self.command("stop --outcome aborted").output();
        }
    }
}

pub const START: &str = "start --participant P07 --condition joystick --task reach";

pub fn newest(stream: &mut Subscription<TrialMsg>) -> Option<TrialMsg> {
    let mut newest = None;
    stream.drain(|message| newest = Some(message)).unwrap();
    newest
}

#[test]
fn trial_is_recorded_with_marks_and_published() {
    let controller = Controller::enabled();
    let bench = StudyRig::new(&controller.domain);
    let client = Client::connect(&controller.domain, TIMEOUT).unwrap();
    let mut stream = client.watcher().trial();
    // Two at once: the second neither starts nor takes the first for truncated.
    let another = Study::open(&bench.study()).unwrap().lock().unwrap();
    bench.fails(START, "another `i2ris record trial start` is running");
    drop(another);
    assert!(bench.succeeds(START).starts_with("P07-joystick-01 is being recorded"));
    bench.fails(START, "P07-joystick-01 is running: end it");
    assert!(bench.succeeds("mark contact").contains("P07-joystick-01: mark 1, contact"));
    bench.succeeds("mark free");
    let mut published = TrialMsg::default();
    wait_until("the mark is published", || {
        published = newest(&mut stream).unwrap_or(published);
        published.mark_number == 2
    });
    assert_eq!(unpadded_text(&published.trial), "P07-joystick-01");
    assert_eq!((unpadded_text(&published.mark).as_str(), published.flags), ("free", 0));
    assert!(published.started_ns < published.mark_ns && published.mark_ns <= clock::now().0);
    assert!(bench.succeeds("stop --outcome recovery --note lost").contains("recovery, 2 marks"));
    wait_until("its end is published", || {
        published = newest(&mut stream).unwrap_or(published);
        published.flags == TrialMsg::ENDED
    });
    bench.fails("mark late", "no trial is running");
    bench.fails("stop --outcome success", "no trial is running");
    // The recording is whole, and has the marks.
    let recording = bench.trial("P07-joystick-01").join("recording.mcap");
    let report = i2ris_record::report::TrialReport::read(&recording).unwrap();
    assert!(report.cut_off.is_none());
    assert_eq!(report.about.get("note").unwrap(), "P07 joystick reach");
    assert!(report.text().contains("no preflight of this controller"), "{}", report.text());
    // The next one has the next number; the list has both. It is marked from another folder, and
    // ended with the printed command.
    let printed = bench.succeeds(START);
    let elsewhere = |words: &str| {
        let mut command = bench.command(words);
        let output = command.env_remove("I2RIS_STUDY").current_dir("/").output().unwrap();
        assert!(output.status.success(), "{words}: {output:?}");
    };
    elsewhere("mark here");
    let advice = printed.split('`').nth(1).unwrap().strip_prefix("i2ris record trial ").unwrap();
    elsewhere(advice);
    let list = bench.succeeds("list");
    let trials = list.lines().filter(|line| line.starts_with("P07-joystick-0")).count();
    assert_eq!(trials, 2, "{list}");
    let show = bench.succeeds("list P07-joystick-01");
    assert_says(&show, &["mark   1", "contact", "no preflight of this controller"]);
    let json: serde_json::Value = serde_json::from_str(&bench.succeeds("list --json")).unwrap();
    assert_eq!(json["P07-joystick-01"]["marks"][1]["text"], "free");
    assert_eq!(json["P07-joystick-01"]["outcome"], "recovery");
}

#[test]
fn each_button_press_marks_the_trial_once() {
    let controller = Controller::enabled();
    let bench = StudyRig::new(&controller.domain);
    let client = Client::connect(&controller.domain, TIMEOUT).unwrap();
    let (mut stream, mut hand) = (client.watcher().trial(), client.announcer());
    // Pressed before the trial: not a mark.
    let mut published = TeleopMsg { mark_ns: clock::now().0, ..TeleopMsg::default() };
    hand.publish(published).unwrap();
    bench.succeeds(START);
    for number in 1..=2 {
        hand.publish(published).unwrap();
        published.mark_ns = clock::now().0;
        wait_until("the mark", || {
            // Published 20 times a second.
            hand.publish(published).unwrap();
            clock::sleep(Nanos::from_millis(20));
            newest(&mut stream).is_some_and(|trial| trial.mark_number == number)
        });
    }
    assert!(bench.succeeds("stop --outcome success").contains("success, 2 marks"));
    let json: serde_json::Value = serde_json::from_str(&bench.succeeds("list --json")).unwrap();
    let mark = &json["P07-joystick-01"]["marks"][1];
    assert_eq!(mark["text"], "by hand");
    assert_eq!(mark["monotonic_ns"], published.mark_ns);
}

#[test]
fn invalid_code_condition_or_study_is_refused_without_traces() {
    let unserved = Domain::new("nobody-serves-this").unwrap();
    let bench = StudyRig::new(&unserved);
    for (words, part) in [
        ("start --participant Ann --condition joystick", "looks like a name"),
        ("start --participant ann@example.org --condition joystick", "e-mail"),
        ("start --participant 1990-01-31 --condition joystick", "date of birth"),
        ("start --participant P07 --condition mouse", "not in this study: joystick, keyboard"),
        ("start --participant P07 --condition joystick", "no controller"),
        ("new STUDY --condition joystick", "already exists"),
        ("list --study /nonexistent", "is not a study"),
        ("list P01-joystick-01", "is not a trial"),
    ] {
        bench.fails(words, part);
    }
    let list = bench.succeeds("list");
    assert!(list.starts_with("no trial yet; `i2ris record trial start` starts one\n"), "{list}");
    let orders = ["participant 1, 3, ...: joystick, keyboard", "2, 4, ...: keyboard, joystick"];
    assert_says(&list, &orders);
    assert_eq!(fs::read_dir(bench.study()).unwrap().count(), 1, "study.json alone");
    let description = bench.folder.read("study/study.json");
    let later = description.replace("\"format\": 1", "\"format\": 2");
    bench.folder.write("study/study.json", &later);
    bench.fails("list", "study format 2, but this program supports 1");
}

pub fn recorder_of(trial: &Path) -> Pid {
    let journal = fs::read_to_string(trial.join("journal.jsonl")).unwrap();
    let recording = journal.lines().find(|line| line.contains("\"recording\"")).unwrap();
    let recording: serde_json::Value = serde_json::from_str(recording).unwrap();
    Pid::from_raw(recording["pid"].as_i64().unwrap().try_into().unwrap())
}

/// The longest time that a thread of a process has waited for a processor, s: on a busy computer
/// it writes later.
fn waited_s(process: Pid) -> f64 {
    let threads = fs::read_dir(format!("/proc/{process}/task")).unwrap();
    let waited_ns = |thread: io::Result<fs::DirEntry>| -> Option<f64> {
        let text = fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        text.split(' ').nth(1)?.parse().ok()
    };
    threads.filter_map(waited_ns).fold(0.0, f64::max) / 1e9
}

/// The content of every file of a trial.
fn content(trial: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<_> =
        fs::read_dir(trial).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.into_iter().map(|file| (file.clone(), fs::read(file).unwrap())).collect()
}

/// Cuts the power at random moments with `cut`, which receives the recorder: earlier files are
/// untouched, the trial keeps its recording except the last second, and the next start finds its
/// state. `back`: the power is back.
fn power_cuts(cases: u32, domain: &Domain, cut: impl Fn(Pid), back: impl Fn()) {
    let bench = StudyRig::new(domain);
    bench.succeeds(START);
    bench.succeeds("stop --outcome success");
    let first = content(&bench.trial("P07-joystick-01"));
    let (number, most_lost_s) = (Cell::new(1), Cell::new(0.0_f64));
    let config = Config {
        cases,
        rng_seed: RngSeed::Fixed(28),
        failure_persistence: None,
        ..Config::default()
    };
    TestRunner::new(config)
        .run(&(0..1500_u64, 0..3_u32), |(after_ms, marks)| {
            number.set(number.get() + 1);
            let printed = bench.succeeds(START);
            let trial = bench.trial(&format!("P07-joystick-{:02}", number.get()));
            let begun = clock::now();
            for mark in 0..marks {
                bench.succeeds(&format!("mark m{mark}"));
            }
            clock::sleep(Nanos::from_millis(after_ms));
            let recorder = recorder_of(&trial);
            let waited_s = waited_s(recorder);
            cut(recorder);
            wait_until("the recorder is gone", || !Journal::is_held(&trial));
            let length_s = clock::now().duration_since(begun).as_seconds();
            back();
            prop_assert!(printed.contains("is being recorded"));
            bench.fails("mark late", "no trial is running");
            let report =
                i2ris_record::report::TrialReport::read(&trial.join("recording.mcap")).unwrap();
            most_lost_s.set(most_lost_s.get().max(length_s - report.length_s));
            let least_s = length_s - waited_s - 1.0;
            prop_assert!(report.length_s > least_s, "{} of {length_s}", report.length_s);
            Ok(())
        })
        .unwrap();
    println!("{cases} power cuts, {:.2} s lost at most", most_lost_s.get());
    let printed = bench.succeeds(START);
    assert_eq!(printed.matches("was truncated").count(), 1, "each once: {printed}");
    bench.succeeds("stop --outcome success");
    assert_eq!(content(&bench.trial("P07-joystick-01")), first);
    let trials = Study::open(&bench.study()).unwrap().trials().unwrap();
    let aborted = trials.iter().filter(|trial| trial.state.outcome == Some(Outcome::Aborted));
    assert_eq!((aborted.count() as u32, trials.len() as u32), (cases, cases + 2));
}

fn end_at_once(recorder: Pid) {
    kill(recorder, Signal::SIGKILL).unwrap();
}

#[test]
fn power_cuts_lose_at_most_a_second_of_one_trial() {
    let controller = Controller::enabled();
    power_cuts(3, &controller.domain, end_at_once, || {});
}

/// Recorder and controller, with drives.
#[test]
#[ignore = "minutes: .ci/nightly"]
fn power_cuts_of_fifty_trials_end_every_process() {
    let rig = RefCell::new(Rig::with_model());
    rig.borrow_mut().start_controller();
    let domain = rig.borrow().domain();
    drop(rig.borrow_mut().client());
    let cut = |recorder| {
        rig.borrow().signal(Signal::SIGKILL);
        end_at_once(recorder);
    };
    power_cuts(50, &domain, cut, || {
        let mut rig = rig.borrow_mut();
        rig.wait_for_end();
        rig.start_controller();
        drop(rig.client());
    });
}
