//! The IPC thread: shared memory on one side, the loop on the other.
//!
//! It passes the newest commands and all requests to the loop and publishes every tick that the
//! loop reports. Calls into shared memory may take a hundred microseconds when a client connects or
//! disconnects, so they are made here, not in the loop.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::clock;
use crate::config::LineBounds;
use crate::core::{CommandCheck, CycleReport, ServoCommand, StateReply, StateRequest};
use crate::drive::line_turn::LoopBeat;
use crate::ipc::payload::{
    AdaptationMsg, BlackBoxReply, Health, OperatingStateMsg, StateCommandReply, Version,
    VirtualFixturesMsg, padded_text,
};
use crate::ipc::server::{COMMAND_POLL_LEAD, ReceivedCommand};
use crate::ipc::watchdog_presence::{PortsDigest, WatchdogStatus};
use crate::ipc::{Request, Server, StreamMessage};
use crate::model::ModelId;
use crate::process::black_box::RecorderRequest;
use crate::process::camera_owner::CameraOwner;
use crate::process::channels::{IpcChannels, RequestQueues, TickReport};
use crate::process::fixture_table::FixtureTable;
use crate::process::loop_history::SharedLoopHistory;
use crate::process::loop_statistics::LoopStatistics;
use crate::process::payload_conversion as convert;
use crate::realtime::{Granted, Schedule};
use crate::robot::{OperatingState, Refusal, StateCommand};
use crate::units::{MAX_OUTPUTS, Nanos};

const ADAPTATION_PERIOD: Nanos = Nanos::from_millis(20);

const STATISTICS_WINDOW: Nanos = Nanos::from_millis(1000);

const WATCHDOG_PERIOD: Nanos = Nanos::from_millis(100);
/// Ticks that the loop history may lag: the capacity of the report ring.
const LATE_TICKS: usize = 256;

/// Maximum number of log lines and reasons published per pass.
const LOG_ENTRIES: usize = 16;

/// Time from the start of a tick to reading its report: longer than a tick takes. A later report is
/// read before the next tick.
const REPORT_LAG: Nanos = Nanos::from_micros(100);

/// Parts of the IPC thread besides the server.
pub(super) struct IpcThreadParts {
    pub channels: IpcChannels,
    /// Robot and limits, for the reply to `version`.
    pub robot: Version,
    pub motors: u32,
    /// Ports that a watchdog must have open.
    pub ports: PortsDigest,
    /// Shared with the port threads: whether a port was opened and whether a watchdog takes over.
    pub beat: LoopBeat,
    pub command_check: CommandCheck,
    pub history: SharedLoopHistory,
    pub queues: RequestQueues,
    pub fixtures: FixtureTable,
    pub period: Nanos,
    pub line: LineBounds,
}

pub(super) struct IpcThread {
    server: Server,
    parts: IpcThreadParts,
    granted: Granted,
    watchdog: WatchdogStatus,
    cameras: CameraOwner,
    next_watchdog: Nanos,
    statistics: LoopStatistics,
    /// Updated every tick, published with the statistics.
    health: Health,
    /// Updated every tick, published at [`ADAPTATION_PERIOD`].
    adaptation: AdaptationMsg,
    next_adaptation: Nanos,
    /// Ticks not yet in the loop history because another thread was reading it.
    late: VecDeque<CycleReport>,
    model: Option<ModelId>,
    lease_client_id: u64,
    state: OperatingState,
}

impl IpcThread {
    /// `granted`: actual scheduling of the loop.
    pub(super) fn new(server: Server, parts: IpcThreadParts, granted: Granted) -> Self {
        let model = parts.history.lock().slots.active;
        let statistics =
            LoopStatistics::new(parts.period, STATISTICS_WINDOW, granted.clone(), parts.line);
        let mut thread = Self {
            server,
            statistics,
            health: Health::default(),
            adaptation: AdaptationMsg::default(),
            next_adaptation: Nanos::ZERO,
            late: VecDeque::with_capacity(LATE_TICKS),
            parts,
            granted,
            watchdog: WatchdogStatus::Absent,
            cameras: CameraOwner::default(),
            next_watchdog: Nanos::ZERO,
            model: None,
            lease_client_id: 0,
            state: OperatingState::Disabled,
        };
        thread.server.describe_robot(&thread.parts.robot);
        thread.describe(model);
        thread
    }

