//! Ownership of client ids.
//!
//! A client id is a number in a payload, and every process that has seen it can write it. So an id
//! belongs to the process that used it first, by the port that sent it. The same number from a
//! different process stands for a different client, with an unpredictable id: it cannot renew the
//! owner's lease, use up its sequence numbers, or release the lease.
//!
//! An id stays with its owner after the lease, so that it cannot be taken in a pause. Owners come
//! and go, so the table is bounded: an owner displaces its own oldest id, and a new one the id that
//! was silent for longest.

use std::collections::BTreeMap;
use std::hash::{BuildHasher, Hash, RandomState};

/// Ids of one owner: `i2ris start ros` speaks for several clients.
const IDS_PER_OWNER: usize = 64;
/// Ids of all owners.
const IDS: usize = 512;

/// The owner of every client id that was used lately.
#[derive(Debug)]
pub(super) struct Identities<K> {
    owned: BTreeMap<u64, Owned<K>>,
    uses: u64,
    salt: RandomState,
}

#[derive(Debug)]
struct Owned<K> {
    owner: K,
    last_use: u64,
}

impl<K> Default for Identities<K> {
    fn default() -> Self {
        Self { owned: BTreeMap::new(), uses: 0, salt: RandomState::new() }
    }
}

impl<K: Clone + Eq + Hash> Identities<K> {
    /// The client that `owner` means by `client_id`: that id if the owner has it or it is free, and
    /// a different id if it belongs to another owner. 0 means no id and stays 0.
    pub(crate) fn resolve(&mut self, owner: &K, client_id: u64) -> u64 {
        if client_id == 0 {
            return 0;
        }
        self.uses += 1;
        match self.owned.get_mut(&client_id) {
            Some(known) if known.owner == *owner => known.last_use = self.uses,
            Some(_) => return self.salt.hash_one((owner, client_id)).max(1),
            None => {
                self.make_room(owner);
                let owned = Owned { owner: owner.clone(), last_use: self.uses };
                self.owned.insert(client_id, owned);
            }
        }
        client_id
    }

    fn make_room(&mut self, owner: &K) {
        let own = self.owned.values().filter(|owned| owned.owner == *owner).count();
        let is_full = own >= IDS_PER_OWNER;
        if !is_full && self.owned.len() < IDS {
            return;
        }
        let candidates = self.owned.iter().filter(|(_, it)| !is_full || it.owner == *owner);
        let oldest = candidates.min_by_key(|(_, owned)| owned.last_use);
        if let Some(oldest) = oldest.map(|(client_id, _)| *client_id) {
            self.owned.remove(&oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_belongs_to_the_first_that_used_it() {
        let mut identities = Identities::default();
        assert_eq!(identities.resolve(&"alice", 7), 7);
        let forged = identities.resolve(&"bob", 7);
        assert!(![0, 7].contains(&forged));
        assert_eq!(identities.resolve(&"bob", 7), forged, "one client, not one per command");
        assert_ne!(identities.resolve(&"carol", 7), forged);
        assert_eq!(identities.resolve(&"bob", 8), 8, "his own");
        assert_eq!(identities.resolve(&"alice", 7), 7);
        assert_eq!(identities.resolve(&"alice", 0), 0);
    }

    #[test]
    fn owner_of_many_ids_displaces_its_own() {
        let mut identities = Identities::default();
        identities.resolve(&0, 7);
        for client_id in 100..10_000 {
            identities.resolve(&1, client_id);
        }
        assert_eq!(identities.owned.len(), 1 + IDS_PER_OWNER);
        assert_ne!(identities.resolve(&1, 7), 7);
        for owner in 2..2000 {
            identities.resolve(&owner, 20_000 + owner);
            assert_eq!(identities.resolve(&0, 7), 7, "in use, so never displaced");
        }
        assert_eq!(identities.owned.len(), IDS);
    }
}
