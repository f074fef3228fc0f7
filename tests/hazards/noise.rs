//! A line between controller and drive that spoils bytes: a pseudo-terminal with a thread that
//! copies in both directions.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;

/// See above. Ends with its test.
pub struct NoisyLine {
    /// What the controller opens.
    pub device: PathBuf,
    spoilt: Arc<AtomicU64>,
    noisy: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Open as long as the line, or the pseudo-terminal hangs up.
    _end: OwnedFd,
}

impl NoisyLine {
    /// Will spoil one byte in `every`, in either direction, from [`NoisyLine::begin`] on.
    pub fn on(drive: &Path, every: u64) -> Self {
        let pty = openpty(None, None).unwrap();
        let mut settings = tcgetattr(&pty.slave).unwrap();
        cfmakeraw(&mut settings);
        tcsetattr(&pty.slave, SetArg::TCSANOW, &settings).unwrap();
        let device = ttyname(&pty.slave).unwrap();
        let drive = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(0o4000 | 0o400)
            .open(drive)
            .unwrap();
        let mut settings = tcgetattr(&drive).unwrap();
        cfmakeraw(&mut settings);
        tcsetattr(&drive, SetArg::TCSANOW, &settings).unwrap();
        let (spoilt, noisy, stop) = <(Arc<AtomicU64>, Arc<AtomicBool>, Arc<AtomicBool>)>::default();
        let mut noise = Noise {
            every,
            state: 0x2545_F491_4F6C_DD1D,
            spoilt: Arc::clone(&spoilt),
            noisy: Arc::clone(&noisy),
        };
        let (flag, mut host, mut drive) = (Arc::clone(&stop), File::from(pty.master), drive);
        nix::fcntl::fcntl(
            &host,
            nix::fcntl::FcntlArg::F_SETFL(nix::fcntl::OFlag::O_NONBLOCK),
        )
        .unwrap();
        let thread = std::thread::spawn(move || {
            while !flag.load(Ordering::Relaxed) {
                let moved = noise.copy(&mut host, &mut drive) + noise.copy(&mut drive, &mut host);
                if moved == 0 {
                    std::thread::sleep(Duration::from_micros(200));
                }
            }
        });
        Self {
            device,
            spoilt,
            noisy,
            stop,
            thread: Some(thread),
            _end: pty.slave,
        }
    }

    /// From now on it is noisy.
    pub fn begin(&self) {
        self.noisy.store(true, Ordering::Relaxed);
    }

    /// Bytes spoilt so far.
    pub fn spoilt(&self) -> u64 {
        self.spoilt.load(Ordering::Relaxed)
    }
}

impl Drop for NoisyLine {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

struct Noise {
    every: u64,
    state: u64,
    spoilt: Arc<AtomicU64>,
    noisy: Arc<AtomicBool>,
}

impl Noise {
    fn copy(&mut self, from: &mut File, to: &mut File) -> usize {
        let mut bytes = [0; 256];
        let Ok(count) = from.read(&mut bytes) else {
            return 0;
        };
        let bytes = &mut bytes[..count];
        bytes.iter_mut().for_each(|byte| *byte = self.spoil(*byte));
        let mut rest = &bytes[..];
        while let Some(written) = (!rest.is_empty()).then(|| to.write(rest).unwrap_or(0)) {
            rest = &rest[written..];
        }
        count
    }

    /// Xorshift (G. Marsaglia 2003): the same noise in every run.
    fn spoil(&mut self, byte: u8) -> u8 {
        self.state ^= self.state << 13;
        self.state ^= self.state >> 7;
        self.state ^= self.state << 17;
        if !self.state.is_multiple_of(self.every) || !self.noisy.load(Ordering::Relaxed) {
            return byte;
        }
        self.spoilt.fetch_add(1, Ordering::Relaxed);
        byte ^ (1 << (self.state >> 32 & 7))
    }
}
