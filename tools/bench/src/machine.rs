//! The machine and its load; scheduling: an own processor and SCHED_FIFO, if permitted.

use std::path::Path;
use std::{fs, thread};

use i2ris::realtime::{Granted, SchedulingRequest, request};
use i2ris_report::Interrupt;
use serde::Serialize;

use crate::{Failure, panicked};

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Machine {
    pub processor: String,
    pub processors: usize,
    pub kernel: String,
    /// Preemption model of the kernel: PREEMPT_DYNAMIC, PREEMPT_RT, ...
    pub preemption: String,
    pub clock: String,
    /// Frequency governor of the first processor; empty: none.
    pub governor: String,
    /// Processors that are isolated from the scheduler; empty: none.
    pub isolated: String,
    /// Limit for real-time threads, percent of the time; `None`: no limit.
    pub real_time_share: Option<f64>,
    pub is_virtual: bool,
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default().trim().to_owned()
}

fn preemption(version: &str, real_time: bool) -> String {
    if real_time {
        return "PREEMPT_RT".to_owned();
    }
    let word = version
        .split_whitespace()
        .find(|word| word.starts_with("PREEMPT") || word.starts_with("(PREEMPT"));
    word.unwrap_or("no preemption named").trim_matches(['(', ')']).to_owned()
}

fn real_time_share(runtime: &str, period: &str) -> Option<f64> {
    let (runtime, period): (f64, f64) = (runtime.parse().ok()?, period.parse().ok()?);
    (runtime >= 0.0 && period > 0.0).then(|| 100.0 * runtime / period)
}

impl Machine {
    pub fn detect() -> Self {
        let cpu = read("/proc/cpuinfo");
        let value = |name: &str| {
            let line = cpu.lines().find(|line| line.starts_with(name));
            line.and_then(|line| line.split(": ").nth(1))
        };
        // All processors, not only those that this thread may use.
        let processors = cpu.lines().filter(|line| line.starts_with("processor")).count();
        let is_realtime = Path::new("/sys/kernel/realtime").exists();
        let share = |name: &str| read(&format!("/proc/sys/kernel/sched_rt_{name}_us"));
        Self {
            processor: value("model name").unwrap_or("unknown").to_owned(),
            processors: processors.max(1),
            kernel: read("/proc/sys/kernel/osrelease"),
            preemption: preemption(&read("/proc/sys/kernel/version"), is_realtime),
            clock: read("/sys/devices/system/clocksource/clocksource0/current_clocksource"),
            governor: read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
            isolated: read("/sys/devices/system/cpu/isolated"),
            real_time_share: real_time_share(&share("runtime"), &share("period")),
            is_virtual: value("flags")
                .is_some_and(|flags| flags.split(' ').any(|flag| flag == "hypervisor")),
        }
    }

    pub fn description(&self) -> String {
        let kind = if self.is_virtual { "virtual machine" } else { "not a virtual machine" };
        let mut text = format!(
            "{}, {} processors, {kind}; Linux {}, {}, clock {}",
            self.processor, self.processors, self.kernel, self.preemption, self.clock
        );
        if !self.governor.is_empty() {
            text += &format!(", frequency governor {}", self.governor);
        }
        if !self.isolated.is_empty() {
            text += &format!(", processors {} isolated", self.isolated);
        }
        text
    }

    pub fn notes(&self) -> Vec<String> {
        let debug = cfg!(debug_assertions)
            .then_some("This is a debug build: measure with a build with --release.");
        let notes = if self.is_virtual { VIRTUAL_NOTES } else { REAL_NOTES };
        debug.iter().chain(notes).map(|note| (*note).to_owned()).collect()
    }
}

const REAL_NOTES: &[&str] =
    &["Everything runs on this one computer. Maxima are of this run, not bounds for the next."];

const VIRTUAL_NOTES: &[&str] = &[
    "Valid on other machines: ratios to the floor of the same run, and the parts of medians and \
     99th percentiles.",
    "Valid on this virtual machine only: absolute microseconds. Waking a thread here takes an exit \
     to the host, tens of microseconds that a real machine does not need.",
    "Cannot be shown here: maxima, most of the 99.9th percentiles, and any deadline below about \
     0.1 s. The host takes the processor away for milliseconds, from real-time threads as well.",
    "Not included: USB adapters and their latency timers, cables, the drive's own time. Lines are \
     pseudo-terminals whose bytes a kernel worker passes on at normal priority; the emulator paces \
     them at the baud rate.",
];

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SystemLoad {
    /// Use of all processors by all processes, percent.
    pub busy_percent: f64,
    /// Time that the host gave to other guests although it was needed here, percent.
    pub stolen_percent: f64,
}

