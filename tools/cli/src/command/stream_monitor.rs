//! Checks the response of the controller to a stream of commands.

use i2ris::clock;
use i2ris::ipc::payload::{JointState, OperatingStateMsg};
use i2ris::ipc::{Fault, Message, OperatingState, Refusal};
use i2ris::robot::{Cause, Reason};
use i2ris::units::Nanos;

use super::trajectory::Angles;
use crate::trajectory_time::LONGEST_STEP_S;
use i2ris_terminal::Failure;

/// Time without an accepted command, and age of the state, at which the program gives up.
const TIMEOUT: Nanos = Nanos::from_millis(1000);
/// Set-points that do not change for so long are at rest, and how often they are read.
const REST: Nanos = Nanos::from_millis(100);
const REST_POLL: Nanos = Nanos::from_millis(5);
/// Time after which the same refusal is reported again.
const REPEAT_PERIOD: Nanos = Nanos::from_millis(1000);

/// Printed when a stream goes on from the set-point.
pub const LOST_SETPOINT: &str = "the controller has stopped the snake, because commands came late \
     or none were read; the motion goes on from where it is";

/// Why a stream of commands ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StopReason {
    /// The controller is in FAULT.
    #[error(
        "the controller is in FAULT: {}",
        Reason::from(Cause::Fault(*.0))
    )]
    Fault(Fault),
    /// The controller is not in ENABLED.
    #[error(
        "the controller is {0}, not ENABLED; add --enable, or run `i2ris command state enable`"
    )]
    NotEnabled(OperatingState),
    /// The controller left ENABLED during the stream.
    #[error(
        "the controller has become {0} meanwhile: somebody has paused, disabled or ended it; the \
         snake holds"
    )]
    LeftEnabled(OperatingState),
    /// An axis does not know its zero, and homing was not asked for.
    #[error(
        "the robot is not homed: its zero is not known. Homing makes the present pose the zero: \
         straighten the snake, then add --home, or run `i2ris command state home`"
    )]
    NotHomed,
    /// A state number of another release.
    #[error(
        "the controller reports state {0}, which this program does not know; build both from one \
         release"
    )]
    Unknown(u32),
    /// Another client commands.
    #[error(
        "client {0:016x} holds the lease; end that program first, or wait until it falls silent"
    )]
    Lease(u64),
    /// Another client has taken the lease.
    #[error("lost the lease to client {0:016x}")]
    LostLease(u64),
    /// Every command is refused.
    #[error(
        "the controller refuses every command: {}",
        Reason::from(Cause::Refusal(*.0))
    )]
    Refused(Refusal),
    /// No command is accepted, and none is refused.
    #[error("the controller accepts no command; see its log")]
    Ignored,
    /// The state is too old.
    #[error("the controller has not reported its state for more than a second; see its log")]
    Silent,
    /// The controller was restarted.
    #[error("the controller was restarted; check the robot before you continue")]
    Restarted,
}

/// Checks that commands are followed in this state.
pub fn enabled(state: &OperatingStateMsg) -> Result<(), StopReason> {
    match OperatingState::from_number(state.state) {
        Some(OperatingState::Enabled) => Ok(()),
        Some(OperatingState::Fault) => Err(StopReason::Fault(
            Fault::from_number(state.fault).unwrap_or(Fault::None),
        )),
        Some(other) => Err(StopReason::NotEnabled(other)),
        None => Err(StopReason::Unknown(state.state)),
    }
}

/// Checks the controller's response to one stream of commands.
#[derive(Debug)]
pub struct StreamMonitor {
    client_id: u64,
    boot_id: u64,
    had_lease: bool,
    accepted: u64,
    accepted_at: Nanos,
    refused: u64,
    /// Why the newest commands are refused.
    refused_now: Option<Refusal>,
    /// What had been accepted when the stream began, or began again.
    accepted_at_start: u64,
    reported: Option<(Refusal, Nanos)>,
}

impl StreamMonitor {
    /// Starts with `state`, received at `now`.
    pub fn new(client_id: u64, state: &OperatingStateMsg, now: Nanos) -> Self {
        Self {
            client_id,
            boot_id: state.boot_id,
            had_lease: false,
            accepted: state.accepted,
            accepted_at: now,
            refused: state.refusals_of(client_id).0,
            refused_now: None,
            accepted_at_start: state.accepted,
            reported: None,
        }
    }

