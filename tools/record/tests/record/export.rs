//! Exports: tables of recordings, and data sets that LeRobot makes of them.

use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use i2ris::clock;
use i2ris::ipc::StreamMessage;
use i2ris::ipc::payload::{ActuatorState, ExternalPosition, JointState, TeleopMsg};
use i2ris::units::Nanos;
use i2ris_needs::needs;
use i2ris_record::messages::standard::snake;
use i2ris_record::recorder::{RecordingHeader, TrialRecorder};
use i2ris_record::trial::Study;
use i2ris_record::trial::journal::{Journal, Outcome};
use i2ris_report::snake::Bend;
use i2ris_testing::{Controller, run_python, run_python_of};

use crate::{header, joints};

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
        let motors = ActuatorState {
            sequence: ms,
            stamp_ns: stamp.0,
            measured_counts: [ms as i32, 7],
            ..ActuatorState::default()
        };
        trial.record(&StreamMessage::Actuators(motors), stamp);
        if ms % 50 == 0 {
            let hand = TeleopMsg {
                stamp_ns: stamp.0,
                view: [[0.0, 1.0], [1.0, 0.0]],
                flags: u32::from(ms < 500),
                ..TeleopMsg::default()
            };
            trial.record(&StreamMessage::Teleop(hand), stamp);
            let camera = ExternalPosition {
                stamp_ns: stamp.0,
                position: [angle + 0.5, 0.0, 0.0],
                count: 2,
                flags: ExternalPosition::VALID,
                ..ExternalPosition::default()
            };
            trial.record(&StreamMessage::External(camera), stamp);
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

/// A study with these outcomes, each a trial of two seconds.
fn study(folder: &Path, outcomes: &[Outcome], has_pictures: bool) -> PathBuf {
    let study = folder.join("study");
    Study::create(&study, vec!["with".parse().unwrap()], "i2ris test").unwrap();
    let study = Study::open(&study).unwrap();
    for outcome in outcomes {
        let (participant, condition) = ("P07".parse().unwrap(), "with".parse().unwrap());
        let (_, trial) = study.new_trial(&participant, &condition).unwrap();
        let mut journal = Journal::open(&trial).unwrap();
        journal.start(&participant, &condition, "reach", "").unwrap();
        journal.stop(*outcome, "").unwrap();
        record(&trial.join("recording.mcap"), 2, has_pictures, 0..0);
    }
    folder.join("study")
}

fn export(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_i2ris-record"));
    command.arg("export").args(arguments).output().unwrap()
}

#[track_caller]
fn exports(arguments: &[&str]) -> String {
    let output = export(arguments);
    let printed = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert!(output.status.success(), "{arguments:?}: {printed}");
    printed
}

#[track_caller]
fn refuses(arguments: &[&str], part: &str) {
    let output = export(arguments);
    let printed = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && printed.contains(part), "{arguments:?}: {printed}");
}

const OUTCOMES: [Outcome; 4] =
    [Outcome::Failure, Outcome::Success, Outcome::Aborted, Outcome::Recovery];

/// Rows as `i2ris.lerobot` makes them of an export, without LeRobot.
const ROWS: &str = include_str!("python/rows.py");
/// Reads a data set with LeRobot and checks its content.
const LOAD: &str = include_str!("python/load.py");

const BUILD: &str = "import sys\nfrom i2ris.lerobot import main\nsys.exit(main(sys.argv[1:]))";

/// Tables become rows in any Python, or a data set that a LeRobot reads.
fn becomes_a_data_set(kind: &str, lerobot: Option<&str>) {
    let folder = tempfile::tempdir().unwrap();
    let study = study(folder.path(), &OUTCOMES, kind == "pictures");
    let tables = folder.path().join("tables");
    let [study, tables] = [&study, &tables].map(|path| path.to_str().unwrap());
    let printed = exports(&[study, "--output", tables, "--pictures"]);
    assert!(printed.contains("P07-with-03: aborted"), "{printed}");
    let Some(python) = lerobot else { return run_python(ROWS, &[tables, kind]) };
    let set = folder.path().join("set");
    let set = set.to_str().unwrap();
    run_python_of(python, BUILD, &[tables, "--output", set, "--rate-hz", "25", "--images"]);
    run_python_of(python, LOAD, &[set, kind]);
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
        let arguments = arguments.each_ref().map(String::as_str);
        run_python(script, &arguments);
    }
}

#[needs("python: csv")]
#[test]
fn missing_lerobot_is_reported_and_leaves_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let study = study(folder.path(), &[Outcome::Success], false);
    let [tables, set] = ["tables", "set"].map(|name| folder.path().join(name));
    let [study, tables, set] = [&study, &tables, &set].map(|path| path.to_str().unwrap());
    exports(&[study, "--output", tables]);
    let script = "import contextlib, io, os, sys\n\
        sys.modules['lerobot'] = None\n\
        from i2ris.lerobot import main\n\
        printed = io.StringIO()\n\
        with contextlib.redirect_stderr(printed):\n    \
            assert main([sys.argv[1], '--output', sys.argv[2]]) == 1\n\
        assert 'pip install lerobot' in printed.getvalue(), printed.getvalue()\n\
        assert printed.getvalue().count('\\n') == 1 and not os.path.exists(sys.argv[2])";
    run_python(script, &[tables, set]);
}

#[needs("python: csv")]
#[test]
fn a_study_becomes_rows_with_and_without_pictures() {
    for kind in ["pictures", "none"] {
        becomes_a_data_set(kind, None);
    }
}

