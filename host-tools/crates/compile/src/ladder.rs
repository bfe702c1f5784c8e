//! Accuracy ladder: which operator entries a tier needs.
//!
//! Entry `(i, j)` of `K^ = W^T K W` changes the light of a frame by about
//! `|K^_ij| sigma_j`, with `sigma_j` the root mean square of input coefficient
//! `j` over [natural images](iltm_solve::natural_images). Entries stand in one queue, by the
//! squares of that per instruction: neighbours in a row are stored in pairs, which take one
//! multiplication each, and the first pair of a row takes what it costs to end the row. The
//! first tier takes as many entries as its error needs, the next one adds to it, and so on.

use crate::cost::Price;
use iltm_solve::{Coefficient, Haar, IMAGES, Interreflection, Inverse, InverseTransport};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Errors that tiers aim for, each about half the one before. The third is one
/// step of an 8-bit code.
pub const TARGETS: [f64; 6] = [
    1.0 / 64.0,
    1.0 / 128.0,
    1.0 / 255.0,
    1.0 / 512.0,
    1.0 / 1024.0,
    1.0 / 4096.0,
];

/// Coefficients of an operator beyond which those that no tier needs stand in no queue.
const MANY: usize = 1 << 22;

/// Error of those, as a part of the finest target.
const ASIDE: f64 = 0.05;

/// Which operator an entry belongs to.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Part {
    /// The operator that all channels share.
    Shared,
    /// What one channel adds to it.
    Channel(u8),
}

/// One entry of an operator in the orthonormal Haar domain.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Entry {
    /// The operator.
    pub part: Part,
    /// Output coefficient.
    pub row: u32,
    /// Input coefficient.
    pub col: u32,
    /// `K^_ij`, drive per camera unit.
    pub value: f64,
}

/// One tier above tier 0.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Tier {
    /// How many entries from the front of the queue it uses.
    pub entries: usize,
    /// Predicted error of leaving the others out.
    pub error: f64,
}

/// All entries worth storing, and how many each tier uses.
#[derive(Clone, Debug)]
pub struct Ladder {
    /// Most useful first.
    pub entries: Vec<Entry>,
    /// Predicted error of gain alone, at the brightness that suits it best: without the
    /// operator all is brighter, which is no error of what the picture looks like.
    pub gain_only: f64,
    /// Tiers 1 and up, each with more entries than the one before.
    pub tiers: Vec<Tier>,
}

/// Chooses entries and tiers. `content` holds [natural images](iltm_solve::natural_images), in
/// camera units; `sigma` comes from them. `targets` are the errors that the tiers aim
/// for, descending.
#[must_use]
pub fn build(inverse: &InverseTransport, content: &DMatrix<f64>, targets: &[f64]) -> Ladder {
    let haar = Haar::new(inverse.grid);
    let coefficients = haar.analyse_columns(content);
    let sigma = DVector::from_iterator(
        coefficients.nrows(),
        coefficients
            .row_iter()
            .map(|row| row.norm() / (row.len().max(1) as f64).sqrt()),
    );
    let mut judge = Judge::new(inverse, &haar, content, &coefficients);
    let finest = targets.last().copied().unwrap_or(0.0);
    let mut entries = queue(inverse, &sigma, finest, &mut judge);
    let mut search = Search::new(&judge, &entries);
    // The finest tier first: a coarser one leaves out all that this one does, and more.
    let found: Vec<Tier> = (targets.iter().rev())
        .map(|target| search.fewest_entries(*target))
        .collect();
    let all = search.error(0);
    let gain_only = judge.error_as_bright_as_fits(search.missing(0));
    let mut tiers: Vec<Tier> = Vec::new();
    for (&target, tier) in targets.iter().zip(found.into_iter().rev()) {
        let last = tiers.last().map_or(all, |tier| tier.error);
        if last > target && tiers.last().is_none_or(|last| tier.entries > last.entries) {
            tiers.push(tier);
        }
    }
    entries.truncate(tiers.last().map_or(0, |tier| tier.entries));
    Ladder {
        entries,
        gain_only,
        tiers,
    }
}

