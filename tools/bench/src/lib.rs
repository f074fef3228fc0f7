//! Benchmarks of i2ris.
//!
//! | what | how |
//! |---|---|
//! | latencies: shared memory, loop, inverse, serial line, all of them together | `i2ris bench`, on [`ipc`], [`ticks`], [`inverse`], [`wire`], [`e2e`] |
//! | time of a call | `cargo bench -p i2ris-bench` |
//! | instructions, which no other load on the machine changes; takes valgrind | `i2ris bench instructions` |
//! | scikit-learn and the Python package `gmr` in the same run | `python3 tools/bench/peers.py` |
//!
//! A latency means little without what the machine itself needs for it. So every measurement is an
//! [`Outcome`]: ways of doing a thing, among them a floor, measured in the same run and in turns
//! with the others, and what everybody has as peers.
//!
//! | module | holds |
//! |---|---|
//! | [`spans`] | many spans, and the few numbers that tell of them |
//! | [`outcome`] | ways, quantities, ratios |
//! | [`seat`] | where threads run, and what they were granted |
//! | [`machine`] | what was measured on, what else it did meanwhile, and what that lets nobody conclude |
//! | [`ipc`], [`ticks`], [`inverse`], [`wire`], [`e2e`] | the measurements |
//! | [`bare`] | a drive asked by nothing but a loop: the floor of everything that ends on a line |
//! | [`show`] | outcomes as JSON, as HDR histogram log, as figure, as page |
//! | [`model`], [`way`] | models of any size, and what the control loop asks of them |

pub mod bare;
pub mod e2e;
mod error;
pub mod inverse;
pub mod ipc;
pub mod machine;
pub mod model;
pub mod outcome;
pub mod seat;
pub mod show;
pub mod spans;
pub mod ticks;
pub mod way;
pub mod wire;

pub use error::BenchError;
pub use outcome::{Outcome, Quantity, Role, Way};
pub use seat::Seats;
pub use spans::{Spans, Summary};

/// Components of the mixtures that are measured.
pub const COMPONENTS: [usize; 3] = [3, 10, 20];

/// Plays per motor beside that of threshold 0.
pub const PLAYS: [usize; 4] = [0, 4, 8, 12];
