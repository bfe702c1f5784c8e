//! The device's key and number: a record that is written once.

use super::map::Part;
use super::record::{self, Identity, Place, places};
use super::{StoreError, flash};
use embedded_storage::nor_flash::NorFlash;

/// Finds the identity; the first that is whole counts.
pub(super) fn find<F: NorFlash>(flash: &mut F, part: Part) -> Option<Identity> {
    (0..places(part)).find_map(|place| match record::look(flash, part, place) {
        Ok(Place::Record(identity)) => Some(identity),
        _ => None,
    })
}

/// Writes the identity of a device that has none. Erases first: what looks blank may
/// have been cut before.
pub(super) fn write<F: NorFlash>(
    flash: &mut F,
    part: Part,
    identity: &Identity,
) -> Result<(), StoreError> {
    flash::erase(flash, part, 0, part.length)?;
    let mut places = 0..places(part);
    if places.any(|place| record::write(flash, part, place, identity).is_ok()) {
        return Ok(());
    }
    Err(StoreError::Full)
}
