//! Records of a file one after the other, with little memory, from whole files and from ones that
//! were cut off.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// No record that we write is larger: models and configurations are the largest.
const LARGEST_RECORD: usize = 1 << 28;

/// Why a file cannot be read, or not further.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It cannot be opened or read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Its bytes are not what MCAP allows, or end too early.
    #[error(
        "{path}: {source}; if it was cut off, `i2ris record recover` makes a whole file of what is there"
    )]
    Format {
        /// Which.
        path: PathBuf,
        /// Why.
        source: McapError,
    },
}

/// Records of a file. After an error there are no more.
pub struct Records {
    path: PathBuf,
    from: BufReader<File>,
    reader: LinearReader,
    ended: bool,
}

impl Records {
    /// Opens a file.
    ///
    /// # Errors
    ///
    /// [`ReadError::Read`].
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let file = File::open(path).map_err(|source| ReadError::Read {
            path: path.to_owned(),
            source,
        })?;
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LARGEST_RECORD);
        let reader = LinearReader::new_with_options(options);
        Ok(Self {
            path: path.to_owned(),
            from: BufReader::with_capacity(1 << 20, file),
            reader,
            ended: false,
        })
    }

    fn step(&mut self) -> Result<Option<Record<'static>>, ReadError> {
        loop {
            let format = |source| ReadError::Format {
                path: self.path.clone(),
                source,
            };
            let wanted = match self.reader.next_event() {
                None => return Ok(None),
                Some(Err(source)) => return Err(format(source)),
                Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                    return mcap::parse_record(opcode, data)
                        .map(|record| Some(record.into_owned()))
                        .map_err(format);
                }
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => wanted,
            };
            let got = self
                .from
                .read(self.reader.insert(wanted))
                .map_err(|source| ReadError::Read {
                    path: self.path.clone(),
                    source,
                })?;
            self.reader.notify_read(got);
        }
    }
}

impl Iterator for Records {
    type Item = Result<Record<'static>, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let step = self.step().transpose();
        self.ended = !matches!(step, Some(Ok(_)));
        step
    }
}
