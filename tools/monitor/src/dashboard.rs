//! Everything that the monitor knows, and the subscriptions that fill it, which only read.

use std::borrow::Cow;
use std::fs;

use i2ris::clock;
use i2ris::ipc::client::{self, ClientError, Subscription, Watcher};
use i2ris::ipc::payload::{ActuatorState, OperatingStateMsg, ReasonMsg};
use i2ris::ipc::{ClientProcess, Domain, Message, Stream, StreamMessage, find_client_process};
use i2ris::units::{MAX_MOTORS, Nanos};
use i2ris_report::model_poller::Known;
use i2ris_report::view::{LatestMessages, State, View};

use super::event_log::EventLog;
use super::history::History;

#[derive(Debug, Clone, Default)]
pub struct Dashboard {
    /// Kept when the controller ends, and stale then.
    pub messages: LatestMessages,
    /// The last refusals, stops and clips, in the order in which they came.
    pub warnings: Vec<ReasonMsg>,
    pub commander: Option<String>,
    /// Reason why the controller is not reachable, if it is not.
    pub problem: Option<String>,
    pub history: History,
    pub event_log: EventLog,
    pub models: Known,
}

impl Dashboard {
    pub fn view(&self, now: Nanos) -> View {
        let view = View::new(&self.messages, now);
        let commander = self.commander.clone();
        View {
            problem: self.problem.clone(),
            state: view.state.map(|state| State { commander, ..state }),
            models: self.models.models.clone(),
            events: self.event_log.newest(now),
            ..view
        }
    }
}

/// Period of reading the streams: their buffers hold 128 messages.
pub const READ_PERIOD: Nanos = Nanos::from_millis(20);
/// Warnings that are kept: as many as a controller sends to a new subscriber.
const WARNINGS: usize = 16;
/// Time over which counters become rates; the first rate comes early, from fewer exchanges.
const RATE_SPAN: Nanos = Nanos::from_millis(1000);
const FIRST_SPAN: Nanos = Nanos::from_millis(250);

/// All but the operating state, in the order in which the event log lists simultaneous events.
const STREAMS: [Stream; 16] = [
    Stream::Actuators,
    Stream::Jaw,
    Stream::Goal,
    Stream::Setpoint,
    Stream::Measured,
    Stream::Events,
    Stream::Error,
    Stream::Warning,
    Stream::Health,
    Stream::Adaptation,
    Stream::VirtualFixtures,
    Stream::ReachTarget,
    Stream::Teleop,
    Stream::Trial,
    Stream::Statistics,
    Stream::External,
];

pub struct Subscriptions {
    state: Subscription<OperatingStateMsg>,
    others: client::Subscriptions,
    commander: Commander,
    exchanges: Exchanges,
    boot_id: Option<u64>,
}

impl Subscriptions {
    pub fn new(domain: &Domain) -> Self {
        let watcher = Watcher::new(domain);
        Self {
            state: watcher.operating_state(),
            others: client::Subscriptions::new(&watcher, &STREAMS),
            commander: Commander::new(domain),
            exchanges: Exchanges::default(),
            boot_id: None,
        }
    }

    /// Reads what has arrived. Returns whether the controller was restarted or the model changed.
    pub fn refresh(&mut self, dashboard: &mut Dashboard, now: Nanos) -> bool {
        let model = dashboard.messages.measured.map(|measured| measured.model_id);
        let outcome = self.read(dashboard);
        dashboard.problem = outcome.as_ref().err().map(ToString::to_string);
        dashboard.event_log.update_connection(dashboard.problem.as_deref(), now);
        dashboard.event_log.update_camera(&dashboard.messages, now);
        dashboard.commander = self.commander.name(dashboard.messages.state.as_ref(), now);
        dashboard.history.sample(&dashboard.messages, now);
        outcome.unwrap_or(false)
            || model != dashboard.messages.measured.map(|measured| measured.model_id)
    }

    fn read(&mut self, dashboard: &mut Dashboard) -> Result<bool, ClientError> {
        let Dashboard { messages: view, warnings, history, event_log, .. } = dashboard;
        let mut states = Vec::new();
        self.state.drain(|message| states.push(message))?;
        let (is_restarted, was_known) =
            (self.boot_id != self.state.boot_id(), self.boot_id.is_some());
        if is_restarted {
            // Messages from before the restart are invalid.
            (self.boot_id, *view) = (self.state.boot_id(), LatestMessages::default());
            warnings.clear();
            if was_known {
                event_log.restart(clock::now());
            }
        }
        view.state = states.last().copied().or(view.state);
        self.others.drain(|message| match message {
            StreamMessage::Actuators(message) => view.actuators = Some(message),
            StreamMessage::Events(message) => event_log.update_line(&message),
            StreamMessage::Jaw(message) => view.jaw = Some(message),
            StreamMessage::Goal(message) => view.goal = Some(message),
            StreamMessage::Setpoint(message) => view.setpoint = Some(message),
            StreamMessage::Measured(message) => view.measured = Some(message),
            StreamMessage::Error(message) => {
                event_log.update_reason(&message);
                view.error = Some(message);
            }
            StreamMessage::Warning(message) => {
                event_log.update_reason(&message);
                view.warning = Some(message);
                warnings.push(message);
                warnings.drain(..warnings.len().saturating_sub(WARNINGS));
            }
            StreamMessage::Health(message) => view.health = Some(message),
            StreamMessage::Adaptation(message) => view.adaptation = Some(message),
            StreamMessage::VirtualFixtures(message) => view.fixtures = Some(message),
            StreamMessage::ReachTarget(message) => view.target = Some(message),
            StreamMessage::Teleop(message) => view.hand = Some(message),
            StreamMessage::Trial(message) => view.trial = Some(message),
            StreamMessage::Statistics(message) => {
                event_log.update_ticks(&message);
                view.statistics = Some(message);
            }
            StreamMessage::External(message) => {
                history.add_frame(&message);
                view.camera = Some(message);
            }
            _ => {}
        })?;
        event_log.end_of_lines();
        view.exchange_rates =
            view.actuators.as_ref().and_then(|message| self.exchanges.rates(message));
        Ok(is_restarted)
    }
}

