//! The name of the process that holds the lease.

use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, find_client_process};
use i2ris::units::Nanos;

/// Time between two attempts to find a process: it costs reading a folder.
const RETRY: Nanos = Nanos::from_millis(1000);

/// Finds the holder of the lease, once per change.
#[derive(Debug)]
pub struct Commander {
    domain: Domain,
    /// Boot id and client of the answer.
    found: Option<(u64, u64, Option<String>)>,
    next: Nanos,
}

impl Commander {
    pub fn new(domain: &Domain) -> Self {
        Self { domain: domain.clone(), found: None, next: Nanos::ZERO }
    }

    /// Program, process id and user of the holder; `None`: nobody, or not known.
    pub fn name(&mut self, state: Option<&OperatingStateMsg>, now: Nanos) -> Option<String> {
        let state = state.filter(|state| state.lease_client_id != 0)?;
        let (boot, client) = (state.boot_id, state.lease_client_id);
        let known = self.found.as_ref().filter(|it| (it.0, it.1) == (boot, client));
        if known.is_none_or(|it| it.2.is_none() && now >= self.next) {
            let process = find_client_process(&self.domain, boot, client);
            self.found = Some((boot, client, process.map(|process| process.to_string())));
            self.next = now + RETRY;
        }
        self.found.as_ref().and_then(|it| it.2.clone())
    }
}
