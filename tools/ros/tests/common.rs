//! Emulated drives and a controller on them, and `i2ris-ros` as a process.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;

use i2ris::ipc::Domain;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris_testing::{Killed, Rig, wait_until, wait_until_idle};
use nix::sys::signal::Signal;

use crate::peer::{Peer, ros_domain};

pub const ROBOT: &str = "i2ris";

/// A robot that is neither homed nor enabled. Half the rate leaves time for six at once.
pub fn robot() -> Rig {
    let mut rig = Rig::with_model();
    rig.config.control.rate_hz = 500;
    rig.start_controller_thread();
    wait_until_idle(&mut rig.client());
    rig
}

/// Waits for a state of the robot, as seen by a client in shared memory.
pub fn wait_for(rig: &mut Rig, wanted: impl Fn(&OperatingStateMsg) -> bool) -> OperatingStateMsg {
    i2ris_testing::wait_for(&mut rig.client(), wanted)
}

/// A robot, its bridge with nothing but these arguments, and a client of ROS.
pub fn start_with(arguments: &[&str]) -> (Rig, Bridge, Peer) {
    let (rig, domain) = (robot(), ros_domain());
    let bridge = Bridge::start_with(&rig.domain(), domain, arguments);
    let peer = Peer::new(domain, ROBOT, "console");
    (rig, bridge, peer)
}

/// The same for clients that command and home.
pub fn start() -> (Rig, Bridge, Peer) {
    start_with(&["--command", "--home"])
}

/// The same, homed and enabled.
pub fn enabled() -> (Rig, Bridge, Peer) {
    let (rig, bridge, mut peer) = start();
    peer.enable();
    (rig, bridge, peer)
}

/// `i2ris-ros` as a process, killed when dropped. Its output is stored.
pub struct Bridge {
    process: Killed,
    lines: Arc<Mutex<Vec<String>>>,
}

impl Bridge {
    /// Starts it for clients that command and home, and waits until it has joined ROS.
    pub fn start(domain: &Domain, ros_domain: u16, arguments: &[&str]) -> Self {
        Self::start_with(domain, ros_domain, &[&["--command", "--home"], arguments].concat())
    }

    /// Starts it with nothing but these arguments.
    pub fn start_with(domain: &Domain, ros_domain: u16, arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_i2ris-ros"));
        command
            .args(arguments)
            .env("I2RIS_DOMAIN", domain.name())
            .env("ROS_DOMAIN_ID", ros_domain.to_string())
            .env_remove("RMW_IMPLEMENTATION")
            .stdin(Stdio::null())
            .stdout(Stdio::piped());
        let mut process = Killed::start(&mut command);
        let lines = Arc::<Mutex<Vec<String>>>::default();
        let (output, kept) = (process.0.stdout.take().unwrap(), Arc::clone(&lines));
        thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                kept.lock().unwrap().push(line);
            }
        });
        let bridge = Self { process, lines };
        bridge.wait_for("in ROS domain");
        bridge
    }

    pub fn id(&self) -> u32 {
        self.process.0.id()
    }

    pub fn lines(&self) -> Vec<String> {
        self.lines.lock().unwrap().clone()
    }

    /// Waits until it prints a line with `words`, and returns the line.
    pub fn wait_for(&self, words: &str) -> String {
        wait_until(&format!("{words:?} among {:?}", self.lines()), || {
            self.lines().into_iter().find(|line| line.contains(words))
        })
    }

    /// Resident memory, kB.
    pub fn memory_kb(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    }

    /// Interrupts it and waits for its end.
    pub fn end(mut self) -> bool {
        self.process.signal(Signal::SIGINT);
        wait_until("it ends", || self.process.0.try_wait().unwrap()).success()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        if thread::panicking() {
            eprintln!("output of i2ris-ros:\n{}", self.lines().join("\n"));
        }
    }
}
