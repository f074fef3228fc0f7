//! Writes messages into a file that survives a crash.
//!
//! The caller never waits; a thread writes the messages. It completes a chunk of the file every
//! [`FLUSH_PERIOD`]: a program that is killed loses no more than that. It synchronizes the disk
//! every [`SYNC_PERIOD`], in case the power fails. If the disk is slow, the queue fills, and
//! messages that do not fit are dropped and counted. If the disk is full, the recording ends with
//! an error. Pictures have a budget, on the disk and in the queue; states are recorded beyond it.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use i2ris::ipc::{Stream, StreamMessage};
use i2ris::units::Nanos;
use i2ris_report::ros::{CompressedImage, Text};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};

use crate::messages::{
    McapFile, Picture, StandardMessages, Topic, TopicSchema, cdr, picture_topic,
};

/// Maximum loss if the program is killed.
pub const FLUSH_PERIOD: Duration = Duration::from_millis(200);
/// Maximum loss if the power fails.
pub const SYNC_PERIOD: Duration = Duration::from_millis(1000);
/// Messages that can wait for the disk: ten seconds of all streams.
const QUEUE_LENGTH: usize = 1 << 16;
/// Bytes of pictures that can wait for the disk.
const PICTURE_QUEUE: usize = 64 << 20;

/// Name of the metadata at the start.
pub const HEADER: &str = "i2ris.header";
pub const JOINTS: &str = "joints";
/// Entries at the end: delay of the camera's stamps, s, and its standard deviation.
pub const ALIGNMENT: &str = "camera_late_s";
pub const ALIGNMENT_DEVIATION: &str = "camera_late_deviation_s";
/// Name of the metadata at the end of a recording that ended without an error.
pub const OUTCOME: &str = "i2ris.outcome";

#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    #[error(
        "cannot create {path}: {source}; name a file that does not exist yet, in a writable folder"
    )]
    Create { path: PathBuf, source: io::Error },
    #[error(
        "{path}: {}; data written until then can be read after `i2ris record recover`",
        cause(source)
    )]
    Write { path: PathBuf, source: McapError },
    #[error("{path}: the thread that writes it ended without an error message")]
    Thread { path: PathBuf },
}