    /// Makes one pass shortly before every tick of the loop, so that the tick gets the newest
    /// command, and publishes its report shortly after it, until `quit`. `first` is the first tick
    /// of the loop.
    pub(super) fn run(mut self, first: Nanos, quit: &AtomicBool) {
        let mut grid = Schedule::new(first, self.parts.period);
        while !quit.load(Ordering::Acquire) {
            clock::sleep_until(grid.next - COMMAND_POLL_LEAD);
            let now = clock::now();
            self.pass(now);
            clock::sleep_until(grid.next + REPORT_LAG);
            self.take_reports();
            // Missed passes are skipped.
            grid.begin(now);
        }
        self.pass(clock::now());
    }

    /// One pass: commands in, replies and messages out, housekeeping.
    fn pass(&mut self, now: Nanos) {
        if now >= self.next_watchdog {
            self.next_watchdog = now + WATCHDOG_PERIOD;
            self.look_for_watchdog(now);
        }
        self.take_servo(now);
        let frames = self.server.poll_cameras();
        let valid = frames.iter().filter_map(|(from, raw)| Some((*from, convert::external(raw)?)));
        if let Some(external) = self.cameras.choose(valid, now) {
            self.parts.channels.external.write(Some(external));
        }
        self.parts.channels.ignored_frames.store(self.cameras.ignored, Ordering::Relaxed);
        self.take_requests(now);
        self.send_slow_replies();
        self.take_reports();
        self.publish_adaptation(now);
        self.update_history();
        if let Some(statistics) = self.statistics.take(now) {
            self.server.publish(StreamMessage::Statistics(statistics));
            let health = Health { stamp_ns: now.0, ..self.health };
            self.server.publish(StreamMessage::Health(health));
            self.publish_fixtures(now);
        }
        for message in self.parts.channels.log_entries.try_iter().take(LOG_ENTRIES) {
            self.server.publish(message);
        }
        self.server.maintain(now);
    }

    fn look_for_watchdog(&mut self, now: Nanos) {
        let IpcThreadParts { ports, beat, .. } = &self.parts;
        let opened = beat.opened();
        self.watchdog = WatchdogStatus::read_since(self.server.domain(), ports, opened, now);
        beat.set_watched(self.watchdog.acts());
    }

    /// Refuses power while a watchdog runs that cannot stop the drives: the operator relies on it.
    fn check_watchdog(
        &mut self,
        request: StateRequest,
        now: Nanos,
    ) -> Result<StateRequest, Refusal> {
        if !matches!(request.command, StateCommand::Enable | StateCommand::Home) {
            return Ok(request);
        }
        self.look_for_watchdog(now);
        match self.watchdog {
            WatchdogStatus::Absent | WatchdogStatus::Watching => Ok(request),
            _ => Err(Refusal::WatchdogNotReady),
        }
    }

    fn take_reports(&mut self) {
        while let Ok(reply) = self.parts.channels.replies.pop() {
            self.reply(reply);
        }
        while let Some(report) = self.take_report() {
            self.publish(&report);
        }
    }

    /// Only the lease holder replaces a command that the loop has not read yet.
    fn take_servo(&mut self, now: Nanos) {
        let (check, holder) = (self.parts.command_check, self.lease_client_id);
        let is_valid = |raw: &ReceivedCommand| check.check(&ServoCommand::from(raw), now).is_ok();
        let command = if self.parts.channels.servo.consumed() {
            self.server.poll_command(holder, is_valid)
        } else {
            self.server.poll_command_of(holder, is_valid)
        };
        if let Some(command) = command {
            self.pass_command(ServoCommand::from(&command));
        }
        if self.parts.channels.jaw.consumed()
            && let Some(command) = self.server.poll_jaw(holder, is_valid)
        {
            self.parts.channels.jaw.write(Some(ServoCommand::from(&command)));
        }
    }

    /// Passes a command to the control loop: wait-free.
    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    fn pass_command(&mut self, command: ServoCommand) {
        self.parts.channels.servo.write(Some(command));
    }

    /// Takes the next tick from the control loop: wait-free.
    #[cfg_attr(realtime_sanitizer, sanitize(realtime = "nonblocking"))]
    fn take_report(&mut self) -> Option<TickReport> {
        self.parts.channels.reports.pop().ok()
    }

