//! The programs of this build.

use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

use i2ris::ipc::Domain;
use i2ris_report::programs;
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
    pub fn end(mut self) -> (bool, String, String) {
        let Output { status, stdout, stderr } = self.0.take().unwrap().wait_with_output().unwrap();
        (status.success(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
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
