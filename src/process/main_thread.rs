//! The main thread while the others run: writes the log, waits for the end and ends the others.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};

use rtrb::Consumer;

use crate::clock;
use crate::core::{CycleEvent, CycleEventKind};
use crate::drive::event::{PortEvent, PortEventKind};
use crate::ipc::heartbeat::Heartbeat;
use crate::ipc::payload::{EventMsg, padded_text};
use crate::ipc::watchdog_presence::{PortsDigest, WatchdogStatus};
use crate::ipc::{Domain, StreamMessage, find_client_process};
use crate::process::run_log::{RunLog, stamped_line};
use crate::process::threads::{NamedThread, ThreadError, Threads};
use crate::realtime::SuspendMonitor;
use crate::robot::{Cause, DrivePower, Reason, Stop};
use crate::units::Nanos;

const LOG_PERIOD: Nanos = Nanos::from_millis(20);
/// Polling period of the watchdog status and of the files that clients need.
const WATCHDOG_PERIOD: Nanos = Nanos::from_millis(100);
/// Time for the other threads to end after the loop, including writing the black box.
const END_TIMEOUT: Nanos = Nanos::from_millis(10_000);

pub(super) struct MainThread<'a> {
    pub events: Consumer<CycleEvent>,
    /// Events of the ports, with their times.
    pub port_events: Receiver<(Nanos, PortEvent)>,
    pub recorder_lines: Receiver<String>,
    pub run_log: RunLog,
    pub domain: Domain,
    /// Ports that a watchdog must have open.
    pub ports: PortsDigest,
    pub was_watched: bool,
    /// Motors whose drives have not confirmed power-off at the end.
    pub powered: Vec<usize>,
    pub boot_id: u64,
    pub log: &'a mut dyn Write,
    /// The same lines for the event stream, and the reasons.
    pub published: Sender<StreamMessage>,
}

