//! Polls the models of the controller, and the hull of the model in use, in a background thread.

use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use crate::hull_outline::{Outline, outline_of};
use crate::view::{LoadedModel, Models, short_id};
use i2ris::ipc::Domain;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::{ModelSlot, unpadded_text};
use i2ris::model::ModelId;
use i2ris::units::Nanos;

/// How long to wait for a controller that is just starting.
const CONNECT: Nanos = Nanos::from_millis(200);
/// Polling period: other programs stage models without notice.
const PERIOD: Duration = Duration::from_secs(3);

/// The models and the hull that were last read.
#[derive(Debug, Clone, Default)]
pub struct Known {
    pub models: Models,
    /// The hull of the model in use.
    pub outline: Arc<Outline>,
}

fn loaded(slot: &ModelSlot) -> Option<LoadedModel> {
    let id = ModelId(slot.model_id);
    (slot.flags & ModelSlot::PRESENT != 0).then(|| LoadedModel {
        id,
        name: format!("{} {}", unpadded_text(&slot.family), short_id(id)),
        file: unpadded_text(&slot.file),
        memory_known: slot.flags & ModelSlot::MEMORY_KNOWN != 0,
    })
}

/// The models in use, staged, and in use before.
fn models(slots: &[ModelSlot; 3]) -> Models {
    let [used, staged, previous] = slots.each_ref().map(loaded);
    Models { known: true, used, staged, previous, ..Models::default() }
}

/// Polls the list of models every few seconds, and on request. It sends no other request, so it
/// cannot change anything.
#[derive(Debug)]
pub struct ModelPoller {
    known: Arc<Mutex<Known>>,
    requests: SyncSender<()>,
}

impl ModelPoller {
    /// Starts the thread.
    pub fn start(domain: &Domain) -> Self {
        let known = Arc::new(Mutex::new(Known::default()));
        let (requests, receiver) = sync_channel(1);
        thread::spawn({
            let (domain, known) = (domain.clone(), Arc::clone(&known));
            move || poll_until_disconnected(&domain, &receiver, &known)
        });
        Self { known, requests }
    }

    /// Polls now. A second request while one is pending has no effect.
    pub fn poll_now(&self) {
        let _ = self.requests.try_send(());
    }

    /// The models and the hull that were last read.
    pub fn known(&self) -> Known {
        self.known.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Runs until the poller is dropped.
fn poll_until_disconnected(domain: &Domain, requests: &Receiver<()>, known: &Mutex<Known>) {
    let mut drawn: Option<ModelId> = None;
    while requests.recv_timeout(PERIOD) != Err(RecvTimeoutError::Disconnected) {
        let answer = ask(domain);
        let mut new = known.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let hull_problem = new.models.hull_problem.take();
        new.models = answer.unwrap_or_else(|error| {
            let problem = Some(format!("cannot read the models: {error}"));
            Models { problem, ..Models::default() }
        });
        new.models.hull_problem = hull_problem;
        let used = new.models.used.as_ref();
        if used.map(|used| used.id) != drawn {
            drawn = used.map(|used| used.id);
            let outline = used.map(|used| outline_of(Path::new(&used.file), used.id)).transpose();
            new.models.hull_problem = outline.as_ref().err().map(ToString::to_string);
            new.outline = Arc::new(outline.ok().flatten().unwrap_or_default());
        }
        *known.lock().unwrap_or_else(PoisonError::into_inner) = new;
    }
}

fn ask(domain: &Domain) -> Result<Models, ClientError> {
    Ok(models(&Client::connect(domain, CONNECT)?.models()?.slots))
}
