//! Level of the Haar pyramid: which nodes merge, and with what weights.

use super::basis::NodeShifts;

/// How two adjacent nodes of one axis merge, or that a last one stays alone.
///
/// `u16`, because every table keeps four of them a level, and a side has at most
/// [`Grid::MAX_CELLS`](crate::Grid::MAX_CELLS).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct NodePair {
    /// Cells in the first node.
    pub(crate) first: u16,
    /// Cells in the second node, 0 if the first stays alone.
    pub(crate) second: u16,
    /// Weight of the first node in the detail: `second / gcd`, 0 if alone.
    pub(crate) first_weight: u16,
    /// Weight of the second node, subtracted: `first / gcd`, 0 if alone.
    pub(crate) second_weight: u16,
}

impl NodePair {
    fn new(first: u16, second: u16) -> Self {
        if second == 0 {
            return Self {
                first,
                second,
                first_weight: 0,
                second_weight: 0,
            };
        }
        let gcd = greatest_common_divisor(first, second).max(1);
        Self {
            first,
            second,
            first_weight: second / gcd,
            second_weight: first / gcd,
        }
    }

    /// Whether there is a second node.
    pub(crate) const fn splits(self) -> bool {
        self.second != 0
    }

    /// Whether the detail is a plain difference.
    pub(crate) const fn is_plain(self) -> bool {
        self.first_weight == 1 && self.second_weight == 1
    }

    /// Cells in both nodes.
    pub(crate) const fn cells(self) -> u32 {
        self.first as u32 + self.second as u32
    }

    /// Sum of the positive values of the detail function along this axis, which
    /// equals the sum of its negative ones: the least common multiple of the two
    /// counts.
    pub(crate) const fn positive_mass(self) -> u64 {
        self.first_weight as u64 * self.first as u64
    }
}

const fn greatest_common_divisor(mut a: u16, mut b: u16) -> u16 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// One axis before a merge: every node has `full` cells but the last.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct LevelAxis {
    pub(crate) nodes: usize,
    full: u16,
    last: u16,
}

impl LevelAxis {
    pub(crate) const fn cells(cells: usize) -> Self {
        Self {
            nodes: cells,
            full: 1,
            last: 1,
        }
    }

    pub(crate) const fn merged(self) -> Self {
        let last = if self.nodes.is_multiple_of(2) {
            self.full.saturating_add(self.last)
        } else {
            self.last
        };
        Self {
            nodes: self.nodes.div_ceil(2),
            // A lone node keeps `last`; `full` is then never used again, and
            // saturating keeps it from wrapping on very long other axes.
            full: self.full.saturating_mul(2),
            last,
        }
    }

    fn pair(self, index: usize) -> NodePair {
        let last = self.nodes.saturating_sub(1);
        let first = 2 * index;
        let cells = |node: usize| if node == last { self.last } else { self.full };
        match first.cmp(&last) {
            core::cmp::Ordering::Less => NodePair::new(cells(first), cells(first + 1)),
            _ => NodePair::new(self.last, 0),
        }
    }
}

/// One level: the axes before and after the merge and the four kinds of pairs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Level {
    pub(crate) rows: LevelAxis,
    pub(crate) cols: LevelAxis,
    /// Pair of rows anywhere but at the end, and the last one.
    row_pairs: [NodePair; 2],
    /// Pair of columns anywhere but at the end, and the last one.
    col_pairs: [NodePair; 2],
    /// Input shifts of the nodes, by kind of row pair and of column pair.
    shifts: [[NodeShifts; 2]; 2],
    /// Index of the level's first detail coefficient.
    pub(crate) first: usize,
}

impl Level {
    pub(crate) fn new(rows: LevelAxis, cols: LevelAxis, first: usize) -> Self {
        let pairs = |axis: LevelAxis| [axis.pair(0), axis.pair(axis.nodes.div_ceil(2) - 1)];
        let (row_pairs, col_pairs) = (pairs(rows), pairs(cols));
        Self {
            rows,
            cols,
            row_pairs,
            col_pairs,
            shifts: row_pairs.map(|row| col_pairs.map(|col| NodeShifts::new(row, col))),
            first,
        }
    }

    pub(crate) fn merged_rows(&self) -> usize {
        self.rows.nodes.div_ceil(2)
    }

    pub(crate) fn merged_cols(&self) -> usize {
        self.cols.nodes.div_ceil(2)
    }

    /// Values before the merge.
    pub(crate) fn nodes(&self) -> usize {
        self.rows.nodes * self.cols.nodes
    }

    /// Values after the merge.
    pub(crate) fn merged_nodes(&self) -> usize {
        self.merged_rows() * self.merged_cols()
    }

    /// Detail coefficients of the level.
    pub(crate) fn details(&self) -> usize {
        self.nodes() - self.merged_nodes()
    }

    #[inline]
    pub(crate) fn row_pair(&self, merged_row: usize) -> &NodePair {
        let [inner, last] = &self.row_pairs;
        if merged_row + 1 == self.merged_rows() {
            last
        } else {
            inner
        }
    }

    #[inline]
    pub(crate) fn col_pair(&self, merged_col: usize) -> &NodePair {
        let [inner, last] = &self.col_pairs;
        if merged_col + 1 == self.merged_cols() {
            last
        } else {
            inner
        }
    }

    #[inline]
    pub(crate) fn shifts(&self, merged_row: usize, merged_col: usize) -> &NodeShifts {
        let [inner, last] = &self.shifts;
        let [inner, last] = if merged_row + 1 == self.merged_rows() {
            last
        } else {
            inner
        };
        if merged_col + 1 == self.merged_cols() {
            last
        } else {
            inner
        }
    }

    /// Whether all nodes have four equal quarters.
    #[inline]
    pub(crate) fn is_plain(&self) -> bool {
        let plain = |pairs: [NodePair; 2]| pairs.iter().all(|pair| pair.is_plain());
        plain(self.row_pairs) && plain(self.col_pairs)
    }

    /// How many merged columns, from the left, have a plain difference.
    pub(crate) fn plain_cols(&self) -> usize {
        let [inner, last] = self.col_pairs;
        let merged = self.merged_cols();
        match (inner.is_plain(), last.is_plain()) {
            (_, true) => merged,
            (true, false) => merged - 1,
            (false, false) => 0,
        }
    }
}
