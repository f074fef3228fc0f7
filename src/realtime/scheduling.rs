//! Requests for real-time scheduling.
//!
//! Every request is best effort: a computer without permissions still runs the controller, with a
//! warning. What counts is what the kernel reports afterwards ([`Granted`]).

use std::fs;

use nix::errno::Errno;
use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::sys::resource::{Resource, getrlimit};
use nix::unistd::Pid;

/// The calling thread, in calls that take a thread id.
const SELF: Pid = Pid::from_raw(0);

/// Scheduling that a thread requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SchedulingRequest {
    /// SCHED_FIFO priority, 1 to 98; 0: normal scheduling.
    pub priority: u8,
    /// The processor to run on, and no other.
    pub cpu: Option<usize>,
    /// Lock the memory of the whole process, now and in future, against paging.
    pub lock_memory: bool,
}

/// Scheduling granted to a thread, as read back from the kernel.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Granted {
    /// SCHED_FIFO priority; 0: normal scheduling.
    pub priority: u8,
    /// The one processor that the thread may run on; `None`: several.
    pub cpu: Option<usize>,
    /// The memory of the process is locked.
    pub memory_locked: bool,
    /// One sentence per refused request: subject, reason and remedy.
    pub warnings: Vec<String>,
}

/// Asks for `wanted` on behalf of the calling thread, then reads back the result.
///
/// Threads and processes that this thread starts do not inherit SCHED_FIFO. They do inherit the
/// processor: see `keep_normal`.
pub fn request(wanted: SchedulingRequest) -> Granted {
    let mut warnings = Vec::new();
    if wanted.lock_memory {
        let locked = mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE);
        warnings.extend(locked.err().map(memory_warning));
    }
    if let Some(cpu) = wanted.cpu {
        warnings.extend(pin(cpu).err().map(|errno| processor_warning(cpu, errno)));
    }
    if wanted.priority > 0 {
        let priority = wanted.priority;
        let warning = |errno| priority_warning(priority, errno, has_right(priority));
        warnings.extend(set_fifo(priority).err().map(warning));
    }
    let granted = Granted { warnings, ..read_back() };
    granted.check_silent_refusals(wanted)
}

/// Puts the calling thread under normal scheduling and off the processor of the control loop. Every
/// thread that is not real-time calls this first, because a thread inherits the processor of the
/// thread that starts it.
pub(crate) fn keep_normal(loop_cpu: Option<usize>) {
    set_normal();
    if let Some(cpu) = loop_cpu {
        let allowed = sched_getaffinity(SELF).unwrap_or_else(|_| every_processor());
        let others = without(&allowed, cpu).or_else(|| without(&every_processor(), cpu));
        if let Some(others) = others {
            // Refused where the processor of the loop is the only one.
            let _ = sched_setaffinity(SELF, &others);
        }
    }
}

pub(crate) fn read_back() -> Granted {
    Granted {
        priority: fifo_priority(),
        cpu: sched_getaffinity(SELF).ok().as_ref().and_then(only_processor),
        memory_locked: fs::read_to_string("/proc/self/status")
            .is_ok_and(|status| locked_kilobytes(&status) > 0),
        warnings: Vec::new(),
    }
}

impl Granted {
    /// Adds a warning for what the kernel accepted without an error and does not report.
    fn check_silent_refusals(mut self, wanted: SchedulingRequest) -> Self {
        let silent = self.warnings.is_empty();
        let missing = [
            (wanted.priority > 0 && self.priority != wanted.priority, "SCHED_FIFO"),
            (wanted.cpu.is_some() && self.cpu != wanted.cpu, "the processor"),
            (wanted.lock_memory && !self.memory_locked, "locked memory"),
        ];
        for (_, what) in missing.iter().filter(|(missing, _)| *missing && silent) {
            self.warnings.push(format!(
                "the kernel accepted the request for {what} but does not report it; check the host"
            ));
        }
        self
    }
}