/// All non-zero entries, most useful first, but those of operators with many that together err by
/// a small part of the target `finest`: the judge counts them as never there.
fn queue(
    inverse: &InverseTransport,
    sigma: &DVector<f64>,
    finest: f64,
    judge: &mut Judge<'_>,
) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    let gains = inverse.channels.iter().flat_map(|channel| &channel.gain);
    let gain = gains.clone().sum::<f64>() / gains.count().max(1) as f64;
    let least = ASIDE * finest * gain * sigma.norm();
    let mut add = |part: Part, operator: &Interreflection| {
        let mut found = operator.haar_coefficients(judge.haar);
        if found.len() > MANY {
            let worth = |coefficient: &Coefficient| {
                coefficient.value.abs() * sigma[coefficient.col as usize]
            };
            let needed = needed_from(&found, worth, least);
            judge.leave_out(part, found.iter().filter(|c| worth(c) < needed));
            found.retain(|coefficient| worth(coefficient) >= needed);
        }
        entries.extend(found.into_iter().map(|coefficient| Entry {
            part,
            row: coefficient.row,
            col: coefficient.col,
            value: coefficient.value,
        }));
    };
    add(Part::Shared, &inverse.shared);
    for (index, channel) in inverse.channels.iter().enumerate() {
        if let Some(deviation) = &channel.deviation {
            add(Part::Channel(index as u8), deviation);
        }
    }
    let scales = inverse.channels.iter().map(|channel| channel.scale);
    let squares: f64 = scales.map(|scale| scale * scale).sum();
    let worth = |entry: &Entry| {
        let weight = match entry.part {
            Part::Shared => squares,
            Part::Channel(_) => 1.0,
        };
        weight * (entry.value * sigma[entry.col as usize]).powi(2)
    };
    most_useful_first(entries, worth, inverse.channels.len() as u8)
}

/// Entries by what they are worth per instruction of a table of `channels` channels, most first.
pub(crate) fn most_useful_first(
    entries: Vec<Entry>,
    worth: impl Fn(&Entry) -> f64 + Copy + Sync + Send,
    channels: u8,
) -> Vec<Entry> {
    let unranked = |entry| Ranked { worth: 0.0, entry };
    let mut ranked: Vec<Ranked> = entries.into_iter().map(unranked).collect();
    let place = |ranked: &Ranked| (ranked.entry.part, ranked.entry.row, ranked.entry.col);
    let row = |ranked: &Ranked| (ranked.entry.part, ranked.entry.row);
    ranked.par_sort_unstable_by_key(place);
    let rows = ranked.par_chunk_by_mut(|a, b| row(a) == row(b));
    rows.for_each(|row| rank(row, worth, Price::of(row[0].entry.part, channels)));
    ranked.par_sort_unstable_by(|a, b| {
        let worth = b.worth.total_cmp(&a.worth);
        worth.then_with(|| place(a).cmp(&place(b)))
    });
    ranked.into_iter().map(|ranked| ranked.entry).collect()
}

/// An entry, and what it is worth per instruction with those that join a tier together with it.
#[derive(Clone, Copy)]
struct Ranked {
    worth: f64,
    entry: Entry,
}

/// Ranks the entries of one row. Pairs join one by one, each worth no more than the one before: the
/// concave hull of what they are worth over what they cost. Where the first ones do not pay for the
/// row, several join together.
fn rank(row: &mut [Ranked], worth: impl Fn(&Entry) -> f64, price: Price) {
    let pairs = pairs(row, worth);
    // Worth, price and number of the pairs that join together.
    let mut hull: Vec<(f64, f64, usize)> = Vec::new();
    for (index, (worth, _)) in pairs.iter().enumerate() {
        let first = if index == 0 { price.row } else { 0.0 };
        let mut step = (*worth, first + price.pair, 1);
        while let Some(before) = hull.pop_if(|before| before.0 * step.1 < step.0 * before.1) {
            step = (before.0 + step.0, before.1 + step.1, before.2 + step.2);
        }
        hull.push(step);
    }
    let mut pairs = pairs.into_iter();
    for (worth, price, count) in hull {
        for (_, pair) in pairs.by_ref().take(count) {
            for ranked in &mut row[pair] {
                ranked.worth = worth / price;
            }
        }
    }
}

