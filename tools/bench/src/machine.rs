//! What was measured on, and what else it did meanwhile.

use std::fs;
use std::path::Path;

use serde::Serialize;

/// A machine, as it says itself.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Machine {
    /// Model of the processor.
    pub processor: String,
    /// How many there are.
    pub processors: usize,
    /// Release of the kernel.
    pub kernel: String,
    /// How the kernel was built: PREEMPT_DYNAMIC, PREEMPT_RT, ...
    pub preemption: String,
    /// What the kernel takes time from.
    pub clock: String,
    /// Governor of the first processor's frequency; empty: nobody governs it.
    pub governor: String,
    /// Processors that the scheduler leaves alone; empty: none.
    pub isolated: String,
    /// Share of every second that real-time threads may have, percent; `None`: all of it.
    pub real_time_share: Option<f64>,
    /// It runs on another one: maxima are not its own.
    pub is_virtual: bool,
}

/// Looks.
#[must_use]
pub fn look() -> Machine {
    let cpu = read("/proc/cpuinfo");
    let line = |name: &str| {
        cpu.lines()
            .find(|line| line.starts_with(name))
            .and_then(|line| line.split(": ").nth(1))
    };
    Machine {
        processor: line("model name").unwrap_or("unknown").to_owned(),
        // Not those that this thread may use: it may be pinned.
        processors: cpu
            .lines()
            .filter(|line| line.starts_with("processor"))
            .count()
            .max(1),
        kernel: read("/proc/sys/kernel/osrelease"),
        preemption: preemption(
            &read("/proc/sys/kernel/version"),
            Path::new("/sys/kernel/realtime").exists(),
        ),
        clock: read("/sys/devices/system/clocksource/clocksource0/current_clocksource"),
        governor: read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
        isolated: read("/sys/devices/system/cpu/isolated"),
        real_time_share: real_time_share(
            &read("/proc/sys/kernel/sched_rt_runtime_us"),
            &read("/proc/sys/kernel/sched_rt_period_us"),
        ),
        is_virtual: line("flags")
            .is_some_and(|flags| flags.split(' ').any(|flag| flag == "hypervisor")),
    }
}

fn read(path: &str) -> String {
    fs::read_to_string(path)
        .unwrap_or_default()
        .trim()
        .to_owned()
}

/// The word of the kernel's version that tells of preemption.
fn preemption(version: &str, real_time: bool) -> String {
    if real_time {
        return "PREEMPT_RT".to_owned();
    }
    let word = version
        .split_whitespace()
        .find(|word| word.starts_with("PREEMPT") || word.starts_with("(PREEMPT"));
    word.unwrap_or("no preemption named")
        .trim_matches(['(', ')'])
        .to_owned()
}

fn real_time_share(runtime: &str, period: &str) -> Option<f64> {
    let (runtime, period): (f64, f64) = (runtime.parse().ok()?, period.parse().ok()?);
    (runtime >= 0.0 && period > 0.0).then(|| 100.0 * runtime / period)
}

impl Machine {
    /// One sentence.
    #[must_use]
    pub fn words(&self) -> String {
        let Self {
            processor,
            processors,
            kernel,
            preemption,
            clock,
            ..
        } = self;
        let kind = if self.is_virtual {
            "virtual machine"
        } else {
            "no virtual machine"
        };
        let governor = if self.governor.is_empty() {
            String::new()
        } else {
            format!(", frequency governor {}", self.governor)
        };
        let isolated = if self.isolated.is_empty() {
            String::new()
        } else {
            format!(", processors {} isolated", self.isolated)
        };
        format!(
            "{processor}, {processors} processors, {kind}; Linux {kernel}, {preemption}, clock {clock}{governor}{isolated}"
        )
    }

    /// What numbers of such a machine show, and what they do not.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let mut notes = if self.is_virtual {
            of_a_virtual_one()
        } else {
            of_a_real_one()
        };
        if cfg!(debug_assertions) {
            notes.insert(
                0,
                "This is a debug build: build with --release for figures that mean something."
                    .to_owned(),
            );
        }
        notes
    }
}

