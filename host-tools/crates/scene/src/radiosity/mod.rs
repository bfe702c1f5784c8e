//! Radiosity: light exchange between all patches of a scene, and the light after all bounces.
//!
//! [`FormFactorMatrix`] holds the form factors `F` of N patches as the symmetric
//! `S_pq = A_p F_pq / sqrt(A_p A_q)`, so that reciprocity holds to the last bit. Up to
//! [`FormFactorOptions::dense_limit`] patches that is one matrix of doubles. Beyond, patches are
//! grouped into a tree of clusters (`cluster.rs`); pairs of clusters that do not face each
//! other or are hidden from each other are dropped, those far apart are stored with low rank
//! (`low_rank.rs`), and only neighbours are stored whole (`blocks.rs`).
//!
//! [`radiosity`] sums the bounces, or solves for all of them at once.
//!
//! What it takes on M-shaped panels whose cells are no rectangles (2 shared cores of a
//! virtual machine; all in blocks; light is 230 columns at albedo 0.7 to 1e-4, 6 bounces; the
//! error is of the irradiance, beside form factors asked to 1e-9 one by one):
//!
//! | patches | build | stored | at most while building | one product | light | error |
//! |---|---|---|---|---|---|---|
//! | 1,024 | 0.13 s | 0.5 MB | 2 MB | 0.02 s | 0.1 s | 1.4e-7 |
//! | 4,096 | 0.5 s | 3.5 MB | 11 MB | 0.1 s | 0.6 s | 1.5e-7 |
//! | 12,288 | 1.3 s | 10 MB | 32 MB | 0.3 s | 1.6 s | 1.7e-7 |
//! | 24,576 | 2.5 s | 20 MB | 64 MB | 0.6 s | 4 s | 2.7e-7 |
//!
//! `cargo bench -p iltm --bench radiosity` repeats it. Pairs of patches that something may stand
//! between take 15 to 25 us of a core each: with a vane in a valley (`-- 12288 vane`), 4.1
//! million of them, 24 MB and 75 s of one core in all, error 2.2e-6 (`-- 1024 vane`, where a
//! patch that the vane stands on is larger: 7e-4). Their error is set by
//! [`FormFactorOptions::visibility`].
//!
//! Hackbusch, *A Sparse Matrix Arithmetic Based on H-Matrices* (1999).

mod blocks;
mod cluster;
mod entries;
mod krylov;
mod low_rank;
mod options;
mod product;
mod solve;
mod survey;
#[cfg(test)]
mod tests;

pub use options::{FormFactorError, FormFactorOptions, Occlusion};
pub use solve::{CostEstimate, Radiosity, RadiosityError, RadiosityMethod, StopRule, radiosity};
pub use survey::{FacetPair, FormFactorReport};

use super::geometry::{Obstacles, Polygon};
use blocks::{BlockStorage, MatrixBlock, Planner};
use cluster::Clusters;
use entries::Entries;
use iltm_picture::progress::Progress;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use std::time::Instant;

/// A part of a surface with one radiosity.
#[derive(Clone, PartialEq, Debug)]
pub struct Element {
    /// Where it is.
    pub polygon: Polygon,
    /// Index of its surface in [`Obstacles::facets`]; patches of one surface never see each
    /// other.
    pub facet: usize,
}

/// Form factors between all patches.
#[derive(Clone, Debug)]
pub struct FormFactorMatrix {
    areas: Vec<f64>,
    store: MatrixStorage,
    row_sums: DVector<f64>,
    report: FormFactorReport,
}

#[derive(Clone, Debug)]
enum MatrixStorage {
    Whole(DMatrix<f64>),
    Blocks {
        order: Vec<usize>,
        blocks: Vec<MatrixBlock>,
        parts: Vec<Range<usize>>,
    },
}

