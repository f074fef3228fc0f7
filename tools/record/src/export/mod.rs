//! Tables for MATLAB, pandas and spreadsheets: one CSV file for each topic of payloads.
//!
//! Columns are the fields of the payload: angles as `pitch_deg`, `yaw_deg`, states by name, other
//! arrays as `NAME_0`, `NAME_1`, ..., members of spans as `NAME_p50_ns`, hashes as hexadecimal
//! digits. The first columns are `time`, UTC, `t_s`, seconds since the first message of the file,
//! and `received_s`, the same for the arrival at the recorder. Entries that a message does not have
//! are empty (NaN). `units.csv` has the unit of every column. `overview` is the table for people:
//! all angles and the state on one grid. Pictures, if requested, are files in one folder per view,
//! named by the `t_s` of their exposure.
//!
//! [`extract`] writes what other programs read: attachments, and the commands of each client as a
//! table for `i2ris command file`. The columns of payloads are in `columns`.

mod columns;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use i2ris::ipc::payload::{PayloadLayout, ServoJp};
use i2ris::ipc::{Stream, StreamMessage};
use i2ris::wall_clock::WallTime;
use mcap::records::{MessageHeader, Record};

use crate::messages::{DEFAULT_NAMES, Picture, Topic, cdr, view_of_topic};
use crate::read::{ReadError, Records};
use crate::recorder::{ALIGNMENT, HEADER, JOINTS, OUTCOME};
use crate::report::Trial;
use columns::Cell;

#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("cannot write {path}: {reason}; a file there is incomplete or of another recording")]
    Write { path: PathBuf, reason: String },
    #[error("cannot create the folder {path}: {source}")]
    Folder { path: PathBuf, source: io::Error },
}

#[derive(Debug, Default)]
pub struct ExportedTables {
    /// Rows of every table, by file name.
    pub rows: BTreeMap<String, u64>,
    /// Delay of the camera's stamps, s; `None`: not measured.
    pub camera_late_s: Option<f64>,
    /// Reason why the recording cannot be read to its end; `None`: it is complete.
    pub stopped_by: Option<ReadError>,
}

struct OpenTable {
    name: String,
    path: PathBuf,
    layout: PayloadLayout,
    outputs: Vec<String>,
    columns: Vec<String>,
    writer: csv::Writer<BufWriter<File>>,
}

/// Error of writing into a file.
fn failed<E: ToString>(path: &Path) -> impl FnOnce(E) -> ExportError {
    let path = path.to_owned();
    move |error| ExportError::Write { path, reason: error.to_string() }
}

fn create_folder(path: &Path) -> Result<(), ExportError> {
    fs::create_dir_all(path).map_err(|source| ExportError::Folder { path: path.to_owned(), source })
}

/// Writes tables into a folder, and pictures if requested; of a truncated recording what it has.
pub fn export(
    recording: &Path,
    folder: &Path,
    with_pictures: bool,
) -> Result<ExportedTables, ExportError> {
    let mut records = Records::open(recording)?;
    let mut views: BTreeMap<u16, PathBuf> = BTreeMap::new();
    create_folder(folder)?;
    let mut tables: BTreeMap<u16, OpenTable> = BTreeMap::new();
    let mut exported = ExportedTables::default();
    let (mut start, mut outputs) = (None, DEFAULT_NAMES.map(str::to_owned).to_vec());
    for record in records.by_ref() {
        match record {
            Record::Metadata(found) if found.name == HEADER => {
                let named = found.metadata.get(JOINTS);
                let named = named.map(|names| names.split(' ').map(str::to_owned).collect());
                outputs = named.unwrap_or(outputs);
            }
            Record::Metadata(found) if found.name == OUTCOME => {
                let late = found.metadata.get(ALIGNMENT);
                exported.camera_late_s = late.and_then(|text| text.parse().ok());
            }
            Record::Channel(channel) if !tables.contains_key(&channel.id) => {
                if let Some(view) = view_of_topic(&channel.topic).filter(|_| with_pictures) {
                    let path = folder.join("pictures").join(view);
                    create_folder(&path)?;
                    views.insert(channel.id, path);
                } else if let Some(stream) = Topic::payload_stream(&channel.topic) {
                    let table = OpenTable::of_stream(folder, stream, &outputs)?;
                    tables.insert(channel.id, table);
                }
            }
            Record::Message { header, data } => {
                if let Some(table) = tables.get_mut(&header.channel_id) {
                    let start = *start.get_or_insert(header.publish_time.min(header.log_time));
                    if table.write_message(start, &header, &data)? {
                        *exported.rows.entry(table.name.clone()).or_default() += 1;
                    }
                } else if let Some(view) = views.get(&header.channel_id) {
                    let start = *start.get_or_insert(header.publish_time.min(header.log_time));
                    write_picture(view, start, &data)?;
                }
            }
            _ => {}
        }
    }
    exported.stopped_by = records.stopped_by();
    let joined = joined_table(recording, folder, &mut exported)?;
    let tables: Vec<OpenTable> = joined.into_iter().chain(tables.into_values()).collect();
    let units = units(&tables);
    for OpenTable { path, mut writer, .. } in tables {
        writer.flush().map_err(failed(&path))?;
    }
    let path = folder.join("units.csv");
    fs::write(&path, units).map_err(failed(&path))?;
    Ok(exported)
}

