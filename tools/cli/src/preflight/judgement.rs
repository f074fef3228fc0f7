//! Go or no-go: what was measured, judged. Pure.

use i2ris::ipc::watchdog_presence::WatchdogStatus;

use super::motion::{Motion, Pair, Seen};
use crate::doctor::report::Report;

/// A model that is older was calibrated on another snake, or might as well have been, days.
const OLDEST_MODEL_DAYS: f64 = 30.0;
/// A recording of an hour with pictures, and its black boxes, MB.
const LEAST_FREE_MB: f64 = 2000.0;
/// Run log and camera name instants: no further off than this, s.
const MOST_CLOCK_STEP_S: f64 = 2.0;
/// A frame is here so soon after its exposure, s.
const CAMERA_LATE_S: std::ops::RangeInclusive<f64> = -0.005..=0.5;
const LEAST_FRAMES_PER_S: f64 = 8.0;
const LEAST_SEEN: f64 = 0.8;
/// What one frame may scatter by at rest, deg.
const MOST_SCATTER_DEG: f64 = 0.2;
/// Encoders behind their setpoints, s, beside what the line takes to write one and to read one.
const LATEST_FOLLOW_S: f64 = 0.015;
/// Camera behind the estimate, s. Motors within their limits cross a gap that is wider or narrower
/// than the model's later or earlier, which looks like this.
const LATEST_STAMP_S: f64 = 0.1;
/// What the encoders show of the motion of the setpoints.
const LEAST_FOLLOWED: f64 = 0.8;
/// Less than this of what the model says, with both motors, is no motion; more is another snake.
const LEAST_GAIN: f64 = 0.25;
const MOST_GAIN: f64 = 1.6;
/// One motor beside the other: with less of it a wire is slack; with less, the snake is another.
const WEAK: f64 = 0.6;
const EQUAL: f64 = 0.75;
/// Seen per motion of a camera whose scale is right; of any that is near where all scales meet,
/// deg.
const RIGHT_SCALE: std::ops::RangeInclusive<f64> = 0.92..=1.2;
const SCALE_OF_ANY: std::ops::RangeInclusive<f64> = 0.8..=1.45;
const FAR_DEG: f64 = 2.0;
/// What a wrong scale adds to a pose, and how much the motors may differ in it.
const LEAST_MORE: f64 = 0.12;
const EVEN: f64 = 0.15;
/// Of a motor that the other one turns with, or in its place.
const MOST_CROSS: f64 = 0.22;
/// Lost motion that the model does not know, counts.
const MOST_LOST: f64 = 60.0;
/// Between camera and model, deg.
const MOST_OFFSET_DEG: f64 = 1.0;

const SWAPPED: &str = "find what is swapped (plugs of motors, wires, views of the camera) or turns \
                       the other way: move one motor (`i2ris command motor 0 20`), change it back";
const CALIBRATE: &str = "calibrate this snake: `i2ris calibrate`";
pub const CAMERA: &str = "start a camera: `python -m i2ris.markers --publish`";
pub const CONDITION: &str = "`i2ris command state condition`";
pub const PICTURE: &str = "light, focus and marker: look at its picture";
const LOOSE: &str = "look for play: turn the shaft of each motor by hand, and feel where gear, \
                     coupling and wires follow late; mend that, then calibrate";
const SCALE: &str = "look at magnification, distance and scale of the camera; if they are right, \
                     calibrate this snake";
const STRAIGHTEN: &str = "straighten the snake, then `i2ris home`; if it is off again, tighten the \
                          coupling of that motor";
const STAMPS: &str = "stamp frames at the exposure, with the monotonic clock of this computer";