/// Turns counters into rates, about once a second.
#[derive(Debug, Default)]
struct Exchanges {
    before: Option<ActuatorState>,
    rates: Option<[f64; MAX_MOTORS]>,
}

impl Exchanges {
    /// `None` until there are two messages to compare.
    fn rates(&mut self, message: &ActuatorState) -> Option<[f64; MAX_MOTORS]> {
        let before = *self.before.get_or_insert(*message);
        let span = message.stamp() - before.stamp();
        if before.boot_id != message.boot_id {
            *self = Self { before: Some(*message), ..Self::default() };
        } else if span >= if self.rates.is_none() { FIRST_SPAN } else { RATE_SPAN } {
            self.rates = Some(std::array::from_fn(|motor| {
                message.exchanges[motor].saturating_sub(before.exchanges[motor]) as f64
                    / span.as_seconds()
            }));
            self.before = Some(*message);
        }
        self.rates
    }
}

/// Time between two attempts to find a process: it costs reading a folder.
const RETRY: Nanos = Nanos::from_millis(1000);

/// Name such as "i2ris calibrate collect, process 12, user 1000": for a program of many commands,
/// the command says more than the program.
fn name(process: &ClientProcess) -> String {
    let line = fs::read(format!("/proc/{}/cmdline", process.pid)).unwrap_or_default();
    let words = line.split(|byte| *byte == 0).skip(1).map(String::from_utf8_lossy);
    let is_word = |word: &Cow<'_, str>| word.bytes().all(|it| it.is_ascii_lowercase());
    let words: Vec<_> =
        words.take_while(|word| !word.is_empty() && is_word(word)).take(2).collect();
    let program = match process.program.as_str() {
        "i2ris" => [vec!["i2ris".into()], words].concat().join(" "),
        other => other.to_owned(),
    };
    ClientProcess { program, ..process.clone() }.to_string()
}

/// Finds the holder of the lease, once per change.
#[derive(Debug)]
pub struct Commander {
    domain: Domain,
    /// Boot id and client of the answer.
    found: Option<(u64, u64, Option<String>)>,
    next: Nanos,
}

impl Commander {
    pub fn new(domain: &Domain) -> Self {
        Self { domain: domain.clone(), found: None, next: Nanos::ZERO }
    }

    /// Program, process id and user of the holder; `None`: no holder, or unknown.
    pub fn name(&mut self, state: Option<&OperatingStateMsg>, now: Nanos) -> Option<String> {
        let state = state.filter(|state| state.lease_client_id != 0)?;
        let (boot, client) = (state.boot_id, state.lease_client_id);
        let known = self.found.as_ref().filter(|it| (it.0, it.1) == (boot, client));
        if known.is_none_or(|it| it.2.is_none() && now >= self.next) {
            let process = find_client_process(&self.domain, boot, client);
            self.found = Some((boot, client, process.map(|process| name(&process))));
            self.next = now + RETRY;
        }
        self.found.as_ref().and_then(|it| it.2.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_become_rates() {
        let message = |milliseconds, count, boot_id| ActuatorState {
            stamp_ns: Nanos::from_millis(milliseconds).0,
            exchanges: [count, 2 * count],
            boot_id,
            ..ActuatorState::default()
        };
        let mut exchanges = Exchanges::default();
        assert_eq!(exchanges.rates(&message(1000, 100, 1)), None);
        assert_eq!(exchanges.rates(&message(1200, 180, 1)), None);
        assert_eq!(exchanges.rates(&message(1500, 300, 1)), Some([400.0, 800.0]));
        assert_eq!(exchanges.rates(&message(2000, 550, 1)), Some([400.0, 800.0]), "once a second");
        assert_eq!(exchanges.rates(&message(2500, 800, 1)), Some([500.0, 1000.0]));
        assert_eq!(exchanges.rates(&message(2600, 3, 2)), None, "a new controller counts from 0");
        assert_eq!(exchanges.rates(&message(3600, 103, 2)), Some([100.0, 200.0]));
    }
}
