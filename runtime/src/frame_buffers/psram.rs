//! Memory map of the emulated boards' PSRAM.
//!
//! 16 MiB that stand for three things of a real board: the NOR flash with the
//! table slots, the flash sectors for small records, and the DMA memory of the
//! frames. Behind it is a file of the host. Offsets are from the start of the
//! PSRAM, whose address differs from board to board.

use core::ops::Range;

/// Bytes of the PSRAM.
pub const SIZE: usize = 16 << 20;

/// Table slot A.
pub const SLOT_A: Range<usize> = 0..2 << 20;

/// Table slot B.
pub const SLOT_B: Range<usize> = 2 << 20..4 << 20;

/// Bytes that the part that stands for flash is erased in.
pub const SECTOR: usize = 4 << 10;

/// Commit records of the slots, in two sectors in turn.
pub const RECORDS: [Range<usize>; 2] = [
    4 << 20..(4 << 20) + SECTOR,
    (4 << 20) + SECTOR..(4 << 20) + 2 * SECTOR,
];

/// The device's key and number.
pub const IDENTITY: Range<usize> = (4 << 20) + 2 * SECTOR..(4 << 20) + 3 * SECTOR;

/// All that stands for flash: erased, it is all ones.
pub const FLASH: Range<usize> = 0..5 << 20;

/// Orders to the firmware's self-test and its findings; the product leaves it
/// alone.
pub const SELF_TEST: Range<usize> = 5 << 20..6 << 20;

/// The frame memory.
pub const FRAMES: Range<usize> = 6 << 20..SIZE;
