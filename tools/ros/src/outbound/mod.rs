//! Path from the controller to ROS: reads what the controller publishes, and publishes it.

mod conversion;
mod lines;

use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use i2ris::clock;
use i2ris::ipc::client::{Latest, Subscription, Watcher};
use i2ris::ipc::payload::{
    JointState as JointPayload, OperatingStateMsg, PeriodStatistics, ReasonMsg,
};
use i2ris::units::Nanos;
use i2ris_report::snake::Snake;
use ros2_client::log::LogLevel;
use ros2_client::rosout::RosoutRaw;
use ros2_client::{Node, Publisher};
use serde::Serialize;

use crate::Options;
use crate::clock::Moment;
use crate::event::{ClientNames, Event, Refusals};
use crate::message::{Header, OperatingState, Outputs, Text};
use crate::participant::NODE;
use conversion::{Snapshot, StateReport, UNDEFINED};
use lines::{Level, Lines};

/// Period of publishing the pose of the tip and the frames, as in cisst-ros.
const POSE_PERIOD: Nanos = Nanos::from_millis(20);
const LOOK_PERIOD: Nanos = Nanos::from_millis(2);
/// Number of times that a new reader gets the state: messages sent before it knows the writer are
/// lost if it requests no stored ones.
const GREETINGS: u32 = 5;
const GREETING_PERIOD: Nanos = Nanos::from_millis(250);

/// The operating state that was published last, for services.
pub(crate) type SharedState = Arc<Mutex<OperatingState>>;

pub(crate) fn lock(state: &SharedState) -> MutexGuard<'_, OperatingState> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(crate) struct Outbound {
    outputs: Outputs,
    node: Node,
    snake: Snake,
    period: Nanos,
    measured: Latest<JointPayload>,
    setpoint: Latest<JointPayload>,
    goal: Latest<JointPayload>,
    jaw: Latest<JointPayload>,
    statistics: Subscription<PeriodStatistics>,
    states: Subscription<OperatingStateMsg>,
    errors: Subscription<ReasonMsg>,
    warnings: Subscription<ReasonMsg>,
    events: Receiver<Event>,
    report: StateReport,
    stamp_unix_ns: u64,
    /// Number of times that new readers still get it, and the next time.
    greetings: (u32, Nanos),
    shared: SharedState,
    refusals: Refusals,
    lines: Lines,
    started: Nanos,
}

impl Outbound {
    pub fn new(
        (outputs, node): (Outputs, Node),
        options: &Options,
        (events, names): (Receiver<Event>, ClientNames),
        shared: SharedState,
    ) -> Self {
        let watcher = Watcher::new(&options.domain);
        Self {
            outputs,
            node,
            snake: Snake::new(&options.robot),
            period: options.period,
            measured: Latest::new(watcher.measured_js()),
            setpoint: Latest::new(watcher.setpoint_js()),
            goal: Latest::new(watcher.goal_js()),
            jaw: Latest::new(watcher.jaw_measured_js()),
            statistics: watcher.period_statistics(),
            states: watcher.operating_state(),
            errors: watcher.error(),
            warnings: watcher.warning(),
            events,
            report: StateReport::default(),
            stamp_unix_ns: 0,
            greetings: (0, Nanos::ZERO),
            shared,
            refusals: Refusals::default(),
            lines: Lines::new(names),
            started: clock::now(),
        }
    }

    /// Publishes until `stop`; passes every line also to `say`.
    pub fn run(mut self, stop: impl Fn() -> bool, mut say: impl FnMut(&str)) {
        publish(&self.outputs.description, Text { data: self.snake.urdf() });
        self.publish_state(Some(UNDEFINED));
        let look = self.period.min(LOOK_PERIOD);
        let (mut next, mut next_joints, mut next_pose) = (clock::now(), Nanos::ZERO, Nanos::ZERO);
        while !stop() {
            let now = Moment::now();
            self.look(now.monotonic, &mut say);
            if now.monotonic >= next_joints {
                next_joints = following(next_joints, self.period, now.monotonic);
                self.publish_joints();
            }
            if now.monotonic >= next_pose {
                next_pose = following(next_pose, POSE_PERIOD, now.monotonic);
                self.publish_pose();
                self.publish_statistics();
            }
            next = following(next, look, clock::now());
            clock::sleep_until(next);
        }
    }

    fn look(&mut self, now: Nanos, say: &mut impl FnMut(&str)) {
        // Before the states: an answer changes their meaning.
        while let Ok(event) = self.events.try_recv() {
            self.take(event, now, say);
        }
        let mut messages = Vec::new();
        let lines = match self.states.drain(|message| messages.push(message)) {
            Ok(_) => {
                for message in &messages {
                    let changed = self.report.state(message);
                    self.publish_state(changed);
                }
                messages.last().map(|last| self.lines.state(last)).unwrap_or_default()
            }
            Err(error) => {
                let changed = self.report.absent();
                self.publish_state(changed);
                self.lines.absent(&error).into_iter().collect()
            }
        };
        for (level, line) in lines {
            self.say(level, line, say);
        }
        self.greet(now);
        self.read_reasons(say);
        for line in self.refusals.due(now) {
            self.say(Level::Warning, line, say);
        }
    }

