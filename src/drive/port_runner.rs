//! The thread that owns a serial port.
//!
//! The thread and the control loop share only a triple buffer in each direction per axis: neither
//! waits for the other, and each sees the newest value.

mod reconnect;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use triple_buffer::{Input, Output, triple_buffer};

use super::axis::interface::{
    AxisFeedback, AxisRequest, Demand, ObjectAccess, RequestWatchdog, Transfer,
};
use super::axis::schedule::LineUse;
use super::axis::state_machine::{AxisStateMachine, EventSink};
use super::bring_up::AxisIdentity;
use super::error::LinkError;
use super::event::{PortEvent, PortEventKind};
use super::family::ObjectMap;
use super::family_selection::family_of_axis;
use super::link::{DriveLink, LinkCounters, TimedReply};
use super::object::{AbortCode, Setting};
use super::port::{SavedPosition, save_positions, take_positions};
use super::serial_transport::SerialTransport;
use super::transport::Transport;
use crate::config::{AxisConfig, PortConfig};
use crate::units::{Counts, Nanos};
use reconnect::{OtherSlots, try_reconnect};

/// The shortest turn over the axes. A real line takes longer; on a pseudo-terminal without a bit
/// rate this leaves the processor to other threads.
const MIN_TURN: Nanos = Nanos::from_micros(500);

/// A turn while no axis answers.
const LOST_TURN: Nanos = Nanos::from_millis(10);

/// How long the drives may take to switch off when the thread ends.
const SHUTDOWN_TIMEOUT: Nanos = Nanos::from_millis(3000);

/// A request of the control loop to an axis. The controller uses a type that only its gate creates;
/// a bench with drives alone uses the plain request.
pub trait PortRequest: Copy + Default + Send + Into<AxisRequest> {}

impl<R: Copy + Default + Send + Into<AxisRequest>> PortRequest for R {}

/// The control loop's end of one axis.
#[derive(Debug)]
pub struct AxisLink<R: Send = AxisRequest> {
    pub motor: usize,
    /// Requests to the axis: the newest counts.
    pub requests: Input<R>,
    /// Feedback of the axis: the newest counts.
    pub feedback: Output<AxisFeedback>,
    /// The drive has not answered the exchange that began last. The watchdog, which takes the line
    /// over from a dead controller, stops such a drive last.
    pub pending_reply: Arc<AtomicBool>,
}

/// The port thread's end of a port. It allocates nothing while it runs.
#[derive(Debug)]
pub struct PortRunner<T = SerialTransport, R: Send = AxisRequest> {
    link: DriveLink<T>,
    slots: Vec<AxisSlot<R>>,
    gateway_lost: bool,
    line: LineUse,
    /// Median duration of an exchange at bring-up, if something delays it.
    delayed: Option<Nanos>,
    positions_file: Option<PathBuf>,
}

#[derive(Debug)]
struct AxisSlot<R: Send> {
    config: AxisConfig,
    identity: AxisIdentity,
    settings: Vec<Setting>,
    axis: AxisStateMachine,
    requests: Output<R>,
    feedback: Input<AxisFeedback>,
    pending_reply: Arc<AtomicBool>,
    next_reconnect: Nanos,
    position_check: Option<PositionCheck>,
    watchdog: RequestWatchdog,
}

/// Comparison of the saved position of an axis with its present one.
#[derive(Debug, Clone, Copy)]
struct PositionCheck {
    saved: Option<Counts>,
    present: Counts,
}

impl<R: PortRequest> AxisSlot<R> {
    fn with_link(
        port: &PortConfig,
        config: &AxisConfig,
        identity: AxisIdentity,
        position_check: Option<PositionCheck>,
    ) -> (Self, AxisLink<R>) {
        let family = family_of_axis(port, config);
        let (request_input, requests) = triple_buffer(&R::default());
        let (feedback, feedback_output) = triple_buffer(&AxisFeedback::default());
        let pending_reply = Arc::new(AtomicBool::new(false));
        let link = AxisLink {
            motor: config.motor,
            requests: request_input,
            feedback: feedback_output,
            pending_reply: Arc::clone(&pending_reply),
        };
        let mut axis = AxisStateMachine::new(config, family);
        axis.leave_out(&identity.left_out);
        let slot = Self {
            config: config.clone(),
            identity,
            settings: family.settings(config),
            axis,
            requests,
            feedback,
            pending_reply,
            next_reconnect: Nanos::ZERO,
            position_check,
            watchdog: RequestWatchdog::default(),
        };
        (slot, link)
    }

    /// The request to carry out now; `stopping`: switch off, whatever the control loop demands.
    fn present_request(
        &mut self,
        now: Nanos,
        stopping: bool,
        events: EventSink<'_>,
    ) -> AxisRequest {
        if stopping { self.axis.disable_request() } else { self.newest_request(now, events) }
    }