/// LeRobot 0.3 writes v2.1.
#[needs("I2RIS_LEROBOT21_PYTHON: lerobot.datasets.lerobot_dataset")]
#[test]
fn a_study_becomes_a_data_set_of_lerobot_2_1() {
    for kind in ["pictures", "none"] {
        becomes_a_data_set(kind, Some("I2RIS_LEROBOT21_PYTHON"));
    }
}

/// LeRobot 0.4 and newer.
#[needs("I2RIS_LEROBOT3_PYTHON: lerobot.datasets.lerobot_dataset")]
#[test]
fn a_study_becomes_a_data_set_of_lerobot_3() {
    for kind in ["pictures", "none"] {
        becomes_a_data_set(kind, Some("I2RIS_LEROBOT3_PYTHON"));
    }
}

#[test]
fn export_is_complete_or_absent_and_replaces_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let study = study(folder.path(), &[Outcome::Success, Outcome::Success], false);
    let output = folder.path().join("set");
    let paths = [&study, &output].map(|path| path.to_str().unwrap());
    let call = [paths[0], "--output", paths[1]];
    let overwriting = [&call[..], &["--overwrite"]].concat();
    exports(&call);
    let before = fs::read(output.join("i2ris-export.json")).unwrap();
    refuses(&call, "exists; name another folder, or add --overwrite");
    exports(&overwriting);
    // The second trial cannot be read: nothing is left of the first, and the old set stays.
    let second = study.join("P07-with-02/recording.mcap");
    fs::write(&second, b"no recording").unwrap();
    refuses(&overwriting, "is not a recording");
    assert_eq!(fs::read(output.join("i2ris-export.json")).unwrap(), before);
    let fresh = folder.path().join("fresh");
    refuses(&[paths[0], "--output", fresh.to_str().unwrap()], "is not a recording");
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|it| it.unwrap().path()).collect();
    assert_eq!(left.len(), 2, "the study and the set: {left:?}");
    // Foreign files are never replaced.
    fs::create_dir(&fresh).unwrap();
    fs::write(fresh.join("thesis.tex"), b"years").unwrap();
    let foreign = [paths[0], "--output", fresh.to_str().unwrap(), "--overwrite"];
    refuses(&foreign, "not an export of i2ris");
    assert!(fresh.join("thesis.tex").exists());
    let file = fresh.join("thesis.tex");
    let file = [paths[0], "--output", file.to_str().unwrap(), "--overwrite"];
    refuses(&file, "not an export of i2ris");
}

/// Messages of `python -m i2ris.lerobot` for an export that is not a data set.
const REFUSED: &str = include_str!("python/refused.py");

#[needs("python: csv")]
#[test]
fn inconsistent_recordings_are_split_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let [hole, pictures, jumped, empty] =
        ["hole.mcap", "pictures.mcap", "jumped.mcap", "empty.mcap"].map(path);
    record(Path::new(&hole), 3, false, 1000..1500);
    record(Path::new(&pictures), 2, true, 0..0);
    // A clock that jumps: the controller's stamps restart.
    let mut trial = TrialRecorder::start(Path::new(&jumped), RecordingHeader::default()).unwrap();
    for stamp in [9000, 9001, 1000, 1001] {
        let stamp = Nanos::from_millis(stamp);
        trial.record(&StreamMessage::Measured(joints(0, stamp, [0.0; 3])), stamp);
    }
    trial.finish(BTreeMap::new(), &[]).unwrap();
    let trial = TrialRecorder::start(Path::new(&empty), RecordingHeader::default()).unwrap();
    trial.finish(BTreeMap::new(), &[]).unwrap();
    let tables = path("tables");
    for (recordings, words, pictures) in [
        (&[&*hole][..], "2 episodes", "with"),
        (&[&hole, &pictures], "pictures of top at 25 Hz, others have no pictures", "with"),
        (&[&hole, &pictures], "3 episodes", "without"),
        (&[&jumped], "stamps of measured_js go back by 8.0 s: the clock jumped", "with"),
        (&[&empty], "no recording has estimate, goal and counts", "with"),
    ] {
        exports(&[recordings, &["--output", &tables, "--overwrite", "--pictures"]].concat());
        run_python(REFUSED, &[&tables, words, pictures]);
    }
}

#[needs("I2RIS_LEROBOT3_PYTHON: pandas")]
#[test]
fn tables_of_trials_have_folders_and_pandas_reads_them() {
    let folder = tempfile::tempdir().unwrap();
    let study = study(folder.path(), &[Outcome::Success, Outcome::Failure], false);
    let output = folder.path().join("tables");
    let paths = [&study, &output].map(|path| path.to_str().unwrap());
    let printed = exports(&[paths[0], "--output", paths[1]]);
    assert!(printed.contains("P07-with-02/measured_js.csv"), "{printed}");
    let script = "import sys, pandas\n\
        table = pandas.read_csv(sys.argv[1] + '/P07-with-01/measured_js.csv')\n\
        assert len(table) == 1001 and table['pitch_deg'].max() > 11, table.describe()";
    run_python_of("I2RIS_LEROBOT3_PYTHON", script, &[paths[1]]);
}

/// The plugins as LeRobot makes them, against a controller that follows at once.
#[needs("I2RIS_LEROBOT3_PYTHON: lerobot.robots, iceoryx2")]
#[test]
fn the_plugins_of_lerobot_watch_and_command_a_controller() {
    let controller = Controller::enabled();
    let script = include_str!("python/plugins.py");
    run_python_of("I2RIS_LEROBOT3_PYTHON", script, &[controller.domain.name()]);
}
