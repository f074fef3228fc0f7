//! Benchmarks of the models of i2ris.
//!
//! | what | how |
//! |---|---|
//! | time | `cargo bench -p i2ris-bench` |
//! | instructions, which no other load on the machine changes; takes valgrind | `cargo run --release -p i2ris-bench -- instructions` |
//! | scikit-learn and the Python package `gmr` in the same run | `python3 tools/bench/peers.py` |
//!
//! [`model`] makes the models, [`way`] what the control loop asks of them.

pub mod model;
pub mod way;

/// Components of the mixtures that are measured.
pub const COMPONENTS: [usize; 3] = [3, 10, 20];

/// Plays per motor beside that of threshold 0.
pub const PLAYS: [usize; 4] = [0, 4, 8, 12];
