//! Every cause of no motion reads the same in `i2ris status`, the recording and the Python
//! client.

use std::fs;
use std::path::Path;

use i2ris::ipc::{Fault, OperatingState};
use i2ris::robot::{Cause, Measurement, Quantity, Reason};
use i2ris_needs::needs;
use i2ris_testing::bench::{WorkFolder, interrupt, repository, start, succeeds};
use i2ris_testing::{Controller, python, wait_until};

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

/// Sets the robot into FAULT and lets the controller report its cause.
fn fault(controller: &Controller, reason: Reason) {
    let Cause::Fault(fault) = reason.cause else {
        return;
    };
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
    let (faults, others): (Vec<&Reason>, Vec<&Reason>) =
        all.iter().partition(|reason| reason.cause.is_error());
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
    { reader.records() }
        .map(|row| row.unwrap())
        .map(|row| (row[text].to_owned(), row[advice].to_owned()))
        .collect()
}

#[test]
fn the_texts_of_python_are_current() {
    let written = fs::read_to_string(repository("tools/python/i2ris/reasons.py")).unwrap();
    assert!(
        written == i2ris_record::generated::python_reasons(),
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
    use i2ris::ipc::ready::{ICEORYX2_VERSION, INTERFACE_VERSION};
    for (file, part) in [
        ("i2ris/payload.py", format!("\nINTERFACE_VERSION = {INTERFACE_VERSION}\n")),
        ("i2ris/link.py", format!("\nICEORYX2_VERSION = \"{ICEORYX2_VERSION}\"\n")),
        ("pyproject.toml", format!("iceoryx2=={ICEORYX2_VERSION}")),
    ] {
        let text = fs::read_to_string(repository("tools/python").join(file)).unwrap();
        assert!(text.contains(&part), "{part}");
    }
}

const SCRIPT: &str = include_str!("python/reasons.py");

#[needs("python: iceoryx2, numpy")]
#[test]
fn every_cause_reads_the_same_in_an_exception_of_python() {
    let all = reasons();
    let (faults, others): (Vec<&Reason>, Vec<&Reason>) =
        all.iter().partition(|reason| reason.cause.is_error());
    for batch in others.chunks(KEPT).chain([faults.as_slice()]) {
        let controller = Controller::enabled();
        for reason in batch {
            controller.robot().reasons.push((**reason, 7));
        }
        let arguments = [controller.domain.name(), &batch.len().to_string()];
        let output = python().args(["-c", SCRIPT]).args(arguments).output().unwrap();
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