/// Everything that is judged.
#[derive(Debug, Clone)]
pub struct Measured {
    /// Settings of the drives that differ from those of the calibration.
    pub drive_differences: Vec<String>,
    /// Since the recording of the model; `None`: not known. Starts of a controller with it.
    pub model_days: Option<f64>,
    pub model_runs: usize,
    pub is_memory_known: bool,
    pub is_homed: bool,
    /// Where the motors are, counts.
    pub counts: [i32; 2],
    /// Of each port: its device, the age of the positions in the middle and the greatest that the
    /// line should have, s.
    pub lines: Vec<(String, [f64; 2])>,
    /// `None`: nothing publishes.
    pub camera: Option<CameraFacts>,
    /// Of the folder of records; `None`: it is not there, or cannot be written.
    pub free_mb: Option<f64>,
    /// Of the wall clock since the controller began to log, s.
    pub clock_step_s: f64,
    /// Scheduling of the loop: priority asked and granted.
    pub priority: [u32; 2],
    pub watchdog: WatchdogStatus,
    pub swing: Swing,
}

#[derive(Debug, Clone, Copy)]
pub struct CameraFacts {
    pub frames_per_s: f64,
    /// Share of the frames with angles.
    pub seen: f64,
    /// From the stamp to the arrival, in the middle, s.
    pub late_s: f64,
    /// What one frame scatters by at rest, deg; 0 only where all frames show the same.
    pub scatter_deg: f64,
}

impl CameraFacts {
    /// A live picture never shows the same to the last digit.
    pub fn is_alive(self) -> bool {
        self.scatter_deg > 0.0 || self.seen < LEAST_SEEN
    }

    pub fn is_sharp(self) -> bool {
        self.scatter_deg <= MOST_SCATTER_DEG
    }
}

/// What came of the motion.
#[derive(Debug, Clone)]
pub enum Swing {
    /// Why there was none, and what to do.
    None([String; 2]),
    /// It was stopped: where the camera saw the snake, and where the goal was, from the start, deg.
    TooFar([Pair; 2]),
    Done(Motion),
    /// Without a camera; whether a person saw what was expected.
    ByEye(Motion, bool),
}

/// A line each; a failure is a no-go.
pub fn judge(measured: &Measured) -> Report {
    let mut report = Report::default();
    judge_computer(measured, &mut report);
    judge_robot(measured, &mut report);
    let is_camera_right = judge_camera(measured, &mut report);
    let line_s = measured.lines.iter().map(|(_, [age_s, _])| *age_s).fold(0.0, f64::max);
    match &measured.swing {
        Swing::None([why, fix]) => report.fail("motion", why, fix),
        _ if !is_camera_right => {
            let found = "not judged: what the camera shows is not right";
            report.warn("motion", found, "mend the camera, then run it again");
        }
        Swing::TooFar([seen, goal]) => {
            let found = format!(
                "stopped at {:+.1} {:+.1} deg from the start, where {:+.1} {:+.1} were asked",
                seen[0], seen[1], goal[0], goal[1]
            );
            // More than 60 deg beside the direction that was asked for.
            match seen.dot(goal) < 0.5 * seen.norm() * goal.norm() {
                true => report.fail("motors", found, SWAPPED),
                false => report.fail("snake", found, CALIBRATE),
            }
        }
        Swing::Done(motion) => {
            if !judge_motion(motion, line_s, &mut report) {
                report.pass("motion", describe(motion));
            }
        }
        Swing::ByEye(_, false) => {
            let fix = "look at wires and couplings, then calibrate";
            report.fail("motion", "a person saw something else than was expected", fix);
        }
        Swing::ByEye(motion, true) => {
            judge_follow(motion, line_s, &mut report);
            let found = "seen by eye only: loop width, offset and lag are not known";
            report.warn("motion", found, "a camera tells: `python -m i2ris.markers`");
        }
    }
    report
}

fn check(report: &mut Report, name: &str, is_good: bool, found: String, fix: &str) {
    if is_good { report.pass(name, found) } else { report.fail(name, found, fix) }
}

