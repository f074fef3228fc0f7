//! The file of a black box.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `I2RISBOX` |
//! | 4 | version of the format, little-endian |
//! | 8 | length of the content, little-endian |
//! | 32 | SHA-256 of the content |
//! | the rest | the content, in the [format of postcard 1][postcard] |
//!
//! [postcard]: https://postcard.jamesmunns.com/wire-format
//!
//! The content has no field names, so only its own version can be read: any change of [`BlackBox`]
//! or of a type inside it raises [`VERSION`].

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::core::{CandidateState, CycleInputs, CycleOutputs, CycleSnapshot};
use crate::model::ModelId;
use crate::realtime::TickTiming;
use crate::robot::DriveFingerprint;

const MAGIC: [u8; 8] = *b"I2RISBOX";
/// Format version that this software writes and reads.
pub(super) const VERSION: u32 = 14;
const HEAD: usize = 8 + 4 + 8 + 32;

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct BlackBox {
    pub header: BlackBoxHeader,
    /// The configuration, as TOML.
    pub config: String,
    /// Every loaded model, in canonical form.
    pub models: Vec<Vec<u8>>,
    /// Models that were passed to the cycle.
    pub offers: Vec<OfferRecord>,
    /// The state of the cycle, once a second.
    pub snapshots: Vec<CycleSnapshot>,
    pub ticks: Vec<TickRecord>,
}

#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct BlackBoxHeader {
    /// Version of the software, with its commit.
    pub software: String,
    pub boot_id: u64,
    pub cause: String,
    /// Date and time, UTC, of the wall clock.
    pub written: String,
    /// Ticks lost since the start because the recorder was too slow.
    pub lost: u64,
    pub drives: Vec<DriveFingerprint>,
}

/// A model as it was passed to the cycle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OfferRecord {
    /// [`TickRecord::offered`].
    pub number: u64,
    pub model: ModelId,
    pub carried: CandidateState,
}

/// One tick, as the loop saw it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TickRecord {
    /// Counts up by one; the first tick after the start is 1.
    pub number: u64,
    /// Model passed to the cycle before the tick: number of its [`OfferRecord`].
    pub offered: Option<u64>,
    pub inputs: CycleInputs,
    pub outputs: CycleOutputs,
    /// Timing. `timing.tick.started` is the time argument of the cycle.
    pub timing: TickTiming,
}

#[derive(Debug, thiserror::Error)]
pub enum BlackBoxError {
    #[error("cannot {action} black box {path}: {source}")]
    Io { action: &'static str, path: PathBuf, source: io::Error },
    #[error(
        "{0} is not a black-box file: it does not begin with `I2RISBOX`; name a file written by \
         i2ris-control"
    )]
    Foreign(PathBuf),
    #[error(
        "black box {path} has format {found}; this software reads only {VERSION}; use the version \
         that wrote it"
    )]
    Version { path: PathBuf, found: u32 },
    #[error("black box {path} is incomplete: {found} bytes instead of {expected}; copy it again")]
    Length { path: PathBuf, expected: u64, found: u64 },
    #[error("black box {0} is damaged: its checksum does not match its content; copy it again")]
    Damaged(PathBuf),
    #[error(
        "black box {path} contains data unknown to this software ({reason}); use the version that \
         wrote it"
    )]
    Decode { path: PathBuf, reason: String },
}

impl BlackBoxError {
    pub(super) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, path, source }
    }
}

impl BlackBox {
    pub fn to_bytes(&self) -> Result<Vec<u8>, postcard::Error> {
        let body = postcard::to_allocvec(self)?;
        Ok(with_head(&body))
    }

    /// Reads the bytes of a file; `path` is for messages only. Fails when they are not a black box
    /// of this version, or are damaged.
    pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<Self, BlackBoxError> {
        let path = || path.to_owned();
        let wrong_length =
            |expected| BlackBoxError::Length { path: path(), expected, found: bytes.len() as u64 };
        let too_short = || wrong_length(HEAD as u64);
        let foreign = || BlackBoxError::Foreign(path());
        let rest = bytes.strip_prefix(&MAGIC).ok_or_else(foreign)?;
        let (version, rest) = rest.split_first_chunk::<4>().ok_or_else(too_short)?;
        let found = u32::from_le_bytes(*version);
        if found != VERSION {
            let path = path();
            return Err(BlackBoxError::Version { path, found });
        }
        let (length, rest) = rest.split_first_chunk::<8>().ok_or_else(too_short)?;
        let (digest, body) = rest.split_first_chunk::<32>().ok_or_else(too_short)?;
        let length = u64::from_le_bytes(*length);
        if body.len() as u64 != length {
            return Err(wrong_length(length.saturating_add(HEAD as u64)));
        }
        if Sha256::digest(body).as_slice() != digest {
            return Err(BlackBoxError::Damaged(path()));
        }
        postcard::from_bytes(body)
            .map_err(|error| BlackBoxError::Decode { path: path(), reason: error.to_string() })
    }

