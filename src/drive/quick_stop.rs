//! Stops drives from outside the controller: the watchdog's way.

use super::abort_code::AbortCode;
use super::cia402::{Controlword, DriveState, PowerGoal, PowerStep, Statusword, power_step};
use super::error::LinkError;
use super::heard::Heard;
use super::link::{DriveLink, Retry};
use super::object::{self, Setting, Value};
use super::transport::Transport;
use crate::units::Nanos;

/// Why a drive could not be stopped from outside the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum QuickStopError {
    /// The port is not open.
    #[error("the port could not be opened; cut the power of the drive")]
    NotHeld,
    /// The controller goes on before the drive has answered.
    #[error("the controller goes on, and has the drive again")]
    TakenBack,
    /// Nothing answers.
    #[error("the drive does not answer; cut its power")]
    NoAnswer,
    /// Something answers, and is not understood.
    #[error("{0}; cut the power of the drive")]
    NotUnderstood(Heard),
    /// It refuses.
    #[error("the drive refuses to be stopped or read: {0}; cut its power")]
    Refused(AbortCode),
    /// It answers, with a statusword that is no known state.
    #[error("the drive answers with the unknown statusword 0x{0:04X}; cut its power")]
    UnknownState(u16),
    /// It answers, and follows its target.
    #[error("the drive does not stop ({0:?}); cut its power")]
    StillOn(DriveState),
}

/// Attempts to stop a drive: the first may collide with the rest of the controller's exchange.
pub const STOP_ATTEMPTS: usize = 3;

/// The wait for a reply while every drive is told once: far more than an exchange takes.
const BLIND: Nanos = Nanos::from_millis(12);

/// Stops drives with their quick-stop ramps, in any state; they then hold with power. A drive
/// without power stays off.
///
/// Behind a gateway, a node that does not answer keeps the line for a whole time-out, and what is
/// said meanwhile may be lost. So nodes that are `owing` an answer come last. Every other one is
/// told once before anything waits for a lost reply. Those that did not answer are told again before
/// any is asked for its state, the first of them last: the gateway may have waited for that one.
pub fn quick_stop_all<T: Transport>(
    link: &mut DriveLink<T>,
    nodes: &[u8],
    owing: &[u8],
    attempts: usize,
) -> Vec<Result<DriveState, QuickStopError>> {
    let _ = link.wait_for_quiet();
    let stop = object::CONTROLWORD.set(Controlword::QUICK_STOP.0);
    let mut last: Vec<bool> =
        nodes.iter().map(|node| nodes.len() > 1 && owing.contains(node)).collect();
    let mut order: Vec<usize> = (0..nodes.len()).collect();
    order.sort_by_key(|&index| last[index]);
    let at_first: Vec<usize> = order.iter().copied().filter(|&index| !last[index]).collect();
    // Sent before the state is known: without power it only delays switching on.
    link.wait_at_most(BLIND);
    let (mut untold, mut is_silent) = (at_first, false);
    untold.retain(|&index| {
        let timeouts = link.counters().timeouts;
        let is_told = link.write_unconfirmed(nodes[index], stop);
        is_silent = link.counters().timeouts != timeouts;
        !is_told
    });
    // Where nothing came at last, a gateway may wait for the first of these.
    let waits = !is_silent || link.is_answered_by_gateway();
    link.wait_for_gateway(waits);
    for index in untold.into_iter().rev() {
        last[index] = !link.write_unconfirmed(nodes[index], stop);
    }
    order.sort_by_key(|&index| last[index]);
    let mut outcomes = vec![Err(QuickStopError::NoAnswer); nodes.len()];
    for _ in 0..attempts {
        for &index in &order {
            if outcomes[index].is_ok() {
                continue;
            }
            match quick_stop(link, nodes[index], stop) {
                Ok(outcome) => outcomes[index] = outcome,
                // Nothing answers at all, not even the drive that the port belongs to.
                Err(LinkError::Broken(_)) => return outcomes,
                Err(LinkError::NotOurTurn) => {
                    let open = outcomes.iter_mut().filter(|outcome| outcome.is_err());
                    open.for_each(|outcome| *outcome = Err(QuickStopError::TakenBack));
                    return outcomes;
                }
                Err(LinkError::Lost(heard)) => {
                    outcomes.iter_mut().for_each(|outcome| note_heard(outcome, heard));
                    return outcomes;
                }
                Err(LinkError::Unanswered(heard)) => note_heard(&mut outcomes[index], heard),
                Err(LinkError::Refused(AbortCode::NO_NODE)) => {}
                Err(LinkError::Refused(code)) => {
                    outcomes[index] = Err(QuickStopError::Refused(code));
                }
            }
        }
    }
    outcomes
}

fn note_heard(outcome: &mut Result<DriveState, QuickStopError>, heard: Heard) {
    if *outcome == Err(QuickStopError::NoAnswer) && !heard.is_silence() {
        *outcome = Err(QuickStopError::NotUnderstood(heard));
    }
}

/// Commands quick stop, and reads the state.
fn quick_stop(
    link: &mut DriveLink<impl Transport>,
    node: u8,
    stop: Setting,
) -> Result<Result<DriveState, QuickStopError>, LinkError> {
    match link.write(node, stop, link.prompt(Retry::Safe)) {
        Ok(_) => {}
        Err(LinkError::Refused(code)) if code != AbortCode::NO_NODE => {}
        Err(error) => return Err(error),
    }
    let statusword = link.read_promptly(node, object::STATUSWORD.address())?.value;
    let statusword = u16::from_raw(statusword);
    let Some(state) = Statusword(statusword).state() else {
        return Ok(Err(QuickStopError::UnknownState(statusword)));
    };
    Ok(match power_step(state, PowerGoal::Stopped) {
        PowerStep::Command(_) => Err(QuickStopError::StillOn(state)),
        PowerStep::Reached | PowerStep::Blocked | PowerStep::Wait => Ok(state),
    })
}
