//! The data of a recording that a report needs, read once.

use std::collections::BTreeMap;
use std::path::Path;

use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, ExternalPosition, JointState, OperatingStateMsg,
    PeriodStatistics, ReachTarget,
};
use i2ris_statistics::TimeSeries;
use mcap::records::Record;

use super::latency::Latencies;
use crate::cdr;
use crate::read::{ReadError, Records};
use crate::recorder::{HEADER, OUTCOME};
use crate::topic::{Stream, Topic};

/// Outputs of models of angles. Models of the tip position have three outputs, in metres.
const ANGLES: u32 = 2;

/// The data of a recording.
#[derive(Debug, Default)]
pub struct Trial {
    pub file: String,
    /// Metadata from the start of the file.
    pub about: BTreeMap<String, String>,
    /// Metadata from its end; empty if the file was cut off.
    pub outcome: BTreeMap<String, String>,
    /// Attached files with their sizes, bytes.
    pub attached: BTreeMap<String, usize>,
    /// The run log of the controller, if it is attached; the longer one of two.
    pub run_log: String,
    pub streams: BTreeMap<Stream, StreamStatistics>,
    /// First stamp of the controller, ns of the monotonic clock.
    pub start_ns: u64,
    /// Last stamp of the controller.
    pub end_ns: u64,
    /// The goal, degrees.
    pub goal: TimeSeries<2>,
    /// The model's estimate, degrees.
    pub measured: TimeSeries<2>,
    /// Angles by the camera, degrees.
    pub camera: TimeSeries<2>,
    /// Encoder positions.
    pub counts: TimeSeries<2>,
    /// Stamp and id of every model from which estimates came.
    pub models: Vec<(u64, [u8; 32])>,
    /// Operating states without repetitions.
    pub states: Vec<OperatingStateMsg>,
    pub windows: Vec<PeriodStatistics>,
    /// Messages of the adaptation, while it was on; five a second.
    pub adaptation: Vec<AdaptationMsg>,
    /// The targets of reach-and-hold tasks: the last message of each.
    pub targets: Vec<ReachTarget>,
    pub latencies: Latencies,
    /// Outputs are positions of the tip, not angles: the series do not contain them.
    pub is_tip: bool,
    /// Why the recording cannot be read to its end.
    pub stopped_by: Option<String>,
}

/// Statistics of one stream.
#[derive(Debug, Clone, Copy, Default)]
pub struct StreamStatistics {
    pub messages: u64,
    /// Missing messages between the first and the last, by their sequence numbers.
    pub missing: u64,
    first_ns: u64,
    last_ns: u64,
    last_sequence: u32,
}

