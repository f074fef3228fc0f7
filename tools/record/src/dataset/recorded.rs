//! A recording as a data set sees it: the state at any instant, and when each picture was taken.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use i2ris::ipc::payload::{
    ExternalPosition, JointState, TeleopMsg, VirtualFixturesMsg, unpadded_text,
};
use i2ris::ipc::{Stream, StreamMessage};
use i2ris_report::snake::{Bend, Snake};
use i2ris_report::statistics::{TimeSeries, mean, median};
use mcap::records::Record;

use crate::cdr;
use crate::pictures::{self, Picture};
use crate::read::{ReadError, Records};
use crate::recorder::{ALIGNMENT, ALIGNMENT_DEVIATION, HEADER, OUTCOME};
use crate::topic::Topic;

/// Samples further apart are a gap: the controller was away, or nobody recorded.
const GAP_NS: u64 = 110_000_000;
/// Camera angles, of which a slow camera has ten a second.
const CAMERA_GAP_NS: u64 = 110_000_000;
/// Stamps of one stream that go back further are of another clock.
const JUMP_NS: u64 = 1_000_000_000;
/// Missing pictures in a row that the next ones stand in for.
const MISSING_PICTURES: f64 = 4.0;

/// Why a recording gives no rows.
#[derive(Debug, thiserror::Error)]
pub enum RecordedError {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(
        "{path}: stamps of {stream} go back by {back_s:.1} s: the clock jumped; leave this \
         recording out"
    )]
    Clock { path: PathBuf, stream: &'static str, back_s: f64 },
    #[error("{path}: holds positions of the tip and no angles")]
    Tip { path: PathBuf },
}

/// Values that stay until they change.
#[derive(Debug)]
struct Changes<T>(Vec<(u64, T)>);

impl<T> Default for Changes<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: PartialEq + Clone> Changes<T> {
    fn push(&mut self, stamp_ns: u64, value: T) {
        if self.0.last().is_none_or(|(_, last)| *last != value) {
            self.0.push((stamp_ns, value));
        }
    }

    fn at(&self, stamp_ns: u64) -> Option<T> {
        let after = self.0.partition_point(|(stamp, _)| *stamp <= stamp_ns);
        self.0[..after].last().map(|(_, value)| value.clone())
    }
}

/// What the robot and its hand are at an instant. Angles in rad.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Pitch, yaw, and the deviation of both.
    pub estimate: [f64; 4],
    pub is_memory_known: bool,
    pub counts: [f64; 2],
    pub goal: [f64; 2],
    /// Of the goal in the picture, right and up, m.
    pub tip: [f64; 2],
    pub camera: Option<[f64; 2]>,
    pub model: [u8; 32],
    /// Names of the regions that count.
    pub fixtures: String,
    pub is_limited: bool,
    /// `None`: no hand steers.
    pub is_clutch_open: Option<bool>,
}

/// The pictures of a view.
#[derive(Debug, Default)]
pub struct View {
    /// Monotonic stamps, in the order of the file.
    pub stamps: Vec<u64>,
    /// Width, height, colours.
    pub size: [usize; 3],
}

/// A recording.
#[derive(Debug, Default)]
pub struct Recorded {
    pub about: BTreeMap<String, String>,
    pub views: BTreeMap<String, View>,
    /// How late the stamps of the camera are, and the deviation of that; `None`: not measured.
    pub late_s: Option<(f64, f64)>,
    /// Why it cannot be read to its end.
    pub stopped_by: Option<ReadError>,
    estimate: TimeSeries<4>,
    goal: TimeSeries<2>,
    counts: TimeSeries<2>,
    camera: TimeSeries<2>,
    memory: Changes<bool>,
    limited: Changes<bool>,
    models: Changes<[u8; 32]>,
    fixtures: Changes<String>,
    clutch: Changes<bool>,
    /// What +pitch and +yaw do in the picture.
    view: Option<[[f64; 2]; 2]>,
}

/// A row: when, and which picture of each view, by its number in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    pub stamp_ns: u64,
    /// The stamp less the time that a reader takes for it, s.
    pub jitter_s: f64,
    pub pictures: Vec<usize>,
}

