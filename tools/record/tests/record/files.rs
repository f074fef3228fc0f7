//! Recordings are read as they were written, complete or damaged, in Rust and in Python.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use i2ris::ipc::payload::{JointState, OperatingStateMsg, PeriodStatistics};
use i2ris::ipc::{Stream, StreamMessage};
use i2ris::units::Nanos;
use i2ris_needs::needs;
use i2ris_record::export::export;
use i2ris_record::recorder::{AttachedFile, RecordingHeader, TrialRecorder};
use i2ris_record::recovery::recover;
use i2ris_record::report::TrialReport;
use i2ris_testing::bench::{WorkFolder, assert_says};
use i2ris_testing::{program, run_python};
use mcap::records::op;

use crate::{UNIX, camera, command, header, joints, motors, recording};

const MESSAGES: u64 = 2000;

fn record(path: &Path) {
    let header = RecordingHeader {
        about: BTreeMap::from([("note".to_owned(), "a test".to_owned())]),
        attachments: vec![AttachedFile {
            name: "robot.toml".to_owned(),
            media_type: "application/toml",
            content: b"robot_id = \"x\"".to_vec(),
        }],
        ..header()
    };
    let mut trial = TrialRecorder::start(path, header).unwrap();
    for number in 1..=MESSAGES {
        let stamp = Nanos::from_millis(number);
        let angle = number as f64 * 1e-4;
        let joints = joints(number, stamp, [angle, -angle, 0.0]);
        let joints = JointState { model_id: [0xAB; 32], ..joints };
        trial.record(&StreamMessage::Measured(joints), stamp);
        trial.record(&motors(number, stamp, [number as i32, -(number as i32)]), stamp);
        if number % 1000 == 0 {
            let mut window = PeriodStatistics {
                sequence: number / 1000,
                stamp_ns: stamp.0,
                ..Default::default()
            };
            window.lateness.p99_ns = 4321;
            trial.record(&StreamMessage::Statistics(window), stamp);
        }
    }
    let outcome = BTreeMap::from([("dropped".to_owned(), "0".to_owned())]);
    let counts = trial.finish(outcome, &[]).unwrap();
    assert_eq!((counts.dropped, counts.messages[&Stream::Measured]), (0, MESSAGES));
}

#[test]
fn csv_tables_have_every_row() {
    let (folder, file) = recording(record);
    let exported = export(&file, &folder.path().join("tables"), false).unwrap();
    assert!(exported.stopped_by.is_none());
    let rows = ["measured_js.csv", "period_statistics.csv"].map(|name| exported.rows[name]);
    assert_eq!(rows, [MESSAGES, 2]);
    let mut reader =
        csv::Reader::from_path(folder.path().join("tables/actuators_measured_js.csv")).unwrap();
    let header = reader.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|h| h == name).unwrap();
    let [time, sequence, second] = ["t_s", "sequence", "measured_counts_1"].map(column);
    let mut rows = 0;
    for (number, row) in reader.records().map(Result::unwrap).enumerate() {
        rows += 1;
        assert_eq!(row[sequence].parse::<u64>().unwrap(), rows);
        assert_eq!(row[second].parse::<i64>().unwrap(), -(number as i64 + 1));
        assert!((row[time].parse::<f64>().unwrap() - number as f64 * 1e-3).abs() < 1e-6);
    }
    assert_eq!(rows, MESSAGES);
    let table = fs::read_to_string(folder.path().join("tables/measured_js.csv")).unwrap();
    let cells = |line: usize| table.lines().nth(line).unwrap().split(',');
    let model = cells(0).position(|name| name == "model_id").unwrap();
    assert_eq!(cells(1).nth(model), Some(&*"ab".repeat(32)));
    // The table of a stream without messages has no rows.
    let table = fs::read_to_string(folder.path().join("tables/goal_js.csv")).unwrap();
    assert_eq!(table.lines().count(), 1);
    let table = fs::read_to_string(folder.path().join("tables/period_statistics.csv")).unwrap();
    assert!(table.lines().next().unwrap().contains("lateness_p99_ns") && table.contains("4321"));
}

