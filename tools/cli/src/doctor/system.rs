//! The computer: real-time scheduling, memory, processors, shared memory.

use std::{fs, os::unix::fs::MetadataExt, path::Path, thread};

use i2ris::ipc::watchdog_presence::{WatchdogStatus, watchdog_process};
use i2ris::ipc::{Domain, client::Client, ready::Ready};
use i2ris::realtime::{self, SchedulingRequest};
use i2ris::{clock, config::Config, units::Nanos, watchdog::PulseLine};
use nix::unistd::{AccessFlags, access};

use super::Report;

pub fn check(config: &Config, report: &mut Report) {
    check_kernel(report);
    check_granted(config, report);
    check_processors(config, report);
    check_memory(config, report);
    check_watchdog(config, report);
    check_pulse(config, report);
    check_records(&config.record_folder, report);
}

/// Checks that records can be written. The controller creates the folder if permitted.
fn check_records(folder: &Path, report: &mut Report) {
    let user = nix::unistd::geteuid();
    let mut above = folder.ancestors().skip_while(|folder| fs::symlink_metadata(folder).is_err());
    let above = above.next().filter(|above| !above.as_os_str().is_empty());
    let above = above.unwrap_or(Path::new("."));
    if above != folder && access(above, AccessFlags::W_OK | AccessFlags::X_OK).is_ok() {
        return report.pass("records", format!("{} will be created", folder.display()));
    }
    let found = fs::metadata(folder).map_err(|error| error.to_string()).and_then(|found| {
        if !found.is_dir() {
            return Err("is not a folder".to_owned());
        }
        if found.uid() != user.as_raw() && !user.is_root() {
            let why = "belongs to another user: there would be no black box and no run log";
            return Err(why.to_owned());
        }
        access(folder, AccessFlags::W_OK | AccessFlags::X_OK).map_err(|error| error.to_string())
    });
    let shown = folder.display();
    let make = format!("`sudo install -d -o $USER {shown}`, or another `record_folder`");
    match found {
        Ok(()) => report.pass("records", shown.to_string()),
        Err(why) => report.fail("records", format!("{shown}: {why}"), make),
    }
}

/// Switches the line once, which does not close a relay that needs a pulse.
fn check_pulse(config: &Config, report: &mut Report) {
    let Some(pulse) = &config.watchdog else {
        let found = config.host_failure_warning().unwrap_or_default();
        let fix = "see the manual: Stops and faults, When the computer dies";
        return report.warn("pulse", found, fix);
    };
    let tried = PulseLine::open(&pulse.device, pulse.line).and_then(|line| {
        let was_on = line.is_on()?;
        line.set(!was_on)?;
        let is_switched = line.is_on()? != was_on;
        line.set(was_on)?;
        Ok(is_switched)
    });
    let (found, fix) = match tried {
        Ok(true) => return report.pass("pulse", "the modem line can be switched"),
        Ok(false) => {
            let fix = "use another adapter, or the other `line`";
            ("the modem line cannot be switched".to_owned(), fix)
        }
        Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
            return report.pass("pulse", "the adapter is used by a watchdog");
        }
        Err(error) => (error.to_string(), "plug in the adapter, or correct [watchdog]"),
    };
    report.fail("pulse", format!("{}: {found}", pulse.device.display()), fix);
}

fn check_watchdog(config: &Config, report: &mut Report) {
    // An error is reported with the shared memory.
    let Ok(domain) = Domain::new(&config.domain) else { return };
    let (found, fix) = match WatchdogStatus::read(&domain, &config.ports_digest(), clock::now()) {
        WatchdogStatus::Watching => {
            return report.pass("watchdog", "running, with access to every port");
        }
        WatchdogStatus::Incomplete => (
            "running, but without access to every port: it cannot stop every drive",
            "see its log, and give it access to every port; nothing can be enabled until then",
        ),
        WatchdogStatus::Silent => (
            "is running, but hung or suspended: it cannot stop any drive",
            "`kill -KILL` this process, and restart it; nothing can be enabled until then",
        ),
        WatchdogStatus::OtherPorts => (
            "is running for other ports: it cannot stop every drive of this configuration",
            "end it; start it with this configuration",
        ),
        WatchdogStatus::Absent => (
            "not running: nothing stops the drives if the controller dies",
            "start `i2ris-watchdog` with the same configuration, before the first motion",
        ),
    };
    let process = watchdog_process(&domain).map(|process| format!("process {process} "));
    report.warn("watchdog", process.unwrap_or_default() + found, fix);
}

fn check_kernel(report: &mut Report) {
    let version = fs::read_to_string("/proc/version").unwrap_or_default();
    let real_time = fs::read_to_string("/sys/kernel/realtime").is_ok_and(|text| text.trim() == "1");
    let release = version.split_whitespace().nth(2).unwrap_or("unknown");
    if starves_workers(release) {
        let found = "it can delay serial lines for seconds while a program computes";
        let fix = "update it (fixed in Linux 6.18.45); until then, compute nothing during trials";
        report.warn("kernel", format!("{release}: {found}"), fix);
    }
    if real_time || version.contains("PREEMPT_RT") {
        return report.pass("kernel", format!("{release}, real-time"));
    }
    let fix = "install a kernel with PREEMPT_RT for bounded latency";
    report.warn("kernel", format!("{release}, not real-time"), fix);
}

