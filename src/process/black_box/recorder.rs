//! The recorder of the black box: takes every tick from the loop, and writes the file and the
//! serial capture.

use std::collections::{BTreeMap, VecDeque};
use std::fs::{self, DirBuilder};
use std::io::Write;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};

use rtrb::{Consumer, Producer, RingBuffer};

use super::file::{BlackBox, BlackBoxError, BlackBoxHeader, OfferRecord, TickRecord, create_whole};
use super::live::{LiveFiles, Ring};
use crate::config::Config;
use crate::core::{CycleEventKind, CycleSnapshot};
use crate::drive::capture::{Capture, file};
use crate::ipc::Domain;
use crate::model::{Model, ModelId};
use crate::process::run_log::write_line;
use crate::robot::{DriveFingerprint, OperatingState};
use crate::units::Nanos;
use crate::{clock, wall_clock};

/// Ticks that the recorder may lag: four seconds at 1 kHz.
const TICKS: usize = 4096;
/// Snapshots in flight; the loop makes one per second.
const SNAPSHOTS: usize = 4;
/// Span of a black box: 10 MB.
const SPAN: Nanos = Nanos::from_millis(12_000);

/// Maximum number of black boxes in the folder; the oldest are removed.
const FILES: usize = 100;

/// Extension of the captures that accompany the black boxes.
const CAPTURE: &str = "pcapng";

const PERIOD: Nanos = Nanos::from_millis(20);
/// Time after a fault that its file includes.
const AFTER_FAULT: Nanos = Nanos::from_millis(500);
/// Minimum time between the files of two faults: a repeated fault must not fill the disk.
const BETWEEN_FAULTS: Nanos = Nanos::from_millis(5000);
/// Number of offers from which old ones are dropped.
const OFFERS: usize = 64;

#[derive(Debug)]
pub enum RecorderRequest {
    Offer(Box<OfferRecord>, Arc<Model>),
    /// Write the file now; the reply carries the token.
    Write(u64),
}

/// Token of [`RecorderRequest::Write`]; the file and its number of ticks, or the error.
pub type WriteReply = (u64, Result<(PathBuf, u64), String>);

/// Endpoints of the loop.
pub struct RecorderChannels {
    pub ticks: Producer<TickRecord>,
    /// The state of the cycle, once a second.
    pub snapshots: Producer<CycleSnapshot>,
}

pub struct Recorder {
    config: Config,
    software: String,
    boot_id: u64,
    ticks: Consumer<TickRecord>,
    snapshots: Consumer<CycleSnapshot>,
    /// A snapshot whose next tick has not arrived.
    waiting: Option<CycleSnapshot>,
    ring: Ring,
    live: LiveFiles,
    captures: Vec<Capture>,
    drives: Vec<DriveFingerprint>,
    models: BTreeMap<ModelId, Arc<Model>>,
    offers: VecDeque<OfferRecord>,
    newest: u64,
    lost: u64,
    /// Clients that wait for a file, which would be empty before the first tick.
    requested: Vec<u64>,
    /// Time of a fault whose file is not yet written.
    fault: Option<Nanos>,
    /// Time of the last file written for a fault.
    last_fault: Option<Nanos>,
}

/// A run, as its black boxes name it.
#[derive(Debug)]
pub(crate) struct RecordedRun {
    /// Configuration, with the exchanges of the serial lines.
    pub config: Config,
    pub software: String,
    pub boot_id: u64,
    pub model: Option<Arc<Model>>,
    pub captures: Vec<Capture>,
    pub drives: Vec<DriveFingerprint>,
}

