//! Go or no-go: judges the measurements. Pure.

use i2ris::ipc::watchdog_presence::WatchdogStatus;

use super::motion::{Motion, Pair, Seen};
use crate::doctor::Report;

/// Maximum age of a model, days: an older one may as well be of another snake.
const OLDEST_MODEL_DAYS: f64 = 30.0;
/// Space for an hour of recording with images, and its black boxes, MB.
const MIN_FREE_MB: f64 = 2000.0;
/// Maximum error of the wall clock in run log and camera stamps, s.
const MAX_CLOCK_STEP_S: f64 = 2.0;
/// Permitted delay of a frame after its exposure, s.
const CAMERA_LATE_S: std::ops::RangeInclusive<f64> = -0.005..=0.5;
const MIN_FRAMES_PER_S: f64 = 8.0;
const MIN_SEEN_SHARE: f64 = 0.8;
const MAX_SCATTER_DEG: f64 = 0.2;
/// Maximum lag of the encoders, s, in addition to the line latency of writing.
const LATEST_FOLLOW_S: f64 = 0.015;
/// Maximum lag of the camera, s. A gap that differs from the model's looks like a lag.
const LATEST_STAMP_S: f64 = 0.1;
/// Maximum lag of an image by play in the gears, s.
const OF_PLAY_S: f64 = 0.3;
/// Minimum encoder motion, relative to the setpoint motion.
const MIN_FOLLOWED_SHARE: f64 = 0.8;
/// Gain relative to the model: below it with both motors, no motion; outside these, another snake.
const MIN_GAIN: f64 = 0.25;
const LOW_GAIN: f64 = 0.5;
const MAX_GAIN: f64 = 1.6;
/// Gain relative to the other motor: below `WEAK`, a wire is slack; below `EQUAL`, another snake.
const WEAK: f64 = 0.6;
const EQUAL: f64 = 0.75;
/// Scale of a correct camera; and within `FAR_DEG` of the straight pose, where it matters little.
const RIGHT_SCALE: std::ops::RangeInclusive<f64> = 0.92..=1.2;
const SCALE_OF_ANY: std::ops::RangeInclusive<f64> = 0.8..=1.45;
const FAR_DEG: f64 = 2.0;
/// Minimum effect of a wrong scale on a pose, and permitted difference between motors.
const MIN_SCALE_EFFECT: f64 = 0.12;
/// Effect of a scale on a pose, relative to its effect on the motion. A wrong zero has any.
const ALIKE: std::ops::RangeInclusive<f64> = 0.4..=2.5;
const EVEN: f64 = 0.15;
/// Maximum gain from one motor to the other's axis.
const MAX_CROSS_GAIN: f64 = 0.22;
const MAX_LOST_COUNTS: f64 = 60.0;
const MAX_OFFSET_DEG: f64 = 1.0;

const SWAPPED: &str = "move one motor (`i2ris command motor 0 20`) to find what is swapped (motor \
                       plugs, wires, camera views) or turns the other way, then correct it";
const CALIBRATE: &str = "calibrate this snake: `i2ris calibrate`";
pub const CAMERA: &str = "start a camera: `python -m i2ris.markers --publish`";
pub const CONDITION: &str = "`i2ris command state condition`";
pub const PICTURE: &str = "check light, focus and marker in the camera image";
const LOOSE: &str = "look for play: turn each motor shaft by hand, and feel where gear, coupling \
                                          and wires follow late; repair it, then calibrate";
const SCALE: &str = "check magnification, distance and scale of the camera; if they are right, \
                     calibrate this snake";
const STRAIGHTEN: &str = "straighten the snake, then `i2ris home`; if it is off again, tighten the \
                          coupling of that motor";
const STAMPS: &str = "stamp frames at the exposure, with the monotonic clock of this computer";

#[derive(Debug, Clone)]
pub struct Measured {
    pub drive_differences: Vec<String>,
    /// Age of the model's recording, days; `None`: unknown.
    pub model_days: Option<f64>,
    pub model_runs: usize,
    pub is_memory_known: bool,
    pub is_homed: bool,
    pub counts: [i32; 2],
    /// For each port: device, median age of the positions, s, and the greatest to expect.
    pub lines: Vec<(String, [f64; 2])>,
    pub camera: Option<CameraFacts>,
    /// Free space for records, MB; `None`: the folder is missing or not writable.
    pub free_mb: Option<f64>,
    /// Change of the wall clock since the controller began to log, s.
    pub clock_step_s: f64,
    /// Scheduling priority of the loop: requested and granted.
    pub priority: [u32; 2],
    pub watchdog: WatchdogStatus,
    pub swing: Swing,
}

#[derive(Debug, Clone, Copy)]
pub struct CameraFacts {
    pub frames_per_s: f64,
    pub seen: f64,
    pub late_s: f64,
    /// Scatter of a frame at rest, deg; 0 only if all frames are identical.
    pub scatter_deg: f64,
}

impl CameraFacts {
    /// Whether the image is live: then frames are never identical.
    pub fn is_alive(self) -> bool {
        self.scatter_deg > 0.0 || self.seen < MIN_SEEN_SHARE
    }

