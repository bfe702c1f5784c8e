//! Haar basis of a grid: its levels and its functions.

use super::level::{Level, LevelAxis, NodePair};
use crate::Grid;
use crate::units::INPUT_COEFFICIENT_MAX;
use heapless::Vec;

/// A 1 x 32,768 grid has fifteen levels, and none has more.
const MAX_LEVELS: usize = 16;

/// The Haar basis of one grid, sized once and used for every frame.
#[derive(Clone, Debug)]
pub struct Basis {
    grid: Grid,
    levels: Vec<Level, MAX_LEVELS>,
}

/// Which halves of a node a function sets against each other.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Split {
    /// Left against right.
    Columns,
    /// Top against bottom.
    Rows,
    /// Both: the two diagonals of the node.
    Both,
    /// Nothing: the constant function over the whole grid.
    None,
}

/// One basis function: a column of `S`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Function {
    /// Level, 0 the finest. The constant counts as one level above the coarsest.
    pub level: u8,
    /// What is set against what.
    pub split: Split,
    /// First row it covers.
    pub row: u16,
    /// First column it covers.
    pub col: u16,
    rows: NodePair,
    cols: NodePair,
}

impl Function {
    /// Rows and columns that the function covers.
    #[must_use]
    pub const fn extent(&self) -> (usize, usize) {
        (self.rows.cells() as usize, self.cols.cells() as usize)
    }

    /// Value at a cell.
    #[must_use]
    pub fn at(&self, row: usize, col: usize) -> i64 {
        let along = |pair: NodePair, start: u16, at: usize, splits: bool| -> i64 {
            match at.checked_sub(usize::from(start)) {
                Some(offset) if offset < pair.first as usize => {
                    if splits {
                        i64::from(pair.first_weight)
                    } else {
                        1
                    }
                }
                Some(offset) if offset < pair.cells() as usize => {
                    if splits {
                        -i64::from(pair.second_weight)
                    } else {
                        1
                    }
                }
                _ => 0,
            }
        };
        let (by_rows, by_cols) = match self.split {
            Split::Columns => (false, true),
            Split::Rows => (true, false),
            Split::Both => (true, true),
            Split::None => (false, false),
        };
        along(self.rows, self.row, row, by_rows) * along(self.cols, self.col, col, by_cols)
    }

    /// Largest coefficient that cells between 0 and 1 can give: the sum of the
    /// function's positive values.
    #[must_use]
    pub const fn positive_mass(&self) -> u64 {
        match self.split {
            Split::Columns => columns_mass(self.rows, self.cols),
            Split::Rows => columns_mass(self.cols, self.rows),
            Split::Both => both_mass(self.rows, self.cols),
            Split::None => self.rows.cells() as u64 * self.cols.cells() as u64,
        }
    }

    /// Largest magnitude of the function at any cell.
    #[must_use]
    pub fn peak(&self) -> u64 {
        let along = |pair: NodePair| u64::from(pair.first_weight.max(pair.second_weight));
        match self.split {
            Split::Columns => along(self.cols),
            Split::Rows => along(self.rows),
            Split::Both => along(self.rows) * along(self.cols),
            Split::None => 1,
        }
    }

    /// Sum of the squares of the function's values.
    #[must_use]
    pub fn squared_norm(&self) -> u64 {
        let along = |pair: NodePair, splits: bool| {
            if splits {
                u64::from(pair.first) * u64::from(pair.first_weight).pow(2)
                    + u64::from(pair.second) * u64::from(pair.second_weight).pow(2)
            } else {
                u64::from(pair.cells())
            }
        };
        match self.split {
            Split::Columns => along(self.rows, false) * along(self.cols, true),
            Split::Rows => along(self.rows, true) * along(self.cols, false),
            Split::Both => along(self.rows, true) * along(self.cols, true),
            Split::None => along(self.rows, false) * along(self.cols, false),
        }
    }

    /// Bits by which this coefficient of a frame is shifted right to become an
    /// [`InputCoefficient`](crate::units::InputCoefficient).
    #[must_use]
    pub fn input_shift(&self) -> u32 {
        input_shift(self.positive_mass())
    }
}

const fn columns_mass(rows: NodePair, cols: NodePair) -> u64 {
    rows.cells() as u64 * cols.positive_mass()
}

const fn both_mass(rows: NodePair, cols: NodePair) -> u64 {
    2 * rows.positive_mass() * cols.positive_mass()
}

/// Input shifts of the details of one node: columns, rows, both.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct NodeShifts {
    pub(crate) columns: u8,
    pub(crate) rows: u8,
    pub(crate) both: u8,
}

