//! `i2ris model` and `i2ris calibrate compare`: models without a robot.

use crate::bench::{WorkFolder, assert_says};

/// A linear model: a hundredth of a degree per count, motor 0 to pitch and motor 1 to yaw.
const MODEL: &str = r#"{"format": "i2ris-model", "schema_version": 1, "robot_id": "paper",
    "outputs": [{"name": "pitch", "unit": "deg"}, {"name": "yaw", "unit": "deg"}],
    "family": {"kind": "linear", "gain": [[0.01, 0.0], [0.0, 0.01]], "offset": [0.0, 0.0],
        "covariance": [[0.01, 0.0], [0.0, 0.01]]},
    "hull": {"corners": [[-900.0, -900.0], [900.0, -900.0], [900.0, 900.0], [-900.0, 900.0]]},
    "training": {"data_file": "none.csv", "data_sha256": "SHA", "rows": 10, "seed": 3,
        "restarts": 1,
        "log_likelihood": null, "bic": null, "software": "test"},
    "metrics": [METRICS, METRICS]}"#;

const METRICS: &str = r#"{"held_out": null,
    "training": {"r2": 0.99, "rmsd": 1.0, "nrmsd": 0.1, "mae": 0.8, "max": 2.0}}"#;

const COUNTS: &str = "t_s,pitch_deg,yaw_deg,q0_counts,q1_counts";

fn bench() -> WorkFolder {
    WorkFolder::with(
        "model.json",
        &MODEL.replace("METRICS", METRICS).replace("SHA", &"0".repeat(64)),
    )
}

impl WorkFolder {
    /// Rows of a table, without the header.
    fn rows(&self, name: &str, header: &str) -> Vec<Vec<f64>> {
        let text = self.read(name);
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some(header));
        lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect()
    }
}

#[test]
fn show_prints_what_the_model_is() {
    let bench = bench();
    let output = bench.succeeds("model show model.json");
    let head = ["linear", "paper", "pitch (deg), yaw (deg)", "-900 to 900 counts"];
    assert_says(&output, &[&head[..], &["0.01000 deg/count", "none.csv"]].concat());
    let json: serde_json::Value =
        serde_json::from_str(&bench.succeeds("model show model.json --json")).unwrap();
    assert_eq!(json["file"]["robot_id"], "paper");
    assert_eq!(json["id"].as_str().map(str::len), Some(64));
}

#[test]
fn counts_lead_to_angles_and_angles_to_counts() {
    let bench = bench();
    bench.write("wanted.csv", "t_s,pitch_deg,yaw_deg\n0,0,0\n1,4,-2\n1.5,4,-2\n");
    bench.succeeds("model invert model.json wanted.csv --output counts.csv");
    let rows = bench.rows("counts.csv", COUNTS);
    assert_eq!(rows.len(), 1501, "one per tick of 1 ms");
    for row in &rows {
        // Accelerating to 400 counts/s at 5000 counts/s^2 takes 16 counts, plus rounding.
        assert!(
            (row[3] - 100.0 * row[1]).abs() <= 17.0 && (row[4] - 100.0 * row[2]).abs() <= 17.0,
            "{row:?}"
        );
    }
    assert_eq!(rows.last().unwrap()[1..], [4.0, -2.0, 400.0, -200.0]);
    bench.succeeds("model predict model.json counts.csv --output angles.csv");
    let angles = bench.rows("angles.csv", COUNTS);
    assert_eq!(angles.len(), rows.len());
    assert!(angles.iter().zip(&rows).all(|(angle, row)| (angle[1] - row[3] * 0.01).abs() < 1e-9));
}

#[test]
fn limits_hold_unless_they_are_lifted() {
    let bench = bench();
    bench.write("jump.csv", "t_s,pitch_deg,yaw_deg\n0,0,0\n0.001,8,0\n0.1,8,0\n");
    let arguments = "model invert model.json jump.csv --output counts.csv";
    bench.fails(arguments, &["jump.csv at t_s = 0.001", "--no-limits"]);
    assert!(!bench.exists("counts.csv"));
    let free = format!("{arguments} --no-limits --json");
    let outcome: serde_json::Value = serde_json::from_str(&bench.succeeds(&free)).unwrap();
    assert_eq!(
        (&outcome["clipped_ticks"], &outcome["travel_counts"][0]),
        (&0.into(), &800.0.into())
    );
    let rows = bench.rows("counts.csv", COUNTS);
    assert_eq!((rows[0][3], rows[1][3]), (0.0, 800.0));
}

