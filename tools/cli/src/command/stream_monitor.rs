//! Checks the response of the controller to a stream of commands. Pure.

use i2ris::ipc::{Fault, MaskedClientId, Message, OperatingState, Refusal};
use i2ris::robot::{Cause, Reason, Stop};
use i2ris::{ipc::client::effect::SILENCE, ipc::payload::OperatingStateMsg, units::Nanos};
use i2ris_simulation::motion::trajectory_time::MAX_STEP_S;

use super::held_up::{self, HeldUp};

/// Time without an accepted command at which the program gives up.
const TIMEOUT: Nanos = Nanos::from_millis(1000);
const REPEAT_PERIOD: Nanos = Nanos::from_millis(1000);
/// Number of consecutive restarts of a stream without a followed command. A controller that
/// was delayed reads the first commands late, and then finds the newest too far away.
const RESTARTS: u32 = 10;

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StopReason {
    #[error("the controller is in FAULT: {}", Reason::from(Cause::Fault(*.0)))]
    Fault(Fault),
    #[error(
        "the controller is {}, not ENABLED; add --enable, or run {}",
        .0,
        Cause::State(*.0).advice()
    )]
    NotEnabled(OperatingState),
    #[error(
        "the controller has changed to {0}: a client has paused or disabled it, or it was shut \
         down; the snake holds"
    )]
    LeftEnabled(OperatingState),
    #[error(
        "the robot is not homed: its zero is unknown. Homing makes the present pose the zero: \
         straighten the snake, then add --home, or run `i2ris home`"
    )]
    NotHomed,
    #[error(
        "the controller reports state {0}, which is unknown to this program; build both from the \
         same release"
    )]
    Unknown(u32),
    #[error(
        "{} holds the lease; end that program first, or wait until it stops sending",
        MaskedClientId(*.0)
    )]
    Lease(u64),
    #[error("lost the lease to {}", MaskedClientId(*.0))]
    LostLease(u64),
    #[error("the controller refuses every command: {}", Reason::from(Cause::Refusal(*.0)))]
    Refused(Refusal),
    #[error("the controller stopped the snake: {}", Reason::from(Cause::Stop(*.0)))]
    Stopped(Stop),
    #[error("the controller accepts no command; see its log")]
    Ignored,
    #[error(
        "the controller has not reported its state for more than {} s; see its log",
        SILENCE.as_seconds()
    )]
    Silent,
    #[error("the controller was restarted; check the robot before you continue")]
    Restarted,
}

pub fn enabled(state: &OperatingStateMsg) -> Result<(), StopReason> {
    match OperatingState::from_number(state.state) {
        Some(OperatingState::Enabled) => Ok(()),
        Some(OperatingState::Fault) => {
            Err(StopReason::Fault(Fault::from_number(state.fault).unwrap_or(Fault::None)))
        }
        Some(other) => Err(StopReason::NotEnabled(other)),
        None => Err(StopReason::Unknown(state.state)),
    }
}

#[derive(Debug, Default)]
pub struct StreamMonitor {
    client_id: u64,
    boot_id: u64,
    had_lease: bool,
    accepted: u64,
    accepted_at: Nanos,
    refused: u64,
    ended: Option<Stop>,
    refused_now: Option<Refusal>,
    restarts_left: u32,
    /// The stream has restarted, and no command has been followed since.
    waits: bool,
    reported: Option<(Refusal, Nanos)>,
    held_up: HeldUp,
    /// Note of a stream that the computer's load has held up often, for the caller to take.
    pub load: Option<String>,
}

impl StreamMonitor {
    pub fn new(client_id: u64, state: &OperatingStateMsg, now: Nanos) -> Self {
        Self {
            client_id,
            boot_id: state.boot_id,
            accepted: state.accepted,
            accepted_at: now,
            refused: state.refusals_of(client_id).0,
            ended: state.broken_off(),
            held_up: HeldUp::new(state, now),
            ..Self::default()
        }
    }

    /// Whether followed commands are now refused: they moved on while the snake was stopped.
    pub fn has_lost_setpoint(&self) -> bool {
        self.refused_now == Some(Refusal::StepTooLarge) && self.restarts_left > 0
    }

    /// Restarts with `state`, received at `now`: the next command starts at the setpoint.
    pub fn restart(&mut self, state: &OperatingStateMsg, now: Nanos) {
        self.accepted = state.accepted;
        self.restarts_left = self.restarts_left.saturating_sub(1);
        self.accepted_at = now;
        self.refused = state.refusals_of(self.client_id).0;
        self.refused_now = None;
        self.waits = true;
    }

    /// Whether the motion may continue. After a restart it waits: late readers see a large step.
    pub fn may_continue(&self) -> bool {
        !self.waits
    }

