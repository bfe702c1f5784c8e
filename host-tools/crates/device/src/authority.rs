//! Authority: whoever signs the rights that a device with a key wants to be shown.

use iltm_runtime::trust::Deed;
use std::fmt;

/// Signs a deed for the device of a number and its next commit record.
type Sign = dyn Fn(&Deed, u64, u32) -> Vec<u8>;

/// Signs rights, with a key that stays where it is.
pub struct Authority(Box<Sign>);

impl Authority {
    /// One that signs so: the deed, the device's number and the sequence number that it
    /// states make a [right](iltm_runtime::trust::allows).
    pub fn new(sign: impl Fn(&Deed, u64, u32) -> Vec<u8> + 'static) -> Self {
        Self(Box::new(sign))
    }

    /// The right to do this.
    pub(super) fn right(&self, deed: &Deed, device: u64, sequence: u32) -> Vec<u8> {
        (self.0)(deed, device, sequence)
    }
}

impl fmt::Debug for Authority {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Authority")
    }
}
