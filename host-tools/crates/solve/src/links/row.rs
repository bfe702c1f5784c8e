//! One row of `K` as links to blocks of source cells: a small non-negative least-squares problem,
//! whose blocks are split where the photographs ask for it.

use super::quadtree::Quadtree;
use nalgebra::{DMatrix, DMatrixView, Dyn, U1};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap, HashSet};

/// A split must explain as many times the noise variance.
const SPLIT: f32 = 5.0;
/// Splits of less than this part of the best one wait for the next round.
const SPLIT_TOGETHER: f32 = 0.25;
/// Blocks of a row beyond which none is split any more.
const MOST_BLOCKS: usize = 200;
/// Rounds of splits at most.
const MOST_ROUNDS: usize = 40;
/// Values that differ by at most this part are alike.
const ALIKE: f32 = 0.1;
/// Sweeps of coordinate descent at most, and the gain in units of the noise variance below which
/// no sweep is worth another.
const MOST_SWEEPS: usize = 200;
const LEAST_GAIN: f32 = 1e-3;

/// Links of one receiving block: the light of all cells of a source block together, times a value.
/// No two source blocks overlap; all of them together are the whole grid.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) blocks: Vec<usize>,
    pub(super) values: Vec<f32>,
}

impl Row {
    /// Adds the row's light to `light`; `sources` has the series of each block.
    pub(super) fn add_light(&self, sources: &DMatrix<f32>, light: &mut [f32]) {
        for (block, value) in self.blocks.iter().zip(&self.values) {
            if *value != 0.0 {
                axpy(light, *value, series(sources, *block));
            }
        }
    }

    /// The same with fewer blocks: four whose values are alike become the one above them.
    pub(super) fn merged(mut self, tree: &Quadtree) -> Self {
        let end = tree.level(tree.coarsest()).end;
        loop {
            let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
            for (link, block) in self.blocks.iter().enumerate() {
                let parent = tree.parent(*block);
                if let Some(parent) = parent.filter(|parent| *parent < end) {
                    groups.entry(parent).or_default().push(link);
                }
            }
            groups.retain(|parent, links| {
                let values = links.iter().map(|link| self.values[*link]);
                let (least, most) = values
                    .fold((f32::INFINITY, 0.0_f32), |(least, most), value| {
                        (least.min(value), most.max(value))
                    });
                links.len() == tree.children(*parent).count() && most - least <= ALIKE * most
            });
            if groups.is_empty() {
                return self;
            }
            let gone: HashSet<usize> = groups.values().flatten().copied().collect();
            let mean = |links: &[usize]| {
                let values = links.iter().map(|link| self.values[*link]);
                values.sum::<f32>() / links.len() as f32
            };
            let kept = (0..self.blocks.len())
                .filter(|link| !gone.contains(link))
                .map(|link| (self.blocks[link], self.values[link]));
            let merged = groups.iter().map(|(parent, links)| (*parent, mean(links)));
            let (blocks, values) = kept.chain(merged).unzip();
            self = Self { blocks, values };
        }
    }

    /// Means of several rows with shares, over the blocks of the first.
    pub(super) fn mean(tree: &Quadtree, rows: &[(&Self, f32)]) -> Option<Self> {
        let (first, share) = rows.first()?;
        let mut mean: Vec<f32> = first.values.iter().map(|value| share * value).collect();
        let mut total = *share;
        for (row, share) in &rows[1..] {
            total += share;
            let links = row.blocks.iter().copied().zip(row.values.iter().copied());
            let values: HashMap<usize, f32> = links.collect();
            for (mean, block) in mean.iter_mut().zip(&first.blocks) {
                *mean += share * value(tree, &values, *block);
            }
        }
        for mean in &mut mean {
            *mean /= total;
        }
        Some(Self {
            blocks: first.blocks.clone(),
            values: mean,
        })
    }
}

