//! Data sets of trials, as LeRobot itself reads them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use i2ris::clock;
use i2ris::ipc::StreamMessage;
use i2ris::ipc::payload::{ActuatorState, ExternalPosition, JointState, TeleopMsg};
use i2ris::units::Nanos;
use i2ris_record::dataset::find_ffmpeg;
use i2ris_record::recorder::{RecordingHeader, TrialRecorder};
use i2ris_record::study::Study;
use i2ris_record::study::journal::{Journal, Outcome};
use i2ris_testing::{Controller, run_python_of};
use serde_json::Value;

const UNIX: u64 = 1_700_000_000_000_000_000;
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

/// Records so many seconds of a motion, with a hole from 1.0 to 1.5 s if asked for.
fn record(path: &Path, seconds: u64, has_pictures: bool, has_hole: bool) {
    let picture = has_pictures.then_some(&jpeg as &dyn Fn(u64) -> Vec<u8>);
    record_with(path, seconds, picture, has_hole);
}

/// The same with other pictures.
fn record_with(
    path: &Path,
    seconds: u64,
    picture: Option<&dyn Fn(u64) -> Vec<u8>>,
    has_hole: bool,
) {
    let header = RecordingHeader {
        about: BTreeMap::from([("robot_id".to_owned(), "R1".to_owned())]),
        unix_offset_ns: UNIX,
        joints: vec!["pitch".to_owned(), "yaw".to_owned()],
        picture_budget: 1 << 40,
        ..RecordingHeader::default()
    };
    let mut trial = TrialRecorder::start(path, header).unwrap();
    for ms in (0..=1000 * seconds).filter(|ms| !has_hole || !(1000..1500).contains(ms)) {
        let stamp = Nanos::from_millis(1000 + ms);
        let angle = ms as f64 * 1e-4;
        let joints = JointState {
            sequence: ms,
            stamp_ns: stamp.0,
            position: [angle, -angle, 0.0],
            deviation: [0.01, 0.02, 0.0],
            model_id: [0xAB; 32],
            count: 2,
            flags: JointState::VALID | JointState::MEMORY_KNOWN,
            ..JointState::default()
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
    for number in 0..picture.map_or(0, |_| seconds * FPS) {
        let late = LATE_MS * u64::from(number % 5 == 4);
        let stamp = Nanos::from_millis(1000 + number * 1000 / FPS + late);
        if let Some(picture) = picture {
            trial.record_picture("top", stamp, &picture(number), stamp);
        }
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
        record(&trial.join("recording.mcap"), 2, has_pictures, false);
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
    let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert!(output.status.success(), "{arguments:?}: {said}");
    said
}

#[track_caller]
fn refuses(arguments: &[&str], part: &str) {
    let output = export(arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && said.contains(part), "{arguments:?}: {said}");
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

const OUTCOMES: [Outcome; 4] =
    [Outcome::Failure, Outcome::Success, Outcome::Aborted, Outcome::Recovery];

/// Reads every row of a data set with LeRobot, and what it has in it.
const LOAD: &str = r#"
import sys, math
from importlib.metadata import version
from lerobot.datasets.lerobot_dataset import LeRobotDataset
root, has_pictures = sys.argv[1], sys.argv[2] != "none"
# Without pictures, the last instant has a row, too.
rows = 50 if has_pictures else 51
dataset = LeRobotDataset("i2ris/test", root=root, video_backend="pyav")
assert dataset.num_episodes == 3 and dataset.fps == 25, (dataset.num_episodes, dataset.fps)
assert dataset.num_frames == len(dataset) == 3 * rows, len(dataset)
meta = dataset.meta
assert meta.info["splits"] == {"train": "0:1", "recovery": "1:2", "failure": "2:3"}
assert meta.stats["observation.state"]["max"].shape == (7,)
late = 0
for index in range(len(dataset)):
    row = dataset[index]
    frame = index % rows
    assert int(row["episode_index"]) == index // rows and int(row["frame_index"]) == frame
    assert abs(float(row["timestamp"]) - frame / 25) < 1e-6
    # The state is that of the exposure, which jitter tells.
    jitter = float(row["observation.meta.jitter_s"])
    t = frame / 25 + jitter
    late += jitter > 0.003
    state = row["observation.state"]
    for value, expected in zip(state.tolist(), [0.1 * t, -0.1 * t, 0.01, 0.02, 1, 1000 * t, 7]):
        assert abs(value - expected) < 1e-3, (index, state, t)
    assert abs(float(row["action"][0]) - 0.1 * t) < 1e-5
    # The hand's view: pitch is up, yaw is right.
    right, up = row["action.tip_motion"].tolist()
    assert (right == up == 0) if frame == rows - 1 else (right > 0 and up > 0), (frame, right, up)
    assert abs(float(row["ground_truth.camera"][0]) - 0.1 * t - 0.5) < 1e-5
    assert row["observation.meta.model_id"] == "ab" * 32
    assert row["observation.meta.clutch"] == ("open" if t < 0.5 else "closed"), (t, row["observation.meta.clutch"])
    assert row["task"] == "reach (with)"
    if has_pictures:
        picture = row["observation.images.top"]
        assert tuple(picture.shape) == (3, 48, 64), picture.shape
        assert abs(255 * float(picture.mean()) - frame) < 3, (frame, 255 * float(picture.mean()))
assert late == (30 if has_pictures else 0), late
if has_pictures:
    assert meta.camera_keys == ["observation.images.top"]
    assert abs(float(meta.stats["observation.images.top"]["mean"].flatten()[0]) * 255 - 24.5) < 1.5
# Batches, as a training takes them.
import torch
dataset = LeRobotDataset("i2ris/test", root=root, video_backend="pyav", delta_timestamps={"action": [0, 0.04, 0.08]})
batch = next(iter(torch.utils.data.DataLoader(dataset, batch_size=8)))
assert tuple(batch["action"].shape) == (8, 3, 2), batch["action"].shape
one = LeRobotDataset("i2ris/test", root=root, video_backend="pyav", episodes=[1])
assert one.num_frames == rows, one.num_frames
print("lerobot", version("lerobot"), "read", len(dataset), "rows")
"#;

/// The Pythons with LeRobot of the version of each format.
const PYTHONS: [(&str, &str); 2] =
    [("lerobot-v2.1", "I2RIS_LEROBOT21_PYTHON"), ("lerobot-v3", "I2RIS_LEROBOT3_PYTHON")];

fn loads(kind: &str) {
    let folder = tempfile::tempdir().unwrap();
    let study = study(folder.path(), &OUTCOMES, kind != "none");
    for (format, python) in PYTHONS {
        let output = folder.path().join(format);
        let paths = [&study, &output].map(|path| path.to_str().unwrap());
        let call = [paths[0], "--output", paths[1], "--format", format, "--rate-hz", "25"];
        let images: &[&str] = if kind == "video" { &[] } else { &["--images"] };
        let said = exports(&[&call[..], images].concat());
        assert!(said.contains("P07-with-03: aborted") && said.contains("3 episodes"), "{said}");
        assert_eq!(output.join("videos").exists(), kind == "video", "{said}");
        run_python_of(python, "lerobot.datasets.lerobot_dataset", LOAD, &[paths[1], kind]);
    }
}

#[test]
fn lerobot_of_both_versions_reads_every_row_of_trials_with_pictures() {
    loads("pictures");
}

#[test]
fn lerobot_of_both_versions_reads_every_row_of_trials_without_pictures() {
    loads("none");
}

#[test]
fn lerobot_of_both_versions_reads_videos_where_there_is_an_ffmpeg() {
    if find_ffmpeg().is_none() {
        eprintln!("skipped: no ffmpeg on the search path");
        return;
    }
    loads("video");
}

#[test]
fn a_data_set_says_what_it_is_made_of_and_what_nobody_knows() {
    let folder = tempfile::tempdir().unwrap();
    let study = study(folder.path(), &OUTCOMES, true);
    let output = folder.path().join("set");
    let paths = [&study, &output].map(|path| path.to_str().unwrap());
    exports(&[paths[0], "--output", paths[1], "--format", "lerobot-v2.1", "--images"]);
    let info = json(&output.join("meta/info.json"));
    assert_eq!((info["fps"].as_u64(), info["total_frames"].as_u64()), (Some(25), Some(150)));
    let readme = fs::read_to_string(output.join("README.md")).unwrap();
    for part in ["| robot id | R1 |", "P07-with-01", "unknown: to be filled in", "4.00 |", "jitter"]
    {
        assert!(readme.contains(part), "{part}: {readme}");
    }
    let made_of = json(&output.join("i2ris-export.json"));
    assert_eq!(made_of["episodes"][2]["outcome"], "failure");
}

#[test]
fn an_export_is_whole_or_not_there_and_never_over_another() {
    let folder = tempfile::tempdir().unwrap();
    let study = study(folder.path(), &[Outcome::Success, Outcome::Success], false);
    let output = folder.path().join("set");
    let paths = [&study, &output].map(|path| path.to_str().unwrap());
    let call = [paths[0], "--output", paths[1], "--format", "lerobot-v3"];
    let overwriting = [&call[..], &["--overwrite"]].concat();
    exports(&call);
    let before = fs::read(output.join("meta/info.json")).unwrap();
    refuses(&call, "exists; name another folder, or add --overwrite");
    exports(&overwriting);
    // The second trial cannot be read: nothing is left of the first, and the old set stays.
    let second = study.join("P07-with-02/recording.mcap");
    fs::write(&second, b"no recording").unwrap();
    refuses(&overwriting, "is no recording");
    assert_eq!(fs::read(output.join("meta/info.json")).unwrap(), before);
    let fresh = folder.path().join("fresh");
    refuses(&[paths[0], "--output", fresh.to_str().unwrap(), "--format", "csv"], "is no recording");
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|it| it.unwrap().path()).collect();
    assert_eq!(left.len(), 2, "the study and the set: {left:?}");
    // What is somebody else's is never replaced.
    fs::create_dir(&fresh).unwrap();
    fs::write(fresh.join("thesis.tex"), b"years").unwrap();
    let foreign = [paths[0], "--output", fresh.to_str().unwrap(), "--overwrite"];
    refuses(&foreign, "is no export of i2ris");
    assert!(fresh.join("thesis.tex").exists());
    let file = fresh.join("thesis.tex");
    let file = [paths[0], "--output", file.to_str().unwrap(), "--overwrite"];
    refuses(&file, "is no export of i2ris");
}

#[test]
fn recordings_with_gaps_other_clocks_other_pictures_or_nothing_are_parted_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let [hole, pictures, jumped] = ["hole.mcap", "pictures.mcap", "jumped.mcap"].map(path);
    record(Path::new(&hole), 3, false, true);
    record(Path::new(&pictures), 2, true, false);
    // A clock that jumps: the controller's stamps begin anew.
    let mut trial = TrialRecorder::start(Path::new(&jumped), RecordingHeader::default()).unwrap();
    for stamp in [9000, 9001, 1000, 1001] {
        let stamp = Nanos::from_millis(stamp);
        let state = JointState { stamp_ns: stamp.0, count: 2, flags: 1, ..JointState::default() };
        trial.record(&StreamMessage::Measured(state), stamp);
    }
    trial.finish(BTreeMap::new(), &[]).unwrap();
    let set = path("set");
    let format = ["--output", &*set, "--format", "lerobot-v3", "--images", "--overwrite"];
    assert!(exports(&[&[&*hole], &format[..]].concat()).contains("2 episodes"), "it is parted");
    let mixed = [&[&*hole, &*pictures], &format[..]].concat();
    refuses(&mixed, "pictures has pictures of top of 64x48 at 25 Hz, hole has no pictures");
    exports(&[&mixed[..], &["--without-pictures"]].concat());
    let jumped = [&[&*jumped], &format[..]].concat();
    refuses(&jumped, "stamps of measured_js go back by 8.0 s: the clock jumped");
    let empty = path("empty.mcap");
    let trial = TrialRecorder::start(Path::new(&empty), RecordingHeader::default()).unwrap();
    trial.finish(BTreeMap::new(), &[]).unwrap();
    refuses(
        &[&empty, "--output", &path("new"), "--format", "lerobot-v3"],
        "anything to learn from",
    );
    assert!(!Path::new(&path("new")).exists());
}

#[test]
fn tables_of_many_trials_have_a_folder_each_and_pandas_reads_them() {
    let folder = tempfile::tempdir().unwrap();
    let study = study(folder.path(), &[Outcome::Success, Outcome::Failure], false);
    let output = folder.path().join("tables");
    let paths = [&study, &output].map(|path| path.to_str().unwrap());
    let said = exports(&[paths[0], "--output", paths[1], "--format", "parquet"]);
    assert!(said.contains("P07-with-02/measured_js.parquet"), "{said}");
    let script = "import sys, pandas\n\
        table = pandas.read_parquet(sys.argv[1] + '/P07-with-01/measured_js.parquet')\n\
        assert len(table) == 1001 and table['pitch_deg'].max() > 11, table.describe()";
    run_python_of("I2RIS_LEROBOT3_PYTHON", "pandas, pyarrow", script, &[paths[1]]);
}

/// The plugins as LeRobot makes them, against a controller that follows at once.
#[test]
fn the_plugins_of_lerobot_watch_and_command_a_controller() {
    let controller = Controller::enabled();
    let script = r#"
import sys, time
sys.path[:0] = ["plugins/lerobot_robot_i2ris", "plugins/lerobot_teleoperator_i2ris"]
from lerobot.robots.utils import make_robot_from_config
from lerobot.teleoperators.utils import make_teleoperator_from_config
from lerobot_robot_i2ris import I2risConfig
from lerobot_teleoperator_i2ris import I2risTeleopConfig
robot = make_robot_from_config(I2risConfig(domain=sys.argv[1]))
hand = make_teleoperator_from_config(I2risTeleopConfig(domain=sys.argv[1]))
robot.connect(); hand.connect()
assert set(robot.get_observation()) == set(robot.observation_features)
begin = robot.get_observation()["pitch.pos"]
for step in range(30):
    robot.send_action({"pitch.pos": begin + 0.001 * step, "yaw.pos": robot.get_observation()["yaw.pos"]})
    time.sleep(0.01)
assert robot.get_observation()["pitch.pos"] > begin + 0.02, robot.get_observation()
assert abs(hand.get_action()["pitch.pos"] - begin) < 0.05 and set(hand.get_action()) == set(robot.action_features)
robot.disconnect(); hand.disconnect()
"#;
    let modules = "lerobot.robots, iceoryx2";
    run_python_of("I2RIS_LEROBOT3_PYTHON", modules, script, &[controller.domain.name()]);
}

/// An hour of states at 1 kHz with 25 pictures a second of a camera's size. Prints how long each
/// format takes; the aim is two minutes.
#[test]
#[ignore = "minutes, and gigabytes: .ci/nightly"]
fn an_hour_is_exported_in_every_format() {
    let seconds = std::env::var("I2RIS_EXPORT_S").map_or(3600, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hour.mcap");
    // Noise, which does not compress: about 100 kB each.
    let pictures: Vec<Vec<u8>> = (0..20_u32)
        .map(|seed| {
            let next = |state: &mut u32| {
                *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                100 + (*state >> 28) as u8
            };
            let mut state = seed;
            let pixels: Vec<u8> = (0..640 * 480).map(|_| next(&mut state)).collect();
            let mut jpeg = Vec::new();
            let encoder = jpeg_encoder::Encoder::new(&mut jpeg, 90);
            encoder.encode(&pixels, 640, 480, jpeg_encoder::ColorType::Luma).unwrap();
            jpeg
        })
        .collect();
    record_with(&file, seconds, Some(&|number| pictures[number as usize % 20].clone()), false);
    let size = fs::metadata(&file).unwrap().len();
    println!("{seconds} s, {} MB, pictures of {} kB", size / 1_000_000, pictures[0].len() / 1000);
    for format in ["lerobot-v3", "lerobot-v2.1", "parquet", "csv"] {
        let begun = clock::now();
        let output = folder.path().join(format);
        let output = output.to_str().unwrap();
        exports(&[file.to_str().unwrap(), "--output", output, "--format", format]);
        println!("{format}: {:.0} s", clock::now().since(begun).as_seconds());
        fs::remove_dir_all(output).unwrap();
    }
}
