//! Benchmarks of i2ris.
//!
//! | measurement | command |
//! |---|---|
//! | latencies: shared memory, loop, inverse, serial line, end to end | `i2ris bench` |
//! | instructions per call; needs valgrind | `i2ris bench instructions` |
//! | scikit-learn and the Python package `gmr` in the same run | `python3 tools/bench/peers.py` |
//! | faults injected into emulated drives | example `fault_campaign` |
//!
//! A latency has little meaning without the least latency that the machine allows. Every
//! measurement is a [`BenchOutcome`] with several variants. One of them is a floor. All variants
//! run in turns in the same run. Common alternatives are peers.
//!
//! | module | contains |
//! |---|---|
//! | [`durations`] | a histogram of durations and its percentiles |
//! | [`outcome`] | variants, quantities, ratios |
//! | [`placement`] | scheduling and processors of threads |
//! | [`machine`] | properties and load of the machine |
//! | [`ipc`], [`control_loop`], [`inverse`], [`wire`], [`e2e`] | the measurements |
//! | [`wire_rates`] | the serial line over baud rates and axes per port |
//! | [`scale`] | how cost grows with rows, components, plays, clients, axes, loop rate |
//! | [`compare`] | medians of two versions from repeated runs |
//! | [`bare_loop`] | a loop that only talks to a drive: the floor of the serial line |
//! | [`output`] | outcomes as JSON, HDR histogram log, figure and page |
//! | [`model`], [`workload`] | models of any size, and the queries of the control loop |
//! | [`tick`] | a tick of the controller with ideal drives |

pub mod bare_loop;
pub mod compare;
pub mod control_loop;
pub mod durations;
pub mod e2e;
mod error;
pub mod inverse;
pub mod ipc;
pub mod machine;
pub mod model;
pub mod outcome;
pub mod output;
pub mod placement;
pub mod scale;
pub mod tick;
pub mod wire;
pub mod wire_rates;
pub mod workload;

pub use durations::{DurationPercentiles, Durations};
pub use error::BenchError;
pub use outcome::{BenchOutcome, Quantity, Role, Variant};
pub use placement::ThreadPlacement;
