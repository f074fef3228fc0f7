//! The key that both ends share, and the mac under every packet.

use std::fmt::Write as _;
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

use crate::NetworkError;

/// Bytes of a key that is made here.
const MADE: usize = 32;
/// Bytes that a key must have: what can be tried out is none.
const SHORTEST: usize = 16;
/// Bytes of a mac. Half of an HMAC-SHA256 is what RFC 2104 (section 5) allows at least.
pub const MAC_LENGTH: usize = 16;

/// The key that both ends share.
#[derive(Clone)]
pub struct Key {
    secret: Vec<u8>,
    open: bool,
}

impl std::fmt::Debug for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Key(open: {})", self.open)
    }
}

impl Key {
    /// No secret: MACs are checksums. For the computer itself only.
    #[must_use]
    pub fn open() -> Self {
        Self {
            secret: b"i2ris without a key".to_vec(),
            open: true,
        }
    }

    /// Whether it is no secret.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.open
    }

    /// A key of these bytes.
    #[must_use]
    pub fn of(secret: &[u8]) -> Self {
        Self {
            secret: secret.to_vec(),
            open: false,
        }
    }

    /// Reads a key: hexadecimal digits in a file that nobody else can read.
    ///
    /// # Errors
    ///
    /// When the file cannot be read, others can read it, or it is no such text of at least 16
    /// bytes.
    pub fn load(path: &Path) -> Result<Self, NetworkError> {
        let wrong = |reason: String| NetworkError::Key {
            path: path.to_owned(),
            reason,
        };
        let mut file = File::open(path)
            .map_err(|error| wrong(format!("{error}; make one with `i2ris bridge key`")))?;
        let mode = file
            .metadata()
            .map_err(|error| wrong(error.to_string()))?
            .mode();
        if mode & 0o077 != 0 {
            return Err(wrong(format!(
                "others can read it (mode {:03o}); chmod 600 it",
                mode & 0o777
            )));
        }
        let mut text = String::new();
        file.read_to_string(&mut text)
            .map_err(|error| wrong(error.to_string()))?;
        let secret = digits(text.trim()).filter(|secret| secret.len() >= SHORTEST);
        secret
            .map(|secret| Self {
                secret,
                open: false,
            })
            .ok_or_else(|| {
                wrong(format!(
                    "not {} or more hexadecimal digits; make one with `i2ris bridge key`",
                    2 * SHORTEST
                ))
            })
    }

    /// Makes a key in a file that does not exist yet.
    ///
    /// # Errors
    ///
    /// When the file exists or cannot be written.
    pub fn make(path: &Path) -> Result<Self, NetworkError> {
        let wrong = |error: std::io::Error| NetworkError::Key {
            path: path.to_owned(),
            reason: error.to_string(),
        };
        let mut secret = vec![0; MADE];
        File::open("/dev/urandom")
            .and_then(|mut source| source.read_exact(&mut secret))
            .map_err(wrong)?;
        let mut text = String::new();
        secret.iter().for_each(|byte| {
            let _ = write!(text, "{byte:02x}");
        });
        text.push('\n');
        let mut file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(path)
            .map_err(wrong)?;
        let written = file
            .write_all(text.as_bytes())
            .and_then(|()| file.sync_all());
        written.map_err(|error| {
            let _ = fs::remove_file(path);
            wrong(error)
        })?;
        Ok(Self {
            secret,
            open: false,
        })
    }

    /// The mac of some bytes.
    pub(crate) fn mac(&self, bytes: &[u8]) -> [u8; MAC_LENGTH] {
        let mut mac = [0; MAC_LENGTH];
        if let Some(hmac) = self.hmac(bytes) {
            mac.copy_from_slice(&hmac.finalize().into_bytes()[..MAC_LENGTH]);
        }
        mac
    }

    /// Whether this is their mac. Takes as long for a wrong one as for the right one.
    pub(crate) fn verify_mac(&self, bytes: &[u8], mac: &[u8]) -> bool {
        mac.len() == MAC_LENGTH
            && self
                .hmac(bytes)
                .is_some_and(|hmac| hmac.verify_truncated_left(mac).is_ok())
    }

    /// HMAC takes keys of any length, so there always is one.
    fn hmac(&self, bytes: &[u8]) -> Option<Hmac<Sha256>> {
        let mut mac = <Hmac<Sha256> as KeyInit>::new_from_slice(&self.secret).ok()?;
        mac.update(bytes);
        Some(mac)
    }
}

fn digits(text: &str) -> Option<Vec<u8>> {
    let pairs = text.as_bytes().chunks(2);
    pairs
        .map(|pair| {
            (pair.len() == 2)
                .then(|| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok())?
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    /// RFC 4231, test case 2.
    #[test]
    fn the_mac_is_half_of_hmac_sha256() {
        let key = Key::of(b"Jefe");
        let mac = key.mac(b"what do ya want for nothing?");
        assert_eq!(mac[..8], [0x5b, 0xdc, 0xc1, 0x46, 0xbf, 0x60, 0x75, 0x4e]);
        assert!(key.verify_mac(b"what do ya want for nothing?", &mac));
        assert!(!key.verify_mac(b"what do ya want for nothing!", &mac));
        assert!(
            !key.verify_mac(b"what do ya want for nothing?", &mac[..8]),
            "a short mac could be guessed"
        );
        assert!(!Key::of(b"jefe").verify_mac(b"what do ya want for nothing?", &mac));
    }

    #[test]
    fn a_key_that_was_made_is_read_again_and_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("key");
        let made = Key::make(&path).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
        assert_eq!(Key::load(&path).unwrap().mac(b"x"), made.mac(b"x"));
        assert!(Key::make(&path).is_err());
        assert_ne!(
            Key::make(&folder.path().join("other")).unwrap().mac(b"x"),
            made.mac(b"x")
        );
    }

    #[test]
    fn keys_that_others_can_read_or_guess_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("key");
        let refused = |text: &str, mode| {
            fs::write(&path, text).unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            Key::load(&path).unwrap_err().to_string()
        };
        assert!(refused(&"ab".repeat(32), 0o644).contains("others can read it (mode 644)"));
        assert!(refused("abcd", 0o600).contains("32 or more hexadecimal digits"));
        assert!(refused(&"xy".repeat(32), 0o600).contains("hexadecimal"));
        assert!(refused(&"a".repeat(33), 0o600).contains("hexadecimal"));
    }
}
