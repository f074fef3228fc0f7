//! A line between controller and drive that corrupts bytes: a pseudo-terminal with a thread that
//! copies in both directions.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use i2ris_testing::Background;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;

/// See above. Ends on drop.
pub struct NoisyLine {
    /// The device for the controller.
    pub device: PathBuf,
    corrupted: Arc<AtomicU64>,
    noisy: Arc<AtomicBool>,
    _thread: Background,
    /// Keeps the pseudo-terminal from hanging up.
    _slave: OwnedFd,
}

impl NoisyLine {
    /// Corrupts one byte in `every`, in either direction, from [`NoisyLine::begin`] on.
    pub fn new(drive: &Path, every: u64) -> Self {
        let pty = openpty(None, None).unwrap();
        let device = ttyname(&pty.slave).unwrap();
        let flags = (OFlag::O_NONBLOCK | OFlag::O_NOCTTY).bits();
        let mut options = OpenOptions::new();
        let mut drive = options.read(true).write(true).custom_flags(flags).open(drive).unwrap();
        make_raw(&pty.slave);
        make_raw(&drive);
        fcntl(&pty.master, FcntlArg::F_SETFL(OFlag::O_NONBLOCK)).unwrap();
        let mut host = File::from(pty.master);
        let (corrupted, noisy) = <(Arc<AtomicU64>, Arc<AtomicBool>)>::default();
        let mut noise = Noise {
            every,
            state: 0x2545_F491_4F6C_DD1D,
            corrupted: Arc::clone(&corrupted),
            noisy: Arc::clone(&noisy),
        };
        let thread = Background::start(move |stop| {
            while !stop.load(Ordering::Relaxed) {
                let moved = noise.copy(&mut host, &mut drive) + noise.copy(&mut drive, &mut host);
                if moved == 0 {
                    std::thread::sleep(Duration::from_micros(200));
                }
            }
        });
        Self { device, corrupted, noisy, _thread: thread, _slave: pty.slave }
    }

    /// Starts the noise.
    pub fn begin(&self) {
        self.noisy.store(true, Ordering::Relaxed);
    }

    /// Number of corrupted bytes.
    pub fn corrupted(&self) -> u64 {
        self.corrupted.load(Ordering::Relaxed)
    }
}

fn make_raw(terminal: &impl AsFd) {
    let mut settings = tcgetattr(terminal).unwrap();
    cfmakeraw(&mut settings);
    tcsetattr(terminal, SetArg::TCSANOW, &settings).unwrap();
}

struct Noise {
    every: u64,
    state: u64,
    corrupted: Arc<AtomicU64>,
    noisy: Arc<AtomicBool>,
}

impl Noise {
    fn copy(&mut self, from: &mut File, to: &mut File) -> usize {
        let mut bytes = [0; 256];
        let Ok(count) = from.read(&mut bytes) else {
            return 0;
        };
        let bytes = &mut bytes[..count];
        for byte in bytes.iter_mut() {
            *byte = self.corrupt(*byte);
        }
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            let written = to.write(rest).unwrap_or(0);
            rest = &rest[written..];
        }
        count
    }

    /// Xorshift (G. Marsaglia 2003): the same noise in every run.
    fn corrupt(&mut self, byte: u8) -> u8 {
        self.state ^= self.state << 13;
        self.state ^= self.state >> 7;
        self.state ^= self.state << 17;
        if !self.state.is_multiple_of(self.every) || !self.noisy.load(Ordering::Relaxed) {
            return byte;
        }
        self.corrupted.fetch_add(1, Ordering::Relaxed);
        byte ^ (1 << (self.state >> 32 & 7))
    }
}
