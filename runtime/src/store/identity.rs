//! The device's key and number: a record that is written once.

use super::map::Part;
use super::record::{self, Identity, Place, RECORD, places};
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

/// Finds the identity; the first that is whole counts.
pub(super) fn find<F: NorFlash>(flash: &mut F, part: Part) -> Option<Identity> {
    (0..places(part)).find_map(|place| match record::look(flash, part, place) {
        Ok(Place::Record(identity)) => Some(identity),
        _ => None,
    })
}

/// Ends the doubt about a record that was cut and reads as none now: it might read as
/// whole at another start. Only for a part without a whole record.
pub(super) fn settle<F: NorFlash>(flash: &mut F, part: Part) -> Result<(), StoreError> {
    let mut doubtful = |place| {
        !matches!(
            record::look::<F, Identity>(flash, part, place),
            Ok(Place::Blank)
        )
    };
    if (0..places(part)).any(&mut doubtful) {
        flash::erase(flash, part, 0, part.length)?;
    }
    Ok(())
}

/// Writes the identity of a device that has none, twice where there is room: a record
/// that rots must not open the device to strangers. Erases first: what looks blank may
/// have been cut before.
pub(super) fn write<F: NorFlash>(
    flash: &mut F,
    part: Part,
    identity: &Identity,
) -> Result<(), StoreError> {
    flash::erase(flash, part, 0, part.length)?;
    let mut written = |place: &u32| record::write(flash, part, *place, identity).is_ok();
    match (0..places(part))
        .filter(|place| written(place))
        .take(2)
        .count()
    {
        0 => Err(StoreError::Full),
        _ => Ok(()),
    }
}
