//! `i2ris calibrate fit` as a person meets it.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use i2ris::model::Model;
use tempfile::TempDir;

const HEADER: &str = "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg";

/// A folder with a recording in it, and a place for the model.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new(recording: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("rows.csv"), recording).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn model(&self) -> PathBuf {
        self.path("model.json")
    }

    fn fit(&self, options: &str) -> Output {
        calibrate(&self.path("rows.csv"), &self.model(), options)
    }

    /// Fits, and expects a good model; returns what was printed.
    #[track_caller]
    fn succeeds(&self, options: &str) -> String {
        let output = self.fit(options);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(said(&output), "");
        Model::load(&self.model()).unwrap();
        String::from_utf8(output.stdout).unwrap()
    }

    /// Fits, and expects one sentence that names the recording and contains `parts`, and no model.
    #[track_caller]
    fn fails(&self, options: &str, parts: &[&str]) {
        let sentence = failure(&self.fit(options));
        assert!(sentence.contains(&*self.path("rows.csv").to_string_lossy()), "{sentence}");
        for part in parts {
            assert!(sentence.contains(part), "`{part}` is missing in: {sentence}");
        }
        let left: Vec<_> = fs::read_dir(self.folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        assert_eq!(left, ["rows.csv"], "something was left behind");
    }
}

fn calibrate(recording: &Path, model: &Path, options: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_i2ris"))
        .args(["calibrate", "fit"])
        .arg(recording)
        .arg("--output")
        .arg(model)
        .args(options.split_whitespace())
        .output()
        .unwrap()
}

/// What was printed beside the result, without lines about progress: a loaded machine has more of
/// them.
fn said(output: &Output) -> String {
    let text = String::from_utf8(output.stderr.clone()).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with("fitting "));
    lines.map(|line| format!("{line}\n")).collect()
}

/// The one sentence that a failure prints.
#[track_caller]
fn failure(output: &Output) -> String {
    let sentence = said(output);
    assert!(!output.status.success() && output.stdout.is_empty());
    assert!(sentence.starts_with("error: ") && sentence.lines().count() == 1, "{sentence}");
    sentence
}

/// A snake that bends less and less, wandering for `rows` rows: lines 2 and on of the file.
fn rows(rows: u32) -> Vec<[f64; 5]> {
    let row = |i: u32| {
        let time = 0.2 * f64::from(i);
        let q0 = (300.0 * (0.31 * time).sin() + 150.0 * (1.13 * time).sin()).round();
        let q1 = (300.0 * (0.23 * time + 1.0).cos() + 150.0 * (0.97 * time).sin()).round();
        let wobble = 0.1 * (57.0 * time).sin();
        let bend = |angle: f64| 12.0 * (angle / 12.0).tanh() + wobble;
        [time, q0, q1, bend(0.02 * q0 - 0.015 * q1), bend(0.015 * q0 + 0.02 * q1)]
    };
    (0..rows).map(row).collect()
}

fn csv(rows: &[[f64; 5]]) -> String {
    let line = |row: &[f64; 5]| row.map(|number| number.to_string()).join(",");
    std::iter::once(HEADER.to_owned()).chain(rows.iter().map(line)).collect::<Vec<_>>().join("\n")
}

/// A good recording with one cell replaced.
fn with_cell(line: usize, column: usize, cell: &str) -> String {
    let text = csv(&rows(100));
    let mut lines: Vec<_> = text.lines().map(str::to_owned).collect();
    let mut cells: Vec<_> = lines[line - 1].split(',').collect();
    cells[column] = cell;
    lines[line - 1] = cells.join(",");
    lines.join("\n")
}

