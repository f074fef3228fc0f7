//! Tests of the model runtime through its public interface.

mod conformance;
mod file;
mod force_balance;
mod gmr;
mod hull;
mod inverse;
mod linear;
mod network;
mod plays;
mod refusals;
