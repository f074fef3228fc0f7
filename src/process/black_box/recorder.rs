//! The thread that keeps the black box: takes every tick from the loop, and writes the file.

use std::collections::{BTreeMap, VecDeque};
use std::fs::{self, DirBuilder};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};

use rtrb::{Consumer, Producer, RingBuffer};

use super::file::{BlackBoxError, Content, Header, OfferRecord};
use super::ring::Ring;
use super::{CycleSnapshot, TickRecord};
use crate::clock;
use crate::config::Config;
use crate::model::{Model, ModelId};
use crate::robot::OperatingState;
use crate::units::Nanos;
use crate::wall_clock;

/// Ticks that the recorder may fall behind: four seconds at 1 kHz.
const TICKS: usize = 4096;
/// Snapshots on their way; the loop makes one a second.
const SNAPSHOTS: usize = 4;
/// How often the recorder looks.
const PERIOD: Nanos = Nanos::from_millis(20);
/// What happens in the half second after a fault belongs to it.
const AFTERMATH: Nanos = Nanos::from_millis(500);
/// A fault that comes back again and again does not fill the disk.
const BETWEEN_FAULTS: Nanos = Nanos::from_millis(5000);
/// Offers that are kept before those of forgotten ticks are dropped.
const OFFERS: usize = 64;

/// What reaches the recorder.
#[derive(Debug)]
pub enum Wish {
    /// A model is on its way to the loop.
    Offer(Box<OfferRecord>, Arc<Model>),
    /// Write the file now; the token goes back with the answer.
    Write(u64),
}

/// The answer to [`Wish::Write`].
#[derive(Debug)]
pub struct Written {
    /// The token of the wish.
    pub token: u64,
    /// The file and how many ticks are in it, or why there is none.
    pub outcome: Result<(PathBuf, u64), String>,
}

/// The ends that the loop holds.
pub struct RecorderEnds {
    /// Every tick.
    pub ticks: Producer<TickRecord>,
    /// The state of the cycle, once a second.
    pub snapshots: Producer<CycleSnapshot>,
}

/// Fills the ring and writes the file.
pub struct Recorder {
    config: Config,
    software: String,
    boot_id: u64,
    ticks: Consumer<TickRecord>,
    snapshots: Consumer<CycleSnapshot>,
    waiting: Option<CycleSnapshot>,
    ring: Ring,
    models: BTreeMap<ModelId, Arc<Model>>,
    offers: VecDeque<OfferRecord>,
    newest: u64,
    lost: u64,
    fault: Option<Nanos>,
    last_fault: Option<Nanos>,
}

impl Recorder {
    /// A recorder, and the ends for the loop. `model` is what the loop begins with.
    #[must_use]
    pub fn new(
        config: &Config,
        model: Option<&Arc<Model>>,
        software: &str,
        boot_id: u64,
    ) -> (Self, RecorderEnds) {
        let (ticks_in, ticks) = RingBuffer::new(TICKS);
        let (snapshots_in, snapshots) = RingBuffer::new(SNAPSHOTS);
        let recorder = Self {
            config: config.clone(),
            software: software.to_owned(),
            boot_id,
            ticks,
            snapshots,
            waiting: None,
            ring: Ring::new(Nanos::from_millis(config.record.seconds * 1000)),
            models: model
                .map(|model| (model.id(), Arc::clone(model)))
                .into_iter()
                .collect(),
            offers: VecDeque::new(),
            newest: 0,
            lost: 0,
            fault: None,
            last_fault: None,
        };
        (
            recorder,
            RecorderEnds {
                ticks: ticks_in,
                snapshots: snapshots_in,
            },
        )
    }

    /// Records until `quit`, then writes what there is. What went wrong while writing goes to
    /// `tell`.
    pub fn run(
        mut self,
        quit: &AtomicBool,
        wishes: &Receiver<Wish>,
        answers: &Sender<Written>,
        mut tell: impl FnMut(String),
    ) {
        loop {
            let last = quit.load(Ordering::Acquire);
            self.drain(wishes, answers);
            let now = clock::now();
            if self
                .fault
                .is_some_and(|fault| last || now.since(fault) >= AFTERMATH)
            {
                self.fault = None;
                self.last_fault = Some(now);
                self.write_and_tell("fault", &mut tell);
            }
            if last {
                return self.write_and_tell("exit", &mut tell);
            }
            clock::sleep(PERIOD);
        }
    }

