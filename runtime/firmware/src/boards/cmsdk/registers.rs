//! Access to the registers of a peripheral.

use core::ptr::with_exposed_provenance_mut;

/// The registers of one peripheral, 32 bits each.
#[derive(Clone, Copy)]
pub(super) struct Registers {
    base: usize,
}

/// Bytes of a CMSDK peripheral.
const SIZE: usize = 0x1000;

impl Registers {
    /// The registers from `base` on.
    ///
    /// # Safety
    /// There is a peripheral at `base` whose [`SIZE`] bytes may be read and
    /// written as words at any time without effect on memory.
    pub(super) const unsafe fn at(base: usize) -> Self {
        Self { base }
    }

    /// The register at `offset` bytes.
    pub(super) fn read(self, offset: usize) -> u32 {
        // SAFETY: `at` promises that words of the peripheral may be read; the mask
        // keeps the address aligned and in it.
        unsafe { with_exposed_provenance_mut::<u32>(self.address(offset)).read_volatile() }
    }

    /// Writes the register at `offset` bytes.
    pub(super) fn write(self, offset: usize, value: u32) {
        // SAFETY: as in `read`.
        unsafe { with_exposed_provenance_mut::<u32>(self.address(offset)).write_volatile(value) }
    }

    const fn address(self, offset: usize) -> usize {
        self.base + (offset & (SIZE - 4))
    }
}
