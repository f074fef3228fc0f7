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

use super::features::{FEATURES, INDEX, described, dtype};
use super::recorded::Recorded;
use super::staged::MADE_OF;
use super::statistics::{PictureStatistics, Statistics};
use super::table::{Cell, Column, Kind, Table};
use super::video::Video;
use super::{Dataset, DatasetError, Options, Shape, Source, Version, readme};
use crate::study::journal::Outcome;

/// Episodes of a folder.
const CHUNK: usize = 1000;

/// A data set in progress.
pub struct Writer {
    folder: PathBuf,
    options: Options,
    shape: Shape,
    tasks: Vec<String>,
    done: Vec<Done>,
    /// Values of each column of numbers, of all rows.
    values: Vec<(String, usize, Vec<f64>)>,
    pictures: Vec<PictureStatistics>,
    pub models: BTreeSet<[u8; 32]>,
    /// Facts of the recordings: controllers, robots.
    pub facts: BTreeSet<(String, String)>,
    pub has_view: bool,
}

/// A finished episode.
struct Done {
    task: usize,
    rows: usize,
    statistics: Vec<(String, Value)>,
    numbers: Vec<(String, Statistics)>,
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

fn table_error(path: &Path) -> impl FnOnce(parquet::errors::ParquetError) -> DatasetError {
    |error| DatasetError::Table { path: path.to_owned(), error }
}

/// A file of the data set, in a folder that is made.
fn file(folder: &Path, name: &str) -> Result<PathBuf, DatasetError> {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap_or(folder)).map_err(io_error(&path))?;
    Ok(path)
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

    fn rows_done(&self) -> usize {
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
        write("README.md", readme::text(dataset, &self))
    }

    fn info(&self, dataset: &Dataset) -> Value {
        let mut features = Map::new();
        for feature in &FEATURES {
            let (entries, kind) = (feature.entries, dtype(feature.kind));
            let names = (!entries.is_empty()).then_some(entries);
            let shape = [entries.len().max(1)];
            let feature_json = json!({ "dtype": kind, "shape": shape, "names": names });
            features.insert(feature.name.to_owned(), feature_json);
        }
        let even =
            |length: usize| if self.is_video() { length.next_multiple_of(2) } else { length };
        for (view, [width, height, colours]) in &self.shape.views {
            let colours = if self.is_video() { 3 } else { *colours };
            let kind = if self.is_video() { "video" } else { "image" };
            let shape = [even(*height), even(*width), colours];
            let mut feature = json!({
                "dtype": kind, "shape": shape, "names": ["height", "width", "channels"],
            });
            if self.is_video() {
                feature["info"] = json!({
                    "video.height": shape[0], "video.width": shape[1], "video.channels": 3,
                    "video.codec": "h264", "video.pix_fmt": "yuv420p",
                    "video.is_depth_map": false, "video.fps": self.shape.fps, "has_audio": false,
                });
            }
            features.insert(view_name(view), feature);
        }
        for (name, kind) in INDEX {
            let feature = json!({ "dtype": dtype(kind), "shape": [1], "names": null });
            features.insert(name.to_owned(), feature);
        }
        let episodes = self.done.len();
        let mut info = json!({
            "robot_type": "i2ris",
            "total_episodes": episodes,
            "total_frames": self.rows_done(),
            "total_tasks": self.tasks.len(),
            "chunks_size": CHUNK,
            "fps": self.shape.fps,
            "splits": splits(dataset),
            "video_path": null,
            "features": features,
        });
        match self.options.version {
            Version::V21 => {
                let path = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet";
                info["codebase_version"] = "v2.1".into();
                info["data_path"] = path.into();
                info["total_chunks"] = episodes.div_ceil(CHUNK).into();
                let videos = if self.is_video() { episodes * self.shape.views.len() } else { 0 };
                info["total_videos"] = videos.into();
                if self.is_video() {
                    let path = "videos/chunk-{episode_chunk:03d}/{video_key}/\
                                episode_{episode_index:06d}.mp4";
                    info["video_path"] = path.into();
                }
            }
            Version::V3 => {
                let path = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet";
                info["codebase_version"] = "v3.0".into();
                info["data_path"] = path.into();
                info["data_files_size_in_mb"] = 100.into();
                info["video_files_size_in_mb"] = 200.into();
                if self.is_video() {
                    let path =
                        "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4";
                    info["video_path"] = path.into();
                }
            }
        }
        info
    }

