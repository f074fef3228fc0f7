//! Which models are at hand, and the hull of the one in use: looked up in the background, because
//! it takes time.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use i2ris::ipc::Domain;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::{ModelSlot, text_of};
use i2ris::model::ModelId;
use i2ris::units::Nanos;

use super::hull::{Outline, outline_of};
use super::view::short_id;

/// How long to wait for a controller that is just starting.
const CONNECT: Nanos = Nanos::from_millis(200);
/// How often it looks without being told to: models are staged by other programs, which nobody
/// tells us.
const PERIOD: Duration = Duration::from_secs(3);

/// What is known about models.
#[derive(Debug, Clone, Default)]
pub struct Models {
    /// In use, staged, in use before; `None`: not told yet.
    pub slots: Option<[ModelSlot; 3]>,
    /// What the model in use looks like.
    pub outline: Arc<Outline>,
    /// Why there are no models to name.
    pub problem: Option<String>,
    /// Why there is no outline.
    pub hull_problem: Option<String>,
}

/// A model that is at hand.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Named {
    pub id: ModelId,
    /// Family and the beginning of the identity.
    pub name: String,
    /// The end of the path of its file.
    pub file: String,
    pub memory_known: bool,
}

impl Models {
    /// The model in use.
    pub fn used(&self) -> Option<Named> {
        self.named(0)
    }

    /// The model that was staged.
    pub fn staged(&self) -> Option<Named> {
        self.named(1)
    }

    /// The model that was in use before.
    pub fn former(&self) -> Option<Named> {
        self.named(2)
    }

    fn named(&self, place: usize) -> Option<Named> {
        let slot = self
            .slots
            .as_ref()?
            .get(place)
            .filter(|slot| slot.flags & ModelSlot::PRESENT != 0)?;
        let id = ModelId(slot.model_id);
        Some(Named {
            id,
            name: format!("{} {}", text_of(&slot.family), short_id(id)),
            file: text_of(&slot.file),
            memory_known: slot.flags & ModelSlot::MEMORY_KNOWN != 0,
        })
    }
}

/// Looks up models every few seconds, and whenever it is told to. It asks one question, `list`,
/// over a connection that it closes again; it has no way to change anything.
#[derive(Debug)]
pub struct Librarian {
    known: Arc<Mutex<Models>>,
    asks: SyncSender<()>,
}

impl Librarian {
    /// Starts it. `file`: where the model in use lies, if its path as the controller tells it is no
    /// good here.
    pub fn start(domain: &Domain, file: Option<PathBuf>) -> Self {
        let known = Arc::new(Mutex::new(Models::default()));
        let (asks, questions) = sync_channel(1);
        thread::spawn({
            let (domain, known) = (domain.clone(), Arc::clone(&known));
            move || look_again_and_again(&domain, file.as_deref(), &questions, &known)
        });
        Self { known, asks }
    }

    /// Has it look now. One look that waits is as good as two.
    pub fn look(&self) {
        let _ = self.asks.try_send(());
    }

    /// What is known.
    pub fn known(&self) -> Models {
        self.known
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

/// Until nobody can ask any more.
fn look_again_and_again(
    domain: &Domain,
    file: Option<&Path>,
    questions: &Receiver<()>,
    known: &Mutex<Models>,
) {
    let mut drawn: Option<ModelId> = None;
    while questions.recv_timeout(PERIOD) != Err(RecvTimeoutError::Disconnected) {
        let slots = list(domain);
        let mut models = known.lock().unwrap_or_else(PoisonError::into_inner).clone();
        (models.slots, models.problem) = match slots {
            Ok(slots) => (Some(slots), None),
            Err(error) => (None, Some(format!("models not known: {error}"))),
        };
        let used = models.used();
        if used.as_ref().map(|used| used.id) != drawn {
            drawn = used.as_ref().map(|used| used.id);
            (models.outline, models.hull_problem) = match &used {
                None => (Arc::default(), None),
                Some(used) => draw(file, &used.file, used.id),
            };
        }
        *known.lock().unwrap_or_else(PoisonError::into_inner) = models;
    }
}

fn list(domain: &Domain) -> Result<[ModelSlot; 3], ClientError> {
    Ok(Client::connect(domain, CONNECT)?.models()?.slots)
}

fn draw(file: Option<&Path>, told: &str, used: ModelId) -> (Arc<Outline>, Option<String>) {
    let outline = match file {
        Some(file) => outline_of(file, used),
        None => outline_of(Path::new(told), used),
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
        let models = Models {
            slots: Some([there, ModelSlot::default(), there]),
            ..Models::default()
        };
        let named = models.used().unwrap();
        assert_eq!(
            (named.name.as_str(), named.file.as_str()),
            ("gmr-play 5a5a5a5a", "/models/a.json")
        );
        assert!(named.memory_known && models.staged().is_none() && models.former().is_some());
        assert!(Models::default().used().is_none());
    }
}
