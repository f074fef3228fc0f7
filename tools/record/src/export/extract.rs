//! Extracts from a recording what other programs read: attachments, and the commands of each client
//! as a table for `i2ris command file`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::path::Path;

use i2ris::ipc::StreamMessage;
use i2ris::ipc::payload::ServoJp;
use mcap::records::Record;

use crate::export::{ExportError, create_folder, failed};
use crate::messages::cdr;
use crate::messages::topic::Topic;
use crate::read::{ReadError, Records};

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
