//! All properties hold in all interleavings, and each fails without its guard.
#![allow(clippy::unwrap_used, reason = "a test may")]

use i2ris_verification::{Guard, Guards, System};
use stateright::{Checker, HasDiscoveries, Model};

/// States that the gate looks at; the whole is for `every_state`.
const GATE_STATES: usize = 300_000;

/// Breadth first: all runs up to some length, and then some.
#[test]
fn no_property_fails_in_the_first_states() {
    let checker = System::default().checker().target_state_count(GATE_STATES);
    let checker = checker.spawn_bfs().join();
    println!(
        "{} states, {} actions deep",
        checker.unique_state_count(),
        checker.max_depth()
    );
    let properties = System::default().properties();
    for property in properties {
        if matches!(property.expectation, stateright::Expectation::Always) {
            checker.assert_no_discovery(property.name);
        }
    }
}

#[test]
#[ignore = "takes minutes: `cargo run --release -p i2ris-verification --example check` does the same"]
fn no_property_fails_in_any_state() {
    let checker = System::default().checker().threads(2).spawn_bfs().join();
    assert!(checker.is_done());
    assert!(checker.unique_state_count() > 1_000_000);
    checker.assert_properties();
}

#[test]
fn every_property_fails_without_its_guard() {
    for guard in Guard::ALL {
        let guards = Guards::without(guard);
        let name = guard.property();
        let checker = System { guards }.checker();
        let checker = checker
            .finish_when(HasDiscoveries::AnyOf([name].into()))
            .spawn_bfs()
            .join();
        let path = checker.discovery(name);
        let path = path.unwrap_or_else(|| panic!("without {guard:?}, {name} still holds"));
        println!("without {guard:?}: {:?}", path.into_actions());
    }
}