    /// The tasks as a table that pandas reads with the texts as its index.
    fn write_tasks(&self) -> Result<(), DatasetError> {
        let path = file(&self.folder, "meta/tasks.parquet")?;
        let columns = vec![
            Column::new("task_index", Kind::Integer, &[]),
            Column::new("task", Kind::Text, &[]),
        ];
        let pandas = json!({
            "index_columns": ["task"],
            "column_indexes": [],
            "columns": [
                { "name": "task_index", "field_name": "task_index", "pandas_type": "int64",
                  "numpy_type": "int64", "metadata": null },
                { "name": "task", "field_name": "task", "pandas_type": "unicode",
                  "numpy_type": "object", "metadata": null },
            ],
            "pandas_version": "2.0.0",
        });
        let about = [("pandas", pandas.to_string())];
        let mut table = Table::create(&path, columns, &about).map_err(table_error(&path))?;
        for (index, task) in self.tasks.iter().enumerate() {
            let cells = vec![Cell::Integer(index as i64), Cell::Text(task.clone())];
            table.row(cells).map_err(table_error(&path))?;
        }
        table.finish().map_err(table_error(&path))
    }

    fn write_episodes(&self) -> Result<(), DatasetError> {
        let path = file(&self.folder, "meta/episodes/chunk-000/file-000.parquet")?;
        let (mut table, mut from) = (None, 0);
        for (number, episode) in self.done.iter().enumerate() {
            let to = from + episode.rows;
            let (chunk, file) = (number / CHUNK, number % CHUNK);
            let mut row = vec![
                (Column::new("episode_index", Kind::Integer, &[]), Cell::Integer(number as i64)),
                (
                    Column::new("tasks", Kind::Text, &[1]),
                    Cell::Text(self.tasks[episode.task].clone()),
                ),
            ];
            let mut integer = |name: &str, value: usize| {
                row.push((Column::new(name, Kind::Integer, &[]), Cell::Integer(value as i64)));
            };
            integer("length", episode.rows);
            for (name, value) in [("data/chunk_index", chunk), ("data/file_index", file)] {
                integer(name, value);
            }
            integer("dataset_from_index", from);
            integer("dataset_to_index", to);
            integer("meta/episodes/chunk_index", 0);
            integer("meta/episodes/file_index", 0);
            if self.is_video() {
                for (view, _) in &self.shape.views {
                    let name = |what: &str| format!("videos/{}/{what}", view_name(view));
                    let mut push = |what, kind, cell| {
                        row.push((Column::new(name(what), kind, &[]), cell));
                    };
                    push("chunk_index", Kind::Integer, Cell::Integer(chunk as i64));
                    push("file_index", Kind::Integer, Cell::Integer(file as i64));
                    push("from_timestamp", Kind::Double, Cell::Numbers(vec![0.0]));
                    let length_s = episode.rows as f64 / f64::from(self.shape.fps);
                    push("to_timestamp", Kind::Double, Cell::Numbers(vec![length_s]));
                }
            }
            for (name, statistics) in &episode.numbers {
                for (what, values) in &statistics.values {
                    let name = format!("stats/{name}/{what}");
                    let column = Column::new(name, Kind::Double, &[values.len()]);
                    row.push((column, Cell::Numbers(values.clone())));
                }
                let column = Column::new(format!("stats/{name}/count"), Kind::Integer, &[1]);
                row.push((column, Cell::Integer(statistics.count as i64)));
            }
            let (columns, cells): (Vec<_>, Vec<_>) = row.into_iter().unzip();
            let table = match &mut table {
                Some(table) => table,
                none => {
                    none.insert(Table::create(&path, columns, &[]).map_err(table_error(&path))?)
                }
            };
            table.row(cells).map_err(table_error(&path))?;
            from = to;
        }
        table.map_or(Ok(()), |table| table.finish().map_err(table_error(&path)))
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

/// Outcomes as ranges of episodes, which are in the order of their outcomes.
fn splits(dataset: &Dataset) -> Value {
    let name = |outcome| match outcome {
        None | Some(Outcome::Success) => "train",
        Some(Outcome::Recovery) => "recovery",
        Some(Outcome::Failure) => "failure",
        Some(Outcome::Aborted) => "aborted",
    };
    let mut splits: Vec<(&str, [usize; 2])> = Vec::new();
    for (number, episode) in dataset.episodes.iter().enumerate() {
        match splits.last_mut().filter(|(last, _)| *last == name(episode.outcome)) {
            Some((_, range)) => range[1] = number + 1,
            None => splits.push((name(episode.outcome), [number, number + 1])),
        }
    }
    let text = splits
        .into_iter()
        .map(|(name, [from, to])| (name.to_owned(), json!(format!("{from}:{to}"))));
    Value::Object(text.collect())
}

fn pretty(value: &Value) -> String {
    format!("{value:#}\n")
}

fn lines(values: impl Iterator<Item = Value>) -> String {
    values.map(|value| format!("{value}\n")).collect()
}