    /// The newest request; a quick stop if the watchdog expired while the axis is enabled.
    fn newest_request(&mut self, now: Nanos, events: EventSink<'_>) -> AxisRequest {
        let request = self.take_request();
        match self.watchdog.expired(request.sequence, now) {
            Some(silence) if request.demand == Demand::Enabled => {
                if !std::mem::replace(&mut self.watchdog.reported, true) {
                    self.axis.report(PortEventKind::WatchdogExpired(silence), events);
                }
                AxisRequest { demand: Demand::QuickStop, ..request }
            }
            _ => request,
        }
    }

    /// Takes the newest request from the control loop: wait-free.
    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    fn take_request(&mut self) -> AxisRequest {
        (*self.requests.read()).into()
    }

    /// Passes the feedback to the control loop: wait-free.
    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    fn pass_feedback(&mut self, counters: LinkCounters) {
        self.feedback.write(self.axis.feedback(counters));
    }

    fn report_ready(&mut self, events: EventSink<'_>) {
        let kind = PortEventKind::Ready {
            node_id: self.identity.node_id,
            product_code: self.identity.model.product_code,
            firmware: self.identity.model.firmware,
            serial_number: self.identity.serial_number,
        };
        self.axis.report(kind, events);
        for &object in &self.identity.left_out {
            self.axis.report(PortEventKind::LeftOut(object), events);
        }
        if let Some(PositionCheck { saved, present }) = self.position_check {
            self.axis.compare_position(saved, present, events);
        }
    }

    fn position_to_save(&mut self) -> Option<SavedPosition> {
        if self.take_request().zero_invalid {
            return None;
        }
        Some(SavedPosition {
            serial_number: self.config.short_serial_number(),
            position: self.axis.position_to_save()?,
        })
    }
}

impl<T: Transport, R: PortRequest> PortRunner<T, R> {
    pub(super) fn with_links(
        link: DriveLink<T>,
        port: &PortConfig,
        identities: Vec<AxisIdentity>,
        exchange: Nanos,
        positions: &[Counts],
    ) -> (Self, Vec<AxisLink<R>>) {
        let saved = port.positions_file.as_deref().map(take_positions);
        let (mut slots, mut links) = (Vec::new(), Vec::new());
        for ((config, identity), &present) in port.axes.iter().zip(identities).zip(positions) {
            let position_check = saved.as_ref().map(|saved| PositionCheck {
                saved: saved
                    .iter()
                    .find(|saved| saved.serial_number == config.short_serial_number())
                    .map(|saved| saved.position),
                present,
            });
            let (slot, link) = AxisSlot::with_link(port, config, identity, position_check);
            slots.push(slot);
            links.push(link);
        }
        let runner = Self {
            link,
            line: LineUse::new(slots.len()),
            delayed: port.is_delayed(exchange).then_some(exchange),
            slots,
            gateway_lost: false,
            positions_file: port.positions_file.clone(),
        };
        (runner, links)
    }

    /// Exchanges with the axes until `stop`, then switches them off if they answer. Blocks; call it
    /// in its own thread. `events` is called in that thread and should not block.
    pub fn run(mut self, stop: &AtomicBool, mut events: impl FnMut(PortEvent)) {
        self.report_ready(&mut events);
        while !stop.load(Ordering::Acquire) {
            self.turn(&mut events);
        }
        self.shut_down(&mut events);
    }

    pub fn report_ready(&mut self, events: EventSink<'_>) {
        for slot in &mut self.slots {
            slot.report_ready(events);
        }
        if let (Some(slot), Some(exchange)) = (self.slots.first(), self.delayed) {
            slot.axis.report(PortEventKind::SlowLine(exchange), events);
        }
    }

    /// Runs as many exchanges as there are axes, each with the axis that needs it most.
    pub fn turn(&mut self, events: EventSink<'_>) {
        let begin = self.link.now();
        self.serve_all(false, events);
        let all_lost = self.slots.iter().all(|slot| slot.axis.is_lost());
        let turn = if all_lost { LOST_TURN } else { MIN_TURN };
        self.link.sleep_until(begin + turn);
    }

    /// Switches all drives off within a bounded time, and saves the positions.
    pub fn shut_down(&mut self, events: EventSink<'_>) {
        let begin = self.link.now();
        for slot in &mut self.slots {
            slot.axis.start_shutdown(begin, events);
        }
        while self.slots.iter().any(|slot| !slot.axis.is_shut_down())
            && self.link.now() < begin + SHUTDOWN_TIMEOUT
        {
            self.serve_all(true, events);
        }
        for slot in &self.slots {
            slot.axis.report(PortEventKind::Ended(slot.axis.power()), events);
        }
        if let Some(file) = &self.positions_file {
            let positions = self.slots.iter_mut().filter_map(AxisSlot::position_to_save);
            // Without the file the next start treats the axes as not homed, which is safe.
            let _ = save_positions(file, positions.collect());
        }
    }

    /// An attempt to bring lost axes up again, and a turn of exchanges. An axis that does not
    /// answer may cost the others a timeout of the gateway: it is not tried while one of them has
    /// to be stopped.
    fn serve_all(&mut self, stopping: bool, events: EventSink<'_>) {
        for index in 0..self.slots.len() {
            let is_lost = self.slots.get(index).is_some_and(|slot| slot.axis.is_lost());
            if is_lost && !self.is_stop_due(stopping, events) {
                self.serve_lost(index, stopping, events);
            }
        }
        for _ in 0..self.slots.len() {
            self.serve_next(stopping, events);
        }
    }

