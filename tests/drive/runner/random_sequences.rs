use proptest::collection::vec;
use proptest::prelude::*;

use super::*;

/// An occurrence while the port thread runs.
#[derive(Debug, Clone)]
enum Occurrence {
    Demand(Demand),
    Target(i32),
    FaultReset,
    Home,
    Fault,
    /// Milliseconds until the drive answers again.
    Restart(u64),
    Disturb(Disturbance),
    Turns(usize),
}

fn occurrence() -> impl Strategy<Value = Occurrence> {
    prop_oneof![
        3 => Just(Occurrence::Demand(Demand::Enabled)),
        1 => Just(Occurrence::Demand(Demand::Disabled)),
        1 => Just(Occurrence::Demand(Demand::QuickStop)),
        4 => (-2200..2200).prop_map(Occurrence::Target),
        1 => Just(Occurrence::FaultReset),
        1 => Just(Occurrence::Home),
        1 => Just(Occurrence::Fault),
        1 => (30..900u64).prop_map(Occurrence::Restart),
        1 => Just(Occurrence::Disturb(Disturbance::LoseRequest)),
        1 => Just(Occurrence::Disturb(Disturbance::LoseReply)),
        1 => any::<usize>()
            .prop_map(|index| Occurrence::Disturb(Disturbance::FlipReply(index))),
        1 => (0..200u64).prop_map(|late| {
            Occurrence::Disturb(Disturbance::DelayReply(Nanos::from_millis(late)))
        }),
        8 => (1..60usize).prop_map(Occurrence::Turns),
    ]
}

proptest! {
    #![proptest_config(i2ris_testing::cases(64))]

    /// In every sequence: the motor is never powered with a target other than its position, no
    /// target outside the limits is written, nothing is powered without demand, or at the end.
    #[test]
    fn the_drive_is_safe_in_every_sequence(occurrences in vec(occurrence(), 1..80)) {
        let mut rig = PortRig::disabled();
        for occurrence in occurrences {
            match occurrence {
                Occurrence::Demand(demand) => rig.demand(demand),
                Occurrence::Target(target) => {
                    rig.request(|request| request.target = Counts(target));
                }
                Occurrence::FaultReset => rig.request(|request| request.fault_resets += 1),
                Occurrence::Home => rig.request(|request| request.homings += 1),
                Occurrence::Fault => rig.drive(|drive| drive.fail(0x8611)),
                Occurrence::Restart(boot) => rig.line.restart(NODE, Nanos::from_millis(boot)),
                Occurrence::Disturb(disturbance) => rig.line.disturb([disturbance]),
                Occurrence::Turns(count) => rig.turns(count),
            }
            rig.drive(|drive| {
                assert_eq!((drive.jumps, drive.starts_outside_homing), (0, 0));
                let targets = drive.written(0x607A, 0);
                assert!(targets.iter().all(|target| (*target as i32).abs() <= 2000));
                assert!((-2000..=2000).contains(&drive.position), "{}", drive.position);
            });
        }
        rig.line.state().disturbances.clear();
        rig.demand(Demand::Disabled);
        rig.until_feedback("is off", |feedback| {
            matches!(feedback.phase, AxisPhase::Disabled | AxisPhase::Faulted)
        });
        rig.turns(50);
        let is_off = matches!(rig.state(), SWITCH_ON_DISABLED | READY | FAULT);
        prop_assert!(is_off, "0x{:04X}", rig.state());
    }
}
