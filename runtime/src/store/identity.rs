//! The device's key and number: a record that is written once.

use super::StoreError;
use super::map::Part;
use super::record::{self, Identity, Place, places};
use embedded_storage::nor_flash::NorFlash;

/// Finds the identity; the first that is whole counts.
pub(super) fn find<F: NorFlash>(flash: &mut F, part: Part) -> Option<Identity> {
    (0..places(part)).find_map(|place| match record::look(flash, part, place) {
        Ok(Place::Record(identity)) => Some(identity),
        _ => None,
    })
}

/// Writes the identity of a device that has none.
pub(super) fn write<F: NorFlash>(
    flash: &mut F,
    part: Part,
    identity: &Identity,
) -> Result<(), StoreError> {
    for place in 0..places(part) {
        let blank = matches!(
            record::look::<F, Identity>(flash, part, place),
            Ok(Place::Blank)
        );
        // As in the journal, a place may look blank and not be.
        if blank && record::write(flash, part, place, identity).is_ok() {
            return Ok(());
        }
    }
    Err(StoreError::Full)
}
