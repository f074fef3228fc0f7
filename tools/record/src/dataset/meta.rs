//! The files of a data set that describe the others: features, tasks, episodes.

use serde_json::{Map, Value, json};

use super::features::{FEATURES, INDEX, dtype};
use super::lerobot::{CHUNK, Writer, file, table_error, view_name};
use super::table::{Cell, Column, Kind, Table};
use super::{Dataset, DatasetError, Version};
use crate::study::journal::Outcome;

impl Writer {
    pub fn info(&self, dataset: &Dataset) -> Value {
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
            "total_tasks": self.tasks().len(),
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
    pub fn write_tasks(&self) -> Result<(), DatasetError> {
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
        for (index, task) in self.tasks().iter().enumerate() {
            let cells = vec![Cell::Integer(index as i64), Cell::Text(task.clone())];
            table.row(cells).map_err(table_error(&path))?;
        }
        table.finish().map_err(table_error(&path))
    }

    pub fn write_episodes(&self) -> Result<(), DatasetError> {
        let path = file(&self.folder, "meta/episodes/chunk-000/file-000.parquet")?;
        let (mut table, mut from) = (None, 0);
        for (number, episode) in self.done.iter().enumerate() {
            let to = from + episode.rows;
            let (chunk, file) = (number / CHUNK, number % CHUNK);
            let mut row = vec![
                (Column::new("episode_index", Kind::Integer, &[]), Cell::Integer(number as i64)),
                (
                    Column::new("tasks", Kind::Text, &[1]),
                    Cell::Text(self.tasks()[episode.task].clone()),
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
