//! The last seconds, tick by tick: in memory, and in shared memory in case of SIGKILL.
//!
//! The black-box thread writes every tick into one of two files in the folder of the domain,
//! on a tmpfs: they survive the process, no call waits for a disk, and no disk wears out. Each file
//! begins with everything that a replay needs and covers the whole span; then the other file is
//! overwritten. So at least one span is always available. A clean shutdown removes both with the
//! domain. After SIGKILL, the next start of the controller converts them to a black box.
//!
//! A file is the format version, then records, each after its length (u32, little-endian).
//! An incomplete last record is ignored.

use std::collections::VecDeque;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::file::{BlackBox, BlackBoxHeader, OfferRecord, TickRecord, VERSION};
use crate::core::CycleSnapshot;
use crate::units::Nanos;

#[derive(Debug, Serialize, Deserialize)]
enum Record {
    /// The first record: number of the file since the start, and a black box without ticks.
    Begin(u64, Box<BlackBox>),
    /// A model that was passed to the cycle, in canonical form.
    Offer(Box<OfferRecord>, Vec<u8>),
    Snapshot(Box<CycleSnapshot>),
    Tick(Box<TickRecord>),
}

#[derive(Debug)]
pub(super) struct LiveFiles {
    /// Empty without a folder for them.
    paths: Vec<PathBuf>,
    span: Nanos,
    number: u64,
    /// `None` before the first snapshot, and after an error.
    file: Option<BufWriter<File>>,
    begun: Nanos,
}

impl LiveFiles {
    /// Files in this folder, if there is one; creates nothing yet.
    pub(super) fn new(folder: Option<&Path>, span: Nanos) -> Self {
        let names = |folder: &Path| ["ticks-0", "ticks-1"].map(|name| folder.join(name));
        let paths = folder.into_iter().flat_map(names).collect();
        Self { paths, span, number: 0, file: None, begun: Nanos::ZERO }
    }

    /// Whether the next snapshot begins a file: the current one covers the span.
    pub(super) fn is_due(&self, now: Nanos) -> bool {
        self.file.is_none() || now.duration_since(self.begun) >= self.span
    }

    /// Adds a snapshot, after the beginning of the other file if that is due.
    pub(super) fn push_snapshot(
        &mut self,
        snapshot: &CycleSnapshot,
        now: Nanos,
        begin: Option<BlackBox>,
    ) {
        if let Some(begin) = begin {
            self.begun = now;
            self.number += 1;
            let path = self.paths.get((self.number % 2) as usize);
            self.file = path.and_then(|path| create(path).ok()).map(BufWriter::new);
            self.write(&Record::Begin(self.number, Box::new(begin)));
        }
        self.write(&Record::Snapshot(Box::new(*snapshot)));
    }

    pub(super) fn push_tick(&mut self, tick: &TickRecord) {
        self.write(&Record::Tick(Box::new(*tick)));
    }

    pub(super) fn push_offer(&mut self, offer: &OfferRecord, model: Vec<u8>) {
        self.write(&Record::Offer(Box::new(offer.clone()), model));
    }

    /// Writes everything to the system, which keeps it when the process is killed.
    pub(super) fn flush(&mut self) {
        if self.file.as_mut().is_some_and(|file| file.flush().is_err()) {
            self.file = None;
        }
    }

    /// After an error, for example a full tmpfs, the next snapshot begins a new file.
    fn write(&mut self, record: &Record) {
        let Some(file) = &mut self.file else { return };
        let written = postcard::to_allocvec(record).is_ok_and(|bytes| {
            let length = (bytes.len() as u32).to_le_bytes();
            file.write_all(&length).is_ok() && file.write_all(&bytes).is_ok()
        });
        if !written {
            self.file = None;
        }
    }

    /// Takes the files of a killed controller, as a black box.
    pub(super) fn take_leftovers(&self) -> Option<BlackBox> {
        let mut found: Vec<(u64, BlackBox)> =
            self.paths.iter().filter_map(|path| read(path)).collect();
        for path in &self.paths {
            let _ = fs::remove_file(path);
        }
        found.sort_by_key(|(number, _)| *number);
        let joined = found.into_iter().map(|(_, part)| part).reduce(join)?;
        (!joined.ticks.is_empty()).then(|| BlackBox {
            header: BlackBoxHeader { cause: "killed".to_owned(), ..joined.header },
            ..joined
        })
    }
}

/// Joins two files. The later one begins with the models and offers still in use.
fn join(mut earlier: BlackBox, later: BlackBox) -> BlackBox {
    earlier.header = later.header;
    extend_with_new(&mut earlier.models, later.models);
    extend_with_new(&mut earlier.offers, later.offers);
    earlier.snapshots.extend(later.snapshots);
    earlier.ticks.extend(later.ticks);
    earlier
}

fn extend_with_new<T: PartialEq>(known: &mut Vec<T>, more: Vec<T>) {
    let more: Vec<T> = more.into_iter().filter(|it| !known.contains(it)).collect();
    known.extend(more);
}

fn create(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    let options = options.write(true).create(true).truncate(true).mode(0o600);
    let mut file = options.open(path)?;
    file.write_all(&VERSION.to_le_bytes())?;
    Ok(file)
}

