//! Quick stop of drives from outside the controller, used by the watchdog.

use crate::drive::cia402::{Controlword, DriveState, PowerGoal, PowerStep, Statusword, power_step};
use crate::drive::error::{LinkError, UnexpectedReply};
use crate::drive::link::{DriveLink, Retry};
use crate::drive::object::{self, AbortCode, Setting, Value};
use crate::drive::transport::Transport;
use crate::units::Nanos;

/// Why a drive could not be stopped from outside the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum QuickStopError {
    #[error("the port could not be opened; cut the power of the drive")]
    NotHeld,
    #[error("the controller continues and controls the drive again")]
    ControllerResumed,
    #[error("the drive does not answer; cut its power")]
    NoAnswer,
    #[error("{0}; cut the power of the drive")]
    InvalidReply(UnexpectedReply),
    #[error("the drive refuses to be stopped or read: {0}; cut its power")]
    Refused(AbortCode),
    #[error("the drive answers with the unknown statusword 0x{0:04X}; cut its power")]
    UnknownState(u16),
    #[error("the drive does not stop ({0:?}); cut its power")]
    PowerStageStillOn(DriveState),
}

/// Attempts to stop a drive: the first may collide with the rest of the controller's exchange.
pub const STOP_ATTEMPTS: usize = 3;

/// Timeout for a reply while every drive is sent its first stop: far longer than an exchange.
const BLIND: Nanos = Nanos::from_millis(12);

/// Stops drives with their quick-stop ramps, in any state; they then hold with power. A drive
/// without power stays off.
///
/// A silent node on a gateway blocks the line for a whole timeout. Requests sent during it may
/// be lost, so nodes with a pending reply (`pending`) come last. Every other node is sent one stop
/// before any wait for a lost reply. Silent nodes are sent another stop before any state is read,
/// the first of them last: the gateway may have waited for that one.
pub fn quick_stop_all<T: Transport>(
    link: &mut DriveLink<T>,
    nodes: &[u8],
    pending: &[u8],
    attempts: usize,
) -> Vec<Result<DriveState, QuickStopError>> {
    let _ = link.wait_for_quiet();
    let stop = object::CONTROLWORD.set(Controlword::QUICK_STOP.0);
    let mut last: Vec<bool> =
        nodes.iter().map(|node| nodes.len() > 1 && pending.contains(node)).collect();
    let mut order: Vec<usize> = (0..nodes.len()).collect();
    order.sort_by_key(|&index| last[index]);
    let at_first: Vec<usize> = order.iter().copied().filter(|&index| !last[index]).collect();
    // Sent before the state is known: without power it ends switching on.
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
                    open.for_each(|outcome| *outcome = Err(QuickStopError::ControllerResumed));
                    return outcomes;
                }
                Err(LinkError::Lost(unexpected)) => {
                    outcomes.iter_mut().for_each(|outcome| note_unexpected(outcome, unexpected));
                    return outcomes;
                }
                Err(LinkError::Unanswered(unexpected)) => {
                    note_unexpected(&mut outcomes[index], unexpected);
                }
                Err(LinkError::Refused(AbortCode::NO_NODE)) => {}
                Err(LinkError::Refused(code)) => {
                    outcomes[index] = Err(QuickStopError::Refused(code));
                }
            }
        }
    }
    outcomes
}

fn note_unexpected(outcome: &mut Result<DriveState, QuickStopError>, unexpected: UnexpectedReply) {
    if *outcome == Err(QuickStopError::NoAnswer) && !unexpected.is_silence() {
        *outcome = Err(QuickStopError::InvalidReply(unexpected));
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
        PowerStep::Command(_) => Err(QuickStopError::PowerStageStillOn(state)),
        PowerStep::Reached | PowerStep::Blocked | PowerStep::Wait => Ok(state),
    })
}
