//! NOR flash simulator: power cuts, bit rot, worn sectors and misread bytes by order, and a
//! count of the rules that its user broke.
//!
//! Whatever is random follows from a seed: a failure that was printed with its seed
//! and its step can be repeated.

mod damage;
mod operation;
mod spent;
#[cfg(test)]
mod tests;
mod work;

pub use operation::{NorError, Operation, Violations, Work};

use damage::Sector;
use fastrand::Rng;
use spent::Spent;
use std::ops::Range;

/// Steps that the erase of one sector takes, at each of which the power can fail.
pub const ERASE_STAGES: u64 = 8;

/// How a sector fails that has been erased too often. But for [`Wear::Refuses`] it says
/// nothing: only reading back shows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Wear {
    /// An erase leaves one bit in 1,024, and at least one, stuck at 0.
    StuckBits,
    /// A program leaves one bit in 64 of those that it should clear as it was.
    LostBits,
    /// Programs and erases report an error and change nothing.
    Refuses,
}

/// How a read goes wrong though the cells are good: a bus that is disturbed, a supply that
/// sags.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Misread {
    /// It fails.
    Error,
    /// All bits are 0.
    Zeros,
    /// All bits are 1, as of erased flash.
    Ones,
    /// One bit of the first byte is the other one.
    OneBit,
}

/// NOR flash in memory: write units of `W` bytes, sectors of `E` bytes, reads of
/// multiples of `R` bytes.
///
/// It holds its user to the rules of the strictest parts (flash with ECC over each
/// write unit): erased cells are 1, a program clears bits, and **a write unit is
/// programmed once between two erases**, even if more bits could be cleared, even if
/// the first program left it all ones. What breaks a rule is refused, changes
/// nothing, and is counted in [`violations`](Self::violations).
///
/// # Power cuts
///
/// The work of the flash is counted in *steps*: a byte of a program is one, the erase
/// of a sector is [`ERASE_STAGES`]. [`cut_after`](Self::cut_after) lets the power fail
/// in the middle of a step:
///
/// | cut in | what is left |
/// |---|---|
/// | a byte | a random subset of the bits to be cleared is; bytes before it are programmed, bytes behind it untouched; its write unit may not be programmed again. [`with_whole_units`](Self::with_whole_units) has all bytes of that unit torn at once |
/// | an erase, first step | nothing has changed |
/// | an erase, any other | a random share of the zeros has become ones, from 1/64 at the second step to 1,023/1,024 at the last; no unit of the sector may be programmed |
///
/// From then on every call fails until [`power_on`](Self::power_on). To try an update
/// at every point where it can be cut:
///
/// ```
/// use embedded_storage::nor_flash::NorFlash;
/// use iltm_tests::flash_simulator::{NorError, NorSimulator, Violations};
///
/// // Write units of 4 bytes, two sectors of 256 bytes.
/// let new = NorSimulator::<4, 256>::new(2, 1);
/// let update = |flash: &mut NorSimulator<4, 256>| -> Result<(), NorError> {
///     flash.erase(256, 512)?;
///     flash.write(256, b"an update...")
/// };
///
/// let mut whole = new.clone();
/// update(&mut whole)?;
/// assert_eq!(whole.steps(), 8 + 12);
/// for cut in 0..=whole.steps() {
///     let mut flash = new.clone();
///     flash.cut_after(cut);
///     let result = update(&mut flash);
///     assert_eq!(result.is_ok(), cut == whole.steps());
///     flash.power_on();
///     // Here the firmware starts again and finds what is left.
///     update(&mut flash)?;
///     assert_eq!(flash.violations(), Violations::default(), "{:?}", flash.last_cut());
/// }
/// # Ok::<(), NorError>(())
/// ```
///
/// # Age
///
/// [`rot`](Self::rot) flips bits, [`wear_out`](Self::wear_out) limits how many erases
/// a sector stands. [`put`](Self::put) and [`contents`](Self::contents) are the debug
/// port.
///
/// [`misread`](Self::misread) spoils reads and leaves the cells as they are.
///
/// # Cost
///
/// A clone is two copies of memory (the cells, and one bit a write unit), a program
/// or an erase that is neither cut nor in a worn sector one more.
#[derive(Clone, Debug)]
pub struct NorSimulator<const W: usize, const E: usize, const R: usize = 1> {
    cells: Vec<u8>,
    spent: Spent,
    /// Bits that read as either, by byte; `None` for a part without any.
    weak: Option<Vec<u8>>,
    sectors: Vec<Sector>,
    random: Rng,
    steps: u64,
    /// Number of the step in which the power fails.
    cut_at: Option<u64>,
    misread: Option<(Range<usize>, u32, Misread)>,
    is_on: bool,
    part: Part,
    /// Units that cannot be read, on a part with ECC.
    torn: Option<Spent>,
    violations: Violations,
    last_cut: Option<Operation>,
    log: Option<Vec<Operation>>,
}

