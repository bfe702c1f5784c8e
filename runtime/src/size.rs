//! Sizes: the [`Grid`] of cells that a table is made for, and the [`FrameSize`] of a frame.
//!
//! A cell is one projector light and, after registration, one camera
//! observation. Cells are numbered row by row: `row * cols + col`.

use core::fmt;

/// `rows x cols` cells, at least 1 x 1 and at most [`Grid::MAX_CELLS`].
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub struct Grid {
    rows: u16,
    cols: u16,
}

impl Grid {
    /// Most cells a grid may have.
    ///
    /// The sum of all cells of a white frame (`cells * 2^15`) has to stay an
    /// `i32`, and a cell index has to fit the 16 bits it has in a table.
    pub const MAX_CELLS: usize = 32_768;

    /// Makes a grid.
    ///
    /// # Errors
    /// [`GridError`] if a side is zero or there are more than
    /// [`Grid::MAX_CELLS`] cells.
    pub const fn new(rows: u16, cols: u16) -> Result<Self, GridError> {
        let cells = rows as usize * cols as usize;
        if cells == 0 || cells > Self::MAX_CELLS {
            return Err(GridError { rows, cols });
        }
        Ok(Self { rows, cols })
    }

    /// Number of rows.
    #[must_use]
    pub const fn rows(self) -> usize {
        self.rows as usize
    }

    /// Number of columns.
    #[must_use]
    pub const fn cols(self) -> usize {
        self.cols as usize
    }

    /// Number of cells, `rows * cols`: the `N` of every matrix.
    #[must_use]
    pub const fn cells(self) -> usize {
        self.rows() * self.cols()
    }
}

impl fmt::Display for Grid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} x {}", self.rows, self.cols)
    }
}

/// A grid with no cells, or with more than a table can index.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct GridError {
    /// Rows asked for.
    pub rows: u16,
    /// Columns asked for.
    pub cols: u16,
}

impl fmt::Display for GridError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "a grid of {} x {} cells; it must have 1 to {} cells",
            self.rows,
            self.cols,
            Grid::MAX_CELLS
        )
    }
}

impl core::error::Error for GridError {}

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
