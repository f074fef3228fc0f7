//! A program on a terminal of any size: its output and typed input.

use std::fs::File;
use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::Domain;
use nix::pty::{OpenptyResult, Winsize, openpty};
use nix::sys::termios::{LocalFlags, tcgetattr};

use crate::program::{self, Killed};
use crate::waiting::{TIMEOUT, wait_until};

fn some(length: u16) -> NonZeroU16 {
    NonZeroU16::new(length).unwrap()
}

/// A program on a separate terminal, killed when dropped.
pub struct Terminal {
    process: Killed,
    keyboard: File,
    /// Kept open, so that its settings can be read after the program has ended.
    slave: File,
    output: Receiver<Vec<u8>>,
    pub screen: vt100::Parser,
}

impl Terminal {
    /// Starts `i2ris` with arguments on a terminal of the given rows and columns.
    pub fn start(domain: &Domain, arguments: &[&str], rows: u16, columns: u16) -> Self {
        let mut command = program::command(arguments);
        command.env("I2RIS_DOMAIN", domain.name());
        Self::run(command, rows, columns)
    }

    /// Runs a command on a terminal of the given rows and columns.
    pub fn run(mut command: Command, rows: u16, columns: u16) -> Self {
        command.env("TERM", "xterm-256color").env_remove("NO_COLOR");
        let size = Winsize { ws_row: rows, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
        let OpenptyResult { master, slave } = openpty(&size, None).unwrap();
        let other = || Stdio::from(slave.try_clone().unwrap());
        command.stdin(other()).stdout(other()).stderr(other());
        // SAFETY: both calls are async-signal-safe and touch no memory of the parent.
        unsafe {
            command.pre_exec(|| {
                nix::unistd::setsid()?;
                nix::errno::Errno::result(nix::libc::ioctl(0, nix::libc::TIOCSCTTY, 0))?;
                Ok(())
            });
        }
        let process = Killed::start(&mut command);
        let mut reader = File::from(master.try_clone().unwrap());
        let (sender, output) = channel();
        thread::spawn(move || {
            let mut chunk = [0; 4096];
            while let Ok(count @ 1..) = reader.read(&mut chunk) {
                if sender.send(chunk[..count].to_vec()).is_err() {
                    return;
                }
            }
        });
        let screen = vt100::Parser::new(some(rows), some(columns), 0);
        Self { process, keyboard: File::from(master), slave: File::from(slave), output, screen }
    }

    pub fn pid(&self) -> nix::unistd::Pid {
        nix::unistd::Pid::from_raw(i32::try_from(self.process.0.id()).unwrap())
    }

    /// Types keys. Once the program has ended, the terminal would fill, and a write wait forever.
    pub fn type_keys(&mut self, keys: &str) {
        if let Some(status) = self.process.0.try_wait().unwrap() {
            self.end();
            panic!("it ended ({status}):\n{}", self.screen.screen().contents());
        }
        self.keyboard.write_all(keys.as_bytes()).unwrap();
    }

    /// Waits until the screen shows something, and returns its content.
    pub fn wait(&mut self, what: &str, shown: impl Fn(&str) -> bool) -> String {
        let end = clock::now() + TIMEOUT;
        loop {
            let text = self.screen.screen().contents();
            if shown(&text) {
                return text;
            }
            assert!(clock::now() < end, "waited in vain: {what}\n{text}");
            match self.output.recv_timeout(Duration::from_millis(100)) {
                Ok(bytes) => self.screen.process(&bytes),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => panic!("it ended: {what}\n{text}"),
            }
        }
    }

    /// Waits for a word on the screen.
    pub fn wait_for(&mut self, word: &str) -> String {
        self.wait(word, |text| text.contains(word))
    }

    /// Waits for the end, and reads the output until then.
    pub fn end(&mut self) -> ExitStatus {
        let status = wait_until("the program ends", || self.process.0.try_wait().unwrap());
        while let Ok(bytes) = self.output.recv_timeout(Duration::from_millis(300)) {
            self.screen.process(&bytes);
        }
        status
    }

    /// Asserts that the terminal was restored: lines and echo, the first screen, a cursor.
    pub fn assert_restored(&self) {
        let flags = tcgetattr(self.slave.as_fd()).unwrap().local_flags;
        let lines = LocalFlags::ICANON | LocalFlags::ECHO;
        assert!(flags.contains(lines), "keys are shown and come in lines");
        assert!(!self.screen.screen().alternate_screen() && !self.screen.screen().hide_cursor());
    }
}
