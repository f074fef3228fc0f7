//! Deliberate defects in the order of filters, one at a time. The pairs must find each of them.
//!
//! A copy of the sources gets the defect, is built, and draws up to two million ticks until it is
//! found. Where two stages enforce the same limit, a defect in one of them changes no setpoint, so
//! both lose the limit: the motor limits in stage 10 and the gate, the calibrated pose in stage 6
//! and the gate. The order of stages 5 and 6 is also such a case: the gate enforces every limit
//! that it could break.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const GATE: &str = "src/core/motion/gate.rs";
const SPACE: &str = "src/core/motion/gate/joint_space.rs";
const CORRECTION: &str = "src/core/motion/joint_model/memory.rs";
const MOTORS: &str = "src/core/motion/velocity_limit.rs";
const BOUNDS: &str = "src/core/motion/joint_limits.rs";
const REGIONS: &str = "src/core/motion/virtual_fixtures/region.rs";
const GOALS: &str = "src/core/command/range_check.rs";
const STAMPS: &str = "src/core/command/client_stream.rs";
const SESSIONS: &str = "src/core/command/sessions.rs";

/// The gate without the limits of the motors.
const NO_MOTORS: Edit =
    (GATE, "if !axes.keep_limits(&self.before) {", "if !axes.keep_limits(&self.before) && false {");