fn set_fifo(priority: u8) -> Result<(), Errno> {
    // With the flag, threads that this one starts begin under normal scheduling.
    schedule(libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, i32::from(priority))
}

fn set_normal() {
    // Always allowed, except that the reset-on-fork flag may not be removed.
    if schedule(libc::SCHED_OTHER, 0).is_err() {
        let _ = schedule(libc::SCHED_OTHER | libc::SCHED_RESET_ON_FORK, 0);
    }
}

fn schedule(policy: i32, priority: i32) -> Result<(), Errno> {
    let parameters = libc::sched_param { sched_priority: priority };
    // SAFETY: the pointer is to a live value of the right type, and 0 names the calling thread.
    Errno::result(unsafe { libc::sched_setscheduler(0, policy, &parameters) }).map(drop)
}

fn fifo_priority() -> u8 {
    let mut parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: 0 names the calling thread.
    let policy = unsafe { libc::sched_getscheduler(0) };
    // SAFETY: the pointer is to a live value of the right type, and 0 names the calling thread.
    let read = unsafe { libc::sched_getparam(0, &mut parameters) };
    if read == 0 && policy & !libc::SCHED_RESET_ON_FORK == libc::SCHED_FIFO {
        u8::try_from(parameters.sched_priority).unwrap_or(0)
    } else {
        0
    }
}

fn pin(cpu: usize) -> Result<(), Errno> {
    let mut one = CpuSet::new();
    one.set(cpu)?;
    sched_setaffinity(SELF, &one)
}

fn only_processor(set: &CpuSet) -> Option<usize> {
    let mut members = members(set);
    let first = members.next()?;
    members.next().is_none().then_some(first)
}

fn members(set: &CpuSet) -> impl Iterator<Item = usize> {
    (0..CpuSet::count()).filter(|cpu| set.is_set(*cpu).unwrap_or(false))
}

fn every_processor() -> CpuSet {
    let mut all = CpuSet::new();
    for cpu in 0..CpuSet::count() {
        let _ = all.set(cpu);
    }
    all
}

/// The set without one processor; `None` if nothing remains.
fn without(set: &CpuSet, cpu: usize) -> Option<CpuSet> {
    let mut rest = *set;
    rest.unset(cpu).ok()?;
    members(&rest).next().map(|_| rest)
}