impl NodeShifts {
    pub(crate) const fn new(rows: NodePair, cols: NodePair) -> Self {
        Self {
            columns: input_shift(columns_mass(rows, cols)) as u8,
            rows: input_shift(columns_mass(cols, rows)) as u8,
            both: input_shift(both_mass(rows, cols)) as u8,
        }
    }
}

/// Bits to shift away so that `positive_mass * 2^15` becomes at most
/// [`INPUT_COEFFICIENT_MAX`].
pub(crate) const fn input_shift(positive_mass: u64) -> u32 {
    let whole_bits = crate::units::Light::FRAC_NBITS - INPUT_COEFFICIENT_MAX.ilog2();
    // `next_power_of_two` of a mass: at most 2^46, see `Grid::MAX_CELLS`.
    match positive_mass.checked_next_power_of_two() {
        Some(power) => power.trailing_zeros() + whole_bits,
        None => u64::BITS - 1,
    }
}

impl Basis {
    /// The basis of `grid`.
    #[inline]
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        let mut basis = Self {
            grid,
            levels: Vec::new(),
        };
        basis.fill();
        basis
    }

    /// Adds the levels in place: they are too large to have twice on a small stack.
    #[inline(never)]
    fn fill(&mut self) {
        let (mut rows, mut cols) = (
            LevelAxis::cells(self.grid.rows()),
            LevelAxis::cells(self.grid.cols()),
        );
        let mut first = 0;
        while rows.nodes > 1 || cols.nodes > 1 {
            let level = Level::new(rows, cols, first);
            first += level.details();
            (rows, cols) = (rows.merged(), cols.merged());
            if self.levels.push(level).is_err() {
                // Not reachable: a grid has at most 2^15 cells, hence 15 levels.
                break;
            }
        }
    }

    /// The grid it is the basis of.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// Number of levels; 0 for a single cell.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.levels.len()
    }

    /// Elements that each of the two buffers of a transform needs: the values that
    /// are left after the first merge.
    #[must_use]
    pub fn scratch_len(&self) -> usize {
        self.levels.first().map_or(0, Level::merged_nodes)
    }

    pub(crate) fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Sum of squares of function `index`, `None` past the last one.
    #[must_use]
    pub fn squared_norm(&self, index: usize) -> Option<u64> {
        self.functions().nth(index).map(|f| f.squared_norm())
    }

    /// All functions in the order of their coefficients.
    #[must_use]
    pub fn functions(&self) -> Functions<'_> {
        Functions {
            basis: self,
            level: 0,
            row: 0,
            col: 0,
            split: 0,
            ended: false,
        }
    }
}

/// Iterator over the functions of a [`Basis`], made by [`Basis::functions`].
#[derive(Clone, Debug)]
pub struct Functions<'b> {
    basis: &'b Basis,
    level: usize,
    row: usize,
    col: usize,
    split: u8,
    ended: bool,
}

impl Functions<'_> {
    fn constant(&mut self) -> Option<Function> {
        if self.ended {
            return None;
        }
        self.ended = true;
        let whole = |cells: usize| NodePair {
            first: cells as u16,
            second: 0,
            first_weight: 0,
            second_weight: 0,
        };
        Some(Function {
            level: self.basis.depth() as u8,
            split: Split::None,
            row: 0,
            col: 0,
            rows: whole(self.basis.grid.rows()),
            cols: whole(self.basis.grid.cols()),
        })
    }

    fn advance(&mut self, level: &Level) {
        self.split += 1;
        if self.split < 3 {
            return;
        }
        self.split = 0;
        self.col += 1;
        if self.col < level.merged_cols() {
            return;
        }
        self.col = 0;
        self.row += 1;
        if self.row < level.merged_rows() {
            return;
        }
        self.row = 0;
        self.level += 1;
    }
}

impl Iterator for Functions<'_> {
    type Item = Function;

    fn next(&mut self) -> Option<Function> {
        loop {
            let Some(level) = self.basis.levels.get(self.level) else {
                return self.constant();
            };
            let (rows, cols) = (*level.row_pair(self.row), *level.col_pair(self.col));
            let (exists, split) = match self.split {
                0 => (cols.splits(), Split::Columns),
                1 => (rows.splits(), Split::Rows),
                _ => (rows.splits() && cols.splits(), Split::Both),
            };
            let function = Function {
                level: self.level as u8,
                split,
                row: (self.row << (self.level + 1)) as u16,
                col: (self.col << (self.level + 1)) as u16,
                rows,
                cols,
            };
            self.advance(level);
            if exists {
                return Some(function);
            }
        }
    }
}
