//! How screens and logs name a client.

use std::fmt;

/// A client id for screens: enough to distinguish clients, without revealing the id that commands.
#[derive(Debug, Clone, Copy)]
pub struct MaskedClientId(pub u64);

impl fmt::Display for MaskedClientId {
    /// Half of what `SplitMix64` (G. L. Steele et al. 2014) mixes: it does not lead back to the id.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut mixed = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        write!(f, "client {:08x}", (mixed ^ (mixed >> 31)) >> 32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn screens_keep_clients_apart_and_do_not_show_their_ids() {
        let shown: Vec<String> = (1..1000).map(|id| MaskedClientId(id).to_string()).collect();
        let different: std::collections::BTreeSet<&String> = shown.iter().collect();
        assert_eq!(different.len(), shown.len());
        for (id, shown) in (1_u64..).zip(&shown) {
            assert_eq!(shown.len(), "client ".len() + 8);
            assert!(!shown.contains(&format!("{id:08x}")), "{shown}");
        }
    }
}
