//! Neighbours: the other projectors of a room, whose light comes to this one's surfaces too.
//!
//! A table for one of several projectors has its own frame's cells, and takes the light that
//! is wanted of the others' frames on a coarser grid: all of them side by side, from left to
//! right, without its own. Their coefficients are inputs of the operator behind those of its
//! own cells.

use super::bytes::{Halfwords, u16_at};
use super::layout::neighbours;
use super::sections::Section;
use super::{ImageError, Meta};
use crate::Grid;
use crate::units::{Halfword, Light};
use crate::yield_budget::{YieldBudget, cost};

/// What a table says of the other projectors.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Neighbours<'a> {
    grid: Grid,
    channels: u8,
    before: u8,
    after: u8,
    ambient: Option<Halfwords<'a>>,
}

impl<'a> Neighbours<'a> {
    /// Their cells: those of all frames side by side.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// Projectors on the left of this one, and on its right.
    #[must_use]
    pub const fn around(&self) -> [usize; 2] {
        [self.before as usize, self.after as usize]
    }

    /// Cells of the light of all, channels counted: as many [`Light`]s come with each frame,
    /// row by row, channels of a cell side by side.
    #[must_use]
    pub const fn samples(&self) -> usize {
        self.grid.cells() * self.channels as usize
    }

    /// Bytes of them.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.samples() * size_of::<Halfword>()
    }

    /// Light that is wanted of the cells in one channel, without the ambient light, from what
    /// came with a frame. Light above that of reference white is taken for it.
    pub(crate) fn fill(&self, heard: &[Halfword], channel: usize, cells: &mut [i32]) {
        let ambient = self.ambient.map_or(&[][..], Halfwords::words);
        let mut at = channel;
        for cell in cells {
            let bits = |all: &[Halfword]| all.get(at).map_or(0, |light| u16::from_le_bytes(*light));
            let light = bits(heard).min(Light::ONE.to_bits());
            *cell = light.saturating_sub(bits(ambient)).into();
            at += usize::from(self.channels);
        }
    }

    /// Reads the section of a table with this meta section, and with ambient light or not.
    pub(super) fn parse(
        section: Section<'a>,
        meta: &Meta,
        has_ambient: bool,
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> Result<Self, ImageError> {
        let (head, rest) = section
            .bytes
            .split_at_checked(neighbours::SIZE)
            .ok_or(section.length_error())?;
        let half = |field| u16_at(head, field).unwrap_or(0);
        let byte = |at: usize| head.get(at).copied().unwrap_or(0);
        let (before, after) = (byte(neighbours::BEFORE), byte(neighbours::AFTER));
        let others = usize::from(before) + usize::from(after);
        let grid = Grid::new(half(neighbours::ROWS), half(neighbours::COLS))
            .ok()
            // The inputs of the operator are as many as a grid may have cells, and neighbours
            // are at most half of them.
            .filter(|grid| grid.cells() <= meta.grid.cells())
            .filter(|grid| grid.cells() + meta.grid.cells() <= Grid::MAX_CELLS)
            .ok_or(section.field_error("grid", neighbours::ROWS.start))?;
        if others == 0 || !grid.cols().is_multiple_of(others) {
            return Err(section.field_error("projectors", neighbours::BEFORE));
        }
        if half(neighbours::RESERVED) != 0 {
            return Err(section.field_error("reserved", neighbours::RESERVED.start));
        }
        let samples = grid.cells() * usize::from(meta.channels);
        let words = Halfwords::new(rest).ok_or(section.length_error())?;
        if words.len() != if has_ambient { samples } else { 0 } {
            return Err(section.length_error());
        }
        let too_much = |bits| {
            budget.spend(1, cost::VALUE);
            Light::from_bits(bits) > Light::ONE
        };
        if let Some(index) = words.run(0, words.len()).position(too_much) {
            return Err(section.field_error("ambient light", neighbours::SIZE + 2 * index));
        }
        Ok(Self {
            grid,
            channels: meta.channels,
            before,
            after,
            ambient: has_ambient.then_some(words),
        })
    }

    /// The head of the section; the ambient light follows.
    #[must_use]
    pub fn head(grid: Grid, [before, after]: [u8; 2]) -> [u8; neighbours::SIZE] {
        let [rows, cols] = [grid.rows(), grid.cols()].map(|side| (side as u16).to_le_bytes());
        let [[a, b], [c, d]] = [rows, cols];
        [a, b, c, d, before, after, 0, 0]
    }
}

