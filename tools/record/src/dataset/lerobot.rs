//! The files of a data set as LeRobot 0.3 (v2.1) and 0.4 (v3.0) have them: one table, and one video
//! of each view, per episode.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use i2ris_report::files;
use serde_json::{Map, Value, json};
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::features::{FEATURES, INDEX, described};
use super::recorded::Recorded;
use super::staged::MADE_OF;
use super::statistics::{PictureStatistics, Statistics};
use super::table::{Cell, Column, Kind, Table};
use super::video::Video;
use super::{Dataset, DatasetError, Options, Shape, Source, Version};

/// Episodes of a folder.
pub const CHUNK: usize = 1000;

/// A data set in progress.
pub struct Writer {
    pub(super) folder: PathBuf,
    pub(super) options: Options,
    pub(super) shape: Shape,
    tasks: Vec<String>,
    pub(super) done: Vec<Done>,
    /// Values of each column of numbers, of all rows.
    values: Vec<(String, usize, Vec<f64>)>,
    pictures: Vec<PictureStatistics>,
    pub models: BTreeSet<[u8; 32]>,
    /// Facts of the recordings: controllers, robots.
    pub facts: BTreeSet<(String, String)>,
    pub has_view: bool,
}

/// A finished episode.
pub struct Done {
    pub task: usize,
    pub rows: usize,
    pub statistics: Vec<(String, Value)>,
    pub numbers: Vec<(String, Statistics)>,
}

/// An episode in progress.
pub struct EpisodeWriter {
    path: PathBuf,
    table: Table,
    videos: Vec<Video>,
    task: usize,
    rows: usize,
    expected: usize,
    values: Vec<(String, usize, Vec<f64>)>,
    pictures: Vec<PictureStatistics>,
    /// Of the episode, and of its first row.
    number: usize,
    first: usize,
    fps: f64,
}

fn numbers() -> Vec<(String, usize, Vec<f64>)> {
    let features = FEATURES.iter().filter(|feature| feature.kind != Kind::Text);
    let features =
        features.map(|feature| (feature.name.to_owned(), feature.entries.len(), Vec::new()));
    features.chain(INDEX.map(|(name, _)| (name.to_owned(), 1, Vec::new()))).collect()
}

/// The column of a view.
pub fn view_name(view: &str) -> String {
    format!("observation.images.{view}")
}

fn io_error(path: &Path) -> impl FnOnce(std::io::Error) -> DatasetError {
    |error| DatasetError::Io { path: path.to_owned(), error }
}

pub fn table_error(path: &Path) -> impl FnOnce(parquet::errors::ParquetError) -> DatasetError {
    |error| DatasetError::Table { path: path.to_owned(), error }
}

/// A file of the data set, in a folder that is made.
pub fn file(folder: &Path, name: &str) -> Result<PathBuf, DatasetError> {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap_or(folder)).map_err(io_error(&path))?;
    Ok(path)
}

fn pretty(value: &Value) -> String {
    format!("{value:#}\n")
}

fn lines(values: impl Iterator<Item = Value>) -> String {
    values.map(|value| format!("{value}\n")).collect()
}

impl Writer {
    pub(super) fn create(
        folder: &Path,
        options: &Options,
        shape: &Shape,
    ) -> Result<Self, DatasetError> {
        fs::create_dir_all(folder).map_err(io_error(folder))?;
        Ok(Self {
            folder: folder.to_owned(),
            options: options.clone(),
            shape: shape.clone(),
            tasks: Vec::new(),
            done: Vec::new(),
            values: numbers(),
            pictures: vec![PictureStatistics::default(); shape.views.len()],
            models: BTreeSet::new(),
            facts: BTreeSet::new(),
            has_view: false,
        })
    }

    pub fn views(&self) -> Vec<String> {
        self.shape.views.iter().map(|(name, _)| name.clone()).collect()
    }

    pub fn is_video(&self) -> bool {
        self.options.ffmpeg.is_some() && !self.shape.views.is_empty()
    }

