//! Log messages from a device.
//!
//! defmt keeps the words of a message in the firmware's ELF file and sends only
//! their number and the values.

use defmt_decoder::{DecodeError, Encoding, Table};
use iltm_picture::foreign_file;
use std::path::{Path, PathBuf};

/// Bytes of a firmware's ELF file at most: many times one with all its debug information.
const MOST_BYTES: u64 = 1 << 28;

/// Why the words of log messages cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum LogsError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// The file is not the ELF file of a firmware, or is of another defmt version.
    #[error("{}: has no log messages that can be read: {reason}", path.display())]
    NoMessages {
        /// The file.
        path: PathBuf,
        /// What the decoder says.
        reason: String,
    },
}

/// The words of a firmware's log messages.
#[derive(Debug)]
pub struct Logs {
    table: Table,
}

/// A log message.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LogMessage {
    /// `error`, `warn`, `info`, `debug` or `trace`; empty for plain print.
    pub level: String,
    /// The device's time, in the format that its firmware chose; empty if it has
    /// none.
    pub time: String,
    /// The words.
    pub text: String,
}

impl Logs {
    /// Reads the words from a firmware's ELF file.
    ///
    /// # Errors
    /// [`LogsError`].
    pub fn read(path: &Path) -> Result<Self, LogsError> {
        let elf = foreign_file::read(path, MOST_BYTES).map_err(|source| LogsError::Read {
            path: path.to_owned(),
            source,
        })?;
        let none = |reason: String| LogsError::NoMessages {
            path: path.to_owned(),
            reason,
        };
        let table = Table::parse(&elf).map_err(|error| none(error.to_string()))?;
        let table = table.ok_or_else(|| none("it holds no defmt section".to_owned()))?;
        if table.encoding() != Encoding::Raw {
            return Err(none("it was built without defmt's raw encoding".to_owned()));
        }
        Ok(Self { table })
    }

    /// The messages in the payload of a log frame. Bytes that are none of this
    /// firmware's messages are a message that says so.
    #[must_use]
    pub fn messages(&self, mut payload: &[u8]) -> Vec<LogMessage> {
        let mut messages = Vec::new();
        while !payload.is_empty() {
            match self.table.decode(payload) {
                Ok((frame, length)) => {
                    let level = frame.level().map_or("", |level| level.as_str());
                    let time = frame.display_timestamp();
                    messages.push(LogMessage {
                        level: level.to_owned(),
                        time: time.map(|time| time.to_string()).unwrap_or_default(),
                        text: frame.display_message().to_string(),
                    });
                    payload = payload.get(length.max(1)..).unwrap_or_default();
                }
                Err(DecodeError::UnexpectedEof | DecodeError::Malformed) => {
                    messages.push(LogMessage {
                        level: "warn".to_owned(),
                        time: String::new(),
                        text: format!(
                            "{} bytes of log that the ELF file does not explain: is it the device's?",
                            payload.len()
                        ),
                    });
                    break;
                }
            }
        }
        messages
    }
}