/// The mean value of links on a block, which may be finer or coarser than they are.
fn value(tree: &Quadtree, values: &HashMap<usize, f32>, block: usize) -> f32 {
    let mut at = Some(block);
    while let Some(block) = at {
        if let Some(value) = values.get(&block) {
            return *value;
        }
        at = tree.parent(block);
    }
    let (mut sum, mut count) = (0.0, 0.0);
    for child in tree.children(block) {
        sum += value(tree, values, child);
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// What a row is fitted to: series are photographs of one channel after the other.
pub(super) struct Target<'t> {
    pub(super) tree: &'t Quadtree,
    /// Length of one channel's series.
    pub(super) photographs: usize,
    /// Light of each block, a column each, in the channels' units of the shared operator.
    pub(super) sources: &'t DMatrix<f32>,
    /// Reciprocal of the noise's deviation in the target.
    pub(super) precision: Vec<f32>,
    /// What the row must make of the sources, noise 1.
    pub(super) wanted: Vec<f32>,
    /// Series of unit length, orthogonal to one another, that gains explain; noise 1.
    pub(super) own: Vec<Vec<f32>>,
    /// How far values may be from those that they start from: a part of the value, and beyond.
    pub(super) prior: Prior,
    pub(super) splits: Splits,
    /// Whether channels will be fitted apart from one another.
    pub(super) apart: bool,
}

/// When blocks of sources are split where the photographs leave more unexplained than noise is.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(in super::super) enum Splits {
    /// A split must explain five times the mean of what is left.
    Few,
    /// Twice that: for scenes whose photographs have little noise beside what blocks cost.
    Many,
}

impl Splits {
    const fn least(self) -> f32 {
        match self {
            Self::Few => 5.0,
            Self::Many => 2.0,
        }
    }
}

/// Deviation of a value from where it starts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior {
    pub(super) relative: f32,
    pub(super) absolute: f32,
}

impl<'t> Target<'t> {
    /// Fits the row that starts from `start`; its blocks are split.
    pub(super) fn fit(mut self, start: &Row) -> Fit<'t> {
        for own in &self.own {
            let along = dot(own, &self.wanted);
            axpy(&mut self.wanted, -along, own);
        }
        let columns = self.columns(&start.blocks);
        let mut fit = Fit {
            blocks: start.blocks.clone(),
            grams: (0..self.parts())
                .map(|part| gram(&self.part(&columns, part)))
                .collect(),
            columns,
            values: start.values.clone(),
            start: start.values.clone(),
            target: self,
        };
        for _ in 0..MOST_ROUNDS {
            fit.descend();
            if fit.blocks.len() > MOST_BLOCKS {
                break;
            }
            let splits = fit.splits();
            if splits.is_empty() {
                break;
            }
            fit.split(&splits);
        }
        fit
    }

    /// Parts of the series whose products are kept apart: channels, or all of them together.
    fn parts(&self) -> usize {
        if self.apart {
            self.wanted.len() / self.photographs
        } else {
            1
        }
    }

    fn part<'c>(&self, columns: &'c DMatrix<f32>, part: usize) -> Columns<'c> {
        let length = self.wanted.len() / self.parts();
        columns.rows(part * length, length)
    }

    /// Sources with noise 1, free of what gains explain.
    fn columns(&self, blocks: &[usize]) -> DMatrix<f32> {
        let mut columns = DMatrix::zeros(self.wanted.len(), blocks.len());
        let length = self.wanted.len();
        for (column, block) in columns.as_mut_slice().chunks_exact_mut(length).zip(blocks) {
            let source = series(self.sources, *block).iter().zip(&self.precision);
            for (value, (source, precision)) in column.iter_mut().zip(source) {
                *value = source * precision;
            }
            for own in &self.own {
                let along = dot(own, column);
                axpy(column, -along, own);
            }
        }
        columns
    }
}

/// Some rows of all columns.
type Columns<'c> = DMatrixView<'c, f32, U1, Dyn>;

/// `columns^T columns`.
fn gram(columns: &Columns<'_>) -> DMatrix<f32> {
    /// Columns from which the half that is the other's transpose is worth leaving out.
    const HALVED: usize = 64;
    let all = columns.ncols();
    if all < HALVED {
        return products(columns, columns);
    }
    let (left, right) = columns.columns_range_pair(..all / 2, all / 2..);
    joined(&gram(&left), &products(&left, &right), &gram(&right))
}

/// `left^T right`: not by `tr_mul`, which takes one product after the other.
fn products(left: &Columns<'_>, right: &Columns<'_>) -> DMatrix<f32> {
    left.transpose() * right
}

/// A symmetric matrix from its blocks on the diagonal and the one beside it.
fn joined(first: &DMatrix<f32>, across: &DMatrix<f32>, second: &DMatrix<f32>) -> DMatrix<f32> {
    let (old, all) = (first.nrows(), first.nrows() + second.nrows());
    let mut whole = DMatrix::zeros(all, all);
    whole.view_mut((0, 0), first.shape()).copy_from(first);
    whole.view_mut((0, old), across.shape()).copy_from(across);
    let mut below = whole.view_mut((old, 0), (all - old, old));
    below.tr_copy_from(across);
    whole.view_mut((old, old), second.shape()).copy_from(second);
    whole
}

