//! H06, H10: a zero that is lost, ticks that are missed.

use i2ris::clock;
use i2ris::ipc::client::ClientError;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;
use i2ris_testing::{Rig, has, settle_in, stream_counts, wait_for, wait_until, wait_until_holding};
use nix::sys::signal::Signal;

#[test]
fn h06_power_cycled_drive_must_be_homed_again() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    client.state_command(StateCommand::Disable).unwrap();
    settle_in(&mut client, OperatingState::Disabled);
    rig.emulator.power_cycle(0);
    wait_for(&mut client, |state| !has(state, OperatingStateMsg::HOMED));
    let restarting = [Refusal::DrivesNotReady, Refusal::Busy, Refusal::InFault];
    for _ in 0..2000 {
        match client.state_command(StateCommand::Enable).unwrap_err() {
            ClientError::Refused { refusal, .. } if restarting.contains(&refusal) => {
                // A fault during the restart is acknowledged as an operator would.
                let _ = client.state_command(StateCommand::Acknowledge);
                clock::sleep(Nanos::from_millis(10));
            }
            ClientError::Refused { refusal, .. } => return assert_eq!(refusal, Refusal::NotHomed),
            error => panic!("{error}"),
        }
    }
    panic!("the drive does not restart");
}

/// A stopped process misses about 300 ticks at once. It counts them and does not run them.
#[test]
fn h10_missed_ticks_are_counted_and_not_caught_up() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    let mut statistics = client.watcher().period_statistics();
    stream_counts(&client, 0.5, |t| [(400.0 * t) as i32, 0]);
    rig.signal(Signal::SIGSTOP);
    clock::sleep(Nanos::from_millis(300));
    rig.signal(Signal::SIGCONT);
    wait_until_holding(&mut client);
    wait_until("300 missed ticks are counted", || {
        let newest = statistics.newest().unwrap();
        newest.filter(|message| message.total_missed >= 200)
    });
}