/// Places in a row of entries with the neighbours that they are stored with, and what both are worth,
/// most first: the entry that is worth most takes the better one of its neighbours, and so on.
fn pairs(row: &[Ranked], worth: impl Fn(&Entry) -> f64) -> Vec<(f64, RangeInclusive<usize>)> {
    let worths: Vec<f64> = row.iter().map(|ranked| worth(&ranked.entry)).collect();
    let mut order: Vec<usize> = (0..row.len()).collect();
    order.sort_by(|a, b| worths[*b].total_cmp(&worths[*a]));
    let mut taken = vec![false; row.len()];
    let mut pairs = Vec::new();
    for index in order {
        if taken[index] {
            continue;
        }
        let neighbours = [index.wrapping_sub(1), index + 1]
            .into_iter()
            .filter(|&other| {
                let column = |index: usize| row[index].entry.col;
                other < row.len() && !taken[other] && column(other).abs_diff(column(index)) == 1
            });
        let other = neighbours.max_by(|a, b| worths[*a].total_cmp(&worths[*b]));
        let pair = other.map_or(index..=index, |other| index.min(other)..=index.max(other));
        taken[pair.clone()].fill(true);
        pairs.push((worths[pair.clone()].iter().sum(), pair));
    }
    pairs.sort_by(|a: &(f64, _), b| b.0.total_cmp(&a.0));
    pairs
}

/// The worth from which coefficients are needed: the squares of all that are worth less sum up to
/// at most that of `least`. It is a power of two.
fn needed_from(
    coefficients: &[Coefficient],
    worth: impl Fn(&Coefficient) -> f64,
    least: f64,
) -> f64 {
    let mut squares: BTreeMap<i32, f64> = BTreeMap::new();
    for worth in coefficients.iter().map(worth).filter(|worth| *worth > 0.0) {
        *squares.entry(worth.log2().floor() as i32).or_default() += worth * worth;
    }
    let (mut sum, mut needed) = (0.0, 0.0);
    for (power, square) in squares {
        sum += square;
        if sum > least * least {
            break;
        }
        needed = f64::from(power + 1).exp2();
    }
    needed
}

/// One value for each image.
type PerImage = [f64; IMAGES];

/// Light of each image that is missing, by channel and output coefficient.
type Missing = Vec<Vec<PerImage>>;

/// Predicts the error of leaving entries out.
struct Judge<'a> {
    channels: Vec<(f64, Inverse)>,
    haar: &'a Haar,
    content: &'a DMatrix<f64>,
    coefficients: Vec<PerImage>,
    /// What entries that stand in no queue would add.
    left_out: Missing,
}

impl<'a> Judge<'a> {
    fn new(
        inverse: &InverseTransport,
        haar: &'a Haar,
        content: &'a DMatrix<f64>,
        coefficients: &DMatrix<f64>,
    ) -> Self {
        let channels = inverse.channels.iter().enumerate();
        let channels = channels.map(|(index, channel)| (channel.scale, inverse.channel(index)));
        let row = |row: usize| std::array::from_fn(|image| coefficients[(row, image)]);
        let nothing = vec![[0.0; IMAGES]; coefficients.nrows()];
        Self {
            channels: channels.collect(),
            haar,
            content,
            coefficients: (0..coefficients.nrows()).map(row).collect(),
            left_out: vec![nothing; inverse.channels.len()],
        }
    }

