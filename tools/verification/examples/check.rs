//! Checks all states, prints how many there are, and how each property fails without its guard.
//! With a number: at most about as many states.
#![allow(clippy::print_stdout, reason = "prints its result")]

use std::time::Instant;

use i2ris_verification::{Guard, Guards, System};
use stateright::{Checker, HasDiscoveries, Model};

fn main() {
    let most = std::env::args().nth(1).and_then(|most| most.parse().ok());
    let start = Instant::now();
    let builder = System::default().checker().threads(2);
    let checker = builder.target_state_count(most.unwrap_or(usize::MAX)).spawn_bfs().join();
    println!(
        "{} states, {} transitions, {} actions deep, {:.1} s",
        checker.unique_state_count(),
        checker.state_count(),
        checker.max_depth(),
        start.elapsed().as_secs_f64()
    );
    for (name, path) in checker.discoveries() {
        println!("{name}: {:?}", path.into_actions());
    }
    for guard in Guard::ALL {
        let (guards, name, start) = (Guards::without(guard), guard.property(), Instant::now());
        let checker = System { guards }
            .checker()
            .target_state_count(most.unwrap_or(usize::MAX))
            .finish_when(HasDiscoveries::AnyOf([name].into()))
            .spawn_bfs()
            .join();
        let actions = checker.discovery(name).map(|path| path.into_actions());
        println!(
            "without {guard:?}: {name}: {} states, {:.1} s, {actions:?}",
            checker.unique_state_count(),
            start.elapsed().as_secs_f64()
        );
    }
}
