//! The key of one person, on the other computer.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use x509_parser::pem::Pem;

use super::access::is_id;
use super::{KeyError, wrong};

/// The key of one person: a folder with `ca.pem`, `certificate.pem` and `key.pem`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PersonalKey {
    folder: PathBuf,
    id: String,
}

impl PersonalKey {
    /// Checks the folder of a key.
    ///
    /// # Errors
    ///
    /// When a file is missing or is no certificate, others can read the secret, or the key has
    /// expired.
    pub fn load(folder: &Path) -> Result<Self, KeyError> {
        let key = Self { folder: folder.to_owned(), id: String::new() };
        let secret = key.secret();
        let mode = fs::metadata(&secret)
            .map_err(|error| wrong(&secret)(format!("{error}; make a key: `i2ris bridge key`")))?
            .mode();
        if mode & 0o077 != 0 {
            return Err(wrong(&secret)(format!(
                "others can read it (mode {:03o}); chmod 600 it",
                mode & 0o777
            )));
        }
        fs::metadata(key.authority()).map_err(wrong(&key.authority()))?;
        let file = key.certificate();
        let bytes = fs::read(&file).map_err(wrong(&file))?;
        let pem = Pem::iter_from_buffer(&bytes)
            .next()
            .ok_or_else(|| wrong(&file)("no certificate"))?
            .map_err(wrong(&file))?;
        let certificate = pem.parse_x509().map_err(wrong(&file))?;
        if !certificate.validity().is_valid() {
            return Err(wrong(&file)(format!(
                "this key is valid from {} to {}, and not now; have another one made",
                certificate.validity().not_before,
                certificate.validity().not_after
            )));
        }
        let name = certificate.subject().iter_common_name().next();
        let id = name.and_then(|name| name.as_str().ok()).unwrap_or_default();
        if !is_id(id) {
            return Err(wrong(&file)("not a certificate of `i2ris bridge key`"));
        }
        let id = id.to_owned();
        Ok(Self { id, ..key })
    }

    /// Name of the person and a random number.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The certificate of the authority that signed the server's.
    #[must_use]
    pub fn authority(&self) -> PathBuf {
        self.folder.join("ca.pem")
    }

    #[must_use]
    pub fn certificate(&self) -> PathBuf {
        self.folder.join("certificate.pem")
    }

    #[must_use]
    pub fn secret(&self) -> PathBuf {
        self.folder.join("key.pem")
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;
    use crate::keys::{Access, Lifetime, make_key};

    #[test]
    fn a_key_that_is_expired_readable_by_others_or_incomplete_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let hosts = ["127.0.0.1".to_owned()];
        let make =
            |lifetime| make_key(folder.path(), "a", Access::Watch, &hosts, lifetime).unwrap();
        let refused = |key: &Path| PersonalKey::load(key).unwrap_err().to_string();
        let expired = refused(&make(Lifetime::seconds(-10)));
        assert!(expired.contains("not now"), "{expired}");
        let key = make(Lifetime::days(1));
        assert!(PersonalKey::load(&key).is_ok());
        let secret = key.join("key.pem");
        fs::set_permissions(&secret, fs::Permissions::from_mode(0o644)).unwrap();
        assert!(refused(&key).contains("others can read it (mode 644)"));
        fs::set_permissions(&secret, fs::Permissions::from_mode(0o600)).unwrap();
        fs::write(key.join("certificate.pem"), "no certificate").unwrap();
        assert!(refused(&key).contains("certificate"));
        fs::remove_file(&secret).unwrap();
        assert!(refused(&key).contains("i2ris bridge key"));
    }
}