fn judge_computer(measured: &Measured, report: &mut Report) {
    let free = measured.free_mb;
    let found = free.map_or("no folder of records that can be written".to_owned(), |free| {
        format!("{free:.0} MB free for records")
    });
    check(
        report,
        "disk",
        free >= Some(LEAST_FREE_MB),
        found,
        "make room, or another record_folder",
    );
    let step_s = measured.clock_step_s;
    let found = format!("the wall clock was set by {step_s:+.0} s since the controller started");
    let fix = "start the controller again, so that its logs have one time";
    check(report, "clock", step_s.abs() <= MOST_CLOCK_STEP_S, found, fix);
    for (device, ages_s) in &measured.lines {
        let [age, longest] = ages_s.map(|age| age * 1e3);
        let found =
            format!("{device}: positions are {age:.0} ms old, {longest:.0} at most expected");
        check(report, "line", age <= longest, found, "its latency timer: `i2ris doctor`");
    }
    let [asked, granted] = measured.priority;
    if granted < asked {
        let fix = "install config/system/limits.conf, then log in again";
        report.warn("real time", format!("priority {granted} of {asked}"), fix);
    }
    let watchdog = measured.watchdog;
    let fix = "start `i2ris-watchdog` with the configuration of the controller";
    let is_good = watchdog == WatchdogStatus::Watching;
    check(report, "watchdog", is_good, format!("{watchdog:?}"), fix);
}

fn judge_robot(measured: &Measured, report: &mut Report) {
    let (runs, [first, second]) = (measured.model_runs, measured.counts);
    match measured.model_days {
        Some(days) => {
            let found = format!("recorded {days:.0} days ago, {runs} starts with it");
            check(report, "model", days <= OLDEST_MODEL_DAYS, found, CALIBRATE);
        }
        None => report.warn("model", format!("of unknown age, {runs} starts with it"), CALIBRATE),
    }
    let found = format!("hysteresis memory known: {}", measured.is_memory_known);
    check(report, "memory", measured.is_memory_known, found, CONDITION);
    if let [first, more @ ..] = &measured.drive_differences[..] {
        let found = format!("not as at the calibration: {first}, and {} more", more.len());
        report.fail("drive gains", found, "set them back, or calibrate: `i2ris drives`");
    }
    let found = match measured.is_homed {
        true => format!("motors at {first} and {second} counts from it"),
        false => "not known".to_owned(),
    };
    check(report, "zero", measured.is_homed, found, "straighten the snake, then `i2ris home`");
}

/// Whether what it shows can be compared.
fn judge_camera(measured: &Measured, report: &mut Report) -> bool {
    let Some(camera) = measured.camera else {
        report.warn("camera", "none publishes", CAMERA);
        return true;
    };
    let CameraFacts { frames_per_s, seen, late_s, scatter_deg } = camera;
    let (late, share) = (late_s * 1e3, 100.0 * seen);
    if !camera.is_alive() {
        let found = "every frame shows the same angles to the last digit: the picture stands still";
        report.fail("camera", found, "start the camera program again, and look at its picture");
        return false;
    }
    let is_in_time = CAMERA_LATE_S.contains(&late_s);
    if !is_in_time {
        report.fail("clock", format!("frames are {late:.0} ms older than their stamps"), STAMPS);
    }
    let found = format!(
        "{frames_per_s:.0} frames/s, {share:.0} % with angles within {scatter_deg:.2} deg, {late:.0} \
         ms late"
    );
    let is_good = frames_per_s >= LEAST_FRAMES_PER_S && seen >= LEAST_SEEN && camera.is_sharp();
    check(report, "camera", is_good, found, PICTURE);
    is_in_time && is_good
}

fn describe(Motion { seen, follow_s, .. }: &Motion) -> String {
    let follow = format!("encoders {:.0} ms behind", follow_s * 1e3);
    seen.as_ref().map_or(follow.clone(), |seen| {
        let (offset, width) = (seen.offset_deg, seen.width_deg.abs());
        format!(
            "offset {:+.2} {:+.2} deg, loop {:.2} {:.2} deg wide, camera {:.0} ms late, {follow}",
            offset[0],
            offset[1],
            width[0],
            width[1],
            seen.late_s * 1e3
        )
    })
}

fn judge_follow(motion: &Motion, line_s: f64, report: &mut Report) -> bool {
    let Motion { follow_s, followed, .. } = motion;
    let latest_s = LATEST_FOLLOW_S + 2.0 * line_s;
    let is_right = *followed >= LEAST_FOLLOWED && follow_s.abs() <= latest_s;
    if !is_right {
        let found = format!(
            "the encoders are {:.0} ms behind the setpoints, and show {:.0} % of their motion",
            follow_s * 1e3,
            100.0 * followed
        );
        report.fail("drive gains", found, "compare the drives: `i2ris drives`; tune them");
    }
    is_right
}

