//! The pulse of the watchdog. Pseudo-terminals have no modem lines, so a preloaded library
//! intercepts the three `ioctl` calls in the watchdog process and writes the time of each edge to a
//! file.
//!
//! Times: `cargo test --test real_time -- --ignored --nocapture pulse_latency`.

use i2ris::config::{ModemLine, WatchdogConfig};
use i2ris_testing::program::c_library;
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};

use super::*;

struct PulsedRig {
    watched: WatchedRig,
    edges: PathBuf,
    _adapter: PtyMaster,
}

impl PulsedRig {
    /// A watchdog with a pulse, and no controller.
    fn new(mut rig: Rig, silence_ms: u64) -> Self {
        let adapter =
            posix_openpt(nix::fcntl::OFlag::O_RDWR | nix::fcntl::OFlag::O_NOCTTY).unwrap();
        grantpt(&adapter).unwrap();
        unlockpt(&adapter).unwrap();
        let device = ptsname_r(&adapter).unwrap().into();
        rig.config.watchdog = Some(WatchdogConfig { device, line: ModemLine::Rts });
        let edges = rig.folder.path().join("edges");
        let library = c_library(rig.folder.path(), include_str!("modem_lines.c"));
        // For the watchdog alone.
        rig.environment = [("LD_PRELOAD", &library), ("I2RIS_EDGES", &edges)]
            .map(|(name, value)| (name.into(), value.into()))
            .into();
        let mut watched = WatchedRig::without_controller(rig, silence_ms);
        watched.rig.environment.clear();
        Self { watched, edges, _adapter: adapter }
    }

    fn edges(&self) -> Vec<Nanos> {
        let bytes = fs::read(&self.edges).unwrap_or_default();
        let stamps = bytes.chunks_exact(8).map(|it| u64::from_le_bytes(it.try_into().unwrap()));
        stamps.map(Nanos).collect()
    }

    fn until_pulsing(&self) {
        let before = self.edges().len();
        wait_until("the line changes", || self.edges().len() > before + 5);
    }

    /// The last edge, once no further edge has arrived for some time.
    fn last_edge(&self) -> Nanos {
        let mut seen = (clock::now(), self.edges().len());
        wait_until("the line is still", || {
            if self.edges().len() != seen.1 {
                seen = (clock::now(), self.edges().len());
            }
            clock::now() - seen.0 > Nanos::from_millis(300)
        });
        self.edges().last().copied().unwrap()
    }
}

#[test]
fn h03_pulse_ends_with_controller_and_returns_with_drives_off() {
    let _turn = in_turn();
    let mut pulsed = PulsedRig::new(Rig::start(), 3000);
    assert!(pulsed.edges().is_empty(), "no pulse without a controller");
    drop(pulsed.watched.rig.started());
    pulsed.until_pulsing();
    // Main thread and pulse have one priority: 0 where the system refuses it.
    let tasks = fs::read_dir(format!("/proc/{}/task", pulsed.watched.watchdog.id())).unwrap();
    let stats = tasks.map(|task| fs::read_to_string(task.unwrap().path().join("stat")).unwrap());
    let own: Vec<String> = stats.filter(|stat| stat.contains("(i2ris-watchdog)")).collect();
    let priorities: Vec<_> = own.iter().map(|stat| stat.split(' ').nth(39).unwrap()).collect();
    assert!(priorities.len() == 2 && priorities[0] == priorities[1], "{priorities:?}");
    pulsed.watched.rig.signal(Signal::SIGSTOP);
    pulsed.last_edge();
    // Its drives are off.
    pulsed.watched.rig.signal(Signal::SIGCONT);
    pulsed.until_pulsing();
    pulsed.watched.rig.emulator.mute(0, true);
    pulsed.last_edge();
    pulsed.watched.rig.emulator.mute(0, false);
    pulsed.watched.end_with(Signal::SIGKILL);
    pulsed.last_edge();
    drop(pulsed.watched.rig.started());
    pulsed.until_pulsing();
    pulsed.watched.watchdog.kill().unwrap();
    pulsed.last_edge();
}

/// A lost reply costs its timeout but is not a fault: the relay must not cut the power.
#[test]
fn h16_lost_reply_does_not_end_pulse() {
    let _turn = in_turn();
    let mut rig = Rig::start();
    rig.config.limits.feedback_stale_ms = 300;
    rig.config.ports[0].reply_timeout_ms = 600;
    let mut pulsed = PulsedRig::new(rig, 3000);
    pulsed.watched.enable();
    pulsed.until_pulsing();
    for _ in 0..3 {
        pulsed.watched.rig.emulator.inject(0, Injection::LoseReply);
        clock::sleep(Nanos::from_millis(1500));
        pulsed.until_pulsing();
    }
}

/// Prints the time from each event to the last edge, with enabled drives.
#[test]
#[ignore = "prints times, which depend on the machine"]
fn pulse_latency() {
    const TIMES: usize = 20;
    type Act = fn(&mut PulsedRig);
    let acts: [(&str, Act); 5] = [
        ("SIGKILL of the controller", |it| it.watched.rig.signal(Signal::SIGKILL)),
        ("SIGSTOP of the controller", |it| it.watched.rig.signal(Signal::SIGSTOP)),
        ("SIGKILL of the watchdog", |it| it.watched.watchdog.kill().unwrap()),
        ("SIGSTOP of the watchdog", |it| {
            kill(Pid::from_raw(it.watched.watchdog.id() as i32), Signal::SIGSTOP).unwrap();
        }),
        ("a line that hangs", |it| it.watched.rig.emulator.mute(0, true)),
    ];
    for (name, act) in acts {
        let mut spans = Vec::new();
        let mut without = 0;
        while spans.len() < TIMES {
            let mut pulsed = PulsedRig::new(Rig::start(), 50);
            pulsed.watched.enable();
            clock::sleep(Nanos::from_millis(200));
            let recent = pulsed.edges().last().copied().unwrap_or_default();
            if clock::now() - recent > Nanos::from_millis(25) {
                // The machine stalled under enabled drives: latched, as it should be.
                without += 1;
                continue;
            }
            let begin = clock::now();
            act(&mut pulsed);
            let last = pulsed.last_edge();
            spans.push(if last > begin { last - begin } else { Nanos::ZERO });
        }
        print_spans(name, spans, 60, &format!("{without} without a pulse before"));
    }
}
