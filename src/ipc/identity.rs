//! Numbers that nobody else has: boot ids and client ids.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};

/// A random number that is not 0.
///
/// The standard library seeds every `RandomState` from the operating system, and SipHash turns the
/// seed into 64 bits. Good for telling processes apart; no secret.
#[must_use]
pub fn random_id() -> u64 {
    RandomState::new().build_hasher().finish().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_ids_differ_and_none_is_zero() {
        let ids: std::collections::HashSet<u64> = (0..1000).map(|_| random_id()).collect();
        assert_eq!(ids.len(), 1000);
        assert!(!ids.contains(&0));
    }
}