/// File, text and its replacement.
type Edit = (&'static str, &'static str, &'static str);

const DEFECTS: [(&str, &[Edit]); 18] = [
    (
        "the gate checks nothing",
        &[(
            GATE,
            "        if !axes.keep_limits(&self.before) {",
            "        if axes.count() > 0 {\n            \
             return Ok(Verdict::Passes { step: OutputVec::default() });\n        }\n        \
             if !axes.keep_limits(&self.before) {",
        )],
    ),
    (
        "the gate does not check regions",
        &[(SPACE, "        if !self.fixtures.is_on() {", "        if bounds.is_some() || true {")],
    ),
    (
        "the gate does not check the angular speed",
        &[(
            GATE,
            "let speed = self.judge_speed(axes, gate)?;",
            "let passes = Verdict::Passes { step: gate.steps[0] };
             let (speed, _) = (passes, self.judge_speed(axes, gate)?);",
        )],
    ),
    (
        "the gate does not check the hull",
        &[(GATE, "if self.in_hull && !places", "if self.in_hull && false && !places")],
    ),
    (
        "the gate does not check the position of the angles",
        &[(SPACE, "if excess > POSE_TOLERANCE {", "if excess > 9.0 {")],
    ),
    (
        "the gate checks the present setpoints instead of where they come to rest",
        &[(GATE, "let places = [rest, here];", "let [_, places] = [[rest, here], [here, here]];")],
    ),
    (
        "regions are kept at the adapted pose only",
        &[
            (
                SPACE,
                "Some(memory) => joints.calibrated_pose(counts, memory),",
                "Some(memory) => joints.calibrated_pose(counts, memory).map(|_| adapted),",
            ),
            (
                CORRECTION,
                "self.state.correction.as_ref().map(Correction::calibrated_view)",
                "self.state.correction.as_ref().map(Correction::calibrated_view).filter(|_| false)",
            ),
        ],
    ),
    (
        "nothing limits the velocity of the motors",
        &[
            NO_MOTORS,
            (
                MOTORS,
                "clamp(reachable, -self.velocity_limit, self.velocity_limit)",
                "clamp(reachable, -f64::MAX, f64::MAX)",
            ),
        ],
    ),
    (
        "nothing limits the acceleration of the motors",
        &[NO_MOTORS, (MOTORS, "            velocity + self.acceleration", "            f64::MAX")],
    ),
    (
        "the gate is as fast after a stop as before it",
        &[(
            GATE,
            "stop(axes)?;\n            self.note(step);",
            "stop(axes)?;\n            self.steps[0] = step.map(|_| 1.0);",
        )],
    ),
    (
        "the gate does not check the angular acceleration",
        &[(BOUNDS, "self.line as f64 + STEP_TOLERANCE;", "self.line as f64 + 1.0;")],
    ),
    (
        "the blend of a swap feeds back to the goal of a rate",
        &[(
            GOALS,
            "let left = self.joints.remaining_motion(&self.axes.setpoints());",
            "let left = self.joints.setpoint().map(|at| zip_map(&from, &at, |from, at| from - at))\
             .ok_or(());",
        )],
    ),
    (
        "the goal of a rate runs ahead of a snake that cannot keep up",
        &[(GOALS, "let back = if ahead > most {", "let back = if ahead > 1e9 * most {")],
    ),
    (
        "a border that jumps moves the goal along",
        &[(GOALS, "&reached.goal, share);", "&reached.goal, share + 1.0);")],
    ),
    (
        "a goal is integrated from stamps that run backwards",
        &[
            (STAMPS, "if stamp < self.stamp {", "if stamp < self.stamp && sequence == 0 {"),
            (GOALS, "begin = self.stamp.max(before.stamp);", "begin = self.stamp;"),
        ],
    ),
    (
        "a stop does not end a session",
        &[(SESSIONS, "|client| client.has_ended = true", "|client| client.has_ended |= false")],
    ),
    (
        "a stream during a pause does not count as refused for the state",
        &[(SESSIONS, "|= of_state.contains(&refusal)", "|= of_state.is_empty()")],
    ),
    (
        "nothing checks regions of the tip",
        &[(
            REGIONS,
            "(distance, [along(pitch), along(yaw), 0.0])",
            "(distance.max(1.0), [along(pitch), along(yaw), 0.0])",
        )],
    ),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn every_deliberate_defect_fits_the_source() {
    for (name, edits) in DEFECTS {
        for (file, from, _) in edits {
            let source = fs::read_to_string(root().join(file)).unwrap();
            assert_eq!(source.matches(from).count(), 1, "{name}: {from}");
        }
    }
}

fn output(command: &mut Command) -> (bool, String) {
    let output = command.output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8_lossy(&text).into_owned())
}

/// Copies the files known to git. Unchanged files are left alone, so they are not rebuilt.
fn copy(to: &Path) {
    let (_, files) = output(Command::new("git").arg("ls-files").current_dir(root()));
    for file in files.lines() {
        let Ok(content) = fs::read(root().join(file)) else { continue };
        let target = to.join(file);
        if fs::read(&target).is_ok_and(|former| former == content) {
            continue;
        }
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        fs::write(target, content).unwrap();
    }
}

/// Draws up to two million ticks in a copy of the sources. Returns success and output of the test.
fn draw(folder: &Path) -> (bool, String) {
    let (found, text) = output(
        Command::new(env!("CARGO"))
            .args(["test", "--locked", "-p", "i2ris", "--test", "simulated", "--"])
            .args(["--ignored", "--nocapture", "pairs_of_a_million"])
            .env("CARGO_TARGET_DIR", folder.join("target"))
            .env("I2RIS_TICKS", "2000000")
            .env("I2RIS_FIRST", "")
            .env_remove("I2RIS_SEED")
            .current_dir(folder.join("source")),
    );
    assert!(text.contains("situations of"), "not built: {text}");
    (found, text)
}

#[test]
#[ignore = "builds the controller again for every defect: for .ci/nightly"]
fn every_deliberate_defect_in_the_order_of_filters_is_found() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("defects");
    let mut missed = Vec::new();
    for (name, edits) in DEFECTS {
        copy(&folder.join("source"));
        for (file, from, to) in edits {
            let file = folder.join("source").join(file);
            fs::write(&file, fs::read_to_string(&file).unwrap().replace(from, to)).unwrap();
        }
        let (is_passed, text) = draw(&folder);
        let seeds = text.lines().find(|line| line.starts_with("seeds")).unwrap_or("not found");
        println!("{name}: {seeds}");
        if is_passed {
            missed.push(name);
        }
    }
    copy(&folder.join("source"));
    assert!(missed.is_empty(), "not found: {missed:?}");
    assert!(draw(&folder).0, "without a defect nothing is found");
}