    /// Counts entries as left out whatever the tier.
    fn leave_out<'c>(&mut self, part: Part, entries: impl Iterator<Item = &'c Coefficient>) {
        for coefficient in entries {
            let inputs = &self.coefficients[coefficient.col as usize];
            let channels = self.channels.iter().zip(&mut self.left_out).enumerate();
            for (index, ((scale, _), left_out)) in channels {
                let Some(factor) = factor(part, index, *scale, coefficient.value) else {
                    continue;
                };
                add(&mut left_out[coefficient.row as usize], factor, inputs);
            }
        }
    }

    /// Adds what entries that are left out would add.
    fn add(&self, left_out: &[Entry], missing: &mut Missing) {
        let channels = missing.par_iter_mut().enumerate();
        channels.for_each(|(index, missing)| {
            let (scale, _) = self.channels[index];
            for entry in left_out {
                if let Some(factor) = factor(entry.part, index, scale, entry.value) {
                    let inputs = &self.coefficients[entry.col as usize];
                    add(&mut missing[entry.row as usize], factor, inputs);
                }
            }
        });
    }

    /// Error when this is missing, all channels together.
    fn error(&self, missing: &Missing) -> f64 {
        let squares = missing.par_iter().enumerate().map(|(index, missing)| {
            let light = self.light(index, missing);
            // Light that grows from bounce to bounce cannot be predicted.
            light.map_or(f64::INFINITY, |light| {
                relative_error(&light, self.content).powi(2)
            })
        });
        let squares: Vec<f64> = squares.collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }

    /// Error when this is missing, each image shown as bright as suits it
    /// best: mean over the images of `min_t |t shown - wanted| / |wanted|`, all channels
    /// together.
    fn error_as_bright_as_fits(&self, missing: &Missing) -> f64 {
        let channels = missing.par_iter().enumerate();
        let light: Option<Vec<_>> = channels
            .map(|(index, missing)| self.light(index, missing))
            .collect();
        let Some(light) = light else {
            return f64::INFINITY;
        };
        let images = self.content.ncols();
        let of_image = |image: usize| {
            let wanted = self.content.column(image);
            let (mut both, mut own, mut whole) = (0.0, 0.0, 0.0);
            for light in &light {
                // What the operator does not take away is there as well.
                let shown = wanted + light.column(image);
                both += shown.dot(&wanted);
                own += shown.norm_squared();
                whole += wanted.norm_squared();
            }
            if own > 0.0 && whole > 0.0 {
                (1.0 - both * both / (own * whole)).max(0.0).sqrt()
            } else {
                0.0
            }
        };
        (0..images).map(of_image).sum::<f64>() / images.max(1) as f64
    }

    /// What is on the wall of one channel when this is missing, beyond what is wanted;
    /// `None` if light grows from bounce to bounce.
    fn light(&self, index: usize, missing: &[PerImage]) -> Option<DMatrix<f64>> {
        let missing = DMatrix::from_fn(missing.len(), IMAGES, |row, image| missing[row][image]);
        let (_, inverse) = &self.channels[index];
        inverse.light(&self.haar.synthesise_columns(&missing))
    }
}

/// A search for tiers, which adds up each part of the queue once.
struct Search<'s> {
    judge: &'s Judge<'s>,
    entries: &'s [Entry],
    /// Errors when the entries from a place on are missing, by place.
    errors: BTreeMap<usize, f64>,
    /// What those would add. Some places are forgotten.
    missing: BTreeMap<usize, Missing>,
}

impl<'s> Search<'s> {
    fn new(judge: &'s Judge<'s>, entries: &'s [Entry]) -> Self {
        Self {
            judge,
            entries,
            errors: BTreeMap::new(),
            missing: BTreeMap::from([(entries.len(), judge.left_out.clone())]),
        }
    }

    /// What the entries from `place` on would add.
    fn missing(&mut self, place: usize) -> &Missing {
        let behind = self.missing.range(place..).next();
        let (end, rest) = behind.expect("the end of the queue is never forgotten");
        if *end > place {
            let (end, mut missing) = (*end, rest.clone());
            self.judge.add(&self.entries[place..end], &mut missing);
            self.missing.insert(place, missing);
        }
        &self.missing[&place]
    }

    /// Error when the entries from `place` on are missing.
    fn error(&mut self, place: usize) -> f64 {
        if let Some(error) = self.errors.get(&place) {
            return *error;
        }
        let judge = self.judge;
        let error = judge.error(self.missing(place));
        self.errors.insert(place, error);
        error
    }

    /// The shortest front of the queue whose rest errs by at most `target`.
    fn fewest_entries(&mut self, target: f64) -> Tier {
        let (mut low, mut high) = (0, self.entries.len());
        // Half a per cent of the entries is as fine as a tier needs to be cut.
        while high - low > 1 + high / 200 {
            let middle = usize::midpoint(low, high);
            if self.error(middle) <= target {
                high = middle;
            } else {
                low = middle;
            }
        }
        let error = self.error(high);
        // The next search is for fewer entries.
        let end = self.entries.len();
        self.missing
            .retain(|place, _| *place <= high || *place == end);
        Tier {
            entries: high,
            error,
        }
    }
}

/// What an entry's input is multiplied with in a channel of this index and scale; `None` if it
/// belongs to another one.
fn factor(part: Part, channel: usize, scale: f64, value: f64) -> Option<f64> {
    match part {
        Part::Shared => Some(scale * value),
        Part::Channel(own) => (usize::from(own) == channel).then_some(value),
    }
}

fn add(sum: &mut PerImage, factor: f64, input: &PerImage) {
    for (sum, input) in sum.iter_mut().zip(input) {
        *sum += factor * input;
    }
}

