//! Keys: who may watch and who may command.
//!
//! | file | holds |
//! |---|---|
//! | `authority` | makes certificates, on the computer of the robot |
//! | `access` | the list of keys and of what they may do |
//! | `personal` | the key of one person, on the other computer |
//!
//! The folder of keys on the computer of the robot:
//!
//! | file | holds |
//! |---|---|
//! | `authority.pem`, `authority.key` | signs all certificates; its key stays here |
//! | `server.pem`, `server.key` | the end beside the controller |
//! | `access.toml` | [`AccessList`] |
//! | `people/ID/` | the key of a person: `ca.pem`, `certificate.pem`, `key.pem` |

mod access;
mod authority;
mod personal;

use std::path::{Path, PathBuf};

pub use access::{Access, AccessList, KeyEntry};
pub use authority::{Lifetime, make_key, revoke};
pub use personal::PersonalKey;

#[derive(Debug, thiserror::Error)]
#[error("{path}: {reason}")]
pub struct KeyError {
    pub path: PathBuf,
    /// What is wrong, and what would be right.
    pub reason: String,
}

/// Turns any error about a file into a [`KeyError`].
fn wrong<E: ToString>(path: &Path) -> impl Fn(E) -> KeyError {
    move |error| KeyError { path: path.to_owned(), reason: error.to_string() }
}
