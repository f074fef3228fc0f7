//! Exports: tables of recordings, and data sets that LeRobot makes of them.

use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::Path;

use i2ris::clock;
use i2ris::ipc::StreamMessage;
use i2ris::ipc::payload::{JointState, TeleopMsg};
use i2ris::units::Nanos;
use i2ris_needs::needs;
use i2ris_record::messages::snake;
use i2ris_record::recorder::{RecordingHeader, TrialRecorder};
use i2ris_record::trial::Study;
use i2ris_record::trial::journal::{Journal, Outcome};
use i2ris_report::snake::Bend;
use i2ris_testing::bench::WorkFolder;
use i2ris_testing::{Controller, run_python, run_python_of};

use crate::{camera, header, joints, motors};

/// Pictures per second, and how late the last one of five is.
const FPS: u64 = 25;
const LATE_MS: u64 = 4;
/// Now and then: a recording that is made faster than it is written drops what has no room.
const WRITES: Nanos = Nanos::from_millis(2);

/// A grey picture of 64 by 48 points, as bright as its number.
fn jpeg(number: u64) -> Vec<u8> {
    let mut file = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut file, 90);
    let pixels = [(number % 200) as u8; 3].repeat(64 * 48);
    encoder.encode(&pixels, 64, 48, jpeg_encoder::ColorType::Rgb).unwrap();
    file
}

/// Records this many seconds of a motion, with a hole of these milliseconds.
fn record(path: &Path, seconds: u64, has_pictures: bool, hole: Range<u64>) {
    let header = RecordingHeader {
        about: BTreeMap::from([("robot_id".to_owned(), "R1".to_owned())]),
        picture_budget: 1 << 40,
        ..header()
    };
    let mut trial = TrialRecorder::start(path, header).unwrap();
    for ms in (0..=1000 * seconds).filter(|ms| !hole.contains(ms)) {
        let stamp = Nanos::from_millis(1000 + ms);
        let angle = ms as f64 * 1e-4;
        let joints = JointState {
            deviation: [0.01, 0.02, 0.0],
            model_id: [0xAB; 32],
            flags: JointState::VALID | JointState::MEMORY_KNOWN,
            ..joints(ms, stamp, [angle, -angle, 0.0])
        };
        if ms % 50 == 0 {
            clock::sleep(WRITES);
        }
        trial.record(&StreamMessage::Measured(joints), stamp);
        trial.record(&StreamMessage::Goal(JointState { position: [angle; 3], ..joints }), stamp);
        trial.record(&motors(ms, stamp, [ms as i32, 7]), stamp);
        if ms % 50 == 0 {
            let hand = TeleopMsg {
                stamp_ns: stamp.0,
                view: [[0.0, 1.0], [1.0, 0.0]],
                flags: u32::from(ms < 500),
                ..TeleopMsg::default()
            };
            trial.record(&StreamMessage::Teleop(hand), stamp);
            trial.record(&camera(stamp, [angle + 0.5, 0.0]), stamp);
        }
    }
    for number in 0..if has_pictures { seconds * FPS } else { 0 } {
        let late = LATE_MS * u64::from(number % 5 == 4);
        let stamp = Nanos::from_millis(1000 + number * 1000 / FPS + late);
        trial.record_picture("top", stamp, &jpeg(number), stamp);
        clock::sleep(WRITES);
    }
    let counts = trial.finish(BTreeMap::new(), &[]).unwrap();
    let dropped = counts.pictures.values().map(|it| it.dropped).sum::<u64>() + counts.dropped;
    assert_eq!(dropped, 0, "faster than it is written");
}

/// A study with these outcomes, each a trial of two seconds, in a folder.
fn study(outcomes: &[Outcome], has_pictures: bool) -> WorkFolder {
    let bench = WorkFolder::empty();
    let conditions = vec!["with".parse().unwrap()];
    let study = Study::create(&bench.path("study"), conditions, "i2ris test").unwrap();
    for outcome in outcomes {
        let (participant, condition) = ("P07".parse().unwrap(), "with".parse().unwrap());
        let trial = study.new_trial(&participant, &condition).unwrap();
        let mut journal = Journal::open(&trial).unwrap();
        journal.start(&participant, &condition, "reach", "").unwrap();
        journal.stop(*outcome, "").unwrap();
        record(&trial.join("recording.mcap"), 2, has_pictures, 0..0);
    }
    bench
}