/// `min ||columns values - wanted||^2 + prior`, values not negative.
pub(super) struct Fit<'t> {
    target: Target<'t>,
    blocks: Vec<usize>,
    /// Series of the blocks, noise 1.
    columns: DMatrix<f32>,
    /// Products of any two of them within each part of the series.
    grams: Vec<DMatrix<f32>>,
    values: Vec<f32>,
    /// What values are pulled towards.
    start: Vec<f32>,
}

impl Fit<'_> {
    pub(super) fn row(&self) -> Row {
        Row {
            blocks: self.blocks.clone(),
            values: self.values.clone(),
        }
    }

    /// Each channel's own row, where channels are fitted apart: a value is pulled to the shared one
    /// by a deviation of `relative` times it.
    pub(super) fn of_channels(&self, relative: f32) -> Vec<Row> {
        let left = self.left(&self.values);
        let prior = Prior {
            relative,
            ..self.target.prior
        };
        let channel = |(channel, gram): (usize, &DMatrix<f32>)| {
            let length = self.target.photographs;
            let segment = channel * length..(channel + 1) * length;
            let slope = |column: &[f32]| dot(&column[segment.clone()], &left[segment.clone()]);
            let columns = self.columns.column_iter();
            let slopes = columns.map(|column| slope(column.data.into_slice()));
            let mut row = self.row();
            descend(gram, slopes.collect(), &mut row.values, &self.values, prior);
            row
        };
        self.grams.iter().enumerate().map(channel).collect()
    }

    /// What values leave unexplained.
    fn left(&self, values: &[f32]) -> Vec<f32> {
        let mut left = self.target.wanted.clone();
        for (column, value) in self.columns.column_iter().zip(values) {
            if *value != 0.0 {
                axpy(&mut left, -value, column.data.into_slice());
            }
        }
        left
    }

    fn descend(&mut self) {
        let left = self.left(&self.values);
        let slopes = (self.columns.column_iter())
            .map(|column| dot(column.data.into_slice(), &left))
            .collect();
        let prior = self.target.prior;
        match self.grams.as_slice() {
            [gram] => descend(gram, slopes, &mut self.values, &self.start, prior),
            grams => {
                let gram: DMatrix<f32> = grams.iter().sum();
                descend(&gram, slopes, &mut self.values, &self.start, prior);
            }
        }
    }

    /// Links whose split explains more than noise would, by index.
    fn splits(&self) -> Vec<usize> {
        let target = &self.target;
        let left = self.left(&self.values);
        let (series_length, links) = (left.len() as f32, self.blocks.len() as f32);
        let free = series_length - target.own.len() as f32 - links.min(0.5 * series_length);
        let variance = dot(&left, &left) / free.max(1.0);
        let least = SPLIT.max(target.splits.least() * variance);
        // Products with series as they are instead of with noise 1.
        let times = |series: &[f32]| -> Vec<f32> {
            series
                .iter()
                .zip(&target.precision)
                .map(|(a, b)| a * b)
                .collect()
        };
        let left = times(&left);
        let own: Vec<Vec<f32>> = target.own.iter().map(|own| times(own)).collect();
        let squares = times(&target.precision);
        let mut found = Vec::new();
        for (link, (block, value)) in self.blocks.iter().zip(&self.values).enumerate() {
            let mut explained = 0.0;
            for child in target.tree.children(*block) {
                let source = series(target.sources, child);
                let along: f32 = own.iter().map(|own| dot(own, source).powi(2)).sum();
                let square = sum(source, &squares, |light, square| square * light * light) - along;
                let slope = dot(&left, source);
                if square > 0.0 && (*value > 0.0 || slope > 0.0) {
                    explained += slope * slope / square;
                }
            }
            if explained > least {
                found.push((link, explained));
            }
        }
        let best = found
            .iter()
            .map(|(_, explained)| *explained)
            .fold(0.0, f32::max);
        found.retain(|(_, explained)| *explained > SPLIT_TOGETHER * best);
        found.into_iter().map(|(link, _)| link).collect()
    }

    fn split(&mut self, splits: &[usize]) {
        let kept: Vec<usize> = (0..self.blocks.len())
            .filter(|link| !splits.contains(link))
            .collect();
        let pick = |values: &[f32]| -> Vec<f32> { kept.iter().map(|link| values[*link]).collect() };
        let mut blocks: Vec<usize> = kept.iter().map(|link| self.blocks[*link]).collect();
        let (mut values, mut start) = (pick(&self.values), pick(&self.start));
        for link in splits {
            for child in self.target.tree.children(self.blocks[*link]) {
                blocks.push(child);
                values.push(self.values[*link]);
                start.push(self.values[*link]);
            }
        }
        let (old, all) = (kept.len(), blocks.len());
        let added = self.target.columns(&blocks[old..]);
        let before = self.columns.select_columns(&kept);
        for (part, gram) in self.grams.iter_mut().enumerate() {
            let of_part = |columns| self.target.part(columns, part);
            *gram = joined(
                &gram.select_rows(&kept).select_columns(&kept),
                &products(&of_part(&before), &of_part(&added)),
                &self::gram(&of_part(&added)),
            );
        }
        self.columns = before.resize_horizontally(all, 0.0);
        self.columns.columns_mut(old, all - old).copy_from(&added);
        (self.blocks, self.values, self.start) = (blocks, values, start);
    }
}

