//! Table files: checked when they are read, signed when they are written.

use super::args::SealTerms as Given;
use super::failure::{Failure, Kind, cannot_read};
use crate::compile::Provenance;
use crate::compile::sign::{self, SealTerms};
use crate::video::VideoError;
use crate::video::watch::FileWatch;
use ed25519_dalek::SigningKey;
use iltm_picture::foreign_file;
use iltm_runtime::image::{Seal, Table, unseal};
use iltm_runtime::{FrameSize, Grid};
use std::ffi::OsString;
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

/// The same of a table that a computer uses: not of one that is for the device of one projector of
/// several.
pub(super) fn check_whole<'a>(path: &Path, file: &'a [u8]) -> Result<Table<'a>, Failure> {
    let table = check(path, file)?;
    if table.neighbours().is_none() {
        return Ok(table);
    }
    Err(Failure::new(
        Kind::Table,
        format!(
            "{}: the table is for the device of one projector of several, which gets the light of \
             the others beside its frames",
            path.display()
        ),
        "Give the table of all projectors, which it was split from: a computer makes all frames.",
    ))
}

/// The same, with the seal if there is one.
pub(super) fn check_sealed<'a>(
    path: &Path,
    file: &'a [u8],
) -> Result<(Table<'a>, Option<Seal>), Failure> {
    let checked = unseal(file).and_then(|(image, seal)| Ok((Table::check(image)?, seal)));
    checked.map_err(|error| no_table(path, error))
}

/// The tier that is asked for, or the most accurate one.
pub(super) fn chosen_tier(table: &Table<'_>, asked: Option<u8>) -> Result<u8, Failure> {
    let top = table.top_tier();
    match asked {
        Some(tier) if tier > top => Err(VideoError::NoSuchTier { tier, top }.into()),
        tier => Ok(tier.unwrap_or(top)),
    }
}

/// Refuses a date for new tables that is none, before the work.
pub(super) fn check_date() -> Result<(), Failure> {
    let refused = |given: OsString| {
        Failure::new(
            Kind::Usage,
            format!(
                "the variable SOURCE_DATE_EPOCH is `{}`, which is no number of seconds",
                given.display()
            ),
            "Set it to seconds since 1970, or unset it.",
        )
    };
    Provenance::given_date().map(|_| ()).map_err(refused)
}

/// What a table needs memory for.
#[derive(Clone, Copy, Debug)]
pub(super) struct TableSize {
    pub(super) bytes: usize,
    pub(super) grid: Grid,
    channels: u8,
    /// Samples of the gains finer than the cells.
    fine: Option<FrameSize>,
}

impl TableSize {
    /// That of a file of so many bytes.
    pub(super) fn new(table: &Table<'_>, bytes: usize) -> Self {
        Self {
            bytes,
            grid: table.grid(),
            channels: table.channels(),
            fine: table.fine_gain().map(|fine| fine.size()),
        }
    }

    /// How to solve again for a table that has room in so many bytes.
    pub(super) fn advice(&self, room: usize) -> String {
        let coarser = "Solve for a coarser grid.".to_owned();
        let Some(fine) = self.fine else {
            return coarser;
        };
        let sample = size_of::<u16>() * usize::from(self.channels);
        let others = self.bytes.saturating_sub(fine.pixels() * sample);
        let most = room.saturating_sub(others) / sample;
        let (cols, rows) = (self.grid.cols(), self.grid.rows());
        let (wide, tall) = (fine.width() / cols, fine.height() / rows);
        let sizes = (1..=wide.max(tall)).rev();
        let mut sizes = sizes.map(|side| (cols * side.min(wide), rows * side.min(tall)));
        match sizes.find(|(width, height)| width * height <= most) {
            Some((width, height)) => format!(
                "Solve again with --gain-resolution {width}x{height}: most of the table are its \
                 gains, {} x {} of them.",
                fine.width(),
                fine.height()
            ),
            None => coarser,
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_that_is_too_large_is_made_smaller_by_its_gains_first() {
        // 100 x 60 gains of two bytes, and 1,000 bytes of others.
        let size = TableSize {
            bytes: 13_000,
            grid: Grid::new(6, 10).unwrap(),
            channels: 1,
            fine: FrameSize::new(100, 60),
        };
        for (room, gains) in [(12_999, "90x54"), (5_000, "50x30"), (1_120, "10x6")] {
            let advice = size.advice(room);
            assert!(
                advice.contains(&format!("--gain-resolution {gains}:")),
                "{advice}"
            );
        }
        for (room, fine) in [(1_119, size.fine), (12_999, None)] {
            let advice = TableSize { fine, ..size }.advice(room);
            assert!(advice.contains("coarser grid"), "{advice}");
        }
    }
}
