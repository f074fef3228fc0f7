//! Channels between the threads: wait-free on the side of the loop, in both directions.
//!
//! Newest values pass through triple buffers: the writer never waits and the reader gets the latest
//! value. Values that must not be lost pass through rings; a full ring drops instead of waiting
//! (H13).

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::mpsc::{Receiver, Sender, channel};

use rtrb::{Consumer, Producer, RingBuffer};
use triple_buffer::triple_buffer;

use crate::core::{
    CycleEvent, CycleReport, ExternalPose, ModelCandidate, ModelSwapReply, ModelSwapRequest,
    ServoCommand, StateReply, StateRequest,
};
use crate::ipc::{StreamMessage, payload};
use crate::process::black_box::{RecorderChannels, RecorderRequest, WriteReply};
use crate::realtime::TickTiming;
use crate::robot::Refusal;

/// Ticks that the IPC thread may lag before reports are dropped: a quarter of a second at 1 kHz.
const REPORTS: usize = 256;
const EVENTS: usize = 1024;
/// State commands in flight; a client sends one and waits for its reply.
const COMMANDS: usize = 32;
/// Stop requests waiting for a tick. Each stops the robot, so further ones may be dropped.
const STOPS: usize = 256;
/// Models in flight; they are staged one at a time.
const MODELS: usize = 8;

#[derive(Debug)]
pub(super) struct ModelOffer {
    pub number: u64,
    pub candidate: ModelCandidate,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct TickReport {
    pub report: CycleReport,
    pub timing: TickTiming,
    pub lost: LostCounters,
}

/// Items that the loop could not pass on, since the start: a slower thread stalls.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LostCounters {
    pub events: u64,
    pub reports: u64,
    pub records: u64,
    pub replies: u64,
}

pub(super) struct LoopChannels {
    pub servo: triple_buffer::Output<Option<ServoCommand>>,
    /// Commands of the auxiliary axis.
    pub jaw: triple_buffer::Output<Option<ServoCommand>>,
    pub external: triple_buffer::Output<Option<ExternalPose>>,
    /// Frames of cameras that are not followed, since the start.
    pub ignored_frames: Arc<AtomicU64>,
    pub requests: Consumer<StateRequest>,
    /// Stop requests: taken before all others.
    pub stops: Consumer<StateRequest>,
    pub replies: Producer<StateReply>,
    pub offers: Consumer<ModelOffer>,
    pub model_requests: Consumer<ModelSwapRequest>,
    pub model_replies: Producer<ModelSwapReply>,
    /// Retired models, which the model manager frees.
    pub retired: Producer<ModelCandidate>,
    pub reports: Producer<TickReport>,
    pub recorder: RecorderChannels,
    pub events: Producer<CycleEvent>,
}

pub(super) struct IpcChannels {
    pub servo: triple_buffer::Input<Option<ServoCommand>>,
    /// Commands of the auxiliary axis.
    pub jaw: triple_buffer::Input<Option<ServoCommand>>,
    pub external: triple_buffer::Input<Option<ExternalPose>>,
    pub ignored_frames: Arc<AtomicU64>,
    pub requests: Producer<StateRequest>,
    pub stops: Producer<StateRequest>,
    pub replies: Consumer<StateReply>,
    pub reports: Consumer<TickReport>,
    /// Lines of the log and reasons, from the main thread.
    pub log_entries: Receiver<StreamMessage>,
}

impl LoopChannels {
    /// Next request; stop requests come first.
    pub(crate) fn next_request(&mut self) -> Option<StateRequest> {
        self.stops.pop().or_else(|_| self.requests.pop()).ok()
    }
}

impl IpcChannels {
    /// Passes a request to the loop; [`Refusal::Busy`]: its queue is full. Stops have their own.
    pub(super) fn ask(&mut self, request: StateRequest) -> Result<(), Refusal> {
        let queue = if request.command.only_stops() { &mut self.stops } else { &mut self.requests };
        queue.push(request).map_err(|_| Refusal::Busy)
    }
}

pub(super) struct ModelChannels {
    pub offers: Producer<ModelOffer>,
    pub requests: Producer<ModelSwapRequest>,
    pub replies: Consumer<ModelSwapReply>,
    pub retired: Consumer<ModelCandidate>,
}

