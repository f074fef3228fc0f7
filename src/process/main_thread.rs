//! The main thread while the others run: writes the log and waits for the end.

use std::fmt;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};

use rtrb::Consumer;

use crate::clock;
use crate::core::{CycleEvent, CycleEventKind};
use crate::drive::event::{PortEvent, PortEventKind};
use crate::ipc::{Domain, find_client_process};
use crate::process::channels::LogLine;
use crate::process::run_log::RunLog;
use crate::process::threads::NamedThread;
use crate::units::Nanos;

/// Period of writing the log.
const LOG_PERIOD: Nanos = Nanos::from_millis(20);

/// Sources and destinations of log lines.
pub struct MainThread<'a> {
    pub events: Consumer<CycleEvent>,
    pub port_events: Receiver<PortEvent>,
    pub recorder_lines: Receiver<String>,
    pub run_log: RunLog,
    pub domain: Domain,
    pub boot_id: u64,
    pub log: &'a mut dyn Write,
    /// The same lines for the stream of events.
    pub published: Sender<LogLine>,
}

impl MainThread<'_> {
    /// Writes the log until the loop has ended. If another thread ends early, the loop shuts down.
    pub fn run(&mut self, control: &NamedThread, others: &[NamedThread], shutdown: &AtomicBool) {
        while !control.is_finished() {
            if others.iter().any(NamedThread::is_finished) {
                shutdown.store(true, Ordering::Release);
            }
            self.write_events();
            clock::sleep(LOG_PERIOD);
        }
    }

    /// Writes everything that has arrived.
    pub fn write_events(&mut self) {
        while let Ok(event) = self.port_events.try_recv() {
            // The loop reports phases, too, at the tick that acts on them.
            if !matches!(event.kind, PortEventKind::Phase { .. }) {
                let line = timed_line(format_args!("{event}"));
                self.write_text(line);
            }
        }
        while let Ok(event) = self.events.pop() {
            let client = self.lease_holder(&event);
            let caller = client.as_ref().map(|client| format!(": {client}"));
            self.write_text(format!("{event}{}", caller.unwrap_or_default()));
            // A full disk does not stop the robot.
            let _ = self.run_log.write_event(&event, client.as_deref());
        }
        while let Ok(line) = self.recorder_lines.try_recv() {
            let line = timed_line(format_args!("{line}"));
            self.write_text(line);
        }
        let _ = self.log.flush();
    }

    /// Writes a line into the log and the stream of events.
    fn write_text(&mut self, line: String) {
        let _ = writeln!(self.log, "{line}");
        // The IPC thread may have ended.
        let _ = self.published.send((clock::now(), line));
    }

    /// The process that has taken the lease.
    fn lease_holder(&self, event: &CycleEvent) -> Option<String> {
        let CycleEventKind::Lease { client_id } = event.kind else {
            return None;
        };
        let client = find_client_process(&self.domain, self.boot_id, client_id);
        client.map(|client| client.to_string())
    }
}

/// Writes one line with the time. A closed or full log does not stop the robot.
pub fn write_line(log: &mut dyn Write, line: fmt::Arguments<'_>) {
    let _ = writeln!(log, "{}", timed_line(line));
}

fn timed_line(line: fmt::Arguments<'_>) -> String {
    format!("[{:12.6}] {line}", clock::now().as_seconds())
}