impl FormFactorMatrix {
    /// Evaluates the form factors between `patches`; on all cores, with the same bits on any
    /// number of them.
    ///
    /// # Errors
    /// [`FormFactorError`] if a patch names a surface that is not there, or if the result takes
    /// more memory than allowed.
    pub fn new(
        patches: &[Element],
        obstacles: &Obstacles,
        options: &FormFactorOptions,
        progress: &dyn Progress,
    ) -> Result<Self, FormFactorError> {
        let start = Instant::now();
        let facets = obstacles.facets().len();
        if let Some(patch) = patches.iter().position(|p| p.facet >= facets) {
            let facet = patches[patch].facet;
            return Err(FormFactorError::NoSuchFacet {
                patch,
                facet,
                facets,
            });
        }
        let mut report = FormFactorReport {
            patches: patches.len(),
            ..FormFactorReport::default()
        };
        survey::survey(patches, obstacles, options.occlusion, &mut report);
        let clusters = Clusters::new(patches, options.leaf);
        let entries = Entries::new(patches, obstacles.facets(), options);
        let planner = Planner {
            clusters: &clusters,
            entries: &entries,
            obstacles: obstacles.facets(),
            options,
            compress: patches.len() > options.dense_limit,
        };
        let tasks = planner.tasks();
        progress.begin("form factors", tasks.len() as u64);
        let store = if planner.compress {
            let blocks = blocks::evaluate(&planner, &tasks, progress);
            blocks.map(|blocks| MatrixStorage::Blocks {
                parts: product::divided(&blocks),
                blocks,
                order: clusters.order.clone(),
            })
        } else {
            Some(MatrixStorage::Whole(blocks::evaluate_whole(
                &planner, &tasks, progress,
            )))
        };
        progress.end();
        (report.evaluated, report.visibility_tested) = entries.counts();
        let too_large = FormFactorError::TooLarge {
            patches: patches.len(),
            limit: options.most_bytes,
        };
        let mut exchange = Self {
            areas: patches.iter().map(|p| p.polygon.area()).collect(),
            store: store.ok_or(too_large)?,
            row_sums: DVector::zeros(patches.len()),
            report,
        };
        exchange.conserve_energy();
        exchange.describe(start);
        Ok(exchange)
    }

    /// Number of patches.
    #[must_use]
    pub fn patches(&self) -> usize {
        self.areas.len()
    }

    /// Areas of the patches, m^2.
    #[must_use]
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Irradiance `F B` from the radiosity `B` of all patches, N x columns. The
    /// same bits on any number of cores.
    ///
    /// # Panics
    /// If `radiosity` has not one row a patch.
    #[must_use]
    pub fn irradiance(&self, radiosity: &DMatrix<f64>) -> DMatrix<f64> {
        let scale = |light: &mut DMatrix<f64>, factor: fn(f64) -> f64| {
            for mut column in light.column_iter_mut() {
                let rows = column.iter_mut().zip(&self.areas);
                rows.for_each(|(value, area)| *value *= factor(*area));
            }
        };
        let mut light = radiosity.clone();
        scale(&mut light, f64::sqrt);
        let mut irradiance = self.symmetric(&light);
        scale(&mut irradiance, |area| area.sqrt().recip());
        irradiance
    }

    /// `S` times columns.
    fn symmetric(&self, light: &DMatrix<f64>) -> DMatrix<f64> {
        match &self.store {
            MatrixStorage::Whole(matrix) => whole_product(matrix, light),
            MatrixStorage::Blocks {
                order,
                blocks,
                parts,
            } => product::product(blocks, parts, order, light),
        }
    }

    /// `S`, if it is stored as one matrix.
    fn whole(&self) -> Option<&DMatrix<f64>> {
        match &self.store {
            MatrixStorage::Whole(matrix) => Some(matrix),
            MatrixStorage::Blocks { .. } => None,
        }
    }

    /// Share of the light leaving each patch that arrives on others, at most 1.
    #[must_use]
    pub fn row_sums(&self) -> DVector<f64> {
        self.row_sums.clone()
    }

    /// One form factor `F_pq`; slow if there are many patches.
    ///
    /// # Panics
    /// If there are not that many patches.
    #[must_use]
    pub fn entry(&self, p: usize, q: usize) -> f64 {
        let symmetric = match &self.store {
            MatrixStorage::Whole(matrix) => matrix[(p, q)],
            MatrixStorage::Blocks { order, blocks, .. } => {
                let place = |patch: usize| order.iter().position(|o| *o == patch).unwrap_or(0);
                let (i, j) = (place(p), place(q));
                let held = |b: &MatrixBlock, i: usize, j: usize| {
                    (b.rows.contains(&i) && b.columns.contains(&j))
                        .then(|| b.entry(i - b.rows.start, j - b.columns.start))
                };
                let either = |b: &MatrixBlock| held(b, i, j).or_else(|| held(b, j, i));
                blocks.iter().find_map(either).unwrap_or(0.0)
            }
        };
        symmetric * (self.areas[q] / self.areas[p]).sqrt()
    }

