//! Everything of a recording that a report needs, read once.

use std::collections::BTreeMap;
use std::path::Path;

use i2ris::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics,
};
use mcap::records::Record;

use super::latency::Latencies;
use crate::cdr;
use crate::read::{ReadError, Records};
use crate::recorder::{HEADER, OUTCOME};
use crate::topic::{Stream, Topic};
use i2ris_plot::series::Series;

/// Models of the tip position have three outputs, in metres; the others have angles.
const ANGLES: u32 = 2;

/// See the head of this file.
#[derive(Debug, Default)]
pub struct Trial {
    pub file: String,
    /// Metadata from the start of the file.
    pub about: BTreeMap<String, String>,
    /// Metadata from its end; empty: it was cut off.
    pub outcome: BTreeMap<String, String>,
    /// Attached files with their sizes.
    pub attached: Vec<(String, usize)>,
    /// The lines of the controller's log of runs, if they are attached; the fuller of two.
    pub audit: String,
    pub streams: BTreeMap<Stream, Count>,
    /// First stamp of the controller, ns of the monotonic clock.
    pub start_ns: u64,
    pub end_ns: u64,
    /// What was asked, degrees.
    pub goal: Series<2>,
    /// The model's estimate, degrees.
    pub measured: Series<2>,
    /// What a camera saw, degrees.
    pub camera: Series<2>,
    /// Encoder positions.
    pub counts: Series<2>,
    /// Changes of what is estimated by which model: stamp and id.
    pub models: Vec<(u64, [u8; 32])>,
    /// Operating states, each one that differs from the one before in more than its stamp.
    pub states: Vec<OperatingStateMsg>,
    pub windows: Vec<PeriodStatistics>,
    pub latencies: Latencies,
    /// Outputs are positions of the tip, not angles: nothing of them is in the series.
    pub is_tip: bool,
    /// Where the recording stops being readable.
    pub stopped_by: Option<String>,
}

/// Messages of one stream.
#[derive(Debug, Clone, Copy, Default)]
pub struct Count {
    pub messages: u64,
    pub first_ns: u64,
    pub last_ns: u64,
    /// By the numbers of the messages, so many between the first and the last are not there.
    pub missing: u64,
    last_sequence: u32,
}

impl Count {
    /// Messages per second.
    pub fn rate_hz(&self) -> f64 {
        let seconds = self.last_ns.saturating_sub(self.first_ns) as f64 * 1e-9;
        if seconds > 0.0 {
            (self.messages as f64 - 1.0) / seconds
        } else {
            0.0
        }
    }

    fn note(&mut self, stamp_ns: u64, sequence: u32, has_one_sender: bool) {
        if self.messages == 0 {
            self.first_ns = stamp_ns;
        } else if has_one_sender {
            // A new start of the controller counts from the beginning: no gap.
            self.missing += u64::from(
                sequence
                    .checked_sub(self.last_sequence)
                    .map_or(0, |step| step.saturating_sub(1)),
            );
        }
        (self.last_ns, self.last_sequence) = (stamp_ns, sequence);
        self.messages += 1;
    }
}

