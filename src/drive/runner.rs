//! The thread that owns a serial port.
//!
//! It and the control loop share nothing but a triple buffer each way per axis: neither ever waits
//! for the other, and each sees the newest value.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use triple_buffer::{Input, Output, triple_buffer};

use crate::config::{AxisConfig, PortConfig};
use crate::units::{Counts, Nanos};

use super::axis::{Access, Ask, Axis, Reply};
use super::bring_up::{self, AxisIdentity};
use super::error::{AxisFault, LinkError};
use super::event::{PortEvent, PortEventKind};
use super::exchange::Link;
use super::family::{self, Parts};
use super::hint::{self, Place};
use super::object::Setting;
use super::serial::SerialTransport;
use super::transport::Transport;
use super::{AxisFeedback, AxisRequest, Demand};

/// The shortest turn over the axes. A real line takes longer; on a pseudo-terminal without pace
/// this leaves the processor to others.
const SHORTEST_TURN: Nanos = Nanos::from_micros(500);

/// A turn while no axis answers.
const LOST_TURN: Nanos = Nanos::from_millis(10);

/// Between two tries to reach an axis that was lost.
const READMISSION_PERIOD: Nanos = Nanos::from_millis(500);

/// How long the drives may take to go off when the thread ends.
const SHUTDOWN_DEADLINE: Nanos = Nanos::from_millis(3000);

/// An exchange takes 2.1 ms at 115200 baud, and little more to be carried out. One that takes
/// longer is held back, most likely by the latency timer of an FTDI adapter.
const SLOW_EXCHANGE: Nanos = Nanos::from_millis(4);

/// The control loop's ends of one axis.
#[derive(Debug)]
pub struct AxisLink {
    /// The motor.
    pub motor: usize,
    /// What the axis shall do: the newest counts.
    pub requests: Input<AxisRequest>,
    /// What the axis reports: the newest counts.
    pub feedback: Output<AxisFeedback>,
}

/// The thread's end of a port. It allocates nothing while it runs.
#[derive(Debug)]
pub struct PortRunner<T = SerialTransport> {
    link: Link<T>,
    slots: Vec<Slot>,
    /// What half of the exchanges took at least when the port was brought up.
    exchange: Nanos,
    /// The last exchange took more than twice as long.
    late: bool,
    /// Takes where the axes stand at the end.
    positions_file: Option<PathBuf>,
}

/// One axis with what the thread keeps for it.
#[derive(Debug)]
struct Slot {
    config: AxisConfig,
    identity: AxisIdentity,
    settings: Vec<Setting>,
    axis: Axis,
    requests: Output<AxisRequest>,
    feedback: Input<AxisFeedback>,
    next_admission: Nanos,
    /// Where it was left and where it stands, if that was noted.
    hint: Hint,
    /// The newest request, and when it was first seen.
    heard: (u64, Nanos),
    /// Silence of the control loop after which the axis is stopped.
    deadman: Option<Nanos>,
    /// The control loop is silent, and this has been told.
    deserted: bool,
}

/// Where an axis was left, if anyone noted it, and where it stands; `None`: not asked for.
type Hint = Option<(Option<Counts>, Counts)>;

impl Slot {
    /// The newest request, or a quick stop if the control loop that enabled the axis has fallen
    /// silent.
    fn newest_request(&mut self, now: Nanos, events: &mut dyn FnMut(PortEvent)) -> AxisRequest {
        let request = *self.requests.read();
        if request.sequence != self.heard.0 {
            self.heard = (request.sequence, now);
            self.deserted = false;
        }
        let silence = now - self.heard.1;
        if request.demand != Demand::Enabled || self.deadman.is_none_or(|deadman| silence < deadman)
        {
            return request;
        }
        if !std::mem::replace(&mut self.deserted, true) {
            self.axis
                .report(PortEventKind::Deserted { silence }, events);
        }
        AxisRequest {
            demand: Demand::QuickStop,
            ..request
        }
    }