    /// Whether commands that were followed are refused now, because the controller stopped the
    /// snake meanwhile and they went on without it.
    pub fn has_lost_setpoint(&self) -> bool {
        self.refused_now == Some(Refusal::Step) && self.accepted > self.accepted_at_start
    }

    /// Begins again with `state`, received at `now`: the next command starts at the set-point.
    pub fn restart(&mut self, state: &OperatingStateMsg, now: Nanos) {
        self.accepted = state.accepted;
        self.accepted_at_start = state.accepted;
        self.accepted_at = now;
        self.refused = state.refusals_of(self.client_id).0;
        self.refused_now = None;
    }

    /// Checks the newest state. Returns a refusal that is to be reported.
    pub fn check(
        &mut self,
        state: &OperatingStateMsg,
        now: Nanos,
    ) -> Result<Option<Refusal>, StopReason> {
        if state.boot_id != self.boot_id {
            return Err(StopReason::Restarted);
        }
        if state.age(now) > TIMEOUT {
            return Err(StopReason::Silent);
        }
        enabled(state).map_err(|stop| match stop {
            StopReason::NotEnabled(state) => StopReason::LeftEnabled(state),
            other => other,
        })?;
        self.check_lease(state.lease_client_id)?;
        let refusal = self.update_counters(state, now);
        self.check_progress(now)?;
        Ok(refusal.filter(|refusal| self.is_worth_reporting(*refusal, now)))
    }

    fn check_lease(&mut self, holder: u64) -> Result<(), StopReason> {
        self.had_lease |= holder == self.client_id;
        match holder {
            0 => Ok(()),
            holder if holder == self.client_id => Ok(()),
            holder if self.had_lease => Err(StopReason::LostLease(holder)),
            holder => Err(StopReason::Lease(holder)),
        }
    }

    fn update_counters(&mut self, state: &OperatingStateMsg, now: Nanos) -> Option<Refusal> {
        if state.accepted > self.accepted {
            self.accepted = state.accepted;
            self.accepted_at = now;
            self.refused_now = None;
        }
        // Refusals of other clients' commands are not this client's concern.
        let (refused, reason) = state.refusals_of(self.client_id);
        // The count starts again when others needed its entry.
        if refused == 0 || refused == self.refused {
            return None;
        }
        self.refused = refused;
        self.refused_now = Some(reason);
        Some(reason)
    }

    fn check_progress(&self, now: Nanos) -> Result<(), StopReason> {
        if now.since(self.accepted_at) <= TIMEOUT {
            return Ok(());
        }
        Err(self
            .refused_now
            .map_or(StopReason::Ignored, StopReason::Refused))
    }

    fn is_worth_reporting(&mut self, refusal: Refusal, now: Nanos) -> bool {
        let repeated = self
            .reported
            .is_some_and(|(reported, when)| reported == refusal && now.since(when) < REPEAT_PERIOD);
        if !repeated {
            self.reported = Some((refusal, now));
        }
        !repeated
    }
}

/// Waits until the set-points rest, and returns them.
pub fn wait_for_rest<T: PartialEq>(
    mut read: impl FnMut() -> Result<T, Failure>,
) -> Result<T, Failure> {
    let start = clock::now();
    let (mut setpoints, mut changed) = (read()?, start);
    loop {
        clock::sleep(REST_POLL);
        let (newest, now) = (read()?, clock::now());
        if newest != setpoints {
            (setpoints, changed) = (newest, now);
        }
        // Set-points that somebody else moves are noticed by the lease.
        if now.since(changed) > REST || now.since(start) > TIMEOUT {
            return Ok(setpoints);
        }
    }
}

/// Sums up the distance of the snake from what was asked, by the model's estimate from the
/// encoders.
#[derive(Debug, Default)]
pub struct TrackingSummary {
    samples: u64,
    squares: f64,
    largest: f64,
}

impl TrackingSummary {
    /// Adds one pair: asked (deg) and measured.
    pub fn record(&mut self, asked: Angles, measured: &JointState) {
        if measured.flags & JointState::VALID == 0 {
            return;
        }
        let error = distance_deg(asked, measured);
        self.samples += 1;
        self.squares += error * error;
        self.largest = self.largest.max(error);
    }