/// Writes a picture, named by its exposure. Messages that are not pictures are skipped.
fn write_picture(view: &Path, start: u64, message: &[u8]) -> Result<(), ExportError> {
    let Some(Picture { unix_ns, jpeg }) = Picture::decode(message) else { return Ok(()) };
    let seconds = (i128::from(unix_ns) - i128::from(start)) as f64 * 1e-9;
    let path = view.join(format!("{seconds:.9}.jpg"));
    fs::write(&path, jpeg).map_err(failed(&path))
}

/// The table of all angles; `None` if the recording has none.
fn joined_table(
    recording: &Path,
    folder: &Path,
    exported: &mut ExportedTables,
) -> Result<Option<OpenTable>, ExportError> {
    let trial = Trial::read(recording)?;
    if trial.angles().iter().all(|(_, series)| series.is_empty()) {
        return Ok(None);
    }
    let layout = Stream::Measured.layout();
    let mut table = OpenTable::create(folder, "overview", layout, columns::overview_columns())?;
    for row in columns::overview_rows(&trial) {
        table.write_row(row)?;
        *exported.rows.entry(table.name.clone()).or_default() += 1;
    }
    Ok(Some(table))
}

/// The unit of every column of every table, as CSV.
fn units(tables: &[OpenTable]) -> String {
    let mut text = "table,column,unit\n".to_owned();
    for table in tables {
        let name = table.path.file_stem().unwrap_or_default().to_string_lossy();
        for column in &table.columns {
            text.push_str(&format!("{name},{column},{}\n", columns::unit(column)));
        }
    }
    text
}

impl OpenTable {
    fn of_stream(folder: &Path, stream: Stream, outputs: &[String]) -> Result<Self, ExportError> {
        let (name, layout) = (stream.name().replace('/', "_"), stream.layout());
        let columns = columns::columns(&layout, outputs);
        let table = Self::create(folder, &name, layout, columns)?;
        Ok(Self { outputs: outputs.to_vec(), ..table })
    }

    fn create(
        folder: &Path,
        name: &str,
        layout: PayloadLayout,
        columns: Vec<String>,
    ) -> Result<Self, ExportError> {
        let name = format!("{name}.csv");
        let path = folder.join(&name);
        let file = File::create(&path).map_err(failed(&path))?;
        let mut writer = csv::Writer::from_writer(BufWriter::new(file));
        writer.write_record(&columns).map_err(failed(&path))?;
        Ok(Self { name, path, layout, outputs: Vec::new(), columns, writer })
    }

    /// Writes a row; `false` if the message has another layout.
    fn write_message(
        &mut self,
        start: u64,
        header: &MessageHeader,
        data: &[u8],
    ) -> Result<bool, ExportError> {
        let times = [header.publish_time, header.log_time];
        let cells = columns::cells(&self.layout, &self.outputs, start, times, data);
        cells.map_or(Ok(false), |cells| self.write_row(cells).map(|()| true))
    }

