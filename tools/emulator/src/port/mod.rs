//! One serial port: a pseudo-terminal, the time that bytes take on a line, and the drive behind it.
//!
//! | file | holds |
//! |---|---|
//! | `pty` | the pseudo-terminal |
//! | `folder` | links of stable names to the pseudo-terminals |
//! | `wire` | when bytes arrive and replies leave |
//! | `shake` | the V1 frame |
//! | `mischief` | what befalls the bytes of one exchange |

mod folder;
mod mischief;
mod pty;
mod shake;
mod wire;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use i2ris::clock;
use i2ris::units::Nanos;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

pub use folder::FolderError;
pub(crate) use folder::PortFolder;
pub use wire::{Framing, LineConfig};

use crate::drive::Answer;
use crate::emulator::Shared;
use crate::frame::{self, Incoming, Parser};
use crate::log::{EventKind, HostBug, LineTrouble};
use mischief::Mischief;
use pty::Pty;
use shake::{FAILED, Heard, OKAY, Shake};
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
    shake: Shake,
    /// What befalls the present exchange.
    mischief: Mischief,
    /// The link of a stable name to the device.
    link: Option<PathBuf>,
    random: Pcg64Mcg,
    /// When the last byte arrived.
    last_byte: Nanos,
    /// In the present exchange, the host has been found not to wait.
    impatience_noted: bool,
    shared: Arc<Shared>,
}

impl Port {
    /// Opens the pseudo-terminal.
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
            wire: Wire::new(config),
            parser: Parser::default(),
            shake: Shake::default(),
            mischief: Mischief::default(),
            link: None,
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

    /// Tells the link that leads to the device.
    pub(crate) fn known_as(&mut self, link: &Path) {
        self.link = Some(link.to_owned());
    }

    /// Serves the host until the emulator ends.
    pub(crate) fn run(mut self) {
        let mut buffer = [0; 512];
        while !self.shared.stops() {
            if let Some(span) = self.shared.lines[self.axis].take_hang_up() {
                self.hang_up(span);
            }
            let before = clock::now();
            if self.pty.wait(LONGEST_NAP) {
                let count = self.pty.read(&mut buffer);
                let read = clock::now();
                self.take(buffer[..count].to_vec(), read, read - before > STALL);
            } else {
                self.rest(clock::now());
            }
        }
    }

    /// The cable is pulled, and comes back as another device.
    fn hang_up(&mut self, span: Nanos) {
        let until = clock::now() + span;
        if let Some(link) = &self.link {
            let _ = std::fs::remove_file(link);
        }
        self.pty.hang_up();
        self.reset_line();
        while clock::now() < until && !self.shared.stops() {
            clock::sleep_until(until.min(clock::now() + LONGEST_NAP));
        }
        // Without a pseudo-terminal to be had the port stays away, as it may in life.
        if let Ok(pty) = Pty::open() {
            self.pty = pty;
            if let Some(link) = &self.link {
                let _ = folder::point(link, self.pty.path());
            }
        }
    }

    fn reset_line(&mut self) {
        self.parser.reset();
        self.shake = Shake::default();
        self.impatience_noted = false;
    }

    /// Takes bytes that were read at `read`. After a stall of the machine, a host may have had to
    /// send again.
    fn take(&mut self, mut bytes: Vec<u8>, read: Nanos, stalled: bool) {
        self.drop_stale_frame(read);
        if self.is_between_frames() {
            self.mischief = Mischief(self.shared.lines[self.axis].take_mischief());
        }
        if self.config.strict_baud && !self.pty.is_at(self.config.baud) {
            // Every bit is taken at the wrong time.
            bytes
                .iter_mut()
                .for_each(|byte| *byte = byte.wrapping_mul(73).rotate_left(3) | 1);
        }
        match self.config.framing {
            Framing::V2 => {
                self.mischief.request(&mut bytes);
                self.take_frame(&bytes, read, stalled);
            }
            Framing::V1 => {
                // What befalls a request befalls what follows its opcode: the rest of it comes in
                // one piece.
                if matches!(self.shake, Shake::Rest { .. }) {
                    self.mischief.request(&mut bytes);
                }
                self.take_parts(&bytes, read);
            }
        }
    }