#[test]
fn overview_has_angles_in_degrees_state_and_time() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let header = RecordingHeader { unix_offset_ns: UNIX, ..RecordingHeader::default() };
    let mut trial = TrialRecorder::start(&file, header).unwrap();
    for ms in 0..=1000_u64 {
        let stamp = Nanos::from_millis(ms);
        let joint =
            |degrees: f64| joints(ms, stamp, [degrees.to_radians(), -degrees.to_radians(), 0.0]);
        trial.record(&StreamMessage::Goal(joint(4.0)), stamp);
        trial.record(&StreamMessage::Setpoint(joint(3.0)), stamp);
        trial.record(&StreamMessage::Measured(joint(2.0)), stamp);
        if ms % 100 == 0 {
            let state = OperatingStateMsg {
                stamp_ns: stamp.0,
                state: if ms < 500 { 1 } else { 3 },
                ..OperatingStateMsg::default()
            };
            trial.record(&StreamMessage::State(state), stamp);
            // The camera stops.
            if ms <= 600 {
                let pitch = f64::to_radians(ms as f64 * 1e-3);
                trial.record(&camera(stamp, [pitch, 0.0]), stamp);
            }
        }
    }
    trial.finish(BTreeMap::new(), &[]).unwrap();
    let tables = folder.path().join("tables");
    let exported = export(&file, &tables, false).unwrap();
    assert_eq!(exported.rows["overview.csv"], 101);
    let table = fs::read_to_string(tables.join("overview.csv")).unwrap();
    let rows: Vec<&str> = table.lines().collect();
    assert_eq!(
        rows[0],
        "time,t_s,state,goal_pitch_deg,goal_yaw_deg,setpoint_pitch_deg,setpoint_yaw_deg,\
         estimate_pitch_deg,estimate_yaw_deg,camera_pitch_deg,camera_yaw_deg"
    );
    let cells: Vec<&str> = rows[1 + 25].split(',').collect();
    assert_eq!(cells[..3], ["2023-11-14T22:13:20.250000Z", "0.250000000", "ENABLED"]);
    let degrees: Vec<f64> = cells[3..].iter().map(|cell| cell.parse().unwrap()).collect();
    for (found, wanted) in degrees.iter().zip([4.0, -4.0, 3.0, -3.0, 2.0, -2.0, 0.25, 0.0]) {
        assert!((found - wanted).abs() < 1e-9, "{degrees:?}");
    }
    let late: Vec<&str> = rows[1 + 75].split(',').collect();
    assert_eq!((late[2], late[9], late[10]), ("FAULT", "", ""), "no angles without a camera");
    let units = fs::read_to_string(tables.join("units.csv")).unwrap();
    assert!(units.contains("overview,camera_yaw_deg,deg\n"), "{units}");
    let report = TrialReport::read(&file).unwrap();
    assert_eq!(report.recorded.as_deref(), Some("2023-11-14T22:13:20Z"));
    assert!(report.text().contains("recorded 2023-11-14T22:13:20Z"), "{}", report.text());
    assert!(report.html().contains("2023-11-14T22:13:20Z"));
}

#[test]
fn a_recording_begins_when_its_first_message_is_received() {
    let bench = WorkFolder::empty();
    let mut trial = TrialRecorder::start(&bench.path("a.mcap"), header()).unwrap();
    // From the history of a stream: published an hour ago.
    trial.record(&camera(Nanos::ZERO, [0.0; 2]), Nanos::from_millis(3_600_000));
    trial.finish(BTreeMap::new(), &[]).unwrap();
    let received = "recorded 2023-11-14T23:13:20Z to 2023-11-14T23:13:20Z (UTC)";
    assert_says(&bench.succeeds("record info a.mcap"), &[received]);
}

