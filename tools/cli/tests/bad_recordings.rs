//! `i2ris calibrate fit` with recordings that are not as they should be: what it says, word for
//! word, and what it writes.
#![allow(clippy::unwrap_used)]

use std::f64::consts::TAU;
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output};

use i2ris::model::{Model, ModelError};
use tempfile::TempDir;

/// Counts of both motors at a time, s.
type Motion = fn(f64) -> [f64; 2];

/// What a camera makes of pitch and yaw.
type View = fn([f64; 2]) -> [f64; 2];

/// Motion with reversals of many sizes.
fn wander(time: f64) -> [f64; 2] {
    [
        300.0 * (0.31 * time).sin() + 150.0 * (1.13 * time).sin(),
        300.0 * (0.23 * time + 1.0).cos() + 150.0 * (0.97 * time).sin(),
    ]
}

fn as_it_is(angles: [f64; 2]) -> [f64; 2] {
    angles
}

/// A play of a width.
fn play(output: &mut f64, input: f64, width: f64) -> f64 {
    *output = output.clamp(input - width / 2.0, input + width / 2.0);
    *output
}

/// A recording of a snake with gaps, 5 rows a second.
struct Rows {
    folder: TempDir,
}

impl Rows {
    fn new(count: u32, motion: Motion, view: View) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = fs::File::create(folder.path().join("rows.csv")).unwrap();
        let mut file = std::io::BufWriter::new(file);
        writeln!(file, "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg").unwrap();
        let mut gaps = [0.0; 2];
        for index in 0..count {
            let time = 0.2 * f64::from(index);
            let [a, b] = motion(time).map(f64::round);
            let (x, y) = (play(&mut gaps[0], a, 40.0), play(&mut gaps[1], b, 40.0));
            let wobble = 0.05 * (57.0 * time).sin();
            let [pitch, yaw] = view([0.03 * x - 0.01 * y + wobble, 0.01 * x + 0.03 * y - wobble]);
            writeln!(file, "{time:.1},{a},{b},{pitch:.4},{yaw:.4}").unwrap();
        }
        file.flush().unwrap();
        drop(file);
        Self { folder }
    }

    fn model(&self) -> PathBuf {
        self.folder.path().join("model.json")
    }

    fn fit(&self, options: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_i2ris"))
            .args(["calibrate", "fit"])
            .arg(self.folder.path().join("rows.csv"))
            .arg("--output")
            .arg(self.model())
            .args(["--restarts", "2"])
            .args(options.split_whitespace())
            .output()
            .unwrap()
    }

    /// What a fit prints, without its line ends.
    #[track_caller]
    fn printed(&self, options: &str) -> String {
        let output = self.fit(options);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{errors}");
        one_line(&String::from_utf8(output.stdout).unwrap())
    }

    /// The sentence of a fit that fails with code 1 and writes nothing.
    #[track_caller]
    fn refused(&self, options: &str) -> String {
        let output = self.fit(options);
        assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0));
        assert!(!self.model().exists());
        let text = String::from_utf8(output.stderr).unwrap();
        let lines = text.lines().filter(|line| !line.starts_with("fitting "));
        lines.collect::<Vec<_>>().join(" ")
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[track_caller]
fn assert_says(text: &str, sentence: &str) {
    assert!(text.contains(sentence), "`{sentence}` is missing in: {text}");
}

#[test]
fn one_axis_at_a_time_gives_a_separable_model_and_says_so() {
    let motion: Motion = |time| match time < 50.0 {
        true => [400.0 * (0.31 * time).sin() * (0.05 * time).cos(), 0.0],
        false => [0.0, 400.0 * (0.29 * time).sin() * (0.05 * time).cos()],
    };
    let rows = Rows::new(500, motion, as_it_is);
    let text = rows.printed("");
    let sentence = "the motors move together on 6 % of the path only, so the recording does not \
                    show the plane between their axes; record motion of both at once";
    assert_says(&text, &format!("warning {sentence}"));
    for family in ["gmr", "gmr-direction", "gmr-play", "gmr-stop"] {
        assert_says(&text, &format!("No `{family}`: {sentence}."));
    }
    let model = Model::load(&rows.model()).unwrap();
    // Beyond the measured lines it is no further off than a straight line may be.
    let [pitch, yaw, _] = model.predict(&[200.0, 200.0], &model.new_memory()).mean;
    let (pitch, yaw) = (pitch.to_degrees(), yaw.to_degrees());
    assert!((pitch - 4.0).abs() < 1.5 && (yaw - 8.0).abs() < 1.5, "{pitch} {yaw}");
}

#[test]
fn one_loop_is_reported() {
    let motion: Motion = |time| {
        // Lines between four corners.
        let phase = (time / 10.0).rem_euclid(4.0);
        let zigzag = |phase: f64| 400.0 * (2.0 - (phase.rem_euclid(4.0) - 2.0).abs() - 1.0);
        [zigzag(phase), zigzag(2.0 * phase)]
    };
    let text = Rows::new(600, motion, as_it_is).printed("");
    for motor in 0..2 {
        assert_says(
            &text,
            &format!(
                "motor {motor} always turns back at the same two positions, so the recording shows \
                 one loop and nothing of the smaller ones inside; record reversals of many sizes"
            ),
        );
    }
}

