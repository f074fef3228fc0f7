//! The README and the manual against the programs: commands run as printed, options exist, links
//! lead somewhere, listings are the files.

mod commands;
mod links;
mod markdown;
mod printed;
