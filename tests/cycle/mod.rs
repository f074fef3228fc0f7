//! The control cycle against simulated drives, on simulated time: see [`i2ris_testing::cycle`].

mod authority;
mod auxiliary_axis;
mod broken_off;
mod command_admission;
mod command_flags;
mod command_table;
mod conditioning;
mod effects;
mod enabling;
mod faults;
mod following;
mod gaps;
mod gate;
mod goal_making;
mod model_swap;
mod monitors;
mod move_and_clutch;
mod network;
mod pairs;
mod rates_and_tip;
mod reach;
mod reasons;
mod rehearsal;
mod replay;
mod report;
mod sessions;
mod shutdown;
mod stopping;
mod virtual_fixtures;

/// Some tests have families of their own, or none.
#[test]
fn other_families_fly_too() {
    // Who may do what asks no model, and takes a minute and a half with a fitted one.
    let own = "--skip=pairs:: --skip=network:: --skip=endurance:: --skip=_family --skip=reach:: \
               --skip=who_may_do";
    let filter: Vec<&str> = "cycle::".split(' ').chain(own.split(' ')).collect();
    i2ris_testing::cycle::with_other_families(&filter);
}