/// Whether something was found. What explains the rest is named alone.
fn judge_motion(motion: &Motion, line_s: f64, report: &mut Report) -> bool {
    if !judge_follow(motion, line_s, report) {
        return true;
    }
    let Some(seen) = &motion.seen else {
        report.fail("camera", "too few frames of the motion", PICTURE);
        return true;
    };
    let fault = fault(seen);
    if let Some((name, found, fix)) = &fault {
        // Of no motion no lag is known.
        let more = if *name == "gear" { String::new() } else { format!("; {}", describe(motion)) };
        report.fail(*name, format!("{found}{more}"), *fix);
    }
    fault.is_some()
}

/// Whether a camera of this scale would explain what is seen. It makes an offset, too: as much more
/// of where the snake is.
fn is_scaled(seen: &Seen, scale: f64) -> bool {
    let (place, offset) = (seen.place_deg, seen.offset_deg);
    if place.norm() < FAR_DEG {
        return !SCALE_OF_ANY.contains(&scale);
    }
    let more = place.dot(&offset) / place.norm_squared();
    let is_along = (offset - more * place).norm() < 0.5 * offset.norm();
    let is_more = more.abs() > LEAST_MORE && more * (scale - 1.0) > 0.0;
    !RIGHT_SCALE.contains(&scale) && is_along && is_more
}

/// What is wrong between motors and picture. First what makes the rest meaningless: nothing moves,
/// axes or signs are others, the scale is another, the stamps are late; the last only where the
/// motion has its size. Then the motors of which the model is not right.
fn fault(seen: &Seen) -> Option<(&'static str, String, &'static str)> {
    let (gain, lost) = (seen.gain, seen.lost_counts);
    let (motors, cross) = (gain.diagonal(), gain[(0, 1)].abs().max(gain[(1, 0)].abs()));
    let (low, high, scale) = (motors.min(), motors.max(), motors.mean());
    let shown = format!(
        "of what the model says the snake shows {:.2} with motor 0, {:.2} with motor 1",
        motors[0], motors[1]
    );
    if motors.amax().max(cross) < LEAST_GAIN {
        let found = format!("the motors turn, and the snake hardly moves: {shown}");
        return Some(("gear", found, LOOSE));
    }
    if cross > motors.amax() || low < -0.3 {
        let found = format!("swapped, or turned the other way: {shown}");
        return Some(("motors", found, SWAPPED));
    }
    if high - low < EVEN * scale && cross < EVEN * scale && is_scaled(seen, scale) {
        let found = format!("both axes show {scale:.2} times what the model says");
        return Some(("camera", found, SCALE));
    }
    let is_whole = cross < MOST_CROSS && low > 0.5 && high < MOST_GAIN;
    if is_whole && seen.late_s.abs() > LATEST_STAMP_S {
        return Some(("clock", format!("stamps are {:.0} ms late", seen.late_s * 1e3), STAMPS));
    }
    let is_other = cross > MOST_CROSS || low < EQUAL * high || high > MOST_GAIN;
    // A motor that shows too little beside the other one, or loses more.
    match [0, 1].map(|motor| motors[motor] < WEAK * high || lost[motor] > MOST_LOST) {
        [true, true] => Some(("snake", shown, CALIBRATE)),
        [false, false] if is_other => Some(("snake", shown, CALIBRATE)),
        [false, false] if seen.offset_deg.norm() > MOST_OFFSET_DEG => {
            let motor = seen.offset_counts.iamax();
            let found = format!(
                "motor {motor} is {:+.0} counts off: the snake was bent at `i2ris home`, or a \
                 coupling has slipped",
                seen.offset_counts[motor]
            );
            Some(("zero", found, STRAIGHTEN))
        }
        [false, false] => None,
        [first, _] => {
            let motor = usize::from(!first);
            let found = format!("motor {motor} loses {:.0} counts more; {shown}", lost[motor]);
            Some(("wire", found, "tighten the wire, then calibrate"))
        }
    }
}