/// Reads a file up to its last complete record; `None` if it is absent or of a different version.
fn read(path: &Path) -> Option<(u64, BlackBox)> {
    let bytes = fs::read(path).ok()?;
    let (version, mut rest) = bytes.split_first_chunk::<4>()?;
    if u32::from_le_bytes(*version) != VERSION {
        return None;
    }
    let Some(Record::Begin(number, mut found)) = next(&mut rest) else {
        return None;
    };
    while let Some(record) = next(&mut rest) {
        match record {
            Record::Begin(..) => return None,
            Record::Offer(offer, model) => {
                found.offers.push(*offer);
                found.models.push(model);
            }
            Record::Snapshot(snapshot) => found.snapshots.push(*snapshot),
            Record::Tick(tick) => found.ticks.push(*tick),
        }
    }
    Some((number, *found))
}

fn next(bytes: &mut &[u8]) -> Option<Record> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    let (record, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    *bytes = rest;
    postcard::from_bytes(record).ok()
}

/// The last seconds, tick by tick, starting at a snapshot. Grows to its full size once.
#[derive(Debug)]
pub(super) struct Ring {
    span: Nanos,
    ticks: VecDeque<TickRecord>,
    snapshots: VecDeque<CycleSnapshot>,
}

impl Ring {
    /// Keeps `span` plus up to one interval between two snapshots.
    pub(super) fn new(span: Nanos) -> Self {
        Self { span, ticks: VecDeque::new(), snapshots: VecDeque::new() }
    }

    pub(super) fn push(&mut self, tick: TickRecord) {
        self.ticks.push_back(tick);
    }

    /// Adds a snapshot, and drops everything before the last snapshot that is older than the span.
    pub(super) fn push_snapshot(&mut self, snapshot: CycleSnapshot) {
        self.snapshots.push_back(snapshot);
        let Some(newest) = self.ticks.back().map(|tick| tick.timing.tick.started) else {
            return;
        };
        while let Some(second) = self.snapshots.get(1).map(CycleSnapshot::ticks) {
            let begin = self.ticks.partition_point(|tick| tick.number <= second);
            let first = self.ticks.get(begin).map(|tick| tick.timing.tick.started);
            if first.is_none_or(|first| newest.duration_since(first) < self.span) {
                return;
            }
            self.ticks.drain(..begin);
            self.snapshots.pop_front();
        }
    }

    /// The ticks, oldest first. A gap in the numbers means lost ticks.
    pub(super) fn ticks(&self) -> impl Iterator<Item = &TickRecord> {
        self.ticks.iter()
    }

    pub(super) fn snapshots(&self) -> impl Iterator<Item = &CycleSnapshot> {
        self.snapshots.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::core::CycleInputs;
    use crate::core::cycle::ControlCycle;
    use crate::realtime::TickTiming;

    fn begin() -> BlackBox {
        BlackBox { models: vec![vec![1]], ..BlackBox::default() }
    }

    fn cycle() -> ControlCycle {
        let text = "robot_id = \"r\"\n[[ports]]\ndevice = \"/dev/null\"\n[[ports.axes]]\n\
                    motor = 0\nnode_id = 0\nserial_number = 1\nposition_min_counts = -9\n\
                    position_max_counts = 9\n";
        ControlCycle::new(&Config::parse(text, "r.toml".as_ref()).unwrap(), None)
    }

    /// Records ticks 1 to `last`, with a snapshot before every tenth, 1 s apart, in a span of 3 s.
    fn record(folder: &Path, last: u64) -> LiveFiles {
        let mut live = LiveFiles::new(Some(folder), Nanos::from_millis(3000));
        let mut cycle = cycle();
        for number in 1..=last {
            let now = Nanos::from_millis(1000 + number * 100);
            if number % 10 == 1 {
                let begin = live.is_due(now).then(begin);
                live.push_snapshot(&cycle.snapshot().unwrap(), now, begin);
            }
            let inputs = CycleInputs::default();
            let outputs = cycle.step(now, &inputs);
            live.push_tick(&TickRecord {
                number,
                offered: None,
                inputs,
                outputs,
                timing: TickTiming::default(),
            });
        }
        live.flush();
        live
    }

    #[test]
    fn last_span_is_recovered_once_in_order() {
        let folder = tempfile::tempdir().unwrap();
        for (last, first) in [(7, 1), (35, 1), (65, 31), (95, 61)] {
            let live = record(folder.path(), last);
            let found = live.take_leftovers().unwrap();
            let numbers: Vec<u64> = found.ticks.iter().map(|tick| tick.number).collect();
            assert_eq!(numbers, (first..=last).collect::<Vec<_>>(), "{last}");
            assert_eq!((found.header.cause.as_str(), found.models.len()), ("killed", 1));
            assert!(found.snapshots[0].ticks() < first);
            assert!(live.take_leftovers().is_none());
        }
    }

    #[test]
    fn incomplete_end_and_foreign_files_are_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let live = record(folder.path(), 25);
        let path = folder.path().join("ticks-1");
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() - 5]).unwrap();
        assert_eq!(live.take_leftovers().unwrap().ticks.len(), 24);
        for bytes in [&b""[..], b"abc", &[9, 0, 0, 0, 1], &[255; 100]] {
            fs::write(&path, bytes).unwrap();
            assert!(live.take_leftovers().is_none());
        }
    }
}