/// Error of the system where the format only wraps it.
fn cause(error: &McapError) -> String {
    match error {
        McapError::Io(error) if error.kind() == io::ErrorKind::StorageFull => {
            "the disk is full".to_owned()
        }
        McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}

#[derive(Debug, Clone)]
pub struct AttachedFile {
    pub name: String,
    pub media_type: &'static str,
    pub content: Vec<u8>,
}

#[derive(Debug, Clone, Default)]
pub struct RecordingHeader {
    /// Facts about the recording: robot, software, model.
    pub about: BTreeMap<String, String>,
    pub attachments: Vec<AttachedFile>,
    /// Unix time minus monotonic time, ns.
    pub unix_offset_ns: u64,
    pub joints: Vec<String>,
    /// The fixed link.
    pub frame: String,
    /// The robot as a URDF; empty: none.
    pub urdf: String,
    pub picture_budget: u64,
}

#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MessageCounts {
    pub messages: BTreeMap<Stream, u64>,
    /// Stamps of the first and the last message of each stream.
    pub spans: BTreeMap<Stream, (Nanos, Nanos)>,
    /// Messages that were dropped because the queue was full.
    pub dropped: u64,
    pub pictures: BTreeMap<String, PictureCounts>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PictureCounts {
    pub recorded: u64,
    /// Dropped because the disk was too slow.
    pub dropped: u64,
    /// Dropped because the budget was used up.
    pub over_budget: u64,
}

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Channel {
    Topic(Topic),
    /// The pictures of a view, whose topic is declared with the first one.
    View(String),
}

impl Channel {
    fn declare(&self, file: &mut McapFile) -> Result<u16, McapError> {
        match self {
            Self::Topic(topic) => topic.declare(file),
            Self::View(view) => {
                TopicSchema::of::<CompressedImage>().declare(file, &picture_topic(view))
            }
        }
    }
}

struct QueuedMessage {
    channel: Channel,
    sequence: u32,
    stamp: Nanos,
    received: Nanos,
    bytes: Vec<u8>,
}

impl MessageCounts {
    pub fn rate_hz(&self, stream: Stream) -> f64 {
        let messages = self.messages.get(&stream).copied().unwrap_or(0);
        let span = self.spans.get(&stream);
        rate_hz(messages, span.map_or(Nanos::ZERO, |(first, last)| last.duration_since(*first)))
    }
}

/// Messages per second within a span that begins with the first and ends with the last one.
pub fn rate_hz(messages: u64, span: Nanos) -> f64 {
    if span == Nanos::ZERO { 0.0 } else { (messages as f64 - 1.0) / span.as_seconds() }
}

#[derive(Debug)]
pub struct TrialRecorder {
    path: PathBuf,
    queue: Option<SyncSender<QueuedMessage>>,
    thread: Option<JoinHandle<Result<McapFile, McapError>>>,
    has_failed: Arc<AtomicBool>,
    standard: StandardMessages,
    counts: MessageCounts,
    /// Bytes of pictures in the queue.
    waiting: Arc<AtomicUsize>,
    /// Bytes of pictures that may still be written.
    budget: u64,
}

impl TrialRecorder {
    /// Creates the file, which must not exist, and writes its header.
    pub fn start(path: &Path, header: RecordingHeader) -> Result<Self, RecordError> {
        let create = |source| RecordError::Create { path: path.to_owned(), source };
        // Recordings are readable by their owner alone, like black boxes.
        let mut options = OpenOptions::new();
        let file = options.write(true).create_new(true).mode(0o600).open(path).map_err(create)?;
        let disk = file.try_clone().map_err(create)?;
        let file = write_header(file, &header)
            .map_err(|source| RecordError::Write { path: path.to_owned(), source })?;
        let (queue, messages) = sync_channel(QUEUE_LENGTH);
        let (has_failed, waiting) = (Arc::<AtomicBool>::default(), Arc::<AtomicUsize>::default());
        let (failure, written) = (Arc::clone(&has_failed), Arc::clone(&waiting));
        let unix_offset_ns = header.unix_offset_ns;
        let thread = thread::spawn(move || {
            let outcome = write_messages(file, &disk, unix_offset_ns, &messages, &written);
            failure.store(outcome.is_err(), Ordering::Release);
            outcome
        });
        Ok(Self {
            path: path.to_owned(),
            queue: Some(queue),
            thread: Some(thread),
            has_failed,
            standard: StandardMessages::new(unix_offset_ns, header.joints, header.frame),
            counts: MessageCounts::default(),
            waiting,
            budget: header.picture_budget,
        })
    }

    /// Whether writing has failed: [`TrialRecorder::finish`] returns the reason.
    pub fn has_failed(&self) -> bool {
        self.has_failed.load(Ordering::Acquire)
    }

    pub fn counts(&self) -> &MessageCounts {
        &self.counts
    }

    /// Records a message, also as the standard message. Does not wait.
    pub fn record(&mut self, message: &StreamMessage, received: Nanos) {
        let (stream, stamp) = (message.stream(), message.stamp());
        *self.counts.messages.entry(stream).or_default() += 1;
        self.counts.spans.entry(stream).or_insert((stamp, stamp)).1 = stamp;
        self.push(Topic::Payload(stream), message, received, cdr::encode(message.bytes()));
        if let Some(bytes) = self.standard.message(message) {
            self.push(Topic::Standard(stream), message, received, bytes);
        }
        if let StreamMessage::Measured(measured) = message {
            for (topic, bytes) in self.standard.poses(measured) {
                self.push(topic, message, received, bytes);
            }
        }
    }

    /// Records a picture, taken at `stamp`. Does not wait: without room it is dropped and counted.
    pub fn record_picture(&mut self, view: &str, stamp: Nanos, jpeg: &[u8], received: Nanos) {
        let counts = self.counts.pictures.entry(view.to_owned()).or_default();
        let size = jpeg.len();
        if self.budget < size as u64 {
            counts.over_budget += 1;
            return;
        }
        let is_full = self.waiting.load(Ordering::Relaxed) + size > PICTURE_QUEUE;
        let unix_ns = stamp.0.wrapping_add(self.standard.unix_offset_ns);
        let bytes = Picture { unix_ns, jpeg: jpeg.to_vec() }.encode(view);
        let (number, length) = (counts.recorded + 1, bytes.len());
        let channel = Channel::View(view.to_owned());
        let message = QueuedMessage { channel, sequence: number as u32, stamp, received, bytes };
        // Added before sending: the thread subtracts it after writing.
        self.waiting.fetch_add(length, Ordering::Relaxed);
        let is_queued = !is_full && self.send(message);
        if !is_queued {
            self.waiting.fetch_sub(length, Ordering::Relaxed);
        }
        let counts = self.counts.pictures.entry(view.to_owned()).or_default();
        if is_queued {
            counts.recorded = number;
            self.budget -= size as u64;
        } else {
            counts.dropped += 1;
        }
    }

    fn push(&mut self, topic: Topic, message: &StreamMessage, received: Nanos, bytes: Vec<u8>) {
        let message = QueuedMessage {
            channel: Channel::Topic(topic),
            sequence: message.sequence() as u32,
            stamp: message.stamp(),
            received,
            bytes,
        };
        self.counts.dropped += u64::from(!self.send(message));
    }

    fn send(&self, message: QueuedMessage) -> bool {
        self.queue.as_ref().is_some_and(|queue| queue.try_send(message).is_ok())
    }

    /// Writes the messages in the queue, `outcome`, attachments, and the end of the file.
    pub fn finish(
        mut self,
        outcome: BTreeMap<String, String>,
        attachments: &[AttachedFile],
    ) -> Result<MessageCounts, RecordError> {
        self.queue = None;
        let path = self.path.clone();
        let joined = self.thread.take().and_then(|thread| thread.join().ok());
        let written = joined.ok_or_else(|| RecordError::Thread { path: path.clone() })?;
        let finish = |mut file: McapFile| {
            attach(&mut file, attachments, self.standard.unix_offset_ns)?;
            file.write_metadata(&Metadata { name: OUTCOME.to_owned(), metadata: outcome })?;
            file.finish()?;
            // Before it is reported as complete. A failure does not count, as in `write_messages`.
            let _ = file.into_inner().get_ref().sync_all();
            Ok(())
        };
        written.and_then(finish).map_err(|source| RecordError::Write { path, source })?;
        Ok(self.counts)
    }
}

fn write_header(file: File, header: &RecordingHeader) -> Result<McapFile, McapError> {
    let options = WriteOptions::new()
        .profile("ros2")
        .library(concat!("i2ris ", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Lz4))
        // The file contains only complete chunks.
        .disable_seeking(true);
    let mut file = Writer::with_options(BufWriter::new(file), options)?;
    let mut about = header.about.clone();
    about.insert("unix_minus_monotonic_ns".to_owned(), header.unix_offset_ns.to_string());
    if !header.joints.is_empty() {
        about.insert(JOINTS.to_owned(), header.joints.join(" "));
    }
    file.write_metadata(&Metadata { name: HEADER.to_owned(), metadata: about })?;
    attach(&mut file, &header.attachments, header.unix_offset_ns)?;
    for topic in Topic::all() {
        topic.declare(&mut file)?;
    }
    if !header.urdf.is_empty() {
        describe(&mut file, header)?;
    }
    file.flush()?;
    Ok(file)
}

/// Writes the URDF where ROS tools look for it, and attaches it.
fn describe(file: &mut McapFile, header: &RecordingHeader) -> Result<(), McapError> {
    let now = header.unix_offset_ns.wrapping_add(i2ris::clock::now().0);
    let message = MessageHeader {
        channel_id: Topic::Description.declare(file)?,
        sequence: 0,
        log_time: now,
        publish_time: now,
    };
    let description = cdr::encode_standard(&Text { data: header.urdf.clone() });
    file.write_to_known_channel(&message, &description)?;
    let attachment = AttachedFile {
        name: "robot.urdf".to_owned(),
        media_type: "application/xml",
        content: header.urdf.clone().into_bytes(),
    };
    attach(file, &[attachment], header.unix_offset_ns)
}

fn attach(
    file: &mut McapFile,
    attachments: &[AttachedFile],
    unix_offset_ns: u64,
) -> Result<(), McapError> {
    let now = unix_offset_ns.wrapping_add(i2ris::clock::now().0);
    for attachment in attachments {
        file.attach(&Attachment {
            log_time: now,
            create_time: now,
            name: attachment.name.clone(),
            media_type: attachment.media_type.to_owned(),
            data: attachment.content.as_slice().into(),
        })?;
    }
    Ok(())
}

fn write_messages(
    mut file: McapFile,
    disk: &File,
    unix_offset_ns: u64,
    messages: &Receiver<QueuedMessage>,
    waiting: &AtomicUsize,
) -> Result<McapFile, McapError> {
    let mut channels: BTreeMap<Channel, u16> = BTreeMap::new();
    let unix = |Nanos(monotonic)| monotonic.wrapping_add(unix_offset_ns);
    let (mut flushed, mut synced) = (Instant::now(), Instant::now());
    loop {
        match messages.recv_timeout(FLUSH_PERIOD.saturating_sub(flushed.elapsed())) {
            Ok(message) => {
                let channel_id = match channels.get(&message.channel) {
                    Some(channel_id) => *channel_id,
                    None => {
                        let channel_id = message.channel.declare(&mut file)?;
                        channels.insert(message.channel.clone(), channel_id);
                        channel_id
                    }
                };
                let header = MessageHeader {
                    channel_id,
                    sequence: message.sequence,
                    log_time: unix(message.received),
                    publish_time: unix(message.stamp),
                };
                file.write_to_known_channel(&header, &message.bytes)?;
                if matches!(message.channel, Channel::View(_)) {
                    waiting.fetch_sub(message.bytes.len(), Ordering::Relaxed);
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(file),
        }
        if flushed.elapsed() >= FLUSH_PERIOD {
            file.flush()?;
            flushed = Instant::now();
        }
        if synced.elapsed() >= SYNC_PERIOD {
            synced = Instant::now();
            // Pipes and some network disks cannot be synchronized: that is not an error.
            let _ = disk.sync_data();
        }
    }
}
