//! Plan of an upload: the sectors that have to be sent.

use super::UploadError;
use crate::{Client, DeviceError, Line};
use iltm_runtime::{
    image::crc32,
    link::{Digest, Slots},
};
use sha2::{Digest as _, Sha512};
use std::collections::BTreeSet;

/// A file on its way.
#[derive(Debug)]
pub struct Parcel<'a> {
    bytes: &'a [u8],
    digest: Digest,
}

impl<'a> Parcel<'a> {
    /// Of a table's file, seal included.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            digest: Digest::of(&Sha512::digest(bytes)),
        }
    }

    /// What tells it from others.
    #[must_use]
    pub const fn digest(&self) -> Digest {
        self.digest
    }

    /// What its chunks are marked with.
    #[must_use]
    pub const fn transfer(&self) -> u32 {
        self.digest.transfer()
    }

    /// Bytes.
    #[must_use]
    pub const fn length(&self) -> u32 {
        self.bytes.len() as u32
    }

    /// At most `length` bytes from `offset` on.
    pub(super) fn part(&self, offset: u32, length: u32) -> &'a [u8] {
        let rest = self.bytes.get(offset as usize..).unwrap_or_default();
        rest.get(..length as usize).unwrap_or(rest)
    }
}

/// Which sectors of a slot do not hold what they should.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct UploadPlan {
    /// The device's slots.
    pub slots: Slots,
    /// Indices of the sectors that differ.
    pub differing: BTreeSet<u32>,
    /// Sectors that the file takes.
    pub sectors: u32,
    length: u32,
}

impl UploadPlan {
    /// Compares the slot that the next table goes to with a file; changes nothing.
    /// Ends early where `stopped` says so.
    ///
    /// # Errors
    /// [`UploadError`].
    pub fn make<L: Line>(
        client: &mut Client<L>,
        parcel: &Parcel<'_>,
        mut stopped: impl FnMut() -> bool,
    ) -> Result<Self, UploadError> {
        let slots = client.slots()?;
        let size = slots.sector;
        let request = "sectors";
        if size == 0 {
            return Err(DeviceError::Answer { request }.into());
        }
        let sectors = parcel.length().div_ceil(size);
        let mut differing = BTreeSet::new();
        let mut first = 0;
        while first < sectors {
            if stopped() {
                return Err(UploadError::Stopped);
            }
            let held = client.sectors(parcel.length(), first)?;
            if held.first != first || held.crcs.is_empty() {
                return Err(DeviceError::Answer { request }.into());
            }
            for (sector, crc) in (first..sectors).zip(&held.crcs) {
                if crc32(&[parcel.part(sector * size, size)]) != *crc {
                    differing.insert(sector);
                }
            }
            first += held.crcs.len() as u32;
        }
        Ok(Self {
            slots,
            differing,
            sectors,
            length: parcel.length(),
        })
    }

    /// Bytes of the file in the sectors that differ.
    #[must_use]
    pub fn bytes(&self) -> u32 {
        self.differing.iter().map(|sector| self.size(*sector)).sum()
    }

    /// Bytes of the file in a sector.
    pub(super) fn size(&self, sector: u32) -> u32 {
        let start = sector.saturating_mul(self.slots.sector);
        self.length.saturating_sub(start).min(self.slots.sector)
    }
}
