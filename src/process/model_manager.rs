//! The model thread: reads, checks and compares models, passes them to the loop, and frees the
//! models that the loop returns.
//!
//! All slow work on models is done here, under normal scheduling. The loop receives a pointer and
//! returns one.

use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

use crate::clock;
use crate::config::Config;
use crate::core::{ModelCandidate, ModelChange, ModelSwapRequest};
use crate::ipc::payload::{self, ModelDifference, ModelSlot, padded_text};
use crate::model::{Model, ModelId};
use crate::process::black_box::{OfferRecord, RecorderRequest};
use crate::process::channels::{ModelChannels, ModelOffer, Tokened};
use crate::process::loop_history::{LoadedModel, LoopHistory, SharedLoopHistory};
use crate::process::model_comparison::{ModelState, difference};
use crate::process::payload_conversion::validity;
use crate::process::start_up::check_drives;
use crate::robot::{DriveFingerprint, ModelAction, Refusal};
use crate::units::Nanos;

/// Timeout for the reply of the loop: normally one tick, unless the machine stalls.
const REPLY_TIMEOUT: Nanos = Nanos::from_millis(2000);
const POLL_PERIOD: Nanos = Nanos::from_micros(500);
/// Period of freeing returned models while there are no requests.
const IDLE_PERIOD: Duration = Duration::from_millis(100);

/// Refusal of a request; the message may be empty.
struct Refused {
    refusal: Refusal,
    message: String,
}

impl From<Refusal> for Refused {
    fn from(refusal: Refusal) -> Self {
        Self { refusal, message: String::new() }
    }
}

pub(super) struct ModelManager {
    config: Config,
    drives: Vec<DriveFingerprint>,
    history: SharedLoopHistory,
    channels: ModelChannels,
    /// Channel to the black box, which must know every model before the loop does.
    recorder: Sender<RecorderRequest>,
    requests: u64,
    offers: u64,
}

impl ModelManager {
    pub(super) fn new(
        config: Config,
        drives: Vec<DriveFingerprint>,
        history: SharedLoopHistory,
        channels: ModelChannels,
        recorder: Sender<RecorderRequest>,
    ) -> Self {
        Self { config, drives, history, channels, recorder, requests: 0, offers: 0 }
    }

