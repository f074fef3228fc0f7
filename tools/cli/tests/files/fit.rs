//! `i2ris calibrate fit` as used, with good and bad recordings. The refusals of the reader are
//! tested there; here each kind occurs once.

use std::fmt::Write as _;

use i2ris::model::{Model, ModelError};

use crate::bench::{WorkFolder, assert_says};

const HEADER: &str = "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg";
const FIT: &str = "calibrate fit rows.csv --output model.json";

/// A motion of both motors with reversals of many sizes, counts.
fn wander(time: f64) -> [f64; 2] {
    [
        300.0 * (0.31 * time).sin() + 150.0 * (1.13 * time).sin(),
        300.0 * (0.23 * time + 1.0).cos() + 150.0 * (0.97 * time).sin(),
    ]
}

/// A recording, 5 rows a second.
fn recording(
    rows: u32,
    motion: impl Fn(f64) -> [f64; 2],
    mut angles: impl FnMut(f64, [f64; 2]) -> [f64; 2],
) -> String {
    let mut text = format!("{HEADER}\n");
    for row in 0..rows {
        let time = 0.2 * f64::from(row);
        let [q0, q1] = motion(time).map(f64::round);
        let [pitch, yaw] = angles(time, [q0, q1]);
        writeln!(text, "{time:.1},{q0},{q1},{pitch:.4},{yaw:.4}").unwrap();
    }
    text
}

/// A snake that bends less and less, and wanders.
fn good(rows: u32) -> String {
    recording(rows, wander, |time, [q0, q1]| {
        let bend = |angle: f64| 12.0 * (angle / 12.0).tanh() + 0.1 * (57.0 * time).sin();
        [bend(0.02 * q0 - 0.015 * q1), bend(0.015 * q0 + 0.02 * q1)]
    })
}

/// A snake with gaps, seen by a camera that transforms its angles.
fn gappy(rows: u32, motion: fn(f64) -> [f64; 2], view: fn([f64; 2]) -> [f64; 2]) -> WorkFolder {
    let mut gaps = [0.0_f64; 2];
    let text = recording(rows, motion, |time, counts| {
        for (gap, counts) in gaps.iter_mut().zip(counts) {
            *gap = gap.clamp(counts - 20.0, counts + 20.0);
        }
        let ([x, y], wobble) = (gaps, 0.05 * (57.0 * time).sin());
        view([0.03 * x - 0.01 * y + wobble, 0.01 * x + 0.03 * y - wobble])
    });
    WorkFolder::with("rows.csv", &text)
}

impl WorkFolder {
    fn good(rows: u32) -> Self {
        Self::with("rows.csv", &good(rows))
    }

    #[track_caller]
    fn fits(&self, options: &str) -> String {
        let printed = self.succeeds(&format!("{FIT} {options}"));
        self.model();
        printed
    }