    pub fn is_sharp(self) -> bool {
        self.scatter_deg <= MAX_SCATTER_DEG
    }
}

#[derive(Debug, Clone)]
pub enum Swing {
    None([String; 2]),
    /// Stopped: camera and goal relative to the start, deg.
    TooFar([Pair; 2]),
    Done(Motion),
    /// Without a camera; whether the operator saw the expected motion.
    ByEye(Motion, bool),
}

/// Makes a report line for each check; a failure is a no-go.
pub fn judge(measured: &Measured) -> Report {
    let mut report = Report::default();
    judge_computer(measured, &mut report);
    judge_robot(measured, &mut report);
    let is_camera_right = judge_camera(measured, &mut report);
    let line_s = measured.lines.iter().map(|(_, [age_s, _])| *age_s).fold(0.0, f64::max);
    match &measured.swing {
        Swing::None([why, fix]) => report.fail("motion", why, fix),
        _ if !is_camera_right => {
            let found = "not judged: the camera data are not valid";
            report.warn("motion", found, "repair the camera, then run it again");
        }
        Swing::TooFar([seen, goal]) => {
            let found = format!(
                "stopped: the tip was {:+.1} {:+.1} deg from the start, the goal {:+.1} {:+.1}",
                seen[0], seen[1], goal[0], goal[1]
            );
            // More than 60 deg off the commanded direction.
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
            let fix = "check wires and couplings, then calibrate";
            report.fail("motion", "the operator did not see the expected motion", fix);
        }
        Swing::ByEye(motion, true) => {
            judge_follow(motion, line_s, &mut report);
            let found = "seen by eye only: loop width, offset and lag are unknown";
            report.warn("motion", found, "a camera measures them: `python -m i2ris.markers`");
        }
    }
    report
}

fn check(report: &mut Report, name: &str, is_good: bool, found: String, fix: &str) {
    if is_good { report.pass(name, found) } else { report.fail(name, found, fix) }
}

fn judge_computer(measured: &Measured, report: &mut Report) {
    let free = measured.free_mb;
    let found = free.map_or("no writable folder for records".to_owned(), |free| {
        format!("{free:.0} MB free for records")
    });
    let fix = "free some space, or choose another record_folder";
    check(report, "disk", free >= Some(MIN_FREE_MB), found, fix);
    let step_s = measured.clock_step_s;
    let found = format!("the wall clock was changed by {step_s:+.0} s after the controller start");
    let fix = "restart the controller, so that all its logs use one time base";
    check(report, "clock", step_s.abs() <= MAX_CLOCK_STEP_S, found, fix);
    for (device, ages_s) in &measured.lines {
        let [age, longest] = ages_s.map(|age| age * 1e3);
        let ages = format!("positions are {age:.0} ms old; at most {longest:.0} expected");
        let fix = "check the latency timer of its adapter (`i2ris doctor`), and end other programs";
        check(report, "line", age <= longest, format!("{device}: {ages}"), fix);
    }
    let [requested, granted] = measured.priority;
    if granted < requested {
        let fix = "install config/system/limits.conf, then log in again";
        report.warn("real time", format!("priority {granted} of {requested}"), fix);
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
            let found = format!("recorded {days:.0} days ago, used in {runs} starts");
            check(report, "model", days <= OLDEST_MODEL_DAYS, found, CALIBRATE);
        }
        None => report.warn("model", format!("of unknown age, used in {runs} starts"), CALIBRATE),
    }
    let found = format!("hysteresis memory known: {}", measured.is_memory_known);
    check(report, "memory", measured.is_memory_known, found, CONDITION);
    if let [first, more @ ..] = &measured.drive_differences[..] {
        let found = format!("changed since the calibration: {first}, and {} more", more.len());
        report.fail("drive gains", found, "restore them (`i2ris doctor drives`), or calibrate");
    }
    let place = format!("motors at {first} and {second} counts from the zero");
    let found = if measured.is_homed { place } else { "unknown".to_owned() };
    check(report, "zero", measured.is_homed, found, "straighten the snake, then `i2ris home`");
}

fn judge_camera(measured: &Measured, report: &mut Report) -> bool {
    let Some(camera) = measured.camera else {
        report.warn("camera", "no camera publishes", CAMERA);
        return true;
    };
    let CameraFacts { frames_per_s, seen, late_s, scatter_deg } = camera;
    let (late, share) = (late_s * 1e3, 100.0 * seen);
    if !camera.is_alive() {
        let found = "all frames show the same angles to the last digit: the image is frozen";
        report.fail("camera", found, "restart the camera program, and look at its image");
        return false;
    }
    let is_in_time = CAMERA_LATE_S.contains(&late_s);
    if !is_in_time {
        report.fail("clock", format!("frames are {late:.0} ms older than their stamps"), STAMPS);
    }
    let found = format!(
        "{frames_per_s:.0} frames/s, {share:.0} % with angles within {scatter_deg:.2} deg, \
         {late:.0} ms late"
    );
    let is_good = frames_per_s >= MIN_FRAMES_PER_S && seen >= MIN_SEEN_SHARE && camera.is_sharp();
    check(report, "camera", is_good, found, PICTURE);
    is_in_time && is_good
}

