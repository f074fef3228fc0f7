//! One serial port: a pseudo-terminal, the timing of the line, and its drive.
//!
//! | file | content |
//! |---|---|
//! | `pty` | the pseudo-terminal; links with stable names |
//! | `line_timing` | arrival of bytes, completion of replies |

pub(super) mod line_timing;
mod pty;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use i2ris::clock;
use i2ris::units::Nanos;

pub use line_timing::LineConfig;
pub use pty::FolderError;
pub(crate) use pty::PortFolder;

use crate::drive::event::{EventKind, HostBug, LineTrouble};
use crate::drive::frame::{self, Incoming, Parser};
use crate::emulator::injection::Injection;
use crate::emulator::shared::{Line, Shared};
pub(crate) use line_timing::LineTiming;
use pty::{Pty, redirect};

/// Maximum sleep before the thread checks for the end.
const POLL: Nanos = Nanos::from_millis(20);
/// A thread that slept longer than this was delayed by the machine.
const STALL: Nanos = Nanos::from_millis(30);

pub(crate) struct Port {
    /// Axis of the drive with the port.
    axis: usize,
    pty: Pty,
    config: LineConfig,
    timing: LineTiming,
    parser: Parser,
    /// The injected fault of the present exchange.
    fault: Option<Injection>,
    /// The link with a stable name to the device.
    pub(super) link: PathBuf,
    /// Arrival of the last byte.
    last_byte: Nanos,
    /// An early byte of the present exchange has been logged.
    early_byte_logged: bool,
    shared: Arc<Shared>,
}

impl Port {
    pub(crate) fn open(
        axis: usize,
        config: &LineConfig,
        seed: u64,
        shared: Arc<Shared>,
    ) -> io::Result<Self> {
        Ok(Self {
            axis,
            pty: Pty::open()?,
            config: config.clone(),
            timing: LineTiming::new(config, seed),
            parser: Parser::default(),
            fault: None,
            link: PathBuf::new(),
            last_byte: Nanos::ZERO,
            early_byte_logged: false,
            shared,
        })
    }

    /// The device file.
    pub(crate) fn path(&self) -> &Path {
        self.pty.path()
    }

    /// Serves the host until the emulator ends.
    pub(crate) fn run(mut self) {
        let mut buffer = [0; 512];
        while !self.shared.is_stopping() {
            if let Some(span) = self.line().take_hang_up() {
                self.hang_up(span);
            }
            let before = clock::now();
            if self.pty.wait(POLL) {
                let count = self.pty.read(&mut buffer);
                let read = clock::now();
                self.receive(buffer[..count].to_vec(), read, read - before > STALL);
            } else {
                self.drop_stale_frame(clock::now());
                if self.pty.is_closed() {
                    clock::sleep(POLL);
                }
            }
        }
    }

    /// Closes the pseudo-terminal as if the cable was pulled, then opens a new one.
    fn hang_up(&mut self, span: Nanos) {
        let until = clock::now() + span;
        let _ = std::fs::remove_file(&self.link);
        self.pty.hang_up();
        self.reset_line();
        while clock::now() < until && !self.shared.is_stopping() {
            clock::sleep_until(until.min(clock::now() + POLL));
        }
        // If no pseudo-terminal is left, the port stays closed, as on a real machine.
        if let Ok(pty) = Pty::open() {
            self.pty = pty;
            let _ = redirect(&self.link, self.pty.path());
        }
    }

    fn line(&self) -> &Line {
        self.shared.line(self.axis)
    }

    fn reset_line(&mut self) {
        self.parser.reset();
        self.early_byte_logged = false;
    }