/// A good recording with one column replaced.
fn with_column(column: usize, cell: &str) -> String {
    let replace = |line: &str| {
        let mut cells: Vec<_> = line.split(',').collect();
        cells[column] = cell;
        cells.join(",")
    };
    let text = csv(&rows(100));
    std::iter::once(HEADER.to_owned())
        .chain(text.lines().skip(1).map(replace))
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn a_good_recording_gives_a_model_and_a_table() {
    let bench = Bench::new(&csv(&rows(300)));
    let printed = bench.succeeds("--max-components 4 --restarts 4 --robot-id left");
    for part in [
        "rows       300; 0 dropped",
        "spikes     0",
        "noise      pitch",
        "chosen",
        "held out   ",
        "RMSD",
    ] {
        assert!(printed.contains(part), "`{part}` is missing in:\n{printed}");
    }
    for name in ["pitch (deg)", "yaw (deg)"] {
        assert!(printed.contains(&format!("{name:<12}linear")), "{printed}");
    }
    assert!(printed.lines().all(|line| line.chars().count() <= 100), "{printed}");
    let model = Model::load(&bench.model()).unwrap();
    assert_eq!(model.file().robot_id, "left");
    assert_eq!(model.file().training.data_file, "rows.csv");
    assert!(printed.contains(&format!("model id   {}", model.id())), "{printed}");
}

#[test]
fn a_report_with_figures_is_written_beside_the_model() {
    let bench = Bench::new(&csv(&rows(300)));
    let page = bench.path("report.html");
    let option = page.to_str().unwrap();
    let options = "--components 2 --restarts 2 --robot-id a<b>&c --report";
    let printed = bench.succeeds(&format!("{options} {option}"));
    assert!(printed.ends_with(&format!("wrote {option}\n")), "{printed}");
    let text = fs::read_to_string(&page).unwrap();
    let model = Model::load(&bench.model()).unwrap();
    for part in [
        &model.id().to_string(),
        &model.file().training.data_sha256,
        "rows.csv",
        "a&lt;b&gt;&amp;c",
        "<svg ",
    ] {
        assert!(text.contains(part), "`{part}` is missing");
    }
    let elsewhere = text.replace("http://www.w3.org/2000/svg", "");
    assert!(!elsewhere.contains("//") && !elsewhere.contains("<script") && !text.contains("NaN"));
    let mut left: Vec<_> = fs::read_dir(bench.folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    left.sort();
    assert_eq!(left, ["model.json", "report.html", "rows.csv"]);
}

#[test]
fn a_report_that_cannot_be_written_is_found_before_the_work() {
    let bench = Bench::new(&csv(&rows(100)));
    let sentence = |report: PathBuf| failure(&bench.fit(&format!("--report {}", report.display())));
    assert!(sentence(bench.path("rows.csv/report.html")).contains("--report"));
    assert!(sentence(bench.path("rows.csv/report.html")).contains("cannot make the folder"));
    assert!(sentence(bench.folder.path().to_owned()).contains("is a folder; name a file in it"));
    assert!(sentence(bench.path("rows.csv")).contains("is the recording itself"));
    assert!(sentence(bench.model()).contains("is the model itself"));
    assert!(!bench.model().exists());
}

#[test]
fn the_linear_family_needs_no_mixture() {
    let bench = Bench::new(&csv(&rows(100)));
    let printed = bench.succeeds("--family linear --hold-out none");
    assert!(printed.contains("held out   nothing") && !printed.contains("gmr"), "{printed}");
}

#[test]
fn the_same_seed_gives_the_same_file() {
    let bench = Bench::new(&csv(&rows(200)));
    let written = || {
        bench.succeeds("--components 3 --restarts 5 --seed 9 --overwrite");
        fs::read(bench.model()).unwrap()
    };
    assert_eq!(written(), written());
}

#[test]
fn dropped_and_flagged_rows_are_named() {
    let mut rows = rows(200);
    rows[58][4] += 70.0;
    let text = csv(&rows).replace(&format!("\n{},", rows[20][0]), "\n,");
    let printed = Bench::new(&text).succeeds("--components 2 --restarts 2");
    assert!(
        printed.contains("1 dropped for an empty cell:\n           line 22 (t_s)"),
        "{printed}"
    );
    assert!(printed.contains("1 reading(s) flagged:\n           line 60 (yaw "), "{printed}");
}

#[test]
fn columns_can_be_named() {
    let text = csv(&rows(100)).replace(HEADER, "when,left,right,up,side");
    let bench = Bench::new(&text);
    let columns = "--counts left,right --angles up=pitch,side=yaw --time when --family linear";
    let printed = bench.succeeds(columns);
    assert!(
        printed.contains("motor 0 `left`, motor 1 `right`, pitch `up`, yaw `side`, time `when`"),
        "{printed}"
    );
}

#[test]
fn an_existing_model_is_replaced_by_a_good_one_only() {
    let bench = Bench::new(&csv(&rows(100)));
    fs::write(bench.model(), "what was there").unwrap();
    failure(&bench.fit("--family gmr --components 60 --overwrite"));
    assert_eq!(fs::read_to_string(bench.model()).unwrap(), "what was there");
    bench.succeeds("--family linear --overwrite");
}

#[test]
fn a_recording_that_is_no_file_is_refused() {
    let bench = Bench::new("");
    bench.fails("", &["is empty"]);
    fs::remove_file(bench.path("rows.csv")).unwrap();
    let sentence = failure(&bench.fit(""));
    assert!(sentence.contains("rows.csv: No such file"), "{sentence}");
    fs::create_dir(bench.path("rows.csv")).unwrap();
    let sentence = failure(&bench.fit(""));
    assert!(sentence.contains("rows.csv: Is a directory"), "{sentence}");
}

#[test]
fn wrong_columns_are_refused() {
    Bench::new(&csv(&rows(100)).replace("q0_counts", "q0"))
        .fails("", &["`q0_counts`", "`q0`, `q1_counts`", "--counts"]);
    let good = Bench::new(&csv(&rows(100)));
    good.fails("--angles bend=pitch", &["no column `bend`", "`pitch_deg`, `yaw_deg`", "--angles"]);
    good.fails("--time clock", &["no column `clock`", "--time"]);
    good.fails("--counts q0_counts,q0_counts", &["`q0_counts` is named for two purposes"]);
}

#[test]
fn columns_that_say_nothing_are_refused() {
    Bench::new(&with_column(4, "")).fails("", &["column `yaw_deg` is empty on every row"]);
    Bench::new(&with_column(2, "5"))
        .fails("", &["column `q1_counts` is 5 on every row", "--counts"]);
    Bench::new(&with_column(3, "0.5"))
        .fails("", &["column `pitch_deg` is 0.5 on every row", "--angles"]);
}

#[test]
fn too_few_rows_are_refused() {
    Bench::new(&csv(&rows(0))).fails("", &["0 complete row(s)"]);
    Bench::new(&csv(&rows(1))).fails("", &["1 complete row(s), and a model takes at least 20"]);
    let few = Bench::new(&csv(&rows(60)));
    let most = ["60 rows of 4 variables carry at most 4", "9 are asked for"];
    few.fails("--family gmr --components 9 --hold-out none", &most);
    few.fails("--hold-out none", &["takes rows held out", "--family"]);
    few.fails("--hold-out 0.9", &["holding out 54 of 60 rows leaves 6 for training", "--hold-out"]);
}

#[test]
fn cells_that_make_no_sense_are_refused() {
    Bench::new(&with_cell(7, 1, "left"))
        .fails("", &["line 7, column `q0_counts`: `left` is not a number"]);
    Bench::new(&with_cell(8, 3, "nan"))
        .fails("", &["line 8, column `pitch_deg`: `nan` is not a finite number"]);
    Bench::new(&with_cell(9, 4, "-181"))
        .fails("", &["line 9, column `yaw_deg`: `-181` is not between -180 and 180"]);
    Bench::new(&with_cell(9, 4, "1,2")).fails("", &["line 9: has 6 cells, and the header names 5"]);
}

#[test]
fn time_that_does_not_go_forward_is_refused() {
    Bench::new(&with_cell(10, 0, "0.3"))
        .fails("", &["line 10, column `t_s`: time 0.3 s goes backwards"]);
    let twice = Bench::new(&with_cell(10, 0, &rows(10)[7][0].to_string()));
    twice.fails("", &["line 10, column `t_s`: time 1.4000000000000001 s occurs twice", "line 9"]);
    twice.succeeds("--no-time --family linear");
}

#[test]
fn motors_that_move_as_one_are_refused() {
    let together: Vec<_> =
        rows(100).into_iter().map(|[t, q0, _, pitch, yaw]| [t, q0, 2.0 * q0, pitch, yaw]).collect();
    Bench::new(&csv(&together)).fails("", &["the motors move together", "--counts"]);
}

#[test]
fn a_model_that_cannot_be_inverted_is_not_written() {
    // Both motors stay on one circle, so nothing is known of its middle, and many components make
    // folds there.
    let on_a_circle = |i: u32| {
        let (time, phase) = (0.2 * f64::from(i), 0.1 * f64::from(i));
        let (q0, q1) = (350.0 * phase.cos(), 350.0 * phase.sin());
        let noise = 0.3 * (91.0 * time).sin();
        let pitch = 0.02 * q0 - 0.015 * q1 + 2.0 * (3.0 * phase).sin() + noise;
        let yaw = 0.015 * q0 + 0.02 * q1 - 1.5 * (2.0 * phase).cos() - noise;
        [time, q0.round(), q1.round(), pitch, yaw]
    };
    let bench = Bench::new(&csv(&(0..250).map(on_a_circle).collect::<Vec<_>>()));
    bench.fails(
        "--family gmr --components 8",
        &["the model of family `gmr` is refused", "the inverse fails at counts"],
    );
}

#[test]
fn an_output_that_cannot_be_written_is_found_before_the_work() {
    let bench = Bench::new(&csv(&rows(100)));
    let recording = bench.path("rows.csv");
    let sentence = |model: PathBuf| failure(&calibrate(&recording, &model, ""));
    assert!(sentence(bench.path("rows.csv/model.json")).contains("cannot make the folder"));
    assert!(sentence(bench.folder.path().to_owned()).contains("is a folder; name a file in it"));
    assert!(sentence(recording.clone()).contains("is the recording itself"));
    assert_eq!(fs::read_to_string(&recording).unwrap(), csv(&rows(100)));
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let bench = Bench::new(&csv(&rows(100)));
    for (options, part) in [
        ("--family cubic", "`cubic` is no family"),
        ("--hold-out 1.5", "`1.5` is neither `blocks`"),
        ("--components 0", "1..=64"),
        ("--restarts 0", "--restarts"),
        ("--shrinkage 2", "from 0 to 1"),
        ("--angles a=", "`a=` names no output"),
    ] {
        let output = bench.fit(options);
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && message.contains(part), "{message}");
        assert!(!bench.model().exists());
    }
}

#[test]
fn the_laboratorys_recording_is_fitted_as_it_is() {
    let recording = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data/i2ris/output_w_angles.csv");
    if !recording.exists() {
        println!("skipped: {} is absent", recording.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("model.json");
    let output = calibrate(&recording, &model, "--restarts 3");
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(
        printed.contains(
            "249; 5 dropped for an empty cell:\n           line 38 (yaws), 74 (yaws), 97"
        ),
        "{printed}"
    );
    assert!(printed.contains("5 blocks all over the recording"), "{printed}");
    assert!(printed.contains("warning    both motors go round"), "{printed}");
    assert_eq!(Model::load(&model).unwrap().outputs(), 2);
}

fn zoo(options: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_i2ris"))
        .args(["calibrate", "zoo"])
        .args(options.split_whitespace())
        .output()
        .unwrap()
}

#[test]
fn the_zoo_judges_a_snake_beside_linear_and_the_exact_inverse() {
    let folder = tempfile::tempdir().unwrap();
    let [json, kept] = ["zoo.json", "kept"].map(|name| folder.path().join(name));
    let output = zoo(&format!(
        "--physics preisach --draws 1 --first-seed 4 --families linear --motions points \
         --duration-s 60 --json {} --keep {}",
        json.display(),
        kept.display()
    ));
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{output:?}");
    assert!(text.contains("preisach           linear"), "{text}");
    let judged: serde_json::Value = serde_json::from_slice(&fs::read(json).unwrap()).unwrap();
    let [judged] = judged.as_array().unwrap().as_slice() else { panic!("{judged}") };
    let rms = |of: &str| judged[of]["rms_deg"].as_f64().unwrap();
    // The exact inverse leaves what the limits of the motors cost.
    assert!(rms("exact") < 0.15, "{judged}");
    assert!((0.3..5.0).contains(&rms("linear")), "{judged}");
    assert_eq!(judged["tracking"], judged["linear"]);
    assert!(kept.join("preisach-4.csv").exists());
}

#[test]
fn the_zoo_refuses_what_it_does_not_have() {
    for (options, words) in [
        ("--physics adder", ["adder", "--physics"]),
        ("--families best,worst", ["worst", "gmr-play"]),
        ("--motions sleep", ["sleep", "minor-loops"]),
        ("--draws 0", ["--draws", "0"]),
        ("--figure ageing.svg", ["--figure", "--ageing"]),
        ("--ageing --drift-hours 1000", ["--drift-hours", "0 to 100"]),
        ("--ageing --json /does/not/exist/zoo.json", ["cannot write", "exist"]),
        ("--duration-s 0", ["--duration-s", "above 0"]),
        ("--json /does/not/exist/zoo.json", ["cannot write", "exist"]),
    ] {
        let output = zoo(options);
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{options}");
        for word in words {
            assert!(text.contains(word), "{options}: {text}");
        }
    }
}

#[test]
fn a_model_gets_its_folder_and_the_robot_of_its_recording() {
    let bench = Bench::new(&csv(&rows(400)));
    fs::write(bench.path("rows.toml"), "format = \"i2ris-recording\"\nrobot_id = \"left\"\n")
        .unwrap();
    let model = bench.path("models/new/x.json");
    let linear = "--family linear";
    let output = calibrate(&bench.path("rows.csv"), &model, linear);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(Model::load(&model).unwrap().file().robot_id, "left");
}

#[test]
fn nothing_is_written_over_without_being_asked() {
    let bench = Bench::new(&csv(&rows(400)));
    fs::write(bench.model(), "mine").unwrap();
    let linear = "--family linear";
    let sentence = failure(&bench.fit(linear));
    assert!(
        sentence.contains("model.json: exists") && sentence.contains("--overwrite"),
        "{sentence}"
    );
    assert_eq!(fs::read_to_string(bench.model()).unwrap(), "mine");
    bench.succeeds(&format!("{linear} --overwrite"));
}
