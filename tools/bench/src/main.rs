//! What the benchmarks cannot do in one process: count instructions under valgrind, and fit what
//! another program hands over; see the crate's documentation.
#![allow(clippy::print_stdout, reason = "a program that prints results")]

mod instructions;
mod peers;

use std::env;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        ["instructions"] => instructions::table(),
        ["repeat", call, components, plays, rounds] => {
            instructions::repeat(call, components.parse()?, plays.parse()?, rounds.parse()?)
        }
        ["peers", file] => peers::answer(file),
        _ => Err("usage: i2ris-bench instructions | peers FILE.json".into()),
    }
}
