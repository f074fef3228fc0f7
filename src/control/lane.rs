//! What passes between the threads: wait-free on the side of the loop, in both directions.
//!
//! Newest-value lanes are triple buffers: the writer never waits and the reader sees the latest value only. What must not be
//! lost goes through rings; a full ring counts what it drops instead of waiting (H13).

use rtrb::{Consumer, Producer, RingBuffer};
use triple_buffer::triple_buffer;

use super::{Event, Report, ServoCommand, StateReply, StateRequest};
use crate::rt::TickTiming;

/// Ticks that the relay may fall behind before reports are dropped: a quarter of a second at 1 kHz.
const REPORTS: usize = 256;
/// Events that the log may fall behind.
const EVENTS: usize = 1024;
/// State commands under way; a client sends one and waits for its answer.
const COMMANDS: usize = 32;

/// One tick as the relay publishes it.
#[derive(Debug, Clone, Copy)]
pub struct Record {
    /// What the cycle shows.
    pub report: Report,
    /// When it ran.
    pub timing: TickTiming,
}

/// The ends that the loop holds.
pub struct LoopEnds {
    /// Newest servo command.
    pub servo: triple_buffer::Output<Option<ServoCommand>>,
    /// State commands in order.
    pub requests: Consumer<StateRequest>,
    /// Answers in order.
    pub replies: Producer<StateReply>,
    /// Every tick.
    pub records: Producer<Record>,
    /// Every event.
    pub events: Producer<Event>,
}

/// The ends that the thread of shared memory holds.
pub struct RelayEnds {
    /// Newest servo command.
    pub servo: triple_buffer::Input<Option<ServoCommand>>,
    /// State commands in order.
    pub requests: Producer<StateRequest>,
    /// Answers in order.
    pub replies: Consumer<StateReply>,
    /// Every tick.
    pub records: Consumer<Record>,
}

/// All lanes between the loop, the thread of shared memory, and the log.
#[must_use]
pub fn lanes() -> (LoopEnds, RelayEnds, Consumer<Event>) {
    let (servo_in, servo_out) = triple_buffer(&None);
    let (requests_in, requests_out) = RingBuffer::new(COMMANDS);
    let (replies_in, replies_out) = RingBuffer::new(COMMANDS);
    let (records_in, records_out) = RingBuffer::new(REPORTS);
    let (events_in, events_out) = RingBuffer::new(EVENTS);
    let of_loop = LoopEnds {
        servo: servo_out,
        requests: requests_out,
        replies: replies_in,
        records: records_in,
        events: events_in,
    };
    let of_relay = RelayEnds { servo: servo_in, requests: requests_in, replies: replies_out, records: records_out };
    (of_loop, of_relay, events_out)
}