    /// One line; `None` without samples.
    pub fn summary(&self) -> Option<String> {
        if self.samples == 0 {
            return None;
        }
        let rms = (self.squares / self.samples as f64).sqrt();
        let largest = self.largest;
        Some(format!(
            "followed within {rms:.2} deg RMS, {largest:.2} deg at most, of what was asked, by the \
             model's own estimate"
        ))
    }
}

/// Notices stops by late commands, which shift a trajectory in time.
#[derive(Debug)]
pub struct LateMonitor {
    stale_stops: u64,
    shift_s: f64,
}

impl LateMonitor {
    /// Starts with `state`.
    pub fn new(state: &OperatingStateMsg) -> Self {
        Self {
            stale_stops: state.stale_stops,
            shift_s: 0.0,
        }
    }

    /// Adds a step of time, s. What is longer than a step of the trajectory shifts it.
    pub fn record_step(&mut self, step_s: f64) {
        self.shift_s += (step_s - LONGEST_STEP_S).max(0.0);
    }

    /// Checks the newest state while this client commands. Returns a sentence after a stop.
    pub fn check(&mut self, state: &OperatingStateMsg) -> Option<String> {
        let stops = state.stale_stops.saturating_sub(self.stale_stops);
        self.stale_stops = state.stale_stops;
        (stops > 0).then(|| {
            format!(
                "the controller has stopped the snake in between: commands came late; the \
                 trajectory is {:.2} s behind its times",
                self.shift_s
            )
        })
    }
}

/// Notices poses that the controller clips to what the snake can reach.
#[derive(Debug)]
pub struct ClipMonitor {
    /// Goals from before belong to another client.
    since: Nanos,
    is_clipped: bool,
    /// A virtual fixture limits the newest goal.
    is_fixture: bool,
    /// The hull or the position limits clipped some goal.
    was_clipped: bool,
    reported: Option<Nanos>,
    farthest_deg: f64,
}

/// Why a stream that went to its end is no success.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "out of reach: the snake stayed up to {farthest_deg:.1} deg away from what was asked; stay \
     inside the calibrated hull, the position limits and the virtual fixtures, or calibrate a \
     wider range"
)]
pub struct OutOfReach {
    /// Largest distance between what was asked and the goal of the controller, deg.
    pub farthest_deg: f64,
}

impl ClipMonitor {
    /// Starts at `since`.
    pub fn new(since: Nanos) -> Self {
        Self {
            since,
            is_clipped: false,
            is_fixture: false,
            was_clipped: false,
            reported: None,
            farthest_deg: 0.0,
        }
    }

    /// Checks the newest goal of the controller. Returns a line to print when clipping begins, at
    /// most once a second.
    pub fn check(&mut self, asked: Angles, goal: &JointState, now: Nanos) -> Option<String> {
        let is_new = goal.stamp_ns > self.since.0;
        self.is_fixture = is_new && goal.flags & JointState::FIXTURE != 0;
        if !is_new || goal.flags & (JointState::CLIPPED | JointState::FIXTURE) == 0 {
            self.is_clipped = false;
            return None;
        }
        let began = !std::mem::replace(&mut self.is_clipped, true);
        let away = distance_deg(asked, goal);
        self.farthest_deg = self.farthest_deg.max(away);
        let due = |last: Nanos| now.since(last) >= REPEAT_PERIOD;
        if !began || !self.reported.is_none_or(due) {
            return None;
        }
        self.reported = Some(now);
        self.was_clipped |= !self.is_fixture;
        let why = if self.is_fixture {
            "a virtual fixture is in the way"
        } else {
            "out of reach"
        };
        let [pitch, yaw, _] = goal.position.map(f64::to_degrees);
        Some(format!(
            "{why}: pitch, yaw {:+.2} {:+.2} deg asked; the robot goes no further than \
             about {pitch:+.2} {yaw:+.2} deg",
            asked[0], asked[1]
        ))
    }

    /// Whether everything that was asked was within reach.
    pub fn outcome(&self) -> Result<(), OutOfReach> {
        match self.reported {
            // A fixture may only slow the snake down: what counts is the end.
            Some(_) if self.was_clipped || self.is_fixture => Err(OutOfReach {
                farthest_deg: self.farthest_deg,
            }),
            Some(_) | None => Ok(()),
        }
    }
}