#[cfg(test)]
mod tests {
    use super::super::made_up::{flat, image};
    use super::super::{ImageError, SectionProblem, Table};
    use super::*;
    use crate::image::layout::SectionKind;
    use std::vec;
    use std::vec::Vec;

    /// A table of 4 x 6 cells, perhaps with ambient light, whose neighbours section is this.
    fn with_neighbours(ambient: bool, bytes: Vec<u8>) -> Result<Vec<i32>, ImageError> {
        let mut sections = flat(4, 6);
        if ambient {
            let light = 100_u16.to_le_bytes().repeat(24);
            sections.push((SectionKind::Ambient, light));
        }
        sections.push((SectionKind::Neighbours, bytes));
        let image = image(&sections);
        let table = Table::check(&image)?;
        let neighbours = table.neighbours().expect("it has been written");
        assert_eq!(table.inputs(), 24 + neighbours.grid().cells());
        assert_eq!(neighbours.bytes(), 2 * neighbours.samples());
        let heard: Vec<Halfword> = [0_u16, 50, 1_000, u16::MAX]
            .iter()
            .map(|light| light.to_le_bytes())
            .collect();
        let mut cells = vec![-1; 4];
        neighbours.fill(&heard, 0, &mut cells);
        Ok(cells)
    }

    fn head(rows: u16, cols: u16, around: [u8; 2]) -> Vec<u8> {
        Neighbours::head(Grid::new(rows, cols).unwrap(), around).to_vec()
    }

    #[test]
    fn light_is_without_the_ambient_light_of_its_cell_and_no_more_than_white() {
        let dark = with_neighbours(false, head(1, 4, [1, 1])).unwrap();
        assert_eq!(dark, [0, 50, 1_000, 1 << 15]);
        let mut bytes = head(1, 4, [0, 2]);
        for light in [7_u16, 60, 60, 68] {
            bytes.extend(light.to_le_bytes());
        }
        let lit = with_neighbours(true, bytes).unwrap();
        assert_eq!(lit, [0, 0, 940, (1 << 15) - 68]);
    }

    #[test]
    fn what_contradicts_the_table_is_refused_with_its_field() {
        let field = |field, offset| ImageError::Field {
            section: SectionKind::Neighbours,
            field,
            offset,
        };
        let length = ImageError::Section {
            section: SectionKind::Neighbours,
            problem: SectionProblem::Length,
        };
        let changed = |at: usize, byte: u8| {
            let mut bytes = head(1, 4, [1, 1]);
            bytes[at] = byte;
            bytes
        };
        let mut bright = head(1, 4, [1, 1]);
        bright.extend([0, 0, 0, 0, 1, 0x80, 0, 0]);
        let mut long = head(1, 4, [1, 1]);
        long.extend([0, 0]);
        for (ambient, bytes, error) in [
            (false, vec![], length),
            (false, long, length),
            (true, head(1, 4, [1, 1]), length),
            (true, bright, field("ambient light", 12)),
            (false, changed(0, 0), field("grid", 0)),
            (false, head(5, 5, [1, 0]), field("grid", 0)),
            (false, head(1, 4, [0, 0]), field("projectors", 4)),
            (false, head(1, 4, [2, 1]), field("projectors", 4)),
            (false, changed(6, 1), field("reserved", 6)),
        ] {
            let shown = std::format!("{bytes:?}");
            assert_eq!(with_neighbours(ambient, bytes), Err(error), "{shown}");
        }
    }
}
