//! The version of the model files.

/// The value of the field `format` in every model file.
pub const FORMAT: &str = "i2ris-model";

/// The version of the schema that this software writes and the only one that it reads.
pub const SCHEMA_VERSION: u32 = 1;

/// The families that are read, as a file names them.
pub const FAMILIES: [&str; 5] = ["linear", "gmr", "gmr-play", "force-balance", "network"];
