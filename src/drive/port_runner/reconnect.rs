//! Bringing up a lost axis again, while the other axes of its line are served.

use super::{AxisSlot, PortRequest, exchange};
use crate::drive::axis::interface::Demand;
use crate::drive::axis::schedule::LineUse;
use crate::drive::axis::state_machine::EventSink;
use crate::drive::bring_up::{self, DriveNode};
use crate::drive::error::{AxisError, LinkError};
use crate::drive::link::DriveLink;
use crate::drive::object;
use crate::drive::transport::Transport;
use crate::units::Nanos;

const RECONNECT_PERIOD: Nanos = Nanos::from_millis(500);

/// Minimum pause relative to the duration of the last attempt, while other axes answer: they wait
/// for a gateway that waits for the lost one.
const RECONNECT_PAUSE: u64 = 5;

/// The other axes of a line while a lost one is brought up again.
pub(super) struct OtherSlots<'a, R: Send> {
    pub before: &'a mut [AxisSlot<R>],
    pub after: &'a mut [AxisSlot<R>],
    pub line: &'a mut LineUse,
}

impl<R: PortRequest> OtherSlots<'_, R> {
    fn answer(&self) -> bool {
        let mut slots = self.before.iter().chain(&*self.after);
        slots.any(|slot| !slot.axis.is_lost())
    }

    /// One exchange with each axis that answers.
    fn serve(&mut self, link: &mut DriveLink<impl Transport>, events: EventSink<'_>) {
        let slots = self.before.iter_mut().chain(&mut *self.after);
        for slot in slots.filter(|slot| !slot.axis.is_lost()) {
            exchange(link, slot, self.line, false, events);
        }
    }
}

/// Tries periodically to reconnect a lost axis. It then holds if that is demanded and it kept its
/// power, and is disabled otherwise. Another axis that answers never waits for more than one
/// exchange.
pub(super) fn try_reconnect<T: Transport>(
    link: &mut DriveLink<T>,
    slot: &mut AxisSlot<impl PortRequest>,
    mut others: OtherSlots<'_, impl PortRequest>,
    events: EventSink<'_>,
) {
    let now = link.now();
    if now < slot.next_reconnect {
        return;
    }
    slot.next_reconnect = now + RECONNECT_PERIOD;
    let brought_up = if others.answer() {
        // The line is known by the axes that answer.
        if !link.is_answered(slot.config.node_id, object::VENDOR.address()) {
            let took = link.now() - now;
            let pause = Nanos(took.0.saturating_mul(RECONNECT_PAUSE)).max(RECONNECT_PERIOD);
            slot.next_reconnect = link.now() + pause;
            return;
        }
        let mut serve_others = |link: &mut DriveLink<T>| others.serve(link, events);
        let drive = DriveNode::new(link, slot.config.node_id);
        bring_up_again(drive.with_interlude(&mut serve_others), slot)
    } else {
        if link.is_broken() && link.reopen().is_err() {
            return;
        }
        // It may be another drive, or one that was restarted.
        link.forget_drive();
        if link.try_to_synchronise().is_err() || !link.is_in_sync() {
            return;
        }
        bring_up::prepare_line(link)
            .and_then(|()| bring_up_again(DriveNode::new(link, slot.config.node_id), slot))
    };
    match brought_up {
        Ok((position, holds)) => slot.axis.reconnect(position, holds, link.now(), events),
        // Lost again; the next attempt follows.
        Err(AxisError::Exchange { error, .. }) if !matches!(error, LinkError::Refused(_)) => {}
        Err(error) => slot.axis.report_unusable(error, events),
    }
}

/// Brings an axis up again. Returns its position, and `true` if it holds. A drive that kept its
/// power has kept its settings. Where a quick stop is demanded it gets one: without power the wires
/// would lose their tension. Any other is switched off and limited again.
fn bring_up_again(
    mut drive: DriveNode<'_, impl Transport>,
    slot: &mut AxisSlot<impl PortRequest>,
) -> Result<(i32, bool), AxisError> {
    drive.check_identity(slot.config.serial_number)?;
    let may_hold = slot.take_request().demand == Demand::QuickStop && slot.axis.may_hold();
    let holds = may_hold && drive.hold()?;
    if !holds {
        drive.switch_off()?;
        // Missing objects were reported at the start.
        drive.configure(&slot.settings, slot.identity.model, &mut |_| {})?;
    }
    Ok((drive.read(object::POSITION)?, holds))
}