    fn write_row(&mut self, cells: Vec<Cell>) -> Result<(), ExportError> {
        let texts = cells.into_iter().map(|cell| match cell {
            Cell::Time(ns) => iso(ns),
            Cell::Seconds(seconds) => format!("{seconds:.9}"),
            Cell::Number(number) => number.to_string(),
            Cell::Text(text) => text,
        });
        self.writer.write_record(texts).map_err(failed(&self.path))
    }
}

/// An instant as in ISO 8601, with microseconds.
fn iso(unix_ns: u64) -> String {
    let second = WallTime::from_unix_seconds(unix_ns / 1_000_000_000).to_string();
    format!("{}.{:06}Z", second.trim_end_matches('Z'), unix_ns / 1000 % 1_000_000)
}

/// Number of angles in a command; models of the tip have three values.
const ANGLES: u32 = 2;

#[derive(Debug, Default)]
pub struct Extracted {
    /// File names with their sizes.
    pub files: Vec<(String, String)>,
    /// Reason why the recording cannot be read to its end; `None`: it is complete.
    pub stopped_by: Option<ReadError>,
}

/// The commands of one client, in the order of their stamps.
#[derive(Default)]
struct Commands {
    first_ns: u64,
    last_ns: u64,
    rows: u64,
    table: String,
}

impl Commands {
    fn add(&mut self, command: &ServoJp) {
        if self.rows == 0 {
            (self.first_ns, self.table) = (command.stamp_ns, "t_s,pitch_deg,yaw_deg\n".to_owned());
        } else if command.stamp_ns <= self.last_ns {
            return;
        }
        (self.last_ns, self.rows) = (command.stamp_ns, self.rows + 1);
        let seconds = (command.stamp_ns - self.first_ns) as f64 * 1e-9;
        let [pitch, yaw, _] = command.position.map(f64::to_degrees);
        // Writing to a string cannot fail.
        let _ = writeln!(self.table, "{seconds:.6},{pitch:.6},{yaw:.6}");
    }
}

/// Writes into a folder, created if necessary; an existing file is an error and stays unchanged.
/// Commands with an open clutch are skipped: they are displacements of a master, not poses.
pub fn extract(recording: &Path, folder: &Path) -> Result<Extracted, ExportError> {
    let mut records = Records::open(recording)?;
    create_folder(folder)?;
    let mut extracted = Extracted::default();
    let (mut channels, mut clients) = (BTreeMap::new(), BTreeMap::<u64, Commands>::new());
    for record in records.by_ref() {
        match record {
            Record::Channel(channel) => {
                let stream = Topic::payload_stream(&channel.topic);
                channels.extend(stream.map(|stream| (channel.id, stream)));
            }
            Record::Message { header, data } => {
                let stream = channels.get(&header.channel_id);
                if let Some(StreamMessage::ServoJp(command)) =
                    stream.and_then(|stream| cdr::decode(*stream, &data))
                    && command.count == ANGLES
                    && command.flags & (ServoJp::CLUTCH | ServoJp::RATE) == 0
                {
                    clients.entry(command.client_id).or_default().add(&command);
                }
            }
            Record::Attachment { header, data, .. } => {
                // Only the last part of a path: nothing is written outside the folder.
                if let Some(name) = Path::new(&header.name).file_name() {
                    let name = name.to_string_lossy().into_owned();
                    write(&folder.join(&name), &data)?;
                    extracted.files.push((name, format!("{} bytes", data.len())));
                }
            }
            _ => {}
        }
    }
    let mut clients: Vec<Commands> = clients.into_values().collect();
    clients.sort_by_key(|commands| std::cmp::Reverse(commands.rows));
    for (number, commands) in (1..).zip(clients) {
        let name = if number == 1 { String::new() } else { format!("-{number}") };
        let name = format!("commands{name}.csv");
        write(&folder.join(&name), commands.table.as_bytes())?;
        extracted.files.push((name, format!("{} commands", commands.rows)));
    }
    extracted.stopped_by = records.stopped_by();
    Ok(extracted)
}

fn write(path: &Path, content: &[u8]) -> Result<(), ExportError> {
    File::create_new(path).and_then(|mut file| file.write_all(content)).map_err(failed(path))
}