    /// What it consists of and what it took.
    #[must_use]
    pub fn report(&self) -> &FormFactorReport {
        &self.report
    }

    /// Scales `S` to `D S D` where quadrature made a patch give more than it has.
    fn conserve_energy(&mut self) {
        let ones = DMatrix::from_element(self.patches(), 1, 1.0);
        // Rounding after scaling may leave a last bit too many.
        for round in 0..8 {
            let sums = self.irradiance(&ones).column(0).into_owned();
            let excess = sums.iter().fold(0.0_f64, |most, s| most.max(s - 1.0));
            if round == 0 {
                self.report.excess = excess;
            }
            self.row_sums = sums;
            if excess <= 0.0 {
                return;
            }
            let margin = if round == 0 {
                0.0
            } else {
                1e-7 * f64::from(round)
            };
            let factors = self
                .row_sums
                .map(|s| if s > 1.0 { (1.0 - margin) / s } else { 1.0 });
            self.scale(&factors);
        }
        self.row_sums.apply(|s| *s = s.min(1.0));
    }

    /// `D S D` for a diagonal `D`.
    fn scale(&mut self, factors: &DVector<f64>) {
        match &mut self.store {
            MatrixStorage::Whole(matrix) => {
                for (q, mut column) in matrix.column_iter_mut().enumerate() {
                    column.component_mul_assign(factors);
                    column *= factors[q];
                }
            }
            MatrixStorage::Blocks { order, blocks, .. } => {
                let rows = |matrix: &mut DMatrix<f32>, range: &Range<usize>| {
                    for (mut row, patch) in matrix.row_iter_mut().zip(&order[range.clone()]) {
                        row *= factors[*patch] as f32;
                    }
                };
                for block in blocks {
                    match &mut block.content {
                        BlockStorage::Dense(matrix) => {
                            rows(matrix, &block.rows);
                            let patches = &order[block.columns.clone()];
                            for (mut column, patch) in matrix.column_iter_mut().zip(patches) {
                                column *= factors[*patch] as f32;
                            }
                        }
                        BlockStorage::LowRank { left, right } => {
                            rows(left, &block.rows);
                            rows(right, &block.columns);
                        }
                    }
                }
            }
        }
    }

    fn describe(&mut self, start: Instant) {
        let report = &mut self.report;
        match &self.store {
            MatrixStorage::Whole(matrix) => {
                report.dense_blocks = 1;
                report.bytes = 8 * matrix.len();
            }
            MatrixStorage::Blocks { blocks, .. } => {
                report.bytes = 4 * blocks.iter().map(MatrixBlock::numbers).sum::<usize>();
                for block in blocks {
                    match &block.content {
                        BlockStorage::Dense(_) => report.dense_blocks += 1,
                        BlockStorage::LowRank { left, .. } => {
                            report.low_rank_blocks += 1;
                            report.largest_rank = report.largest_rank.max(left.ncols());
                        }
                    }
                }
            }
        }
        report.seconds = start.elapsed().as_secs_f64();
    }
}

/// The product with one matrix, some columns at a time on each core.
fn whole_product(matrix: &DMatrix<f64>, light: &DMatrix<f64>) -> DMatrix<f64> {
    use rayon::prelude::*;
    const CHUNK: usize = 32;
    if light.ncols() == 1 {
        return matrix * light;
    }
    let firsts: Vec<usize> = (0..light.ncols()).step_by(CHUNK).collect();
    let parts: Vec<DMatrix<f64>> = firsts
        .par_iter()
        .map(|first| matrix * light.columns(*first, CHUNK.min(light.ncols() - first)))
        .collect();
    let mut result = DMatrix::zeros(light.nrows(), light.ncols());
    for (first, part) in firsts.iter().zip(parts) {
        result.columns_mut(*first, part.ncols()).copy_from(&part);
    }
    result
}
