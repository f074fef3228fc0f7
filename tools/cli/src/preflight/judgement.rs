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
pub const MOST_SCATTER_DEG: f64 = 0.2;
/// Encoders behind their setpoints, s, beside what the line takes to write one and to read one.
const LATEST_FOLLOW_S: f64 = 0.015;
/// Camera behind the estimate, s. Motors within their limits cross a gap that is wider or narrower
/// than the model's later or earlier, which looks like this.
const LATEST_STAMP_S: f64 = 0.08;
/// Seen per motion that the model says, of a motor.
const RIGHT_GAIN: std::ops::RangeInclusive<f64> = 0.3..=1.6;
/// Of a motor that the other one turns with, or in its place.
const MOST_CROSS: f64 = 0.35;
/// Lost motion that the model does not know, counts.
const MOST_LOST: f64 = 60.0;
/// Between camera and model, deg.
const MOST_OFFSET_DEG: f64 = 1.0;

const SWAPPED: &str = "motors, wires or views are swapped, or turned the other way";
const CALIBRATE: &str = "calibrate this snake: `i2ris calibrate`";
const PICTURE: &str = "light, focus and marker: look at its picture";
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
    /// What one frame scatters by at rest, deg.
    pub scatter_deg: f64,
}

/// What came of the motion.
#[derive(Debug, Clone)]
pub enum Swing {
    /// Why there was none.
    None(String),
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
    judge_camera(measured, &mut report);
    let line_s = measured.lines.iter().map(|(_, [age_s, _])| *age_s).fold(0.0, f64::max);
    match &measured.swing {
        Swing::None(why) => report.fail("motion", why, "it is what shows a slow failure"),
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
    let fix = "`i2ris command state condition`";
    check(report, "memory", measured.is_memory_known, found, fix);
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

fn judge_camera(measured: &Measured, report: &mut Report) {
    let Some(CameraFacts { frames_per_s, seen, late_s, scatter_deg }) = measured.camera else {
        return report.warn("camera", "none publishes", "`python -m i2ris.markers --publish`");
    };
    let (late, share) = (late_s * 1e3, 100.0 * seen);
    if !CAMERA_LATE_S.contains(&late_s) {
        report.fail("clock", format!("frames are {late:.0} ms older than their stamps"), STAMPS);
    }
    let found = format!(
        "{frames_per_s:.0} frames/s, {share:.0} % with angles within {scatter_deg:.2} deg, {late:.0} \
         ms late"
    );
    let is_sharp = scatter_deg <= MOST_SCATTER_DEG;
    let is_good = frames_per_s >= LEAST_FRAMES_PER_S && seen >= LEAST_SEEN && is_sharp;
    check(report, "camera", is_good, found, PICTURE);
}

fn describe(Motion { seen, follow_s }: &Motion) -> String {
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
    // A motor that does not move at all has no number here.
    let is_in_time = motion.follow_s <= LATEST_FOLLOW_S + 2.0 * line_s;
    if !is_in_time {
        let found =
            format!("the encoders are {:.0} ms behind the setpoints", motion.follow_s * 1e3);
        report.fail("drive gains", found, "compare the drives: `i2ris drives`; tune them");
    }
    is_in_time
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
    let is_stamped = seen.late_s.abs() <= LATEST_STAMP_S;
    if !is_stamped {
        report.fail("clock", format!("stamps are {:.0} ms late", seen.late_s * 1e3), STAMPS);
    }
    let fault = mechanics(seen);
    if let Some((name, found, fix)) = &fault {
        report.fail(*name, format!("{found}; {}", describe(motion)), *fix);
    }
    !is_stamped || fault.is_some()
}

/// What is wrong between motors and tip, by the motors of which the model is not right.
fn mechanics(seen: &Seen) -> Option<(&'static str, String, &'static str)> {
    let (gain, lost) = (seen.gain, seen.lost_counts);
    let cross = gain[(0, 1)].abs().max(gain[(1, 0)].abs());
    let shown = format!(
        "of what the model says the snake shows {:.2} with motor 0, {:.2} with motor 1",
        gain[(0, 0)],
        gain[(1, 1)]
    );
    if cross > gain[(0, 0)].abs().max(gain[(1, 1)].abs()) || gain.diagonal().min() < -0.3 {
        return Some(("motors", shown, SWAPPED));
    }
    let off = [0, 1]
        .map(|motor: usize| !RIGHT_GAIN.contains(&gain[(motor, motor)]) || lost[motor] > MOST_LOST);
    match off {
        _ if cross > MOST_CROSS => Some(("snake", shown, CALIBRATE)),
        [true, true] => Some(("snake", shown, CALIBRATE)),
        [false, false] if seen.offset_deg.norm() > MOST_OFFSET_DEG => {
            let motor = seen.offset_counts.iamax();
            let found = format!("motor {motor} is {:+.0} counts off", seen.offset_counts[motor]);
            Some(("coupling", found, "tighten it, straighten the snake, `i2ris home`"))
        }
        [false, false] => None,
        [first, _] => {
            let motor = usize::from(!first);
            let found = format!("motor {motor} loses {:.0} counts more; {shown}", lost[motor]);
            Some(("wire", found, "tighten the wire, then calibrate"))
        }
    }
}
