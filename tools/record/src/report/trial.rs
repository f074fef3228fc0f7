//! The data of a recording that a report needs, read once; when the robot followed commands.

use std::collections::BTreeMap;
use std::path::Path;

use i2ris::ipc::payload::{
    AdaptationMsg, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics, ReachTarget,
    ServoJp,
};
use i2ris::ipc::{OperatingState, Stream, StreamMessage};
use i2ris::units::Nanos;
use i2ris::wall_clock::WallTime;
use i2ris_report::statistics::TimeSeries;
use mcap::records::Record;

use super::latency::Latencies;
use crate::messages::{Topic, cdr};
use crate::read::{ReadError, Records};
use crate::recorder::{HEADER, OUTCOME, rate_hz};

/// Outputs that a report draws. A model of the tip has three, in metres; that of one motor has one.
const ANGLES: u32 = 2;

#[derive(Debug, Default)]
pub struct Trial {
    pub file: String,
    /// Metadata from the start of the file.
    pub about: BTreeMap<String, String>,
    /// Metadata from the end; empty if the file is truncated.
    pub outcome: BTreeMap<String, String>,
    /// Attached files with their sizes, bytes.
    pub attached: BTreeMap<String, usize>,
    /// The run log of the controller, if it is attached; the longer one of two.
    pub run_log: String,
    pub streams: BTreeMap<Stream, StreamStatistics>,
    /// First stamp of the controller, ns of the monotonic clock.
    pub start_ns: u64,
    pub end_ns: u64,
    /// Unix time minus the clock of the stamps, ns.
    pub unix_offset_ns: Option<u64>,
    pub goal: TimeSeries<2>,
    /// Stamp and flags of every goal.
    pub goal_flags: Vec<(u64, u32)>,
    /// Commands of the client that controlled the robot, degrees.
    pub commands: TimeSeries<2>,
    /// Setpoint of the controller after all limits, degrees.
    pub setpoint: TimeSeries<2>,
    /// The model's estimate, degrees.
    pub measured: TimeSeries<2>,
    /// Angles by the camera, degrees.
    pub camera: TimeSeries<2>,
    pub counts: TimeSeries<2>,
    /// Stamp and id of every model from which estimates came.
    pub models: Vec<(u64, [u8; 32])>,
    /// Last motion scale of a hand, and number of active regions, if reported.
    pub scale: Option<f64>,
    pub fixtures: Option<u32>,
    /// Operating states without repetitions.
    pub states: Vec<OperatingStateMsg>,
    pub windows: Vec<PeriodStatistics>,
    /// Messages of the adaptation, while it was on; five a second.
    pub adaptation: Vec<AdaptationMsg>,
    /// The targets of reach-and-hold tasks: the last message of each.
    pub targets: Vec<ReachTarget>,
    pub followed: Vec<Followed>,
    pub latencies: Latencies,
    /// Whether outputs are not two angles: the series do not contain them.
    pub has_other_outputs: bool,
    /// Reason why the recording cannot be read to its end.
    pub stopped_by: Option<String>,
}

#[derive(Debug, Clone, Copy, Default)]
pub struct StreamStatistics {
    pub messages: u64,
    /// Missing messages between the first and the last, by their sequence numbers.
    pub missing: u64,
    /// Messages of another layout: another release recorded them.
    pub unread: u64,
    first_ns: u64,
    last_ns: u64,
    last_sequence: u32,
}

impl StreamStatistics {
    pub fn rate_hz(&self) -> f64 {
        rate_hz(self.messages, Nanos(self.last_ns.saturating_sub(self.first_ns)))
    }

    fn add(&mut self, stamp_ns: u64, sequence: u32, has_one_sender: bool) {
        if self.messages == 0 {
            self.first_ns = stamp_ns;
        } else if has_one_sender {
            // A new start of the controller counts from the beginning: no gap.
            let step = sequence.checked_sub(self.last_sequence).unwrap_or(1);
            self.missing += u64::from(step.saturating_sub(1));
        }
        (self.last_ns, self.last_sequence) = (stamp_ns, sequence);
        self.messages += 1;
    }
}

