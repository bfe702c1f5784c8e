//! NOR flash work: what a simulated flash does when it is asked: read, program, erase.

use super::damage::{self, Sector};
use super::{ERASE_STAGES, Misread, NorError, NorSimulator, Operation, Wear, Work};
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, ReadNorFlash, check_erase, check_read, check_write,
};

/// Bytes that are looked at together for weak ones: hardly any are.
const FEW: usize = 64;

impl<const W: usize, const E: usize, const R: usize> ErrorType for NorSimulator<W, E, R> {
    type Error = NorError;
}

impl<const W: usize, const E: usize, const R: usize> ReadNorFlash for NorSimulator<W, E, R> {
    const READ_SIZE: usize = R;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorError> {
        self.need_power()?;
        if let Err(kind) = check_read(self, offset, bytes.len()) {
            self.violations.count(kind.into());
            return Err(kind.into());
        }
        let (from, to) = (offset as usize, offset as usize + bytes.len());
        if !self.is_readable(from..to) {
            return Err(NorError::Unreadable);
        }
        bytes.copy_from_slice(self.cells.get(from..to).unwrap_or_default());
        let weak = self.weak.as_ref().and_then(|weak| weak.get(from..to));
        let weak = weak.unwrap_or_default().chunks(FEW);
        for (bytes, weak) in bytes.chunks_mut(FEW).zip(weak) {
            if weak == &[0; FEW][..weak.len()] {
                continue;
            }
            for (byte, weak) in bytes.iter_mut().zip(weak).filter(|(_, weak)| **weak != 0) {
                *byte = (*byte & !weak) | (self.random.u8(..) & weak);
            }
        }
        self.spoil(from, bytes)
    }

    fn capacity(&self) -> usize {
        self.cells.len()
    }
}

impl<const W: usize, const E: usize, const R: usize> NorFlash for NorSimulator<W, E, R> {
    const WRITE_SIZE: usize = W;
    const ERASE_SIZE: usize = E;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorError> {
        self.need_power()?;
        let before = self.steps;
        let result = self.erase_sectors(from, to);
        let length = to.saturating_sub(from) as usize;
        self.note(Work::Erase, from, length, before, result)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorError> {
        self.need_power()?;
        let before = self.steps;
        let result = self.program(offset, bytes);
        self.note(Work::Program, offset, bytes.len(), before, result)
    }
}

impl<const W: usize, const E: usize, const R: usize> NorSimulator<W, E, R> {
    const fn need_power(&self) -> Result<(), NorError> {
        if self.is_on {
            Ok(())
        } else {
            Err(NorError::PowerCut)
        }
    }

    /// Spoils what was read from an offset if that was ordered.
    fn spoil(&mut self, from: usize, bytes: &mut [u8]) -> Result<(), NorError> {
        let Some((range, reads, how)) = &mut self.misread else {
            return Ok(());
        };
        if !range.contains(&from) || *reads == 0 {
            return Ok(());
        }
        *reads -= 1;
        match how {
            Misread::Error => return Err(NorError::Unreadable),
            Misread::Zeros => bytes.fill(0),
            Misread::Ones => bytes.fill(0xFF),
            Misread::OneBit => {
                if let Some(byte) = bytes.first_mut() {
                    *byte ^= 1;
                }
            }
        }
        Ok(())
    }

    /// Counts, notes and passes on what came of an operation.
    fn note(
        &mut self,
        work: Work,
        offset: u32,
        length: usize,
        before: u64,
        result: Result<(), NorError>,
    ) -> Result<(), NorError> {
        let operation = Operation {
            work,
            offset,
            length,
            before,
            done: self.steps - before,
            result,
        };
        match result {
            Err(NorError::PowerCut) => self.last_cut = Some(operation),
            Err(error) => self.violations.count(error),
            Ok(()) => {}
        }
        if let Some(log) = &mut self.log {
            log.push(operation);
        }
        result
    }

    /// Does so many steps, or those before the cut; then the power is off.
    fn advance(&mut self, steps: u64) -> u64 {
        let left = self.cut_at.map(|at| at.saturating_sub(self.steps));
        let done = left.map_or(steps, |left| left.min(steps));
        self.steps += done;
        self.is_on = done == steps;
        done
    }

