//! Writes the Python module of all reasons:
//! `cargo run -p i2ris-record --example python_reasons > tools/python/i2ris/reasons.py`.
#![allow(clippy::print_stdout, reason = "its output is the file")]

fn main() {
    print!("{}", i2ris_record::other_languages::python_reasons());
}
