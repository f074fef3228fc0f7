//! The thread that keeps the models: reads, checks and compares them, hands them to the loop, and
//! frees what comes back.
//!
//! Everything that takes time or memory about a model happens here, under normal scheduling. The
//! loop is given a pointer and gives one back.

use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

use crate::clock;
use crate::config::Config;
use crate::core::{ModelCandidate, ModelChange, ModelSwapRequest};
use crate::file_permissions;
use crate::ipc::payload::{self, ModelDifference, ModelSlot, padded_text};
use crate::model::{Model, ModelError, ModelId};
use crate::process::black_box::{OfferRecord, Wish};
use crate::process::channels::{KeeperEnds, Offer};
use crate::process::loop_history::{Chronicle, Known, SharedChronicle};
use crate::process::model_comparison::{Remembering, difference};
use crate::robot::{ModelAction, Refusal};
use crate::units::Nanos;

/// How long the loop may take to answer: a tick, unless the machine stalls.
const ANSWER: Nanos = Nanos::from_millis(2000);
/// How often its answer is looked for.
const POLL: Nanos = Nanos::from_micros(500);
/// How often models that came back are freed while nothing is asked.
const IDLE: Duration = Duration::from_millis(100);

/// A request, with the token that the answer needs.
pub type Question = (u64, payload::ModelRequest);
/// An answer, with its token.
pub type Answer = (u64, payload::ModelReply);

/// Why a request is refused.
struct Refused {
    refusal: Refusal,
    message: String,
}

impl From<Refusal> for Refused {
    fn from(refusal: Refusal) -> Self {
        Self {
            refusal,
            message: String::new(),
        }
    }
}

/// Keeps the models.
pub struct Keeper {
    config: Config,
    chronicle: SharedChronicle,
    ends: KeeperEnds,
    /// To the black box, which has to know of every model before the loop does.
    wishes: Sender<Wish>,
    requests: u64,
    offers: u64,
}

impl Keeper {
    /// A keeper that knows what the loop began with.
    #[must_use]
    pub fn new(
        config: Config,
        chronicle: SharedChronicle,
        ends: KeeperEnds,
        wishes: Sender<Wish>,
    ) -> Self {
        Self {
            config,
            chronicle,
            ends,
            wishes,
            requests: 0,
            offers: 0,
        }
    }