    fn read_reasons(&mut self, say: &mut impl FnMut(&str)) {
        let mut reasons = Vec::new();
        // Without a controller there are none.
        let _ = self.errors.drain(|message| reasons.push((Level::Error, message)));
        let _ = self.warnings.drain(|message| reasons.push((Level::Warning, message)));
        for (level, message) in self.lines.news(reasons, self.started) {
            let line = self.lines.reason(&message, clock::now());
            self.say(level, line, say);
        }
    }

    fn take(&mut self, event: Event, now: Nanos, say: &mut impl FnMut(&str)) {
        match event {
            Event::Refused(refused) => {
                if let Some(line) = self.refusals.add(refused, now) {
                    self.say(Level::Warning, line, say);
                }
            }
            Event::Status(line) => self.say(Level::Status, line, say),
            Event::Warning(line) => self.say(Level::Warning, line, say),
            Event::StateRepeated => self.publish_state(Some(self.report.published)),
            Event::ReaderFound => self.greetings = (GREETINGS, now),
            Event::MoveRequested => self.report.move_requested(),
            Event::MoveAnswered(since) => {
                let changed = self.report.move_answered(since);
                self.publish_state(changed);
            }
        }
    }

    /// Sends the state to new readers with its old stamp: clients ignore what precedes a command.
    fn greet(&mut self, now: Nanos) {
        let (left, due) = self.greetings;
        if left > 0 && now >= due {
            self.greetings = (left - 1, now + GREETING_PERIOD);
            self.publish_state_at(self.report.published, self.stamp_unix_ns);
        }
    }

    fn publish_state(&mut self, changed: Option<Snapshot>) {
        if let Some(snapshot) = changed {
            self.publish_state_at(snapshot, Moment::now().unix_ns);
        }
    }

    fn publish_state_at(&mut self, snapshot: Snapshot, unix_ns: u64) {
        self.stamp_unix_ns = conversion::rising(self.stamp_unix_ns, unix_ns);
        let message = OperatingState {
            header: Header::new(self.stamp_unix_ns, ""),
            state: snapshot.state.to_owned(),
            is_homed: snapshot.homed,
            is_busy: snapshot.busy,
        };
        *lock(&self.shared) = message.clone();
        publish(&self.outputs.operating_state, message);
    }

    fn publish_joints(&mut self) {
        // Without a controller nothing is known.
        let measured = self.measured.refresh().ok().flatten();
        let setpoint = self.setpoint.refresh().ok().flatten();
        let goal = self.goal.refresh().ok().flatten();
        let now = Moment::now();
        let [measured, setpoint, goal] =
            [measured, setpoint, goal].map(|state| conversion::joint_state(state, &now));
        publish(&self.outputs.measured_js, measured);
        publish(&self.outputs.setpoint_js, setpoint);
        publish(&self.outputs.goal_js, goal);
        // Robots without a jaw have none.
        if let Some(jaw) = self.jaw.refresh().ok().flatten() {
            publish(&self.outputs.jaw_measured_js, conversion::jaw(jaw, &now));
        }
    }

    fn publish_pose(&mut self) {
        let measured = self.measured.refresh().ok().flatten();
        let setpoint = self.setpoint.refresh().ok().flatten();
        let now = Moment::now();
        let [tip, wanted] =
            [measured, setpoint].map(|state| conversion::tip(&self.snake, state, &now));
        publish(&self.outputs.measured_cp, tip);
        publish(&self.outputs.setpoint_cp, wanted);
        publish(&self.outputs.measured_cv, conversion::twist(&self.snake, measured, &now));
        if let Some(jacobian) = conversion::jacobian(&self.snake, measured, &now) {
            publish(&self.outputs.jacobian, jacobian);
        }
        if let Some(links) = conversion::links(&self.snake, measured, &now) {
            publish(&self.outputs.transforms, links);
        }
    }

    fn publish_statistics(&mut self) {
        let mut seen = Vec::new();
        let _ = self.statistics.drain(|message| seen.push(message));
        for message in &seen {
            let message = conversion::statistics(message, &Moment::now());
            publish(&self.outputs.period_statistics, message);
        }
    }

    fn say(&self, level: Level, line: String, say: &mut impl FnMut(&str)) {
        say(&format!("{}: {line}", level.word()));
        let (publisher, log_level) = match level {
            Level::Error => (&self.outputs.error, LogLevel::Error),
            Level::Warning => (&self.outputs.warning, LogLevel::Warn),
            Level::Status => (&self.outputs.status, LogLevel::Info),
        };
        let stamp = ros2_client::builtin_interfaces::Time::now();
        self.node.rosout_raw(stamp, log_level, NODE, &line, "", "", 0);
        publish(publisher, Text { data: line });
    }
}

/// The next instant of a grid after `now`; missed ones are skipped.
fn following(planned: Nanos, period: Nanos, now: Nanos) -> Nanos {
    let next = planned + period;
    if next > now { next } else { now + period }
}

/// Publishes, or drops the message if a reader is stopped: it gets the next one.
fn publish<M: Serialize>(publisher: &Publisher<M>, message: M) {
    let _ = publisher.publish(message);
}
