//! The small motion: permission, commands and measurement.

use i2ris::clock;
use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::payload::{ExternalPosition, JointState, Message};
use i2ris::ipc::{OperatingState, StateCommand};
use i2ris::realtime::Ticker;
use i2ris::units::Nanos;
use i2ris_report::statistics::mean;
use i2ris_report::{Failure, Interrupt, bail, while_working};

use super::judgement::{CAMERA, CONDITION, Measured, PICTURE, Swing};
use super::motion::{LENGTH_S, Observer, Pair, Plan, Series};
use crate::command::prepare::{FIRST_MESSAGE_TIMEOUT, PrepareOptions, prepare};
use crate::command::stream::present_pose;
use crate::command::stream_monitor::{StopReason, StreamMonitor};
use crate::procedure::{Person, Terminal};

const PERIOD: Nanos = Nanos::from_millis(5);
/// Time for the last frames to arrive, s.
const LAST_FRAMES_S: f64 = 0.5;
/// Time without a camera angle after which the camera cannot limit the motion.
const BLIND: Nanos = Nanos::from_millis(1000);

/// Reasons for no motion, with remedy.
pub const NOBODY: [&str; 2] =
    ["none: no operator to ask here", "run it at a terminal, or give permission by --enable"];
const UNCONFIRMED: [&str; 2] =
    ["none: not confirmed", "run it again, and type yes when the snake may move"];
pub const PAUSED: [&str; 2] =
    ["none: a client has paused the robot", "`i2ris command state resume`, then run it again"];
const AGAIN: &str = "fix what `i2ris status` shows (also computer load), then run it again";

/// Moves, if permitted and meaningful. An obstacle is a no-go; an interrupt is an error.
pub fn run(
    client: &mut Client,
    mut options: PrepareOptions,
    measured: &Measured,
    interrupt: &Interrupt,
) -> Result<Swing, Failure> {
    let none = |[why, fix]: [&str; 2]| Ok(Swing::None([why.to_owned(), fix.to_owned()]));
    let mut person = Terminal::open(interrupt);
    if !measured.is_memory_known {
        return none(["none: the hysteresis memory of the model is unknown", CONDITION]);
    }
    if measured.camera.is_some_and(|camera| !camera.is_alive() || !camera.is_sharp()) {
        return none(["none: the camera is frozen or too noisy to limit the motion", PICTURE]);
    }
    // A script gives permission by `--enable` or `--home`.
    if !options.is_given() {
        let question = format!(
            "The snake will swing by less than 2 deg to one side and back, in pitch, then in yaw, \
             for {LENGTH_S:.0} s. The drives will be powered. Is one hand on the switch of the \
             motor supply, and the snake out of the eye?"
        );
        let Some(person) = &mut person else { return none(NOBODY) };
        if !is_yes(person, &question) {
            return none(UNCONFIRMED);
        }
        options = PrepareOptions::ENABLE;
    }
    // The permission is for an unused robot: it must not end a stream or a pause.
    let state = client.wait_for(FIRST_MESSAGE_TIMEOUT, |_| true)?;
    let holder = state.lease_client_id;
    if ![0, client.id()].contains(&holder) {
        let fix = "end that client (`i2ris status` names it), then run it again";
        return none([&format!("none: {}", StopReason::Lease(holder)), fix]);
    }
    if state.state == OperatingState::Paused.number() {
        return none(PAUSED);
    }
    let moved = swing(client, options, measured, interrupt);
    let state = client.operating_state().ok().flatten();
    let holder = state.map_or(0, |state| state.lease_client_id);
    let released = match moved {
        // Another client took the lease first.
        Err(_) if ![0, client.id()].contains(&holder) => Ok(()),
        Err(_) => client.state_command(StateCommand::Hold).map(drop),
        Ok(_) => client.state_command(StateCommand::Release).map(drop),
    };
    let observer = match moved {
        Err(failure) if interrupt.came() => return Err(failure),
        Err(failure) => return none([&failure.to_string(), AGAIN]),
        Ok(observer) => observer,
    };
    released?;
    match observer.finish() {
        _ if observer.is_too_far() => Ok(Swing::TooFar(observer.farthest)),
        None => none(["too few samples from the controller to judge it", AGAIN]),
        Some(motion) if motion.seen.is_some() || measured.camera.is_some() => {
            Ok(Swing::Done(motion))
        }
        Some(motion) => {
            let Some(person) = &mut person else {
                return none(["seen by neither operator nor camera", CAMERA]);
            };
            let question = "Did the tip swing in pitch only, then in yaw only, without a pause at \
                                            every turn, and is it back at the start?";
            Ok(Swing::ByEye(motion, is_yes(person, question)))
        }
    }
}