    /// Replies to requests until `quit`, or until the request queue is closed.
    pub(super) fn run(
        mut self,
        quit: &AtomicBool,
        requests: &Receiver<Tokened<payload::ModelRequest>>,
        replies: &Sender<Tokened<payload::ModelReply>>,
    ) {
        while !quit.load(Ordering::Acquire) {
            match requests.recv_timeout(IDLE_PERIOD) {
                Ok((token, request)) => {
                    let reply = self.reply(&request);
                    // The IPC thread may have ended.
                    let _ = replies.send((token, reply));
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            self.free_retired();
        }
    }

    fn reply(&mut self, request: &payload::ModelRequest) -> payload::ModelReply {
        let outcome = self.execute(request);
        let slots = model_slots(&self.history.lock());
        let mut reply = payload::ModelReply { slots, ..payload::ModelReply::default() };
        match outcome {
            Ok(difference) => reply.difference = difference.unwrap_or_default(),
            Err(refused) => {
                reply.refusal = refused.refusal.number();
                reply.message = padded_text(&refused.message);
            }
        }
        reply
    }

    fn execute(
        &mut self,
        request: &payload::ModelRequest,
    ) -> Result<Option<ModelDifference>, Refused> {
        let known = payload::ModelRequest::FORCE | payload::ModelRequest::OTHER_DRIVE;
        if request.client_id == 0 || request.flags & !known != 0 {
            return Err(Refusal::Malformed.into());
        }
        let forced = request.flags & payload::ModelRequest::FORCE != 0;
        let change = match ModelAction::from_number(request.action).ok_or(Refusal::Malformed)? {
            ModelAction::List => return Ok(None),
            ModelAction::Stage => {
                let other_drive = request.flags & payload::ModelRequest::OTHER_DRIVE != 0;
                return self.stage(&path(&request.path)?, other_drive);
            }
            ModelAction::Activate => ModelChange::Activate(ModelId(request.model_id)),
            ModelAction::Rollback => ModelChange::Rollback,
        };
        let validity = validity(request.stamp_ns, request.valid_ns);
        let (id, client_id) = (0, request.client_id);
        self.change(ModelSwapRequest { id, client_id, validity, change, forced }).map(|()| None)
    }

    fn stage(
        &mut self,
        file: &Path,
        other_drive: bool,
    ) -> Result<Option<ModelDifference>, Refused> {
        let bad = |message: String| Refused { refusal: Refusal::BadModel, message };
        let model = Model::load_trusted(file).map_err(|error| bad(error.to_string()))?;
        self.config
            .check_model(&model)
            .map_err(|error| bad(format!("model file {} {error}", file.display())))?;
        if !other_drive {
            check_drives(&model, &self.drives).map_err(|differences| {
                bad(format!("model file {} {differences}; or --other-drive", file.display()))
            })?;
        }
        let model = Arc::new(model);
        let (history, active, position) = {
            let shared = self.history.lock();
            let active = shared.model(shared.slots.active).map(|known| Arc::clone(&known.model));
            (shared.history.clone(), active, shared.position)
        };
        let difference = active.and_then(|active| {
            let (old, new) = (active.recall(&history), model.recall(&history));
            let old = ModelState { model: &active, memory: &old };
            let new = ModelState { model: &model, memory: &new };
            difference(old, new, &position, self.config.compensation.factor)
        });
        self.offer(model, file.to_owned())?;
        Ok(difference)
    }

    /// Passes a model to the loop and waits until it is staged.
    fn offer(&mut self, model: Arc<Model>, file: PathBuf) -> Result<(), Refused> {
        let id = model.id();
        let (history, mark) = {
            let mut shared = self.history.lock();
            shared.known.insert(id, LoadedModel { model: Arc::clone(&model), file });
            (shared.history.clone(), shared.mark)
        };
        let candidate = ModelCandidate::new(Arc::clone(&model), &self.config, &history, mark);
        self.offers += 1;
        let number = self.offers;
        let record = Box::new(OfferRecord { number, model: id, carried: candidate.state() });
        // If the recorder has ended, no black box is written, and the robot continues.
        let _ = self.recorder.send(RecorderRequest::Offer(record, model));
        self.channels.offers.push(ModelOffer { number, candidate }).map_err(|_| Refusal::Busy)?;
        self.wait_for(|manager| {
            manager.free_retired();
            (manager.history.lock().slots.staged == Some(id)).then_some(())
        })
    }

    fn change(&mut self, request: ModelSwapRequest) -> Result<(), Refused> {
        self.requests += 1;
        let request = ModelSwapRequest { id: self.requests, ..request };
        let to = match request.change {
            ModelChange::Activate(to) => Some(to),
            ModelChange::Rollback => self.history.lock().slots.previous,
        };
        self.channels.requests.push(request).map_err(|_| Refusal::Busy)?;
        let refusal = self.wait_for(|manager| {
            let reply = manager.channels.replies.pop().ok()?;
            (reply.id == request.id).then_some(reply.refusal)
        })?;
        if refusal != Refusal::None {
            return Err(refusal.into());
        }
        // Waits until clients can see the change.
        self.wait_for(|manager| (manager.history.lock().slots.active == to).then_some(()))
    }

    fn wait_for<T>(&mut self, mut poll: impl FnMut(&mut Self) -> Option<T>) -> Result<T, Refused> {
        let start = clock::now();
        loop {
            if let Some(found) = poll(self) {
                return Ok(found);
            }
            if clock::now().duration_since(start) > REPLY_TIMEOUT {
                let message = "no reply from the control loop".to_owned();
                return Err(Refused { refusal: Refusal::Busy, message });
            }
            clock::sleep(POLL_PERIOD);
        }
    }

    /// Frees returned models and forgets models that are no longer loaded.
    fn free_retired(&mut self) {
        if self.channels.retired.is_empty() {
            return;
        }
        while self.channels.retired.pop().is_ok() {}
        let mut history = self.history.lock();
        let slots = history.slots;
        let loaded = [slots.active, slots.staged, slots.previous];
        history
            .known
            .retain(|id, known| loaded.contains(&Some(*id)) || Arc::strong_count(&known.model) > 1);
    }
}

fn path(field: &[u8]) -> Result<PathBuf, Refusal> {
    let bytes = field.split(|byte| *byte == 0).next().unwrap_or_default();
    let path = PathBuf::from(std::ffi::OsStr::from_bytes(bytes));
    if !path.is_absolute() || bytes.len() == field.len() {
        return Err(Refusal::Malformed);
    }
    Ok(path)
}

fn model_slots(history: &LoopHistory) -> [ModelSlot; 3] {
    let slots = history.slots;
    let models = [(slots.active, true), (slots.staged, slots.staged_known), (slots.previous, true)];
    models.map(|(id, memory_known)| {
        let loaded = history.model(id);
        loaded.map(|loaded| model_slot(loaded, memory_known)).unwrap_or_default()
    })
}

fn model_slot(loaded: &LoadedModel, memory_known: bool) -> ModelSlot {
    let file = loaded.model.file();
    let known = if memory_known { ModelSlot::MEMORY_KNOWN } else { 0 };
    let mut slot = ModelSlot {
        model_id: loaded.model.id().0,
        family: padded_text(&file.family.title()),
        file: padded_text(tail(&loaded.file.to_string_lossy(), 120)),
        outputs: file.outputs.len() as u32,
        flags: ModelSlot::PRESENT | known,
        ..ModelSlot::default()
    };
    for (rms, metrics) in slot.training_rms.iter_mut().zip(&file.metrics) {
        *rms = metrics.training.rmsd;
    }
    for (rms, metrics) in slot.held_out_rms.iter_mut().zip(&file.metrics) {
        *rms = metrics.held_out.as_ref().map_or(0.0, |metrics| metrics.rmsd);
    }
    slot
}

/// Last characters of a text, at most `bytes` bytes.
fn tail(text: &str, bytes: usize) -> &str {
    let mut starts = text.len().saturating_sub(bytes)..=text.len();
    let start = starts.find(|start| text.is_char_boundary(*start));
    start.and_then(|start| text.get(start..)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn path_must_be_absolute_and_terminated() {
        let field = padded_text::<16>("/a/b.json");
        assert_eq!(path(&field).unwrap(), Path::new("/a/b.json"));
        for field in [&padded_text::<16>("a/b.json")[..], &[b'/'; 16], &[]] {
            assert_eq!(path(field).unwrap_err(), Refusal::Malformed);
        }
    }

    #[test]
    fn long_path_is_reduced_to_its_end() {
        assert_eq!(tail("/models/snake.json", 10), "snake.json");
        assert_eq!(tail("snake.json", 100), "snake.json");
        assert_eq!(tail("äb", 2), "b");
    }
}
