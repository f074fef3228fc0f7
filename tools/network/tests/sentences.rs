//! What both ends say of a key that is not let in, or may not do what it tries.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread;

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, random_id};
use i2ris::units::Nanos;
use i2ris_network::keys::{Access, revoke};
use i2ris_testing::{Controller, Program, wait_until};

use crate::common::{free_address, make};

/// An end as a process, because Zenoh warns a whole process, and what it has said.
struct End {
    said: Arc<Mutex<Vec<String>>>,
    _program: Program,
}

impl End {
    fn start(domain: &Domain, arguments: &[&str]) -> Self {
        let mut program = Program::start(domain, &[&["bridge"], arguments].concat());
        let (said, stdout) = (Arc::<Mutex<Vec<String>>>::default(), program.child().stdout.take());
        let kept = Arc::clone(&said);
        thread::spawn(move || {
            for line in BufReader::new(stdout.unwrap()).lines().map_while(Result::ok) {
                kept.lock().unwrap().push(line);
            }
        });
        Self { said, _program: program }
    }

    fn serve(controller: &Controller, address: &str, keys: &Path) -> Self {
        let arguments = ["serve", "--command", "--listen", address, "--keys"];
        let end = Self::start(&controller.domain, &[&arguments[..], &[text(keys)]].concat());
        end.hear("listening");
        end
    }

    fn connect(domain: &Domain, address: &str, key: &Path) -> Self {
        Self::start(domain, &["connect", address, "--key", text(key)])
    }

    fn has_said(&self, words: &str) -> bool {
        self.said.lock().unwrap().iter().any(|line| line.contains(words))
    }

    /// Waits until it says so.
    fn hear(&self, words: &str) {
        let end = clock::now() + Nanos::from_millis(20_000);
        while !self.has_said(words) {
            assert!(clock::now() < end, "{words:?} among {:?}", self.said);
            clock::sleep(Nanos::from_millis(5));
        }
    }
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn elsewhere() -> Domain {
    Domain::new(&format!("t{:016x}", random_id())).unwrap()
}

#[test]
fn a_key_of_another_robot_hears_so_and_so_does_the_server() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let (keys, others) = (folder.path().join("keys"), folder.path().join("others"));
    let valid = make(&keys, "alice", Access::Watch);
    let foreign = make(&others, "bob", Access::Watch);
    let address = free_address();
    let server = End::serve(&controller, &address, &keys);
    // The server's certificate is of an authority that the key does not know.
    let unknown = End::connect(&elsewhere(), &address, &foreign);
    unknown.hear("the key is of another robot");
    drop(unknown);
    // And one that the server does not know.
    std::fs::copy(valid.join("ca.pem"), foreign.join("ca.pem")).unwrap();
    let refused = End::connect(&elsewhere(), &address, &foreign);
    refused.hear("does not accept this key");
    server.hear("somebody was not let in");
    let welcome = End::connect(&elsewhere(), &address, &valid);
    welcome.hear("joined");
    for end in [&server, &refused, &welcome] {
        for wrong in ["open file limit", "Timeout", "network interfaces"] {
            assert!(!end.has_said(wrong), "{:?}", end.said);
        }
    }
}

#[test]
fn commands_of_a_key_that_may_watch_only_do_not_vanish_without_a_word() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let key = make(folder.path(), "eve", Access::Watch);
    let (there, address) = (elsewhere(), free_address());
    let server = End::serve(&controller, &address, folder.path());
    let client = End::connect(&there, &address, &key);
    let program = wait_until("a domain", || Client::connect(&there, Nanos::from_millis(200)).ok());
    let mut commander = program.commander();
    wait_until("both say so", || {
        let _ = commander.servo_jp(&[0.01, 0.0]);
        clock::sleep(Nanos::from_millis(20));
        client.has_said("may watch only") && server.has_said("may watch only")
    });
    let said = client.said.lock().unwrap().clone();
    let lines = said.iter().filter(|line| line.contains("may watch only"));
    assert_eq!(lines.count(), 1, "once: {said:?}");
    assert!(controller.robot().poses.is_empty());
}

#[test]
fn a_client_whose_key_is_revoked_hears_that_and_not_of_silence() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let key = make(folder.path(), "alice", Access::Command);
    let address = free_address();
    let _server = End::serve(&controller, &address, folder.path());
    let client = End::connect(&elsewhere(), &address, &key);
    client.hear("joined");
    revoke(folder.path(), "alice").unwrap();
    client.hear("this key was revoked");
    assert!(!client.has_said("silent"), "{:?}", client.said);
}