impl Recorder {
    pub(crate) fn new(run: RecordedRun) -> (Self, RecorderChannels) {
        let RecordedRun { config, software, boot_id, model, captures, drives } = run;
        let (ticks_in, ticks) = RingBuffer::new(TICKS);
        let (snapshots_in, snapshots) = RingBuffer::new(SNAPSHOTS);
        // Without a valid name of a domain there is no folder.
        let domain = Domain::new(&config.domain).ok();
        let recorder = Self {
            config,
            software,
            boot_id,
            ticks,
            snapshots,
            waiting: None,
            ring: Ring::new(SPAN),
            live: LiveFiles::new(domain.as_ref().map(Domain::directory), SPAN),
            captures,
            drives,
            models: model.into_iter().map(|model| (model.id(), model)).collect(),
            offers: VecDeque::new(),
            newest: 0,
            lost: 0,
            requested: Vec::new(),
            fault: None,
            last_fault: None,
        };
        let channels = RecorderChannels { ticks: ticks_in, snapshots: snapshots_in };
        (recorder, channels)
    }

    /// Records until `quit`, then writes the last file. Results of writing are passed to `report`.
    pub fn run(
        mut self,
        quit: &AtomicBool,
        requests: &Receiver<RecorderRequest>,
        replies: &Sender<WriteReply>,
        mut report: impl FnMut(String),
    ) {
        loop {
            let last = quit.load(Ordering::Acquire);
            self.drain(requests, replies);
            let now = clock::now();
            if self.fault.is_some_and(|fault| last || now.duration_since(fault) >= AFTER_FAULT) {
                self.fault = None;
                self.last_fault = Some(now);
                self.write_and_report("fault", &mut report);
            }
            if last {
                return self.write_and_report("exit", &mut report);
            }
            clock::sleep(PERIOD);
        }
    }

    fn drain(&mut self, requests: &Receiver<RecorderRequest>, replies: &Sender<WriteReply>) {
        // The model manager announces a model before it sends it to the loop, so the offer is read
        // before its tick.
        for request in requests.try_iter() {
            match request {
                RecorderRequest::Offer(offer, model) => {
                    if let Ok(text) = model.file().canonical_form() {
                        self.live.push_offer(&offer, text);
                    }
                    self.models.insert(offer.model, model);
                    self.offers.push_back(*offer);
                }
                RecorderRequest::Write(token) => self.requested.push(token),
            }
        }
        while let Ok(tick) = self.ticks.pop() {
            self.add(tick);
        }
        self.live.flush();
        self.drop_unused_models();
        let ready = self.ring.ticks().next().map(|_| std::mem::take(&mut self.requested));
        for token in ready.into_iter().flatten() {
            let outcome = self.write("request").map_err(|error| error.to_string());
            // The IPC thread may have ended.
            let _ = replies.send((token, outcome));
        }
    }

    fn add(&mut self, tick: TickRecord) {
        self.lost += tick.number.saturating_sub(self.newest + 1);
        self.newest = tick.number;
        let to_fault =
            |kind| matches!(kind, CycleEventKind::State { to: OperatingState::Fault, .. });
        let faulted = tick.outputs.events.iter().flatten().any(|event| to_fault(event.kind));
        let now = clock::now();
        let quiet = self.last_fault.is_none_or(|last| now.duration_since(last) >= BETWEEN_FAULTS);
        if faulted && quiet && self.fault.is_none() {
            self.fault = Some(now);
        }
        // A snapshot comes before the tick after it.
        self.waiting = self.waiting.take().or_else(|| self.snapshots.pop().ok());
        let is_due = |snapshot: &mut CycleSnapshot| snapshot.ticks() < tick.number;
        while let Some(snapshot) = self.waiting.take_if(is_due) {
            let begin = self.live.is_due(now).then(|| self.origin("killed", |_| true));
            self.live.push_snapshot(&snapshot, now, begin);
            self.ring.push_snapshot(snapshot);
            self.waiting = self.snapshots.pop().ok();
        }
        self.live.push_tick(&tick);
        self.ring.push(tick);
    }