    fn take_frame(&mut self, bytes: &[u8], read: Nanos, stalled: bool) {
        for (place, byte) in bytes.iter().enumerate() {
            self.last_byte = self.wire.arrive(read);
            if let Some(incoming) = self.parser.push(*byte) {
                self.last_byte = self.wire.complete(read);
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

    fn take_parts(&mut self, bytes: &[u8], read: Nanos) {
        for byte in bytes {
            self.last_byte = self.wire.arrive(read);
            // A drive that boots hears nothing.
            if self.shared.world().drives[self.axis].is_deaf() {
                self.shake = Shake::default();
                continue;
            }
            match self.shake.push(*byte) {
                Heard::Nothing => {}
                Heard::Say(byte) => {
                    if byte == FAILED {
                        self.note(self.last_byte, EventKind::Line(LineTrouble::Crc));
                    }
                    self.send(vec![byte], self.last_byte);
                }
                Heard::Unasked => self.note_impatience(self.last_byte),
                Heard::Send(reply) => {
                    let mut reply = reply;
                    self.mischief.reply(&mut reply);
                    self.send(reply, self.last_byte + self.mischief.delay());
                    self.shared.lines[self.axis]
                        .replies
                        .fetch_add(1, Ordering::Relaxed);
                }
                Heard::Request(incoming) => {
                    self.last_byte = self.wire.complete(read);
                    self.send(vec![OKAY], self.last_byte);
                    if let Some((answer, ready)) = self.carry_out(&incoming, self.last_byte) {
                        self.shake.offer(&answer.data);
                        self.send(vec![0x00], ready);
                    }
                    self.impatience_noted = false;
                }
            }
        }
    }

    fn is_between_frames(&self) -> bool {
        match self.config.framing {
            Framing::V2 => !self.parser.is_partial(),
            Framing::V1 => self.shake == Shake::Idle,
        }
    }

    /// Carries a request out; the answer, and when it can go out. None: the host hears nothing.
    fn carry_out(&mut self, incoming: &Incoming, arrived: Nanos) -> Option<(Answer, Nanos)> {
        let answer = self.shared.world().answer(self.axis, incoming, arrived);
        let line = &self.shared.lines[self.axis];
        line.requests.fetch_add(1, Ordering::Relaxed);
        let mut answer = answer.filter(|_| !line.is_muted(clock::now()))?;
        answer.data = self.mischief.data(answer.data);
        let jitter = Nanos::from_micros(self.random.random_range(0..=self.config.jitter_us));
        let start = arrived + Nanos::from_micros(self.config.processing_us) + jitter + answer.delay;
        Some((answer, start))
    }

    /// One request, strictly: nothing is taken before the reply has gone out.
    fn exchange(&mut self, incoming: &Incoming, arrived: Nanos) {
        self.listen_for_impatience(arrived);
        let Some((answer, ready)) = self.carry_out(incoming, arrived) else {
            return;
        };
        let mut reply = frame::reply(&answer.data);
        self.mischief.reply(&mut reply);
        if let Some(stray) = self.mischief.stray() {
            reply.splice(0..0, frame::reply(&stray));
        }
        let late = self.mischief.delay();
        if late > Nanos::ZERO {
            // A host may rightly lose patience with this one.
            self.impatience_noted = true;
        }
        self.send(reply, ready + late);
        self.shared.lines[self.axis]
            .replies
            .fetch_add(1, Ordering::Relaxed);
    }

    /// Puts bytes on the line from `start` on, and hands them over when the last has arrived.
    fn send(&mut self, bytes: Vec<u8>, start: Nanos) {
        let end = self.wire.depart(start, bytes.len());
        let due = end + Nanos::from_millis(self.config.adapter_hold_ms);
        self.listen_for_impatience(due);
        self.pty.write(&bytes);
        self.wire.hand_over(due, clock::now());
    }

    /// Waits, and notices a host that sends before it has its reply. Its bytes are lost.
    fn listen_for_impatience(&mut self, until: Nanos) {
        loop {
            let now = clock::now();
            if now >= until {
                return;
            }
            if self.pty.wait((until - now).min(LONGEST_NAP)) {
                // If this thread was held up, the reply is late and the host may rightly have lost
                // patience.
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
        if !self.is_between_frames()
            && now - self.last_byte > self.shared.world().drives[self.axis].frame_timeout()
        {
            self.reset_line();
            self.note(now, EventKind::Line(LineTrouble::FrameTimeout));
        }
    }

    fn note(&self, stamp: Nanos, kind: EventKind) {
        self.shared.world().note(self.axis, stamp, kind);
    }
}