/// How a part programs and erases.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    /// A unit may be programmed again.
    is_rewritable: bool,
    /// An erase clears all bits first.
    preprograms: bool,
    /// All bytes of a unit are programmed at the same time.
    programs_units: bool,
}

impl<const W: usize, const E: usize, const R: usize> NorSimulator<W, E, R> {
    /// An erased flash of so many sectors. What is random in it follows from `seed`.
    ///
    /// That `W` divides `E` and that nothing is 0 is checked when it is compiled.
    pub fn new(sectors: usize, seed: u64) -> Self {
        const { assert!(W > 0 && E > 0 && R > 0 && E.is_multiple_of(W)) };
        let capacity = sectors.saturating_mul(E);
        Self {
            cells: vec![0xFF; capacity],
            spent: Spent::new(capacity / W),
            weak: None,
            sectors: vec![Sector::NEW; sectors],
            random: Rng::with_seed(seed),
            steps: 0,
            cut_at: None,
            misread: None,
            is_on: true,
            part: Part::default(),
            torn: None,
            violations: Violations::default(),
            last_cut: None,
            log: None,
        }
    }

    /// As a part on which a unit may be programmed again, to clear more bits. Ones
    /// leave bits as they are.
    pub const fn rewritable(mut self) -> Self {
        self.part.is_rewritable = true;
        self
    }

    /// As a part that clears all bits of a sector before it sets them all: an erase
    /// that is cut then leaves zeros as well where there were ones.
    pub const fn with_preprogramming(mut self) -> Self {
        self.part.preprograms = true;
        self
    }

    /// As a part on which bits that a cut caught in motion are *weak*: each read of
    /// one gives either value, until it is erased. (What reads well once after a cut
    /// may not do so again.)
    pub fn with_weak_bits(mut self) -> Self {
        self.weak = Some(vec![0; self.cells.len()]);
        self
    }

    /// As a part that programs all bytes of a write unit at the same time: a cut in one
    /// of them tears all.
    pub const fn with_whole_units(mut self) -> Self {
        self.part.programs_units = true;
        self
    }

    /// As a part with ECC over each write unit: one that a cut caught in motion cannot be
    /// read until it is erased.
    pub fn with_ecc(mut self) -> Self {
        self.torn = Some(Spent::new(self.cells.len() / W));
        self
    }

    /// Whether bytes can be read like memory; where not, a processor faults.
    pub fn is_readable(&self, bytes: Range<usize>) -> bool {
        let units = bytes.start / W..bytes.end.div_ceil(W);
        !self.torn.as_ref().is_some_and(|torn| torn.any(units))
    }

    /// Notes every operation in [`log`](Self::log).
    pub fn with_log(mut self) -> Self {
        self.log = Some(Vec::new());
        self
    }

    /// Lets what is random follow from another seed from here on, as for a clone that
    /// shall not fail like its original.
    pub fn reseed(&mut self, seed: u64) {
        self.random = Rng::with_seed(seed);
    }

