//! One thread of the controller hangs. A tracer stops it: a signal would stop the whole process.

use nix::errno::Errno;
use nix::libc;

use super::*;

/// Shorter than the time after which a port thread without a watchdog stops its drives itself.
const SILENCE: Nanos = Nanos::from_millis(500);

/// Margin for measurements from outside, on a shared test machine.
const TOLERANCE: Nanos = Nanos::from_millis(1000);

/// A thread that hangs until this is dropped, by the thread that has made it.
pub(super) struct HungThread(i32);

impl HungThread {
    pub(super) fn of(rig: &Rig, name: &str) -> Self {
        let tasks = fs::read_dir(format!("/proc/{}/task", rig.controller_id())).unwrap();
        let is_it = |task: &fs::DirEntry| {
            fs::read_to_string(task.path().join("comm")).is_ok_and(|comm| comm.trim() == name)
        };
        let task = tasks.flatten().find(is_it).expect(name);
        let id: i32 = task.file_name().to_str().unwrap().parse().unwrap();
        // SAFETY: neither request reads or writes memory, and `waitpid` writes no status.
        unsafe {
            Errno::result(libc::ptrace(libc::PTRACE_SEIZE, id, 0, 0)).unwrap();
            Errno::result(libc::ptrace(libc::PTRACE_INTERRUPT, id, 0, 0)).unwrap();
            Errno::result(libc::waitpid(id, std::ptr::null_mut(), libc::__WALL)).unwrap();
        }
        Self(id)
    }
}

impl Drop for HungThread {
    fn drop(&mut self) {
        // SAFETY: the request accesses no memory. It fails if the process has ended.
        unsafe { libc::ptrace(libc::PTRACE_DETACH, self.0, 0, 0) };
    }
}

impl WatchedRig {
    /// Runs `act` while a client moves both motors of the snake.
    pub(super) fn while_moving<R>(&self, act: impl FnOnce(&Self) -> R) -> R {
        while_streaming(self.client.as_ref().unwrap(), swing, || {
            let begin = clock::now();
            wait_until("it moves", || self.rig.moved_since(begin));
            act(self)
        })
    }

    pub(super) fn violations(&self) -> usize {
        let log = self.rig.emulator.log();
        log.iter().filter(|it| matches!(it.kind, EventKind::HostBug(_))).count()
    }

    /// Time from `since` until every drive has taken its quick stop.
    pub(super) fn until_all_stopped(&self, since: Nanos) -> Nanos {
        let stop = |axis| self.stop_since(axis, since);
        let stops = wait_until("every drive is stopped", || {
            [0, 1, 2].map(stop).into_iter().collect::<Option<Vec<_>>>()
        });
        stops.into_iter().max().unwrap() - since
    }
}

fn check_stops(name: &str) {
    let watched = WatchedRig::new(SILENCE.0 / 1_000_000);
    let took = watched.while_moving(|watched| {
        let since = clock::now();
        let _hung = HungThread::of(&watched.rig, name);
        let took = watched.until_all_stopped(since);
        // Time in which another process could interfere.
        clock::sleep(Nanos::from_millis(1500));
        took
    });
    assert!(took <= SILENCE + TOLERANCE, "{name}: after {:.0} ms", took.as_seconds() * 1e3);
    // It resumes, and must not enable the drives again.
    clock::sleep(Nanos::from_millis(500));
    let enabled = |state: &State| *state == State::OperationEnabled;
    assert!(!watched.states().iter().any(enabled), "{name}: {:?}", watched.states());
    assert_eq!(watched.violations(), 0, "{name}: two talked on one line at once");
    let text = watched.log_text();
    assert!(!text.contains("NOT STOPPED"), "{name}: {text}");
}

#[test]
fn h03_hung_control_loop_in_motion_stops_drives() {
    let _turn = in_turn();
    check_stops("control");
}

#[test]
fn h03_hung_port_thread_in_motion_stops_its_drives() {
    let _turn = in_turn();
    check_stops("port");
}

#[test]
fn h03_hung_ipc_thread_ends_motion_but_hung_recorder_does_not() {
    let _turn = in_turn();
    let watched = WatchedRig::new(3000);
    watched.while_moving(|watched| {
        let hung = HungThread::of(&watched.rig, "black box");
        let begin = clock::now() + Nanos::from_millis(1000);
        wait_until("motion continues", || watched.rig.moved_since(begin));
        drop(hung);
        let _hung = HungThread::of(&watched.rig, "ipc");
        watched.rig.wait_until_still();
    });
    let stops = [0, 1].map(|axis| watched.stop_since(axis, Nanos::ZERO));
    assert_eq!(stops, [None; 2], "the loop holds");
    assert_eq!(watched.violations(), 0);
}

/// Two drives on one port, and a watchdog that knows only the first: it could not stop the other.
#[test]
fn h28_watchdog_with_other_nodes_is_rejected() {
    let _turn = in_turn();
    let mut rig = Rig::start();
    let ports = rig.config.ports.clone();
    rig.config.ports[0].axes.pop();
    let mut watched = WatchedRig::without_controller(rig, 3000);
    watched.rig.config.ports = ports;
    let mut client = watched.rig.started();
    watched.until_logged("watching");
    wait_for(&mut client, |state| !has(state, OperatingStateMsg::BUSY));
    let refused = client.state_command(StateCommand::Home).unwrap_err().to_string();
    assert!(refused.contains("the watchdog is running, but cannot stop"), "{refused}");
    wait_for(&mut client, |state| !has(state, OperatingStateMsg::WATCHED));
}