    fn serve_next(&mut self, stopping: bool, events: EventSink<'_>) {
        if !self.link.is_our_turn() {
            // The watchdog may have stopped any of the drives.
            let now = self.link.now();
            self.slots.iter_mut().for_each(|slot| slot.axis.distrust_state(now, events));
        }
        let is_stop_due = self.is_stop_due(stopping, events);
        let (now, line) = (self.link.now(), &mut self.line);
        let (mut next, mut moving) = (None, 0);
        for slot in self.slots.iter_mut().filter(|slot| !slot.axis.is_lost()) {
            let request = slot.present_request(now, stopping, events);
            slot.axis.take_request(&request, now, events);
            moving += u64::from(slot.axis.is_moving(&request, line));
            if !slot.axis.answers() && (is_stop_due || !slot.axis.has_waited(line)) {
                continue;
            }
            let urgency = slot.axis.urgency(&request, line);
            if next.as_ref().is_none_or(|(most, _)| urgency > *most) {
                next = Some((urgency, slot));
            }
        }
        line.moving = moving.max(1);
        let Some((_, slot)) = next else { return };
        exchange(&mut self.link, slot, line, stopping, events);
        if let [gateway, _, ..] = &self.slots[..] {
            let was_lost = std::mem::replace(&mut self.gateway_lost, gateway.axis.is_lost());
            if self.gateway_lost && !was_lost {
                gateway.axis.report(PortEventKind::GatewayLost, events);
            }
        }
    }

    /// Whether an axis that answers is to be stopped.
    fn is_stop_due(&mut self, stopping: bool, events: EventSink<'_>) -> bool {
        let now = self.link.now();
        self.slots.iter_mut().filter(|slot| slot.axis.answers()).any(|slot| {
            if stopping {
                return !slot.axis.is_shut_down();
            }
            let request = slot.newest_request(now, events);
            slot.axis.is_stop_due(&request)
        })
    }

    /// Tries to bring a lost axis up again, unless it is `stopping`.
    fn serve_lost(&mut self, index: usize, stopping: bool, events: EventSink<'_>) {
        let Some((before, [slot, after @ ..])) = self.slots.split_at_mut_checked(index) else {
            return;
        };
        let (link, line) = (&mut self.link, &mut self.line);
        let request = slot.take_request();
        slot.axis.acknowledge_counters(&request, events);
        if !stopping && link.is_our_turn() {
            let others = OtherSlots { before, after, line };
            try_reconnect(link, slot, others, events);
        }
        slot.pass_feedback(link.counters());
    }
}

/// One exchange with an axis that is not lost.
fn exchange(
    link: &mut DriveLink<impl Transport>,
    slot: &mut AxisSlot<impl PortRequest>,
    line: &mut LineUse,
    stopping: bool,
    events: EventSink<'_>,
) {
    if !link.is_our_turn() {
        let next = link.now() + MIN_TURN;
        return link.sleep_until(next);
    }
    if let Err(error) = link.synchronise() {
        if error != LinkError::NotOurTurn {
            slot.axis.set_lost(error, events);
        }
    } else {
        // Read as late as possible before the setpoint is encoded.
        let begin = link.now();
        let request = slot.present_request(begin, stopping, events);
        let transfer = slot.axis.next_transfer(&request, begin, line, events);
        slot.pending_reply.store(true, Ordering::Relaxed);
        let timeouts = link.counters().timeouts;
        let map = slot.axis.object_map();
        // A value that the drive does not have is not requested.
        let is_absent = slot.identity.left_out.contains(&transfer.object(map));
        let transfer = if is_absent { Transfer::Status } else { transfer };
        let outcome = perform(link, slot.config.node_id, transfer, map);
        if link.counters().timeouts != timeouts {
            let object = transfer.object(map);
            slot.axis.report(PortEventKind::TimedOut(object), events);
            slot.axis.handle_timeout(link.now(), events);
        }
        let refused = |code: &AbortCode| *code != AbortCode::NO_NODE;
        if outcome.is_ok() || matches!(&outcome, Err(LinkError::Refused(code)) if refused(code)) {
            slot.pending_reply.store(false, Ordering::Relaxed);
        }
        slot.axis.handle_outcome(transfer, outcome, link.now(), events);
    }
    slot.pass_feedback(link.counters());
}

/// Carries a transfer out. The value of a write is 0.
fn perform(
    link: &mut DriveLink<impl Transport>,
    node: u8,
    transfer: Transfer,
    map: &ObjectMap,
) -> Result<TimedReply<u32>, LinkError> {
    match transfer.access(map) {
        ObjectAccess::Read(object) => link.read_promptly(node, object),
        ObjectAccess::Write(setting, retry) => {
            let retry = link.prompt(retry);
            let TimedReply { sent, received, .. } = link.write(node, setting, retry)?;
            Ok(TimedReply { value: 0, sent, received })
        }
    }
}