impl StreamStatistics {
    /// Messages per second.
    pub fn rate_hz(&self) -> f64 {
        let seconds = self.last_ns.saturating_sub(self.first_ns) as f64 * 1e-9;
        if seconds > 0.0 { (self.messages as f64 - 1.0) / seconds } else { 0.0 }
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
    /// Reads a recording. A recording that was cut off gives what it has.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let mut trial = Self {
            file: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            start_ns: u64::MAX,
            ..Self::default()
        };
        let mut channels: BTreeMap<u16, Stream> = BTreeMap::new();
        let mut is_recording = false;
        for record in Records::open(path)? {
            match record {
                Ok(Record::Channel(channel)) => {
                    let stream = Topic::payload_stream(&channel.topic);
                    channels.extend(stream.map(|stream| (channel.id, stream)));
                }
                Ok(Record::Message { header, data }) => {
                    if let Some(stream) = channels.get(&header.channel_id) {
                        let statistics = trial.streams.entry(*stream).or_default();
                        let has_one_sender = stream.has_one_sender();
                        statistics.add(header.publish_time, header.sequence, has_one_sender);
                        let _ = trial.add(*stream, &data);
                    }
                }
                Ok(Record::Metadata(found)) if found.name == HEADER => trial.about = found.metadata,
                Ok(Record::Metadata(found)) if found.name == OUTCOME => {
                    trial.outcome = found.metadata;
                }
                Ok(Record::Attachment { header, data, .. }) => {
                    if header.name.ends_with(".jsonl") && data.len() > trial.run_log.len() {
                        trial.run_log = String::from_utf8_lossy(&data).into_owned();
                    }
                    trial.attached.insert(header.name, data.len());
                }
                Ok(Record::DataEnd(_)) => break,
                Ok(_) => {}
                // The file has not even a beginning: it is not a recording.
                Err(error) if !is_recording => return Err(error),
                Err(error) => {
                    trial.stopped_by = Some(error.to_string());
                    break;
                }
            }
            is_recording = true;
        }
        if trial.start_ns == u64::MAX {
            trial.start_ns = 0;
        }
        Ok(trial)
    }

    /// Seconds since the start.
    pub fn seconds(&self, stamp_ns: u64) -> f64 {
        (i128::from(stamp_ns) - i128::from(self.start_ns)) as f64 * 1e-9
    }

    /// The length of the recording.
    pub fn length_s(&self) -> f64 {
        self.end_ns.saturating_sub(self.start_ns) as f64 * 1e-9
    }

    /// Adds a message; `None` if it cannot be decoded.
    fn add(&mut self, stream: Stream, data: &[u8]) -> Option<()> {
        match stream {
            Stream::Measured => {
                let state: JointState = cdr::decode(data)?;
                let is_valid = state.flags & JointState::VALID != 0;
                let model = self.models.last().map(|(_, id)| *id);
                if is_valid && model != Some(state.model_id) {
                    self.models.push((state.stamp_ns, state.model_id));
                }
                self.add_angles(&state, |trial| &mut trial.measured);
            }
            Stream::Goal => self.add_angles(&cdr::decode(data)?, |trial| &mut trial.goal),
            Stream::Actuators => {
                let state: ActuatorState = cdr::decode(data)?;
                self.extend_to(state.stamp_ns);
                self.counts.push(state.stamp_ns, state.measured_counts.map(f64::from));
                self.latencies.add(&state);
            }
            Stream::State => {
                let state = cdr::decode(data)?;
                if self.states.last().is_none_or(|last| differs(last, &state)) {
                    self.states.push(state);
                }
            }
            Stream::Statistics => self.windows.push(cdr::decode(data)?),
            Stream::External => {
                let seen: ExternalPosition = cdr::decode(data)?;
                if seen.flags & ExternalPosition::VALID != 0 && seen.count == ANGLES {
                    self.camera.push(seen.stamp_ns, degrees(seen.position));
                }
            }
            Stream::Adaptation => self.add_adaptation(cdr::decode(data)?),
            Stream::ReachTarget => self.add_target(cdr::decode(data)?),
            Stream::Setpoint
            | Stream::Health
            | Stream::VirtualFixtures
            | Stream::Events
            | Stream::ServoJp
            | Stream::Error
            | Stream::Warning
            | Stream::ServoActuators => {}
        }
        Some(())
    }

    /// Of the messages that come 50 times a second, the drift needs no more than these.
    fn add_adaptation(&mut self, message: AdaptationMsg) {
        const LEAST_INTERVAL_NS: u64 = 200_000_000;
        let last = self.adaptation.last().map_or(0, |last| last.stamp_ns);
        let is_on = message.flags & AdaptationMsg::ON != 0;
        if is_on && message.stamp_ns.saturating_sub(last) >= LEAST_INTERVAL_NS {
            self.adaptation.push(message);
        }
    }

    fn add_target(&mut self, message: ReachTarget) {
        let identity = |target: &ReachTarget| (target.client_id, target.shown_ns);
        match self.targets.last_mut() {
            Some(last) if identity(last) == identity(&message) => *last = message,
            _ => self.targets.push(message),
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
            self.is_tip = true;
        }
    }
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

pub(super) fn degrees(position: [f64; 3]) -> [f64; 2] {
    [position[0].to_degrees(), position[1].to_degrees()]
}
