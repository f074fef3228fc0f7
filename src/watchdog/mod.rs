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
//! | `shared_port` | a port that is also open in the controller; quick stop through it, retries |
//! | `pulse` | a modem line that toggles while all is well, for a relay on the STO inputs |
//! | `event` | events for the log |
//!
//! The watchdog and the controller both keep the ports open. Ages decide which of them transmits
//! (`drive::line_turn`): the watchdog takes over a line whose port thread hangs, or all
//! lines when the loop hangs, and releases them as soon as both run again.
//!
//! A port may have several drives, the first of which is a gateway to the others. While it waits
//! for a silent node, it accepts nothing else. So the heartbeat also contains the drives with a
//! pending reply, and those are stopped last.
//!
//! Limits: the watchdog sends nothing when the host loses power, hangs as a whole, or its cable is
//! disconnected. Then its `pulse` ends, and a relay on the safe-torque-off inputs of the drives
//! opens, where there is one.

mod event;
mod heartbeat_monitor;
mod pulse;
mod shared_port;

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::clock;
use crate::config::Config;
use crate::drive::line_turn::TAKE_OVER;
use crate::drive::quick_stop::STOP_ATTEMPTS;
use crate::ipc::Domain;
use crate::ipc::heartbeat::HeartbeatReader;
use crate::ipc::watchdog_presence::WatchdogPresence;
use crate::realtime::{self, SchedulingRequest};
use crate::service_manager;
use crate::units::Nanos;

pub use event::{AxisStop, WatchdogEvent};
pub use heartbeat_monitor::{ControllerStatus, HeartbeatMonitor};
use pulse::Pulse;
pub use pulse::PulseLine;
pub use shared_port::SharedPort;
use shared_port::{PendingStops, is_complete_stop};

const POLL_PERIOD: Nanos = Nanos::from_millis(2);

const OPEN_PERIOD: Nanos = Nanos::from_millis(100);

/// Wait of an unsupervised watchdog for its first port: without any, it watches nothing.
const FIRST_PORT: Nanos = Nanos::from_millis(10_000);

/// Stack of a thread that stops a port, bytes: all of it resident where memory is locked.
const STOP_STACK: usize = 256 * 1024;

/// Scheduling above every thread of the controller. Each thread requests it: none inherits it.
pub const REAL_TIME: SchedulingRequest =
    SchedulingRequest { priority: 90, cpu: None, lock_memory: false };

/// Every reply pending: it is unknown which drives answer.
const ALL_OWING: u8 = u8::MAX;

/// Default silence of the loop, or of the thread of a port, after which the watchdog acts. The
/// watchdog has priority over every controller thread, so 50 missed ticks are not its own delay.
pub const DEFAULT_SILENCE: Nanos = TAKE_OVER;

#[derive(Debug, Clone, Copy)]
pub struct Watched<'a> {
    pub config: &'a Config,
    pub domain: &'a Domain,
    pub presence: &'a WatchdogPresence,
    pub silence: Nanos,
}

/// Monitors the controller until `stop` is set. Passes every event to `report`. Returns whether it
/// ever held a port: on a terminal it ends without one.
pub fn run(watched: Watched<'_>, stop: &AtomicBool, report: &mut dyn FnMut(WatchdogEvent)) -> bool {
    let Watched { config, domain, presence, silence } = watched;
    let first_port = clock::now() + FIRST_PORT;
    let mut had_port = service_manager::is_supervised();
    let mut watch = Watch {
        ports: config.ports.iter().map(SharedPort::new).collect(),
        reader: HeartbeatReader::new(domain),
        monitor: HeartbeatMonitor::new(silence),
        presence,
    };
    let (mut next_open, mut was_complete) = (Nanos::ZERO, false);
    let mut unstopped = PendingStops::default();
    let pulse = config.watchdog.as_ref().map(|pulse| Pulse::start(pulse, silence));
    let mut pulse = pulse.and_then(|pulse| {
        pulse.map_err(|error| report(WatchdogEvent::Pulse(Some(error.to_string())))).ok()
    });
    while !stop.load(Ordering::Acquire) {
        let now = clock::now();
        if now >= next_open {
            next_open = now + OPEN_PERIOD;
            for event in watch.ports.iter_mut().filter_map(SharedPort::open) {
                report(event);
            }
            had_port |= watch.ports.iter().any(SharedPort::is_open);
            if !had_port && now > first_port {
                return false;
            }
            let is_complete = watch.ports.iter().all(SharedPort::is_open);
            if std::mem::replace(&mut was_complete, is_complete) != is_complete {
                // If the lock fails, clients see a watchdog that cannot act: the safe side.
                let _ = presence.set_complete(is_complete);
            }
            if is_complete {
                service_manager::notify(service_manager::READY);
            }
            watch.show_life(now);
        }
        let heartbeat = watch.reader.read();
        if let Some(pulse) = &mut pulse {
            pulse.update(heartbeat.ok().flatten(), clock::now());
            pulse.change().into_iter().for_each(|why| report(WatchdogEvent::Pulse(why)));
        }
        let status = watch.monitor.update(heartbeat, clock::now());
        match status {
            ControllerStatus::Absent => {}
            ControllerStatus::Alive => watch.stop_lost_ports(&mut unstopped, report),
            ControllerStatus::Started => {
                unstopped.clear();
                report(WatchdogEvent::Monitoring);
            }
            ControllerStatus::Ended => report(WatchdogEvent::ControllerEnded),
            ControllerStatus::Died | ControllerStatus::Hangs => {
                let lost = WatchdogEvent::ControllerLost(status, watch.monitor.age(clock::now()));
                let all = (0..watch.ports.len()).collect::<Vec<_>>();
                watch.stop(&all, vec![lost], &mut unstopped, report);
            }
        }
        if unstopped.is_due(now) {
            let due = (0..watch.ports.len()).filter(|&port| {
                unstopped.contains(watch.ports[port].device()) && watch.may_retry(port)
            });
            let due: Vec<usize> = due.collect();
            let mut stopped = watch.quick_stop(&due, ALL_OWING, 1);
            // A retry that fails does not extend the time of the retries.
            stopped.retain(is_complete_stop);
            unstopped.note(&stopped, clock::now());
            stopped.into_iter().for_each(&mut *report);
        }
        clock::sleep(POLL_PERIOD);
    }
    true
}