    fn drain(&mut self, wishes: &Receiver<Wish>, answers: &Sender<Written>) {
        // A model is announced before the loop gets it, so its offer is known before its tick is.
        let mut writes = Vec::new();
        for wish in wishes.try_iter() {
            match wish {
                Wish::Offer(offer, model) => {
                    self.models.insert(offer.model, model);
                    self.offers.push_back(*offer);
                }
                Wish::Write(token) => writes.push(token),
            }
        }
        while let Ok(tick) = self.ticks.pop() {
            self.take(tick);
        }
        self.forget();
        for token in writes {
            // Whoever asked may be gone.
            let _ = answers.send(Written {
                token,
                outcome: self.write("request").map_err(|error| error.to_string()),
            });
        }
    }

    fn take(&mut self, tick: TickRecord) {
        self.lost += tick.number.saturating_sub(self.newest + 1);
        self.newest = tick.number;
        let to_fault = tick.outputs.events.iter().flatten().any(|event| {
            matches!(
                event.kind,
                crate::core::CycleEventKind::State {
                    to: OperatingState::Fault,
                    ..
                }
            )
        });
        let quiet = self
            .last_fault
            .is_none_or(|last| clock::now().since(last) >= BETWEEN_FAULTS);
        if to_fault && quiet && self.fault.is_none() {
            self.fault = Some(clock::now());
        }
        // A snapshot comes before the tick after it.
        self.waiting = self.waiting.take().or_else(|| self.snapshots.pop().ok());
        while let Some(snapshot) = self
            .waiting
            .take_if(|snapshot| snapshot.ticks() < tick.number)
        {
            self.ring.begin(snapshot);
            self.waiting = self.snapshots.pop().ok();
        }
        self.ring.push(tick);
    }

    /// Forgets models that no tick in the ring knows of.
    fn forget(&mut self) {
        if self.offers.len() <= OFFERS {
            return;
        }
        let oldest = self.ring.ticks().find_map(|tick| tick.offered);
        if let Some(oldest) = oldest {
            self.offers.retain(|offer| offer.number >= oldest);
        }
        let kept: Vec<ModelId> = self.named().collect();
        self.models.retain(|id, _| kept.contains(id));
    }

    /// The models that the ring and the offers name.
    fn named(&self) -> impl Iterator<Item = ModelId> {
        let in_snapshots = self.ring.snapshots().flat_map(CycleSnapshot::models);
        in_snapshots.chain(self.offers.iter().map(|offer| offer.model))
    }

    fn write_and_tell(&mut self, cause: &str, tell: &mut impl FnMut(String)) {
        if self.ring.ticks().next().is_none() {
            return;
        }
        tell(match self.write(cause) {
            Ok((path, ticks)) => {
                format!("black box of {ticks} ticks written to {}", path.display())
            }
            Err(error) => format!("warning: {error}"),
        });
    }

    fn write(&self, cause: &str) -> Result<(PathBuf, u64), BlackBoxError> {
        let folder = &self.config.record.folder;
        create_folder(folder)?;
        let written = wall_clock::now();
        let stem = format!("{}-{cause}", written.compact());
        let content = self.content(cause, &written.to_string());
        let ticks = content.ticks.len() as u64;
        let mut path = folder.join(format!("{stem}.box"));
        for number in 2..1000 {
            match content.write(&path) {
                Err(BlackBoxError::Io { source, .. })
                    if source.kind() == std::io::ErrorKind::AlreadyExists =>
                {
                    path = folder.join(format!("{stem}-{number}.box"));
                }
                Err(error) => return Err(error),
                Ok(()) => break,
            }
        }
        Ok((path, ticks))
    }

    fn content(&self, cause: &str, written: &str) -> Content {
        let named: Vec<ModelId> = self.named().collect();
        let models = self.models.iter().filter(|(id, _)| named.contains(id));
        Content {
            header: Header {
                software: self.software.clone(),
                boot_id: self.boot_id,
                cause: cause.to_owned(),
                written: written.to_owned(),
                lost: self.lost,
            },
            config: toml::to_string(&self.config).unwrap_or_default(),
            models: models
                .filter_map(|(_, model)| model.file().canonical_form().ok())
                .collect(),
            offers: self.offers.iter().cloned().collect(),
            snapshots: self.ring.snapshots().copied().collect(),
            ticks: self.ring.ticks().copied().collect(),
        }
    }
}

/// A folder for its owner alone, unless it is there already.
fn create_folder(folder: &Path) -> Result<(), BlackBoxError> {
    if fs::metadata(folder).is_ok_and(|metadata| metadata.is_dir()) {
        return Ok(());
    }
    let created = DirBuilder::new().recursive(true).mode(0o700).create(folder);
    created.map_err(|source| BlackBoxError::Io {
        action: "write",
        path: folder.to_owned(),
        source,
    })
}
