//! The control loop: the real-time thread.
//!
//! No allocation, no lock, no I/O: only [`ControlCycle::step`] and wait-free channels.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::clock;
use crate::config::ControlConfig;
use crate::core::cycle::ControlCycle;
use crate::core::{CycleInputs, CycleOutputs, CycleReport, Gated};
use crate::drive::AxisFeedback;
use crate::drive::line_turn::{LoopBeat, PortLife};
use crate::drive::port_runner::AxisLink;
use crate::ipc::heartbeat::{Heartbeat, HeartbeatWriter};
use crate::process::black_box::{RecorderChannels, TickRecord};
use crate::process::channels::{LoopChannels, LostCounters, TickReport};
use crate::realtime::{SuspendMonitor, Tick, TickTiming, Ticker};
use crate::robot::{DrivePower, OperatingState};
use crate::units::{AUXILIARY, MAX_AXES, Nanos};

/// Spin time before each tick: waking from sleep takes tens of microseconds.
const SPIN: Nanos = Nanos::from_micros(100);

/// Everything the loop needs; built before the thread starts.
pub(super) struct ControlLoop {
    pub cycle: ControlCycle,
    pub channels: LoopChannels,
    pub links: Vec<AxisLink<Gated>>,
    pub beats: Arc<Beats>,
    pub lost_after: Nanos,
}

/// State of the loop from tick to tick, in addition to that of the cycle.
struct Books {
    recording: TickRecording,
    lost: Lost,
    suspends: SuspendMonitor,
}

/// Recipients of the loop heartbeat: the watchdog and the port threads.
pub(super) struct Beats {
    pub heartbeat: HeartbeatWriter,
    pub line: LoopBeat,
    pub lives: Vec<PortLife>,
}

impl Beats {
    /// Writes one heartbeat. Wait-free.
    pub(super) fn write(&self, beat: Heartbeat) {
        let mut alive = [Nanos::ZERO; MAX_AXES];
        for (alive, life) in alive.iter_mut().zip(&self.lives) {
            *alive = life.seen();
        }
        self.heartbeat.write(Heartbeat { alive, ..beat });
        // Written last: a port thread must not see a newer heartbeat than the watchdog.
        self.line.set(beat.stamp);
    }
}

impl ControlLoop {
    /// Runs one cycle per tick from `first` on, until the cycle has shut down.
    pub(super) fn run(mut self, config: &ControlConfig, first: Nanos, shutdown: &AtomicBool) {
        let spin = if config.priority > 0 { SPIN } else { Nanos::ZERO };
        let mut ticker = Ticker::new(first, config.period(), spin);
        let mut books = Books {
            recording: TickRecording::new(config.rate_hz),
            lost: Lost::default(),
            suspends: SuspendMonitor::start(),
        };
        books.recording.push_snapshot(&self.cycle, &mut self.channels.recorder);
        while !self.run_tick(ticker.wait(), &mut books, shutdown) {}
    }

    /// One tick, from its inputs to the black box. Returns whether the cycle has shut down.
    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    fn run_tick(&mut self, tick: Tick, books: &mut Books, shutdown: &AtomicBool) -> bool {
        let Books { recording, lost, suspends } = books;
        let offered = self.take_offer();
        // The tick clock stood still during suspend: the number of missed ticks is unknown.
        let missed = match suspends.update(clock::suspended()) {
            None => u32::try_from(tick.missed).unwrap_or(u32::MAX - 1),
            Some(_) => u32::MAX,
        };
        let inputs = self.read_inputs(missed, shutdown);
        let outputs = self.cycle.step(tick.started, &inputs);
        for link in &mut self.links {
            let request = match link.motor {
                AUXILIARY => outputs.auxiliary.as_ref(),
                motor => outputs.requests.get(motor),
            };
            if let Some(request) = request {
                link.requests.write(*request);
            }
        }
        lost.counters.records = recording.lost;
        self.pass_on(&outputs, lost);
        let report = outputs.report;
        let off = is_off(&report)
            && self.links.iter().all(|link| {
                // Only a recent drive report counts.
                let oldest = Nanos(tick.started.0.saturating_sub(self.lost_after.0));
                let power = feedback(link, &inputs).map(|feedback| feedback.power(oldest));
                power == Some(DrivePower::Off)
            });
        let owing = self.links.iter().filter(|link| link.pending_reply.load(Ordering::Relaxed));
        let owing = owing.fold(0, |motors, link| motors | 1 << link.motor);
        let read = self.links.iter().filter_map(|link| Some(feedback(link, &inputs)?.stamp));
        let good_until = read.min().unwrap_or_default() + self.lost_after;
        let stamp = tick.started;
        self.beats.write(Heartbeat { stamp, off, owing, good_until, ..Heartbeat::default() });
        let timing = TickTiming { tick, ended: clock::now() };
        let channels = &mut self.channels;
        let tick_report = TickReport { report, timing, lost: lost.counters };
        lost.counters.reports += u64::from(channels.reports.push(tick_report).is_err());
        let record = TickRecord { number: 0, offered, inputs, outputs, timing };
        recording.push_tick(record, &mut channels.recorder);
        recording.push_snapshot(&self.cycle, &mut channels.recorder);
        outputs.finished
    }