impl Recorded {
    pub fn read(path: &Path) -> Result<Self, RecordedError> {
        let mut recorded = Self::default();
        let (mut streams, mut views) = (BTreeMap::new(), BTreeMap::new());
        let mut last: BTreeMap<Stream, u64> = BTreeMap::new();
        let mut records = Records::open(path)?;
        let mut offset_ns = 0;
        for record in records.by_ref() {
            match record {
                Record::Channel(channel) => {
                    if let Some(view) = pictures::view(&channel.topic) {
                        views.insert(channel.id, view.to_owned());
                    } else if let Some(stream) = Topic::payload_stream(&channel.topic) {
                        streams.insert(channel.id, stream);
                    }
                }
                Record::Metadata(found) if found.name == HEADER => {
                    let offset = found.metadata.get("unix_minus_monotonic_ns");
                    offset_ns = offset.and_then(|text| text.parse().ok()).unwrap_or(0);
                    recorded.about = found.metadata;
                }
                Record::Metadata(found) if found.name == OUTCOME => {
                    let number = |name| found.metadata.get(name).and_then(|it| it.parse().ok());
                    recorded.late_s = number(ALIGNMENT).zip(number(ALIGNMENT_DEVIATION));
                }
                Record::Message { header, data } => {
                    if let Some(view) = views.get(&header.channel_id) {
                        recorded.add_picture(view, &data, offset_ns);
                    } else if let Some(stream) = streams.get(&header.channel_id)
                        && let Some(message) = cdr::decode(*stream, &data)
                    {
                        let last = last.entry(*stream).or_default();
                        let stamp = message.stamp().0;
                        if stamp + JUMP_NS < *last && stream.has_one_sender() {
                            let back_s = (*last - stamp) as f64 * 1e-9;
                            let path = path.to_owned();
                            return Err(RecordedError::Clock {
                                path,
                                stream: stream.name(),
                                back_s,
                            });
                        }
                        *last = stamp;
                        if !recorded.add(&message) {
                            return Err(RecordedError::Tip { path: path.to_owned() });
                        }
                    }
                }
                _ => {}
            }
        }
        recorded.stopped_by = records.stopped_by();
        recorded.align();
        Ok(recorded)
    }

    /// Puts pictures and angles of the camera to where the motion says that they were taken.
    fn align(&mut self) {
        let Some((late_s, _)) = self.late_s else { return };
        let earlier = |stamp: u64| stamp.saturating_add_signed((-late_s * 1e9) as i64);
        for view in self.views.values_mut() {
            view.stamps.iter_mut().for_each(|stamp| *stamp = earlier(*stamp));
        }
        let mut camera = TimeSeries::default();
        self.camera.iter().for_each(|(stamp, angles)| camera.push(earlier(*stamp), *angles));
        self.camera = camera;
    }

    fn add_picture(&mut self, view: &str, message: &[u8], offset_ns: u64) {
        if let Some(picture) = Picture::decode(message) {
            let view = self.views.entry(view.to_owned()).or_default();
            view.stamps.push(picture.unix_ns.saturating_sub(offset_ns));
            if view.size == [0; 3] {
                view.size = pictures::size(&picture.jpeg).unwrap_or_default();
            }
        }
    }

    /// `false`: the model is one of the tip.
    fn add(&mut self, message: &StreamMessage) -> bool {
        match message {
            StreamMessage::Measured(state) if state.flags & JointState::VALID != 0 => {
                let ([pitch, yaw, _], [d_pitch, d_yaw, _]) = (state.position, state.deviation);
                self.estimate.push(state.stamp_ns, [pitch, yaw, d_pitch, d_yaw]);
                self.memory.push(state.stamp_ns, state.flags & JointState::MEMORY_KNOWN != 0);
                self.models.push(state.stamp_ns, state.model_id);
                return state.count == 2;
            }
            StreamMessage::Goal(state) if state.flags & JointState::VALID != 0 => {
                self.goal.push(state.stamp_ns, [state.position[0], state.position[1]]);
                self.limited.push(state.stamp_ns, state.flags & JointState::FIXTURE != 0);
            }
            StreamMessage::Actuators(state) => {
                self.counts.push(state.stamp_ns, state.measured_counts.map(f64::from));
            }
            StreamMessage::External(seen)
                if seen.flags & ExternalPosition::VALID != 0 && seen.count == 2 =>
            {
                self.camera.push(seen.stamp_ns, [seen.position[0], seen.position[1]]);
            }
            StreamMessage::VirtualFixtures(regions) => {
                self.fixtures.push(regions.stamp_ns, names(regions));
            }
            StreamMessage::Teleop(hand) => {
                self.clutch.push(hand.stamp_ns, hand.flags & TeleopMsg::OPEN != 0);
                self.view = Some(hand.view);
            }
            _ => {}
        }
        true
    }

