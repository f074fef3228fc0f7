//! The watchdog: a second process that stops the drives when the controller dies or hangs.
//!
//! A drive on a serial line does not detect the loss of its host: it stays powered and holds its
//! last target. The watchdog monitors the heartbeat of the control loop in shared memory
//! ([`crate::ipc::heartbeat`]). When the controller is killed, or its loop is silent for too long,
//! the watchdog sends quick stop over the same ports.
//!
//! | file | content |
//! |---|---|
//! | `heartbeat_monitor` | status of the controller: a pure function of heartbeats and time |
//! | `shared_port` | a port that is open beside the controller, and quick stop through it |
//! | `unstopped` | ports whose drives could not be stopped, for another try |
//! | `pulse` | a modem line that changes while all is well, for a relay on the STO inputs |
//! | `event` | events for the log |
//!
//! The watchdog keeps its ports open. The controller takes a port for itself, and lets a watchdog
//! that runs in first, at its start and after every replug ([`crate::drive::exclusive_use`]). So it
//! does not matter who is first. While the watchdog keeps a port open, the kernel does not end the
//! exclusive use by a killed controller, so the watchdog does.
//!
//! Behind one port may be several drives, and the first is a gateway to the others. It waits for
//! one that does not answer, and takes nothing else meanwhile. So the heartbeat also tells which
//! drives owe an answer, and those are stopped last.
//!
//! Limits: the watchdog sends nothing when the host loses power, hangs as a whole, or its cable is
//! disconnected. Then its `pulse` ends, and a relay on the safe-torque-off inputs of the drives
//! opens, where there is one.

mod event;
mod heartbeat_monitor;
mod pulse;
mod shared_port;
mod unstopped;

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::clock;
use crate::config::Config;
use crate::drive::quick_stop::STOP_ATTEMPTS;
use crate::ipc::Domain;
use crate::ipc::heartbeat::HeartbeatReader;
use crate::ipc::watchdog_presence::WatchdogPresence;
use crate::service_manager;
use crate::units::Nanos;

pub use event::{AxisStop, WatchdogEvent};
pub use heartbeat_monitor::{ControllerStatus, HeartbeatMonitor};
use pulse::Pulse;
pub use pulse::PulseLine;
pub use shared_port::SharedPort;
use unstopped::{Unstopped, is_complete_stop};

/// Period of reading the heartbeat.
const POLL_PERIOD: Nanos = Nanos::from_millis(2);

/// Period of trying to open ports, and of looking for ports that were abandoned in exclusive use.
const OPEN_PERIOD: Nanos = Nanos::from_millis(100);

/// How long a watchdog without a service manager waits for a first port: without one it watches
/// nothing, and nobody sees that.
const FIRST_PORT: Nanos = Nanos::from_millis(10_000);

/// Stack of a thread that stops a port, bytes. All of it becomes resident where memory is locked.
const STOP_STACK: usize = 256 * 1024;

/// Nobody knows any more which drives answer.
const ALL_OWING: u8 = u8::MAX;

/// Default silence of the loop after which the watchdog acts.
///
/// The port threads of the controller have a time-out for a silent loop, too: `LOOP_TIMEOUT`,
/// 1000 ms by default. The two differ on purpose. The watchdog runs above everything of the
/// controller, so 40 missed ticks are not its own delay, and it acts before the operator notices.
/// The port thread is the second line, for a controller without a watchdog. It also runs where the
/// machine grants no real time, and where stalls of a hundred milliseconds are normal and harmless:
/// a drive without new setpoints holds the last one. A quick stop there would end work for nothing.
/// If both acted at the same time, their exchanges would collide on the line.
pub const DEFAULT_SILENCE: Nanos = Nanos::from_millis(40);