#[track_caller]
fn exports(bench: &WorkFolder, words: &str) -> String {
    let result = bench.run(&format!("record export {words}"));
    assert_eq!(result.code, Some(0), "{words}: {}{}", result.output, result.error);
    result.output + &result.error
}

#[track_caller]
fn refuses(bench: &WorkFolder, words: &str, part: &str) {
    let result = bench.run(&format!("record export {words}"));
    assert!(result.code != Some(0) && result.error.contains(part), "{words}: {}", result.error);
}

const OUTCOMES: [Outcome; 4] =
    [Outcome::Failure, Outcome::Success, Outcome::Aborted, Outcome::Recovery];

/// Tables with and without pictures become rows in any Python, or a data set that a LeRobot reads.
fn becomes_a_data_set(lerobot: Option<&str>) {
    let build = "import sys\nfrom i2ris.lerobot import main\nsys.exit(main(sys.argv[1:]))";
    for kind in ["pictures", "none"] {
        let bench = study(&OUTCOMES, kind == "pictures");
        let printed = exports(&bench, "study --output tables --pictures");
        assert!(printed.contains("P07-with-03: aborted"), "{printed}");
        let [tables, set] = [&*bench.file("tables"), &*bench.file("set")];
        match lerobot {
            None => run_python(include_str!("python/rows.py"), &[tables, kind]),
            Some(python) => {
                let words = [tables, "--output", set, "--rate-hz", "25", "--images"];
                run_python_of(python, build, &words);
                run_python_of(python, include_str!("python/load.py"), &[set, kind]);
            }
        }
    }
}

#[needs("python: csv")]
#[test]
fn data_set_has_the_tip_of_the_snake() {
    let script = "import sys\n\
        from i2ris.lerobot import tip_m\n\
        pitch, yaw, *known = map(float, sys.argv[1:])\n\
        assert all(abs(a - b) < 1e-12 for a, b in zip(tip_m(pitch, yaw), known)), known";
    for (pitch, yaw) in [(0.0, 0.0), (0.3, 0.0), (-0.7, 0.5)] {
        let [x, y, _] = snake().tip_pose(Bend { pitch, yaw }).position_m;
        let arguments = [pitch, yaw, x, y].map(|number| format!("{number:e}"));
        run_python(script, &arguments.each_ref().map(String::as_str));
    }
}

#[needs("python: csv")]
#[test]
fn missing_lerobot_is_reported_and_leaves_no_files() {
    let bench = study(&[Outcome::Success], false);
    exports(&bench, "study --output tables");
    let script = "import contextlib, io, os, sys\n\
        sys.modules['lerobot'] = None\n\
        from i2ris.lerobot import main\n\
        printed = io.StringIO()\n\
        with contextlib.redirect_stderr(printed):\n    \
            assert main([sys.argv[1], '--output', sys.argv[2]]) == 1\n\
        assert 'pip install lerobot' in printed.getvalue(), printed.getvalue()\n\
        assert printed.getvalue().count('\\n') == 1 and not os.path.exists(sys.argv[2])";
    run_python(script, &[&bench.file("tables"), &bench.file("set")]);
}

#[needs("python: csv")]
#[test]
fn a_study_becomes_rows_with_and_without_pictures() {
    becomes_a_data_set(None);
}

/// LeRobot 0.3 writes v2.1.
#[needs("I2RIS_LEROBOT21_PYTHON: lerobot.datasets.lerobot_dataset")]
#[test]
fn a_study_becomes_a_data_set_of_lerobot_2_1() {
    becomes_a_data_set(Some("I2RIS_LEROBOT21_PYTHON"));
}

/// LeRobot 0.4 and newer.
#[needs("I2RIS_LEROBOT3_PYTHON: lerobot.datasets.lerobot_dataset")]
#[test]
fn a_study_becomes_a_data_set_of_lerobot_3() {
    becomes_a_data_set(Some("I2RIS_LEROBOT3_PYTHON"));
}

