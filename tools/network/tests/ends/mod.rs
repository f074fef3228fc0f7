//! Both ends of the bridge on a rig, on threads.
#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "every test binary uses a part"
)]

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::{Domain, OperatingState};
use i2ris::units::Nanos;
use i2ris_network::keys::{Access, Lifetime, PersonalKey, make_key};
use i2ris_network::{BridgeClient, BridgeServer};

use crate::rig::motion::{SEND_PERIOD, swing};
use crate::rig::{Rig, TIMEOUT, wait_until_holding};

/// Long compared with stalls of the machine, short compared with the timeout of the test.
pub const LOST_AFTER: Nanos = Nanos::from_millis(1500);

/// A thread that is stopped and joined on drop.
pub struct Running {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    pub fn start(work: impl FnOnce(Arc<AtomicBool>) + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let thread = Some(thread::spawn(move || work(flag)));
        Self { stop, thread }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The folder of keys of a rig.
pub fn keys(rig: &Rig) -> PathBuf {
    rig.folder.path().join("keys")
}

/// A key that may command.
pub fn key(rig: &Rig) -> PersonalKey {
    let hosts = ["127.0.0.1", "10.77.0.1"].map(str::to_owned);
    let lifetime = Lifetime::days(1);
    let made = make_key(&keys(rig), "surgeon", Access::Command, &hosts, lifetime);
    PersonalKey::load(&made.unwrap()).unwrap()
}

pub fn start_server(rig: &Rig, listen: &str) -> Running {
    let server = BridgeServer {
        domain: rig.domain(),
        listen: listen.to_owned(),
        keys: keys(rig),
        commands: true,
        period: Nanos::from_millis(5),
        lost_after: LOST_AFTER,
    };
    let server = server.open().unwrap();
    Running::start(move |stop| server.run(|| stop.load(Ordering::Relaxed), drop))
}

pub fn start_client(domain: &Domain, server: &str, key: PersonalKey) -> Running {
    let client = BridgeClient {
        domain: domain.clone(),
        server: server.to_owned(),
        key,
        lost_after: LOST_AFTER,
    };
    Running::start(move |stop| client.run(|| stop.load(Ordering::Relaxed), drop).unwrap())
}

/// Streams until it fails; the error.
pub fn stream_until_it_fails(client: &Client) -> ClientError {
    let (mut commander, start) = (client.commander(), clock::now());
    loop {
        let now = clock::now();
        match commander.servo_actuators(&swing((now - start).as_seconds())) {
            Ok(_) => assert!(now.since(start) < TIMEOUT, "it never fails"),
            Err(error) => return error,
        }
        clock::sleep_until(now + SEND_PERIOD);
    }
}

/// The time from a cut until the setpoints must be constant.
pub fn deadline(rig: &Rig) -> Nanos {
    Nanos::from_millis(rig.config.command.deadline_ms + 250)
}

/// Waits until the robot holds because its commander has fallen silent.
pub fn wait_until_stopped(client: &mut Client) -> u64 {
    let held = wait_until_holding(client);
    assert!(held.state == OperatingState::Enabled.number() && held.stale_stops >= 1);
    held.accepted
}