    /// Takes bytes that were read at `read`. After a stall the host may have had to repeat them.
    fn receive(&mut self, mut bytes: Vec<u8>, read: Nanos, stalled: bool) {
        self.drop_stale_frame(read);
        self.timing.wait_for_frame(read);
        if !self.parser.is_partial() {
            self.fault = self.line().take_exchange_fault();
        }
        if self.config.strict_baud && !self.pty.has_baud_rate(self.config.baud) {
            // Every bit is sampled at the wrong time.
            for byte in &mut bytes {
                *byte = byte.wrapping_mul(73).rotate_left(3) | 1;
            }
        }
        if let Some(fault) = self.fault {
            fault.damage(&mut bytes, false);
        }
        self.receive_frame(&bytes, read, stalled);
    }

    fn receive_frame(&mut self, bytes: &[u8], read: Nanos, stalled: bool) {
        for (index, byte) in bytes.iter().enumerate() {
            self.last_byte = self.timing.arrive(read);
            if let Some(incoming) = self.parser.push(*byte) {
                self.last_byte = self.timing.complete(read);
                if index + 1 < bytes.len() && !stalled {
                    self.log_early_byte(self.last_byte);
                }
                self.exchange(&incoming, self.last_byte);
                self.early_byte_logged = false;
                // The drive does not receive the bytes after the frame.
                return;
            }
        }
    }

    /// Executes one request. Bytes are ignored until the reply is complete.
    fn exchange(&mut self, incoming: &Incoming, arrived: Nanos) {
        self.watch_for_early_bytes(arrived);
        let reply = self.shared.plant().reply(self.axis, incoming, arrived);
        self.line().requests.fetch_add(1, Ordering::Relaxed);
        let Some(reply) = reply.filter(|_| !self.line().is_muted(clock::now())) else {
            return;
        };
        let mut start = self.timing.process(arrived, reply.delay);
        let is_wrong = self.fault == Some(Injection::WrongLength);
        let mut bytes = frame::reply(if is_wrong { &[0x22, 0, 0, 8, 0, 0] } else { &reply.data });
        if let Some(fault) = self.fault {
            fault.damage(&mut bytes, true);
        }
        if self.fault == Some(Injection::StrayReply) {
            bytes.splice(0..0, frame::reply(&[0, 0, 0, 0, 9, 9, 0, 0]));
        }
        if let Some(Injection::LateReply { delay_ms: delay_ms @ 1.. }) = self.fault {
            // The timeout of the host may expire.
            self.early_byte_logged = true;
            start = start + Nanos::from_millis(delay_ms);
        }
        let due = self.timing.reply(start, bytes.len());
        self.watch_for_early_bytes(due);
        self.pty.write(&bytes);
        self.timing.hand_over(due, clock::now());
        self.line().replies.fetch_add(1, Ordering::Relaxed);
    }

    /// Waits, and detects a host that sends before it has its reply. Its bytes are lost.
    fn watch_for_early_bytes(&mut self, until: Nanos) {
        loop {
            let now = clock::now();
            if now >= until {
                return;
            }
            if self.pty.wait((until - now).min(POLL)) {
                // If this thread was delayed, the timeout of the host may have expired.
                if clock::now() >= until {
                    return;
                }
                if self.pty.read(&mut [0; 512]) > 0 {
                    self.log_early_byte(now);
                }
            } else if self.shared.is_stopping() {
                return;
            } else if self.pty.is_closed() {
                clock::sleep_until(until.min(now + POLL));
            }
        }
    }

    /// Logs an early byte once per exchange.
    fn log_early_byte(&mut self, stamp: Nanos) {
        if !std::mem::replace(&mut self.early_byte_logged, true) {
            self.log(stamp, EventKind::HostBug(HostBug::Pipelined));
        }
    }

    /// Drops a frame that is not complete in time, without a reply (object 0x2005).
    fn drop_stale_frame(&mut self, now: Nanos) {
        let timeout = || self.shared.plant().drives[self.axis].frame_timeout();
        if self.parser.is_partial() && now - self.last_byte > timeout() {
            self.reset_line();
            self.log(now, EventKind::Line(LineTrouble::FrameTimeout));
        }
    }

    fn log(&self, stamp: Nanos, kind: EventKind) {
        self.shared.plant().log(self.axis, stamp, kind);
    }
}