    /// Passes replies, events and models on to slower threads. A full channel means that one of
    /// them stalls: its replies and events are lost and counted, and the loop continues.
    fn pass_on(&mut self, outputs: &CycleOutputs, lost: &mut Lost) {
        let channels = &mut self.channels;
        let counters = &mut lost.counters;
        if let Some(reply) = outputs.reply {
            counters.replies += u64::from(channels.replies.push(reply).is_err());
        }
        if let Some(reply) = outputs.model_reply {
            counters.replies += u64::from(channels.model_replies.push(reply).is_err());
        }
        for event in outputs.events.into_iter().flatten() {
            lost.events_not_pushed += u64::from(channels.events.push(event).is_err());
        }
        counters.events = lost.events_not_pushed + self.cycle.lost_events();
        // Nothing is freed here: a model that does not fit into the channel stays in the cycle.
        if !channels.retired.is_full()
            && let Some(retired) = self.cycle.take_retired()
        {
            let _ = channels.retired.push(retired);
        }
    }

    /// Passes the next model to the cycle, if it accepts one. Returns the number of the offer.
    fn take_offer(&mut self) -> Option<u64> {
        if self.channels.offers.is_empty() || !self.cycle.can_stage_model() {
            return None;
        }
        let offer = self.channels.offers.pop().ok()?;
        self.cycle.stage_model(offer.candidate);
        Some(offer.number)
    }

    fn read_inputs(&mut self, missed: u32, shutdown: &AtomicBool) -> CycleInputs {
        let channels = &mut self.channels;
        let [first, second, auxiliary] = read_feedback(&mut self.links);
        CycleInputs {
            servo: newest(&mut channels.servo),
            jaw: newest(&mut channels.jaw),
            request: channels.next_request(),
            model: channels.model_requests.pop().ok(),
            external: newest(&mut channels.external),
            ignored_frames: channels.ignored_frames.load(Ordering::Relaxed),
            missed,
            feedback: [first, second],
            auxiliary,
            shutdown: shutdown.load(Ordering::Acquire),
        }
    }
}

#[derive(Debug, Default)]
struct Lost {
    counters: LostCounters,
    /// Only the events that did not fit into the channel; others did not fit into a tick.
    events_not_pushed: u64,
}

/// The value of a triple buffer, if it was written since the last call.
fn newest<T: Copy + Send>(buffer: &mut triple_buffer::Output<Option<T>>) -> Option<T> {
    buffer.update().then(|| *buffer.output_buffer()).flatten()
}

fn read_feedback(links: &mut [AxisLink<Gated>]) -> [AxisFeedback; MAX_AXES] {
    let mut feedback = [AxisFeedback::default(); MAX_AXES];
    for link in links {
        if let Some(slot) = feedback.get_mut(link.motor) {
            *slot = *link.feedback.read();
        }
    }
    feedback
}

struct TickRecording {
    ticks: u64,
    interval: u64,
    /// Tick from which the next snapshot is due.
    next_snapshot: u64,
    lost: u64,
}

impl TickRecording {
    /// With one snapshot per second.
    fn new(rate_hz: u32) -> Self {
        Self { ticks: 0, interval: u64::from(rate_hz), next_snapshot: 0, lost: 0 }
    }

    fn push_tick(&mut self, tick: TickRecord, recorder: &mut RecorderChannels) {
        self.ticks += 1;
        let number = self.ticks;
        // A full channel means that the recorder stalls; it detects the gap in the numbers.
        let pushed = recorder.ticks.push(TickRecord { number, ..tick });
        self.lost += u64::from(pushed.is_err());
    }

    fn push_snapshot(&mut self, cycle: &ControlCycle, recorder: &mut RecorderChannels) {
        if self.ticks >= self.next_snapshot
            && !recorder.snapshots.is_full()
            && let Some(snapshot) = cycle.snapshot()
            && recorder.snapshots.push(snapshot).is_ok()
        {
            self.next_snapshot = self.ticks + self.interval;
        }
    }
}

/// Whether every drive may be off: no request to power any is pending.
fn is_off(report: &CycleReport) -> bool {
    match report.state {
        OperatingState::Disabled => !report.busy,
        OperatingState::Fault => true,
        OperatingState::Enabled | OperatingState::Paused => false,
    }
}

fn feedback<'a>(link: &AxisLink<Gated>, inputs: &'a CycleInputs) -> Option<&'a AxisFeedback> {
    match link.motor {
        AUXILIARY => Some(&inputs.auxiliary),
        motor => inputs.feedback.get(motor),
    }
}
