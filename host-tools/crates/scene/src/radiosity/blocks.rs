//! Hierarchical blocks of the form factor matrix: which pairs of clusters exchange light, and how
//! each block of them is stored.

use super::cluster::{Cluster, Clusters};
use super::entries::{Entries, KnownVisibility};
use super::low_rank::cross_approximation;
use super::{FormFactorOptions, Occlusion};
use crate::form_factor::shaft::{blocks_all, may_block};
use crate::geometry::{Plane, Polygon};
use iltm_picture::progress::Progress;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// How a block is stored. Single precision: its rounding (6e-8) is far below what
/// form factors and compression are asked for, at half the memory and twice the
/// speed.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum BlockStorage {
    /// rows x columns.
    Dense(DMatrix<f32>),
    /// `left right^T`: rows x rank, columns x rank.
    LowRank {
        left: DMatrix<f32>,
        right: DMatrix<f32>,
    },
}

/// A block of the upper triangle, in the order of the clusters; its transpose stands for the
/// lower one, so both ways exchange the same to the last bit. Blocks on the diagonal
/// are dense and hold both.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct MatrixBlock {
    pub(super) rows: Range<usize>,
    pub(super) columns: Range<usize>,
    pub(super) content: BlockStorage,
}

impl MatrixBlock {
    pub(super) fn on_diagonal(&self) -> bool {
        self.rows == self.columns
    }

    /// Numbers stored.
    pub(super) fn numbers(&self) -> usize {
        match &self.content {
            BlockStorage::Dense(matrix) => matrix.len(),
            BlockStorage::LowRank { left, right } => left.len() + right.len(),
        }
    }

    /// One entry, by the block's own row and column.
    pub(super) fn entry(&self, row: usize, column: usize) -> f64 {
        match &self.content {
            BlockStorage::Dense(matrix) => f64::from(matrix[(row, column)]),
            BlockStorage::LowRank { left, right } => {
                let term = |k| f64::from(left[(row, k)]) * f64::from(right[(column, k)]);
                (0..left.ncols()).map(term).sum()
            }
        }
    }
}

/// A block that is to be evaluated.
pub(super) struct BlockTask {
    rows: usize,
    columns: usize,
    smooth: bool,
    known: KnownVisibility,
}

/// Finds the blocks between which light passes.
pub(super) struct Planner<'a> {
    pub(super) clusters: &'a Clusters,
    pub(super) entries: &'a Entries<'a>,
    pub(super) obstacles: &'a [Polygon],
    pub(super) options: &'a FormFactorOptions,
    /// Whether blocks may be compressed.
    pub(super) compress: bool,
}

impl Planner<'_> {
    /// All blocks, in an order that depends on nothing but the patches.
    pub(super) fn tasks(&self) -> Vec<BlockTask> {
        let mut tasks = Vec::new();
        if !self.clusters.nodes.is_empty() {
            let between = match self.options.occlusion {
                Occlusion::Ignore => Vec::new(),
                _ => (0..self.obstacles.len()).collect(),
            };
            self.visit(0, 0, &between, &mut tasks);
        }
        tasks
    }

    fn visit(&self, rows: usize, columns: usize, between: &[usize], tasks: &mut Vec<BlockTask>) {
        let (a, b) = (&self.clusters.nodes[rows], &self.clusters.nodes[columns]);
        if (a.facet().is_some() && a.facet() == b.facet()) || !self.may_face(a, b) {
            return;
        }
        let between = self.between(a, b, between);
        if self.options.occlusion == Occlusion::Decide
            && between
                .iter()
                .any(|o| blocks_all(&a.hull, &b.hull, &self.obstacles[*o]))
        {
            return;
        }
        let in_front = rows != columns && self.in_front(a, b) && self.in_front(b, a);
        let smooth = self.compress && in_front && between.is_empty() && self.admissible(a, b);
        if smooth || (a.halves.is_none() && b.halves.is_none()) {
            let known = KnownVisibility { in_front, between };
            tasks.push(BlockTask {
                rows,
                columns,
                smooth,
                known,
            });
            return;
        }
        for (rows, columns) in parts((rows, a), (columns, b)) {
            self.visit(rows, columns, &between, tasks);
        }
    }

    /// Whether patches of both may be in front of each other.
    fn may_face(&self, a: &Cluster, b: &Cluster) -> bool {
        let sees = |a: &Cluster, b: &Cluster| {
            a.facets
                .iter()
                .any(|f| b.hull.reaches_front_of(self.obstacles[*f].plane()))
        };
        sees(a, b) && sees(b, a)
    }

    /// Obstacles that may stand between.
    fn between(&self, a: &Cluster, b: &Cluster, obstacles: &[usize]) -> Vec<usize> {
        let own = |o: usize| a.facet() == Some(o) || b.facet() == Some(o);
        let may = |o: &usize| !own(*o) && may_block(&a.hull, &b.hull, &self.obstacles[*o]);
        obstacles.iter().copied().filter(may).collect()
    }

    /// Whether all of `b` is in front of all surfaces of `a`.
    fn in_front(&self, a: &Cluster, b: &Cluster) -> bool {
        a.facets.iter().all(|f| {
            let plane = self.obstacles[*f].plane();
            b.hull.in_front_of(plane) || self.corners_in_front(b, plane)
        })
    }

    fn corners_in_front(&self, cluster: &Cluster, plane: &Plane) -> bool {
        let near = 1e-9 * cluster.radius;
        let members = &self.clusters.order[cluster.range.clone()];
        let mut corners = members
            .iter()
            .flat_map(|p| self.entries.patch(*p).corners());
        corners.all(|c| plane.distance(c) >= -near)
    }

    /// Whether they are far enough apart for few terms to describe the block.
    fn admissible(&self, a: &Cluster, b: &Cluster) -> bool {
        let gap = (b.centre - a.centre).norm() - a.radius - b.radius;
        2.0 * a.radius.min(b.radius) <= self.options.separation * gap
    }
}