#[test]
fn export_is_complete_or_absent_and_replaces_nothing_else() {
    let bench = study(&[Outcome::Success, Outcome::Success], false);
    let (call, overwriting) = ("study --output set", "study --output set/ --overwrite");
    exports(&bench, call);
    let before = bench.read("set/i2ris-export.json");
    refuses(&bench, call, "exists; name another folder, or add --overwrite");
    // Left over from a killed export; and the copy of a person.
    for folder in ["set.i2ris-old", "set.old"] {
        fs::create_dir(bench.path(folder)).unwrap();
        bench.write(&format!("{folder}/goal_js.csv"), "");
    }
    exports(&bench, overwriting);
    // The second trial cannot be read: nothing is left of the first, and the old set stays.
    bench.write("study/P07-with-02/recording.mcap", "no recording");
    refuses(&bench, overwriting, "is not a recording");
    assert_eq!(bench.read("set/i2ris-export.json"), before);
    refuses(&bench, "study --output fresh", "is not a recording");
    let left: Vec<_> = fs::read_dir(bench.path("")).unwrap().map(|it| it.unwrap().path()).collect();
    assert_eq!(left.len(), 3, "the study, the set and the copy: {left:?}");
    // Foreign files are never replaced.
    fs::create_dir(bench.path("fresh")).unwrap();
    bench.write("fresh/thesis.tex", "years");
    for foreign in ["fresh", "fresh/thesis.tex"] {
        let words = format!("study --output {foreign} --overwrite");
        refuses(&bench, &words, "not an export of i2ris");
        assert!(bench.exists("fresh/thesis.tex"));
    }
}

#[needs("python: csv")]
#[test]
fn inconsistent_recordings_are_split_or_refused() {
    let bench = WorkFolder::empty();
    record(&bench.path("hole.mcap"), 3, false, 1000..1500);
    record(&bench.path("pictures.mcap"), 2, true, 0..0);
    // A clock that jumps: the controller's stamps restart.
    for (name, stamps) in [("jumped.mcap", &[9000, 9001, 1000, 1001][..]), ("empty.mcap", &[])] {
        let header = RecordingHeader::default();
        let mut trial = TrialRecorder::start(&bench.path(name), header).unwrap();
        for stamp in stamps.iter().copied().map(Nanos::from_millis) {
            trial.record(&StreamMessage::Measured(joints(0, stamp, [0.0; 3])), stamp);
        }
        trial.finish(BTreeMap::new(), &[]).unwrap();
    }
    let mixed = "pictures of top at 25 Hz, others have no pictures";
    for (recordings, words, pictures) in [
        ("hole.mcap", "2 episodes", "with"),
        ("hole.mcap pictures.mcap", mixed, "with"),
        ("hole.mcap pictures.mcap", "3 episodes", "without"),
        ("jumped.mcap", "stamps of measured_js go back by 8.0 s: the clock jumped", "with"),
        ("empty.mcap", "no recording has estimate, goal and counts", "with"),
    ] {
        exports(&bench, &format!("{recordings} --output tables --overwrite --pictures"));
        let script = include_str!("python/refused.py");
        run_python(script, &[&bench.file("tables"), words, pictures]);
    }
}

#[needs("I2RIS_LEROBOT3_PYTHON: pandas")]
#[test]
fn tables_of_trials_have_folders_and_pandas_reads_them() {
    let bench = study(&[Outcome::Success, Outcome::Failure], false);
    let printed = exports(&bench, "study --output tables");
    assert!(printed.contains("P07-with-02/measured_js.csv"), "{printed}");
    let script = "import sys, pandas\n\
        table = pandas.read_csv(sys.argv[1] + '/P07-with-01/measured_js.csv')\n\
        assert len(table) == 1001 and table['pitch_deg'].max() > 11, table.describe()";
    run_python_of("I2RIS_LEROBOT3_PYTHON", script, &[&bench.file("tables")]);
}

/// The plugins as LeRobot makes them, against a controller that follows at once.
#[needs("I2RIS_LEROBOT3_PYTHON: lerobot.robots, iceoryx2")]
#[test]
fn the_plugins_of_lerobot_watch_and_command_a_controller() {
    let controller = Controller::enabled();
    let script = include_str!("python/plugins.py");
    run_python_of("I2RIS_LEROBOT3_PYTHON", script, &[controller.domain.name()]);
}