    /// Answers until `quit`, or until nobody can ask any more.
    pub fn run(
        mut self,
        quit: &AtomicBool,
        questions: &Receiver<Question>,
        answers: &Sender<Answer>,
    ) {
        while !quit.load(Ordering::Acquire) {
            match questions.recv_timeout(IDLE) {
                Ok((token, request)) => {
                    let reply = self.answer(&request);
                    // Whoever asked may be gone.
                    let _ = answers.send((token, reply));
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            self.free();
        }
    }

    fn answer(&mut self, request: &payload::ModelRequest) -> payload::ModelReply {
        let outcome = self.obey(request);
        let mut reply = payload::ModelReply {
            slots: shown(&self.chronicle.lock()),
            ..payload::ModelReply::default()
        };
        match outcome {
            Ok(difference) => reply.difference = difference.unwrap_or_default(),
            Err(refused) => {
                reply.refusal = refused.refusal.number();
                reply.message = padded_text(&refused.message);
            }
        }
        reply
    }

    fn obey(
        &mut self,
        request: &payload::ModelRequest,
    ) -> Result<Option<ModelDifference>, Refused> {
        if request.client_id == 0 {
            return Err(Refusal::Malformed.into());
        }
        let forced = request.flags & payload::ModelRequest::FORCE != 0;
        match ModelAction::from_number(request.action).ok_or(Refusal::Malformed)? {
            ModelAction::List => Ok(None),
            ModelAction::Stage => self.stage(&path(&request.path)?),
            ModelAction::Activate => self
                .change(ModelChange::Activate(ModelId(request.model_id)), forced)
                .map(|()| None),
            ModelAction::Rollback => self.change(ModelChange::Rollback, forced).map(|()| None),
        }
    }

    fn stage(&mut self, file: &Path) -> Result<Option<ModelDifference>, Refused> {
        let bad = |message: String| Refused {
            refusal: Refusal::BadModel,
            message,
        };
        file_permissions::check(file).map_err(|error| bad(format!("model file {error}")))?;
        let model = self.load(file).map_err(|error| bad(error.to_string()))?;
        let (history, active, position) = {
            let chronicle = self.chronicle.lock();
            let active = chronicle
                .model(chronicle.slots.active)
                .map(|known| Arc::clone(&known.model));
            (chronicle.history.clone(), active, chronicle.position)
        };
        let difference = active.and_then(|active| {
            let (old, new) = (active.recall(&history), model.recall(&history));
            let old = Remembering {
                model: &active,
                memory: &old,
            };
            let new = Remembering {
                model: &model,
                memory: &new,
            };
            difference(old, new, &position, self.config.compensation.factor)
        });
        self.offer(model, file.to_owned())?;
        Ok(difference)
    }

    fn load(&self, file: &Path) -> Result<Arc<Model>, ModelError> {
        let model = Model::load(file)?;
        model.check_robot(&self.config.robot_id, self.config.motors())?;
        Ok(Arc::new(model))
    }

    /// Hands a model to the loop and waits until it is led along.
    fn offer(&mut self, model: Arc<Model>, file: PathBuf) -> Result<(), Refused> {
        let id = model.id();
        let (history, mark) = {
            let mut chronicle = self.chronicle.lock();
            chronicle.known.insert(
                id,
                Known {
                    model: Arc::clone(&model),
                    file,
                },
            );
            (chronicle.history.clone(), chronicle.mark)
        };
        let candidate = ModelCandidate::new(Arc::clone(&model), &self.config, &history, mark);
        self.offers += 1;
        let number = self.offers;
        let record = Box::new(OfferRecord {
            number,
            model: id,
            carried: candidate.state(),
        });
        // Without a recorder there is no black box, and the robot goes on.
        let _ = self.wishes.send(Wish::Offer(record, model));
        self.ends
            .offers
            .push(Offer { number, candidate })
            .map_err(|_| Refusal::Busy)?;
        self.wait(|keeper| {
            keeper.free();
            (keeper.chronicle.lock().slots.staged == Some(id)).then_some(())
        })
    }

    fn change(&mut self, change: ModelChange, forced: bool) -> Result<(), Refused> {
        self.requests += 1;
        let id = self.requests;
        let to = match change {
            ModelChange::Activate(to) => Some(to),
            ModelChange::Rollback => self.chronicle.lock().slots.previous,
        };
        self.ends
            .requests
            .push(ModelSwapRequest { id, change, forced })
            .map_err(|_| Refusal::Busy)?;
        let refusal = self.wait(|keeper| {
            let reply = keeper.ends.replies.pop().ok()?;
            (reply.id == id).then_some(reply.refusal)
        })?;
        if refusal != Refusal::None {
            return Err(refusal.into());
        }
        // Until it shows in what everybody sees.
        self.wait(|keeper| (keeper.chronicle.lock().slots.active == to).then_some(()))
    }

    fn wait<T>(&mut self, mut look: impl FnMut(&mut Self) -> Option<T>) -> Result<T, Refused> {
        let start = clock::now();
        loop {
            if let Some(found) = look(self) {
                return Ok(found);
            }
            if clock::now().since(start) > ANSWER {
                return Err(Refused {
                    refusal: Refusal::Busy,
                    message: "the control loop does not answer".to_owned(),
                });
            }
            clock::sleep(POLL);
        }
    }

    /// Frees what came back, and forgets models that are no longer at hand.
    fn free(&mut self) {
        let mut any = false;
        while let Ok(candidate) = self.ends.retired.pop() {
            drop(candidate);
            any = true;
        }
        if any {
            let mut chronicle = self.chronicle.lock();
            let slots = chronicle.slots;
            let at_hand = [slots.active, slots.staged, slots.previous];
            chronicle.known.retain(|id, known| {
                at_hand.contains(&Some(*id)) || Arc::strong_count(&known.model) > 1
            });
        }
    }
}

/// The path in a request.
fn path(field: &[u8]) -> Result<PathBuf, Refusal> {
    let bytes = field.split(|byte| *byte == 0).next().unwrap_or_default();
    let path = PathBuf::from(std::ffi::OsStr::from_bytes(bytes));
    if path.is_absolute() && bytes.len() < field.len() {
        Ok(path)
    } else {
        Err(Refusal::Malformed)
    }
}

/// The models at hand as clients see them.
fn shown(chronicle: &Chronicle) -> [ModelSlot; 3] {
    let slots = chronicle.slots;
    let known = [true, slots.staged_known, true];
    let mut shown = [ModelSlot::default(); 3];
    for ((slot, id), known) in shown
        .iter_mut()
        .zip([slots.active, slots.staged, slots.previous])
        .zip(known)
    {
        if let (Some(id), Some(model)) = (id, chronicle.model(id)) {
            *slot = describe(id, model, known);
        }
    }
    shown
}

fn describe(id: ModelId, known: &Known, memory_known: bool) -> ModelSlot {
    let file = known.model.file();
    let kind = serde_json::to_value(&file.family).unwrap_or_default();
    let family = kind
        .get("kind")
        .and_then(|kind| kind.as_str())
        .unwrap_or_default();
    let mut slot = ModelSlot {
        model_id: id.0,
        family: padded_text(family),
        file: padded_text(&tail(&known.file.to_string_lossy(), 120)),
        outputs: file.outputs.len() as u32,
        flags: ModelSlot::PRESENT
            | if memory_known {
                ModelSlot::MEMORY_KNOWN
            } else {
                0
            },
        ..ModelSlot::default()
    };
    for ((training, held_out), metrics) in slot
        .training_rms
        .iter_mut()
        .zip(&mut slot.held_out_rms)
        .zip(&file.metrics)
    {
        *training = metrics.training.rmsd;
        *held_out = metrics
            .held_out
            .as_ref()
            .map_or(0.0, |metrics| metrics.rmsd);
    }
    slot
}

/// The last characters of a text, at most so many bytes.
fn tail(text: &str, bytes: usize) -> String {
    let start =
        (text.len().saturating_sub(bytes)..=text.len()).find(|start| text.is_char_boundary(*start));
    text.get(start.unwrap_or(0)..)
        .unwrap_or_default()
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_absolute_and_ends_within_its_field() {
        assert_eq!(
            path(&padded_text::<16>("/a/b.json")).unwrap(),
            Path::new("/a/b.json")
        );
        assert_eq!(
            path(&padded_text::<16>("a/b.json")).unwrap_err(),
            Refusal::Malformed
        );
        assert_eq!(path(&[b'/'; 16]).unwrap_err(), Refusal::Malformed);
        assert_eq!(path(&[]).unwrap_err(), Refusal::Malformed);
    }

    #[test]
    fn a_long_name_shows_its_end() {
        assert_eq!(tail("/models/snake.json", 10), "snake.json");
        assert_eq!(tail("snake.json", 100), "snake.json");
        assert_eq!(tail("äb", 2), "b");
    }
}
