//! The file of a black box.
//!
//! | bytes | hold |
//! |---|---|
//! | 8 | `I2RISBOX` |
//! | 4 | version of the format, little-endian |
//! | 8 | length of the content, little-endian |
//! | 32 | SHA-256 of the content |
//! | the rest | the content, in the format of postcard 1 (<https://postcard.jamesmunns.com/wire-format>) |
//!
//! The content has no field names in it, so another version of it cannot be read: any change of
//! [`Content`] or of anything inside raises [`VERSION`].

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{CycleSnapshot, TickRecord};
use crate::core::CandidateState;
use crate::model::ModelId;

/// The first bytes of every file.
const MAGIC: [u8; 8] = *b"I2RISBOX";
/// The version that this software writes, and the only one that it reads.
pub const VERSION: u32 = 1;
/// Bytes before the content.
const HEAD: usize = 8 + 4 + 8 + 32;

/// Everything in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Content {
    /// Where it comes from.
    pub header: Header,
    /// The configuration, as TOML.
    pub config: String,
    /// Every model that was at hand, in canonical form.
    pub models: Vec<Vec<u8>>,
    /// Models that were handed to the cycle.
    pub offers: Vec<OfferRecord>,
    /// The state of the cycle, now and then.
    pub snapshots: Vec<CycleSnapshot>,
    /// Every tick.
    pub ticks: Vec<TickRecord>,
}

/// Where a file comes from.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Header {
    /// Version of the software, with its commit.
    pub software: String,
    /// This start of the controller.
    pub boot_id: u64,
    /// Why it was written.
    pub cause: String,
    /// When, UTC, by the clock of the wall.
    pub written: String,
    /// Ticks that the recorder was too slow for, since the start.
    pub lost: u64,
}

/// A model as it was handed to the cycle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OfferRecord {
    /// [`TickRecord::offered`].
    pub number: u64,
    /// Which.
    pub model: ModelId,
    /// What it remembered.
    pub carried: CandidateState,
}

/// Why a file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum BlackBoxError {
    /// The system refuses.
    #[error("cannot {action} black box {path}: {source}")]
    Io {
        /// `read` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Another kind of file.
    #[error(
        "{path} is no black box: it does not begin with `I2RISBOX`; name a file that i2ris-control wrote"
    )]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// A file of another version of this software.
    #[error(
        "black box {path} has format {found}, and this software reads {VERSION} only; use the software named in it"
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// What stands there.
        found: u32,
    },
    /// The end is missing, or there is something behind it.
    #[error("black box {path} is incomplete: {found} bytes instead of {expected}; copy it again")]
    Length {
        /// The file.
        path: PathBuf,
        /// As it says.
        expected: u64,
        /// As it is.
        found: u64,
    },
    /// The checksum is wrong.
    #[error("black box {path} is damaged: its checksum does not match its content; copy it again")]
    Damaged {
        /// The file.
        path: PathBuf,
    },
    /// The checksum is right, and yet it cannot be read.
    #[error(
        "black box {path} holds what this software does not know ({reason}); use the software that wrote it"
    )]
    Content {
        /// The file.
        path: PathBuf,
        /// What failed.
        reason: String,
    },
}