/// Mean over the columns of `|difference| / |wanted|`.
#[must_use]
pub fn relative_error(difference: &DMatrix<f64>, wanted: &DMatrix<f64>) -> f64 {
    let ratio = |column: usize| {
        let norm = wanted.column(column).norm();
        if norm > 0.0 {
            difference.column(column).norm() / norm
        } else {
            0.0
        }
    };
    let columns = wanted.ncols();
    (0..columns).map(ratio).sum::<f64>() / columns.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::inverse;
    use iltm_runtime::Grid;
    use iltm_solve::natural_images;

    #[test]
    fn neighbours_join_together_and_the_first_pair_of_a_row_pays_for_it() {
        let ranked = |col, value: f64| Ranked {
            worth: 0.0,
            entry: Entry {
                part: Part::Shared,
                row: 7,
                col,
                value: value.sqrt(),
            },
        };
        // The second takes the third, not the first; the last has no neighbour.
        let columns = [0, 1, 2, 3, 6];
        let mut row: Vec<Ranked> = columns
            .into_iter()
            .zip([1.0, 3.0, 2.0, 0.5, 2.5])
            .map(|(col, value)| ranked(col, value))
            .collect();
        let worth = |entry: &Entry| entry.value * entry.value;
        let found: Vec<_> = pairs(&row, worth).into_iter().map(|pair| pair.1).collect();
        assert_eq!(found, [1..=2, 4..=4, 0..=0, 3..=3]);
        let mut thousandths = |price| {
            rank(&mut row, worth, price);
            row.iter()
                .map(|ranked| (1e3 * ranked.worth).round())
                .collect::<Vec<_>>()
        };
        // A row for nothing: each pair joins alone.
        let free = Price {
            row: 0.0,
            pair: 2.0,
        };
        assert_eq!(thousandths(free), [500.0, 2500.0, 2500.0, 250.0, 1250.0]);
        // One that costs three: 5 for 5 alone, 7.5 for 7 with the second pair, which joins it.
        let dear = Price {
            row: 3.0,
            pair: 2.0,
        };
        assert_eq!(thousandths(dear), [500.0, 1071.0, 1071.0, 250.0, 1071.0]);
    }

    #[test]
    fn entries_that_stand_in_no_queue_err_as_if_they_did_and_by_no_more_than_asked() {
        let grid = Grid::new(4, 5).unwrap();
        let near = |i: usize, j: usize| {
            if i == j {
                0.0
            } else {
                0.3 / (i + 2 * j + 9) as f64
            }
        };
        let mut scene = inverse(grid, 3, |cell, _| 2.0 + 0.1 * cell as f64, near);
        scene.channels[1].scale = 0.7;
        scene.channels[2].deviation = Some(&scene.shared * 0.1);
        let haar = Haar::new(grid);
        let content = natural_images(grid);
        let coefficients = haar.analyse_columns(&content);
        let sigma = DVector::from_iterator(
            coefficients.nrows(),
            coefficients.row_iter().map(|row| row.norm() / 4.0),
        );
        let mut judge = Judge::new(&scene, &haar, &content, &coefficients);
        let entries = queue(&scene, &sigma, 0.0, &mut judge);
        let wanted = Search::new(&judge, &entries).error(0);
        let shared = scene.shared.haar_coefficients(&haar);
        let worth = |c: &Coefficient| c.value.abs() * sigma[c.col as usize];
        let all = shared.iter().map(|c| worth(c).powi(2)).sum::<f64>().sqrt();
        let needed = needed_from(&shared, worth, 0.1 * all);
        let less = |c: &&Coefficient| worth(c) < needed;
        let squares: f64 = shared.iter().filter(less).map(|c| worth(c).powi(2)).sum();
        assert!(squares > 0.0 && squares.sqrt() <= 0.1 * all, "{squares}");
        judge.leave_out(Part::Shared, shared.iter().filter(less));
        let others: Vec<Entry> = entries
            .iter()
            .filter(|e| e.part != Part::Shared || e.value.abs() * sigma[e.col as usize] >= needed)
            .copied()
            .collect();
        assert!(others.len() < entries.len());
        let mut search = Search::new(&judge, &others);
        // Forwards and backwards: what places have in common is added once.
        for place in [others.len() / 2, others.len() / 3, others.len(), 0] {
            let mut missing = judge.left_out.clone();
            judge.add(&others[place..], &mut missing);
            assert!((search.error(place) - judge.error(&missing)).abs() < 1e-12);
        }
        assert!((search.error(0) - wanted).abs() < 1e-12);
        let few = entries.len() - others.len();
        assert!(search.error(others.len()) > 0.0, "{few} are left out");
    }
}
