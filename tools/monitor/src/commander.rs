//! The name of the process that holds the lease.

use std::borrow::Cow;
use std::fs;

use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{ClientProcess, Domain, find_client_process};
use i2ris::units::Nanos;

/// Time between two attempts to find a process: it costs reading a folder.
const RETRY: Nanos = Nanos::from_millis(1000);

/// Name such as "i2ris calibrate collect, process 12, user 1000": for a program of many commands,
/// the command says more than the program.
fn name(process: &ClientProcess) -> String {
    let line = fs::read(format!("/proc/{}/cmdline", process.pid)).unwrap_or_default();
    let words = line.split(|byte| *byte == 0).skip(1).map(String::from_utf8_lossy);
    let is_word = |word: &Cow<'_, str>| word.bytes().all(|it| it.is_ascii_lowercase());
    let words: Vec<_> =
        words.take_while(|word| !word.is_empty() && is_word(word)).take(2).collect();
    let program = match process.program.as_str() {
        "i2ris" => [vec!["i2ris".into()], words].concat().join(" "),
        other => other.to_owned(),
    };
    ClientProcess { program, ..process.clone() }.to_string()
}

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

    /// Program, process id and user of the holder; `None`: no holder, or unknown.
    pub fn name(&mut self, state: Option<&OperatingStateMsg>, now: Nanos) -> Option<String> {
        let state = state.filter(|state| state.lease_client_id != 0)?;
        let (boot, client) = (state.boot_id, state.lease_client_id);
        let known = self.found.as_ref().filter(|it| (it.0, it.1) == (boot, client));
        if known.is_none_or(|it| it.2.is_none() && now >= self.next) {
            let process = find_client_process(&self.domain, boot, client);
            self.found = Some((boot, client, process.map(|process| name(&process))));
            self.next = now + RETRY;
        }
        self.found.as_ref().and_then(|it| it.2.clone())
    }
}