impl SystemLoad {
    pub fn description(&self) -> String {
        let Self { busy_percent: busy, stolen_percent: stolen } = self;
        format!("{busy:.0} % of all processors in use, {stolen:.1} % stolen by the host")
    }
}

/// Times of all processors since boot.
#[derive(Debug, Clone, Copy)]
pub struct LoadMonitor {
    idle: u64,
    stolen: u64,
    total: u64,
}

impl LoadMonitor {
    pub fn start() -> Self {
        Self::at(&read("/proc/stat"))
    }

    pub fn stop(self) -> SystemLoad {
        let now = Self::start();
        let total = now.total.saturating_sub(self.total).max(1) as f64;
        let share = |before: u64, after: u64| 100.0 * after.saturating_sub(before) as f64 / total;
        let stolen_percent = share(self.stolen, now.stolen);
        let busy = 100.0 - share(self.idle, now.idle) - stolen_percent;
        SystemLoad { busy_percent: busy.clamp(0.0, 100.0), stolen_percent }
    }

    /// Line 1 of `/proc/stat` (proc(5)): user, nice, system, idle, iowait, irq, softirq, steal.
    fn at(stat: &str) -> Self {
        let first = stat.lines().next().unwrap_or_default();
        let fields = first.split_whitespace().skip(1).take(8);
        let fields: Vec<u64> = fields.map(|field| field.parse().unwrap_or(0)).collect();
        let field = |index: usize| fields.get(index).copied().unwrap_or(0);
        Self { idle: field(3) + field(4), stolen: field(7), total: fields.iter().sum() }
    }
}

#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// SCHED_FIFO priority of the threads; 0: normal scheduling.
    pub priority: u8,
    pub interrupt: &'a Interrupt,
}

impl Run<'_> {
    pub fn check(self) -> Result<(), Failure> {
        if self.interrupt.came() { Err("interrupted".into()) } else { Ok(()) }
    }

    /// Its own processor, if there are two: the last, as the first serves most interrupts.
    pub fn processor(self) -> Option<usize> {
        let processors = thread::available_parallelism().map_or(1, usize::from);
        (self.priority > 0 && processors >= 2).then(|| processors - 1)
    }

    /// Requests the scheduling for the calling thread, and describes the result.
    pub fn schedule(self, thread: &str) -> String {
        let (priority, lock_memory) = (self.priority, self.priority > 0);
        let granted = request(SchedulingRequest { priority, cpu: self.processor(), lock_memory });
        format!("{thread}: {}", describe(&granted))
    }
}

pub fn request_priority(priority: u8) {
    let _ = request(SchedulingRequest { priority, ..SchedulingRequest::default() });
}

/// Describes the scheduling that was granted or refused, with the reason.
pub fn describe(granted: &Granted) -> String {
    let mut text = match granted.priority {
        0 => "normal scheduling".to_owned(),
        priority => format!("SCHED_FIFO {priority}"),
    };
    text += &match granted.cpu {
        None => ", on any processor".to_owned(),
        Some(cpu) => format!(", on processor {cpu} only"),
    };
    if granted.memory_locked {
        text += ", memory locked";
    }
    for warning in &granted.warnings {
        text += &format!("; {warning}");
    }
    text
}

/// Runs `work` in a new thread: its scheduling ends with the thread.
pub fn in_thread<T: Send>(work: impl FnOnce() -> Result<T, Failure> + Send) -> Result<T, Failure> {
    thread::scope(|scope| scope.spawn(work).join().map_err(panicked)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_the_kernel_are_read() {
        let load = LoadMonitor::at("cpu  100 1 50 800 20 3 4 22 5 6\ncpu0 1 2 3");
        assert_eq!((load.idle, load.stolen, load.total), (820, 22, 1000));
        assert_eq!(preemption("#1 SMP PREEMPT_DYNAMIC Debian 6.1", false), "PREEMPT_DYNAMIC");
        assert_eq!(preemption("#1 SMP", false), "no preemption named");
        assert_eq!(preemption("", true), "PREEMPT_RT");
        assert_eq!(real_time_share("950000", "1000000"), Some(95.0));
        assert_eq!(real_time_share("-1", "1000000"), None);
    }

    #[test]
    fn the_notes_of_a_virtual_machine_name_its_limits() {
        let machine = Machine { is_virtual: true, ..Machine::detect() };
        assert!(machine.notes().iter().any(|note| note.contains("Cannot be shown here")));
        assert!(machine.description().contains("virtual machine"));
    }
}
