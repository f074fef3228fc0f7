//! Writes the C++ header:
//! `cargo run -p i2ris-record --example cpp_header > tools/cpp/i2ris_payload.hpp`.
#![allow(clippy::print_stdout, reason = "its output is the file")]

fn main() {
    print!("{}", i2ris_record::other_languages::cpp_header());
}
