//! From messages to a file that survives its writer.
//!
//! Whoever listens to the robot hands messages over and never waits: a thread of its own writes
//! them. It closes a chunk of the file every [`FLUSH`], so a program that is killed loses no more
//! than that, and asks the disk to keep what it has every [`SYNC`], for the case that the power
//! goes. A disk that stalls fills the queue; what does not fit any more is dropped and counted. A
//! disk that is full ends the recording, and is reported.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use i2ris::ipc::Message;
use i2ris::ipc::payload::JointState;
use i2ris::units::Nanos;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};

use crate::cdr;
use crate::joint;
use crate::layout::Laid;
use crate::topic::{Stream, Topic};

/// What is lost at most when the program is killed.
pub const FLUSH: Duration = Duration::from_millis(200);
/// What is lost at most when the power goes.
pub const SYNC: Duration = Duration::from_millis(1000);
/// Messages that wait for a disk: ten seconds of everything.
const QUEUE: usize = 1 << 16;

/// Name of the metadata that stand at the start.
pub const HEADER: &str = "i2ris.header";
/// Name of the metadata that stand at the end of a recording that ended well.
pub const OUTCOME: &str = "i2ris.outcome";

/// Why a recording cannot begin, or ended.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be made.
    #[error(
        "cannot make {path}: {source}; name a file that does not exist yet, in a folder that you may write to"
    )]
    Create {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file cannot be written any more.
    #[error(
        "{path}: {source}; what was written until then can be read after `i2ris record recover`"
    )]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        source: McapError,
    },
    /// The writing thread is gone.
    #[error("{path}: the thread that writes it ended without a word")]
    Thread {
        /// Which.
        path: PathBuf,
    },
}

/// A file that goes into a recording: name, media type, bytes.
pub type Attached = (String, &'static str, Vec<u8>);

/// What stands at the start of a file.
#[derive(Debug, Clone, Default)]
pub struct Header {
    /// Words about the recording: robot, software, model.
    pub about: BTreeMap<String, String>,
    /// Files that go into it.
    pub attachments: Vec<Attached>,
    /// Unix time minus monotonic time, ns.
    pub unix_offset_ns: u64,
    /// Names of the joints.
    pub joints: Vec<String>,
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Written {
    /// Messages of each stream.
    pub messages: BTreeMap<Stream, u64>,
    /// Messages that found the queue full.
    pub dropped: u64,
}

struct Item {
    topic: Topic,
    sequence: u32,
    stamp: Nanos,
    received: Nanos,
    bytes: Vec<u8>,
}

/// A recording under way.
#[derive(Debug)]
pub struct Trial {
    path: PathBuf,
    to: Option<SyncSender<Item>>,
    thread: Option<JoinHandle<Result<Writer<BufWriter<File>>, McapError>>>,
    failed: Arc<AtomicBool>,
    unix_offset_ns: u64,
    joints: Vec<String>,
    written: Written,
}

impl Trial {
    /// Makes the file, which must not exist, and writes its header.
    ///
    /// # Errors
    ///
    /// [`RecordError::Create`], [`RecordError::Write`].
    pub fn start(path: &Path, header: Header) -> Result<Self, RecordError> {
        let create = |source| RecordError::Create {
            path: path.to_owned(),
            source,
        };
        let file = File::create_new(path).map_err(create)?;
        let disk = file.try_clone().map_err(create)?;
        let begun = begin(file, &header).map_err(|source| RecordError::Write {
            path: path.to_owned(),
            source,
        })?;
        let (to, from) = sync_channel(QUEUE);
        let failed = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&failed);
        let offset = header.unix_offset_ns;
        let thread = thread::spawn(move || {
            let outcome = write(begun, &disk, offset, &from);
            flag.store(outcome.is_err(), Ordering::Release);
            outcome
        });
        Ok(Self {
            path: path.to_owned(),
            to: Some(to),
            thread: Some(thread),
            failed,
            unix_offset_ns: offset,
            joints: header.joints,
            written: Written::default(),
        })
    }

    /// Whether the disk has refused: time to call [`Trial::finish`], which says why.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.failed.load(Ordering::Acquire)
    }

    /// What was handed over so far.
    #[must_use]
    pub fn written(&self) -> &Written {
        &self.written
    }

    /// Hands over a message of a stream. Never waits.
    pub fn take<T: Laid + Message>(&mut self, stream: Stream, message: &T, received: Nanos) {
        let (sequence, stamp) = (message.sequence() as u32, message.stamp());
        *self.written.messages.entry(stream).or_default() += 1;
        self.put(Item {
            topic: Topic::Own(stream),
            sequence,
            stamp,
            received,
            bytes: cdr::message(message),
        });
    }

    /// Hands over angles, which become standard messages as well.
    pub fn take_joints(&mut self, stream: Stream, message: &JointState, received: Nanos) {
        self.take(stream, message, received);
        let (sequence, stamp) = (message.sequence as u32, message.stamp());
        if let Some(bytes) = joint::message(
            message,
            message.stamp_ns.wrapping_add(self.unix_offset_ns),
            &self.joints,
        ) {
            self.put(Item {
                topic: Topic::Joint(stream),
                sequence,
                stamp,
                received,
                bytes,
            });
        }
    }

    fn put(&mut self, item: Item) {
        let taken = self.to.as_ref().is_some_and(|to| to.try_send(item).is_ok());
        self.written.dropped += u64::from(!taken);
    }

    /// Writes what waits, `outcome`, files that go to the end, and the end of the file.
    ///
    /// # Errors
    ///
    /// [`RecordError::Write`] with what ended the recording, [`RecordError::Thread`].
    pub fn finish(
        mut self,
        outcome: BTreeMap<String, String>,
        files: &[Attached],
    ) -> Result<Written, RecordError> {
        self.to = None;
        let path = self.path.clone();
        let joined = self.thread.take().and_then(|thread| thread.join().ok());
        let ended = joined.ok_or_else(|| RecordError::Thread { path: path.clone() })?;
        let refused = |source| RecordError::Write { path, source };
        let mut file = match ended {
            Ok(file) => file,
            Err(error) => return Err(refused(error)),
        };
        let end = |file: &mut Writer<BufWriter<File>>| {
            attach(file, files, self.unix_offset_ns)?;
            file.write_metadata(&Metadata {
                name: OUTCOME.to_owned(),
                metadata: outcome,
            })?;
            file.finish().map(drop)
        };
        end(&mut file).map_err(refused)?;
        Ok(self.written.clone())
    }
}