    /// Checks the newest state. Returns a refusal to report.
    pub fn check(
        &mut self,
        state: &OperatingStateMsg,
        now: Nanos,
    ) -> Result<Option<Refusal>, StopReason> {
        if state.boot_id != self.boot_id {
            return Err(StopReason::Restarted);
        }
        if state.age(now) > SILENCE {
            return Err(StopReason::Silent);
        }
        if let Some(longest) = self.held_up.check(state, now) {
            self.load = Some(held_up::note(longest, state));
        }
        enabled(state).map_err(|stop| match stop {
            StopReason::NotEnabled(state) => StopReason::LeftEnabled(state),
            other => other,
        })?;
        self.check_lease(state.lease_client_id)?;
        let refusal = self.update_counters(state, now);
        let ended = state.broken_off().filter(|stop| self.ended != Some(*stop));
        if let (Some(Refusal::StreamInterrupted), Some(stop)) = (refusal, ended) {
            return Err(StopReason::Stopped(stop));
        }
        self.check_progress(now)?;
        Ok(refusal.filter(|refusal| self.is_worth_reporting(*refusal, now)))
    }

    fn check_lease(&mut self, holder: u64) -> Result<(), StopReason> {
        self.had_lease |= holder == self.client_id;
        match holder {
            holder if holder == 0 || holder == self.client_id => Ok(()),
            holder if self.had_lease => Err(StopReason::LostLease(holder)),
            holder => Err(StopReason::Lease(holder)),
        }
    }

    fn update_counters(&mut self, state: &OperatingStateMsg, now: Nanos) -> Option<Refusal> {
        if state.accepted > self.accepted {
            self.accepted = state.accepted;
            self.accepted_at = now;
            self.ended = state.broken_off();
            self.refused_now = None;
            self.restarts_left = RESTARTS;
            self.waits = false;
        }
        // Refusals of other clients' commands are not this client's concern.
        let (refused, reason) = state.refusals_of(self.client_id);
        // The count restarts when another client has taken its entry.
        let before = std::mem::replace(&mut self.refused, refused);
        if refused == 0 || refused == before {
            return None;
        }
        self.refused_now = Some(reason);
        Some(reason)
    }

    fn check_progress(&self, now: Nanos) -> Result<(), StopReason> {
        if now.duration_since(self.accepted_at) <= TIMEOUT {
            return Ok(());
        }
        Err(self.refused_now.map_or(StopReason::Ignored, StopReason::Refused))
    }

    fn is_worth_reporting(&mut self, refusal: Refusal, now: Nanos) -> bool {
        let repeated = self.reported.is_some_and(|(reported, when)| {
            reported == refusal && now.duration_since(when) < REPEAT_PERIOD
        });
        if !repeated {
            self.reported = Some((refusal, now));
        }
        !repeated
    }
}

pub struct LateMonitor {
    stale_stops: u64,
    shift_s: f64,
}

impl LateMonitor {
    pub fn new(state: &OperatingStateMsg) -> Self {
        Self { stale_stops: state.stale_stops, shift_s: 0.0 }
    }

    /// Adds a time step, s. The excess over a trajectory step shifts the trajectory.
    pub fn record_step(&mut self, step_s: f64) {
        self.shift_s += (step_s - MAX_STEP_S).max(0.0);
    }

