//! Faulty and foreign clients next to an honest one: they cannot displace its commands, and every
//! client receives only its own refusals.

use i2ris::ipc::MaskedClientId;

use super::*;

/// Changes that a hostile client makes to every command.
#[derive(Debug, Clone, Copy)]
struct Hostile {
    client_id: u64,
    /// Added to the present time, ms.
    ahead_ms: u64,
    /// Goal of the first joint or motor.
    value: f64,
    refusal: Refusal,
}

/// Every kind: a stamp in the future, no identity, a value that is not finite (only angles can be),
/// and a command that only the loop can refuse, with the newest stamp that is allowed.
const HOSTILE: [Hostile; 4] = [
    Hostile { client_id: 101, ahead_ms: 1000, value: 0.0, refusal: Refusal::Stamp },
    Hostile { client_id: 0, ahead_ms: 0, value: 0.0, refusal: Refusal::Malformed },
    Hostile { client_id: 103, ahead_ms: 0, value: f64::NAN, refusal: Refusal::NotFinite },
    Hostile { client_id: 104, ahead_ms: 1, value: 1e6, refusal: Refusal::StepTooLarge },
];

impl Hostile {
    /// Sends as fast as the loop takes commands, on one stream, until `done`.
    fn send_until(self, domain: &Domain, in_counts: bool, done: &AtomicBool) {
        let mut forwarder = Forwarder::new(domain);
        let mut sequence = 0;
        while !done.load(Ordering::Relaxed) {
            let now = clock::now();
            let (stamp_ns, client_id) =
                ((now + Nanos::from_millis(self.ahead_ms)).0, self.client_id);
            sequence += 1;
            // Fails when the controller ends.
            let _ = if in_counts {
                forwarder.servo_actuators(ServoActuator {
                    sequence,
                    stamp_ns,
                    client_id,
                    position_counts: [self.value as i32, 0],
                    count: 2,
                    ..ServoActuator::default()
                })
            } else {
                forwarder.servo_jp(ServoJp {
                    sequence,
                    stamp_ns,
                    client_id,
                    position: [self.value, 0.0, 0.0],
                    count: 2,
                    ..ServoJp::default()
                })
            };
            clock::sleep(Nanos::from_millis(1));
        }
    }
}

/// Runs `work` while every kind of hostile client sends on one stream.
fn besieged<T>(domain: &Domain, in_counts: bool, work: impl FnOnce() -> T) -> T {
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        let _stop = SetOnDrop(&done);
        for hostile in HOSTILE {
            if !(in_counts && hostile.value.is_nan()) {
                let done = &done;
                scope.spawn(move || hostile.send_until(domain, in_counts, done));
            }
        }
        work()
    })
}

fn wait_until_refused(client: &mut Client, client_id: u64) -> Refusal {
    let refused = |state: &OperatingStateMsg| state.refusals_of(client_id).0 > 10;
    wait_for(client, refused).refusals_of(client_id).1
}

/// The honest client holds its motors.
fn still(_: f64) -> [i32; 2] {
    [0, 0]
}

/// Streams as the honest client; the others do not affect it.
fn assert_followed(rig: &Rig, client: &mut Client, target: i32) {
    let start = rig.positions()[0];
    let accepted = wait_for(client, |_| true).accepted;
    stream_counts(client, 1.5, |t| {
        let share = (t / 1.0).min(1.0);
        [start + (f64::from(target - start) * share) as i32, 0]
    });
    let state = wait_for(client, |_| true);
    assert!(state.accepted > accepted, "{state:?}");
    assert_eq!(state.refusals_of(client.id()), (0, Refusal::None));
    let [first, _] = rig.positions();
    assert!((first - target).abs() <= 20, "{first}: {state:?}");
}

