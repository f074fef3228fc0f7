//! `i2ris vision` as a process: frames in, angles out, one sentence for each error.

use std::fs;
use std::io::Write;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::units::Nanos;
use i2ris_needs::needs;
use i2ris_testing::bench::{WorkFolder, assert_says};
use i2ris_testing::{program, python, serve, unique_domain, wait_until};
use i2ris_vision::drawing::save_grey;
use i2ris_vision::scene::JointPose;
use i2ris_vision::scene_setup::setup;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::rig;

const REST: u64 = 6;

/// `i2ris vision` in a folder, with a pipe to its input.
fn vision(bench: &WorkFolder, words: &str) -> Command {
    let words = format!("vision {words}");
    let mut command = program::command(&words.split(' ').collect::<Vec<_>>());
    command.current_dir(bench.path("")).stdin(Stdio::piped());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Ends with a code other than 0 and one sentence that holds `words`.
fn assert_refused(is_success: bool, message: &str, words: &[&str]) {
    assert!(!is_success, "{message}");
    assert!(message.contains("error: ") && !message.contains("panicked"), "{message}");
    assert_says(message, words);
}

/// A folder with numbered frames of both views: rest, then these poses in degrees. And the setup.
fn film(poses: &[[f64; 2]]) -> WorkFolder {
    let (bench, rig) = (WorkFolder::empty(), rig());
    (0..2).for_each(|view| fs::create_dir_all(bench.path(&format!("view{view}"))).unwrap());
    let all = (0..REST).map(|_| [0.0; 2]).chain(poses.iter().copied());
    for (number, [pitch, yaw]) in all.enumerate() {
        let pose = JointPose { pitch_rad: pitch.to_radians(), yaw_rad: yaw.to_radians() };
        for (view, image) in rig.render_views(pose, number as u64).iter().enumerate() {
            save_grey(&bench.path(&format!("view{view}/image_{number:04}.png")), image).unwrap();
        }
    }
    setup(&rig).save(&bench.path("vision.toml")).unwrap();
    bench
}

fn rows(csv: &str) -> Vec<Vec<String>> {
    csv.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

fn number(cell: &str) -> f64 {
    cell.parse().unwrap()
}

#[track_caller]
fn assert_near(row: &[String], expected: [f64; 2], within: f64) {
    let off = [number(&row[1]) - expected[0], number(&row[2]) - expected[1]];
    assert!(off.iter().all(|off| off.abs() < within), "{row:?}");
}

#[test]
fn two_folders_become_angles_and_bad_files_gaps() {
    let bench = film(&[[10.0, -20.0], [-30.0, 5.0], [25.0, 25.0], [1.0, 2.0]]);
    fs::remove_file(bench.path("view0/image_0007.png")).unwrap();
    let whole = fs::read(bench.path("view1/image_0008.png")).unwrap();
    fs::write(bench.path("view1/image_0008.png"), &whole[..whole.len() / 2]).unwrap();
    let options = "--rest-s 0.2 --overlays overlays";
    let result = bench.run(&format!("vision --config vision.toml view0 view1 {options}"));
    assert_eq!(result.code, Some(0), "{}", result.error);
    let rows = rows(&result.output);
    assert_eq!(rows.len(), 10);
    assert_near(&rows[6], [10.0, -20.0], 0.1);
    assert_near(&rows[9], [1.0, 2.0], 0.1);
    for (row, cause) in [(7, "view0: file missing"), (8, "view1: not a whole frame")] {
        let row = &rows[row];
        assert!(row[1..9].iter().all(String::is_empty) && row[9].contains(cause), "{row:?}");
    }
    assert_says(&result.error, &["8 of 10 rows have angles", "spread"]);

    // A person looks at what there was to measure.
    assert_eq!(fs::read_dir(bench.path("overlays")).unwrap().count(), 18);
}

/// A stream of the first view alone, and a folder with its setup.
fn stream(poses: usize) -> (WorkFolder, Vec<u8>) {
    let (bench, mut one) = (WorkFolder::empty(), setup(&rig()));
    one.views.truncate(1);
    one.save(&bench.path("one.toml")).unwrap();
    (bench, frames(0, poses))
}

fn frames(view: usize, poses: usize) -> Vec<u8> {
    let mut bytes = b"YUV4MPEG2 W640 H480 F30:1 Cmono\n".to_vec();
    for number in 0..poses as u64 {
        let angle = if number < REST { 0.0 } else { 0.2 };
        bytes.extend(b"FRAME\n");
        let pose = JointPose { pitch_rad: angle, yaw_rad: 0.0 };
        bytes.extend(rig().render_views(pose, number)[view].data());
    }
    bytes
}

#[test]
fn truncated_stream_keeps_its_frames_and_reports_its_end() {
    let (bench, mut bytes) = stream(9);
    bytes.truncate(bytes.len() - 1000);
    let words = "--config one.toml - --fps 30 --rest-s 0.15";
    let mut child = vision(&bench, words).spawn().unwrap();
    let mut to = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || {
        let _ = to.write_all(&bytes);
    });
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    let words = "frame stream: ends within frame 9, after 306200 of 307200 bytes; is the size \
                 640x480 right?";
    assert_refused(output.status.success(), &text(&output.stderr), &[words]);
    let rows = rows(&text(&output.stdout));
    assert_eq!(rows.len(), 8);
    assert!((number(&rows[7][1]) - f64::to_degrees(0.2)).abs() < 0.1);
}

/// Six frames of [`send_frames`] are at rest, however late they come.
const LIVE: &str = "--config one.toml - --rest-s 0.0055";

/// Sends the frames of `bytes` repeatedly, each stamped a millisecond after the previous one.
fn send_frames(
    to: &mut impl Write,
    bytes: &[u8],
    begin: Nanos,
    times: usize,
) -> std::io::Result<()> {
    let header = b"YUV4MPEG2 W640 H480 F30:1 Cmono\n".len();
    to.write_all(&bytes[..header])?;
    let frames = bytes[header..].chunks(6 + 640 * 480);
    let frames = std::iter::repeat_n(frames, times).flatten();
    for (number, frame) in frames.enumerate() {
        let Nanos(stamp) = begin + Nanos::from_millis(number as u64);
        writeln!(to, "FRAME XT={}.{:09}", stamp / 1_000_000_000, stamp % 1_000_000_000)?;
        to.write_all(&frame[6..])?;
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok(())
}

#[test]
fn angles_reach_the_controller_with_stamp_deviation_and_quality() {
    let (bench, mut bytes) = stream(30);
    // The last frame is empty: the controller learns that nothing was seen.
    let length = bytes.len();
    bytes[length - 640 * 480..].fill(100);
    let domain = unique_domain();
    let mut server = serve(&domain);
    let before = clock::now();
    let words = format!("{LIVE} --publish --domain {}", domain.name());
    let mut child = vision(&bench, &words).spawn().unwrap();
    let mut to = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || {
        send_frames(&mut to, &bytes, before, 1).unwrap();
        // Time for the server to see the last one before its publisher goes.
        std::thread::sleep(Duration::from_millis(500));
    });
    let mut seen: Vec<ExternalPosition> = Vec::new();
    wait_until("the last frame shows nothing", || {
        server.maintain(clock::now());
        seen.extend(server.poll_external());
        seen.last().is_some_and(|last| last.flags == 0)
    });
    writer.join().unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let valid: Vec<_> = seen.iter().filter(|s| s.flags == ExternalPosition::VALID).collect();
    let last = valid.last().unwrap();
    assert!((last.position[0] - 0.2).abs() < 0.003 && last.count == 1, "{last:?}");
    assert!(last.quality > 0.5 && last.deviation[0] > 0.0 && last.deviation[0] < 0.01, "{last:?}");
    assert!(seen.windows(2).all(|pair| pair[0].stamp_ns < pair[1].stamp_ns));
    let number = (last.stamp_ns - before.0) / 1_000_000;
    let is_own = last.stamp_ns == before.0 + number * 1_000_000 && number < 29;
    assert!(is_own, "the frame's own stamp: {last:?}");
    assert_eq!(seen.last().unwrap().flags, 0, "an empty frame is reported to show nothing");
}

#[test]
fn frames_do_not_wait_for_a_camera_that_stalls() {
    const BOTH: usize = 7;
    let (bench, begin) = (film(&[]), clock::now());
    let (of_top, of_side) = (frames(0, BOTH + 10), frames(1, BOTH));
    let mut top = fs::File::create(bench.path("top.y4m")).unwrap();
    send_frames(&mut top, &of_top, begin, 1).unwrap();
    let words = "--config vision.toml top.y4m - --rest-s 0.0055 --output angles.csv";
    let mut child = vision(&bench, words).spawn().unwrap();
    let mut side = child.stdin.take().unwrap();
    send_frames(&mut side, &of_side, begin, 1).unwrap();
    let is_stalled = |row: &Vec<String>| row.last().unwrap().contains("delivers nothing");
    let before = wait_until("the stall is reported", || {
        let rows = rows(&fs::read_to_string(bench.path("angles.csv")).unwrap_or_default());
        rows.iter().rposition(|row| !is_stalled(row)).map(|it| it + 1).filter(|it| *it < rows.len())
    });
    assert!(before > BOTH + 1, "the stall is reported after the other frames: {before}");
    drop(side);
    assert_success(&child.wait_with_output().unwrap());
}

#[test]
fn it_ends_on_request_while_the_camera_is_running() {
    let (bench, frames) = stream(2);
    let mut child = vision(&bench, &format!("{LIVE} --output angles.csv"));
    let mut child = child.stdout(Stdio::null()).stderr(Stdio::inherit()).spawn().unwrap();
    let mut to = child.stdin.take().unwrap();
    // Until the reader is gone.
    let camera =
        std::thread::spawn(move || send_frames(&mut to, &frames, clock::now(), usize::MAX));
    wait_until("it measures", || {
        assert!(child.try_wait().unwrap().is_none(), "it has ended");
        let csv = fs::read_to_string(bench.path("angles.csv"));
        csv.is_ok_and(|text| text.lines().count() > 5)
    });
    kill(Pid::from_raw(child.id().cast_signed()), Signal::SIGINT).unwrap();
    wait_until("it ends", || child.try_wait().unwrap().is_some());
    camera.join().unwrap().unwrap_err();
}

#[test]
fn bad_input_is_refused_with_a_reason() {
    let bench = film(&[]);
    fs::create_dir(bench.path("empty")).unwrap();
    for (arguments, words) in [
        ("none.toml view0 view1", &["none.toml"][..]),
        ("vision.toml view0", &["1 sources of frames for 2 views"]),
        ("vision.toml view0 empty", &["empty", "no PNG or JPEG"]),
        ("vision.toml view0 view0", &["of 6 frames at rest can be measured"]),
        ("vision.toml view0 view1 --publish", &["--publish", "stream"]),
        ("vision.toml vision.toml vision.toml", &["YUV4MPEG2"]),
    ] {
        let result = bench.run(&format!("vision --config {arguments}"));
        assert_refused(result.code == Some(0), &result.error, words);
    }
}

fn assert_success(output: &Output) {
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{out}{err}");
}

#[needs("python: cv2, numpy, pytest")]
#[test]
fn the_tests_of_the_python_package_pass() {
    let mut tests = python();
    assert_success(&tests.args(["-m", "pytest", "-q", "-p", "no:cacheprovider"]).output().unwrap());
}

#[needs("python: iceoryx2")]
#[test]
fn what_python_publishes_reaches_the_controller() {
    let domain = unique_domain();
    let mut server = serve(&domain);
    let script = include_str!("python/publish.py");
    let before = clock::now().0;
    let mut command = python();
    command.args(["-c", script, domain.name()]).stdout(Stdio::piped());
    let child = command.spawn().unwrap();
    let mut seen: Vec<ExternalPosition> = Vec::new();
    wait_until("nothing is published", || {
        server.maintain(clock::now());
        seen.extend(server.poll_external());
        seen.last().is_some_and(|last| last.flags == 0)
    });
    let output = child.wait_with_output().unwrap();
    assert_success(&output);
    assert_says(&text(&output.stdout), &["no controller serves domain nobody-"]);
    let first = seen.first().unwrap();
    assert_eq!((first.position, first.deviation), ([0.1, -0.2, 0.0], [0.001, 0.002, 0.0]));
    assert_eq!((first.quality, first.count, first.flags), (0.75, 2, ExternalPosition::VALID));
    let is_between = first.stamp_ns > before && first.stamp_ns < clock::now().0;
    assert!(is_between, "one clock for both languages");
    assert!(seen.windows(2).all(|pair| pair[0].sequence < pair[1].sequence));
    assert_eq!(seen.last().unwrap().flags, 0);
}
