//! Identity records: the device's key and number, written once.
//!
//! A device without a key takes tables from anybody. So a key that cannot be read must
//! not pass for a key that was never given, and what is in this part of the flash does
//! not tell the two apart: a write or an erase that was cut may leave anything. The
//! commit records tell, which outlive every cut. Each says whether the device had a key
//! when it was written, and provisioning goes
//!
//! 1. a commit record, if there is none yet: without a key;
//! 2. this part erased, and the identity in two places, the first place last;
//! 3. a commit record: with a key. Only then the host is answered.
//!
//! | whole identity | last commit record | the device |
//! |---|---|---|
//! | yes | with a key, or none | has its key |
//! | yes | without | has its key if the first place is not blank, since the other copy was whole then; a commit record says so from now on. Else it was cut in step 2 |
//! | no | without | was cut in step 2: it has no key, and the part is erased |
//! | no | with a key | has lost its key |
//! | no | none | has no key if the part is blank, else it has lost it |
//!
//! A device that has lost its key changes nothing in this part, so that one bad start
//! (a supply that sags, a bus that is disturbed) is over with the next.

use super::map::Part;
use super::record::{self, Commit, Contents, Identity, RECORD, places};
use super::{StoreError, flash};
use embedded_storage::nor_flash::NorFlash;

/// What a factory programs at the start of the erased identity sector, so that the
/// device never takes a table from a stranger: the public key that its tables are
/// signed with, and the device's number. The device itself writes the same when it is
/// asked to.
#[must_use]
pub fn identity_record(key: [u8; 32], device: u64) -> [u8; RECORD] {
    record::bytes(&Identity { key, device })
}

/// What a start finds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Found {
    /// The device was never given a key.
    Nothing,
    /// It has this one.
    Identity(Identity),
    /// It was given one, which cannot be read.
    Lost,
}

/// Finds the identity beside the commit record that counts; erases what a provisioning
/// that was cut has left.
pub(super) fn find<F: NorFlash>(flash: &mut F, part: Part, last: Option<Commit>) -> Found {
    let (mut identity, mut blank, mut first_blank) = (None, true, true);
    for place in 0..places(part) {
        match record::look(flash, part, place) {
            Ok(Contents::Blank) => continue,
            Ok(Contents::Record(found)) => identity = identity.or(Some(found)),
            Ok(Contents::Corrupt) | Err(_) => {}
        }
        blank = false;
        first_blank &= place > 0;
    }
    // A part with one place has no other copy.
    let was_whole = !first_blank && places(part) > 1;
    match (identity, last.map(|last| last.has_key)) {
        (Some(identity), None | Some(true)) => Found::Identity(identity),
        (Some(identity), Some(false)) if was_whole => Found::Identity(identity),
        (_, Some(false)) => {
            if !blank {
                // A flash that fails here leaves things as they are.
                let _ = erase(flash, part);
            }
            Found::Nothing
        }
        (None, None) if blank => Found::Nothing,
        (None, _) => Found::Lost,
    }
}

/// Erases the part.
pub(super) fn erase<F: NorFlash>(flash: &mut F, part: Part) -> Result<(), StoreError> {
    flash::erase(flash, part, 0, part.length)
}

/// Writes the identity of a device that has none, twice where there is room: one that
/// rots is there once more. Erases first: what looks blank may have been cut before.
pub(super) fn write<F: NorFlash>(
    flash: &mut F,
    part: Part,
    identity: &Identity,
) -> Result<(), StoreError> {
    erase(flash, part)?;
    let mut written = |place| record::write(flash, part, place, identity).is_ok();
    let other = (1..places(part)).any(&mut written);
    if written(0) || other {
        Ok(())
    } else {
        Err(StoreError::Full)
    }
}