    /// Notes what a recording says of the robot.
    pub fn about(&mut self, recorded: &Recorded) {
        self.models.extend(recorded.model_ids());
        self.has_view |= recorded.has_view();
        for name in ["robot_id", "controller", "recorder"] {
            let fact = recorded.about.get(name);
            self.facts.extend(fact.map(|value| (name.to_owned(), value.clone())));
        }
        if !self.shape.views.is_empty() {
            let late = recorded.late_s.map(|(late, deviation)| {
                let [late, deviation] = [late, deviation].map(|seconds| 1e3 * seconds);
                format!("{late:.1} ms late (deviation {deviation:.1} ms), put right")
            });
            let unknown = || "not measured: nothing moved under a camera".to_owned();
            self.facts.insert(("stamps of pictures".to_owned(), late.unwrap_or_else(unknown)));
        }
    }

    fn columns(&self) -> Vec<Column> {
        let mut columns: Vec<_> = FEATURES.iter().map(|feature| feature.column()).collect();
        if !self.is_video() {
            let views = self.shape.views.iter();
            columns.extend(views.map(|(view, _)| Column::new(view_name(view), Kind::Picture, &[])));
        }
        columns.extend(INDEX.map(|(name, kind)| Column::new(name, kind, &[])));
        columns
    }

    pub fn rows_done(&self) -> usize {
        self.done.iter().map(|episode| episode.rows).sum()
    }

    fn data_file(&self, episode: usize) -> String {
        let (chunk, file) = (episode / CHUNK, episode % CHUNK);
        match self.options.version {
            Version::V21 => format!("data/chunk-{chunk:03}/episode_{episode:06}.parquet"),
            Version::V3 => format!("data/chunk-{chunk:03}/file-{file:03}.parquet"),
        }
    }

    fn video_file(&self, view: &str, episode: usize) -> String {
        let (chunk, file, name) = (episode / CHUNK, episode % CHUNK, view_name(view));
        match self.options.version {
            Version::V21 => format!("videos/chunk-{chunk:03}/{name}/episode_{episode:06}.mp4"),
            Version::V3 => format!("videos/{name}/chunk-{chunk:03}/file-{file:03}.mp4"),
        }
    }

    pub fn begin(&mut self, task: &str, rows: usize) -> Result<EpisodeWriter, DatasetError> {
        let number = self.done.len();
        let known = self.tasks.iter().position(|it| it == task);
        let task = known.unwrap_or_else(|| {
            self.tasks.push(task.to_owned());
            self.tasks.len() - 1
        });
        let path = file(&self.folder, &self.data_file(number))?;
        let columns = self.columns();
        let described: Map<String, Value> =
            columns.iter().map(|column| (column.name.clone(), described(column))).collect();
        let about = json!({ "info": { "features": described } }).to_string();
        let table = Table::create(&path, columns, &[("huggingface", about)]);
        let mut videos = Vec::new();
        if let (Some(ffmpeg), true) = (&self.options.ffmpeg, self.is_video()) {
            for view in self.views() {
                let output = file(&self.folder, &self.video_file(&view, number))?;
                videos.push(Video::create(ffmpeg, &output, self.shape.fps)?);
            }
        }
        Ok(EpisodeWriter {
            table: table.map_err(table_error(&path))?,
            path,
            videos,
            task,
            rows: 0,
            expected: rows,
            values: numbers(),
            pictures: vec![PictureStatistics::default(); self.shape.views.len()],
            number,
            first: self.rows_done(),
            fps: f64::from(self.shape.fps),
        })
    }

    pub fn end(&mut self, episode: EpisodeWriter) -> Result<(), DatasetError> {
        let EpisodeWriter { path, table, videos, task, rows, values, pictures, .. } = episode;
        table.finish().map_err(table_error(&path))?;
        videos.into_iter().try_for_each(Video::finish)?;
        let numbers: Vec<(String, Statistics)> = values
            .iter()
            .map(|(name, width, values)| (name.clone(), Statistics::of(values, *width)))
            .collect();
        for ((_, _, all), (_, _, own)) in self.values.iter_mut().zip(values) {
            all.extend(own);
        }
        let statistics = all_statistics(&numbers, &pictures, &self.views());
        self.pictures.iter_mut().zip(&pictures).for_each(|(all, own)| all.merge(own));
        self.done.push(Done { task, rows, statistics, numbers });
        Ok(())
    }

