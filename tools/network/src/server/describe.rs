//! A thread that asks the controller what it is. It may have to wait for a controller that hangs,
//! and the server may not.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread;

use i2ris::ipc::Domain;
use i2ris::ipc::client::RequestForwarder;
use i2ris::ipc::payload::Version;

use crate::NetworkError;

/// Asks `version` on request. Ends when dropped.
#[derive(Debug)]
pub(super) struct Describer {
    ask: SyncSender<()>,
    answers: Receiver<Version>,
}

impl Describer {
    pub fn start(domain: &Domain) -> Result<Self, NetworkError> {
        let (ask, asked) = sync_channel(1);
        let (answered, answers) = channel();
        let controller = RequestForwarder::new(domain);
        let work = move || serve(controller, &asked, &answered);
        thread::Builder::new()
            .name("server-version".to_owned())
            .spawn(work)
            .map_err(NetworkError::Thread)?;
        Ok(Self { ask, answers })
    }

    /// Has it ask, unless it still does.
    pub fn ask(&self) {
        let _ = self.ask.try_send(());
    }

    /// The newest answer since the last call.
    pub fn answered(&self) -> Option<Version> {
        self.answers.try_iter().last()
    }
}

fn serve(mut controller: RequestForwarder, asked: &Receiver<()>, answered: &Sender<Version>) {
    while asked.recv().is_ok() {
        if let Ok(version) = controller.version()
            && answered.send(version).is_err()
        {
            return;
        }
    }
}