#[test]
fn a_goal_outside_the_hull_is_clipped_and_reported() {
    let bench = bench();
    bench.write("far.csv", "t_s,pitch_deg,yaw_deg\n0,8,0\n4,12,0\n");
    let invert = "model invert model.json far.csv --output counts.csv";
    assert_says(&bench.succeeds(invert), &["are out of reach, by 3.00 deg at most"]);
    let rows = bench.rows("counts.csv", COUNTS);
    assert_eq!(rows.last().unwrap()[3], 900.0);
}

#[test]
fn models_are_compared_on_a_recording() {
    let bench = bench();
    let mut text = "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg\n".to_owned();
    for k in 0..200 {
        let t = f64::from(k) * 0.1;
        let (a, b) = ((500.0 * t.sin()).round(), (400.0 * (1.3 * t).cos()).round());
        // Off by 0.3 deg in pitch; positions without angles in between.
        text += &format!("{t},{a},{b},{},{}\n{},{a},{b},,\n", 0.01 * a + 0.3, 0.01 * b, t + 0.05);
    }
    bench.write("unseen.csv", &text);
    let output = bench.succeeds("calibrate compare model.json model.json --recording unseen.csv");
    assert_says(&output, &["200 rows with angles on a path of 400 positions"]);
    assert_eq!(output.matches("linear").count(), 2, "{output}");
    let arguments = "calibrate compare model.json --recording unseen.csv --json";
    let json: serde_json::Value = serde_json::from_str(&bench.succeeds(arguments)).unwrap();
    let near =
        |value: &serde_json::Value, wanted: f64| (value.as_f64().unwrap() - wanted).abs() < 1e-9;
    let [pitch, yaw] = [&json[0]["outputs"][0], &json[0]["outputs"][1]];
    assert!(
        near(&pitch["rmsd"], 0.3) && near(&pitch["p99"], 0.3) && near(&pitch["max"], 0.3),
        "{json}"
    );
    assert!(near(&yaw["r2"], 1.0) && near(&json[0]["rms_length"], 0.3), "{json}");
    // A model with less memory is right there: both are judged on the rows known to both.
    let mut narrow: serde_json::Value = serde_json::from_str(&bench.read("model.json")).unwrap();
    narrow["family"]["offset"] = serde_json::json!([0.29, 0.0]);
    narrow["hull"]["corners"] =
        serde_json::json!([[-300.0, -300.0], [300.0, -300.0], [300.0, 300.0], [-300.0, 300.0]]);
    bench.write("narrow.json", &narrow.to_string());
    let both = "calibrate compare model.json narrow.json --recording unseen.csv";
    let output = bench.succeeds(both);
    let (_, rows) = output.split_once("RMS length on the ").unwrap();
    let rows = rows.split(' ').next().unwrap();
    let says = |rms| format!("RMS length on the {rows} rows known to every compared model: {rms}");
    assert_says(&output, &[&says("0.300"), &says("0.010")]);
    let verdict =
        format!("verdict: narrow.json is the best on the {rows} rows known to every model");
    assert_says(
        &output,
        &[&verdict, "model.json, leaves 2900 % more, and is worse in 5 of 5 parts"],
    );
    let json: serde_json::Value =
        serde_json::from_str(&bench.succeeds(&format!("{both} --json"))).unwrap();
    assert!(near(&json[1]["rms_length_of_common"], 0.01), "{json}");
}

#[test]
fn mistakes_are_named_with_file_and_remedy() {
    let bench = bench();
    bench.write("wanted.csv", "t_s,pitch_deg\n0,0\n");
    bench.write("text.csv", "t_s,q0_counts,q1_counts\n0,1,2\n1,x,2\n");
    let axis = "[[ports.axes]]\nposition_min_counts = -900\nposition_max_counts = 900";
    let axes = [0, 1].map(|motor| {
        format!("{axis}\nmotor = {motor}\nnode_id = {motor}\nserial_number = {motor}\n")
    });
    let port = "robot_id = \"other\"\n[[ports]]\ndevice = \"/dev/null\"\n";
    bench.write("other.toml", &format!("{port}{}", axes.concat()));
    bench.write("good.csv", "t_s,pitch_deg,yaw_deg\n0,0,0\n1,1,1\n");
    let invert = "model invert model.json --output out.csv";
    let predict = "model predict model.json text.csv --output";
    for (command, more, result) in [
        (invert, "wanted.csv", "column `yaw_deg`"),
        (invert, "nothing.csv", "table nothing.csv: cannot be read"),
        (invert, "good.csv --config other.toml", "other"),
        (invert, "good.csv --history wanted.csv", "column `q0_counts`"),
        (predict, "out.csv", "text.csv, line 3"),
        (predict, "text.csv", "is the same file"),
        ("model show", "text.csv", "text.csv"),
    ] {
        bench.fails(&format!("{command} {more}"), &[result]);
        assert!(!bench.exists("out.csv"));
    }
}
