//! Model files on disk, and their identity.
//!
//! The **canonical form** of a model is the JSON that `serde_json` writes for [`ModelFile`] without
//! white space: fields in the order of the schema, numbers in the shortest form that reads back to
//! the same bits, UTF-8. It depends on every value, but not on the layout and field order of the
//! file on disk. The identity of a model is the SHA-256 of this form.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::{fs, io, process};

use serde::Deserialize;
use sha2::{Digest, Sha256};

use crate::file_permissions::MAX_MODEL_BYTES;
use crate::model::error::ModelError;
use crate::model::file::{FAMILIES, ModelFile, check_header};
use crate::robot::ModelId;

/// The fields of every version of the schema.
#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: String,
    #[serde(default)]
    schema_version: u64,
    #[serde(default)]
    family: FamilyHeader,
}

#[derive(Default, Deserialize)]
struct FamilyHeader {
    kind: Option<String>,
}

impl ModelFile {
    /// Parses the text of a model file. The contents are not checked:
    /// [`crate::model::Model::from_file`] does that.
    ///
    /// # Errors
    ///
    /// When the text is not a model file, has another schema version, is of a family that this
    /// version does not read, or has a missing or unknown field.
    pub fn parse(text: &str) -> Result<Self, ModelError> {
        // Version and family are checked first: others have other fields, and an error about them
        // would be misleading.
        let header: Header = serde_json::from_str(text)?;
        check_header(&header.format, header.schema_version)?;
        if let Some(found) = header.family.kind
            && !FAMILIES.contains(&found.as_str())
        {
            return Err(ModelError::Family(found));
        }
        Ok(serde_json::from_str(text)?)
    }

    /// Reads a model file. The contents are not checked: [`crate::model::Model::load`] does that.
    ///
    /// # Errors
    ///
    /// When the file cannot be read, and the errors of [`ModelFile::parse`]. Every error names the
    /// file.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let unread = |source| ModelError::Read { path: path.to_owned(), source };
        let length = fs::metadata(path).map_err(unread)?.len();
        if length > MAX_MODEL_BYTES {
            let found = format!("a file of {} MB", length >> 20);
            return Err(ModelError::Format(found).in_file(path));
        }
        let text = fs::read_to_string(path).map_err(unread)?;
        Self::parse(&text).map_err(|error| error.in_file(path))
    }

    /// The canonical form: JSON without white space, fields in the order of the schema, numbers in
    /// the shortest form that reads back to the same bits. A number that is not finite becomes
    /// `null`; a checked model has none.
    ///
    /// # Errors
    ///
    /// The errors of `serde_json`. They do not occur for the types of the schema.
    pub fn canonical_form(&self) -> Result<Vec<u8>, ModelError> {
        Ok(serde_json::to_vec(self)?)
    }

    /// The identity: SHA-256 of the canonical form.
    ///
    /// # Errors
    ///
    /// The errors of [`ModelFile::canonical_form`].
    pub fn id(&self) -> Result<ModelId, ModelError> {
        Ok(ModelId(Sha256::digest(self.canonical_form()?).into()))
    }

    /// Writes the file atomically and without checks: into a new file in the same folder, which is
    /// then renamed.
    pub(in crate::model) fn save(&self, path: &Path) -> Result<(), ModelError> {
        let text = join_number_rows(&serde_json::to_string_pretty(self)?);
        replace(path, text.as_bytes())
            .map_err(|source| ModelError::Write { path: path.to_owned(), source })
    }
}

/// Joins the numbers of one row to one line. Pretty JSON has one line per number.
fn join_number_rows(pretty: &str) -> String {
    let mut text = String::with_capacity(pretty.len());
    let mut lines = pretty.lines().peekable();
    while let Some(line) = lines.next() {
        text.push_str(line);
        // No string ends with a bracket outside its quotes, so this line opens an array.
        let opens_row = line.ends_with('[') && lines.peek().is_some_and(|next| is_number(next));
        if opens_row {
            let mut separator = "";
            while let Some(number) = lines.next_if(|next| is_number(next)) {
                text.push_str(separator);
                text.push_str(number.trim());
                separator = " ";
            }
            text.push_str(lines.next().unwrap_or_default().trim());
        }
        text.push('\n');
    }
    text
}

fn is_number(line: &str) -> bool {
    line.trim_start().starts_with(|c: char| c == '-' || c.is_ascii_digit())
}

/// Writes a file under a temporary name, flushes it to the disk and renames it to `path`.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let (file, temporary) = create_beside(path)?;
    let written = write_and_sync(file, bytes).and_then(|()| fs::rename(&temporary, path));
    if written.is_err() {
        // The first error is reported. A leftover temporary file is harmless.
        let _ = fs::remove_file(&temporary);
    }
    written
}

fn write_and_sync(mut file: File, bytes: &[u8]) -> io::Result<()> {
    file.write_all(bytes)?;
    file.sync_all()
}

/// Creates a new file in the folder of `path`: a rename does not cross file systems.
fn create_beside(path: &Path) -> io::Result<(File, PathBuf)> {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "names no file"))?;
    loop {
        let mut hidden_name = std::ffi::OsString::from(".");
        hidden_name.push(name);
        hidden_name.push(format!(
            ".{}-{}.tmp",
            process::id(),
            NUMBER.fetch_add(1, Ordering::Relaxed)
        ));
        let temporary = path.with_file_name(hidden_name);
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            // A killed process with the same number left this file: take the next name.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
            Ok(file) => return Ok((file, temporary)),
        }
    }
}