    fn drop_unused_models(&mut self) {
        if self.offers.len() <= OFFERS {
            return;
        }
        if let Some(oldest) = self.ring.ticks().find_map(|tick| tick.offered) {
            self.offers.retain(|offer| offer.number >= oldest);
        }
        let used: Vec<ModelId> = self.used_models().collect();
        self.models.retain(|id, _| used.contains(id));
    }

    fn used_models(&self) -> impl Iterator<Item = ModelId> {
        let in_snapshots = self.ring.snapshots().flat_map(CycleSnapshot::models);
        in_snapshots.chain(self.offers.iter().map(|offer| offer.model))
    }

    fn write_and_report(&self, cause: &str, report: &mut impl FnMut(String)) {
        if self.ring.ticks().next().is_none() {
            return;
        }
        report(match self.write(cause) {
            Ok((path, ticks)) => {
                format!("black box of {ticks} ticks written to {}", path.display())
            }
            Err(error) => format!("warning: {error}"),
        });
    }

    fn write(&self, cause: &str) -> Result<(PathBuf, u64), BlackBoxError> {
        let used: Vec<ModelId> = self.used_models().collect();
        let content = BlackBox {
            snapshots: self.ring.snapshots().copied().collect(),
            ticks: self.ring.ticks().copied().collect(),
            ..self.origin(cause, |id| used.contains(id))
        };
        let (path, ticks) = write_content(&self.config.record_folder, &content)?;
        write_captures(&self.captures, &path.with_extension(CAPTURE), &self.software)?;
        Ok((path, ticks))
    }

    /// A file with these models, without snapshots and ticks.
    fn origin(&self, cause: &str, is_used: impl Fn(&ModelId) -> bool) -> BlackBox {
        let models = self.models.iter().filter(|(id, _)| is_used(id));
        BlackBox {
            header: BlackBoxHeader {
                software: self.software.clone(),
                boot_id: self.boot_id,
                cause: cause.to_owned(),
                written: wall_clock::now().to_string(),
                lost: self.lost,
                drives: self.drives.clone(),
            },
            config: toml::to_string(&self.config).unwrap_or_default(),
            models: models.filter_map(|(_, model)| model.file().canonical_form().ok()).collect(),
            offers: self.offers.iter().cloned().collect(),
            ..BlackBox::default()
        }
    }
}

/// Writes the file of a controller that was killed in this domain.
pub(crate) fn recover(config: &Config, domain: &Domain, log: &mut dyn Write) {
    let live = LiveFiles::new(Some(domain.directory()), SPAN);
    let Some(content) = live.take_leftovers() else { return };
    match write_content(&config.record_folder, &content) {
        Ok((path, ticks)) => write_line(
            log,
            format_args!(
                "the previous controller was killed: black box of its last {ticks} ticks written \
                 to {}",
                path.display()
            ),
        ),
        Err(error) => write_line(log, format_args!("warning: {error}")),
    }
}

fn write_content(folder: &Path, content: &BlackBox) -> Result<(PathBuf, u64), BlackBoxError> {
    create_folder(folder)?;
    let stem = format!("{}-{}", wall_clock::now().compact(), content.header.cause);
    let path = write_new(content, folder, &stem)?;
    remove_oldest(folder, FILES, &path);
    Ok((path, content.ticks.len() as u64))
}

/// Writes the serial traffic of a failed start. Only one such file exists, so that a service that
/// restarts repeatedly does not fill the disk.
pub(crate) fn write_failed_start(
    folder: &Path,
    captures: &[Capture],
    software: &str,
) -> Result<PathBuf, BlackBoxError> {
    let path = folder.join("failed-start").with_extension(CAPTURE);
    create_folder(folder)?;
    let _ = fs::remove_file(&path);
    write_captures(captures, &path, software).map(|()| path)
}

