//! The programs of this build.

use std::fs;
use std::io::{PipeReader, PipeWriter};
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use i2ris::ipc::Domain;
use i2ris_report::programs;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

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
    assert!(
        path.exists(),
        "there is no {}: build all programs with `cargo build --workspace --bins`",
        path.display()
    );
    path
}

/// Runs an example of a package to its end; its standard output.
pub fn example(name: &str, arguments: &[&str]) -> String {
    let output = Command::new(path(&format!("examples/{name}"))).args(arguments).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

/// Runs `i2ris` with these arguments to its end, without input.
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
        Self(Some(
            command
                .stdin(Stdio::null())
                .stdout(Stdio::piped())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap(),
        ))
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

    /// Waits for the end: success, standard output, standard error.
    pub fn end(self) -> (bool, String, String) {
        let (code, output, error) = self.code();
        (code == Some(0), output, error)
    }

    /// Runs to the end.
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
