//! The guard: a second process that stops the drives when the controller dies or hangs.
//!
//! A drive on a serial line does not notice that its host is gone: it stays powered and holds its
//! last demand. The guard watches the pulse of the control loop in shared memory
//! ([`crate::ipc::pulse`]). When the controller is killed, or its loop has been silent for too
//! long, the guard sends quick stop over the same ports.
//!
//! | file | holds |
//! |---|---|
//! | `watch` | when the controller counts as gone; a pure function of what was felt |
//! | `port` | a port that is held open without taking it from the controller, and the stop |
//!
//! The guard opens its ports before the controller does and keeps them: a port that the controller
//! has opened is locked for everyone who comes later, also when the controller hangs. So the guard
//! is started first, and a port that it cannot open yet is tried again and again.
//!
//! What it cannot do: anything when the host loses power, hangs as a whole, or its cable is pulled.
//! That takes a watchdog of hardware on the safe-torque-off input of the drives, see the README.

mod port;
mod watch;

use std::sync::atomic::{AtomicBool, Ordering};

use crate::clock;
use crate::config::Config;
use crate::ipc::Domain;
use crate::ipc::pulse::Finger;
use crate::units::Nanos;

pub use port::{GuardedPort, Stopped};
pub use watch::{Heartbeat, Verdict};

/// How often the heartbeat is looked at.
const LOOK: Nanos = Nanos::from_millis(2);

/// How often a port is tried that could not be opened.
const TRY_PORTS: Nanos = Nanos::from_millis(100);

/// Silence of the loop after which the guard acts, unless told otherwise.
pub const DEFAULT_SILENCE: Nanos = Nanos::from_millis(40);

/// What the guard tells, for the log.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// A port is held.
    Held(std::path::PathBuf),
    /// A port cannot be held now, and why.
    NotHeld(std::path::PathBuf, String),
    /// The controller is there, and watched from now on.
    Watching,
    /// The controller is gone, or hangs, for this long.
    Silent(Verdict, Nanos),
    /// What came of stopping a port.
    Stopped(std::path::PathBuf, Vec<Stopped>),
    /// The controller ended with its drives off.
    Ended,
}

/// Watches until `stop`. Every notice goes to `tell`.
pub fn run(
    config: &Config,
    domain: &Domain,
    silence: Nanos,
    stop: &AtomicBool,
    tell: &mut dyn FnMut(Notice),
) {
    let mut ports: Vec<GuardedPort> = config.ports.iter().map(GuardedPort::new).collect();
    let mut finger = Finger::new(domain);
    let mut heartbeat = Heartbeat::new(silence);
    let mut next_try = Nanos::ZERO;
    while !stop.load(Ordering::Acquire) {
        let now = clock::now();
        if now >= next_try {
            next_try = now + TRY_PORTS;
            ports
                .iter_mut()
                .filter_map(GuardedPort::hold)
                .for_each(&mut *tell);
        }
        let felt = finger.feel();
        let verdict = heartbeat.judge(felt, clock::now());
        match verdict {
            Verdict::Waiting | Verdict::Alive => {}
            Verdict::Arrived => tell(Notice::Watching),
            Verdict::Ended => tell(Notice::Ended),
            Verdict::Gone | Verdict::Hangs => {
                let age = heartbeat.age(clock::now());
                // The stop comes before the talk.
                let stopped: Vec<Notice> = ports
                    .iter_mut()
                    .map(|port| Notice::Stopped(port.device().to_owned(), port.stop()))
                    .collect();
                tell(Notice::Silent(verdict, age));
                stopped.into_iter().for_each(&mut *tell);
            }
        }
        clock::sleep(LOOK);
    }
}