/// Monitors the controller until `stop` is set, and keeps `presence` up to date. Passes every event
/// to `report`. Returns whether it ever held a port: on a terminal it ends without one.
pub fn run(
    config: &Config,
    domain: &Domain,
    presence: &WatchdogPresence,
    silence: Nanos,
    stop: &AtomicBool,
    report: &mut dyn FnMut(WatchdogEvent),
) -> bool {
    let first_port = clock::now() + FIRST_PORT;
    let mut had_port = service_manager::is_there();
    let mut ports: Vec<SharedPort> = config.ports.iter().map(SharedPort::new).collect();
    let mut reader = HeartbeatReader::new(domain);
    let mut monitor = HeartbeatMonitor::new(silence);
    let mut next_open = Nanos::ZERO;
    let mut was_complete = false;
    let mut unstopped = Unstopped::default();
    let mut pulse = start_pulse(config, report);
    let alive = |now| {
        service_manager::notify(service_manager::ALIVE);
        // If it fails, clients see a watchdog that is silent: the safe side.
        let _ = presence.alive(now);
    };
    while !stop.load(Ordering::Acquire) {
        let now = clock::now();
        if now >= next_open {
            next_open = now + OPEN_PERIOD;
            for event in ports.iter_mut().filter_map(SharedPort::open) {
                report(event);
            }
            for port in &ports {
                port.release_if_abandoned();
            }
            had_port |= ports.iter().any(SharedPort::is_open);
            if !had_port && now > first_port {
                return false;
            }
            let is_complete = ports.iter().all(SharedPort::is_open);
            if std::mem::replace(&mut was_complete, is_complete) != is_complete {
                // If the lock fails, clients see a watchdog that cannot act: the safe side.
                let _ = presence.set_complete(is_complete);
            }
            if is_complete {
                service_manager::notify(service_manager::READY);
            }
            alive(now);
        }
        let heartbeat = reader.read();
        if let Some(pulse) = &mut pulse {
            pulse.update(heartbeat.ok().flatten(), clock::now());
            pulse.change().into_iter().for_each(|why| report(WatchdogEvent::Pulse(why)));
        }
        let status = monitor.update(heartbeat, clock::now());
        match status {
            ControllerStatus::Absent | ControllerStatus::Alive => {}
            ControllerStatus::Started => {
                unstopped.clear();
                report(WatchdogEvent::Monitoring);
            }
            ControllerStatus::Ended => report(WatchdogEvent::ControllerEnded),
            ControllerStatus::Died | ControllerStatus::Hangs => {
                let age = monitor.age(clock::now());
                // Sends quick stop to every axis before it reports.
                let all = ports.iter().collect::<Vec<_>>();
                let stopped = quick_stop_all(&all, monitor.owing(), STOP_ATTEMPTS, alive);
                report(WatchdogEvent::ControllerLost(status, age));
                unstopped.note(&stopped, clock::now());
                stopped.into_iter().for_each(&mut *report);
            }
        }
        if unstopped.is_due(now) {
            // A controller that has opened a port again stops its drives itself.
            let due = ports.iter().filter(|port| {
                unstopped.contains(port.device()) && port.is_open() && !port.is_in_use()
            });
            let stopped = quick_stop_all(&due.collect::<Vec<_>>(), ALL_OWING, 1, alive);
            unstopped.note_again(&stopped);
            stopped.into_iter().filter(is_complete_stop).for_each(&mut *report);
        }
        clock::sleep(POLL_PERIOD);
    }
    true
}

fn start_pulse(config: &Config, report: &mut dyn FnMut(WatchdogEvent)) -> Option<Pulse> {
    let pulse = Pulse::start(config.watchdog.pulse.as_ref()?);
    pulse.map_err(|error| report(WatchdogEvent::Pulse(Some(error.to_string())))).ok()
}

/// Stops the axes of all ports at the same time, so often: a port that does not answer takes
/// seconds. `alive` is called meanwhile.
fn quick_stop_all(
    ports: &[&SharedPort],
    owing: u8,
    attempts: usize,
    alive: impl Fn(Nanos),
) -> Vec<WatchdogEvent> {
    thread::scope(|scope| {
        let stopping: Vec<_> = ports
            .iter()
            .map(|port| {
                let thread = thread::Builder::new().stack_size(STOP_STACK);
                let stop = || port.quick_stop(owing, attempts);
                // Without memory for a thread, one port after the other.
                thread.spawn_scoped(scope, stop).map_err(|_| stop())
            })
            .collect();
        let mut next_alive = clock::now() + OPEN_PERIOD;
        while stopping.iter().flatten().any(|thread| !thread.is_finished()) {
            clock::sleep(POLL_PERIOD);
            let now = clock::now();
            if now >= next_alive {
                next_alive = now + OPEN_PERIOD;
                alive(now);
            }
        }
        let events = stopping.into_iter().map(|stopping| match stopping {
            Ok(thread) => thread.join().ok(),
            Err(event) => Some(event),
        });
        events.flatten().collect()
    })
}