    fn program(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorError> {
        check_write(self, offset, bytes.len())?;
        let (from, to) = (offset as usize, offset as usize + bytes.len());
        self.refuses(from, to)?;
        if !self.part.is_rewritable
            && let Some(unit) = self.first_spent(from, to)
        {
            return Err(NorError::NotErased { unit });
        }
        let done = self.advance(bytes.len() as u64) as usize;
        let (whole, rest) = bytes.split_at_checked(done).unwrap_or((bytes, &[]));
        self.settle(from, whole);
        // The unit of a torn byte is spent, whatever it looks like.
        let torn = usize::from(!rest.is_empty());
        self.spent
            .set(from / W..(from + whole.len() + torn).div_ceil(W));
        let at = from + whole.len();
        let unit = if self.part.programs_units { W } else { 1 };
        for place in at / unit * unit..at / unit * unit + unit {
            // Those before it are done in this model, and go back into motion.
            if let Some(byte) = bytes.get(place - from).filter(|_| !rest.is_empty()) {
                self.tear(place, *byte);
            }
        }
        self.need_power()
    }

    /// Whether one of the sectors is worn so that it takes nothing.
    fn refuses(&self, from: usize, to: usize) -> Result<(), NorError> {
        let sectors = self.sectors.get(from / E..to.div_ceil(E));
        let worn = |sector: &Sector| sector.is_worn(Wear::Refuses);
        if sectors.unwrap_or_default().iter().any(worn) {
            return Err(NorError::Worn);
        }
        Ok(())
    }

    /// Where the first unit begins that may not be programmed.
    fn first_spent(&self, from: usize, to: usize) -> Option<u32> {
        let is_erased = |from: usize, to: usize| {
            let cells = self.cells.get(from..to).unwrap_or_default();
            // Without a way out the loop takes many bytes at once.
            let all = cells.iter().fold(0xFF, |all, cell| all & cell);
            all == 0xFF && !self.spent.any(from / W..to / W)
        };
        if is_erased(from, to) {
            return None;
        }
        let mut units = (from..to).step_by(W);
        units
            .find(|unit| !is_erased(*unit, unit + W))
            .map(|unit| unit as u32)
    }

    /// Programs bytes that no cut falls into.
    fn settle(&mut self, from: usize, bytes: &[u8]) {
        let to = from + bytes.len();
        let sectors = self.sectors.get(from / E..to.div_ceil(E));
        let mut sectors = sectors.unwrap_or_default().iter();
        let is_worn = sectors.any(|sector| sector.is_worn(Wear::LostBits));
        let cells = self.cells.get_mut(from..to).unwrap_or_default();
        if is_worn {
            for ((at, cell), byte) in (from..).zip(cells).zip(bytes) {
                let sector = self.sectors.get(at / E);
                let is_worn = sector.is_some_and(|sector| sector.is_worn(Wear::LostBits));
                *cell = if is_worn {
                    damage::worn_program(*cell, *byte, &mut self.random)
                } else {
                    *cell & byte
                };
            }
        } else {
            for (cell, byte) in cells.iter_mut().zip(bytes) {
                *cell &= byte;
            }
        }
        if let Some(weak) = self.weak.as_mut().and_then(|weak| weak.get_mut(from..to)) {
            // A bit that has been cleared whole is a firm 0.
            for (weak, byte) in weak.iter_mut().zip(bytes) {
                *weak &= byte;
            }
        }
    }

    /// Programs a byte in which the power fails.
    fn tear(&mut self, at: usize, byte: u8) {
        if self.part.programs_units
            && let Some(cell) = self.cells.get_mut(at)
        {
            *cell = 0xFF;
        }
        let Some(cell) = self.cells.get_mut(at) else {
            return;
        };
        if let Some(torn) = &mut self.torn {
            torn.set(at / W..at / W + 1);
        }
        if let Some(weak) = self.weak.as_mut().and_then(|weak| weak.get_mut(at)) {
            *weak |= *cell & !byte;
        }
        *cell = damage::torn(*cell, byte, &mut self.random);
    }

    fn erase_sectors(&mut self, from: u32, to: u32) -> Result<(), NorError> {
        check_erase(self, from, to)?;
        self.refuses(from as usize, to as usize)?;
        for sector in from as usize / E..to as usize / E {
            let stage = self.advance(ERASE_STAGES);
            self.erase_sector(sector, stage);
            self.need_power()?;
        }
        Ok(())
    }

    /// Erases a sector up to a stage.
    fn erase_sector(&mut self, sector: usize, stage: u64) {
        let (from, to) = (sector * E, (sector + 1) * E);
        let Some(cells) = self.cells.get_mut(from..to) else {
            return;
        };
        let Some(sector) = self.sectors.get_mut(sector) else {
            return;
        };
        if stage == 0 {
            return;
        }
        sector.erases = sector.erases.saturating_add(1);
        let weak = self.weak.as_mut().and_then(|weak| weak.get_mut(from..to));
        if stage < ERASE_STAGES {
            damage::half_erased(cells, weak, stage, self.part.preprograms, &mut self.random);
            self.spent.set(from / W..to / W);
            if let Some(torn) = &mut self.torn {
                torn.set(from / W..to / W);
            }
            return;
        }
        cells.fill(0xFF);
        if sector.is_worn(Wear::StuckBits) {
            damage::worn_erase(cells, &mut self.random);
        }
        self.spent.clear(from / W..to / W);
        if let Some(torn) = &mut self.torn {
            torn.clear(from / W..to / W);
        }
        self.firm(from..to);
    }
}
