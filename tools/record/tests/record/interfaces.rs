//! Python, C++, the tools of ROS, `i2ris status` and the manual have the payloads, services and
//! causes of no motion of the controller. A recording contains the same as one of a dVRK: standard
//! messages and those of CRTK, and the robot as a URDF.

use std::fs;
use std::path::Path;
use std::process::Command;

use i2ris::ipc::payload::{Field, LAYOUTS, ModelReply, OperatingStateMsg, Payload, PayloadLayout};
use i2ris::ipc::ready::{ICEORYX2_VERSION, INTERFACE_VERSION};
use i2ris::ipc::{Direction, Fault, OperatingState, RequestService, Stream, StreamMessage};
use i2ris::robot::{Cause, Measurement, Quantity, Reason};
use i2ris::units::Nanos;
use i2ris_needs::needs;
use i2ris_record::messages::snake;
use i2ris_record::recorder::{RecordingHeader, TrialRecorder};
use i2ris_testing::bench::{WorkFolder, interrupt, repository, start, succeeds};
use i2ris_testing::{Controller, python, run_python, wait_until};

use crate::{command, header, joints, recording};

/// The layouts of all payloads as JSON.
fn table() -> serde_json::Value {
    let field = |field: &Field| {
        let bytes = field.kind.size() * field.count;
        serde_json::json!({"name": field.name, "offset": field.offset, "bytes": bytes})
    };
    let payload = |layout: PayloadLayout| {
        let fields: Vec<_> = layout.fields.iter().map(field).collect();
        serde_json::json!({"type_name": layout.type_name, "name": layout.name,
                           "size": layout.size, "fields": fields})
    };
    LAYOUTS.into_iter().chain([ModelReply::LAYOUT]).map(payload).collect::<Vec<_>>().into()
}

#[needs("python: ctypes")]
#[test]
fn python_has_the_same_payloads() {
    run_python(include_str!("python/payloads.py"), &[&table().to_string()]);
}

