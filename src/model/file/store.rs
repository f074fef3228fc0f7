//! Model files on disk, and their identity.
//!
//! The **canonical form** of a model is the JSON that `serde_json` writes for [`ModelFile`] without
//! any white space: fields in the order of the schema, numbers in the shortest form that reads back
//! to the same bits, UTF-8. Layout and field order of the file on disk do not enter it; every value
//! does. The identity of a model is its SHA-256.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::{fmt, process};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::model::error::ModelError;
use crate::model::file::ModelFile;
use crate::model::file::check::check_header;

/// SHA-256 of the canonical form of a model file: the identity of a model.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
pub struct ModelId(pub [u8; 32]);

impl fmt::Display for ModelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for ModelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ModelId({self})")
    }
}

/// The fields that every version of the schema has.
#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: String,
    #[serde(default)]
    schema_version: u64,
}

impl ModelFile {
    /// Parses the text of a model file. What it holds is not checked:
    /// [`crate::model::Model::from_file`] does that.
    ///
    /// # Errors
    ///
    /// When the text is no model file, one of another schema version, or has a missing or unknown
    /// field.
    pub fn parse(text: &str) -> Result<Self, ModelError> {
        // The version comes first: another one has other fields, and to name those would mislead.
        let header: Header = serde_json::from_str(text)?;
        check_header(&header.format, header.schema_version)?;
        Ok(serde_json::from_str(text)?)
    }

    /// Reads a model file. What it holds is not checked: [`crate::model::Model::load`] does that.
    ///
    /// # Errors
    ///
    /// When the file cannot be read, and as [`ModelFile::parse`]; all name the file.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let text = fs::read_to_string(path).map_err(|source| ModelError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text).map_err(|error| error.in_file(path))
    }

    /// The canonical form: JSON without white space, fields in the order of the schema, numbers in
    /// the shortest form that reads back to the same bits. A number that is not finite, which no
    /// checked model has, becomes `null`.
    ///
    /// # Errors
    ///
    /// As `serde_json` may fail; for the types of the schema it does not.
    pub fn canonical_form(&self) -> Result<Vec<u8>, ModelError> {
        Ok(serde_json::to_vec(self)?)
    }

    /// The identity: SHA-256 of the canonical form.
    ///
    /// # Errors
    ///
    /// As [`ModelFile::canonical_form`].
    pub fn id(&self) -> Result<ModelId, ModelError> {
        Ok(ModelId(Sha256::digest(self.canonical_form()?).into()))
    }

    /// Writes the file without a check, whole or not at all: into a new file in the same folder
    /// that then takes the name.
    pub(in crate::model) fn save(&self, path: &Path) -> Result<(), ModelError> {
        let text = readable(&serde_json::to_string_pretty(self)?);
        replace(path, text.as_bytes()).map_err(|source| ModelError::Write {
            path: path.to_owned(),
            source,
        })
    }
}

/// Puts the numbers of one row on one line: in pretty JSON each has its own.
fn readable(pretty: &str) -> String {
    let mut text = String::with_capacity(pretty.len());
    let mut lines = pretty.lines().peekable();
    while let Some(line) = lines.next() {
        text.push_str(line);
        // A string never ends with a bracket outside its quotes, so this opens an array.
        let opens_row = line.ends_with('[') && lines.peek().is_some_and(|next| is_number(next));
        if opens_row {
            let mut gap = "";
            while let Some(number) = lines.next_if(|next| is_number(next)) {
                text.push_str(gap);
                text.push_str(number.trim());
                gap = " ";
            }
            text.push_str(lines.next().unwrap_or_default().trim());
        }
        text.push('\n');
    }
    text
}

fn is_number(line: &str) -> bool {
    line.trim_start()
        .starts_with(|c: char| c == '-' || c.is_ascii_digit())
}

/// Writes a file under a name of its own, forces it to the disk and gives it the name `path`.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let (file, temporary) = create_beside(path)?;
    let written = fill(file, bytes).and_then(|()| fs::rename(&temporary, path));
    if written.is_err() {
        // The first error is the one to report; a leftover harms no one.
        let _ = fs::remove_file(&temporary);
    }
    written
}

fn fill(mut file: File, bytes: &[u8]) -> io::Result<()> {
    file.write_all(bytes)?;
    file.sync_all()
}

/// A new file in the folder of `path`: a rename does not cross file systems.
fn create_beside(path: &Path) -> io::Result<(File, PathBuf)> {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "names no file"))?;
    loop {
        let mut own = std::ffi::OsString::from(".");
        own.push(name);
        own.push(format!(
            ".{}-{}.tmp",
            process::id(),
            NUMBER.fetch_add(1, Ordering::Relaxed)
        ));
        let temporary = path.with_file_name(own);
        match OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&temporary)
        {
            // Left by a killed process that had the same number: take the next name.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
            Ok(file) => return Ok((file, temporary)),
        }
    }
}