    fn with_link(
        port: &PortConfig,
        config: &AxisConfig,
        identity: AxisIdentity,
        hint: Hint,
    ) -> (Self, AxisLink) {
        let (drive, config) = (family::of_axis(port, config), config.clone());
        let (request_input, requests) = triple_buffer(&AxisRequest::default());
        let (feedback, feedback_output) = triple_buffer(&AxisFeedback::default());
        let link = AxisLink {
            motor: config.motor,
            requests: request_input,
            feedback: feedback_output,
        };
        let (settings, axis) = (
            drive.settings(&config),
            Axis::new(&config, drive, port.polling),
        );
        let slot = Self {
            config,
            identity,
            settings,
            axis,
            requests,
            feedback,
            next_admission: Nanos::ZERO,
            hint,
            heard: (0, Nanos::ZERO),
            deadman: (port.loop_timeout_ms > 0).then(|| Nanos::from_millis(port.loop_timeout_ms)),
            deserted: false,
        };
        (slot, link)
    }

    fn publish<T: Transport>(&mut self, link: &Link<T>) {
        self.feedback.write(self.axis.feedback(link.counters()));
    }
}

impl<T: Transport> PortRunner<T> {
    pub(super) fn with_links(
        link: Link<T>,
        port: &PortConfig,
        identities: Vec<AxisIdentity>,
        exchange: Nanos,
        stands: &[Counts],
    ) -> (Self, Vec<AxisLink>) {
        let places = port.positions_file.as_deref().map(hint::take);
        let with_link = |((config, identity), stands): ((&AxisConfig, AxisIdentity), &Counts)| {
            let left = |place: &Place| {
                (place.serial_number == config.serial_number).then_some(place.position)
            };
            let hint = places
                .as_ref()
                .map(|places| (places.iter().find_map(left), *stands));
            Slot::with_link(port, config, identity, hint)
        };
        let (slots, links) = port
            .axes
            .iter()
            .zip(identities)
            .zip(stands)
            .map(with_link)
            .unzip();
        (
            Self {
                link,
                slots,
                exchange,
                late: false,
                positions_file: port.positions_file.clone(),
            },
            links,
        )
    }

    /// Exchanges with the axes until `stop`, then leaves them switched off as far as they can be
    /// reached. Blocks; call it in a thread of its own. `events` is called in that thread and
    /// should not block.
    pub fn run(mut self, stop: &AtomicBool, mut events: impl FnMut(PortEvent)) {
        self.announce(&mut events);
        while !stop.load(Ordering::Acquire) {
            self.turn(&mut events);
        }
        self.shut_down(&mut events);
    }

    /// Notes where the axes stand. Without a note the next start finds no hint, which is no worse
    /// than a wrong one.
    fn leave_hints(&self) {
        if let Some(file) = &self.positions_file {
            let place = |slot: &Slot| {
                let position = slot.axis.resting_place()?;
                Some(Place {
                    serial_number: slot.config.serial_number,
                    position,
                })
            };
            let _ = hint::leave(file, self.slots.iter().filter_map(place).collect());
        }
    }

    /// Tells who was found.
    pub fn announce(&mut self, events: &mut dyn FnMut(PortEvent)) {
        for slot in &mut self.slots {
            let AxisIdentity {
                node_id,
                product_code,
                firmware,
                serial_number,
                ..
            } = slot.identity;
            slot.axis.report(
                PortEventKind::Ready {
                    node_id,
                    product_code,
                    firmware,
                    serial_number,
                },
                events,
            );
            if let Some((left, stands)) = slot.hint {
                slot.axis.compare(left, stands, events);
            }
        }
        if self.exchange > SLOW_EXCHANGE
            && let Some(slot) = self.slots.first()
        {
            slot.axis.report(
                PortEventKind::SlowLine {
                    median: self.exchange,
                },
                events,
            );
        }
    }

    /// One exchange with every axis.
    pub fn turn(&mut self, events: &mut dyn FnMut(PortEvent)) {
        let begin = self.link.now();
        for place in 0..self.slots.len() {
            self.serve(place, false, events);
        }
        let nothing_to_do = self.slots.iter().all(|slot| slot.axis.is_lost());
        self.link.sleep_until(
            begin
                + if nothing_to_do {
                    LOST_TURN
                } else {
                    SHORTEST_TURN
                },
        );
    }

