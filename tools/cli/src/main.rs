//! The command line of i2ris.
fn main() {}