/// Linux with commit 6d71a9c61604, before its revert 101f3498b4bd: workers of the kernel that
/// deliver what a serial line received wait while a group of processes computes. A distribution may
/// have the revert under an earlier number.
fn starves_workers(release: &str) -> bool {
    let mut numbers = release.split(|c: char| !c.is_ascii_digit()).map(|text| text.parse().ok());
    let version: [u32; 3] = std::array::from_fn(|_| numbers.next().flatten().unwrap_or(0));
    ([6, 13, 0]..[6, 18, 45]).contains(&version)
}

/// Requests the permissions that the controller would request, in a separate thread.
fn check_granted(config: &Config, report: &mut Report) {
    let (priority, cpu) = (config.control.priority, config.control.cpu);
    let wanted = SchedulingRequest { priority, cpu, lock_memory: priority > 0 };
    let Ok(granted) = thread::spawn(move || realtime::request(wanted)).join() else {
        return report.fail("scheduling", "the test thread ended early", "see above");
    };
    if granted.warnings.is_empty() {
        let locked = if granted.memory_locked { "locked" } else { "not locked, not requested" };
        report.pass("scheduling", format!("SCHED_FIFO {}, memory {locked}", granted.priority));
    }
    for warning in granted.warnings {
        // The text has the form `finding; fix`.
        let (found, fix) = warning.split_once("; ").unwrap_or((warning.as_str(), "see the README"));
        report.warn("scheduling", found, fix);
    }
}

fn check_processors(config: &Config, report: &mut Report) {
    let isolated = fs::read_to_string("/sys/devices/system/cpu/isolated").unwrap_or_default();
    let isolated = isolated.trim();
    match config.control.cpu {
        None => {
            let isolated = if isolated.is_empty() { "none" } else { isolated };
            let fix = "isolate a processor (kernel argument isolcpus=N) and set control.cpu = N";
            report.warn("processor", format!("the loop is not pinned; isolated: {isolated}"), fix);
        }
        Some(cpu) if contains(isolated, cpu) => {
            report.pass("processor", format!("{cpu}, isolated"))
        }
        Some(cpu) => {
            let fix = format!("add isolcpus={cpu} to the arguments of the kernel");
            report.warn("processor", format!("{cpu} is not isolated"), fix);
        }
    }
}

/// Whether a list such as `1,4-6` contains a number.
fn contains(list: &str, wanted: usize) -> bool {
    list.split(',').map(str::trim).any(|part| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let [first, last] = [first, last].map(str::parse::<usize>);
        first.is_ok_and(|first| first <= wanted) && last.is_ok_and(|last| wanted <= last)
    })
}

fn check_memory(config: &Config, report: &mut Report) {
    let domain = match Domain::new(&config.domain) {
        Ok(domain) => domain,
        Err(error) => return report.fail("shared memory", error.to_string(), "correct domain"),
    };
    if let Some(ready) = Ready::read(&domain) {
        let serves = format!("a controller serves `{}`, process {}", domain.name(), ready.pid);
        let client = Client::connect(&domain, Nanos::from_millis(1000));
        return match client.and_then(|mut client| client.version()) {
            Ok(_) => report.pass("shared memory", serves),
            Err(error) => {
                let sentence = error.to_string();
                let (found, fix) = sentence.split_once("; ").unwrap_or((&sentence, "see its log"));
                report.fail("shared memory", format!("{serves}: {found}"), fix);
            }
        };
    }
    let leftovers = count_leftovers(domain.directory(), Path::new("/dev/shm"), domain.prefix());
    if leftovers == 0 {
        report.pass("shared memory", format!("no leftovers in `{}`", domain.name()));
    } else {
        let found = format!("{leftovers} files of a killed controller in `{}`", domain.name());
        report.warn("shared memory", found, "no action needed: the next controller removes them");
    }
}

fn count_leftovers(folder: &Path, memory: &Path, prefix: &str) -> usize {
    let count = |path: &Path, counts: &dyn Fn(&str) -> bool| {
        let entries = fs::read_dir(path).into_iter().flatten().flatten();
        entries.filter(|entry| counts(&entry.file_name().to_string_lossy())).count()
    };
    // The lock file stays by design.
    count(folder, &|name| !name.contains("lock")) + count(memory, &|name| name.starts_with(prefix))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processor_lists_are_parsed() {
        assert!(contains("1,4-6", 5) && contains("1,4-6\n", 1) && contains("3", 3));
        assert!(!contains("1,4-6", 3) && !contains("", 0));
    }

    #[test]
    fn kernels_that_starve_serial_lines_are_known() {
        assert!(["6.13.0", "6.17.0-14-generic", "6.18.44"].into_iter().all(starves_workers));
        let sound = ["6.12.48+deb13-amd64", "6.18.45", "7.0.0", "unknown"];
        assert!(!sound.into_iter().any(starves_workers));
    }

    #[test]
    fn leftovers_are_counted_without_the_lock() {
        let base = tempfile::tempdir().unwrap();
        let (folder, memory) = (base.path().join("domain"), base.path().join("shm"));
        fs::create_dir_all(&folder).unwrap();
        fs::create_dir_all(&memory).unwrap();
        fs::write(folder.join("lock"), "").unwrap();
        assert_eq!(count_leftovers(&folder, &memory, "i2ris_"), 0);
        fs::write(folder.join("ready"), "").unwrap();
        fs::write(memory.join("i2ris_7"), "").unwrap();
        fs::write(memory.join("other"), "").unwrap();
        assert_eq!(count_leftovers(&folder, &memory, "i2ris_"), 2);
    }
}
