//! All properties hold in the first million states, and each fails without its guard.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

use i2ris_verification::{Guard, Guards, System};
use stateright::{Checker, HasDiscoveries, Model};

/// Transitions that the gate follows; the example `check` goes further.
const GATE_TRANSITIONS: usize = 8_000_000;

/// Breadth first: all runs up to some length, and then some.
#[test]
fn no_property_fails_in_the_first_states() {
    let checker = System::default().checker().threads(2);
    let checker = checker.target_state_count(GATE_TRANSITIONS).spawn_bfs().join();
    let states = checker.unique_state_count();
    println!("{states} states, runs of {} actions", checker.max_depth());
    assert!(states > 1_000_000, "{states} states");
    checker.assert_properties();
}

#[test]
fn every_property_fails_without_its_guard() {
    for guard in Guard::ALL {
        let guards = Guards::without(guard);
        let name = guard.property();
        let checker = System { guards }.checker();
        let checker = checker.finish_when(HasDiscoveries::AnyOf([name].into())).spawn_bfs().join();
        let path = checker.discovery(name);
        let path = path.unwrap_or_else(|| panic!("without {guard:?}, {name} still holds"));
        println!("without {guard:?}: {:?}", path.into_actions());
    }
}