impl Trial {
    /// Reads a recording. One that is cut off gives what it has.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let mut trial = Self {
            file: path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            start_ns: u64::MAX,
            ..Self::default()
        };
        let mut channels: BTreeMap<u16, Stream> = BTreeMap::new();
        let mut is_recording = false;
        for record in Records::open(path)? {
            match record {
                Ok(Record::Channel(channel)) => {
                    channels.extend(Topic::own(&channel.topic).map(|stream| (channel.id, stream)));
                }
                Ok(Record::Message { header, data }) => {
                    if let Some(stream) = channels.get(&header.channel_id) {
                        trial.streams.entry(*stream).or_default().note(
                            header.publish_time,
                            header.sequence,
                            has_one_sender(*stream),
                        );
                        trial.take(*stream, &data);
                    }
                }
                Ok(Record::Metadata(metadata)) if metadata.name == HEADER => {
                    trial.about = metadata.metadata
                }
                Ok(Record::Metadata(metadata)) if metadata.name == OUTCOME => {
                    trial.outcome = metadata.metadata
                }
                Ok(Record::Attachment { header, data, .. }) => {
                    trial.attached.push((header.name.clone(), data.len()));
                    if header.name.ends_with(".jsonl") && data.len() > trial.audit.len() {
                        trial.audit = String::from_utf8_lossy(&data).into_owned();
                    }
                }
                Ok(Record::DataEnd(_)) => break,
                Ok(_) => {}
                // Not even a beginning: it is something else.
                Err(error) if !is_recording => return Err(error),
                Err(error) => {
                    trial.stopped_by = Some(error.to_string());
                    break;
                }
            }
            is_recording = true;
        }
        trial.start_ns = if trial.start_ns == u64::MAX {
            0
        } else {
            trial.start_ns
        };
        Ok(trial)
    }

    /// Seconds since the start.
    pub fn seconds(&self, stamp_ns: u64) -> f64 {
        (i128::from(stamp_ns) - i128::from(self.start_ns)) as f64 * 1e-9
    }

    /// How long it lasted.
    pub fn length_s(&self) -> f64 {
        self.end_ns.saturating_sub(self.start_ns) as f64 * 1e-9
    }

    fn take(&mut self, stream: Stream, data: &[u8]) {
        match stream {
            Stream::Measured => {
                let Some(state) = cdr::payload::<JointState>(data) else {
                    return;
                };
                self.span(state.stamp_ns);
                if state.flags & JointState::VALID != 0
                    && self
                        .models
                        .last()
                        .is_none_or(|(_, id)| *id != state.model_id)
                {
                    self.models.push((state.stamp_ns, state.model_id));
                }
                self.angles(&state, |trial| &mut trial.measured);
            }
            Stream::Goal => {
                let Some(state) = cdr::payload::<JointState>(data) else {
                    return;
                };
                self.span(state.stamp_ns);
                self.angles(&state, |trial| &mut trial.goal);
            }
            Stream::Actuators => {
                let Some(state) = cdr::payload::<ActuatorState>(data) else {
                    return;
                };
                self.span(state.stamp_ns);
                self.counts
                    .push(state.stamp_ns, state.measured_counts.map(f64::from));
                self.latencies.note(&state);
            }
            Stream::State => {
                let changed = cdr::payload(data).filter(|state| self.is_new(state));
                self.states.extend(changed);
            }
            Stream::Statistics => self.windows.extend(cdr::payload::<PeriodStatistics>(data)),
            Stream::External => {
                let Some(seen) = cdr::payload::<ExternalPosition>(data) else {
                    return;
                };
                if seen.flags & ExternalPosition::VALID != 0 && seen.count == ANGLES {
                    self.camera.push(seen.stamp_ns, degrees(seen.position));
                }
            }
            Stream::Setpoint | Stream::ServoJp | Stream::ServoActuators => {}
        }
    }

    fn span(&mut self, stamp_ns: u64) {
        self.start_ns = self.start_ns.min(stamp_ns);
        self.end_ns = self.end_ns.max(stamp_ns);
    }

    fn angles(&mut self, state: &JointState, to: fn(&mut Self) -> &mut Series<2>) {
        if state.flags & JointState::VALID == 0 {
            return;
        }
        if state.count == ANGLES {
            to(self).push(state.stamp_ns, degrees(state.position));
        } else {
            self.is_tip = true;
        }
    }

    fn is_new(&self, state: &OperatingStateMsg) -> bool {
        let what = |state: &OperatingStateMsg| {
            (
                state.state,
                state.fault,
                state.flags,
                state.lease_client_id,
                state.refused,
                state.stale_stops,
                state.boot_id,
            )
        };
        self.states
            .last()
            .is_none_or(|last| what(last) != what(state))
    }
}

fn degrees(position: [f64; 3]) -> [f64; 2] {
    [position[0].to_degrees(), position[1].to_degrees()]
}

/// Commands and pictures may come from several senders, whose numbers do not tell.
const fn has_one_sender(stream: Stream) -> bool {
    !matches!(
        stream,
        Stream::External | Stream::ServoJp | Stream::ServoActuators
    )
}