fn of_a_real_one() -> Vec<String> {
    vec!["Everything runs on this one computer; maxima are of this run, and no bound for the next one.".to_owned()]
}

fn of_a_virtual_one() -> Vec<String> {
    [
        "Carries over to other machines: ratios to the floor of the same run, and what medians and 99th percentiles \
         consist of.",
        "Belongs to this virtual machine: absolute microseconds. Waking a thread here takes an exit to the host, tens of \
         microseconds that a real machine does not need.",
        "Cannot be shown here: maxima, most of the 99.9th percentiles, and any deadline below about 0.1 s. The host takes \
         the processor away for milliseconds, from real-time threads as well.",
        "Not in it: USB adapters and their latency timers, cables, the drive's own time. Lines are pseudo-terminals whose \
         bytes a worker of the kernel passes on at normal priority; the emulator paces them at the baud rate.",
    ]
    .map(str::to_owned)
    .into()
}

/// What else a machine did during a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Weather {
    /// Share of all processors that was in use, by whomever, percent.
    pub busy_percent: f64,
    /// Share that the host gave to others although it was wanted here, percent.
    pub stolen_percent: f64,
}

/// Looks at the clock of the processors when a measurement begins.
#[derive(Debug, Clone, Copy)]
pub struct Watch(Times);

#[derive(Debug, Clone, Copy, Default)]
struct Times {
    idle: u64,
    stolen: u64,
    total: u64,
}

impl Watch {
    /// Now.
    #[must_use]
    pub fn start() -> Self {
        Self(times(&read("/proc/stat")))
    }

    /// What there was since then.
    #[must_use]
    pub fn stop(self) -> Weather {
        let (before, after) = (self.0, times(&read("/proc/stat")));
        let total = after.total.saturating_sub(before.total).max(1) as f64;
        let share = |before: u64, after: u64| 100.0 * after.saturating_sub(before) as f64 / total;
        let stolen_percent = share(before.stolen, after.stolen);
        let busy = 100.0 - share(before.idle, after.idle) - stolen_percent;
        Weather {
            busy_percent: busy.clamp(0.0, 100.0),
            stolen_percent,
        }
    }
}

/// Ticks of all processors since the start, of `/proc/stat`: user, nice, system, idle, waiting for
/// disks, interrupts, soft interrupts, stolen.
fn times(stat: &str) -> Times {
    let first = stat.lines().next().unwrap_or_default();
    let fields: Vec<u64> = first
        .split_whitespace()
        .skip(1)
        .take(8)
        .map(|field| field.parse().unwrap_or(0))
        .collect();
    let field = |index: usize| fields.get(index).copied().unwrap_or(0);
    Times {
        idle: field(3) + field(4),
        stolen: field(7),
        total: fields.iter().sum(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_kernel_says_is_read() {
        let Times {
            idle,
            stolen,
            total,
        } = times("cpu  100 1 50 800 20 3 4 22 5 6\ncpu0 1 2 3");
        assert_eq!((idle, stolen, total), (820, 22, 1000));
        assert_eq!(
            preemption("#1 SMP PREEMPT_DYNAMIC Debian 6.1", false),
            "PREEMPT_DYNAMIC"
        );
        assert_eq!(preemption("#1 SMP", false), "no preemption named");
        assert_eq!(preemption("", true), "PREEMPT_RT");
        assert_eq!(real_time_share("950000", "1000000"), Some(95.0));
        assert_eq!(real_time_share("-1", "1000000"), None);
    }

    #[test]
    fn a_virtual_machine_is_told_what_it_cannot_show() {
        let machine = Machine {
            is_virtual: true,
            ..look()
        };
        assert!(
            machine
                .notes()
                .iter()
                .any(|note| note.contains("Cannot be shown here"))
        );
        assert!(machine.words().contains("virtual machine"));
    }
}