    /// Whether a hand said what its motions do in the picture.
    pub fn has_view(&self) -> bool {
        self.view.is_some()
    }

    pub fn model_ids(&self) -> impl Iterator<Item = &[u8; 32]> {
        self.models.0.iter().map(|(_, id)| id)
    }

    /// The state at an instant; `None` in a gap.
    pub fn at(&self, stamp_ns: u64, snake: &Snake) -> Option<Moment> {
        let goal = self.goal.value_at(stamp_ns, GAP_NS)?;
        let metres = snake.tip_pose(Bend { pitch: goal[0], yaw: goal[1] }).position_m;
        // Pitch moves the tip along y of the base, yaw along x.
        let [up, right] = [metres[1], metres[0]];
        let view = self.view.unwrap_or([[0.0, 1.0], [1.0, 0.0]]);
        Some(Moment {
            estimate: self.estimate.value_at(stamp_ns, GAP_NS)?,
            counts: self.counts.value_at(stamp_ns, GAP_NS)?,
            goal,
            tip: [0, 1].map(|axis| view[0][axis] * up + view[1][axis] * right),
            camera: self.camera.value_at(stamp_ns, CAMERA_GAP_NS),
            is_memory_known: self.memory.at(stamp_ns).unwrap_or(false),
            model: self.models.at(stamp_ns).unwrap_or_default(),
            fixtures: self.fixtures.at(stamp_ns).unwrap_or_default(),
            is_limited: self.limited.at(stamp_ns).unwrap_or(false),
            is_clutch_open: self.clutch.at(stamp_ns),
        })
    }

    /// Pictures per second of the first view, gaps left out; `None` without pictures.
    pub fn picture_rate_hz(&self) -> Option<f64> {
        let stamps = &self.views.values().next()?.stamps;
        let mut steps: Vec<f64> =
            stamps.windows(2).map(|pair| pair[1].saturating_sub(pair[0]) as f64 * 1e-9).collect();
        let usual = median(&mut steps)?;
        let whole = steps.into_iter().filter(|step| (0.5..1.5).contains(&(step / usual)));
        mean(whole).filter(|step| *step > 0.0).map(f64::recip)
    }

    /// Rows of equal distance in time, as long as there is a state and pictures of all these views;
    /// a gap begins a new list. Each row is at the stamp of the picture that is nearest to its time.
    pub fn rows(&self, fps: f64, views: &[String], snake: &Snake) -> Vec<Vec<Row>> {
        let period_ns = 1e9 / fps;
        let taken: Vec<&[u64]> =
            views.iter().filter_map(|view| Some(&*self.views.get(view)?.stamps)).collect();
        let Some((first, last)) = self.estimate.get(0).zip(self.estimate.last()) else {
            return Vec::new();
        };
        let instants: Vec<u64> = match taken.first() {
            Some(stamps) => stamps.to_vec(),
            None => {
                let count = (last.0 - first.0) as f64 / period_ns;
                (0..=count as u64).map(|row| first.0 + (row as f64 * period_ns) as u64).collect()
            }
        };
        let widest_ns = (period_ns * if taken.is_empty() { 1.5 } else { MISSING_PICTURES }) as u64;
        let mut runs: Vec<Vec<u64>> = Vec::new();
        for stamp in instants.into_iter().filter(|stamp| self.at(*stamp, snake).is_some()) {
            match runs.last_mut() {
                Some(run)
                    if run.last().is_some_and(|last| stamp.wrapping_sub(*last) < widest_ns) =>
                {
                    run.push(stamp);
                }
                _ => runs.push(vec![stamp]),
            }
        }
        let rows = runs.iter().map(|run| grid(run, period_ns, &taken));
        // One row shows no motion.
        rows.filter(|rows| rows.len() > 1).collect()
    }
}

/// Rows at equal distances over the instants of a run.
fn grid(run: &[u64], period_ns: f64, views: &[&[u64]]) -> Vec<Row> {
    let span_ns = (run[run.len() - 1] - run[0]) as f64;
    let rows = (0..=(span_ns / period_ns).round() as u64).map(|number| {
        let due = run[0] + (number as f64 * period_ns).round() as u64;
        let stamp_ns = run[nearest(run, due)];
        let jitter_s = (stamp_ns as f64 - due as f64) * 1e-9;
        let pictures = views.iter().map(|stamps| nearest(stamps, stamp_ns)).collect();
        Row { stamp_ns, jitter_s, pictures }
    });
    rows.collect()
}

