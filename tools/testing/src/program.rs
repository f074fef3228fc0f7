//! The programs of this build, on a terminal where a test needs one, and a Python that
//! `#[needs("python: MODULES")]` has found.

use std::fs::{self, File};
use std::io::{PipeReader, PipeWriter, Read, Write};
use std::num::NonZeroU16;
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris_report::programs;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::{OpenptyResult, Winsize, openpty};
use nix::sys::signal::{Signal, kill};
use nix::sys::termios::{LocalFlags, tcgetattr};
use nix::unistd::Pid;

use crate::waiting::{TIMEOUT, wait_until};

/// `i2ris` with these arguments. A program that `i2ris` would only start is called directly, and so
/// is the controller as `control`.
pub fn command(arguments: &[&str]) -> Command {
    let (program, arguments) = match (programs::Program::of(arguments), arguments) {
        (Some((program, rest)), _) => (format!("i2ris-{}", program.name()), rest),
        (None, ["control", rest @ ..]) => ("i2ris-control".to_owned(), rest),
        (None, arguments) => ("i2ris".to_owned(), arguments),
    };
    let mut command = Command::new(path(&program));
    command.args(arguments);
    command
}

/// The file of a program of this build, next to the folder of the tests.
pub fn path(program: &str) -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let path = test.parent().unwrap().with_file_name(program);
    let remedy = "build all programs with `cargo build --workspace --bins`";
    assert!(path.exists(), "there is no {}: {remedy}", path.display());
    path
}

/// Runs an example of a package to its end; its standard output.
pub fn example(name: &str, arguments: &[&str]) -> String {
    let output = Command::new(path(&format!("examples/{name}"))).args(arguments).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

pub fn output(arguments: &[&str]) -> Output {
    command(arguments).stdin(Stdio::null()).output().unwrap()
}

/// A process that is killed and reaped on drop: iceoryx2 takes a zombie for alive.
pub struct Killed(pub Child);

impl Killed {
    pub fn start(command: &mut Command) -> Self {
        Self(command.spawn().unwrap())
    }

    /// Runs an ignored test of this binary, the role of another process, until it is killed.
    pub fn role(name: &str, environment: &[(&str, &str)]) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", name, "--ignored"]).envs(environment.iter().copied());
        Self::start(command.stdout(Stdio::null()).stderr(Stdio::null()))
    }

    pub fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(self.0.id() as i32), signal).unwrap();
    }
}

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Compiles a C library for preloading into a folder.
pub fn c_library(folder: &Path, source: &str) -> PathBuf {
    let [file, library] = ["preloaded.c", "preloaded.so"].map(|name| folder.join(name));
    fs::write(&file, source).unwrap();
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", "-o"]).args([&library, &file]);
    assert!(compiler.status().unwrap().success(), "a C compiler, as the README asks for");
    library
}

/// A pipe that is full; nothing reads it.
pub fn full_pipe() -> (PipeReader, PipeWriter) {
    let (reader, writer) = std::io::pipe().unwrap();
    let set_flags = |flags| fcntl(writer.as_fd(), FcntlArg::F_SETFL(flags)).unwrap();
    set_flags(OFlag::O_NONBLOCK);
    while nix::unistd::write(writer.as_fd(), &[b' '; 4096]).is_ok() {}
    while nix::unistd::write(writer.as_fd(), b" ").is_ok() {}
    set_flags(OFlag::empty());
    (reader, writer)
}

/// The program under test, killed if the test fails.
pub struct Program(Option<Child>);

impl Program {
    pub fn start(domain: &Domain, arguments: &[&str]) -> Self {
        Self::start_as(None, domain, arguments)
    }

    /// Runs as another user, which needs root.
    pub fn start_as(user: Option<u32>, domain: &Domain, arguments: &[&str]) -> Self {
        let mut command = command(arguments);
        command.env("I2RIS_DOMAIN", domain.name());
        if let Some(user) = user {
            command.uid(user).gid(user);
        }
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(Some(command.spawn().unwrap()))
    }

    pub fn child(&mut self) -> &mut Child {
        self.0.as_mut().unwrap()
    }

    pub fn interrupt(&mut self) {
        self.signal(Signal::SIGINT);
    }

    /// Suspends the process, as an overloaded machine would, until `resume`.
    pub fn pause(&mut self) {
        self.signal(Signal::SIGSTOP);
    }

    pub fn resume(&mut self) {
        self.signal(Signal::SIGCONT);
    }

    fn signal(&mut self, signal: Signal) {
        let pid = Pid::from_raw(i32::try_from(self.child().id()).unwrap());
        kill(pid, signal).unwrap();
    }

    /// Waits for the end: exit code, standard output, standard error.
    pub fn code(mut self) -> (Option<i32>, String, String) {
        let Output { status, stdout, stderr } = self.0.take().unwrap().wait_with_output().unwrap();
        (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
    }

    pub fn end(self) -> (bool, String, String) {
        let (code, output, error) = self.code();
        (code == Some(0), output, error)
    }

    pub fn run(domain: &Domain, arguments: &[&str]) -> (bool, String, String) {
        Self::start(domain, arguments).end()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

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
        let mut command = command(arguments);
        command.env("I2RIS_DOMAIN", domain.name());
        Self::run(command, rows, columns)
    }

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
        let [rows, columns] = [rows, columns].map(|length| NonZeroU16::new(length).unwrap());
        let screen = vt100::Parser::new(rows, columns, 0);
        Self { process, keyboard: File::from(master), slave: File::from(slave), output, screen }
    }

    pub fn pid(&self) -> Pid {
        Pid::from_raw(i32::try_from(self.process.0.id()).unwrap())
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

    pub fn wait_for(&mut self, word: &str) -> String {
        self.wait(word, |text| text.contains(word))
    }

    /// Waits for the end, and reads the output until then.
    pub fn end(&mut self) -> ExitStatus {
        let status = wait_until("the program ends", || self.process.0.try_wait().unwrap());
        while let Ok(bytes) = self.output.recv_timeout(Duration::from_millis(300)) {
            self.screen.process(&bytes);
        }
        eprintln!("{status}: {}", self.screen.screen().contents());
        status
    }

    /// Asserts that the terminal was restored: lines and echo, the first screen, a cursor.
    pub fn assert_restored(&self) {
        let flags = tcgetattr(self.slave.as_fd()).unwrap().local_flags;
        assert!(flags.contains(LocalFlags::ICANON | LocalFlags::ECHO), "echo, line by line");
        assert!(!self.screen.screen().alternate_screen() && !self.screen.screen().hide_cursor());
    }
}

/// The Python named by `I2RIS_PYTHON`, otherwise `python3`, in the folder of the Python package.
#[must_use]
pub fn python() -> Command {
    python_of("I2RIS_PYTHON")
}

/// A Python like [`python`], named by another variable.
fn python_of(variable: &str) -> Command {
    let name = std::env::var(variable).unwrap_or_else(|_| "python3".to_owned());
    let mut command = Command::new(name);
    command.current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../python"));
    command.env("PYTHONDONTWRITEBYTECODE", "1");
    command
}

/// Runs a script in Python; panics with its output when it fails.
pub fn run_python(script: &str, arguments: &[&str]) {
    run_python_of("I2RIS_PYTHON", script, arguments);
}

/// Runs like [`run_python`] in the Python named by a variable: some modules exclude each other.
pub fn run_python_of(variable: &str, script: &str, arguments: &[&str]) {
    let output =
        python_of(variable).args(["-c", script]).args(arguments).output().expect("Python starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
}