fn describe(Motion { seen, follow_s, .. }: &Motion) -> String {
    let follow = format!("encoders {:.0} ms behind", follow_s * 1e3);
    seen.as_ref().map_or(follow.clone(), |seen| {
        let (offset, width, late_ms) = (seen.offset_deg, seen.width_deg.abs(), seen.late_s * 1e3);
        format!(
            "offset {:+.2} {:+.2} deg, loop {:.2} {:.2} deg wide, camera {late_ms:.0} ms late, \
             {follow}",
            offset[0], offset[1], width[0], width[1]
        )
    })
}

fn judge_follow(motion: &Motion, line_s: f64, report: &mut Report) -> bool {
    let Motion { follow_s, followed, .. } = motion;
    let latest_s = LATEST_FOLLOW_S + line_s;
    let is_right = *followed >= MIN_FOLLOWED_SHARE && follow_s.abs() <= latest_s;
    if !is_right {
        let (behind_ms, share) = (follow_s * 1e3, 100.0 * followed);
        let found = format!(
            "the encoders are {behind_ms:.0} ms behind the setpoints, and show {share:.0} % of \
             their motion"
        );
        let fix = "compare the drive settings (`i2ris doctor drives`), then tune them";
        report.fail("drive gains", found, fix);
    }
    is_right
}

/// Whether a fault was found. A fault that explains the rest is reported alone.
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
        // Without motion the lag is unknown.
        let more = if *name == "gear" { String::new() } else { format!("; {}", describe(motion)) };
        report.fail(*name, format!("{found}{more}"), *fix);
    }
    fault.is_some()
}

/// Whether a camera of this scale, with an offset proportional to the pose, explains it all.
fn is_scaled(seen: &Seen, scale: f64) -> bool {
    let (place, offset) = (seen.place_deg, seen.offset_deg);
    if place.norm() < FAR_DEG {
        return !SCALE_OF_ANY.contains(&scale);
    }
    let more = place.dot(&offset) / place.norm_squared();
    let is_along = (offset - more * place).norm() < 0.5 * offset.norm();
    let is_more = more.abs() > MIN_SCALE_EFFECT && ALIKE.contains(&(more / (scale - 1.0)));
    !RIGHT_SCALE.contains(&scale) && is_along && is_more
}

/// Finds the fault between motors and image. First those that make the rest meaningless: no motion,
/// wrong axes or signs, a wrong scale, late stamps. Then motors for which the model is wrong.
pub(super) fn fault(seen: &Seen) -> Option<(&'static str, String, &'static str)> {
    let (gain, lost) = (seen.gain, seen.lost_counts);
    let (motors, cross) = (gain.diagonal(), gain[(0, 1)].abs().max(gain[(1, 0)].abs()));
    let (low, high, scale) = (motors.min(), motors.max(), motors.mean());
    let [first, second] = [motors[0], motors[1]];
    let shown =
        format!("gain relative to the model: {first:.2} with motor 0, {second:.2} with motor 1");
    if motors.amax().max(cross) < MIN_GAIN {
        let found = format!("the motors turn, but the snake hardly moves: {shown}");
        return Some(("gear", found, LOOSE));
    }
    if cross > motors.amax() || low < -0.3 {
        return Some(("motors", format!("swapped, or turning the other way: {shown}"), SWAPPED));
    }
    let is_late = seen.late_s.abs() > LATEST_STAMP_S;
    if high - low < EVEN * scale && cross < EVEN * scale && !is_late && is_scaled(seen, scale) {
        let found = format!("both axes show {scale:.2} times the motion of the model");
        return Some(("camera", found, SCALE));
    }
    // Both late stamps and play in both gears leave less gain; play never has so great a lag.
    let is_even = low >= EQUAL * high && high < MAX_GAIN && cross < MAX_CROSS_GAIN;
    if is_late && is_even {
        let is_play = low < LOW_GAIN && seen.late_s.abs() < OF_PLAY_S;
        let (name, fix) = if is_play { ("gear", LOOSE) } else { ("clock", STAMPS) };
        let found = format!("the image lags by {:.0} ms; {shown}", 1e3 * seen.late_s);
        return Some((name, found, fix));
    }
    let is_other = !is_even || low < LOW_GAIN;
    // A motor that shows too little compared with the other, or loses more.
    match [0, 1].map(|motor| motors[motor] < WEAK * high || lost[motor] > MAX_LOST_COUNTS) {
        [true, true] => Some(("snake", shown, CALIBRATE)),
        [false, false] if is_other => Some(("snake", shown, CALIBRATE)),
        [false, false] if seen.offset_deg.norm() > MAX_OFFSET_DEG => {
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
            let found = format!(
                "motor {motor} loses {:.0} counts more than the model predicts; {shown}",
                lost[motor]
            );
            Some(("wire", found, "tighten the wire, then calibrate"))
        }
    }
}