fn nearest(stamps: &[u64], stamp: u64) -> usize {
    let after = stamps.partition_point(|it| *it < stamp).min(stamps.len() - 1);
    let before = after.saturating_sub(1);
    if stamps[before].abs_diff(stamp) <= stamps[after].abs_diff(stamp) { before } else { after }
}

fn names(regions: &VirtualFixturesMsg) -> String {
    let active = (0..regions.name.len()).filter(|place| regions.active & (1 << place) != 0);
    active.map(|place| unpadded_text(&regions.name[place])).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two seconds at 100 Hz, without what lies in a gap.
    fn recorded(gap_ms: std::ops::Range<u64>, pictures: Vec<u64>) -> Recorded {
        let mut recorded = Recorded::default();
        for ms in (0..=2000_u64).step_by(10).filter(|ms| !gap_ms.contains(ms)) {
            let (stamp, angle) = (ms * 1_000_000, ms as f64 * 1e-4);
            recorded.estimate.push(stamp, [angle, -angle, 0.01, 0.02]);
            recorded.goal.push(stamp, [angle, 0.0]);
            recorded.counts.push(stamp, [ms as f64, 0.0]);
        }
        if !pictures.is_empty() {
            let stamps = pictures.into_iter().map(|ms| ms * 1_000_000).collect();
            recorded.views.insert("top".to_owned(), View { stamps, size: [64, 48, 3] });
        }
        recorded
    }

    fn rows(recorded: &Recorded, fps: f64) -> Vec<Vec<Row>> {
        let views: Vec<String> = recorded.views.keys().cloned().collect();
        recorded.rows(fps, &views, &Snake::new("i2ris"))
    }

    #[test]
    fn without_pictures_rows_are_at_the_rate_that_was_asked_for() {
        let found = rows(&recorded(0..0, Vec::new()), 20.0);
        assert_eq!((found.len(), found[0].len()), (1, 41));
        assert!(found[0].iter().all(|row| row.jitter_s == 0.0 && row.pictures.is_empty()));
        assert_eq!(found[0][40].stamp_ns, 2_000_000_000);
    }

    #[test]
    fn a_gap_ends_an_episode_and_begins_another() {
        let found = rows(&recorded(600..900, Vec::new()), 20.0);
        let ends: Vec<_> = found.iter().map(|it| it[it.len() - 1].stamp_ns / 1_000_000).collect();
        assert_eq!(ends, [550, 2000]);
        assert_eq!(found[1][0].stamp_ns, 900_000_000);
    }

    #[test]
    fn rows_are_at_the_stamps_of_pictures_and_tell_how_far_they_are_from_their_time() {
        // 25 pictures a second that come up to 4 ms late; the eleventh is missing.
        let late = |number: u64| 40 * number + number % 5;
        let pictures: Vec<u64> = (0..50).filter(|it| *it != 10).map(late).collect();
        let recorded = recorded(0..0, pictures.clone());
        assert_eq!(recorded.picture_rate_hz().unwrap().round(), 25.0);
        let found = rows(&recorded, 25.0);
        assert_eq!((found.len(), found[0].len()), (1, 50));
        for (number, row) in found[0].iter().enumerate() {
            assert_eq!(row.stamp_ns / 1_000_000, pictures[row.pictures[0]], "row {number}");
            let due = number as f64 * 0.04;
            assert!((row.stamp_ns as f64 * 1e-9 - due - row.jitter_s).abs() < 1e-9);
            let most = if number == 10 { 0.041 } else { 0.0041 };
            assert!(row.jitter_s.abs() <= most, "row {number}: {}", row.jitter_s);
        }
    }

    #[test]
    fn the_tip_moves_in_the_picture_as_the_hand_was_told() {
        let snake = Snake::new("i2ris");
        let mut recorded = recorded(0..0, Vec::new());
        let up = recorded.at(1_000_000_000, &snake).unwrap().tip;
        assert!(up[0].abs() < 1e-12 && up[1] > 1e-4, "pitch is up: {up:?}");
        // The camera is turned by a quarter: pitch goes left.
        recorded.view = Some([[-1.0, 0.0], [0.0, 1.0]]);
        let left = recorded.at(1_000_000_000, &snake).unwrap().tip;
        assert!((left[0] + up[1]).abs() < 1e-12 && left[1].abs() < 1e-12, "{left:?}");
    }
}