fn is_yes(person: &mut Terminal, question: &str) -> bool {
    person.answer(&format!("{question} Type yes.")).is_ok_and(|typed| typed == "yes")
}

fn swing(
    client: &mut Client,
    options: PrepareOptions,
    before: &Measured,
    interrupt: &Interrupt,
) -> Result<Observer, Failure> {
    let state = prepare(client, options, interrupt)?;
    let plan = Plan { start: Pair::from(present_pose(client)?) };
    let mut monitor = StreamMonitor::new(client.id(), &state, clock::now());
    let (watcher, mut commander) = (client.watcher(), client.commander());
    let (mut measured, mut motors) = (watcher.measured_js(), watcher.actuators());
    let (mut camera, mut goal) = (watcher.external(), Latest::new(watcher.goal_js()));
    let (mut observer, mut ages_ms) = (Observer::new(plan), Vec::new());
    let begin = clock::now();
    let mut shown = begin;
    let mut ticker = Ticker::new(begin, PERIOD, Nanos::ZERO);
    let time_s = |stamp: Nanos| (stamp.0 as f64 - begin.0 as f64) * 1e-9;
    let angles = |at: [f64; 3]| Pair::new(at[0].to_degrees(), at[1].to_degrees());
    while_working("the snake swings", || -> Result<(), Failure> {
        loop {
            let now_s = time_s(ticker.wait().started);
            measured.drain(|joint| {
                if joint.flags & JointState::VALID != 0 {
                    observer.see(Series::Estimate, time_s(joint.stamp()), angles(joint.position));
                }
            })?;
            motors.drain(|state| {
                let read = state.measured_stamp_ns.into_iter().filter(|it| *it > 0).min();
                let read = read.map_or(state.stamp(), Nanos);
                ages_ms.push(1e3 * state.stamp().duration_since(read).as_seconds());
                for (series, stamp, counts) in [
                    (Series::Setpoint, state.stamp(), state.setpoint_counts),
                    (Series::Encoder, read, state.measured_counts),
                ] {
                    observer.see(series, time_s(stamp), Pair::from(counts.map(f64::from)));
                }
            })?;
            camera.drain(|frame| {
                let is_angle = frame.flags & ExternalPosition::VALID != 0 && frame.count == 2;
                if is_angle && frame.stamp() > begin {
                    shown = clock::now();
                    observer.see(Series::Camera, time_s(frame.stamp()), angles(frame.position));
                }
            })?;
            if observer.is_too_far() || now_s > LENGTH_S + LAST_FRAMES_S {
                return Ok(());
            }
            if before.camera.is_some() && clock::now().duration_since(shown) > BLIND {
                bail!("the camera has shown no angle for 1 s and cannot limit the motion");
            }
            if interrupt.came() {
                bail!("interrupted; the snake stopped and holds");
            }
            commander.servo_jp(plan.goal(now_s).map(f64::to_radians).as_slice())?;
            if let Some(state) = client.operating_state()? {
                monitor.check(&state, clock::now())?;
            }
            if monitor.has_lost_setpoint() {
                bail!("commands came late, and the controller stopped the snake");
            }
            let short = JointState::CLIPPED | JointState::FIXTURE;
            let goal = goal.refresh()?.filter(|goal| goal.stamp() > begin);
            if goal.is_some_and(|goal| goal.flags & short != 0) {
                bail!("none: out of reach here; start nearer to the straight pose");
            }
        }
    })?;
    let age = mean(ages_ms).unwrap_or(0.0);
    let longest = before.lines.iter().map(|(_, [_, it])| 1e3 * it).fold(0.0, f64::max);
    if age > longest {
        bail!("positions were {age:.0} ms old in the motion; at most {longest:.0} expected");
    }
    Ok(observer)
}
