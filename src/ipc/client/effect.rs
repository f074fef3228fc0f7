//! Waiting for the effect of a command. A robot that is no longer busy may not have completed the
//! command: it may have been interrupted.
//!
//! | command | its effect |
//! |---|---|
//! | `enable`, `resume` | ENABLED |
//! | `disable` | DISABLED or FAULT, and every drive reports power off |
//! | `home`, `unhome` | every zero known; a zero unknown |
//! | `condition` | the cycle is complete; with a model: its memory is known |
//! | `move` | the motion is complete, and the setpoint is at the goal |
//! | `pause`, `hold` | nothing is followed, and no setpoint moves |
//! | `acknowledge` | out of FAULT |
//! | `release` | another client or none holds the lease |

use super::controller_client::{Client, POLL_PERIOD};
use super::error::ClientError;
use super::subscription::Latest;
use crate::clock;
use crate::ipc::payload::{JointState, OperatingStateMsg};
use crate::robot::{Cause, Fault, KnownPower, OperatingState, Refusal, StateCommand};
use crate::units::Nanos;

/// Period of repeating a command that has to wait for the drives or for another command to end.
const REPEAT_PERIOD: Nanos = Nanos::from_millis(50);
/// Time limit for starting drives, and for all commands without motion.
const DRIVES_TIMEOUT: Nanos = Nanos::from_millis(15_000);
/// Time limit for motions planned by the controller: homing, conditioning, `move_jp`.
const MOTION_TIMEOUT: Nanos = Nanos::from_millis(300_000);
/// Maximum time between the end of busy and the effect: the encoders are read after the last
/// setpoint was sent.
pub const SETTLE: Nanos = Nanos::from_millis(1000);
/// Maximum time for drives that are switched off in FAULT: they report it after some exchanges, and
/// a quick stop.
pub const SETTLE_OFF: Nanos = Nanos::from_millis(5000);
/// Timeout after which a controller without state reports counts as hung.
pub const SILENCE: Nanos = Nanos::from_millis(3000);
/// Distance of the setpoint from the goal at which a motion has arrived, rad (m): rounding to
/// counts, and the dead-band.
pub const ARRIVAL: f64 = 0.009;

/// Progress of an accepted command, as shown by a state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// The command is running.
    Busy,
    /// No activity is running any more, but the effect is missing.
    Ended,
    /// The effect has occurred.
    Done,
    /// The command was interrupted by this cause.
    Interrupted(Cause),
}

impl OperatingStateMsg {
    /// Progress of a command, as shown by this newer state. `client_id`: sender of the command.
    #[must_use]
    pub fn progress(&self, command: StateCommand, client_id: u64) -> Progress {
        use OperatingState::{Disabled, Enabled, Paused};
        let has = |flags: u32| self.flags & flags == flags;
        let state = OperatingState::from_number(self.state);
        let (is_busy, is_still) = (has(Self::BUSY), has(Self::HOLDING | Self::AT_REST));
        let memory_known = has(Self::MEMORY_KNOWN) || !has(Self::MODEL);
        let stop = self.broken_off().map(Cause::Stop);
        // The state itself has priority over the way it was reached.
        let why = || match state {
            Some(OperatingState::Fault) => {
                Cause::Fault(Fault::from_number(self.fault).unwrap_or(Fault::None))
            }
            _ => stop.unwrap_or(Cause::State(state.unwrap_or(Disabled))),
        };
        let otherwise = |going_on: bool| match going_on {
            true => Progress::Busy,
            false => Progress::Interrupted(why()),
        };
        let done = |is_done: bool, or: Progress| if is_done { Progress::Done } else { or };
        let is_fault = state == Some(OperatingState::Fault);
        match command {
            StateCommand::Enable | StateCommand::Resume => {
                done(state == Some(Enabled), otherwise(is_busy && !is_fault))
            }
            StateCommand::Disable if is_busy && !is_fault => otherwise(state == Some(Disabled)),
            StateCommand::Disable if is_fault || state == Some(Disabled) => {
                done(self.power() == KnownPower::Off, Progress::Ended)
            }
            StateCommand::Disable => Progress::Interrupted(why()),
            _ if is_fault && command == StateCommand::Acknowledge => otherwise(is_busy),
            StateCommand::Release => done(self.lease_client_id != client_id, Progress::Busy),
            StateCommand::Fixture => Progress::Done,
            _ if is_fault => Progress::Interrupted(why()),
            StateCommand::Acknowledge => done(state != Some(Disabled) || !is_busy, Progress::Busy),
            StateCommand::Home if stop.is_some() => Progress::Interrupted(why()),
            StateCommand::Home if is_busy => Progress::Busy,
            StateCommand::Home => done(has(Self::HOMED), Progress::Ended),
            StateCommand::Unhome => done(!has(Self::HOMED), Progress::Ended),
            StateCommand::Pause => {
                done(state == Some(Paused) && has(Self::AT_REST), otherwise(state == Some(Paused)))
            }
            StateCommand::Hold if !matches!(state, Some(Enabled | Paused)) => otherwise(false),
            StateCommand::Hold if has(Self::HOLDING) => done(is_still, Progress::Busy),
            // A client started a new motion.
            StateCommand::Hold => Progress::Interrupted(Cause::Refusal(Refusal::Busy)),
            StateCommand::Condition | StateCommand::Move => {
                if stop.is_some() || state != Some(Enabled) {
                    Progress::Interrupted(why())
                } else if is_busy {
                    Progress::Busy
                } else {
                    let is_done = memory_known || command == StateCommand::Move;
                    done(is_done, Progress::Ended)
                }
            }
        }
    }
}