fn write_captures(captures: &[Capture], path: &Path, software: &str) -> Result<(), BlackBoxError> {
    let ports: Vec<_> = captures.iter().map(Capture::read).collect();
    let wall_offset = wall_clock::unix_time().duration_since(clock::now());
    let bytes = file::to_bytes(&ports, software, wall_offset);
    create_whole(path, |mut file| file.write_all(&bytes).and_then(|()| file.sync_all()))
        .map_err(BlackBoxError::io("write", path))
}

/// Writes a black box under an unused name.
fn write_new(content: &BlackBox, folder: &Path, stem: &str) -> Result<PathBuf, BlackBoxError> {
    let mut path = folder.join(format!("{stem}.box"));
    for number in 2..1000 {
        match content.write(&path) {
            Err(BlackBoxError::Io { source, .. })
                if source.kind() == std::io::ErrorKind::AlreadyExists =>
            {
                path = folder.join(format!("{stem}-{number}.box"));
            }
            outcome => return outcome.map(|()| path),
        }
    }
    content.write(&path).map(|()| path)
}

fn create_folder(folder: &Path) -> Result<(), BlackBoxError> {
    if fs::metadata(folder).is_ok_and(|metadata| metadata.is_dir()) {
        return Ok(());
    }
    let created = DirBuilder::new().recursive(true).mode(0o700).create(folder);
    created.map_err(BlackBoxError::io("write", folder))
}

/// The wall-clock time at which the name of a black box begins; `None` if a person named it.
fn written(path: &Path) -> Option<String> {
    let time = path.file_name()?.to_str()?.strip_suffix(".box")?.get(..15)?;
    time.bytes().all(|byte| byte.is_ascii_digit() || byte == b'-').then(|| time.to_owned())
}

/// Removes the oldest black boxes of a folder beyond a number, but never the newest one. If the
/// clock was set back, files with a later time than the newest one are the oldest.
fn remove_oldest(folder: &Path, keep: usize, newest: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let paths = entries.flatten().map(|entry| entry.path());
    let mut boxes: Vec<PathBuf> = paths.filter(|path| written(path).is_some()).collect();
    let last = written(newest);
    boxes.sort_by_cached_key(|path| {
        let time = written(path);
        (time <= last, time, path == newest)
    });
    let excess = boxes.len().saturating_sub(keep);
    for path in boxes.iter().take(excess) {
        // If this fails, the next call removes it.
        let _ = fs::remove_file(path);
        let _ = fs::remove_file(path.with_extension(CAPTURE));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_oldest_black_boxes_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        // The last two are of one second.
        let names =
            ["20260101-000000-exit.box", "20260103-000000-killed.box", "20260103-000000-fault.box"];
        let others = ["runs.jsonl", "0-notes.txt", "wire-broke.box"];
        for name in names.iter().chain(&others) {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let left = |name: &str| folder.path().join(name).exists();
        for (keep, kept) in [(3, [true; 3]), (2, [false, true, true]), (1, [false, false, true])] {
            remove_oldest(folder.path(), keep, &folder.path().join(names[2]));
            assert_eq!(names.map(left), kept);
            assert!(others.into_iter().all(left));
        }
    }

    #[test]
    fn newest_black_box_survives_a_clock_set_back() {
        let folder = tempfile::tempdir().unwrap();
        let names = ["20250101-000000-fault.box", "20260101-000000-a.box", "20260102-000000-b.box"];
        names.iter().for_each(|name| fs::write(folder.path().join(name), "").unwrap());
        remove_oldest(folder.path(), 1, &folder.path().join(names[0]));
        assert_eq!(names.map(|name| folder.path().join(name).exists()), [true, false, false]);
    }

    #[test]
    fn writing_fails_if_every_name_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        let taken = |name: String| fs::write(folder.path().join(name), "").unwrap();
        taken("a.box".to_owned());
        (2..1000).for_each(|number| taken(format!("a-{number}.box")));
        let content = BlackBox::default();
        assert!(write_new(&content, folder.path(), "a").is_err());
        assert!(write_new(&content, folder.path(), "b").is_ok());
    }
}