fn begin(file: File, header: &Header) -> Result<Writer<BufWriter<File>>, McapError> {
    let options = WriteOptions::new()
        .profile("ros2")
        .library(concat!("i2ris ", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Lz4))
        // A chunk goes to the file whole or not at all.
        .disable_seeking(true);
    let mut writer = Writer::with_options(BufWriter::new(file), options)?;
    let mut about = header.about.clone();
    about.insert(
        "unix_minus_monotonic_ns".to_owned(),
        header.unix_offset_ns.to_string(),
    );
    writer.write_metadata(&Metadata {
        name: HEADER.to_owned(),
        metadata: about,
    })?;
    attach(&mut writer, &header.attachments, header.unix_offset_ns)?;
    for topic in Topic::all() {
        topic.declare(&mut writer)?;
    }
    writer.flush()?;
    Ok(writer)
}

fn attach(
    to: &mut Writer<BufWriter<File>>,
    files: &[Attached],
    unix_offset_ns: u64,
) -> Result<(), McapError> {
    let now = unix_offset_ns.wrapping_add(i2ris::clock::now().0);
    files.iter().try_for_each(|(name, media_type, data)| {
        to.attach(&Attachment {
            log_time: now,
            create_time: now,
            name: name.clone(),
            media_type: (*media_type).to_owned(),
            data: data.as_slice().into(),
        })
    })
}

/// Writes what comes until nothing more can come.
fn write(
    mut file: Writer<BufWriter<File>>,
    disk: &File,
    unix_offset_ns: u64,
    from: &Receiver<Item>,
) -> Result<Writer<BufWriter<File>>, McapError> {
    let channels: BTreeMap<Topic, u16> = Topic::all()
        .map(|topic| Ok((topic, topic.declare(&mut file)?)))
        .collect::<Result<_, McapError>>()?;
    let (mut flushed, mut synced) = (Instant::now(), Instant::now());
    loop {
        match from.recv_timeout(FLUSH.saturating_sub(flushed.elapsed())) {
            Ok(Item {
                topic,
                sequence,
                stamp,
                received,
                bytes,
            }) => {
                let unix = |Nanos(monotonic)| monotonic.wrapping_add(unix_offset_ns);
                let Some(channel_id) = channels.get(&topic).copied() else {
                    continue;
                };
                let header = MessageHeader {
                    channel_id,
                    sequence,
                    log_time: unix(received),
                    publish_time: unix(stamp),
                };
                file.write_to_known_channel(&header, &bytes)?;
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(file),
        }
        if flushed.elapsed() >= FLUSH {
            file.flush()?;
            flushed = Instant::now();
        }
        if synced.elapsed() >= SYNC {
            synced = Instant::now();
            // Some places cannot be asked to keep: pipes, some network disks. That is theirs to
            // know.
            let _ = disk.sync_data();
        }
    }
}