    /// Writes what describes the data.
    pub fn finish(self, dataset: &Dataset, sources: &[Source]) -> Result<(), DatasetError> {
        let write = |name: &str, text: String| {
            let path = file(&self.folder, name)?;
            files::replace(&path, text.as_bytes()).map_err(io_error(&path))
        };
        write("meta/info.json", pretty(&self.info(dataset)))?;
        match self.options.version {
            Version::V21 => {
                let tasks = self.tasks.iter().enumerate();
                let tasks = tasks.map(|(index, task)| json!({ "task_index": index, "task": task }));
                write("meta/tasks.jsonl", lines(tasks))?;
                let done = || self.done.iter().enumerate();
                let episodes = done().map(|(number, episode)| {
                    let task = &self.tasks[episode.task];
                    json!({ "episode_index": number, "tasks": [task], "length": episode.rows })
                });
                write("meta/episodes.jsonl", lines(episodes))?;
                let statistics = done().map(|(number, episode)| {
                    let all: Map<_, _> = episode.statistics.iter().cloned().collect();
                    json!({ "episode_index": number, "stats": all })
                });
                write("meta/episodes_stats.jsonl", lines(statistics))?;
            }
            Version::V3 => {
                let numbers: Vec<_> = { self.values.iter() }
                    .map(|(name, width, values)| (name.clone(), Statistics::of(values, *width)))
                    .collect();
                let all = all_statistics(&numbers, &self.pictures, &self.views());
                write("meta/stats.json", pretty(&Value::Object(all.into_iter().collect())))?;
                self.write_tasks()?;
                self.write_episodes()?;
            }
        }
        let made_of = json!({
            "software": concat!("i2ris ", env!("CARGO_PKG_VERSION")),
            "recordings": sources.iter().map(|source| &source.recording).collect::<Vec<_>>(),
            "episodes": dataset.episodes,
            "left_out": dataset.left_out,
        });
        write(MADE_OF, pretty(&made_of))?;
        write("README.md", self.readme(dataset))
    }

    /// What is done in the episodes.
    pub fn tasks(&self) -> &[String] {
        &self.tasks
    }
}

impl EpisodeWriter {
    /// `pictures`: one of each view.
    pub fn row(
        &mut self,
        mut cells: Vec<Cell>,
        pictures: Vec<Vec<u8>>,
    ) -> Result<(), DatasetError> {
        let frame = self.rows as f64;
        for (view, jpeg) in pictures.into_iter().enumerate() {
            if self.rows.is_multiple_of(PictureStatistics::step(self.expected))
                && let Some(pixels) = pixels(&jpeg)
            {
                self.pictures[view].add(&pixels);
            }
            match self.videos.get_mut(view) {
                Some(video) => video.add(&jpeg)?,
                None => {
                    let name = format!("frame-{:06}.jpg", self.rows);
                    cells.push(Cell::Picture { bytes: jpeg, name });
                }
            }
        }
        let [episode, index] = [self.number, self.first + self.rows].map(|it| it as f64);
        let index = [frame / self.fps, frame, episode, index, self.task as f64];
        cells.extend(index.map(|value| Cell::Numbers(vec![value])));
        let is_number = |cell: &&Cell| matches!(cell, Cell::Numbers(_) | Cell::Integer(_));
        for ((_, _, to), cell) in self.values.iter_mut().zip(cells.iter().filter(is_number)) {
            match cell {
                Cell::Numbers(values) => to.extend(values),
                Cell::Integer(value) => to.push(*value as f64),
                Cell::Text(_) | Cell::Picture { .. } => {}
            }
        }
        self.rows += 1;
        self.table.row(cells).map_err(table_error(&self.path))
    }
}

/// Red, green and blue of every pixel; `None`: it is no picture.
fn pixels(jpeg: &[u8]) -> Option<Vec<u8>> {
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGB);
    zune_jpeg::JpegDecoder::new_with_options(ZCursor::new(jpeg), options).decode().ok()
}

fn all_statistics(
    numbers: &[(String, Statistics)],
    pictures: &[PictureStatistics],
    views: &[String],
) -> Vec<(String, Value)> {
    let numbers = numbers.iter().map(|(name, statistics)| (name.clone(), statistics.json(false)));
    let pictures = views.iter().zip(pictures);
    let pictures = pictures.map(|(view, it)| (view_name(view), it.statistics().json(true)));
    numbers.chain(pictures).collect()
}
