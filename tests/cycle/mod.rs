//! The control cycle against simulated drives, on simulated time: see [`i2ris_testing::cycle`].

mod auxiliary_axis;
mod broken_off;
mod command_admission;
mod command_flags;
mod command_table;
mod conditioning;
mod enabling;
mod endurance;
mod faults;
mod following;
mod gate;
mod goal_making;
mod model_swap;
mod move_and_clutch;
mod network;
mod pairs;
mod random_inputs;
mod rates_and_tip;
mod reach;
mod reasons;
mod rehearsal;
mod replay;
mod report;
mod shutdown;
mod stopping;
mod virtual_fixtures;
