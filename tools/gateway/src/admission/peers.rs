//! Those that take part.

use std::collections::BTreeMap;

use i2ris::units::Nanos;

use super::Reason;

/// A bounded number of those that take part, and when each was heard last.
#[derive(Debug)]
pub struct Peers<K, T> {
    limit: usize,
    known: BTreeMap<K, (Nanos, T)>,
}

impl<K: Ord + Clone, T> Peers<K, T> {
    #[must_use]
    pub const fn new(limit: usize) -> Self {
        Self { limit, known: BTreeMap::new() }
    }

    /// Notes that one was heard now.
    pub fn heard(&mut self, key: &K, now: Nanos) -> Option<&mut T> {
        let (heard, peer) = self.known.get_mut(key)?;
        *heard = now;
        Some(peer)
    }

    pub fn get_mut(&mut self, key: &K) -> Option<&mut T> {
        self.known.get_mut(key).map(|(_, peer)| peer)
    }

    /// Takes a new one.
    ///
    /// # Errors
    ///
    /// [`Reason::Full`].
    pub fn join(&mut self, key: K, peer: T, now: Nanos) -> Result<(), Reason> {
        if self.known.len() >= self.limit {
            return Err(Reason::Full);
        }
        self.known.insert(key, (now, peer));
        Ok(())
    }

    /// Notes that one was heard, which is a new one if it is not known. It takes the place of the
    /// one that has been silent for longest: who comes as another one with every message does not
    /// fill the memory.
    pub fn heard_or_new(&mut self, key: &K, now: Nanos) -> &mut T
    where
        T: Default,
    {
        if !self.known.contains_key(key) && self.known.len() >= self.limit {
            let oldest = self.known.iter().min_by_key(|(_, (heard, _))| *heard);
            if let Some(oldest) = oldest.map(|(key, _)| key.clone()) {
                self.known.remove(&oldest);
            }
        }
        let (heard, peer) = self.known.entry(key.clone()).or_default();
        *heard = now;
        peer
    }

    /// One that has been silent for longer than this.
    pub fn silent(&self, now: Nanos, longest: Nanos) -> Option<K> {
        let silent = |(_, (heard, _)): &(&K, &(Nanos, T))| now.since(*heard) > longest;
        self.known.iter().find(silent).map(|(key, _)| key.clone())
    }

    pub fn keys(&self) -> impl Iterator<Item = &K> {
        self.known.keys()
    }

    pub fn values(&self) -> impl Iterator<Item = &T> {
        self.known.values().map(|(_, peer)| peer)
    }

    pub fn iter_mut(&mut self) -> impl Iterator<Item = (&K, &mut T)> {
        self.known.iter_mut().map(|(key, (_, peer))| (key, peer))
    }

    pub fn first(&self) -> Option<K> {
        self.known.keys().next().cloned()
    }

    pub fn remove(&mut self, key: &K) {
        self.known.remove(key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(ms: u64) -> Nanos {
        Nanos::from_millis(ms)
    }

    #[test]
    fn one_more_is_refused_or_takes_the_place_of_the_most_silent() {
        let mut peers = Peers::<u8, ()>::new(2);
        assert_eq!(peers.join(1, (), ms(1)), Ok(()));
        assert_eq!(peers.join(2, (), ms(2)), Ok(()));
        assert_eq!(peers.join(3, (), ms(3)), Err(Reason::Full));
        assert!(peers.heard(&1, ms(4)).is_some());
        peers.heard_or_new(&3, ms(5));
        assert!(peers.get_mut(&1).is_some() && peers.get_mut(&2).is_none());
        assert_eq!(peers.silent(ms(14), ms(10)), None);
        assert_eq!(peers.silent(ms(15), ms(10)), Some(1));
    }
}
