//! What was measured on.

use std::fs;

use i2ris::rt::read_back;
use serde::Serialize;

/// A machine, as it says itself.
#[derive(Debug, Serialize)]
pub struct Machine {
    processor: String,
    processors: usize,
    kernel: String,
    /// It runs on another one: maxima are not its own.
    is_virtual: bool,
    /// Processes that wanted to run in the last minute.
    load: String,
    /// SCHED_FIFO priority of this thread; 0: normal scheduling.
    priority: u8,
}

/// Looks.
pub fn look() -> Machine {
    let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let cpu = read("/proc/cpuinfo");
    let line = |name: &str| cpu.lines().find(|line| line.starts_with(name)).and_then(|line| line.split(": ").nth(1));
    Machine {
        processor: line("model name").unwrap_or("unknown").to_owned(),
        processors: std::thread::available_parallelism().map_or(1, usize::from),
        kernel: read("/proc/sys/kernel/osrelease").trim().to_owned(),
        is_virtual: line("flags").is_some_and(|flags| flags.split(' ').any(|flag| flag == "hypervisor")),
        load: read("/proc/loadavg").split(' ').next().unwrap_or_default().to_owned(),
        priority: read_back().priority,
    }
}

impl Machine {
    /// One sentence.
    pub fn words(&self) -> String {
        let Self { processor, processors, kernel, is_virtual, load, priority } = self;
        let kind = if *is_virtual { ", virtual: maxima belong to the host" } else { "" };
        let scheduling = if *priority > 0 { format!("SCHED_FIFO {priority}") } else { "normal scheduling".to_owned() };
        format!("{processor}, {processors} processors, Linux {kernel}{kind}; load {load}; {scheduling}")
    }
}
