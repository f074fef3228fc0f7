//! Known participants.

use std::collections::BTreeMap;

use i2ris::units::Nanos;

/// A bounded number of participants, and the last message of each.
#[derive(Debug)]
pub struct Peers<K, T> {
    limit: usize,
    known: BTreeMap<K, (Nanos, T)>,
}

impl<K: Ord + Clone, T> Peers<K, T> {
    pub const fn new(limit: usize) -> Self {
        Self { limit, known: BTreeMap::new() }
    }

    pub fn get_mut(&mut self, key: &K) -> Option<&mut T> {
        self.known.get_mut(key).map(|(_, peer)| peer)
    }

    /// Records a message of a participant. A new one replaces the one that has been silent for
    /// longest: a sender that changes its identity with every message does not fill the memory.
    pub fn known_or_new(&mut self, key: &K, now: Nanos) -> &mut T
    where
        T: Default,
    {
        if !self.known.contains_key(key) && self.known.len() >= self.limit {
            let oldest = self.known.iter().min_by_key(|(_, (last_seen, _))| *last_seen);
            if let Some(oldest) = oldest.map(|(key, _)| key.clone()) {
                self.known.remove(&oldest);
            }
        }
        let (last_seen, peer) = self.known.entry(key.clone()).or_default();
        *last_seen = now;
        peer
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_more_replaces_the_most_silent() {
        let mut peers = Peers::<u8, ()>::new(2);
        for (key, at) in [(1, 1), (2, 2), (1, 4), (3, 5)] {
            peers.known_or_new(&key, Nanos::from_millis(at));
        }
        assert!(peers.get_mut(&1).is_some() && peers.get_mut(&2).is_none());
    }
}
