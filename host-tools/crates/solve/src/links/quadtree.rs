//! A quadtree over a grid of cells: blocks of 2 x 2, of 4 x 4 and so on, each a sum of the four
//! below it. Blocks at the right and lower border may have fewer.

use iltm_runtime::Grid;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Blocks along the shorter side of the coarsest level that links are of, at least, unless it would
/// have more than [`MOST_COARSEST`].
const LEAST_SIDE: usize = 2;
/// See [`LEAST_SIDE`]: a row starts with all blocks of that level, and is to split some.
const MOST_COARSEST: usize = 32;

/// The blocks of all levels, numbered from the cells up, each level by rows.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Quadtree {
    levels: Vec<Level>,
    /// The block above each, of all but the one of all cells.
    parents: Vec<usize>,
    /// Cells of each block.
    sizes: Vec<u32>,
    coarsest: usize,
}

/// Blocks of one size.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Level {
    rows: usize,
    cols: usize,
    first: usize,
}

impl Level {
    fn blocks(self) -> Range<usize> {
        self.first..self.first + self.rows * self.cols
    }
}

impl Quadtree {
    pub(super) fn new(grid: Grid) -> Self {
        let mut level = Level {
            rows: grid.rows(),
            cols: grid.cols(),
            first: 0,
        };
        let mut tree = Self {
            levels: vec![level],
            parents: Vec::new(),
            sizes: vec![1; level.blocks().end],
            coarsest: 0,
        };
        while level.rows * level.cols > 1 {
            let above = Level {
                rows: level.rows.div_ceil(2),
                cols: level.cols.div_ceil(2),
                first: tree.blocks(),
            };
            tree.sizes.resize(above.blocks().end, 0);
            for (at, block) in level.blocks().enumerate() {
                let (row, col) = (at / level.cols, at % level.cols);
                let parent = above.first + row / 2 * above.cols + col / 2;
                tree.parents.push(parent);
                tree.sizes[parent] += tree.sizes[block];
            }
            let too_many = level.rows * level.cols > MOST_COARSEST;
            if too_many || above.rows.min(above.cols) >= LEAST_SIDE {
                tree.coarsest += 1;
            }
            tree.levels.push(above);
            level = above;
        }
        tree
    }

    /// Number of blocks, cells among them.
    pub(super) const fn blocks(&self) -> usize {
        self.sizes.len()
    }

    /// Number of cells.
    pub(super) fn cells(&self) -> usize {
        self.level(0).len()
    }

    /// Number of levels: the first has the cells, the last one block of all of them.
    pub(super) const fn levels(&self) -> usize {
        self.levels.len()
    }

    /// The coarsest level that links are of.
    pub(super) const fn coarsest(&self) -> usize {
        self.coarsest
    }

    /// Number of cells of a block.
    pub(super) fn size(&self, block: usize) -> usize {
        self.sizes[block] as usize
    }

    /// The blocks of a level.
    pub(super) fn level(&self, level: usize) -> Range<usize> {
        self.levels[level].blocks()
    }

    fn level_of(&self, block: usize) -> usize {
        let finer = |level: &&Level| level.first <= block;
        self.levels.iter().take_while(finer).count() - 1
    }

    /// The block above; `None` for that of all cells.
    pub(super) fn parent(&self, block: usize) -> Option<usize> {
        self.parents.get(block).copied()
    }

    /// The block that a cell or block belongs to, so many levels above.
    pub(super) fn ancestor(&self, block: usize, levels: usize) -> usize {
        (0..levels).fold(block, |block, _| self.parents[block])
    }

    /// Whether a block has this cell.
    pub(super) fn holds(&self, block: usize, cell: usize) -> bool {
        self.ancestor(cell, self.level_of(block)) == block
    }

    /// The four blocks below, fewer at the border; none below a cell.
    pub(super) fn children(&self, block: usize) -> impl Iterator<Item = usize> {
        self.square(block).into_iter().flatten()
    }

    /// The blocks below: left above, right above, left below, right below.
    pub(super) fn square(&self, block: usize) -> [Option<usize>; 4] {
        let level = self.level_of(block);
        let own = self.levels[level];
        let below = level.checked_sub(1).map(|below| self.levels[below]);
        let (row, col) = (
            (block - own.first) / own.cols,
            (block - own.first) % own.cols,
        );
        [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(down, right)| {
            let below = below?;
            let (row, col) = (2 * row + down, 2 * col + right);
            let there = row < below.rows && col < below.cols;
            there.then(|| below.first + row * below.cols + col)
        })
    }

    /// The cells of a block.
    pub(super) fn cells_of(&self, block: usize) -> Vec<usize> {
        let mut blocks = vec![block];
        for _ in 0..self.level_of(block) {
            blocks = (blocks.iter())
                .flat_map(|block| self.children(*block))
                .collect();
        }
        blocks
    }

