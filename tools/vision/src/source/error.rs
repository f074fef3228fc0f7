//! Errors that end a source.

use std::path::PathBuf;

use super::size::ImageSize;

/// What ends a stream before its end.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// A file or folder cannot be read.
    #[error("{path}: {source}")]
    Read {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The stream cannot be read.
    #[error("frame stream: {0}")]
    Stream(#[from] std::io::Error),
    /// The stream ends within a frame.
    #[error(
        "frame stream: ends within frame {number}, after {got} of {expected} bytes; \
         is the size {size} right?"
    )]
    Truncated {
        /// Number of the frame, from 1.
        number: u64,
        /// Bytes that came.
        got: usize,
        /// Bytes of a whole frame.
        expected: usize,
        /// Size of a frame.
        size: ImageSize,
    },
    /// The stream is not what it should be.
    #[error("frame stream: {0}")]
    NotY4m(String),
    /// The folder holds no frames.
    #[error("{path}: no PNG or JPEG file in this folder")]
    NoFrames {
        /// The folder.
        path: PathBuf,
    },
    /// A folder whose names carry no numbers and that has no list of stamps.
    #[error(
        "{path}: {file} has no number in its name; number the files, or add frames.csv \
         with columns file,t_s"
    )]
    NoNumber {
        /// The folder.
        path: PathBuf,
        /// The file.
        file: String,
    },
    /// Two files with the same number.
    #[error("{path}: {first} and {second} have the same number")]
    SameNumber {
        /// The folder.
        path: PathBuf,
        /// One file.
        first: String,
        /// The other.
        second: String,
    },
    /// The list of stamps is wrong.
    #[error("{path}: line {line}: {what}")]
    BadList {
        /// The list.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// What is wrong with it.
        what: String,
    },
}
