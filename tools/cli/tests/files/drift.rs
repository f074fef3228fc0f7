//! `i2ris calibrate compare --drift` and `fit` with a trial as used.

use std::fmt::Write as _;

use i2ris::model::Model;

use crate::bench::{WorkFolder, assert_says};

/// Rows of a snake that bends by its counts, with a zero of pitch, deg.
fn recording(rows: u32, zero_deg: f64, phase: f64) -> String {
    recording_with(rows, zero_deg, phase, 1.0)
}

/// With a gain of pitch.
fn recording_with(rows: u32, zero_deg: f64, phase: f64, gain: f64) -> String {
    let mut text = String::from("t_s,q0_counts,q1_counts,pitch_deg,yaw_deg\n");
    for i in 0..rows {
        let time = 0.2 * f64::from(i);
        let at = time + phase;
        let q0 = (300.0 * (0.31 * at).sin() + 150.0 * (1.13 * at).sin()).round();
        let q1 = (300.0 * (0.23 * at + 1.0).cos() + 150.0 * (0.97 * at).sin()).round();
        let wobble = 0.1 * (57.0 * at).sin();
        let pitch = gain * (0.02 * q0 - 0.015 * q1) + wobble + zero_deg;
        let yaw = 0.015 * q0 + 0.02 * q1 + wobble;
        writeln!(text, "{time:.1},{q0},{q1},{pitch:.4},{yaw:.4}").unwrap();
    }
    text
}

/// The recording of a new snake, its model, and a minute of the snake today.
fn bench() -> WorkFolder {
    let bench = WorkFolder::with("new.csv", &recording(500, 0.0, 0.0));
    bench.write("today.csv", &recording(300, 1.0, 40.0));
    bench.succeeds("calibrate fit new.csv --output model.json --family linear --latency-ms 0");
    bench
}

#[test]
fn drift_is_reported_with_a_verdict_and_a_page() {
    let bench = bench();
    let today = "calibrate compare model.json --recording today.csv --drift";
    let with_page = format!("{today} --report page.html");
    let text = bench.succeeds(&with_page);
    let verdict = "it has drifted: home the robot again, or `i2ris calibrate fit` it with a trial";
    assert_says(&text, &["zero       pitch  +1.0", verdict]);
    assert_says(&bench.read("page.html"), &["<svg", "zero of pitch (deg)"]);
    let text = bench.succeeds("calibrate compare model.json --recording new.csv --drift");
    assert_says(&text, &["the calibration holds"]);
    let json: serde_json::Value =
        serde_json::from_str(&bench.succeeds(&format!("{today} --json"))).unwrap();
    assert_eq!(json[0]["verdict"], "refine");
    let zero = json[0]["zero"][0]["value"].as_f64().unwrap();
    assert!((zero - 1.0).abs() < 0.05, "{json}");
    bench.fails(&with_page, &["--overwrite"]);
}

#[test]
fn trial_refines_model_if_better_and_wrong_zero_is_refused() {
    let bench = bench();
    bench.write("trial.csv", &recording_with(300, 0.0, 90.0, 1.1));
    let refine = |trial: &str, output: &str| {
        format!("calibrate fit new.csv {trial} --model model.json --output {output}")
    };
    let text = bench.succeeds(&refine("trial.csv", "refined.json"));
    assert_says(&text, &["300 frames of trial.csv", "held out", "wrote refined.json"]);
    let [calibrated, refined] =
        ["model.json", "refined.json"].map(|name| Model::load(&bench.path(name)).unwrap());
    let gain = |model: &Model| model.predict(&[200.0, 0.0], &model.new_memory()).mean[0];
    assert!(gain(&refined) > 1.02 * gain(&calibrated));
    assert_eq!(refined.file().training.data_file, "new.csv and trial.csv");
    bench.fails(&refine("trial.csv", "model.json"), &["model.json: exists", "--overwrite"]);
    for (trial, words) in
        [("today.csv", "the zero has shifted"), ("new.csv", "not better on the rest")]
    {
        bench.fails(&refine(trial, "other.json"), &[words]);
    }
    let other = "calibrate fit today.csv trial.csv --model model.json --output other.json";
    bench.fails(other, &["was fitted to new.csv"]);
    let useless = format!("{} --family gmr", refine("trial.csv", "other.json"));
    assert_says(&bench.run(&useless).error, &["cannot be used with"]);
    assert!(!bench.exists("other.json"));
}
