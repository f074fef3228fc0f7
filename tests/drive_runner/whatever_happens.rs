use proptest::collection::vec;
use proptest::prelude::*;

use super::*;

/// Something that happens while the port thread runs.
#[derive(Debug, Clone)]
enum Happening {
    Demand(Demand),
    Target(i32),
    FaultReset,
    Home,
    Fault,
    /// Takes so many milliseconds.
    Restart(u64),
    Mischief(Mischief),
    Turns(usize),
}

fn happening() -> impl Strategy<Value = Happening> {
    prop_oneof![
        3 => Just(Happening::Demand(Demand::Enabled)),
        1 => Just(Happening::Demand(Demand::Disabled)),
        1 => Just(Happening::Demand(Demand::QuickStop)),
        4 => (-2200..2200).prop_map(Happening::Target),
        1 => Just(Happening::FaultReset),
        1 => Just(Happening::Home),
        1 => Just(Happening::Fault),
        1 => (30..900u64).prop_map(Happening::Restart),
        1 => Just(Happening::Mischief(Mischief::LoseRequest)),
        1 => Just(Happening::Mischief(Mischief::LoseReply)),
        1 => any::<usize>().prop_map(|place| Happening::Mischief(Mischief::FlipReply(place))),
        1 => (0..200u64).prop_map(|late| Happening::Mischief(Mischief::DelayReply(Nanos::from_millis(late)))),
        8 => (1..60usize).prop_map(Happening::Turns),
    ]
}

proptest! {
    /// Whatever happens: the motor is never powered on another target than its position, no target
    /// outside the limits is written, nothing is powered that no one demands, and in the end
    /// everything is off.
    #[test]
    fn the_drive_is_safe_whatever_happens(happenings in vec(happening(), 1..80)) {
        let mut rig = Rig::disabled();
        for happening in happenings {
            match happening {
                Happening::Demand(demand) => rig.demand(demand),
                Happening::Target(target) => rig.request(|request| request.target = Counts(target)),
                Happening::FaultReset => rig.request(|request| request.fault_resets += 1),
                Happening::Home => rig.request(|request| request.homings += 1),
                Happening::Fault => rig.drive(|drive| drive.fail(0x8611)),
                Happening::Restart(boot) => rig.bench.restart(NODE, Nanos::from_millis(boot)),
                Happening::Mischief(mischief) => rig.bench.misbehave([mischief]),
                Happening::Turns(count) => rig.turns(count),
            }
            rig.drive(|drive| {
                assert_eq!((drive.jumps, drive.starts_outside_homing), (0, 0));
                assert!(drive.written(0x607A, 0).iter().all(|target| (*target as i32).abs() <= 2000));
                assert!((-2000..=2000).contains(&drive.position), "{}", drive.position);
            });
        }
        rig.bench.world().mischief.clear();
        rig.demand(Demand::Disabled);
        rig.until_it("comes to rest", |feedback| {
            matches!(feedback.phase, AxisPhase::Disabled | AxisPhase::Faulted)
        });
        rig.turns(50);
        let state = rig.drive(|drive| drive.state);
        prop_assert!(matches!(state, SWITCH_ON_DISABLED | READY | FAULT), "0x{:04X}", state);
    }
}