/// The pairs of parts that a pair of clusters consists of, each once.
fn parts((i, a): (usize, &Cluster), (j, b): (usize, &Cluster)) -> Vec<(usize, usize)> {
    match (a.halves, b.halves) {
        (Some([first, second]), _) if i == j => {
            vec![(first, first), (first, second), (second, second)]
        }
        (Some(a), None) => a.iter().map(|k| (*k, j)).collect(),
        (None, Some(b)) => b.iter().map(|k| (i, *k)).collect(),
        // A much larger one is halved alone, so that blocks stay near square.
        (Some(halves), Some(_)) if a.radius > 2.0 * b.radius => {
            halves.iter().map(|k| (*k, j)).collect()
        }
        (Some(_), Some(halves)) if b.radius > 2.0 * a.radius => {
            halves.iter().map(|k| (i, *k)).collect()
        }
        (Some(a), Some(b)) => a
            .iter()
            .flat_map(|k| b.iter().map(move |l| (*k, *l)))
            .collect(),
        (None, None) => Vec::new(),
    }
}

/// Evaluates tasks on all cores. `None` if they take more than the allowed bytes.
pub(super) fn evaluate(
    planner: &Planner<'_>,
    tasks: &[BlockTask],
    progress: &dyn Progress,
) -> Option<Vec<MatrixBlock>> {
    let bytes = AtomicUsize::new(0);
    let most = planner.options.most_bytes;
    let blocks: Vec<Option<MatrixBlock>> = tasks
        .par_iter()
        .map(|task| {
            if bytes.load(Relaxed) > most {
                return None;
            }
            let block = evaluate_one(planner, task);
            bytes.fetch_add(4 * block.numbers(), Relaxed);
            progress.advance(1);
            Some(block)
        })
        .collect();
    if bytes.into_inner() > most {
        return None;
    }
    let mut blocks: Vec<MatrixBlock> = blocks.into_iter().flatten().collect();
    blocks.retain(|block| match &block.content {
        BlockStorage::Dense(matrix) => matrix.iter().any(|x| *x != 0.0),
        BlockStorage::LowRank { left, .. } => left.ncols() > 0,
    });
    Some(blocks)
}

fn evaluate_one(planner: &Planner<'_>, task: &BlockTask) -> MatrixBlock {
    let (rows, columns) = ranges(planner, task);
    let order = &planner.clusters.order;
    let entry = |i: usize, j: usize| {
        planner
            .entries
            .entry(order[rows.start + i], order[columns.start + j], &task.known)
    };
    let found = if task.smooth {
        cross_approximation(
            (rows.len(), columns.len()),
            entry,
            planner.options.compression,
        )
    } else {
        None
    };
    let content = match found {
        Some(found) => BlockStorage::LowRank {
            left: found.left.cast(),
            right: found.right.cast(),
        },
        None => BlockStorage::Dense(dense(&rows, &columns, entry).cast()),
    };
    MatrixBlock {
        rows,
        columns,
        content,
    }
}

fn ranges(planner: &Planner<'_>, task: &BlockTask) -> (Range<usize>, Range<usize>) {
    let range = |node: usize| planner.clusters.nodes[node].range.clone();
    (range(task.rows), range(task.columns))
}

/// Evaluates tasks into one matrix in the order of the patches.
pub(super) fn evaluate_whole(
    planner: &Planner<'_>,
    tasks: &[BlockTask],
    progress: &dyn Progress,
) -> DMatrix<f64> {
    let order = &planner.clusters.order;
    let parts: Vec<DMatrix<f64>> = tasks
        .par_iter()
        .map(|task| {
            let (rows, columns) = ranges(planner, task);
            let part = dense(&rows, &columns, |i, j| {
                let (p, q) = (order[rows.start + i], order[columns.start + j]);
                planner.entries.entry(p, q, &task.known)
            });
            progress.advance(1);
            part
        })
        .collect();
    let mut whole = DMatrix::zeros(order.len(), order.len());
    for (task, part) in tasks.iter().zip(parts) {
        let (rows, columns) = ranges(planner, task);
        for (j, q) in order[columns].iter().enumerate() {
            for (i, p) in order[rows.clone()].iter().enumerate() {
                whole[(*p, *q)] = part[(i, j)];
                whole[(*q, *p)] = part[(i, j)];
            }
        }
    }
    whole
}

fn dense(
    rows: &Range<usize>,
    columns: &Range<usize>,
    entry: impl Fn(usize, usize) -> f64,
) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(rows.len(), columns.len());
    let symmetric = rows == columns;
    for j in 0..columns.len() {
        let last = if symmetric { j } else { rows.len() };
        for i in 0..last {
            matrix[(i, j)] = entry(i, j);
            if symmetric {
                matrix[(j, i)] = matrix[(i, j)];
            }
        }
    }
    matrix
}