impl Client {
    /// Sends a command and waits for its effect. A command that has to wait for starting drives, or
    /// for another command to end, is repeated. `gives_up` is polled and ends the wait; an
    /// accepted command then continues.
    ///
    /// # Errors
    ///
    /// [`ClientError::Refused`]; and as [`Client::wait_until_done`].
    pub fn carry_out(
        &mut self,
        command: StateCommand,
        mut gives_up: impl FnMut() -> bool,
    ) -> Result<OperatingStateMsg, ClientError> {
        let start = clock::now();
        loop {
            let refused = match self.state_command(command) {
                Ok(_) => return self.wait_until_done(command, gives_up),
                Err(refused) => refused,
            };
            let limit = match &refused {
                ClientError::Refused { refusal: Refusal::DrivesNotReady, .. } => DRIVES_TIMEOUT,
                ClientError::Refused { refusal: Refusal::Busy | Refusal::Conditioning, .. } => {
                    MOTION_TIMEOUT
                }
                _ => return Err(refused),
            };
            if gives_up() || clock::now().duration_since(start) > limit {
                return Err(refused);
            }
            clock::sleep(REPEAT_PERIOD);
        }
    }

    /// Waits for the effect of a command that was accepted just now: see [`Client::carry_out`].
    ///
    /// # Errors
    ///
    /// [`ClientError::Interrupted`] with the cause, [`ClientError::NotConfirmed`],
    /// [`ClientError::WaitCancelled`], [`ClientError::Restarted`], [`ClientError::NoReply`] from a
    /// controller that hangs; and as [`super::Subscription::read`] when it ends.
    pub fn wait_until_done(
        &mut self,
        command: StateCommand,
        mut gives_up: impl FnMut() -> bool,
    ) -> Result<OperatingStateMsg, ClientError> {
        let start = clock::now();
        let boot_id = self.link.session(start)?.ready.boot_id;
        let limit = match command {
            StateCommand::Home | StateCommand::Condition | StateCommand::Move => MOTION_TIMEOUT,
            _ => DRIVES_TIMEOUT,
        };
        let (mut last_report, mut ended) = (start, None);
        loop {
            let now = clock::now();
            if let Some(state) = self.operating_state()?.filter(|it| it.stamp_ns > start.0) {
                if state.boot_id != boot_id {
                    return Err(ClientError::Restarted);
                }
                last_report = last_report.max(Nanos(state.stamp_ns));
                match state.progress(command, self.id()) {
                    Progress::Done if self.is_at_goal(command, &state)? => return Ok(state),
                    Progress::Interrupted(cause) => {
                        return Err(ClientError::Interrupted { command, cause });
                    }
                    Progress::Busy => {}
                    Progress::Done | Progress::Ended => {
                        let since = *ended.get_or_insert(now);
                        let is_power = command == StateCommand::Disable;
                        if now.duration_since(since) > if is_power { SETTLE_OFF } else { SETTLE } {
                            return Err(ClientError::NotConfirmed(command));
                        }
                    }
                }
            }
            if now.duration_since(last_report) > SILENCE {
                let request = "operating_state";
                return Err(ClientError::NoReply { request, waited: SILENCE });
            }
            if gives_up() {
                return Err(ClientError::WaitCancelled(command));
            }
            if now.duration_since(start) > limit {
                return Err(ClientError::NotConfirmed(command));
            }
            clock::sleep(POLL_PERIOD);
        }
    }

    /// Whether the setpoint is at the goal of this client's last move.
    fn is_at_goal(
        &mut self,
        command: StateCommand,
        state: &OperatingStateMsg,
    ) -> Result<bool, ClientError> {
        let Some(goal) = self.goal.filter(|_| command == StateCommand::Move) else {
            return Ok(true);
        };
        let setpoint = match &mut self.setpoint {
            Some(setpoint) => setpoint,
            None => self.setpoint.insert(Latest::new(self.watcher().setpoint_js())),
        };
        let newer = |joint: &&JointState| joint.stamp_ns >= state.stamp_ns;
        let Some(joint) = setpoint.refresh()?.filter(newer) else { return Ok(false) };
        let away = goal.iter().zip(&joint.position).map(|(goal, is)| (goal - is).powi(2));
        Ok(away.sum::<f64>().sqrt() < ARRIVAL)
    }
}
