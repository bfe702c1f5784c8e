//! Table files: checked when they are read, signed when they are written.

use super::args::SealTerms as Given;
use super::failure::{Failure, Kind, cannot_read};
use crate::compile::sign::{self, SealTerms};
use crate::video::watch::FileWatch;
use ed25519_dalek::SigningKey;
use iltm_picture::foreign_file;
use iltm_runtime::image::{Seal, Table, unseal};
use std::fmt::Display;
use std::io;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// Bytes of a table file at most: many times what any device has room for.
const MOST_BYTES: u64 = 1 << 28;

/// Reads a table file.
pub(super) fn read_table(path: &Path) -> Result<Vec<u8>, Failure> {
    foreign_file::read(path, MOST_BYTES).map_err(|error| not_read(path, &error))
}

/// The same, and watches the file from then on.
pub(super) fn watch_table(path: &Path) -> Result<(Vec<u8>, FileWatch), Failure> {
    FileWatch::read(path, MOST_BYTES).map_err(|error| not_read(path, &error))
}

fn not_read(path: &Path, error: &io::Error) -> Failure {
    match error.kind() {
        io::ErrorKind::FileTooLarge => no_table(path, error),
        _ => cannot_read(path, error),
    }
}

fn no_table(path: &Path, reason: impl Display) -> Failure {
    Failure::new(
        Kind::Table,
        format!("{}: {reason}", path.display()),
        "Copy the table again, or make it anew with `iltm solve`.",
    )
}

/// Checks the bytes of a table file. The signature is not looked at.
pub(super) fn check<'a>(path: &Path, file: &'a [u8]) -> Result<Table<'a>, Failure> {
    Ok(check_sealed(path, file)?.0)
}

/// The same, with the seal if there is one.
pub(super) fn check_sealed<'a>(
    path: &Path,
    file: &'a [u8],
) -> Result<(Table<'a>, Option<Seal>), Failure> {
    let checked = unseal(file).and_then(|(image, seal)| Ok((Table::check(image)?, seal)));
    checked.map_err(|error| no_table(path, error))
}

/// Signs a file on the terms of the command line.
pub(super) fn seal(file: &[u8], key: &SigningKey, given: &Given) -> Result<Vec<u8>, Failure> {
    let version = given.table_version.unwrap_or_else(version_of_now);
    let oldest = given.revoke_below.unwrap_or(0);
    if oldest > version {
        return Err(Failure::new(
            Kind::Usage,
            format!(
                "version {version} would revoke itself: versions below {oldest} are to be revoked"
            ),
            "Give --revoke-below at most the --table-version.",
        ));
    }
    let terms = SealTerms {
        version,
        oldest,
        device: given.for_device.unwrap_or(0),
    };
    sign::sign(file, key, terms).map_err(|error| {
        let next_step = "Make the table anew with `iltm solve`.";
        Failure::new(Kind::Table, error, next_step)
    })
}

/// Version of what is signed now where nobody says one: minutes since 1970, so that what is
/// signed later is newer.
pub(super) fn version_of_now() -> u32 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let minutes = now.map_or(0, |now| now.as_secs() / 60);
    u32::try_from(minutes).unwrap_or(u32::MAX).max(1)
}