struct Watch<'a> {
    ports: Vec<SharedPort>,
    reader: HeartbeatReader,
    monitor: HeartbeatMonitor,
    presence: &'a WatchdogPresence,
}

impl Watch<'_> {
    fn show_life(&self, now: Nanos) {
        service_manager::notify(service_manager::ALIVE);
        // If this fails, clients see a silent watchdog: the safe side.
        let _ = self.presence.alive(now);
    }

    /// Whether a retry may transmit on a port: no controller uses it or is starting.
    fn may_retry(&mut self, port: usize) -> bool {
        match self.reader.read() {
            Ok(Some(beat)) => !self.monitor.has_port(port, &beat, clock::now()),
            Ok(None) => false,
            // As it is not, if the port is not open.
            Err(_) => self.ports[port].try_lock(),
        }
    }

    /// Stops the drives of the ports whose threads hang while the loop lives.
    fn stop_lost_ports(
        &mut self,
        unstopped: &mut PendingStops,
        report: &mut dyn FnMut(WatchdogEvent),
    ) {
        let lost = self.monitor.lost_ports(clock::now());
        let (mut ports, mut events) = (Vec::new(), Vec::new());
        for (port, (shared, age)) in self.ports.iter().zip(lost).enumerate() {
            if let Some(age) = age {
                ports.push(port);
                events.push(WatchdogEvent::PortLost(shared.device().to_owned(), age));
            }
        }
        if !ports.is_empty() {
            self.stop(&ports, events, unstopped, report);
        }
    }

    /// Sends quick stop to every axis of these ports before it reports.
    fn stop(
        &mut self,
        ports: &[usize],
        why: Vec<WatchdogEvent>,
        unstopped: &mut PendingStops,
        report: &mut dyn FnMut(WatchdogEvent),
    ) {
        let stopped = self.quick_stop(ports, self.monitor.newest.owing, STOP_ATTEMPTS);
        unstopped.note(&stopped, clock::now());
        why.into_iter().chain(stopped).for_each(report);
    }

    /// Stops the axes of several ports in parallel, with this many attempts, because a silent port
    /// takes seconds. Ends on a port as soon as the controller has it again.
    fn quick_stop(&mut self, which: &[usize], owing: u8, attempts: usize) -> Vec<WatchdogEvent> {
        let ports: Vec<(usize, &SharedPort, AtomicBool)> =
            which.iter().map(|&port| (port, &self.ports[port], AtomicBool::new(false))).collect();
        let reader = &mut self.reader;
        let (monitor, presence) = (&self.monitor, self.presence);
        thread::scope(|scope| {
            let stopping: Vec<_> = ports
                .iter()
                .map(|(_, port, is_over)| {
                    let thread = thread::Builder::new().stack_size(STOP_STACK);
                    let stop = || {
                        let _ = realtime::request(REAL_TIME);
                        port.quick_stop(owing, attempts, is_over)
                    };
                    // Without memory for a thread, one port after the other.
                    thread.spawn_scoped(scope, stop).map_err(|_| stop())
                })
                .collect();
            let mut next_alive = clock::now() + OPEN_PERIOD;
            while stopping.iter().flatten().any(|thread| !thread.is_finished()) {
                clock::sleep(POLL_PERIOD);
                let now = clock::now();
                if let Ok(Some(beat)) = reader.read() {
                    for (port, _, is_over) in &ports {
                        is_over.fetch_or(monitor.has_port(*port, &beat, now), Ordering::AcqRel);
                    }
                }
                if now >= next_alive {
                    next_alive = now + OPEN_PERIOD;
                    service_manager::notify(service_manager::ALIVE);
                    let _ = presence.alive(now);
                }
            }
            let events = stopping.into_iter().map(|stopping| match stopping {
                Ok(thread) => thread.join().ok(),
                Err(event) => Some(event),
            });
            events.flatten().collect()
        })
    }
}