#[test]
fn report_starts_with_commands_out_of_reach() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let mut trial = TrialRecorder::start(&file, RecordingHeader::default()).unwrap();
    let state = OperatingStateMsg { state: 1, lease_client_id: 7, ..Default::default() };
    trial.record(&StreamMessage::State(state), Nanos(1));
    for ms in 1..=9000_u64 {
        let stamp = Nanos::from_millis(ms);
        let requested = (ms as f64 * 0.01).min(60.0);
        let flags = if requested > 37.3 { JointState::CLIPPED } else { 0 };
        let goal = joints(0, stamp, [requested.min(37.3).to_radians(), 0.0, 0.0]);
        let goal = JointState { flags: JointState::VALID | flags, ..goal };
        trial.record(&command(0, stamp, [requested.to_radians(), 0.0, 0.0]), stamp);
        trial.record(&StreamMessage::Goal(goal), stamp);
        trial.record(&StreamMessage::Measured(goal), stamp);
    }
    trial.finish(BTreeMap::new(), &[]).unwrap();
    let report = TrialReport::read(&file).unwrap();
    let text = report.text();
    assert!(text.lines().nth(1).unwrap().contains("22.7 deg short"), "{text}");
    let page = report.html();
    let short = page.find("requested pitch, yaw +60.0 +0.0 deg").unwrap();
    assert!(short < page.find("deg from the nearest goal in reach").unwrap());
    assert!(!page.contains("from its goal"));
}

#[test]
fn a_file_cut_off_anywhere_is_recovered() {
    let (folder, whole) = recording(record);
    let [cut, out] = ["cut.mcap", "out.mcap"].map(|name| folder.path().join(name));
    let bytes = fs::read(&whole).unwrap();
    let mut most = 0;
    for part in 0..40 {
        let length = bytes.len() * part / 39;
        fs::write(&cut, &bytes[..length]).unwrap();
        let _ = fs::remove_file(&out);
        let recovered = recover(&cut, &out).unwrap();
        assert!(recovered.messages >= most, "more of the file cannot hold less");
        most = recovered.messages;
        if length > 20_000 {
            assert_eq!((recovered.attachments, recovered.metadata >= 1), (1, true), "{length}");
        }
        let again = recover(&out, &folder.path().join(format!("again{part}.mcap"))).unwrap();
        assert!(again.stopped_by.is_none());
    }
    // There are two streams, one of them also as standard messages, and as poses every 20 ms.
    assert_eq!(most, 3 * MESSAGES + 2 * (MESSAGES / 20) + 2);
}

/// The length of the record that begins at a place.
fn length(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap())
}

/// Where chunks begin.
fn chunks(bytes: &[u8]) -> Vec<usize> {
    let (mut chunks, mut at) = (Vec::new(), mcap::MAGIC.len());
    while at + mcap::MAGIC.len() < bytes.len() {
        chunks.extend((bytes[at] == op::CHUNK).then_some(at));
        at += 9 + length(bytes, at) as usize;
    }
    chunks
}

