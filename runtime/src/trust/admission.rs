//! Admission: checks signature, version and contents of a table before it may run.

use super::{Accepted, Rejected, Terms, ed25519};
use crate::image::{Checked, Seal, Table, Whole, seal, unseal};
use crate::yield_budget::YieldBudget;

/// [`examine`]s a file and makes its table.
///
/// # Errors
/// As [`examine`].
pub fn admit<'a>(
    file: &'a [u8],
    terms: &Terms,
    yield_now: &mut (impl FnMut() + ?Sized),
) -> Result<(Table<'a>, Accepted), Rejected> {
    let (checked, accepted) = examine(file, terms, yield_now)?;
    Ok((checked.table(), accepted))
}

/// Checks the bytes of a whole file against `terms`, and its table as
/// [`Table::check`] does. What this returns may run.
///
/// `yield_now` is called every few thousand instructions, and a device works on frames
/// in it: on the reference board at most 25,000 apart, but for a square root and an
/// inverse modulo `2^255 - 19`, which a signature takes one each of: 125,000 and
/// 108,000.
///
/// # Errors
/// The first that applies of [`Rejected`]: what is no table, or another format;
/// damage, which the checksums tell from forgery; then, where the device has a
/// key, no signature, another key, a false signature, another device, an old version;
/// last, contents that the runtime cannot use.
pub fn examine<'a>(
    file: &'a [u8],
    terms: &Terms,
    yield_now: &mut (impl FnMut() + ?Sized),
) -> Result<(Checked<'a>, Accepted), Rejected> {
    let (image, seal) = unseal(file)?;
    let mut budget = YieldBudget::new(yield_now);
    let whole = Whole::new(image, &mut budget)?;
    let oldest = match &terms.trust.key {
        Some(key) => vouched(file, seal.as_ref(), key, terms, &mut budget)?,
        None => 0,
    };
    let checked = Checked::of(whole, &mut budget)?;
    let accepted = Accepted {
        id: checked.id(),
        version: seal.map_or(0, |seal| seal.version),
        oldest,
        length: file.len() as u32,
        grid: checked.meta().grid,
        channels: checked.meta().channels,
        label: checked.meta().label,
    };
    Ok((checked, accepted))
}

/// The floor that the file brings, if it is signed with `key`, for this device,
/// and recent enough.
#[inline(never)]
fn vouched(
    file: &[u8],
    seal: Option<&Seal>,
    key: &[u8; 32],
    terms: &Terms,
    budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
) -> Result<u32, Rejected> {
    let seal = seal.ok_or(Rejected::Unsigned)?;
    if seal.key != Seal::key_id(key) {
        return Err(Rejected::WrongKey);
    }
    let signed = file.len().saturating_sub(seal::field::SIGNATURE.len());
    let message = file.get(..signed).unwrap_or_default();
    if !ed25519::verify(key, &seal.signature, message, budget) {
        return Err(Rejected::Signature);
    }
    if seal.device != 0 && seal.device != terms.trust.device {
        return Err(Rejected::OtherDevice {
            device: seal.device,
        });
    }
    if seal.version < terms.floor {
        return Err(Rejected::Older {
            version: seal.version,
            floor: terms.floor,
        });
    }
    // A table that revoked itself would be lost at the start after its confirmation.
    Ok(seal.oldest.min(seal.version))
}