/// `VmLck` of `/proc/PID/status`, kB.
fn locked_kilobytes(status: &str) -> u64 {
    let line = status.lines().find_map(|line| line.strip_prefix("VmLck:"));
    line.and_then(|rest| rest.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

/// Only the control group can refuse a priority to a process that has the right to it.
fn priority_warning(priority: u8, errno: Errno, has_right: bool) -> String {
    let refused =
        format!("SCHED_FIFO priority {priority} refused ({errno}): ticks will be late under load");
    if has_right {
        return format!(
            "{refused}; the process has the right to it, but its control group (see \
             /proc/self/cgroup) has no real-time budget: start it in another group, set a budget \
             in cpu.rt_runtime_us of the group and of those above it, or boot a kernel without \
             RT_GROUP_SCHED"
        );
    }
    format!(
        "{refused}; allow it with `setcap cap_sys_nice,cap_ipc_lock+ep` on the program, `rtprio` \
         in /etc/security/limits.d, or LimitRTPRIO= in its systemd unit"
    )
}

/// Whether this process may have a priority, by its limit or its capability.
fn has_right(priority: u8) -> bool {
    /// `CAP_SYS_NICE` in the mask of capabilities.
    const NICE: u64 = 1 << 23;
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    let limit = getrlimit(Resource::RLIMIT_RTPRIO).map_or(0, |(soft, _)| soft);
    mask & NICE != 0 || limit >= u64::from(priority)
}

fn memory_warning(errno: Errno) -> String {
    format!(
        "locking memory refused ({errno}): paging can delay ticks; allow it with `setcap \
         cap_sys_nice,cap_ipc_lock+ep` on the program, `memlock` in /etc/security/limits.d, or \
         LimitMEMLOCK=infinity in its systemd unit"
    )
}

fn processor_warning(cpu: usize, errno: Errno) -> String {
    format!(
        "pinning to processor {cpu} refused ({errno}): it does not exist or is not allowed for \
         this process; change control.cpu"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    /// Scheduling belongs to a thread: tests it in a separate one.
    fn in_a_thread<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
        thread::spawn(work).join().unwrap()
    }

    fn allowed() -> Vec<usize> {
        members(&sched_getaffinity(SELF).unwrap()).collect()
    }

    #[test]
    fn existing_processor_is_granted_and_read_back() {
        in_a_thread(|| {
            let cpu = allowed()[0];
            let granted = request(SchedulingRequest { cpu: Some(cpu), ..Default::default() });
            assert_eq!((granted.cpu, granted.warnings), (Some(cpu), vec![]));
        });
    }

    #[test]
    fn missing_processor_gives_a_warning() {
        in_a_thread(|| {
            let granted = request(SchedulingRequest { cpu: Some(1000), ..Default::default() });
            let [warning] = &granted.warnings[..] else { panic!("{granted:?}") };
            assert!(warning.contains("processor 1000"), "{granted:?}");
            assert_ne!(granted.cpu, Some(1000));
        });
    }

    #[test]
    fn fifo_is_either_there_or_warned_about() {
        in_a_thread(|| {
            let granted = request(SchedulingRequest { priority: 7, ..Default::default() });
            assert_eq!(granted.priority == 7, granted.warnings.is_empty(), "{granted:?}");
            let is_right = |it: &String| it.contains("rtprio") != has_right(7);
            assert!(granted.warnings.iter().all(is_right), "{granted:?}");
        });
    }

    /// moby/moby#22380, opencontainers/runc#2431: limits and capabilities were granted.
    #[test]
    fn control_group_is_named_to_a_process_with_the_right() {
        for (has_right, remedy) in [(true, "cpu.rt_runtime_us"), (false, "LimitRTPRIO")] {
            let warning = priority_warning(80, Errno::EPERM, has_right);
            assert!(warning.contains(remedy), "{warning}");
            assert_eq!(warning.contains("setcap"), !has_right, "{warning}");
        }
    }

    #[test]
    fn child_threads_do_not_inherit_fifo_or_pinning() {
        in_a_thread(|| {
            let processors = allowed();
            let cpu = processors[0];
            let _ = request(SchedulingRequest { priority: 7, cpu: Some(cpu), lock_memory: false });
            let child = in_a_thread(read_back);
            assert_eq!((child.priority, child.cpu), (0, Some(cpu)));
            let helper = in_a_thread(move || {
                keep_normal(Some(cpu));
                (fifo_priority(), allowed())
            });
            assert_eq!(helper.0, 0);
            assert_eq!(helper.1.contains(&cpu), processors.len() == 1, "{helper:?}");
        });
    }

    #[test]
    fn a_real_time_thread_can_be_put_back() {
        in_a_thread(|| {
            let _ = request(SchedulingRequest { priority: 7, ..SchedulingRequest::default() });
            keep_normal(None);
            assert_eq!(read_back().priority, 0);
        });
    }

    #[test]
    fn silently_refused_request_gives_a_warning() {
        let wanted = SchedulingRequest { priority: 80, cpu: Some(1), lock_memory: true };
        let granted = Granted::default().check_silent_refusals(wanted);
        assert_eq!(granted.warnings.len(), 3);
        let granted = Granted { priority: 80, cpu: Some(1), memory_locked: true, warnings: vec![] };
        assert_eq!(granted.clone().check_silent_refusals(wanted), granted);
    }

    #[test]
    fn locked_memory_is_read_from_the_status_file() {
        assert_eq!(locked_kilobytes("VmSize:\t 10 kB\nVmLck:\t  2048 kB\nVmPin:\t 0 kB\n"), 2048);
        assert_eq!(locked_kilobytes("VmLck:\t nonsense\n"), 0);
        assert_eq!(locked_kilobytes(""), 0);
    }
}