    /// Output of a fit, without line ends.
    #[track_caller]
    fn prints(&self, options: &str) -> String {
        let result = self.run(&format!("{FIT} --restarts 2 {options}"));
        assert_eq!(result.code, Some(0), "{}", result.error);
        result.output.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Error of a fit that names the recording and leaves no files.
    #[track_caller]
    fn refuses(&self, options: &str, parts: &[&str]) -> String {
        let sentence = self.fails(&format!("{FIT} {options}"), parts);
        assert_says(&sentence, &["rows.csv"]);
        assert_eq!(self.names(), ["rows.csv"], "files were left");
        sentence
    }

    fn model(&self) -> Model {
        Model::load(&self.path("model.json")).unwrap()
    }
}

#[test]
fn a_good_recording_gives_a_model_and_a_table() {
    let bench = WorkFolder::good(300);
    let printed = bench.fits("--components ..4 --restarts 4 --robot-id left");
    let id = format!("model id   {}", bench.model().id());
    let head = ["rows       300; 0 dropped", "spikes     0", "noise      pitch", "chosen"];
    let table = ["held out   ", "RMSD", "pitch (deg) linear", "yaw (deg)   linear", &id];
    assert_says(&printed, &[&head[..], &table].concat());
    assert!(printed.lines().all(|line| line.chars().count() <= 100), "{printed}");
    let file = bench.model().file().clone();
    assert_eq!((file.robot_id.as_str(), file.training.data_file.as_str()), ("left", "rows.csv"));
}

#[test]
fn a_report_with_figures_is_written_metadata_the_model() {
    let bench = WorkFolder::good(300);
    let options = "--components 2 --restarts 2 --robot-id a<b>&c --report report.html";
    let printed = bench.fits(options);
    assert!(printed.ends_with("wrote report.html\n"), "{printed}");
    let (text, model) = (bench.read("report.html"), bench.model());
    let (id, hash) = (model.id().to_string(), &model.file().training.data_sha256);
    assert_says(&text, &[&id, hash, "rows.csv", "a&lt;b&gt;&amp;c", "<svg "]);
    let elsewhere = text.replace("http://www.w3.org/2000/svg", "");
    assert!(!elsewhere.contains("//") && !elsewhere.contains("<script") && !text.contains("NaN"));
    assert_eq!(bench.names(), ["model.json", "report.html", "rows.csv"]);
}

#[test]
fn angles_and_millimetres_in_one_file_are_two_models() {
    let both = good(300).lines().enumerate().fold(String::new(), |text, (number, line)| {
        let yaw = line.rsplit(',').next().and_then(|cell| cell.parse::<f64>().ok());
        let x = yaw.map_or(String::new(), |yaw| (0.1 * yaw).to_string());
        format!("{text}{line},{}\n", if number == 0 { "x_mm" } else { &x })
    });
    let bench = WorkFolder::with("rows.csv", &both);
    let command = "`i2ris calibrate fit rows.csv --angles x_mm --output FILE`";
    assert_says(&bench.prints("--family linear"), &["this one omits x_mm", command]);
    let result =
        bench.run("calibrate fit rows.csv --angles x_mm --family linear --output tip.json");
    assert_eq!(result.code, Some(0), "{}", result.error);
    assert_eq!(Model::load(&bench.path("tip.json")).unwrap().file().outputs[0].name, "x");
}

#[test]
fn unwritable_file_is_found_before_the_work() {
    let bench = WorkFolder::good(100);
    for (options, part) in [
        ("--report rows.csv/report.html", "--report rows.csv/report.html: cannot create folder"),
        ("--report .", "is a folder; name a file in it"),
        ("--report rows.csv", "is the recording itself"),
        ("--report model.json", "is the model itself"),
    ] {
        bench.fails(&format!("{FIT} {options}"), &[part]);
    }
    for (output, part) in [
        ("rows.csv/model.json", "cannot create folder"),
        (".", "is a folder; name a file in it"),
        ("rows.csv", "is the recording itself"),
    ] {
        bench.fails(&format!("calibrate fit rows.csv --output {output}"), &[part]);
    }
    assert_eq!((bench.names(), bench.read("rows.csv")), (vec!["rows.csv".to_owned()], good(100)));
}

#[test]
fn linear_family_needs_no_mixture_and_is_reproducible() {
    let bench = WorkFolder::good(200);
    let printed = bench.fits("--family linear --hold-out none");
    assert!(printed.contains("held out   nothing") && !printed.contains("gmr"), "{printed}");
    let written = || {
        bench.fits("--components 3 --restarts 5 --seed 9 --overwrite");
        bench.read("model.json")
    };
    assert_eq!(written(), written());
}

#[test]
fn dropped_and_flagged_rows_are_named() {
    let spike = |line: &str| {
        let (rest, yaw) = line.rsplit_once(',').unwrap();
        format!("{rest},{}", yaw.parse::<f64>().unwrap() + 70.0)
    };
    let text = good(200);
    let lines = text.lines().enumerate().map(|(index, line)| match index {
        21 => line[line.find(',').unwrap()..].to_owned(),
        59 => spike(line),
        _ => line.to_owned(),
    });
    let bench = WorkFolder::with("rows.csv", &lines.collect::<Vec<_>>().join("\n"));
    let printed = bench.fits("--components 2 --restarts 2");
    let dropped = "1 dropped for an empty cell:\n           line 22 (t_s)";
    assert_says(&printed, &[dropped, "1 reading(s) flagged:\n           line 60 (yaw "]);
}

#[test]
fn model_is_replaced_only_on_request_by_a_good_one() {
    let bench = WorkFolder::good(100);
    bench.write("model.json", "mine");
    bench.fails(&format!("{FIT} --family linear"), &["model.json: exists", "--overwrite"]);
    bench.fails(&format!("{FIT} --family gmr --components 60 --overwrite"), &[]);
    assert_eq!(bench.read("model.json"), "mine");
    bench.fits("--family linear --overwrite");
}

#[test]
fn model_gets_its_folder_and_recorded_robot() {
    let bench = WorkFolder::good(400);
    bench.write("rows.toml", "format = \"i2ris-recording\"\nrobot_id = \"left\"\n");
    bench.succeeds("calibrate fit rows.csv --output models/new/x.json --family linear");
    assert_eq!(Model::load(&bench.path("models/new/x.json")).unwrap().file().robot_id, "left");
}

#[test]
fn model_and_report_state_recording_date_and_are_reproducible() {
    let bench = WorkFolder::good(400);
    let metadata =
        "format = \"i2ris-recording\"\nrobot_id = \"left\"\nstarted_unix_s = 1700000000\n";
    bench.write("rows.toml", metadata);
    let output = bench.fits("--family linear --report page.html");
    assert!(output.contains("2023-11-14T22:13:20Z"), "{output}");
    assert!(bench.read("page.html").contains("2023-11-14T22:13:20Z"));
    let first = bench.read("model.json");
    std::thread::sleep(std::time::Duration::from_millis(1100));
    bench.fits("--family linear --overwrite");
    assert_eq!(bench.read("model.json"), first, "the day of the fit is not in the file");
    let shown = bench.succeeds("model show model.json");
    assert!(shown.contains("recorded 2023-11-14T22:13:20Z"), "{shown}");
    assert!(shown.contains("file of    20"), "{shown}");
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let bench = WorkFolder::good(100);
    for (options, part) in [
        ("--family cubic", "`cubic` is not a model family"),
        ("--hold-out 1.5", "`1.5` is neither `blocks`"),
        ("--components 0", "must be 1 to 64"),
        ("--restarts 0", "--restarts"),
        ("--components ..65", "must be 1 to 64"),
        ("--angles a=", "`a=` is not an output"),
    ] {
        let result = bench.run(&format!("{FIT} {options}"));
        assert_ne!(result.code, Some(0));
        assert_says(&result.error, &[part]);
        assert!(!bench.exists("model.json"));
    }
}

#[test]
fn pure_noise_is_refused_and_forced_model_is_marked() {
    // The seconds of an angle, as if only rounding remained.
    let bench = gappy(300, wander, |[pitch, yaw]| [(1e4 * pitch).sin(), (1e4 * yaw).cos()]);
    let sentence = "error: recording rows.csv: the model of family `linear` is worthless: on rows \
                    held out, R2 of `pitch` is -0.01, below that of a constant; record motion with \
                    reversals of many sizes of both motors, or use --force to write it with a mark\n";
    assert_eq!(bench.refuses("--restarts 2 --family linear", &[]), sentence);
    bench.prints("--family linear --force");
    let model = bench.model();
    let refusal = model.check_use("i2ris", 2).unwrap_err();
    assert!(matches!(&refusal, ModelError::Worthless(_)), "{refusal}");
    assert_says(&refusal.to_string(), &["fit a better one"]);
}

#[test]
fn swapped_columns_and_units_show_in_the_output() {
    let swapped = gappy(300, wander, |[pitch, yaw]| [yaw, pitch]).prints("--family linear");
    let remedy = "if the robot moves differently, two columns are swapped (--counts, --angles) or \
                  the image is mirrored";
    let moved = "one count of motor 0 moves pitch by +0.0098 deg";
    assert_says(&swapped, &[moved, "and yaw by +0.0294 deg", remedy]);
    let mirrored = gappy(300, wander, |[pitch, yaw]| [pitch, -yaw]).prints("--family linear");
    let moved = "one count of motor 0 moves pitch by +0.0294 deg";
    assert_says(&mirrored, &[moved, "and yaw by -0.0098 deg"]);
    let radians = gappy(300, wander, |angles| angles.map(f64::to_radians));
    let warning = "warning no angle is further from 0 than 0.290 deg; if they are radians, \
                   multiply them by 57.29578 and fit again";
    assert_says(&radians.prints("--family linear"), &[warning]);
}

#[test]
fn few_rows_give_a_model_and_many_are_thinned() {
    let short = gappy(200, wander, |angles| angles);
    assert_says(&short.prints(""), &["training 150 row(s) held out 50 row(s)"]);
    short.model();
    assert_thinned(100_000, "every 4th row; more hardly improve the fit");
}

#[track_caller]
fn assert_thinned(rows: u32, sentence: &str) {
    let motion: fn(f64) -> [f64; 2] = |time| {
        let part = std::f64::consts::TAU * time / 2000.0;
        [400.0 * (7.0 * part).sin(), 400.0 * (11.3 * part).cos()]
    };
    let text = gappy(rows, motion, |angles| angles).prints("--family linear --latency-ms 0");
    assert_says(&text, &[sentence]);
}
