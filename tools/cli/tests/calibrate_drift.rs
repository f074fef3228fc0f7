//! `i2ris calibrate compare --drift` and `i2ris calibrate update` as a person meets them.
#![allow(clippy::unwrap_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use i2ris::model::Model;
use tempfile::TempDir;

/// A folder with the recording of a new snake, its model, and a minute of the snake today.
struct Bench(TempDir);

/// Rows of a snake that bends by its counts, with a zero of pitch, deg.
fn recording(rows: u32, zero_deg: f64, phase: f64) -> String {
    let mut text = String::from("t_s,q0_counts,q1_counts,pitch_deg,yaw_deg\n");
    for i in 0..rows {
        let time = 0.2 * f64::from(i);
        let at = time + phase;
        let q0 = (300.0 * (0.31 * at).sin() + 150.0 * (1.13 * at).sin()).round();
        let q1 = (300.0 * (0.23 * at + 1.0).cos() + 150.0 * (0.97 * at).sin()).round();
        let wobble = 0.1 * (57.0 * at).sin();
        let pitch = 0.02 * q0 - 0.015 * q1 + wobble + zero_deg;
        let yaw = 0.015 * q0 + 0.02 * q1 + wobble;
        writeln!(text, "{time:.1},{q0},{q1},{pitch:.4},{yaw:.4}").unwrap();
    }
    text
}

impl Bench {
    fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        fs::write(bench.path("new.csv"), recording(500, 0.0, 0.0)).unwrap();
        fs::write(bench.path("today.csv"), recording(300, 1.0, 40.0)).unwrap();
        let fit = "fit new.csv --output model.json --family linear --latency-ms 0";
        assert!(bench.run(fit).status.success());
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, arguments: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_i2ris"))
            .arg("calibrate")
            .args(arguments.split_whitespace())
            .current_dir(self.0.path())
            .output()
            .unwrap()
    }

    #[track_caller]
    fn says(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    }

    #[track_caller]
    fn refuses(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        assert!(!output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    }
}

#[test]
fn the_drift_of_a_snake_is_printed_with_a_verdict_and_a_page() {
    let bench = Bench::new();
    let text = bench.says("compare model.json --recording today.csv --drift --report page.html");
    assert!(text.contains("zero       pitch  +1.0"), "{text}");
    assert!(text.contains("it has drifted: `i2ris calibrate update`"), "{text}");
    let page = fs::read_to_string(bench.path("page.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("zero of pitch (deg)"));
    let text = bench.says("compare model.json --recording new.csv --drift");
    assert!(text.contains("the calibration holds"), "{text}");
    let json = bench.says("compare model.json --recording today.csv --drift --json");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json[0]["verdict"], "update");
    let zero = json[0]["zero"][0]["value"].as_f64().unwrap();
    assert!((zero - 1.0).abs() < 0.05, "{json}");
    let again = "compare model.json --recording today.csv --drift --report page.html";
    assert!(bench.refuses(again).contains("--overwrite"));
}

#[test]
fn an_update_writes_a_model_of_today_and_nothing_over() {
    let bench = Bench::new();
    let old = fs::read(bench.path("model.json")).unwrap();
    let text = bench.says("update today.csv --model model.json --output today.json");
    assert!(text.contains("wrote today.json"), "{text}");
    let model = Model::load(&bench.path("today.json")).unwrap();
    let at = |model: &Model| model.predict(&[0.0; 2], &model.new_memory()).mean[0].to_degrees();
    let calibrated = Model::load(&bench.path("model.json")).unwrap();
    assert!((at(&model) - at(&calibrated) - 1.0).abs() < 0.05);
    let origin = &model.file().training.data_file;
    assert_eq!(origin, "new.csv updated by today.csv");
    let again = bench.refuses("update today.csv --model model.json --output model.json");
    assert!(again.contains("model.json: exists") && again.contains("--overwrite"), "{again}");
    assert_eq!(fs::read(bench.path("model.json")).unwrap(), old);
    bench.says("update today.csv --model model.json --output today.json --overwrite");
    let needless = bench.refuses("update new.csv --model model.json --output other.json");
    assert!(needless.contains("no better on the rest"), "{needless}");
    assert!(!bench.path("other.json").exists());
}
