//! Data sets for those who train policies: LeRobot v2.1 and v3.
//!
//! An episode is a trial, or the part of one between two gaps. Rows are at the stamps of the
//! pictures; without pictures, at a rate. A split is an outcome.
//!
//! | file | contains |
//! |---|---|
//! | `source` | which recordings go into an export |
//! | `recorded` | the state of a recording at any instant, and its rows |
//! | `features` | the columns, and what a row has in them |
//! | `table` | Parquet with lists and pictures |
//! | `statistics` | range, mean, deviation and quantiles of each column |
//! | `video` | pictures as video, by an external `ffmpeg` |
//! | `lerobot` | files and folders of the format, and their rows |
//! | `meta` | the files that describe the others |
//! | `readme` | what is known of the data, for its readers |
//! | `staged` | a folder that is written whole or not at all |
//!
//! Arrow stays out: its columns in memory would bring ten times the code, and rows are written as
//! they come.

mod features;
mod lerobot;
mod meta;
mod readme;
mod recorded;
mod source;
mod staged;
mod statistics;
mod table;
mod video;

use std::io;
use std::path::{Path, PathBuf};

use i2ris_report::snake::Snake;
use parquet::errors::ParquetError;

use crate::pictures::Picture;
use crate::read::ReadError;
use crate::study::journal::Outcome;
use lerobot::Writer;
pub use recorded::RecordedError;
use recorded::{Recorded, Row};
pub use source::{Source, Sources};
pub use staged::{MADE_OF, StagedError, staged};
pub use video::find_ffmpeg;

/// Rates of pictures of two trials that are the same within this share.
const SAME_RATE: f64 = 0.02;

/// The version of the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    V21,
    V3,
}

/// How a data set is made.
#[derive(Debug, Clone)]
pub struct Options {
    pub version: Version,
    /// Rows per second where there are no pictures.
    pub rate_hz: f64,
    /// Leave pictures out.
    pub without_pictures: bool,
    /// The program that makes videos; `None`: pictures are files in the tables.
    pub ffmpeg: Option<PathBuf>,
}

/// Why there is no data set.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    #[error(transparent)]
    Recorded(#[from] RecordedError),
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("cannot write {path}: {error}")]
    Io { path: PathBuf, error: io::Error },
    #[error("cannot write {path}: {error}")]
    Table { path: PathBuf, error: ParquetError },
    #[error(
        "{name} has {found}, {first} has {expected}: export them apart, or add --without-pictures"
    )]
    Differ { name: String, found: String, first: String, expected: String },
    #[error("ffmpeg: {0}; --images writes pictures instead of videos")]
    Video(String),
    #[error(
        "no recording has anything to learn from: estimate, goal and counts at the same time for \
         two rows; did the controller have a model?"
    )]
    Empty,
}

/// An episode of a data set.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Episode {
    pub trial: String,
    /// Of the trial, from 1; more than one where it has gaps.
    pub part: usize,
    pub task: String,
    pub outcome: Option<Outcome>,
    pub participant: Option<String>,
    pub rows: usize,
    /// The largest distance of a row from its time, s.
    pub jitter_s: f64,
}

/// What was written.
#[derive(Debug, Default)]
pub struct Dataset {
    pub fps: u32,
    pub views: Vec<String>,
    pub episodes: Vec<Episode>,
    /// Recordings, or their ends, that are not in it, and why.
    pub left_out: Vec<(String, String)>,
}

/// What all recordings of a data set have alike.
#[derive(Debug, Clone, PartialEq)]
struct Shape {
    fps: u32,
    /// Names and sizes.
    views: Vec<(String, [usize; 3])>,
}

impl Shape {
    fn of(recorded: &Recorded, options: &Options) -> (Self, f64) {
        let rate_hz = recorded.picture_rate_hz().filter(|_| !options.without_pictures);
        let Some(rate_hz) = rate_hz else {
            let fps = options.rate_hz.round().max(1.0);
            return (Self { fps: fps as u32, views: Vec::new() }, fps);
        };
        let views = recorded.views.iter().map(|(name, view)| (name.clone(), view.size)).collect();
        (Self { fps: rate_hz.round().max(1.0) as u32, views }, rate_hz)
    }

    fn in_words(&self) -> String {
        let views: Vec<_> =
            self.views.iter().map(|(name, [w, h, _])| format!("{name} of {w}x{h}")).collect();
        match views.as_slice() {
            [] => "no pictures".to_owned(),
            views => format!("pictures of {} at {} Hz", views.join(", "), self.fps),
        }
    }
}