/// Coordinate descent (Hastie, Tibshirani, Wainwright, *Statistical Learning with Sparsity*,
/// 2015, section 5.4) on the normal equations. `slopes` are those where the values are.
fn descend(
    gram: &DMatrix<f32>,
    mut slopes: Vec<f32>,
    values: &mut [f32],
    start: &[f32],
    prior: Prior,
) {
    let precision =
        |start: &f32| ((prior.relative * start).powi(2) + prior.absolute.powi(2)).recip();
    let pulls: Vec<f32> = start.iter().map(precision).collect();
    for _ in 0..MOST_SWEEPS {
        let mut gained = 0.0_f32;
        for link in 0..values.len() {
            let curvature = gram[(link, link)] + pulls[link];
            let before = values[link];
            let slope = slopes[link] - pulls[link] * (before - start[link]);
            let next = (before + slope / curvature).max(0.0);
            let step = next - before;
            if step != 0.0 {
                values[link] = next;
                axpy(&mut slopes, -step, gram.column(link).data.into_slice());
                gained = gained.max(step * step * curvature);
            }
        }
        if gained < LEAST_GAIN {
            break;
        }
    }
}

/// Gives each block the sum of the series of its cells, a column each.
pub(super) fn sum_cells(tree: &Quadtree, sources: &mut DMatrix<f32>) {
    let length = sources.nrows();
    let mut series: Vec<&mut [f32]> = sources.as_mut_slice().chunks_exact_mut(length).collect();
    tree.sum_cells(&mut series, |sum, own| axpy(sum, 1.0, own));
}

/// The series of a block.
pub(super) fn series(sources: &DMatrix<f32>, block: usize) -> &[f32] {
    let length = sources.nrows();
    &sources.as_slice()[block * length..][..length]
}

/// Sums side by side, which the processor can add at once.
const LANES: usize = 16;

/// `sum of(a, b)` over the pairs of two series.
fn sum(a: &[f32], b: &[f32], of: impl Fn(f32, f32) -> f32) -> f32 {
    let mut sums = [0.0_f32; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest = a.remainder().iter().zip(b.remainder());
    let rest: f32 = rest.map(|(a, b)| of(*a, *b)).sum();
    for (a, b) in a.zip(b) {
        for lane in 0..LANES {
            sums[lane] += of(a[lane], b[lane]);
        }
    }
    rest + sums.iter().sum::<f32>()
}

pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    sum(a, b, |a, b| a * b)
}

