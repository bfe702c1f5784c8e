//! Accuracy ladder: which operator entries a tier needs.
//!
//! Entry `(i, j)` of `K^ = W^T K W` changes the light of a frame by about
//! `|K^_ij| sigma_j`, with `sigma_j` the root mean square of input coefficient
//! `j` over [natural images](iltm_solve::natural_images). In that order, the first tier takes
//! as many entries as its error needs, the next one adds to it, and so on. The
//! entries of the shared operator and those that one channel adds stand in one
//! queue: an entry is worth what it changes per multiplication.

use iltm_solve::{Haar, IMAGES, Interreflection, Inverse, InverseTransport};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

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

/// Which operator an entry belongs to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Part {
    /// The operator that all channels share.
    Shared,
    /// What one channel adds to it.
    Channel(usize),
}

/// One entry of an operator in the orthonormal Haar domain.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Entry {
    /// The operator.
    pub part: Part,
    /// Output coefficient.
    pub row: usize,
    /// Input coefficient.
    pub col: usize,
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
    let mut entries = queue(inverse, &haar, &sigma);
    let judge = Judge::new(inverse, &haar, content, &coefficients);
    let all = judge.error(&entries);
    let gain_only = judge.error_as_bright_as_fits(&entries);
    let mut tiers: Vec<Tier> = Vec::new();
    for &target in targets {
        let last = tiers.last().map_or(all, |tier| tier.error);
        if last <= target {
            continue;
        }
        let tier = judge.fewest_entries(&entries, target);
        if tiers.last().is_none_or(|last| tier.entries > last.entries) {
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

/// All non-zero entries, most useful first.
fn queue(inverse: &InverseTransport, haar: &Haar, sigma: &DVector<f64>) -> Vec<Entry> {
    let mut entries = Vec::new();
    let mut add = |part: Part, operator: &Interreflection| {
        let found = operator.haar_coefficients(haar).into_iter();
        entries.extend(found.map(|coefficient| Entry {
            part,
            row: coefficient.row as usize,
            col: coefficient.col as usize,
            value: coefficient.value,
        }));
    };
    add(Part::Shared, &inverse.shared);
    for (index, channel) in inverse.channels.iter().enumerate() {
        if let Some(deviation) = &channel.deviation {
            add(Part::Channel(index), deviation);
        }
    }
    let worth = |entry: &Entry| entry.value.abs() * sigma[entry.col];
    entries.sort_by(|a, b| {
        let place = |e: &Entry| (e.row, e.col);
        worth(b)
            .total_cmp(&worth(a))
            .then_with(|| place(a).cmp(&place(b)))
    });
    entries
}

/// One value for each image.
type PerImage = [f64; IMAGES];

/// Predicts the error of leaving entries out.
struct Judge<'a> {
    channels: Vec<(f64, Inverse)>,
    haar: &'a Haar,
    content: &'a DMatrix<f64>,
    coefficients: Vec<PerImage>,
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
        Self {
            channels: channels.collect(),
            haar,
            content,
            coefficients: (0..coefficients.nrows()).map(row).collect(),
        }
    }

    /// Error when all of `left_out` are missing, all channels together.
    fn error(&self, left_out: &[Entry]) -> f64 {
        let channels = 0..self.channels.len();
        let errors: Vec<f64> = channels
            .into_par_iter()
            .map(|channel| self.error_in(channel, left_out))
            .collect();
        let squares: f64 = errors.iter().map(|error| error * error).sum();
        (squares / errors.len().max(1) as f64).sqrt()
    }

    fn error_in(&self, index: usize, left_out: &[Entry]) -> f64 {
        let light = self.missing_light(index, left_out);
        // Light that grows from bounce to bounce cannot be predicted.
        light.map_or(f64::INFINITY, |light| relative_error(&light, self.content))
    }

    /// Error when all of `left_out` are missing, each image shown as bright as suits it
    /// best: mean over the images of `min_t |t shown - wanted| / |wanted|`, all channels
    /// together.
    fn error_as_bright_as_fits(&self, left_out: &[Entry]) -> f64 {
        let channels = 0..self.channels.len();
        let missing: Option<Vec<_>> = channels
            .into_par_iter()
            .map(|channel| self.missing_light(channel, left_out))
            .collect();
        let Some(missing) = missing else {
            return f64::INFINITY;
        };
        let images = self.content.ncols();
        let of_image = |image: usize| {
            let wanted = self.content.column(image);
            let (mut both, mut own, mut whole) = (0.0, 0.0, 0.0);
            for missing in &missing {
                // What the operator does not take away is there as well.
                let shown = wanted + missing.column(image);
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

    /// What is on the wall when all of `left_out` are missing, beyond what is wanted;
    /// `None` if light grows from bounce to bounce.
    fn missing_light(&self, index: usize, left_out: &[Entry]) -> Option<DMatrix<f64>> {
        let (scale, inverse) = &self.channels[index];
        let mut missing: Vec<PerImage> = vec![[0.0; IMAGES]; self.coefficients.len()];
        for entry in left_out {
            let factor = match entry.part {
                Part::Shared => scale * entry.value,
                Part::Channel(own) if own == index => entry.value,
                Part::Channel(_) => continue,
            };
            let inputs = &self.coefficients[entry.col];
            for (missing, input) in missing[entry.row].iter_mut().zip(inputs) {
                *missing += factor * input;
            }
        }
        let missing = DMatrix::from_fn(missing.len(), IMAGES, |row, image| missing[row][image]);
        inverse.light(&self.haar.synthesise_columns(&missing))
    }

    /// The shortest front of the queue whose rest errs by at most `target`.
    fn fewest_entries(&self, entries: &[Entry], target: f64) -> Tier {
        let (mut low, mut high) = (0, entries.len());
        // Half a per cent of the entries is as fine as a tier needs to be cut.
        while high - low > 1 + high / 200 {
            let middle = usize::midpoint(low, high);
            if self.error(&entries[middle..]) <= target {
                high = middle;
            } else {
                low = middle;
            }
        }
        Tier {
            entries: high,
            error: self.error(&entries[high..]),
        }
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
