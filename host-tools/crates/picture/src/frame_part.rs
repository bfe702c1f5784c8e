//! Frame part: what one of several projectors shows of a wide frame, in cells or in pixels.
//!
//! The frames of all stand side by side from left to right, their first rows beside each other. Below
//! a frame that is lower than the highest, the wide frame has cells of no projector.

use iltm_runtime::{FrameSize, Grid};
use std::ops::Range;

/// Columns and rows of a wide frame that are one projector's.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FramePart {
    /// Its columns.
    pub columns: Range<usize>,
    /// Its rows, from the first one.
    pub rows: usize,
}

impl FramePart {
    /// The parts of frames with so many rows and columns, from left to right.
    pub fn side_by_side(frames: impl IntoIterator<Item = [usize; 2]>) -> Vec<Self> {
        let mut end = 0;
        let frames = frames.into_iter();
        let part = |[rows, cols]: [usize; 2]| {
            let start = end;
            end += cols;
            Self {
                columns: start..end,
                rows,
            }
        };
        frames.map(part).collect()
    }

    /// All of a frame.
    #[must_use]
    pub const fn whole(grid: Grid) -> Self {
        Self {
            columns: 0..grid.cols(),
            rows: grid.rows(),
        }
    }

    /// Rows and columns of the wide frame of all parts.
    #[must_use]
    pub fn around(parts: &[Self]) -> [usize; 2] {
        let rows = parts.iter().map(|part| part.rows).max();
        let cols = parts.last().map_or(0, |last| last.columns.end);
        [rows.unwrap_or(0), cols]
    }

    /// Cells of the wide frame of all parts; `None` if they are more than a grid may have.
    #[must_use]
    pub fn grid(parts: &[Self]) -> Option<Grid> {
        let [rows, cols] = Self::around(parts);
        Grid::new(rows.try_into().ok()?, cols.try_into().ok()?).ok()
    }

    /// The number in the wide frame, which has so many columns, of a cell or pixel of the part.
    #[must_use]
    pub fn place(&self, cols: usize, own: usize) -> usize {
        let width = self.columns.len();
        own / width * cols + self.columns.start + own % width
    }

    /// The number in the part of a cell or pixel of the wide frame, which has so many columns; `None`
    /// of one that is not the part's.
    #[must_use]
    pub fn own(&self, cols: usize, at: usize) -> Option<usize> {
        let (row, col) = (at / cols, at % cols);
        let inside = row < self.rows && self.columns.contains(&col);
        inside.then(|| row * self.columns.len() + col - self.columns.start)
    }

    /// The numbers in the wide frame of all cells or pixels of the part, row by row.
    pub fn places(&self, cols: usize) -> impl Iterator<Item = usize> {
        (0..self.rows).flat_map(move |row| {
            let columns = self.columns.clone();
            columns.map(move |col| row * cols + col)
        })
    }

    /// The pixels of a part of so many cells, of a frame for `grid`; `None` if a pixel would be
    /// shared.
    #[must_use]
    pub fn pixels(&self, grid: Grid, frame: FrameSize) -> Option<Self> {
        let pixel = |cell: usize, cells: usize, pixels: usize| {
            let place = cell * pixels;
            place.is_multiple_of(cells).then_some(place / cells)
        };
        let column = |col| pixel(col, grid.cols(), frame.width());
        Some(Self {
            columns: column(self.columns.start)?..column(self.columns.end)?,
            rows: pixel(self.rows, grid.rows(), frame.height())?,
        })
    }

    /// The frame for `grid` in which a part of so many cells has `own` pixels; `None` if there would be
    /// no whole number of them.
    #[must_use]
    pub fn wide(&self, grid: Grid, own: FrameSize) -> Option<FrameSize> {
        let side = |pixels: usize, cells: usize, all: usize| {
            let wide = pixels * all;
            wide.is_multiple_of(cells)
                .then_some(wide / cells)?
                .try_into()
                .ok()
        };
        FrameSize::new(
            side(own.width(), self.columns.len(), grid.cols())?,
            side(own.height(), self.rows, grid.rows())?,
        )
    }

    /// The part as a frame of its own; `None` if it is none.
    #[must_use]
    pub fn frame(&self) -> Option<FrameSize> {
        FrameSize::new(
            self.columns.len().try_into().ok()?,
            self.rows.try_into().ok()?,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_two_heights_stand_side_by_side() {
        let parts = FramePart::side_by_side([[3, 2], [2, 4]]);
        assert_eq!(FramePart::around(&parts), [3, 6]);
        let grid = FramePart::grid(&parts).unwrap();
        let owners = |at: usize| parts.iter().filter_map(move |part| part.own(6, at)).count();
        let all: Vec<usize> = (0..grid.cells()).map(owners).collect();
        assert_eq!(all, [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0]);
        for part in &parts {
            let places: Vec<usize> = part.places(6).collect();
            let own: Vec<usize> = (0..places.len()).collect();
            let there: Vec<usize> = own.iter().map(|own| part.place(6, *own)).collect();
            assert_eq!(there, places);
            let back: Vec<_> = there.iter().filter_map(|at| part.own(6, *at)).collect();
            assert_eq!(back, own);
        }
    }

    #[test]
    fn no_pixel_is_of_two_parts() {
        let parts = FramePart::side_by_side([[3, 2], [2, 4]]);
        let grid = FramePart::grid(&parts).unwrap();
        let size = |width, height| FrameSize::new(width, height).unwrap();
        let pixels = parts[1].pixels(grid, size(18, 30)).unwrap();
        assert_eq!((pixels.columns.clone(), pixels.rows), (6..18, 20));
        assert_eq!(pixels.frame(), Some(size(12, 20)));
        assert_eq!(parts[1].wide(grid, size(12, 20)), Some(size(18, 30)));
        assert_eq!(parts[1].wide(grid, size(12, 19)), None);
        assert_eq!(
            FramePart::whole(grid).wide(grid, size(7, 5)),
            Some(size(7, 5))
        );
        assert_eq!(parts[1].pixels(grid, size(16, 30)), None);
        assert_eq!(parts[1].pixels(grid, size(18, 31)), None);
    }
}