#[test]
fn hostile_clients_on_either_stream_do_not_displace_the_commander() {
    let mut rig = Rig::with_model();
    let mut client = rig.enabled();
    let domain = rig.domain();
    for in_counts in [false, true] {
        besieged(&domain, in_counts, || {
            // The lease is free at first, then held.
            wait_until_refused(&mut client, 104);
            assert_eq!(wait_for(&mut client, |_| true).lease_client_id, 0);
            assert_followed(&rig, &mut client, 200);
            assert_followed(&rig, &mut client, 0);
        });
        // Until the lease and the entries of refusals are free.
        wait_for(&mut client, |state| state.lease_client_id == 0);
    }
}

/// Not a test of its own: a process that commands under the id of another client.
#[test]
#[ignore = "a role: run by another test"]
fn forger_process() {
    let Ok(domain) = std::env::var("RIG_DOMAIN") else { return };
    let client_id = std::env::var("RIG_CLIENT").unwrap().parse().unwrap();
    let domain = Domain::new(&domain).unwrap();
    let (mut forwarder, mut requests) = (Forwarder::new(&domain), RequestForwarder::new(&domain));
    let command = StateCommand::Release.number();
    let release = StateCommandRequest { client_id, command, ..StateCommandRequest::default() };
    loop {
        for sequence in [1_000_000, u64::MAX - 1, u64::MAX] {
            let stamp_ns = clock::now().0;
            let command = ServoActuator {
                sequence,
                stamp_ns,
                client_id,
                position_counts: [300, 300],
                count: 2,
                ..ServoActuator::default()
            };
            let _ = forwarder.servo_actuators(command);
            clock::sleep(Nanos::from_millis(2));
        }
        let _ = requests.state_command(release);
    }
}

#[test]
fn forged_id_neither_moves_snake_nor_ends_owners_lease() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    stream_counts(&client, 0.2, still);
    let before = wait_for(&mut client, |state| state.lease_client_id != 0);
    assert_eq!(before.lease_client_id, client.id());
    let (id, role) = (client.id().to_string(), "process::hostile_clients::forger_process");
    let forger = Killed::role(role, &[("RIG_DOMAIN", &rig.config.domain), ("RIG_CLIENT", &id)]);
    while_streaming(&client, still, || {
        let mut watching = rig.client();
        let state = wait_for(&mut watching, |state| state.refused > before.refused + 50);
        assert_eq!(state.refusals_of(client.id()), (0, Refusal::None), "{state:?}");
        assert_eq!(state.lease_client_id, client.id());
        assert_eq!(state.last_refusal, Refusal::Lease.number());
    });
    drop(forger);
    assert!(rig.positions().iter().all(|counts| counts.abs() < 20), "{:?}", rig.positions());
}

#[test]
fn every_client_learns_of_its_own_refusals() {
    let mut rig = Rig::with_model();
    let mut client = rig.enabled();
    let domain = rig.domain();
    // With a free lease, and with one that the client takes and holds.
    besieged(&domain, false, || {
        for hostile in HOSTILE {
            let reason = wait_until_refused(&mut client, hostile.client_id);
            assert_eq!(reason, hostile.refusal, "{hostile:?}");
        }
        stream_counts(&client, 0.5, still);
        let state = wait_for(&mut client, |_| true);
        assert_eq!(state.refusals_of(client.id()), (0, Refusal::None));
        assert_eq!(state.refusals_of(101).1, Refusal::Stamp);
    });
    // The log folds them; accepted commands of the honest client do not end that.
    let log = rig.log_text("controller");
    for hostile in HOSTILE {
        let name = format!("refused {}", MaskedClientId(hostile.client_id));
        let lines = log.lines().filter(|line| line.contains(&name)).count();
        assert!((1..=4).contains(&lines), "{hostile:?}: {lines} lines\n{log}");
    }
    // A second commander learns that the lease is held; the holder is not.
    let second = rig.client();
    while_streaming(&client, still, || {
        let mut watching = rig.client();
        let holder = client.id();
        wait_for(&mut watching, |state| state.lease_client_id == holder);
        stream_counts(&second, 0.5, still);
        let id = second.id();
        let state = wait_for(&mut watching, |state| state.refusals_of(id).0 > 0);
        assert_eq!(state.refusals_of(id).1, Refusal::Lease);
        assert_eq!(state.refusals_of(holder), (0, Refusal::None));
    });
}