impl Trial {
    /// Reads a recording. A truncated recording gives what it has.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let mut trial = Self {
            file: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            start_ns: u64::MAX,
            ..Self::default()
        };
        let mut channels: BTreeMap<u16, Stream> = BTreeMap::new();
        let (mut is_recording, mut records) = (false, Records::open(path)?);
        for record in records.by_ref() {
            is_recording = true;
            match record {
                Record::Channel(channel) => {
                    let stream = Topic::payload_stream(&channel.topic);
                    channels.extend(stream.map(|stream| (channel.id, stream)));
                }
                Record::Message { header, data } => {
                    if let Some(stream) = channels.get(&header.channel_id) {
                        trial.take(*stream, header.publish_time, header.sequence, &data);
                    }
                }
                Record::Metadata(found) if found.name == HEADER => trial.about = found.metadata,
                Record::Metadata(found) if found.name == OUTCOME => trial.outcome = found.metadata,
                Record::Attachment { header, data, .. } => {
                    if header.name.ends_with(".jsonl") && data.len() > trial.run_log.len() {
                        trial.run_log = String::from_utf8_lossy(&data).into_owned();
                    }
                    trial.attached.insert(header.name, data.len());
                }
                _ => {}
            }
        }
        match records.stopped_by() {
            // The file has not even a beginning: it is not a recording.
            Some(error) if !is_recording => return Err(error),
            stopped_by => trial.stopped_by = stopped_by.map(|error| error.to_string()),
        }
        if trial.start_ns == u64::MAX {
            trial.start_ns = 0;
        }
        Ok(trial)
    }

    fn take(&mut self, stream: Stream, publish_time: u64, sequence: u32, data: &[u8]) {
        let statistics = self.streams.entry(stream).or_default();
        statistics.add(publish_time, sequence, stream.has_one_sender());
        let Some(message) = cdr::decode(stream, data) else {
            statistics.unread += 1;
            return;
        };
        let offset = publish_time.wrapping_sub(message.stamp().0);
        self.unix_offset_ns.get_or_insert(offset);
        self.add(message);
    }

    /// Streams that are not in the report because another release recorded them.
    pub fn unread(&self) -> impl Iterator<Item = String> {
        let streams = self.streams.iter().filter(|(_, statistics)| statistics.unread > 0);
        streams.map(|(stream, StreamStatistics { unread, .. })| {
            let name = stream.name();
            format!(
                "{unread} message(s) of `{name}` have the layout of another release and are not \
                 shown: report with the release that recorded them"
            )
        })
    }

    /// Every series of angles, with its name.
    pub fn angles(&self) -> [(&'static str, &TimeSeries<2>); 4] {
        let Self { goal, setpoint, measured, camera, .. } = self;
        [("goal", goal), ("setpoint", setpoint), ("estimate", measured), ("camera", camera)]
    }

    fn last_state(&self, stamp_ns: u64) -> Option<&OperatingStateMsg> {
        let after = self.states.partition_point(|state| state.stamp_ns <= stamp_ns);
        self.states[..after].last()
    }

    pub fn state_at(&self, stamp_ns: u64) -> Option<&'static str> {
        let state = self.last_state(stamp_ns)?;
        OperatingState::from_number(state.state).map(OperatingState::text)
    }

    pub fn unix_ns(&self, stamp_ns: u64) -> u64 {
        stamp_ns.wrapping_add(self.unix_offset_ns.unwrap_or(0))
    }

    /// Date and time of the start, UTC; `None` for a recording without messages.
    pub fn recorded(&self) -> Option<String> {
        self.unix_offset_ns?;
        let seconds = self.unix_ns(self.start_ns) / 1_000_000_000;
        Some(WallTime::from_unix_seconds(seconds).to_string())
    }

    pub fn seconds(&self, stamp_ns: u64) -> f64 {
        (i128::from(stamp_ns) - i128::from(self.start_ns)) as f64 * 1e-9
    }

    pub fn length_s(&self) -> f64 {
        self.end_ns.saturating_sub(self.start_ns) as f64 * 1e-9
    }

    /// Whether the robot followed commands; a recording without states counts as following.
    pub fn was_following(&self, stamp_ns: u64) -> bool {
        self.last_state(stamp_ns).map_or(self.states.is_empty(), follows)
    }

    /// Mean time between two goals, seconds.
    pub fn goal_period_s(&self) -> f64 {
        let ends = self.goal_flags.first().zip(self.goal_flags.last());
        let span = ends.map_or(0.0, |((first, _), (last, _))| (last - first) as f64 * 1e-9);
        span / (self.goal_flags.len().max(2) - 1) as f64
    }

    /// The intervals in which the robot did not follow commands, seconds.
    pub fn intervals_without_following(&self) -> Vec<[f64; 2]> {
        let mut intervals: Vec<[f64; 2]> = Vec::new();
        let mut since = None;
        for state in &self.states {
            let now = self.seconds(state.stamp_ns);
            if !follows(state) {
                since.get_or_insert(now);
            } else if let Some(from) = since.take() {
                intervals.push([from, now]);
            }
        }
        intervals.extend(since.map(|from| [from, self.length_s()]));
        intervals
    }

    /// Source and series of the snake's pose: the camera, or without one the model's estimate.
    pub fn observed(&self) -> (&'static str, &TimeSeries<2>) {
        if self.camera.is_empty() { ("estimate", &self.measured) } else { ("camera", &self.camera) }
    }

    fn add(&mut self, message: StreamMessage) {
        match message {
            StreamMessage::Measured(state) => {
                let is_valid = state.flags & JointState::VALID != 0;
                let model = self.models.last().map(|(_, id)| *id);
                if is_valid && model != Some(state.model_id) {
                    self.models.push((state.stamp_ns, state.model_id));
                }
                self.add_angles(&state, |trial| &mut trial.measured);
            }
            StreamMessage::Setpoint(state) => self.add_angles(&state, |trial| &mut trial.setpoint),
            StreamMessage::ServoJp(command)
                if command.count == ANGLES && command.flags & ServoJp::RATE == 0 =>
            {
                let leads = |state: &OperatingStateMsg| state.lease_client_id == command.client_id;
                if self.states.last().is_some_and(leads) {
                    self.commands.push(command.stamp_ns, degrees(command.position));
                }
            }
            StreamMessage::Goal(state) => {
                self.goal_flags.push((state.stamp_ns, state.flags));
                self.add_angles(&state, |trial| &mut trial.goal);
            }
            StreamMessage::Actuators(state) => {
                self.extend_to(state.stamp_ns);
                self.counts.push(state.stamp_ns, state.measured_counts.map(f64::from));
                self.latencies.add(&state);
            }
            StreamMessage::State(state)
                if self.states.last().is_none_or(|last| differs(last, &state)) =>
            {
                self.states.push(state);
            }
            StreamMessage::Statistics(window) => self.windows.push(window),
            StreamMessage::External(seen)
                if seen.flags & ExternalPosition::VALID != 0 && seen.count == ANGLES =>
            {
                self.camera.push(seen.stamp_ns, degrees(seen.position));
            }
            StreamMessage::Adaptation(message) => self.add_adaptation(message),
            StreamMessage::ReachTarget(message) => self.add_target(message),
            StreamMessage::Teleop(message) => self.scale = Some(message.scale),
            StreamMessage::VirtualFixtures(message) => {
                self.fixtures = Some(message.active.count_ones())
            }
            _ => {}
        }
    }

    fn add_adaptation(&mut self, message: AdaptationMsg) {
        // Five of the 50 messages a second are enough to show the drift.
        const MIN_INTERVAL_NS: u64 = 200_000_000;
        let last = self.adaptation.last().map_or(0, |last| last.stamp_ns);
        let is_on = message.flags & AdaptationMsg::ON != 0;
        if is_on && message.stamp_ns.saturating_sub(last) >= MIN_INTERVAL_NS {
            self.adaptation.push(message);
        }
    }

    pub fn add_target(&mut self, message: ReachTarget) {
        let identity = |target: &ReachTarget| (target.client_id, target.shown_ns);
        let is_same = |last: &ReachTarget| identity(last) == identity(&message);
        if message.flags & ReachTarget::FOLLOW == 0 {
            match self.targets.last_mut() {
                Some(last) if is_same(last) => *last = message,
                _ => self.targets.push(message),
            }
            return;
        }
        if self.followed.last().is_none_or(|followed| !is_same(&followed.last)) {
            self.followed.push(Followed { last: message, curve: TimeSeries::default() });
        }
        if let Some(followed) = self.followed.last_mut() {
            followed.curve.push(message.stamp_ns, degrees(message.position));
            followed.last = message;
        }
    }

    fn extend_to(&mut self, stamp_ns: u64) {
        self.start_ns = self.start_ns.min(stamp_ns);
        self.end_ns = self.end_ns.max(stamp_ns);
    }

    fn add_angles(&mut self, state: &JointState, series: fn(&mut Self) -> &mut TimeSeries<2>) {
        self.extend_to(state.stamp_ns);
        if state.flags & JointState::VALID == 0 {
            return;
        }
        if state.count == ANGLES {
            series(self).push(state.stamp_ns, degrees(state.position));
        } else {
            self.has_other_outputs = true;
        }
    }
}