    /// Switches everything off, in order, for a bounded time.
    pub fn shut_down(&mut self, events: &mut dyn FnMut(PortEvent)) {
        let begin = self.link.now();
        for slot in &mut self.slots {
            slot.axis.power_down(begin, events);
        }
        while self.slots.iter().any(|slot| !slot.axis.is_at_rest())
            && self.link.now() < begin + SHUTDOWN_DEADLINE
        {
            for place in 0..self.slots.len() {
                self.serve(place, true, events);
            }
        }
        for slot in &self.slots {
            slot.axis.report(
                PortEventKind::Ended {
                    off: slot.axis.is_off(),
                },
                events,
            );
        }
        self.leave_hints();
    }

    /// One exchange with one axis; `stopping` switches it off whatever the control loop demands.
    fn serve(&mut self, place: usize, stopping: bool, events: &mut dyn FnMut(PortEvent)) {
        let Self {
            link,
            slots,
            exchange: usual,
            late,
            ..
        } = self;
        let Some(slot) = slots.get_mut(place) else {
            return;
        };
        if slot.axis.is_lost() {
            slot.axis.acknowledge(slot.requests.read(), events);
            if !stopping {
                readmit(link, slot, events);
            }
        } else if let Err(error) = link.get_in_step() {
            slot.axis.lose(error, events);
        } else {
            // The newest request, at the last moment before its set-point is encoded.
            let request = if stopping {
                slot.axis.rest()
            } else {
                slot.newest_request(link.now(), events)
            };
            let begin = link.now();
            let ask = slot.axis.next(&request, begin, *late, events);
            let timeouts = link.counters().timeouts;
            let parts = slot.axis.drive().parts();
            let outcome = perform(link, slot.config.node_id, ask, parts);
            if link.counters().timeouts != timeouts {
                let object = ask.object(parts);
                slot.axis.report(PortEventKind::TimedOut { object }, events);
                slot.axis.disturbed(link.now(), events);
            }
            let end = link.now();
            *late = end - begin > *usual + *usual;
            slot.axis.done(ask, outcome, end, events);
        }
        slot.publish(link);
    }
}

fn perform<T: Transport>(
    link: &mut Link<T>,
    node: u8,
    ask: Ask,
    parts: &Parts,
) -> Result<Reply, LinkError> {
    match ask.access(parts) {
        Access::Read(object) => link.read_raw(node, object).map(|answer| Reply {
            raw: answer.value,
            sent: answer.sent,
            received: answer.received,
        }),
        Access::Write(setting, repeat) => link.write(node, setting, repeat).map(|answer| Reply {
            raw: 0,
            sent: answer.sent,
            received: answer.received,
        }),
    }
}

/// Tries to reach an axis that was lost, now and then. It ends disabled, whatever is demanded.
fn readmit<T: Transport>(link: &mut Link<T>, slot: &mut Slot, events: &mut dyn FnMut(PortEvent)) {
    let now = link.now();
    if now < slot.next_admission {
        return;
    }
    slot.next_admission = now + READMISSION_PERIOD;
    if link.is_broken() && link.reopen().is_err() {
        return;
    }
    // It may be another drive, or one that was restarted.
    link.forget_drive();
    if link.try_to_get_in_step().is_err() || !link.is_in_step() {
        return;
    }
    match bring_up_again(link, slot) {
        Ok(position) => slot.axis.readmit(position, events),
        // Gone again; the next try will tell.
        Err(AxisFault::Exchange {
            error: LinkError::Lost | LinkError::Unanswered | LinkError::Broken(_),
            ..
        }) => {}
        Err(fault) => slot.axis.refuse(fault, events),
    }
}

/// Where the axis stands when it is switched off and limited again.
fn bring_up_again<T: Transport>(link: &mut Link<T>, slot: &Slot) -> Result<i32, AxisFault> {
    let (node, parts) = (slot.config.node_id, slot.axis.drive().parts());
    bring_up::know_line(link)?;
    bring_up::check_identity(link, &slot.config, parts)?;
    bring_up::switch_off(link, node, parts)?;
    bring_up::configure(link, node, &slot.settings)?;
    bring_up::read(link, node, parts.position)
}