    pub fn read(path: &Path) -> Result<Self, BlackBoxError> {
        let bytes = std::fs::read(path).map_err(BlackBoxError::io("read", path))?;
        Self::from_bytes(&bytes, path)
    }

    /// Writes a new file, for its owner only. Fails when one of this name exists.
    pub fn write(&self, path: &Path) -> Result<(), BlackBoxError> {
        let bytes = self.to_bytes().map_err(|error| BlackBoxError::Decode {
            path: path.to_owned(),
            reason: error.to_string(),
        })?;
        let write = |mut file: &File| file.write_all(&bytes).and_then(|()| file.sync_all());
        create_whole(path, write).map_err(BlackBoxError::io("write", path))
    }
}

/// Creates a file for its owner only. A partly written file, as on a full disk, is removed:
/// otherwise it would count as a black box and displace a complete one.
pub(super) fn create_whole(
    path: &Path,
    write: impl FnOnce(&File) -> io::Result<()>,
) -> io::Result<()> {
    let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)?;
    write(&file).inspect_err(|_| {
        let _ = std::fs::remove_file(path);
    })
}

fn with_head(body: &[u8]) -> Vec<u8> {
    let length = (body.len() as u64).to_le_bytes();
    let digest = Sha256::digest(body);
    [&MAGIC[..], &VERSION.to_le_bytes(), &length, &digest, body].concat()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn example() -> BlackBox {
        let config = "robot_id = 1".to_owned();
        BlackBox { config, models: vec![vec![1, 2, 3]], ..BlackBox::default() }
    }

    #[test]
    fn full_disk_leaves_no_partial_file_and_none_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.box");
        let full = |mut file: &File| {
            file.write_all(b"I2R")?;
            Err(io::ErrorKind::StorageFull.into())
        };
        assert!(create_whole(&path, full).is_err());
        assert!(!path.exists());
        example().write(&path).unwrap();
        let error = example().write(&path).unwrap_err().to_string();
        assert!(error.contains("File exists"), "{error}");
        assert_eq!(BlackBox::read(&path).unwrap(), example());
        let error = BlackBox::read(&folder.path().join("b.box")).unwrap_err().to_string();
        assert!(error.contains("cannot read"), "{error}");
    }

    fn error(bytes: &[u8]) -> String {
        BlackBox::from_bytes(bytes, Path::new("x.box")).unwrap_err().to_string()
    }

    #[test]
    fn incomplete_and_foreign_files_are_reported_as_such() {
        let bytes = example().to_bytes().unwrap();
        for length in 8..bytes.len() {
            let text = error(&bytes[..length]);
            assert!(text.contains("incomplete"), "{length}: {text}");
        }
        assert!(error(b"t_s,q0_counts").contains("is not a black-box file"));
        assert!(error(b"").contains("is not a black-box file"));
        let mut newer = bytes.clone();
        newer[8] = 99;
        let expected = format!("has format 99; this software reads only {VERSION}");
        assert!(error(&newer).contains(&expected));
        let longer = [bytes.as_slice(), &[0]].concat();
        assert!(error(&longer).contains("incomplete"));
    }

    proptest! {
        #[test]
        fn every_damage_is_detected(index in HEAD..HEAD + 30, bit in 0..8_u32) {
            let mut bytes = example().to_bytes().unwrap();
            let index = index.min(bytes.len() - 1);
            bytes[index] ^= 1 << bit;
            prop_assert!(error(&bytes).contains("damaged"));
        }

        #[test]
        fn no_bytes_cause_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = BlackBox::from_bytes(&with_head(&bytes), Path::new("x.box"));
            let _ = BlackBox::from_bytes(&bytes, Path::new("x.box"));
        }
    }
}
