//! What passes between the threads: wait-free on the side of the loop, in both directions.
//!
//! Newest-value lanes are triple buffers: the writer never waits and the reader sees the latest
//! value only. What must not be lost goes through rings; a full ring counts what it drops instead
//! of waiting (H13).

use rtrb::{Consumer, Producer, RingBuffer};
use triple_buffer::triple_buffer;

use crate::core::{CycleEvent, CycleReport, ExternalPose, ServoCommand, StateReply, StateRequest};
use crate::core::{ModelCandidate, ModelSwapReply, ModelSwapRequest};
use crate::ipc::pulse::Pulse;
use crate::process::black_box::RecorderEnds;
use crate::realtime::TickTiming;

/// Ticks that the relay may fall behind before reports are dropped: a quarter of a second at 1 kHz.
const REPORTS: usize = 256;
/// Events that the log may fall behind.
const EVENTS: usize = 1024;
/// State commands under way; a client sends one and waits for its answer.
const COMMANDS: usize = 32;

/// Models on their way in or out; one waits for the other.
const MODELS: usize = 8;

/// A model for the loop.
#[derive(Debug)]
pub struct Offer {
    /// Counts up by one per offer.
    pub number: u64,
    /// The pointer.
    pub candidate: ModelCandidate,
}

/// One tick as the relay publishes it.
#[derive(Debug, Clone, Copy)]
pub struct Record {
    /// What the cycle shows.
    pub report: CycleReport,
    /// When it ran.
    pub timing: TickTiming,
}

/// The ends that the loop holds.
pub struct LoopEnds {
    /// Newest servo command.
    pub servo: triple_buffer::Output<Option<ServoCommand>>,
    /// Newest picture of the snake.
    pub external: triple_buffer::Output<Option<ExternalPose>>,
    /// State commands in order.
    pub requests: Consumer<StateRequest>,
    /// Answers in order.
    pub replies: Producer<StateReply>,
    /// Models to stage.
    pub offers: Consumer<Offer>,
    /// Changes of the model in use, in order.
    pub model_requests: Consumer<ModelSwapRequest>,
    /// Answers in order.
    pub model_replies: Producer<ModelSwapReply>,
    /// Models to be freed.
    pub retired: Producer<ModelCandidate>,
    /// Every tick.
    pub records: Producer<Record>,
    /// The same with all that it saw and did, for the black box.
    pub recorder: RecorderEnds,
    /// Every event.
    pub events: Producer<CycleEvent>,
    /// What the guard feels; there is none before shared memory is up.
    pub pulse: Option<Pulse>,
}

/// The ends that the thread of shared memory holds.
pub struct RelayEnds {
    /// Newest servo command.
    pub servo: triple_buffer::Input<Option<ServoCommand>>,
    /// Newest picture of the snake.
    pub external: triple_buffer::Input<Option<ExternalPose>>,
    /// State commands in order.
    pub requests: Producer<StateRequest>,
    /// Answers in order.
    pub replies: Consumer<StateReply>,
    /// Every tick.
    pub records: Consumer<Record>,
}

/// The ends that the thread of the models holds.
pub struct KeeperEnds {
    /// Models to stage.
    pub offers: Producer<Offer>,
    /// Changes of the model in use, in order.
    pub requests: Producer<ModelSwapRequest>,
    /// Answers in order.
    pub replies: Consumer<ModelSwapReply>,
    /// Models to be freed.
    pub retired: Consumer<ModelCandidate>,
}

/// All lanes between the loop, the thread of shared memory, and the log.
#[must_use]
pub fn lanes(recorder: RecorderEnds) -> (LoopEnds, RelayEnds, KeeperEnds, Consumer<CycleEvent>) {
    let (servo_in, servo_out) = triple_buffer(&None);
    let (external_in, external_out) = triple_buffer(&None);
    let (requests_in, requests_out) = RingBuffer::new(COMMANDS);
    let (replies_in, replies_out) = RingBuffer::new(COMMANDS);
    let (records_in, records_out) = RingBuffer::new(REPORTS);
    let (events_in, events_out) = RingBuffer::new(EVENTS);
    let (offers_in, offers_out) = RingBuffer::new(MODELS);
    let (model_requests_in, model_requests_out) = RingBuffer::new(MODELS);
    let (model_replies_in, model_replies_out) = RingBuffer::new(MODELS);
    let (retired_in, retired_out) = RingBuffer::new(MODELS);
    let of_loop = LoopEnds {
        servo: servo_out,
        external: external_out,
        requests: requests_out,
        replies: replies_in,
        offers: offers_out,
        model_requests: model_requests_out,
        model_replies: model_replies_in,
        retired: retired_in,
        records: records_in,
        recorder,
        events: events_in,
        pulse: None,
    };
    let of_relay = RelayEnds {
        servo: servo_in,
        external: external_in,
        requests: requests_in,
        replies: replies_out,
        records: records_out,
    };
    let of_keeper = KeeperEnds {
        offers: offers_in,
        requests: model_requests_in,
        replies: model_replies_out,
        retired: retired_out,
    };
    (of_loop, of_relay, of_keeper, events_out)
}