#[test]
fn a_flat_recording_is_refused() {
    let rows = Rows::new(300, wander, |_| [3.0, 1.0]);
    assert_eq!(
        rows.refused(""),
        format!(
            "error: recording {}: column `pitch_deg` is 3 on every row: nothing was measured; \
             record motion of it, or leave it out with --angles",
            rows.folder.path().join("rows.csv").display()
        )
    );
}

#[test]
fn angles_of_noise_alone_are_refused_and_forced_ones_are_marked() {
    // The seconds of an angle, as if nothing but rounding were left of them.
    let view: View = |[pitch, yaw]| [(1e4 * pitch).sin(), (1e4 * yaw).cos()];
    let rows = Rows::new(300, wander, view);
    let sentence = rows.refused("--family linear");
    assert_eq!(
        sentence,
        format!(
            "error: recording {}: the model of family `linear` is worthless: on rows held out, R2 \
             of `pitch` is -0.01, below that of a constant; record motion with reversals of many \
             sizes of both motors, or write it all the same, marked, with --force",
            rows.folder.path().join("rows.csv").display()
        )
    );
    rows.printed("--family linear --force");
    let model = Model::load(&rows.model()).unwrap();
    let refusal = model.check_use("i2ris", 2, false).unwrap_err();
    assert!(matches!(&refusal, ModelError::Worthless { .. }), "{refusal}");
    assert_says(
        &refusal.to_string(),
        "fit a better one, or allow it by control.allow_worthless_model = true",
    );
    assert!(model.check_use("i2ris", 2, true).is_ok());
    let again = rows.fit("--family linear --force");
    assert_says(&String::from_utf8_lossy(&again.stderr), "--overwrite");
}

#[test]
fn swapped_columns_show_in_what_a_count_moves() {
    let text = Rows::new(300, wander, |[pitch, yaw]| [yaw, pitch]).printed("--family linear");
    assert_says(&text, "a count of motor 0 moves pitch by +0.0098 deg");
    assert_says(&text, "and yaw by +0.0294 deg");
    assert_says(
        &text,
        "where the robot does otherwise, two columns are swapped (--counts, --angles) or the \
         picture is mirrored",
    );
}

#[test]
fn a_mirrored_picture_shows_in_what_a_count_moves() {
    let text = Rows::new(300, wander, |[pitch, yaw]| [pitch, -yaw]).printed("--family linear");
    assert_says(&text, "a count of motor 0 moves pitch by +0.0294 deg");
    assert_says(&text, "and yaw by -0.0098 deg");
}

#[test]
fn radians_in_place_of_degrees_are_reported() {
    let view: View = |angles| angles.map(f64::to_radians);
    let text = Rows::new(300, wander, view).printed("--family linear");
    assert_says(
        &text,
        "warning no angle is further from 0 than 0.290 deg; if they are radians, multiply them by \
         57.29578 and fit again",
    );
}

#[test]
fn two_hundred_rows_give_a_model() {
    let rows = Rows::new(200, wander, as_it_is);
    let text = rows.printed("");
    assert_says(&text, "training 150 row(s) held out 50 row(s)");
    assert!(Model::load(&rows.model()).is_ok());
}

#[test]
fn a_hundred_thousand_rows_are_thinned() {
    assert_thinned(100_000, "every 4th, more add hardly anything");
}

#[test]
#[ignore = "two minutes"]
fn a_million_rows_are_thinned() {
    assert_thinned(1_000_000, "training 19737 row(s): every 38th, more add hardly anything");
}

#[track_caller]
fn assert_thinned(rows: u32, sentence: &str) {
    let motion: Motion = |time| {
        let part = time / 2000.0;
        [400.0 * (TAU * 7.0 * part).sin(), 400.0 * (TAU * 11.3 * part).cos()]
    };
    let text = Rows::new(rows, motion, as_it_is).printed("--family linear --latency-ms 0");
    assert_says(&text, sentence);
}

#[test]
fn stamps_that_jump_back_are_refused() {
    let rows = Rows::new(300, wander, as_it_is);
    let path = rows.folder.path().join("rows.csv");
    let text = fs::read_to_string(&path).unwrap();
    let jumped = text.replacen("\n20.0,", "\n12.3,", 1);
    assert_ne!(text, jumped);
    fs::write(&path, jumped).unwrap();
    assert_eq!(
        rows.refused(""),
        format!(
            "error: recording {}, line 102, column `t_s`: time 12.3 s goes backwards (19.8 s in \
             line 101); correct the stamps, cut the recording there, or read it without time \
             (--no-time)",
            path.display()
        )
    );
}