#[needs("program: c++")]
#[test]
fn the_header_for_cpp_is_current_and_compiles() {
    let path = repository("tools/cpp/i2ris_payload.hpp");
    let written = fs::read_to_string(&path).unwrap();
    assert!(
        written == i2ris_record::other_languages::cpp_header(),
        "run cargo run -p i2ris-record --example cpp_header > tools/cpp/i2ris_payload.hpp"
    );
    let mut compiler = Command::new("c++");
    compiler.args("-std=c++17 -Wall -Wextra -Werror -fsyntax-only -include".split(' ')).arg(&path);
    let output = compiler.args(["-x", "c++", "/dev/null"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn the_manual_has_every_service_with_payload_and_direction() {
    let manual = fs::read_to_string(repository("tools/manual/src/shared-memory.md")).unwrap();
    let rows = manual.lines().filter(|line| line.starts_with("| `i2ris/"));
    let rows: Vec<Vec<&str>> = rows.map(|line| line.split('|').map(str::trim).collect()).collect();
    let mut services = 0;
    let mut check = |service: &str, pattern: &str, payloads: &str, direction: &str| {
        let name = format!("`{service}`");
        let mut found = rows.iter().filter(|row| row[1].split(", ").any(|it| it == name));
        let row = found.next().unwrap_or_else(|| panic!("the manual does not have {service}"));
        assert!(found.next().is_none(), "{service} is listed twice");
        assert_eq!(row[2], pattern, "{service}");
        assert!(row[3].starts_with(payloads), "{service}: {row:?}");
        assert!(row[4].starts_with(direction), "{service}: {row:?}");
        services += 1;
    };
    for stream in Stream::ALL.iter().map(|stream| stream.properties()) {
        let direction = match stream.direction {
            Direction::Out => "out",
            Direction::In => "in",
            Direction::BetweenClients => "from the client",
        };
        let payload = format!("`{}`", stream.layout.name);
        check(stream.service, "publish-subscribe", &payload, direction);
    }
    for service in RequestService::ALL {
        let payloads = service.layouts().map(|layout| format!("`{}`", layout.name)).join(", ");
        check(service.service(), "request-response", &payloads, "");
    }
    let named: usize = rows.iter().map(|row| row[1].split(", ").count()).sum();
    assert_eq!(named, services, "a service of the manual is not in the table");
}

/// A robot that is enabled, and then moves.
fn robot_that_moves(path: &Path) {
    let (frame, urdf) = (snake().base(), snake().urdf());
    let header = RecordingHeader { frame, urdf, ..header() };
    let mut trial = TrialRecorder::start(path, header).unwrap();
    for number in 1..=100 {
        let stamp = Nanos::from_millis(number);
        let (state, busy) = match number {
            1..20 => (OperatingState::Disabled, false),
            20..30 => (OperatingState::Disabled, true),
            _ => (OperatingState::Enabled, false),
        };
        let busy = if busy { OperatingStateMsg::BUSY } else { 0 };
        let message = OperatingStateMsg {
            sequence: number,
            stamp_ns: stamp.0,
            state: state.number(),
            flags: OperatingStateMsg::HOMED | busy,
            ..OperatingStateMsg::default()
        };
        trial.record(&StreamMessage::State(message), stamp);
        let angles = [0.001 * number as f64, -0.5, 0.0];
        if number > 50 {
            trial.record(&command(number, stamp, angles), stamp);
        }
        trial.record(&StreamMessage::Measured(joints(number, stamp, angles)), stamp);
    }
    trial.finish(Default::default(), &[]).unwrap();
}

/// Checks of both readers, with the messages by topic in `seen`.
fn sees_a_robot(script: &str) {
    let (_folder, file) = recording(robot_that_moves);
    let script = [script, include_str!("python/crtk_checks.py")].concat();
    run_python(&script, &[file.to_str().unwrap()]);
}

#[needs("python: mcap, mcap_ros2")]
#[test]
fn the_python_package_of_mcap_sees_a_robot_of_crtk() {
    sees_a_robot(include_str!("python/crtk_mcap.py"));
}

#[needs("python: rosbags")]
#[test]
fn rosbags_sees_a_robot_of_crtk() {
    sees_a_robot(include_str!("python/crtk_rosbags.py"));
}

/// Messages that `error` and `warning` keep for later subscribers.
const KEPT: usize = 16;

fn reasons() -> Vec<Reason> {
    let measurements = [
        None,
        Some(Measurement::new(Quantity::Milliseconds, 62.25, Some(50.0))),
        Some(Measurement::new(Quantity::Counts, 2314.0, Some(2000.0)).of_motor(1)),
        Some(Measurement::new(Quantity::ErrorCode, 34_321.0, None).of_motor(0)),
        Some(Measurement::new(Quantity::Sequence, 4.0, Some(9.0))),
        Some(Measurement::new(Quantity::Degrees, 9.5, Some(2.0))),
    ];
    let causes = Cause::all().filter(|cause| !matches!(cause, Cause::State(_)));
    let paired = causes.zip(measurements.into_iter().cycle());
    paired.map(|(cause, measurement)| Reason { cause, measurement }).collect()
}

fn faults_and_others(all: &[Reason]) -> (Vec<&Reason>, Vec<&Reason>) {
    all.iter().partition(|reason| reason.cause.is_error())
}

/// Sets the robot into FAULT and lets the controller report its cause.
fn fault(controller: &Controller, reason: Reason) {
    let Cause::Fault(fault) = reason.cause else { return };
    let mut robot = controller.robot();
    (robot.state, robot.fault) = (OperatingState::Fault, fault);
    robot.reasons.push((reason, 0));
}

fn status(controller: &Controller) -> (String, serde_json::Value) {
    let json = succeeds(&controller.domain, "status --json");
    (succeeds(&controller.domain, "status"), serde_json::from_str(&json).unwrap())
}

#[test]
fn every_cause_reads_the_same_in_status_and_recording() {
    let (controller, bench) = (Controller::enabled(), WorkFolder::empty());
    let recorder = start(&controller.domain, &bench.words("record --output @trial.mcap"));
    wait_until("a recording begins", || bench.exists("trial.mcap"));
    let all = reasons();
    let (faults, others) = faults_and_others(&all);
    for batch in others.chunks(KEPT) {
        for reason in batch {
            controller.robot().reasons.push((**reason, 7));
        }
        let (text, json) = status(&controller);
        for reason in batch {
            let advice = format!("  action: {}", reason.cause.advice());
            let line = text.lines().position(|line| line.starts_with(&reason.text()));
            let line = line.unwrap_or_else(|| panic!("{reason}\n{text}"));
            assert_eq!(text.lines().nth(line + 1), Some(advice.as_str()));
            let is_same = |it: &serde_json::Value| it["text"] == reason.text().as_str();
            assert!(json["why"].as_array().unwrap().iter().any(is_same), "{reason}");
        }
    }
    for reason in &faults {
        fault(&controller, **reason);
        let (text, json) = status(&controller);
        assert!(text.starts_with(&reason.text()), "{reason}\n{text}");
        assert_eq!(json["why"][0]["code"], reason.cause.to_string().as_str());
    }
    interrupt(recorder);
    bench.succeeds("record export trial.mcap --output tables");
    let recorded = ["error.csv", "warning.csv"].map(|it| texts(&bench.path("tables").join(it)));
    for reason in &all {
        let stream = &recorded[usize::from(!reason.cause.is_error())];
        let (text, advice) = (reason.text(), reason.cause.advice().to_owned());
        assert!(stream.contains(&(text, advice)), "{reason}\n{stream:#?}");
    }
}

/// Text and advice of every row.
fn texts(table: &Path) -> Vec<(String, String)> {
    let mut reader = csv::Reader::from_path(table).unwrap();
    let headers = reader.headers().unwrap().clone();
    let column = |name: &str| headers.iter().position(|header| header == name).unwrap();
    let (text, advice) = (column("text"), column("advice"));
    let rows = reader.records().map(Result::unwrap);
    rows.map(|row| (row[text].to_owned(), row[advice].to_owned())).collect()
}

#[test]
fn the_texts_of_python_are_current() {
    let written = fs::read_to_string(repository("tools/python/i2ris/reasons.py")).unwrap();
    assert!(
        written == i2ris_record::other_languages::python_reasons(),
        "run cargo run -p i2ris-record --example python_reasons > tools/python/i2ris/reasons.py"
    );
}

#[test]
fn the_table_of_the_manual_is_current() {
    let file = repository("tools/manual/src/stops-and-faults.md");
    let text = fs::read_to_string(&file).unwrap();
    let (head, rest) = text.split_once("<!-- reasons:").unwrap();
    let (mark, rest) = rest.split_once("-->\n").unwrap();
    let (_, tail) = rest.split_once("<!-- end -->").unwrap();
    let causes = Cause::all().filter(|cause| !matches!(cause, Cause::State(_)));
    let rows = causes.map(|cause| {
        let (sentence, advice) = (cause.sentence(), cause.advice());
        format!("| {cause} | {sentence} | {advice} |\n")
    });
    let table = format!(
        "\n| code | what happened | what to do |\n|---|---|---|\n{}\n",
        rows.collect::<String>()
    );
    let current = format!("{head}<!-- reasons:{mark}-->\n{table}<!-- end -->{tail}");
    if std::env::var_os("I2RIS_UPDATE").is_some() {
        fs::write(&file, &current).unwrap();
    } else {
        assert!(text == current, "run I2RIS_UPDATE=1 cargo test -p i2ris-record --test record");
    }
}

#[test]
fn python_has_the_versions_of_the_controller() {
    for (file, part) in [
        ("i2ris/payload.py", format!("\nINTERFACE_VERSION = {INTERFACE_VERSION}\n")),
        ("i2ris/link.py", format!("\nICEORYX2_VERSION = \"{ICEORYX2_VERSION}\"\n")),
        ("pyproject.toml", format!("iceoryx2=={ICEORYX2_VERSION}")),
    ] {
        let text = fs::read_to_string(repository("tools/python").join(file)).unwrap();
        assert!(text.contains(&part), "{part}");
    }
}

#[needs("python: iceoryx2, numpy")]
#[test]
fn every_cause_reads_the_same_in_an_exception_of_python() {
    let all = reasons();
    let (faults, others) = faults_and_others(&all);
    for batch in others.chunks(KEPT).chain([faults.as_slice()]) {
        let controller = Controller::enabled();
        for reason in batch {
            controller.robot().reasons.push((**reason, 7));
        }
        let arguments = [controller.domain.name(), &batch.len().to_string()];
        let output = python()
            .args(["-c", include_str!("python/reasons.py")])
            .args(arguments)
            .output()
            .unwrap();
        let printed = String::from_utf8_lossy(&output.stdout);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{printed}{error}");
        for reason in batch {
            let line = reason.to_string();
            assert!(printed.lines().any(|it| it == line), "{line}\n{printed}");
        }
    }
    assert!(Fault::ALL.len() > 1);
}