    fn take_requests(&mut self, now: Nanos) {
        for (id, request) in self.server.poll_requests(now) {
            match request {
                Request::StateCommand(raw) => {
                    let request = convert::state_request(id, &raw)
                        .and_then(|request| self.check_watchdog(request, now));
                    self.request(id, request);
                }
                Request::Move(raw) => self.request(id, convert::move_request(id, &raw)),
                Request::Fixture(raw) => {
                    self.parts.fixtures.sent(id, raw);
                    self.request(id, convert::fixture_request(id, &raw));
                }
                // If the thread has ended, the client times out.
                Request::Model(raw) => drop(self.parts.queues.models.send((id, raw))),
                Request::BlackBox(_) => {
                    drop(self.parts.queues.recorder.send(RecorderRequest::Write(id)));
                }
                // The server answers.
                Request::Version(_) => {}
            }
        }
    }

    fn publish_fixtures(&mut self, now: Nanos) {
        let message = VirtualFixturesMsg { stamp_ns: now.0, ..self.parts.fixtures.message };
        self.server.publish(StreamMessage::VirtualFixtures(message));
    }

    fn request(&mut self, id: u64, request: Result<StateRequest, Refusal>) {
        if let Err(refusal) = request.and_then(|request| self.parts.channels.ask(request)) {
            self.reply(StateReply { id, refusal, state: self.state, measurement: None });
        }
    }

    fn send_slow_replies(&mut self) {
        let queues = &self.parts.queues;
        while let Ok((token, reply)) = queues.model_replies.try_recv() {
            self.server.reply(token, reply);
        }
        while let Ok((token, outcome)) = queues.recorder_replies.try_recv() {
            let (ticks, text) = match outcome {
                Ok((path, ticks)) => (ticks, padded_text(&path.to_string_lossy())),
                Err(reason) => (0, padded_text(&reason)),
            };
            self.server.reply(token, BlackBoxReply { ticks, text });
        }
    }

    /// Sets the model in the reply to `version`; at the next tick if the history is locked.
    fn describe(&mut self, model: Option<ModelId>) {
        let Some(history) = self.parts.history.try_lock() else {
            return;
        };
        self.model = model;
        let outputs = history.model(model).map_or(&[][..], |known| &known.model.file().outputs);
        let mut names = [[0; 16]; MAX_OUTPUTS];
        for (name, output) in names.iter_mut().zip(outputs) {
            *name = padded_text(&output.name);
        }
        let shape = [self.parts.motors as u8, outputs.len().min(MAX_OUTPUTS) as u8];
        self.server.describe(shape, model.unwrap_or_default().0, names);
    }

    fn reply(&mut self, reply: StateReply) {
        if self.parts.fixtures.answered(reply.id, reply.refusal) {
            self.publish_fixtures(clock::now());
        }
        let payload = StateCommandReply::new(reply.refusal, reply.state, reply.measurement);
        self.server.reply(reply.id, payload);
    }

    /// Never waits: a suspended thread may hold the history, which would delay commands.
    fn update_history(&mut self) {
        if let Some(mut history) = self.parts.history.try_lock() {
            for report in self.late.drain(..) {
                history.update(&report);
            }
        }
    }

    /// Drift takes minutes: not every tick is published.
    fn publish_adaptation(&mut self, now: Nanos) {
        if now < self.next_adaptation {
            return;
        }
        let is_on = self.adaptation.flags & AdaptationMsg::ON != 0;
        self.next_adaptation = now + if is_on { ADAPTATION_PERIOD } else { STATISTICS_WINDOW };
        self.server.publish(StreamMessage::Adaptation(self.adaptation));
    }

    fn publish(&mut self, tick: &TickReport) {
        let report = &tick.report;
        self.parts.fixtures.update(report);
        self.health = convert::health(report, &tick.lost);
        self.adaptation = convert::adaptation(report);
        (self.lease_client_id, self.state) = (report.lease_client_id, report.state);
        self.statistics.record(tick.timing);
        if self.late.len() == LATE_TICKS {
            // The gap restarts the history.
            self.late.clear();
        }
        self.late.push_back(*report);
        if report.models.active != self.model {
            self.describe(report.models.active);
        }
        let [goal, setpoint, measured] = convert::joint_states(report);
        let (server, motors) = (&mut self.server, self.parts.motors);
        server.publish(StreamMessage::Goal(goal));
        server.publish(StreamMessage::Setpoint(setpoint));
        server.publish(StreamMessage::Measured(measured));
        server.publish(StreamMessage::Actuators(convert::actuator_state(report, motors)));
        if let Some(jaw) = convert::jaw_state(report) {
            server.publish(StreamMessage::Jaw(jaw));
        }
        let mut state = convert::operating_state(report, &self.granted);
        if self.watchdog == WatchdogStatus::Watching {
            state.flags |= OperatingStateMsg::WATCHED;
        }
        server.publish(StreamMessage::State(state));
    }
}