/// Writes a data set into an empty folder. `progress` is told how many of all recordings are done.
pub fn write(
    sources: &[Source],
    folder: &Path,
    options: &Options,
    mut progress: impl FnMut(usize, &str),
) -> Result<Dataset, DatasetError> {
    let snake = Snake::new("i2ris");
    let mut dataset = Dataset::default();
    let mut writer: Option<(Writer, Shape, String)> = None;
    for (number, source) in sources.iter().enumerate() {
        progress(number, &source.name);
        let recorded = Recorded::read(&source.recording)?;
        if let Some(why) = &recorded.stopped_by {
            dataset.left_out.push((source.name.clone(), format!("its end: {why}")));
        }
        let (shape, rate_hz) = Shape::of(&recorded, options);
        let views: Vec<String> = shape.views.iter().map(|(name, _)| name.clone()).collect();
        let rows = recorded.rows(f64::from(shape.fps), &views, &snake);
        if rows.is_empty() {
            let why = "no two rows with estimate, goal and counts";
            dataset.left_out.push((source.name.clone(), why.to_owned()));
            continue;
        }
        let (writer, first, first_name) = match &mut writer {
            Some(writer) => writer,
            none => {
                let new = Writer::create(folder, options, &shape)?;
                none.insert((new, shape.clone(), source.name.clone()))
            }
        };
        let is_same =
            (rate_hz / f64::from(first.fps) - 1.0).abs() < SAME_RATE || shape.fps == first.fps;
        if shape.views != first.views || !is_same {
            return Err(DatasetError::Differ {
                name: source.name.clone(),
                found: shape.in_words(),
                first: first_name.clone(),
                expected: first.in_words(),
            });
        }
        for (part, rows) in (1..).zip(&rows) {
            let jitter_s = rows.iter().map(|row| row.jitter_s.abs()).fold(0.0, f64::max);
            let trial = source.trial.as_ref();
            dataset.episodes.push(Episode {
                trial: source.name.clone(),
                part,
                task: source.task(),
                outcome: source.outcome(),
                participant: trial.map(|trial| trial.participant.clone()),
                rows: rows.len(),
                jitter_s,
            });
        }
        write_episodes(writer, &recorded, source, &rows, &snake)?;
    }
    progress(sources.len(), "");
    let Some((writer, shape, _)) = writer else { return Err(DatasetError::Empty) };
    dataset.fps = shape.fps;
    dataset.views = shape.views.into_iter().map(|(name, _)| name).collect();
    writer.finish(&dataset, sources)?;
    Ok(dataset)
}

/// All parts of a recording; its pictures are read once, in their order.
fn write_episodes(
    writer: &mut Writer,
    recorded: &Recorded,
    source: &Source,
    parts: &[Vec<Row>],
    snake: &Snake,
) -> Result<(), DatasetError> {
    let mut pictures = Pictures::open(&source.recording, writer.views())?;
    writer.about(recorded);
    for rows in parts {
        let moments: Vec<_> =
            rows.iter().filter_map(|row| recorded.at(row.stamp_ns, snake)).collect();
        let mut episode = writer.begin(&source.task(), rows.len())?;
        for (number, (row, moment)) in rows.iter().zip(&moments).enumerate() {
            let next = moments.get(number + 1).unwrap_or(moment);
            let motion = [0, 1].map(|axis| next.tip[axis] - moment.tip[axis]);
            let taken = pictures.take(&row.pictures);
            episode.row(features::cells(row, moment, motion), taken)?;
        }
        writer.end(episode)?;
    }
    Ok(())
}

/// The pictures of a recording, in the order of their numbers.
struct Pictures {
    records: crate::read::Records,
    channels: std::collections::BTreeMap<u16, usize>,
    views: Vec<String>,
    /// Number of the next picture of each view, and those that were read and not passed.
    next: Vec<usize>,
    waiting: Vec<std::collections::VecDeque<(usize, Vec<u8>)>>,
}

impl Pictures {
    fn open(recording: &Path, views: Vec<String>) -> Result<Self, ReadError> {
        let records = crate::read::Records::open(recording)?;
        let (next, waiting) = (vec![0; views.len()], vec![Default::default(); views.len()]);
        Ok(Self { records, channels: Default::default(), views, next, waiting })
    }

    /// The picture of each view with these numbers, which never fall.
    fn take(&mut self, numbers: &[usize]) -> Vec<Vec<u8>> {
        let view_pictures = numbers.iter().enumerate().map(|(view, number)| {
            while self.next[view] <= *number && self.read_one() {}
            let waiting = &mut self.waiting[view];
            while waiting.front().is_some_and(|(it, _)| it < number) {
                waiting.pop_front();
            }
            // It may be taken again.
            waiting.front().map(|(_, jpeg)| jpeg.clone()).unwrap_or_default()
        });
        view_pictures.collect()
    }

    fn read_one(&mut self) -> bool {
        use mcap::records::Record;
        match self.records.next() {
            None => return false,
            Some(Record::Channel(channel)) => {
                let name = crate::pictures::view(&channel.topic);
                let view = name.and_then(|name| self.views.iter().position(|it| it == name));
                self.channels.extend(view.map(|view| (channel.id, view)));
            }
            Some(Record::Message { header, data }) => {
                if let Some(view) = self.channels.get(&header.channel_id)
                    && let Some(picture) = Picture::decode(&data)
                {
                    self.waiting[*view].push_back((self.next[*view], picture.jpeg));
                    self.next[*view] += 1;
                }
            }
            Some(_) => {}
        }
        true
    }
}
