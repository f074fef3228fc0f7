//! A model of the whole system, checked in all interleavings: two commanders, one of them connected
//! through a middleware that delays and repeats, the controller, its serial line, the drive, and
//! the watchdog. Everything may fail at any time, and any number of times.
//!
//! # What is real and what is model
//!
//! Admission of commands, lease, deadline ([`i2ris::core`]) and the heartbeat monitor of the
//! watchdog ([`i2ris::watchdog`]) are the functions that the programs run. The states of robot and
//! drive are a model, small enough to be exhausted, and so is the gate: see
//! `controller::move_setpoints`. The state machine itself is tested in every state with every
//! command by the tests of the cycle.
//!
//! # Time
//!
//! Time passes in steps. In one step the watchdog looks once and the loop runs once; between two
//! steps anything else may happen, in any order. All times are ages, and ages beyond every limit
//! are the same, so the states do not depend on how long the model has run.
#![cfg(test)]
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

mod controller;
mod environment;
mod guard;
mod properties;
mod state;
mod system;

use guard::{GUARDS, Guards};
use stateright::{Checker, HasDiscoveries, Model};
use system::System;

/// Checks this many transitions, breadth first: all runs up to some length, and some longer ones.
fn check_first(transitions: usize) -> usize {
    let checker = System::default().checker().threads(2);
    let checker = checker.target_state_count(transitions).spawn_bfs().join();
    let states = checker.unique_state_count();
    println!("{states} states, runs of {} actions", checker.max_depth());
    checker.assert_properties();
    states
}

#[test]
fn no_property_fails_in_the_first_states() {
    assert!(check_first(8_000_000) > 1_000_000);
}

#[test]
fn every_property_fails_without_its_guard() {
    for (guard, name) in GUARDS {
        let checker = System { guards: Guards::without(guard) }.checker();
        let checker = checker.finish_when(HasDiscoveries::AnyOf([name].into())).spawn_bfs().join();
        let path = checker.discovery(name);
        let path = path.unwrap_or_else(|| panic!("without {guard:?}, {name} still holds"));
        println!("without {guard:?}, not {name}: {:?}", path.into_actions());
    }
}

/// Checks the number of transitions in `I2RIS_TRANSITIONS`.
#[test]
#[ignore = "minutes and a gigabyte"]
fn no_property_fails_further_out() {
    let transitions = std::env::var("I2RIS_TRANSITIONS");
    check_first(transitions.map_or(30_000_000, |number| number.parse().unwrap()));
}
