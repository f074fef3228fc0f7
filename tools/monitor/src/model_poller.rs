//! Polls the models of the controller, and the hull of the model in use, in a background thread.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use i2ris::ipc::Domain;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::{ModelSlot, Version, unpadded_text};
use i2ris::model::ModelId;
use i2ris::units::Nanos;

use super::hull_outline::{Outline, outline_of};
use super::latest_messages::short_id;

/// How long to wait for a controller that is just starting.
const CONNECT: Nanos = Nanos::from_millis(200);
/// Polling period: other programs stage models without notice.
const PERIOD: Duration = Duration::from_secs(3);

/// What is known about models.
#[derive(Debug, Clone, Default)]
pub struct Models {
    /// In use, staged, in use before; `None`: not known yet.
    pub slots: Option<[ModelSlot; 3]>,
    /// The hull of the model in use.
    pub outline: Arc<Outline>,
    /// Software and process of the controller, and its model, in one line.
    pub title: Option<String>,
    /// Why there are no models to name.
    pub problem: Option<String>,
    /// Why there is no outline.
    pub hull_problem: Option<String>,
}

/// A loaded model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LoadedModel {
    pub id: ModelId,
    /// Family and the beginning of the identity.
    pub name: String,
    /// The end of the path of its file.
    pub file: String,
    pub memory_known: bool,
}

impl Models {
    /// The model in use.
    pub fn used(&self) -> Option<LoadedModel> {
        self.slot(0)
    }

    /// The model that was staged.
    pub fn staged(&self) -> Option<LoadedModel> {
        self.slot(1)
    }

    /// The model that was in use before.
    pub fn previous(&self) -> Option<LoadedModel> {
        self.slot(2)
    }

    fn slot(&self, index: usize) -> Option<LoadedModel> {
        let slot =
            self.slots.as_ref()?.get(index).filter(|slot| slot.flags & ModelSlot::PRESENT != 0)?;
        let id = ModelId(slot.model_id);
        Some(LoadedModel {
            id,
            name: format!("{} {}", unpadded_text(&slot.family), short_id(id)),
            file: unpadded_text(&slot.file),
            memory_known: slot.flags & ModelSlot::MEMORY_KNOWN != 0,
        })
    }
}

/// Polls the list of models every few seconds, and on request. It sends no other request, so it
/// cannot change anything.
#[derive(Debug)]
pub struct ModelPoller {
    known: Arc<Mutex<Models>>,
    requests: SyncSender<()>,
}

impl ModelPoller {
    /// Starts the thread. `file`: the model in use, if the path that the controller reports is not
    /// valid here.
    pub fn start(domain: &Domain, file: Option<PathBuf>) -> Self {
        let known = Arc::new(Mutex::new(Models::default()));
        let (requests, receiver) = sync_channel(1);
        thread::spawn({
            let (domain, known) = (domain.clone(), Arc::clone(&known));
            move || poll_until_disconnected(&domain, file.as_deref(), &receiver, &known)
        });
        Self { known, requests }
    }

    /// Polls now. A second request while one is pending has no effect.
    pub fn poll_now(&self) {
        let _ = self.requests.try_send(());
    }

    /// What is known.
    pub fn known(&self) -> Models {
        self.known.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Runs until the poller is dropped.
fn poll_until_disconnected(
    domain: &Domain,
    file: Option<&Path>,
    requests: &Receiver<()>,
    known: &Mutex<Models>,
) {
    let mut drawn: Option<ModelId> = None;
    while requests.recv_timeout(PERIOD) != Err(RecvTimeoutError::Disconnected) {
        let answer = ask(domain);
        let mut models = known.lock().unwrap_or_else(PoisonError::into_inner).clone();
        (models.slots, models.title, models.problem) = match answer {
            Ok((slots, title)) => (Some(slots), Some(title), None),
            Err(error) => (None, None, Some(format!("models not known: {error}"))),
        };
        let used = models.used();
        if used.as_ref().map(|used| used.id) != drawn {
            drawn = used.as_ref().map(|used| used.id);
            (models.outline, models.hull_problem) = match &used {
                None => (Arc::default(), None),
                Some(used) => outline(file, &used.file, used.id),
            };
        }
        *known.lock().unwrap_or_else(PoisonError::into_inner) = models;
    }
}

fn ask(domain: &Domain) -> Result<([ModelSlot; 3], String), ClientError> {
    let mut client = Client::connect(domain, CONNECT)?;
    let slots = client.models()?.slots;
    let version = client.version()?;
    let [used, ..] = &slots;
    Ok((slots, title(&version, domain.name(), used.model_id)))
}

/// Software and process of the controller, and its model, in one line.
pub fn title(version: &Version, domain: &str, model: [u8; 32]) -> String {
    let [major, minor, patch] = version.software;
    let model = if model == [0; 32] {
        "no model".to_owned()
    } else {
        format!("model {}", short_id(ModelId(model)))
    };
    let process = version.pid;
    format!("i2ris {major}.{minor}.{patch}, domain {domain}, process {process}, {model}")
}

fn outline(file: Option<&Path>, reported: &str, used: ModelId) -> (Arc<Outline>, Option<String>) {
    let outline = match file {
        Some(file) => outline_of(file, used),
        None => outline_of(Path::new(reported), used),
    };
    match outline {
        Ok(outline) => (Arc::new(outline), None),
        Err(error) => (Arc::default(), Some(error.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::padded_text;

    use super::*;

    #[test]
    fn a_slot_without_a_model_has_no_name() {
        let there = ModelSlot {
            model_id: [0x5a; 32],
            family: padded_text("gmr-play"),
            file: padded_text("/models/a.json"),
            flags: ModelSlot::PRESENT | ModelSlot::MEMORY_KNOWN,
            ..ModelSlot::default()
        };
        let models =
            Models { slots: Some([there, ModelSlot::default(), there]), ..Models::default() };
        let named = models.used().unwrap();
        assert_eq!(
            (named.name.as_str(), named.file.as_str()),
            ("gmr-play 5a5a5a5a", "/models/a.json")
        );
        assert!(named.memory_known && models.staged().is_none() && models.previous().is_some());
        assert!(Models::default().used().is_none());
    }
}