    /// Steps done whole since the flash was made.
    pub const fn steps(&self) -> u64 {
        self.steps
    }

    /// Lets the power fail in the middle of the step that follows the next `steps`
    /// steps: 0 is the very next. An earlier order is forgotten.
    pub const fn cut_after(&mut self, steps: u64) {
        self.cut_at = Some(self.steps.saturating_add(steps));
    }

    /// Switches the power off between two operations.
    pub const fn power_off(&mut self) {
        self.is_on = false;
    }

    /// Switches the power on again. An order to cut that has not come true yet is
    /// forgotten.
    pub const fn power_on(&mut self) {
        self.is_on = true;
        self.cut_at = None;
    }

    /// Whether the power is on.
    pub const fn is_on(&self) -> bool {
        self.is_on
    }

    /// The operation that the last cut fell into.
    pub const fn last_cut(&self) -> Option<&Operation> {
        self.last_cut.as_ref()
    }

    /// All operations since the flash was made, with their errors, if
    /// [`with_log`](Self::with_log) was asked for; without those that found the power
    /// off already.
    pub fn log(&self) -> &[Operation] {
        self.log.as_deref().unwrap_or_default()
    }

    /// How often its user broke a rule of the part.
    pub const fn violations(&self) -> Violations {
        self.violations
    }

    /// How often a sector has been erased, cut erases included; `None` if there is no
    /// such sector.
    pub fn erases(&self, sector: usize) -> Option<u32> {
        self.sectors.get(sector).map(|sector| sector.erases)
    }

    /// Lets a sector stand so many erases in all, those before included; every one
    /// after fails as `wear` says.
    ///
    /// # Errors
    /// [`NorError::OutOfBounds`] if there is no such sector.
    pub fn wear_out(&mut self, sector: usize, erases: u32, wear: Wear) -> Result<(), NorError> {
        let sector = self.sectors.get_mut(sector).ok_or(NorError::OutOfBounds)?;
        sector.limit = Some((erases, wear));
        Ok(())
    }

    /// Flips `count` random bits of a range, all different; all bits if there are
    /// fewer.
    ///
    /// # Errors
    /// [`NorError::OutOfBounds`] if the range is not within the flash.
    pub fn rot(&mut self, range: Range<u32>, count: usize) -> Result<(), NorError> {
        let range = range.start as usize..range.end as usize;
        let cells = self.cells.get_mut(range).ok_or(NorError::OutOfBounds)?;
        damage::rot(cells, count, &mut self.random);
        Ok(())
    }

    /// Spoils the next `reads` reads that begin in a range. An earlier order is forgotten.
    pub const fn misread(&mut self, range: Range<usize>, reads: u32, how: Misread) {
        self.misread = Some((range, reads, how));
    }

    /// What is in the cells, power or not. A weak bit shows as what it would be on
    /// its own.
    pub fn contents(&self) -> &[u8] {
        &self.cells
    }

    /// Puts bytes where they are wanted, whatever the rules, as a debug port does that
    /// erases and programs. Power or not; no step, no erase counted. Write units that
    /// are all ones afterwards count as erased.
    ///
    /// # Errors
    /// [`NorError::OutOfBounds`] if they do not fit.
    pub fn put(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorError> {
        let from = offset as usize;
        let to = from.saturating_add(bytes.len());
        let cells = self.cells.get_mut(from..to).ok_or(NorError::OutOfBounds)?;
        cells.copy_from_slice(bytes);
        self.spent.clear(from / W..to.div_ceil(W));
        self.firm(from..to);
        if let Some(torn) = &mut self.torn {
            torn.clear(from / W..to.div_ceil(W));
        }
        Ok(())
    }

    /// The bits of these bytes are weak no more.
    fn firm(&mut self, bytes: Range<usize>) {
        if let Some(weak) = self.weak.as_mut().and_then(|weak| weak.get_mut(bytes)) {
            weak.fill(0);
        }
    }
}
