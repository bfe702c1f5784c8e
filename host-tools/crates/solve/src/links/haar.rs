//! Haar coefficients of links, without the `N x N` elements between: the light of a block is a
//! scaling function of the quadtree, so a row of links has as few coefficients as links.
//!
//! [`Haar`](crate::Haar) splits the same blocks in two along each side. So `W^T K W` comes from
//! the links by the same steps, once along the rows and once along the columns: four blocks'
//! normalised sums become that of the block above and three details.

use super::operator::Link;
use super::quadtree::Quadtree;
use crate::interreflection::Coefficient;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Coefficients of one image or row that are not zero, by number.
type Sparse = Vec<(u32, f64)>;

/// The elements of `W^T K W` that are not zero, of an operator with these rows.
pub(super) fn coefficients(tree: &Quadtree, rows: &[Vec<Link>]) -> Vec<Coefficient> {
    let splits = Splits::new(tree);
    let mut sums: Vec<Sparse> = rows.par_iter().map(|row| splits.of_row(row)).collect();
    let mut found = Vec::new();
    for level in 1..tree.levels() {
        let below = tree.level(level - 1).start;
        let merged: Vec<(Sparse, Vec<Coefficient>)> = (tree.level(level))
            .into_par_iter()
            .map(|block| splits.merge_rows(block, below, &sums))
            .collect();
        sums.clear();
        for (sum, details) in merged {
            sums.push(sum);
            found.extend(details);
        }
    }
    let constant = (tree.cells() - 1) as u32;
    let last = sums.iter().flatten();
    found.extend(last.map(|(col, value)| Coefficient {
        row: constant,
        col: *col,
        value: *value,
    }));
    found
}

/// How the blocks of a quadtree become those above them.
struct Splits<'t> {
    tree: &'t Quadtree,
    /// Number of the first detail of each block.
    first: Vec<u32>,
}

impl<'t> Splits<'t> {
    fn new(tree: &'t Quadtree) -> Self {
        let mut next = 0;
        let first = (0..tree.blocks()).map(|block| {
            let own = next;
            // A cell has none.
            next += (tree.children(block).count() as u32).saturating_sub(1);
            own
        });
        Self {
            first: first.collect(),
            tree,
        }
    }

    /// Coefficients of one row.
    fn of_row(&self, row: &[Link]) -> Sparse {
        // Normalised sums of blocks that are not part of one above yet. The first is always of
        // the finest level that there is.
        let mut sums: BTreeMap<usize, f64> = BTreeMap::new();
        for link in row.iter().filter(|link| link.value != 0.0) {
            let block = link.block as usize;
            let norm = (self.tree.size(block) as f64).sqrt();
            *sums.entry(block).or_default() += f64::from(link.value) * norm;
        }
        let mut found = Sparse::new();
        while let Some((block, sum)) = sums.first_key_value() {
            let Some(parent) = self.tree.parent(*block) else {
                found.push(((self.tree.cells() - 1) as u32, *sum));
                break;
            };
            let merge = self.merge(parent);
            let below = merge.children.map(|child| {
                let sum = child.and_then(|child| sums.remove(&child));
                sum.unwrap_or(0.0)
            });
            let (sum, details) = merge.apply(below);
            found.extend(merge.numbered(details));
            *sums.entry(parent).or_default() += sum;
        }
        found.sort_unstable_by_key(|(number, _)| *number);
        found
    }

    /// The rows of a block's cells together, and what tells them apart: `sums` has the rows of
    /// the blocks one level below, from block `below` on.
    fn merge_rows(
        &self,
        block: usize,
        below: usize,
        sums: &[Sparse],
    ) -> (Sparse, Vec<Coefficient>) {
        let merge = self.merge(block);
        let mut rows = merge.children.map(|child| {
            let row = child.map_or(&[][..], |child| &sums[child - below]);
            row.iter().copied().peekable()
        });
        let (mut sum, mut found) = (Sparse::new(), Vec::new());
        loop {
            let next = rows.iter_mut().filter_map(|row| row.peek());
            let Some(col) = next.map(|(col, _)| *col).min() else {
                return (sum, found);
            };
            let values = rows.each_mut().map(|row| {
                let own = row.next_if(|(own, _)| *own == col);
                own.map_or(0.0, |(_, value)| value)
            });
            let (total, details) = merge.apply(values);
            sum.push((col, total));
            let details = merge.numbered(details).filter(|(_, value)| *value != 0.0);
            found.extend(details.map(|(row, value)| Coefficient { row, col, value }));
        }
    }

    fn merge(&self, block: usize) -> Merge {
        let children = self.tree.square(block);
        let size = |child: Option<usize>| child.map_or(0.0, |child| self.tree.size(child) as f64);
        let [first, right, below, _] = children.map(size);
        Merge {
            children,
            across: Rotation::new(first, right),
            down: Rotation::new(first, below),
            number: self.first[block],
        }
    }
}

/// How up to four blocks become one: left above, right above, left below, right below.
struct Merge {
    children: [Option<usize>; 4],
    across: Rotation,
    down: Rotation,
    /// Of its first detail.
    number: u32,
}

impl Merge {
    /// The sum, and the details along the columns, the rows and both.
    fn apply(&self, [a, b, c, d]: [f64; 4]) -> (f64, [f64; 3]) {
        let (above, right_above) = self.across.of(a, b);
        let (below, right_below) = self.across.of(c, d);
        let (sum, rows) = self.down.of(above, below);
        let (columns, both) = self.down.of(right_above, right_below);
        (sum, [columns, rows, both])
    }

    /// The details that there are, with their numbers.
    fn numbered(&self, details: [f64; 3]) -> impl Iterator<Item = (u32, f64)> {
        let [_, right, below, both] = self.children.map(|child| child.is_some());
        let there = details.into_iter().zip([right, below, both]);
        (self.number..).zip(there.filter(|(_, there)| *there).map(|(value, _)| value))
    }
}

/// Two normalised sums become one and a detail, by how many cells they are of.
struct Rotation {
    cos: f64,
    sin: f64,
}

impl Rotation {
    fn new(first: f64, second: f64) -> Self {
        Self {
            cos: (first / (first + second)).sqrt(),
            sin: (second / (first + second)).sqrt(),
        }
    }

    fn of(&self, a: f64, b: f64) -> (f64, f64) {
        (self.cos * a + self.sin * b, self.sin * a - self.cos * b)
    }
}
