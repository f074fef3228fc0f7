//! The README and the manual against the programs: commands run as printed, options exist, links
//! lead somewhere, listings are the files.
#![allow(clippy::unwrap_used, reason = "a test may")]
#![allow(clippy::print_stderr, reason = "a test shows the command that it runs")]

mod commands;
mod links;
mod markdown;
mod printed;