fn distance_deg(asked: Angles, joint: &JointState) -> f64 {
    let [pitch, yaw, _] = joint.position.map(f64::to_degrees);
    (asked[0] - pitch).hypot(asked[1] - yaw)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ME: u64 = 7;
    const OTHER: u64 = 8;

    fn state(now: Nanos) -> OperatingStateMsg {
        OperatingStateMsg {
            stamp_ns: now.0,
            boot_id: 1,
            state: OperatingState::Enabled.number(),
            ..OperatingStateMsg::default()
        }
    }

    fn at(milliseconds: u64) -> Nanos {
        Nanos::from_millis(10_000 + milliseconds)
    }

    /// After this number of refused commands of one client.
    fn refused_state(now: Nanos, client_id: u64, count: u64, reason: Refusal) -> OperatingStateMsg {
        let mut state = OperatingStateMsg {
            refused: count,
            last_refusal: reason.number(),
            ..state(now)
        };
        state.refused_client_id[3] = client_id;
        state.refused_commands[3] = count;
        state.refused_reason[3] = reason.number();
        state
    }

    fn monitor() -> StreamMonitor {
        StreamMonitor::new(ME, &state(at(0)), at(0))
    }

    #[test]
    fn accepted_commands_are_not_reported() {
        let mut monitor = monitor();
        for step in 1..300 {
            let now = at(step * 10);
            let state = OperatingStateMsg {
                accepted: step,
                lease_client_id: ME,
                ..state(now)
            };
            assert_eq!(monitor.check(&state, now), Ok(None));
        }
    }

    #[test]
    fn a_refusal_is_reported_once_a_second() {
        let mut monitor = monitor();
        let mut reported = 0;
        for step in 1..=250 {
            let now = at(step * 10);
            let refusal = Refusal::Step;
            let state = OperatingStateMsg {
                accepted: step,
                ..refused_state(now, ME, step, refusal)
            };
            reported += u64::from(monitor.check(&state, now).unwrap() == Some(Refusal::Step));
        }
        assert_eq!(reported, 3);
    }

    #[test]
    fn after_a_second_without_an_accepted_command_the_reason_is_given() {
        let mut monitor = monitor();
        let refused = |now, count| refused_state(now, ME, count, Refusal::NotHomed);
        assert_eq!(
            monitor.check(&refused(at(900), 5), at(900)),
            Ok(Some(Refusal::NotHomed))
        );
        assert_eq!(
            monitor.check(&refused(at(1100), 6), at(1100)),
            Err(StopReason::Refused(Refusal::NotHomed))
        );
        assert_eq!(
            self::monitor().check(&state(at(1100)), at(1100)),
            Err(StopReason::Ignored)
        );
    }

    #[test]
    fn a_followed_stream_that_is_refused_for_its_step_has_lost_the_setpoint() {
        let mut monitor = monitor();
        let refused = |accepted, now, count| OperatingStateMsg {
            accepted,
            ..refused_state(now, ME, count, Refusal::Step)
        };
        // Refused from the beginning: the stream does not start at the set-point.
        monitor.check(&refused(0, at(5), 1), at(5)).unwrap();
        assert!(!monitor.has_lost_setpoint());
        monitor.check(&refused(1, at(10), 1), at(10)).unwrap();
        assert!(!monitor.has_lost_setpoint());
        monitor.check(&refused(1, at(15), 2), at(15)).unwrap();
        assert!(monitor.has_lost_setpoint());
        // Refused again before anything was accepted: no third start.
        monitor.restart(&refused(1, at(900), 4), at(900));
        assert!(!monitor.has_lost_setpoint());
        monitor.check(&refused(1, at(905), 5), at(905)).unwrap();
        assert!(!monitor.has_lost_setpoint());
        assert_eq!(
            monitor.check(&refused(1, at(1910), 6), at(1910)),
            Err(StopReason::Refused(Refusal::Step))
        );
    }

    #[test]
    fn the_refusals_of_another_client_are_not_reported() {
        let mut monitor = monitor();
        for step in 1..=100 {
            let now = at(step * 10);
            let state = refused_state(now, OTHER, step, Refusal::Stamp);
            assert_eq!(monitor.check(&state, now), Ok(None));
        }
        assert_eq!(
            monitor.check(
                &refused_state(at(1100), OTHER, 200, Refusal::Stamp),
                at(1100)
            ),
            Err(StopReason::Ignored)
        );
    }

    #[test]
    fn leaving_the_enabled_state_ends_the_stream() {
        let fault = OperatingStateMsg {
            state: OperatingState::Fault.number(),
            fault: Fault::FollowingError.number(),
            ..state(at(1))
        };
        assert_eq!(
            monitor().check(&fault, at(1)),
            Err(StopReason::Fault(Fault::FollowingError))
        );
        let paused = OperatingStateMsg {
            state: OperatingState::Paused.number(),
            ..state(at(1))
        };
        assert_eq!(
            monitor().check(&paused, at(1)),
            Err(StopReason::LeftEnabled(OperatingState::Paused))
        );
        let newer = OperatingStateMsg {
            state: 77,
            ..state(at(1))
        };
        assert_eq!(monitor().check(&newer, at(1)), Err(StopReason::Unknown(77)));
    }

    #[test]
    fn a_lease_of_another_client_ends_the_stream() {
        let held_by = |client, now| OperatingStateMsg {
            lease_client_id: client,
            ..state(now)
        };
        let mut monitor = monitor();
        assert_eq!(monitor.check(&held_by(ME, at(1)), at(1)), Ok(None));
        assert_eq!(monitor.check(&held_by(0, at(2)), at(2)), Ok(None));
        assert_eq!(
            monitor.check(&held_by(OTHER, at(3)), at(3)),
            Err(StopReason::LostLease(OTHER))
        );
        assert_eq!(
            self::monitor().check(&held_by(OTHER, at(1)), at(1)),
            Err(StopReason::Lease(OTHER))
        );
    }

    #[test]
    fn an_old_state_and_a_restart_end_the_stream() {
        assert_eq!(
            monitor().check(&state(at(0)), at(1200)),
            Err(StopReason::Silent)
        );
        let restarted = OperatingStateMsg {
            boot_id: 2,
            ..state(at(1))
        };
        assert_eq!(
            monitor().check(&restarted, at(1)),
            Err(StopReason::Restarted)
        );
    }

    #[test]
    fn tracking_is_summed_up_in_degrees() {
        let joint = |pitch: f64, flags| JointState {
            position: [pitch.to_radians(), 0.0, 0.0],
            flags,
            ..JointState::default()
        };
        let mut tracking = TrackingSummary::default();
        assert_eq!(tracking.summary(), None);
        tracking.record([3.0, 0.0], &joint(0.0, JointState::VALID));
        tracking.record([4.0, 0.0], &joint(0.0, JointState::VALID));
        tracking.record([90.0, 0.0], &joint(0.0, 0));
        assert!(
            tracking
                .summary()
                .unwrap()
                .contains("3.54 deg RMS, 4.00 deg at most")
        );
    }

    #[test]
    fn clipping_is_reported_when_it_begins_and_remembered() {
        let goal = |milliseconds, flags| JointState {
            stamp_ns: at(milliseconds).0,
            position: [20_f64.to_radians(), 0.0, 0.0],
            flags,
            ..JointState::default()
        };
        let clipped = JointState::VALID | JointState::CLIPPED;
        let mut clips = ClipMonitor::new(at(0));
        // The goal of the client before.
        assert_eq!(clips.check([60.0, 0.0], &goal(0, clipped), at(1)), None);
        assert_eq!(clips.check([5.0, 0.0], &goal(2, 1), at(2)), None);
        assert_eq!(clips.outcome(), Ok(()));
        let line = clips.check([30.0, 0.0], &goal(3, clipped), at(3)).unwrap();
        assert!(line.contains("+30.00 +0.00 deg asked"), "{line}");
        assert!(line.contains("+20.00 +0.00"), "{line}");
        assert_eq!(clips.check([63.0, 0.0], &goal(4, clipped), at(4)), None);
        assert_eq!(clips.check([5.0, 0.0], &goal(5, 1), at(5)), None);
        let out_of_reach = clips.outcome().unwrap_err();
        assert!((out_of_reach.farthest_deg - 43.0).abs() < 1e-9);
    }
}