impl Content {
    /// The file as bytes.
    ///
    /// # Errors
    ///
    /// As postcard may fail; for these types it does not.
    pub fn to_bytes(&self) -> Result<Vec<u8>, postcard::Error> {
        let body = postcard::to_allocvec(self)?;
        let mut bytes = Vec::with_capacity(HEAD + body.len());
        bytes.extend_from_slice(&MAGIC);
        bytes.extend_from_slice(&VERSION.to_le_bytes());
        bytes.extend_from_slice(&(body.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&Sha256::digest(&body));
        bytes.extend_from_slice(&body);
        Ok(bytes)
    }

    /// Reads the bytes of a file; `path` is for messages only.
    ///
    /// # Errors
    ///
    /// When they are no black box of this version, or not as they were written.
    pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<Self, BlackBoxError> {
        let path = || path.to_owned();
        let foreign = || BlackBoxError::Foreign { path: path() };
        let rest = bytes.strip_prefix(&MAGIC).ok_or_else(foreign)?;
        let cut = |expected| BlackBoxError::Length {
            path: path(),
            expected,
            found: bytes.len() as u64,
        };
        let (version, rest) = rest
            .split_first_chunk::<4>()
            .ok_or_else(|| cut(HEAD as u64))?;
        let found = u32::from_le_bytes(*version);
        if found != VERSION {
            return Err(BlackBoxError::Version {
                path: path(),
                found,
            });
        }
        let (length, rest) = rest
            .split_first_chunk::<8>()
            .ok_or_else(|| cut(HEAD as u64))?;
        let (digest, body) = rest
            .split_first_chunk::<32>()
            .ok_or_else(|| cut(HEAD as u64))?;
        let length = u64::from_le_bytes(*length);
        if body.len() as u64 != length {
            return Err(cut(length.saturating_add(HEAD as u64)));
        }
        if Sha256::digest(body).as_slice() != digest {
            return Err(BlackBoxError::Damaged { path: path() });
        }
        postcard::from_bytes(body).map_err(|error| BlackBoxError::Content {
            path: path(),
            reason: error.to_string(),
        })
    }

    /// Reads a file.
    ///
    /// # Errors
    ///
    /// As [`Content::from_bytes`], and when the system refuses.
    pub fn read(path: &Path) -> Result<Self, BlackBoxError> {
        let bytes = std::fs::read(path).map_err(|source| io_error("read", path, source))?;
        Self::from_bytes(&bytes, path)
    }

    /// Writes a new file, for its owner alone.
    ///
    /// # Errors
    ///
    /// When there is one of this name, or the system refuses.
    pub fn write(&self, path: &Path) -> Result<(), BlackBoxError> {
        let bytes = self.to_bytes().map_err(|error| BlackBoxError::Content {
            path: path.to_owned(),
            reason: error.to_string(),
        })?;
        let write = || -> io::Result<()> {
            let mut file = OpenOptions::new()
                .write(true)
                .create_new(true)
                .mode(0o600)
                .open(path)?;
            file.write_all(&bytes)?;
            file.sync_all()
        };
        write().map_err(|source| io_error("write", path, source))
    }
}

fn io_error(action: &'static str, path: &Path, source: io::Error) -> BlackBoxError {
    BlackBoxError::Io {
        action,
        path: path.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn content() -> Content {
        let header = Header {
            software: "test".to_owned(),
            cause: "a test".to_owned(),
            ..Header::default()
        };
        Content {
            header,
            config: "robot_id = 1".to_owned(),
            models: vec![vec![1, 2, 3]],
            offers: vec![],
            snapshots: vec![],
            ticks: vec![],
        }
    }

    fn error(bytes: &[u8]) -> String {
        Content::from_bytes(bytes, Path::new("x.box"))
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.box");
        content().write(&path).unwrap();
        assert_eq!(Content::read(&path).unwrap(), content());
        assert!(
            content()
                .write(&path)
                .unwrap_err()
                .to_string()
                .contains("File exists"),
            "never written over"
        );
        assert!(
            Content::read(&folder.path().join("b.box"))
                .unwrap_err()
                .to_string()
                .contains("cannot read")
        );
    }

    #[test]
    fn a_file_that_is_not_whole_gets_one_clear_error() {
        let bytes = content().to_bytes().unwrap();
        for length in 8..bytes.len() {
            let text = error(&bytes[..length]);
            assert!(text.contains("incomplete"), "{length}: {text}");
        }
        assert!(error(b"t_s,q0_counts").contains("is no black box"));
        assert!(error(b"").contains("is no black box"));
        let mut newer = bytes.clone();
        newer[8] = 2;
        assert!(error(&newer).contains("has format 2, and this software reads 1 only"));
        let longer = [bytes.as_slice(), &[0]].concat();
        assert!(error(&longer).contains("incomplete"));
    }

    proptest! {
        #[test]
        fn no_damage_goes_unnoticed(place in HEAD..HEAD + 30, bit in 0..8_u32) {
            let mut bytes = content().to_bytes().unwrap();
            let place = place.min(bytes.len() - 1);
            bytes[place] ^= 1 << bit;
            prop_assert!(error(&bytes).contains("damaged"));
        }

        #[test]
        fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let framed = {
                let mut framed = MAGIC.to_vec();
                framed.extend_from_slice(&VERSION.to_le_bytes());
                framed.extend_from_slice(&(bytes.len() as u64).to_le_bytes());
                framed.extend_from_slice(&Sha256::digest(&bytes));
                framed.extend_from_slice(&bytes);
                framed
            };
            let _ = Content::from_bytes(&framed, Path::new("x.box"));
            let _ = Content::from_bytes(&bytes, Path::new("x.box"));
        }
    }
}
