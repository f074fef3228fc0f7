//! The list of keys and of what they may do.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use i2ris::file_permissions::read_trusted;
use serde::{Deserialize, Serialize};

use super::{KeyError, wrong};

/// Longest list, bytes: thousands of keys.
const LONGEST: u64 = 1 << 20;
const FILE: &str = "access.toml";

/// What a key may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Access {
    /// Streams, and questions that change nothing
    Watch,
    /// Commands and requests, too
    Command,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyEntry {
    /// Name of the person and a random number: the common name of the certificate.
    pub id: String,
    pub may: Access,
    /// It may do nothing any more.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub revoked: bool,
}

/// The list of keys. A key that is not in it may do nothing.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AccessList {
    #[serde(default)]
    pub key: Vec<KeyEntry>,
}

impl AccessList {
    /// Where the list lies in a folder of keys.
    #[must_use]
    pub fn file(folder: &Path) -> PathBuf {
        folder.join(FILE)
    }

    /// Reads the list of a folder of keys.
    ///
    /// # Errors
    ///
    /// When it cannot be read, others may write it, or it is no such list.
    pub fn load(folder: &Path) -> Result<Self, KeyError> {
        let file = Self::file(folder);
        let text = read_trusted(&file, LONGEST).map_err(|error| match error.into_io() {
            Ok(error) if error.kind() == ErrorKind::NotFound => wrong(&file)(
                "there is no list of keys; make the first key with `i2ris bridge key NAME`",
            ),
            Ok(error) => wrong(&file)(error),
            Err(error) => wrong(&file)(error),
        })?;
        let list: Self = toml::from_str(&text).map_err(wrong(&file))?;
        match list.key.iter().find(|entry| !is_id(&entry.id)) {
            Some(entry) => Err(wrong(&file)(format!(
                "`{}` is no id of a key: letters, digits, `-` and `_`, 80 at most",
                entry.id
            ))),
            None => Ok(list),
        }
    }

    /// What a key may do; `None`: nothing.
    #[must_use]
    pub fn access(&self, id: &str) -> Option<Access> {
        let entry = self.key.iter().find(|entry| entry.id == id)?;
        (!entry.revoked).then_some(entry.may)
    }
}

/// Whether this can stand in a key expression and in the name of a folder.
pub(super) fn is_id(text: &str) -> bool {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-_".contains(letter);
    !text.is_empty() && text.len() <= 80 && text.chars().all(is_plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(text: &str) -> Result<AccessList, KeyError> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(AccessList::file(folder.path()), text).unwrap();
        AccessList::load(folder.path())
    }

    #[test]
    fn a_key_may_do_what_the_list_says_and_nothing_when_it_is_revoked_or_absent() {
        let list = list(
            "[[key]]\nid = \"a-1\"\nmay = \"command\"\n[[key]]\nid = \"b-2\"\nmay = \"watch\"\n\
             [[key]]\nid = \"c-3\"\nmay = \"command\"\nrevoked = true\n",
        )
        .unwrap();
        assert_eq!(list.access("a-1"), Some(Access::Command));
        assert_eq!(list.access("b-2"), Some(Access::Watch));
        assert_eq!((list.access("c-3"), list.access("d-4")), (None, None));
    }

    #[test]
    fn a_list_with_anything_unknown_is_refused() {
        for (text, reason) in [
            ("[[key]]\nid = \"a\"\nmay = \"everything\"", "everything"),
            ("[[key]]\nid = \"a\"\nmay = \"watch\"\nuntil = 3", "until"),
            ("[[key]]\nid = \"a/**\"\nmay = \"watch\"", "no id"),
            ("[[key]]\nid = \"\"\nmay = \"watch\"", "no id"),
        ] {
            let error = list(text).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
        }
        let nowhere = AccessList::load(Path::new("/nowhere")).unwrap_err();
        assert!(nowhere.to_string().contains("i2ris bridge key"));
    }
}