pub(super) fn axpy(y: &mut [f32], by: f32, x: &[f32]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += by * x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::Grid;

    /// Light of 8 x 8 cells in so many photographs, by block.
    fn sources(tree: &Quadtree, photographs: usize) -> DMatrix<f32> {
        let mut random = fastrand::Rng::with_seed(7);
        let mut sources = DMatrix::zeros(photographs, tree.blocks());
        for cell in 0..tree.cells() {
            sources
                .column_mut(cell)
                .apply(|light| *light = random.f32() - 0.5);
        }
        sum_cells(tree, &mut sources);
        sources
    }

    fn fitted(tree: &Quadtree, sources: &DMatrix<f32>, wanted: &[f32], noise: f32) -> Row {
        let mut own = series(sources, 0).to_vec();
        let norm = dot(&own, &own).sqrt();
        for value in &mut own {
            *value /= norm;
        }
        let target = Target {
            tree,
            photographs: wanted.len(),
            sources,
            precision: vec![noise.recip(); wanted.len()],
            wanted: wanted.iter().map(|value| value / noise).collect(),
            own: vec![own],
            prior: Prior {
                relative: 0.7,
                absolute: 0.01,
            },
            splits: Splits::Few,
            apart: false,
        };
        let top: Vec<usize> = tree.level(tree.levels() - 1).collect();
        let start = Row {
            values: vec![0.0; top.len()],
            blocks: top,
        };
        target.fit(&start).row()
    }

    #[test]
    fn blocks_are_split_down_to_the_cell_that_lights_the_row_and_nowhere_else() {
        let tree = Quadtree::new(Grid::new(8, 8).unwrap());
        let sources = sources(&tree, 200);
        // Cell 0 is the row's own, which gains explain.
        let wanted: Vec<f32> = (series(&sources, 45).iter().zip(series(&sources, 0)))
            .map(|(light, own)| 0.05 * light + 3.0 * own)
            .collect();
        let row = fitted(&tree, &sources, &wanted, 1e-3);
        let mut covered: Vec<usize> = row.blocks.iter().flat_map(|b| tree.cells_of(*b)).collect();
        covered.sort_unstable();
        assert!(covered.into_iter().eq(0..64));
        assert!(row.blocks.contains(&45), "{row:?}");
        assert!(row.blocks.len() < 16, "{row:?}");
        for (block, value) in row.blocks.iter().zip(&row.values) {
            let wanted = if *block == 45 { 0.05 } else { 0.0 };
            assert!((value - wanted).abs() < 2e-3, "{block}: {value}");
        }
    }

    #[test]
    fn noise_alone_splits_little_and_light_that_is_missing_makes_no_link() {
        let tree = Quadtree::new(Grid::new(8, 8).unwrap());
        let sources = sources(&tree, 200);
        let mut random = fastrand::Rng::with_seed(8);
        let mut noise = || (0..12).map(|_| random.f32()).sum::<f32>() - 6.0;
        let wanted: Vec<f32> = (series(&sources, 45).iter())
            .map(|light| 1e-2 * noise() - 0.05 * light)
            .collect();
        let row = fitted(&tree, &sources, &wanted, 1e-2);
        assert!(row.values.iter().all(|value| *value >= 0.0));
        let links = row.blocks.iter().zip(&row.values);
        let mut lit = links.filter(|(_, value)| **value != 0.0);
        assert!(lit.all(|(block, _)| !tree.holds(*block, 45)), "{row:?}");
        assert!(row.blocks.len() < 32, "{row:?}");
    }

    #[test]
    fn blocks_whose_values_are_alike_become_the_one_above_them() {
        let tree = Quadtree::new(Grid::new(8, 8).unwrap());
        // 64 to 79 are the blocks of 2 x 2 cells, 80 to 83 those of 4 x 4.
        let mut blocks: Vec<usize> = vec![0, 1, 8, 9];
        blocks.extend(65..80);
        let mut values = vec![1.0; blocks.len()];
        values[0] = 0.95;
        let merged = |values: &[f32]| {
            let (blocks, values) = (blocks.clone(), values.to_vec());
            let row = Row { blocks, values }.merged(&tree);
            let mut links: Vec<(usize, f32)> = row.blocks.into_iter().zip(row.values).collect();
            links.sort_by_key(|(block, _)| *block);
            links
        };
        let even = merged(&values);
        assert_eq!(
            even.iter().map(|(block, _)| *block).collect::<Vec<_>>(),
            [80, 81, 82, 83]
        );
        assert!((even[0].1 - (3.0 + 3.95 / 4.0) / 4.0).abs() < 1e-6);
        // One cell is brighter: the blocks that it is in stay apart.
        values[0] = 1.2;
        let found = merged(&values);
        let wanted = [0, 1, 8, 9, 65, 68, 69, 81, 82, 83];
        assert_eq!(
            found.iter().map(|(block, _)| *block).collect::<Vec<_>>(),
            wanted
        );
    }

    #[test]
    fn the_mean_of_rows_is_over_the_blocks_of_the_first() {
        let tree = Quadtree::new(Grid::new(4, 4).unwrap());
        let row = |blocks: Vec<usize>, values: Vec<f32>| Row { blocks, values };
        // 16 to 19 are the blocks of 2 x 2 cells; 16 has cells 0, 1, 4 and 5.
        let first = row(vec![16, 17, 18, 19], vec![4.0, 0.0, 0.0, 0.0]);
        let finer = row(
            vec![0, 1, 4, 5, 17, 18, 19],
            vec![4.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        );
        let mean = Row::mean(&tree, &[(&first, 3.0), (&finer, 1.0)]).unwrap();
        assert_eq!(mean.values, [3.25, 0.25, 0.0, 0.0]);
        let mean = Row::mean(&tree, &[(&finer, 1.0), (&first, 1.0)]).unwrap();
        assert_eq!(mean.values, [4.0, 2.0, 2.0, 2.0, 0.5, 0.0, 0.0]);
        assert!(Row::mean(&tree, &[]).is_none());
    }
}
