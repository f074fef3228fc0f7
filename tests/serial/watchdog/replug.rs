//! After a replug, controller and watchdog reopen the port in any order: either the watchdog
//! reconnects, or enabling is refused with the reason.

use super::*;

impl WatchedRig {
    fn count(&self, line: &str) -> usize {
        self.log_text().matches(line).count()
    }

    fn reconnects(&self) -> usize {
        self.rig.log_text("controller").matches("answers again").count()
    }

    fn signal_watchdog(&self, signal: Signal) {
        kill(Pid::from_raw(self.watchdog.id() as i32), signal).unwrap();
    }

    /// Unplugs a drive and plugs it in again. `is_late`: the watchdog is suspended until the
    /// controller has the port again, which is the order that it used to lose.
    fn replug(&mut self, for_ms: u64, is_late: bool) {
        let (held, reconnects) = (self.count("holding"), self.reconnects());
        if is_late {
            self.signal_watchdog(Signal::SIGSTOP);
        }
        self.rig.emulator.inject(0, Injection::HangUp { for_ms });
        wait_until("the controller has the drive again", || self.reconnects() > reconnects);
        let mut client = self.client.take().unwrap();
        wait_until("the fault is acknowledged", || {
            client.state_command(StateCommand::Acknowledge).is_ok()
        });
        wait_until_idle(&mut client);
        if is_late {
            let refused = client.state_command(StateCommand::Enable).unwrap_err().to_string();
            assert!(refused.contains("the watchdog is running, but cannot stop"), "{refused}");
            self.signal_watchdog(Signal::SIGCONT);
        }
        wait_until("the watchdog holds the port again", || self.count("holding") > held);
        wait_until("enabled", || client.state_command(StateCommand::Enable).is_ok());
        settle(&mut client, |state| state.state == OperatingState::Enabled.number());
        // To others it is as closed as ever.
        assert!(is_locked(&self.rig.config.ports[0].device));
        self.client = Some(client);
    }

    fn replug_often(&mut self, times: u64) {
        // Pull the cable at no fixed phase of either process.
        let mut seed = 7u64;
        for time in 0..times {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(time);
            self.replug(20 + (seed >> 40) % 500, time % 2 == 0);
        }
    }
}

#[test]
fn h03_watchdog_reconnects_after_replug_whichever_is_first() {
    let _turn = in_turn();
    WatchedRig::new(3000).replug_often(4);
}

#[test]
#[ignore = "minutes"]
fn h03_watchdog_reconnects_after_hundred_replugs() {
    let _turn = in_turn();
    WatchedRig::new(3000).replug_often(100);
}

#[test]
fn h03_watchdog_started_after_controller_connects() {
    let _turn = in_turn();
    let mut rig = Rig::start();
    let client = rig.enabled();
    let mut watched = WatchedRig::without_controller(rig, 3000);
    watched.until_logged("watching");
    watched.client = Some(client);
    watched.end_with(Signal::SIGKILL);
    watched.until_stopped();
}
