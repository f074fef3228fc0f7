//! Random numbers for boot ids and client ids.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};

/// A random number that is not 0.
///
/// The standard library seeds every `RandomState` from the operating system, and SipHash turns the
/// seed into 64 bits. Unique enough to identify processes; not a secret.
#[must_use]
pub fn random_id() -> u64 {
    RandomState::new().build_hasher().finish().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_differ_and_are_not_zero() {
        let ids: std::collections::HashSet<u64> = (0..1000).map(|_| random_id()).collect();
        assert!(ids.len() == 1000 && !ids.contains(&0));
    }
}