    /// Checks the newest state while this client commands. Returns a message after a stop.
    pub fn check(&mut self, state: &OperatingStateMsg) -> Option<String> {
        let stops = state.stale_stops.saturating_sub(self.stale_stops);
        self.stale_stops = state.stale_stops;
        (stops > 0).then(|| {
            format!(
                "the controller stopped the snake in the meantime: commands came late; the \
                 trajectory is delayed by {:.2} s",
                self.shift_s
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ME: u64 = 7;
    const OTHER: u64 = 8;

    fn state(now: Nanos) -> OperatingStateMsg {
        let enabled = OperatingState::Enabled.number();
        OperatingStateMsg { stamp_ns: now.0, boot_id: 1, state: enabled, ..Default::default() }
    }

    fn at(milliseconds: u64) -> Nanos {
        Nanos::from_millis(10_000 + milliseconds)
    }

    fn refused_state(now: Nanos, client_id: u64, count: u64, reason: Refusal) -> OperatingStateMsg {
        let mut state =
            OperatingStateMsg { refused: count, last_refusal: reason.number(), ..state(now) };
        state.refused_client_id[3] = client_id;
        state.refused_commands[3] = count;
        state.refused_reason[3] = reason.number();
        state
    }

    fn monitor() -> StreamMonitor {
        StreamMonitor::new(ME, &state(at(0)), at(0))
    }

    #[test]
    fn refusal_is_reported_once_a_second() {
        let mut monitor = monitor();
        let mut reported = 0;
        for step in 1..=250 {
            let now = at(step * 10);
            let refusal = Refusal::StepTooLarge;
            let state =
                OperatingStateMsg { accepted: step, ..refused_state(now, ME, step, refusal) };
            reported += u64::from(monitor.check(&state, now).unwrap() == Some(refusal));
        }
        assert_eq!(reported, 3);
    }

    #[test]
    fn followed_stream_refused_for_its_step_has_lost_the_setpoint() {
        let mut monitor = monitor();
        let refused = |accepted, now, count| OperatingStateMsg {
            accepted,
            ..refused_state(now, ME, count, Refusal::StepTooLarge)
        };
        // Refused from the beginning: the stream does not start at the setpoint.
        monitor.check(&refused(0, at(5), 1), at(5)).unwrap();
        assert!(!monitor.has_lost_setpoint());
        monitor.check(&refused(1, at(10), 1), at(10)).unwrap();
        assert!(!monitor.has_lost_setpoint());
        monitor.check(&refused(1, at(15), 2), at(15)).unwrap();
        // Repeated restarts without a followed command are limited.
        for restart in 1..=RESTARTS {
            assert!(monitor.has_lost_setpoint());
            monitor.restart(&refused(1, at(900), 4), at(900));
            assert!(!monitor.has_lost_setpoint() && !monitor.may_continue());
            monitor.check(&refused(1, at(905), 5), at(905)).unwrap();
            assert_eq!(monitor.has_lost_setpoint(), restart < RESTARTS);
        }
        let ended = monitor.check(&refused(1, at(1910), 6), at(1910));
        assert_eq!(ended, Err(StopReason::Refused(Refusal::StepTooLarge)));
        assert!(!monitor.may_continue());
        monitor.check(&refused(2, at(1915), 6), at(1915)).unwrap();
        assert!(monitor.may_continue());
    }

    #[test]
    fn the_refusals_of_another_client_are_not_reported() {
        let mut monitor = monitor();
        for step in 1..=100 {
            let now = at(step * 10);
            let state = refused_state(now, OTHER, step, Refusal::Stamp);
            assert_eq!(monitor.check(&state, now), Ok(None));
        }
        let last = refused_state(at(1100), OTHER, 200, Refusal::Stamp);
        assert_eq!(monitor.check(&last, at(1100)), Err(StopReason::Ignored));
    }

    #[test]
    fn restarted_count_is_a_new_refusal() {
        let mut monitor = monitor();
        let refused = |now, client| OperatingStateMsg {
            accepted: 1,
            ..refused_state(now, client, 1, Refusal::StepTooLarge)
        };
        assert_eq!(monitor.check(&refused(at(10), ME), at(10)), Ok(Some(Refusal::StepTooLarge)));
        let accepted = OperatingStateMsg { accepted: 2, ..refused(at(900), OTHER) };
        assert_eq!(monitor.check(&accepted, at(900)), Ok(None), "its entry is gone");
        let again = |now| OperatingStateMsg { accepted: 2, ..refused(now, ME) };
        assert_eq!(monitor.check(&again(at(1800)), at(1800)), Ok(Some(Refusal::StepTooLarge)));
        let ended = monitor.check(&again(at(1901)), at(1901));
        assert_eq!(ended, Err(StopReason::Refused(Refusal::StepTooLarge)));
    }

    #[test]
    fn stream_interrupted_by_a_limit_names_it() {
        let mut state = refused_state(at(5), ME, 1, Refusal::StreamInterrupted);
        state.flags = OperatingStateMsg::broken_off_by(Some(Stop::Hull));
        let ended = monitor().check(&state, at(5)).unwrap_err();
        assert_eq!(ended, StopReason::Stopped(Stop::Hull));
        assert!(ended.to_string().contains("calibrated range"), "{ended}");
        // What ended another motion before is not the reason.
        let second = refused_state(at(6), ME, 2, Refusal::StreamInterrupted);
        let again = OperatingStateMsg { refused_commands: second.refused_commands, ..state };
        let refusal = StreamMonitor::new(ME, &state, at(0)).check(&again, at(6));
        assert_eq!(refusal, Ok(Some(Refusal::StreamInterrupted)));
    }

    #[test]
    fn an_old_state_and_a_restart_end_the_stream() {
        assert_eq!(monitor().check(&state(at(0)), at(3200)), Err(StopReason::Silent));
        let restarted = OperatingStateMsg { boot_id: 2, ..state(at(1)) };
        assert_eq!(monitor().check(&restarted, at(1)), Err(StopReason::Restarted));
    }
}
