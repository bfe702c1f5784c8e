//! The size of a frame.

use crate::Grid;
use core::fmt;

/// `width x height` pixels, neither zero.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub struct FrameSize {
    width: u16,
    height: u16,
}

impl FrameSize {
    /// Makes a size; `None` if a side is zero.
    #[must_use]
    pub const fn new(width: u16, height: u16) -> Option<Self> {
        if width == 0 || height == 0 {
            return None;
        }
        Some(Self { width, height })
    }

    /// One pixel a cell.
    #[must_use]
    pub const fn of_grid(grid: Grid) -> Self {
        Self {
            width: grid.cols() as u16,
            height: grid.rows() as u16,
        }
    }

    /// Pixels in a row.
    #[must_use]
    pub const fn width(self) -> usize {
        self.width as usize
    }

    /// Rows.
    #[must_use]
    pub const fn height(self) -> usize {
        self.height as usize
    }

    /// Pixels in the frame.
    #[must_use]
    pub const fn pixels(self) -> usize {
        self.width() * self.height()
    }

    /// Whether every cell of `grid` covers at least one pixel.
    #[must_use]
    pub const fn holds(self, grid: Grid) -> bool {
        self.width() >= grid.cols() && self.height() >= grid.rows()
    }
}

impl fmt::Display for FrameSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} x {} pixels", self.width, self.height)
    }
}