/// One bad sector costs what it hit: foxglove/mcap#385.
#[test]
fn a_damaged_place_costs_one_chunk_and_is_counted() {
    const CHUNKS: u64 = 30;
    let folder = tempfile::tempdir().unwrap();
    let [whole, bad, out] = ["a", "b", "c"].map(|name| folder.path().join(name));
    let options = mcap::WriteOptions::new().compression(Some(mcap::Compression::Lz4));
    let file = fs::File::create_new(&whole).unwrap();
    let mut writer = mcap::Writer::with_options(file, options.use_chunks(true)).unwrap();
    let channel = writer.add_channel(0, "/a", "json", &BTreeMap::new()).unwrap();
    for sequence in 0..CHUNKS as u32 {
        let (log_time, publish_time) = (u64::from(sequence), 0);
        let header =
            mcap::records::MessageHeader { channel_id: channel, sequence, log_time, publish_time };
        let byte = |at: u32| (at.wrapping_mul(at ^ sequence) >> 3) as u8;
        let data: Vec<u8> = (0..500).map(byte).collect();
        writer.write_to_known_channel(&header, &data).unwrap();
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
    let bytes = fs::read(&whole).unwrap();
    let chunks = chunks(&bytes);
    // Data of the first chunk, which alone names the channel; of the last; and lengths of records,
    // after which nothing is where it should be.
    let (first, middle, last) = (chunks[0], chunks[CHUNKS as usize / 2], chunks[29]);
    for at in [first + 200, last + 200, first + 1, middle + 2, middle + 7] {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x40;
        fs::write(&bad, damaged).unwrap();
        let _ = fs::remove_file(&out);
        let recovered = recover(&bad, &out).unwrap();
        let why = recovered.stopped_by.expect("damage is reported").to_string();
        assert!(why.contains("1 damaged place"), "{at}: {why}");
        assert_eq!(recovered.messages, CHUNKS - 1, "{at}: {why}");
        assert!(recover(&out, &folder.path().join(format!("{at}"))).unwrap().stopped_by.is_none());
    }
}

/// The default of the `mcap` tools.
#[test]
fn zstd_chunks_are_refused_but_not_reported_as_damage() {
    let (folder, whole) = recording(record);
    let mut bytes = fs::read(&whole).unwrap();
    let at = chunks(&bytes)[0];
    let name = at + 9 + 28;
    assert_eq!(&bytes[name..name + 7], b"\x03\0\0\0lz4");
    bytes.splice(name..name + 7, *b"\x04\0\0\0zstd");
    let length = length(&bytes, at) + 1;
    bytes[at + 1..at + 9].copy_from_slice(&length.to_le_bytes());
    fs::write(&whole, bytes).unwrap();
    let out = folder.path().join("out.mcap");
    let error = recover(&whole, &out).unwrap_err().to_string();
    let part = "nothing is damaged, but its chunks are compressed with zstd";
    assert!(error.contains(part), "{error}");
    assert!(!out.exists());
    let exported = export(&whole, &folder.path().join("tables"), false).unwrap();
    let text = exported.stopped_by.unwrap().incomplete().to_string();
    assert!(text.contains("zstd") && !text.contains("not complete"), "{text}");
}

#[test]
fn damaged_bytes_cause_no_panic() {
    let (folder, whole) = recording(record);
    let bad = folder.path().join("bad.mcap");
    let bytes = fs::read(&whole).unwrap();
    for step in 0..60 {
        let mut damaged = bytes.clone();
        let place = bytes.len() * step / 60;
        damaged[place] ^= 0xFF;
        fs::write(&bad, damaged).unwrap();
        let _ = export(&bad, &folder.path().join("tables"), false);
    }
}

#[test]
fn declared_length_allocates_only_what_the_file_holds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.mcap");
    let (long, longer) = (&[0xFF; 4][..], &[0xFF; 8][..]);
    for (what, opcode, before, length, after) in [
        ("name of a schema", op::SCHEMA, 2, long, 0),
        ("encoding of a schema", op::SCHEMA, 6, long, 0),
        ("data of a schema", op::SCHEMA, 10, long, 0),
        ("topic", op::CHANNEL, 4, long, 0),
        ("encoding of messages", op::CHANNEL, 8, long, 0),
        ("map of a channel", op::CHANNEL, 12, long, 0),
        ("name of an attachment", op::ATTACHMENT, 16, long, 16),
        ("kind of an attachment", op::ATTACHMENT, 20, long, 12),
        ("data of an attachment", op::ATTACHMENT, 24, longer, 4),
        ("end of an attachment", op::ATTACHMENT, 24, &[], 8),
        ("name of metadata", op::METADATA, 0, long, 0),
        ("map of metadata", op::METADATA, 4, long, 0),
        ("key of metadata", op::METADATA, 4, &[8, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF], 4),
        ("compression", op::CHUNK, 28, long, 8),
        ("size of a chunk", op::CHUNK, 16, longer, 16),
        ("compressed size", op::CHUNK, 32, longer, 0),
    ] {
        let body = [&vec![0; before], length, &vec![0; after]].concat();
        let whole = body.len() as u64;
        for announced in [whole, 1 << 27, 1 << 28, 1 << 32, u64::MAX] {
            let record = [&[opcode], &announced.to_le_bytes()[..], &body].concat();
            fs::write(&path, [mcap::MAGIC, &record].concat()).unwrap();
            let info = program::command(&["record", "info"]);
            let limited = ["-c", "ulimit -v 120000; exec \"$0\" info \"$1\""];
            let mut shell = Command::new("sh");
            let output = shell.args(limited).arg(info.get_program()).arg(&path).output().unwrap();
            let error = String::from_utf8_lossy(&output.stderr);
            let is_reported =
                matches!(output.status.code(), Some(1 | 10)) && error.contains("bad.mcap");
            assert!(is_reported, "{what}, {announced}: {:?} {error}", output.status);
        }
    }
}

#[needs("python: mcap, mcap_ros2")]
#[test]
fn python_opens_it_with_named_fields() {
    let (_folder, file) = recording(record);
    run_python(include_str!("python/named_fields.py"), &[file.to_str().unwrap()]);
}