    /// Gives each block the sum of its cells: one value a block, those of cells given, all others
    /// zero. `add` adds its second argument to the first.
    pub(super) fn sum_cells<T>(&self, values: &mut [T], add: impl Fn(&mut T, &T)) {
        for (block, parent) in self.parents.iter().enumerate() {
            let (below, above) = values.split_at_mut(*parent);
            add(&mut above[0], &below[block]);
        }
    }

    /// Gives each cell the sum of all blocks that it is part of, itself among them.
    pub(super) fn spread_to_cells<T>(&self, values: &mut [T], add: impl Fn(&mut T, &T)) {
        for (block, parent) in self.parents.iter().enumerate().rev() {
            let (below, above) = values.split_at_mut(*parent);
            add(&mut below[block], &above[0]);
        }
    }

    /// Whether the rows of some cells need that of each block: the cells themselves, and what
    /// [surrounds](Self::around) them on every level.
    pub(super) fn needed_for(&self, cells: &[usize]) -> Vec<bool> {
        let mut needed = vec![false; self.blocks()];
        for cell in cells {
            needed[*cell] = true;
        }
        for block in 0..self.blocks() {
            if needed[block] {
                for (above, _) in self.around(block) {
                    needed[above] = true;
                }
            }
        }
        needed
    }

    /// The blocks whose centres surround that of `block`, one level above it, with their shares:
    /// its parent (9), the two beside that which are nearer (3 each) and the one between (1). None
    /// surround one of the coarsest level that links are of.
    pub(super) fn around(&self, block: usize) -> Vec<(usize, f32)> {
        let level = self.level_of(block);
        if level >= self.coarsest {
            return Vec::new();
        }
        let above = self.levels[level + 1];
        let own = self.levels[level];
        let (row, col) = (
            (block - own.first) / own.cols,
            (block - own.first) % own.cols,
        );
        let beside = |at: usize, count: usize| {
            let (parent, upper) = (at / 2, at % 2 == 1);
            let next = if upper {
                parent + 1
            } else {
                parent.wrapping_sub(1)
            };
            [(parent, 3.0), (next, 1.0)]
                .into_iter()
                .filter(move |(at, _)| *at < count)
        };
        let mut found = Vec::new();
        for (row, share) in beside(row, above.rows) {
            for (col, other) in beside(col, above.cols) {
                found.push((above.first + row * above.cols + col, share * other));
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_is_in_one_block_of_each_level() {
        for (rows, cols) in [(1, 1), (1, 9), (2, 2), (3, 5), (13, 21), (24, 32)] {
            let tree = Quadtree::new(Grid::new(rows, cols).unwrap());
            for level in 0..tree.levels() {
                let mut cells: Vec<usize> =
                    tree.level(level).flat_map(|b| tree.cells_of(b)).collect();
                cells.sort_unstable();
                assert!(
                    cells.into_iter().eq(0..tree.cells()),
                    "{rows} x {cols}, {level}"
                );
            }
        }
    }

    #[test]
    fn children_and_parents_are_each_others() {
        let tree = Quadtree::new(Grid::new(5, 7).unwrap());
        for block in 0..tree.blocks() {
            for child in tree.children(block) {
                assert_eq!(tree.parent(child), Some(block));
            }
        }
        let tops = (0..tree.blocks()).filter(|b| tree.parent(*b).is_none());
        assert!(tops.eq(tree.level(tree.levels() - 1)));
        assert_eq!(tree.size(tree.blocks() - 1), 35);
        // 5 x 7, 3 x 4, 2 x 2.
        assert_eq!(tree.coarsest(), 2);
        // 257 x 3, 129 x 2, 65 x 1, 33 x 1, 17 x 1.
        assert_eq!(Quadtree::new(Grid::new(257, 3).unwrap()).coarsest(), 4);
    }

    #[test]
    fn blocks_around_a_cell_have_its_parent_first_and_end_at_the_border() {
        // 4 x 4 cells, 2 x 2 blocks above them: 16 to 19.
        let tree = Quadtree::new(Grid::new(4, 4).unwrap());
        assert_eq!(tree.around(0), [(16, 9.0)]);
        assert_eq!(tree.around(5), [(16, 9.0), (17, 3.0), (18, 3.0), (19, 1.0)]);
        assert_eq!(tree.around(7), [(17, 9.0), (19, 3.0)]);
        assert!(tree.around(16).is_empty());
        let needed = |cells: &[usize]| {
            let needed = tree.needed_for(cells).into_iter().enumerate();
            let needed = needed.filter_map(|(block, needed)| needed.then_some(block));
            needed.collect::<Vec<_>>()
        };
        assert_eq!(needed(&[0, 7]), [0, 7, 16, 17, 19]);
        assert!(needed(&[]).is_empty());
    }
}
