//! One serial port: a pseudo-terminal, the time that bytes take on a line, and the drive behind it.
//!
//! | file | holds |
//! |---|---|
//! | `pty` | the pseudo-terminal |
//! | `folder` | links of stable names to the pseudo-terminals |
//! | `wire` | when bytes arrive and replies leave |

mod folder;
mod pty;
mod wire;

use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use i2ris::clock;
use i2ris::units::Nanos;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

pub use folder::FolderError;
pub(crate) use folder::PortFolder;
pub use wire::LineConfig;

use crate::emulator::Shared;
use crate::frame::{Incoming, Parser};
use crate::log::{EventKind, HostBug, LineTrouble};
use pty::Pty;
use wire::Wire;

/// How long a thread sleeps at most before it looks whether it shall end.
const LONGEST_NAP: Nanos = Nanos::from_millis(20);

/// A thread that slept longer than this was held up by the machine.
const STALL: Nanos = Nanos::from_millis(30);

/// Silence after which a host is taken to have let go of the port.
const LET_GO: Nanos = Nanos::from_millis(200);

/// A port that serves one axis.
pub(crate) struct Port {
    axis: usize,
    pty: Pty,
    config: LineConfig,
    wire: Wire,
    parser: Parser,
    random: Pcg64Mcg,
    /// When the last byte arrived.
    last_byte: Nanos,
    /// In the present exchange, the host has been found not to wait.
    impatience_noted: bool,
    shared: Arc<Shared>,
}

impl Port {
    /// Opens the pseudo-terminal.
    pub(crate) fn open(axis: usize, config: &LineConfig, seed: u64, shared: Arc<Shared>) -> io::Result<Self> {
        Ok(Self {
            axis,
            pty: Pty::open()?,
            config: config.clone(),
            wire: Wire::new(config),
            parser: Parser::default(),
            random: Pcg64Mcg::seed_from_u64(seed),
            last_byte: Nanos::ZERO,
            impatience_noted: false,
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
        while !self.shared.stops() {
            let before = clock::now();
            if self.pty.wait(LONGEST_NAP) {
                let count = self.pty.read(&mut buffer);
                let read = clock::now();
                self.take(&buffer[..count], read, read - before > STALL);
            } else {
                self.rest(clock::now());
            }
        }
    }

    /// Takes bytes that were read at `read`. After a stall of the machine, a host may have had to send again.
    fn take(&mut self, bytes: &[u8], read: Nanos, stalled: bool) {
        self.drop_stale_frame(read);
        for (place, byte) in bytes.iter().enumerate() {
            self.last_byte = self.wire.arrive(read);
            if let Some(incoming) = self.parser.push(*byte) {
                if place + 1 < bytes.len() && !stalled {
                    self.note_impatience(self.last_byte);
                }
                self.exchange(&incoming, self.last_byte);
                self.impatience_noted = false;
                // What came behind the frame found a drive that does not listen.
                return;
            }
        }
    }

    /// One request, strictly: nothing is taken before the reply has gone out.
    fn exchange(&mut self, incoming: &Incoming, arrived: Nanos) {
        self.listen_for_impatience(arrived);
        let answer = self.shared.world().answer(self.axis, incoming, arrived);
        let line = &self.shared.lines[self.axis];
        line.requests.fetch_add(1, Ordering::Relaxed);
        let Some(answer) = answer.filter(|_| !line.muted.load(Ordering::Relaxed)) else { return };
        let jitter = Nanos::from_micros(self.random.random_range(0..=self.config.jitter_us));
        let start = arrived + Nanos::from_micros(self.config.processing_us) + jitter + answer.delay;
        let end = self.wire.depart(start, answer.frame.len());
        self.listen_for_impatience(end + Nanos::from_millis(self.config.adapter_hold_ms));
        self.pty.write(&answer.frame);
        self.shared.lines[self.axis].replies.fetch_add(1, Ordering::Relaxed);
    }

    /// Waits, and notices a host that sends before it has its reply. Its bytes are lost.
    fn listen_for_impatience(&mut self, until: Nanos) {
        loop {
            let now = clock::now();
            if now >= until {
                return;
            }
            if self.pty.wait((until - now).min(LONGEST_NAP)) {
                // If this thread was held up, the reply is late and the host may rightly have lost patience.
                if clock::now() >= until {
                    return;
                }
                if self.pty.read(&mut [0; 512]) > 0 {
                    self.note_impatience(now);
                }
            } else if self.shared.stops() {
                return;
            }
        }
    }

    /// Once an exchange, in however many pieces the bytes come.
    fn note_impatience(&mut self, stamp: Nanos) {
        if !std::mem::replace(&mut self.impatience_noted, true) {
            self.note(stamp, EventKind::HostBug(HostBug::Pipelined));
        }
    }

    fn rest(&mut self, now: Nanos) {
        self.drop_stale_frame(now);
        if now - self.last_byte > LET_GO {
            self.pty.release();
        }
    }

    /// A frame that is not completed in time is dropped without an answer (object 0x2005).
    fn drop_stale_frame(&mut self, now: Nanos) {
        if self.parser.is_partial() && now - self.last_byte > self.shared.world().drives[self.axis].frame_timeout() {
            self.parser.reset();
            self.note(now, EventKind::Line(LineTrouble::FrameTimeout));
        }
    }

    fn note(&self, stamp: Nanos, kind: EventKind) {
        self.shared.world().note(self.axis, stamp, kind);
    }
}
