//! Child processes that end with this one.

use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use nix::sys::prctl::set_pdeathsig;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::Failure;

/// Time limit for a child to end after SIGTERM: the controller switches the drives off first.
const END_TIMEOUT: Duration = Duration::from_secs(10);

/// A program that is ended when this is dropped.
pub struct Process {
    name: &'static str,
    child: Child,
    log: PathBuf,
}

impl Process {
    /// Starts a program, writing what it prints to `NAME.log` in `folder`.
    pub fn start(
        name: &'static str,
        command: &mut Command,
        folder: &Path,
    ) -> Result<Self, Failure> {
        let log = folder.join(format!("{name}.log"));
        let output = File::options().create(true).append(true).open(&log)?;
        command
            .stdin(Stdio::null())
            // Ctrl-C is for the parent, which ends its children in sequence.
            .process_group(0)
            .stderr(output.try_clone()?)
            .stdout(output);
        // SAFETY: prctl is async-signal-safe and touches no memory of the parent.
        unsafe { command.pre_exec(|| Ok(set_pdeathsig(Signal::SIGTERM)?)) };
        let child = command.spawn().map_err(|error| {
            format!("cannot start {}: {error}", command.get_program().to_string_lossy())
        })?;
        Ok(Self { name, child, log })
    }

    /// Checks that the child runs. Fails if it has ended, with the last lines of its output.
    pub fn check(&mut self) -> Result<(), Failure> {
        self.child.try_wait()?.map_or(Ok(()), |status| Err(self.failure(status)))
    }

    /// Whether the child has ended with success. Fails if it ended otherwise.
    pub fn finished(&mut self) -> Result<bool, Failure> {
        match self.child.try_wait()? {
            Some(status) if !status.success() => Err(self.failure(status)),
            status => Ok(status.is_some()),
        }
    }

    /// Ends the child with SIGTERM and waits. Fails if it does not end, or its exit code is not 0.
    pub fn end(mut self) -> Result<(), Failure> {
        self.terminate();
        match self.wait()? {
            Some(status) if status.success() => Ok(()),
            Some(status) => Err(self.failure(status)),
            None => {
                let (name, seconds) = (self.name, END_TIMEOUT.as_secs());
                Err(format!("{name} did not end within {seconds} s of SIGTERM").into())
            }
        }
    }

    pub fn kill(mut self) -> Result<(), Failure> {
        self.child.kill()?;
        self.child.wait()?;
        Ok(())
    }

    fn terminate(&self) {
        // The child may have ended already.
        let _ = kill(Pid::from_raw(self.child.id() as i32), Signal::SIGTERM);
    }

    fn wait(&mut self) -> Result<Option<ExitStatus>, Failure> {
        let deadline = Instant::now() + END_TIMEOUT;
        while Instant::now() < deadline {
            if let Some(status) = self.child.try_wait()? {
                return Ok(Some(status));
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(None)
    }

    fn failure(&self, status: ExitStatus) -> Failure {
        let text = fs::read_to_string(&self.log).unwrap_or_default();
        let lines: Vec<&str> = text.lines().collect();
        let tail = lines[lines.len().saturating_sub(8)..].join("\n  ");
        format!("{} ended early ({status}); its last lines:\n  {tail}", self.name).into()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            self.terminate();
            if matches!(self.wait(), Ok(None) | Err(_)) {
                let _ = self.child.kill();
            }
        }
        let _ = self.child.wait();
    }
}