fn follows(state: &OperatingStateMsg) -> bool {
    let other = OperatingStateMsg::HOLDING | OperatingStateMsg::BUSY;
    state.state == OperatingState::Enabled.number() && state.flags & other == 0
}

/// Whether two states differ in more than stamps and counters.
fn differs(a: &OperatingStateMsg, b: &OperatingStateMsg) -> bool {
    let content = |state: &OperatingStateMsg| OperatingStateMsg {
        sequence: 0,
        stamp_ns: 0,
        since_ns: 0,
        accepted: 0,
        last_refusal: 0,
        ..*state
    };
    content(a) != content(b)
}

/// A target to follow: its last message, and where it was.
#[derive(Debug, Clone)]
pub struct Followed {
    pub last: ReachTarget,
    pub curve: TimeSeries<2>,
}

pub fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

pub fn degrees(position: [f64; 3]) -> [f64; 2] {
    [position[0].to_degrees(), position[1].to_degrees()]
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::Payload;

    use super::*;

    #[test]
    fn messages_of_another_layout_are_counted_and_reported() {
        let mut trial = Trial::default();
        let message = cdr::encode(AdaptationMsg { stamp_ns: 5, ..Default::default() }.bytes());
        trial.take(Stream::Adaptation, 10, 1, &message);
        assert_eq!(trial.unread().count(), 0);
        trial.take(Stream::Adaptation, 20, 2, &message[..message.len() - 128]);
        trial.take(Stream::Adaptation, 30, 3, &[&message[..], &[0; 8]].concat());
        let text: Vec<String> = trial.unread().collect();
        assert!(text.len() == 1 && text[0].starts_with("2 message(s) of `adaptation`"), "{text:?}");
    }

    #[test]
    fn intervals_without_following_end_with_state_or_recording() {
        let state = |seconds: u64, state: OperatingState| OperatingStateMsg {
            stamp_ns: seconds * 1_000_000_000,
            state: state.number(),
            ..OperatingStateMsg::default()
        };
        let trial = Trial {
            states: vec![
                state(1, OperatingState::Disabled),
                state(2, OperatingState::Fault),
                state(3, OperatingState::Enabled),
                state(5, OperatingState::Disabled),
            ],
            end_ns: 9_000_000_000,
            ..Trial::default()
        };
        assert_eq!(trial.intervals_without_following(), [[1.0, 3.0], [5.0, 9.0]]);
        let following = [0, 2, 4, 6].map(|s| trial.was_following(s * 1_000_000_000));
        assert_eq!(following, [false, false, true, false]);
    }
}