/// All channels of the loop, and the events for the log.
pub(crate) fn loop_channels(
    recorder: RecorderChannels,
    log_entries: Receiver<StreamMessage>,
) -> (LoopChannels, IpcChannels, ModelChannels, Consumer<CycleEvent>) {
    let (servo_in, servo) = triple_buffer(&None);
    let (jaw_in, jaw) = triple_buffer(&None);
    let (external_in, external) = triple_buffer(&None);
    let ignored_frames = Arc::new(AtomicU64::new(0));
    let (requests_in, requests) = RingBuffer::new(COMMANDS);
    let (stops_in, stops) = RingBuffer::new(STOPS);
    let (replies, replies_out) = RingBuffer::new(COMMANDS + STOPS);
    let (reports, reports_out) = RingBuffer::new(REPORTS);
    let (events, events_out) = RingBuffer::new(EVENTS);
    let (offers_in, offers) = RingBuffer::new(MODELS);
    let (model_requests_in, model_requests) = RingBuffer::new(MODELS);
    let (model_replies, model_replies_out) = RingBuffer::new(MODELS);
    let (retired, retired_out) = RingBuffer::new(MODELS);
    let control_loop = LoopChannels {
        servo,
        jaw,
        external,
        ignored_frames: Arc::clone(&ignored_frames),
        requests,
        stops,
        replies,
        offers,
        model_requests,
        model_replies,
        retired,
        reports,
        recorder,
        events,
    };
    let ipc = IpcChannels {
        servo: servo_in,
        jaw: jaw_in,
        external: external_in,
        ignored_frames,
        requests: requests_in,
        stops: stops_in,
        replies: replies_out,
        reports: reports_out,
        log_entries,
    };
    let models = ModelChannels {
        offers: offers_in,
        requests: model_requests_in,
        replies: model_replies_out,
        retired: retired_out,
    };
    (control_loop, ipc, models, events_out)
}

/// A request about models or its reply, with the token that the server needs for the reply.
pub(super) type Tokened<T> = (u64, T);

/// Queues of the IPC thread to the slow threads.
pub(super) struct RequestQueues {
    pub models: Sender<Tokened<payload::ModelRequest>>,
    pub model_replies: Receiver<Tokened<payload::ModelReply>>,
    pub recorder: Sender<RecorderRequest>,
    pub recorder_replies: Receiver<WriteReply>,
}

/// Other ends of [`RequestQueues`].
pub(super) struct WorkerQueues {
    pub models: Receiver<Tokened<payload::ModelRequest>>,
    pub model_replies: Sender<Tokened<payload::ModelReply>>,
    pub recorder: Receiver<RecorderRequest>,
    pub recorder_replies: Sender<WriteReply>,
}

pub(crate) fn request_queues() -> (RequestQueues, WorkerQueues) {
    let (models, models_out) = channel();
    let (model_replies_in, model_replies) = channel();
    let (recorder, recorder_out) = channel();
    let (recorder_replies_in, recorder_replies) = channel();
    let ipc = RequestQueues { models, model_replies, recorder, recorder_replies };
    let workers = WorkerQueues {
        models: models_out,
        model_replies: model_replies_in,
        recorder: recorder_out,
        recorder_replies: recorder_replies_in,
    };
    (ipc, workers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Validity;
    use crate::robot::StateCommand;

    #[test]
    fn stop_requests_bypass_a_full_queue_and_come_first() {
        let (ticks, _ticks) = RingBuffer::new(1);
        let (snapshots, _snapshots) = RingBuffer::new(1);
        let recorder = RecorderChannels { ticks, snapshots };
        let (mut ends, mut ipc, ..) = loop_channels(recorder, channel().1);
        let request = |command| {
            let (id, client_id, validity) = (0, 7, Validity::ALWAYS);
            StateRequest { id, client_id, validity, command, pose: None, fixture: None }
        };
        while ipc.ask(request(StateCommand::Acknowledge)).is_ok() {}
        for stop in [StateCommand::Disable, StateCommand::Pause, StateCommand::Hold] {
            assert_eq!(ipc.ask(request(stop)), Ok(()));
            assert_eq!(ends.next_request().map(|it| it.command), Some(stop));
        }
        assert_eq!(ipc.ask(request(StateCommand::Enable)), Err(Refusal::Busy));
        assert_eq!(ends.next_request().map(|it| it.command), Some(StateCommand::Acknowledge));
    }
}