impl MainThread<'_> {
    /// Writes the log until the loop has ended. If another thread ends early, the loop shuts down.
    pub(super) fn run(&mut self, threads: &Threads, shutdown: &AtomicBool) {
        let mut suspends = SuspendMonitor::start();
        let (mut next_watchdog, mut had_files) = (Nanos::ZERO, true);
        while !threads.control.is_finished() {
            if threads.ports.iter().chain(&threads.others).any(NamedThread::is_finished) {
                shutdown.store(true, Ordering::Release);
            }
            if let Some(slept) = suspends.update(clock::suspended()) {
                let (slept_s, now) = (slept.as_seconds(), clock::now());
                let line = format_args!("the computer was suspended for {slept_s:.1} s");
                self.write_text(stamped_line(now, line));
            }
            self.write_events();
            let now = clock::now();
            if now >= next_watchdog {
                next_watchdog = now + WATCHDOG_PERIOD;
                self.report_lost_watchdog(now);
                let has_files = self.domain.has_files(self.boot_id);
                if std::mem::replace(&mut had_files, has_files) && !has_files {
                    let line = format_args!(
                        "files of this domain in /dev/shm were removed: no new client can connect, \
                         not even to stop the robot; restart this controller"
                    );
                    self.write_text(stamped_line(now, line));
                }
            }
            clock::sleep(LOG_PERIOD);
        }
    }

    /// Reports once that a watchdog ended, hung or lost a port; no motion depends on it.
    fn report_lost_watchdog(&mut self, now: Nanos) {
        let status = WatchdogStatus::read(&self.domain, &self.ports, now);
        let is_watched = status == WatchdogStatus::Watching;
        if std::mem::replace(&mut self.was_watched, is_watched) && !is_watched {
            let reason = Reason::from(Cause::Stop(Stop::Watchdog));
            let what = match status {
                WatchdogStatus::Absent | WatchdogStatus::Watching => "it has ended",
                WatchdogStatus::Silent => "it hung or is suspended",
                WatchdogStatus::OtherPorts => "it has a different configuration of ports and axes",
                WatchdogStatus::Incomplete => "it does not hold every port",
            };
            let line = format_args!("{}: {what}; action: {}", reason.text(), reason.cause.advice());
            self.write_text(stamped_line(now, line));
            let _ = self.published.send(StreamMessage::of_reason(&reason, 0, now));
        }
    }

    pub(super) fn write_events(&mut self) {
        let mut lines: Vec<(Nanos, String)> = Vec::new();
        while let Ok((stamp, event)) = self.port_events.try_recv() {
            if let PortEventKind::Ended(power) = event.kind
                && power == DrivePower::Off
            {
                self.powered.retain(|motor| *motor != event.motor);
            }
            // The loop also reports phases, at the tick that acts on them.
            if !matches!(event.kind, PortEventKind::Phase { .. }) {
                lines.push((stamp, event.to_string()));
            }
        }
        while let Ok(event) = self.events.pop() {
            let client = match event.kind {
                CycleEventKind::Lease { client_id } => {
                    find_client_process(&self.domain, self.boot_id, client_id)
                }
                _ => None,
            };
            let client = client.map(|client| client.to_string());
            lines.push(match &client {
                Some(client) => (event.stamp, format!("{event}: {client}")),
                None => (event.stamp, event.to_string()),
            });
            if let Some(reason) = event.reason() {
                lines.push((event.stamp, format!("action: {}", reason.cause.advice())));
                let (client_id, stamp) = (event.kind.client_id(), event.stamp);
                let _ = self.published.send(StreamMessage::of_reason(&reason, client_id, stamp));
            }
            // A full disk does not stop the robot.
            let _ = self.run_log.write_event(&event, client.as_deref());
        }
        while let Ok(line) = self.recorder_lines.try_recv() {
            lines.push((clock::now(), line));
        }
        // Lines of several threads, in the order of their times.
        lines.sort_by_key(|(stamp, _)| *stamp);
        for (stamp, line) in lines {
            self.write_text(stamped_line(stamp, format_args!("{line}")));
        }
        let _ = self.log.flush();
    }

    fn write_text(&mut self, line: String) {
        let _ = writeln!(self.log, "{line}");
        // The IPC thread may have ended.
        let message =
            EventMsg { stamp_ns: clock::now().0, text: padded_text(&line), ..EventMsg::default() };
        let _ = self.published.send(StreamMessage::Events(message));
    }
}

impl Threads {
    /// Waits for the loop, ends the other threads, and writes their last events. Returns the result
    /// and the end of the threads.
    pub(super) fn end(self, main: &mut MainThread<'_>) -> (Result<(), ThreadError>, RunEnd) {
        let mut ended = self.control.join();
        let end = clock::now() + END_TIMEOUT;
        self.quit_ports.store(true, Ordering::Release);
        // The port threads need heartbeats to transmit, and the loop no longer sends any.
        let beat = |stamp| self.beats.write(Heartbeat { stamp, ..Heartbeat::default() });
        for port in self.ports {
            ended = ended.and(port.join_until(end, beat));
        }
        main.write_events();
        if main.powered.is_empty() {
            let last = Heartbeat { stamp: clock::now(), off: true, ..Heartbeat::default() };
            self.beats.write(last);
        }
        self.quit.store(true, Ordering::Release);
        for thread in self.others {
            ended = ended.and(thread.join_until(end, |_| ()));
        }
        main.write_events();
        let end = match (main.powered.is_empty(), &ended) {
            (true, Ok(())) => RunEnd::Clean,
            (true, Err(_)) => RunEnd::ThreadFailed,
            (false, _) => RunEnd::Powered,
        };
        (ended, end)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RunEnd {
    Clean,
    ThreadFailed,
    /// Drives have not confirmed power-off.
    Powered,
}

impl RunEnd {
    pub(super) fn text(self) -> &'static str {
        match self {
            Self::Clean => "clean shutdown",
            Self::ThreadFailed => "a thread ended early, or did not end",
            Self::Powered => "drives have not confirmed power-off",
        }
    }
}
