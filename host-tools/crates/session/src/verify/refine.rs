//! Refinement: photographs of compensated images, fed back into a table's gains and black.
//!
//! What is still wrong on the wall after compensation has a part that is the same in every image:
//! so much too bright or too dark at a place, whatever is shown. That part is a wrong gain. With
//! `w` wanted and `l` photographed, relative to reference white, the gain of a sample should be
//! `1 + u` times what it is, `u = sum w (w - l) / sum w^2` over the pixels and images that show it.
//!
//! Noise, and errors that change from image to image, are no wrong gains. They are told apart by
//! finding `u` twice, from either half of the images: what both agree on is kept (a Wiener filter,
//! scale by scale and place by place, whose signal is the product of both). Then each image is held
//! against a step that was made without it; a step that would not have helped is not taken.

use super::pixels::{counted_light, cut_at_pixels, wanted_light};
use super::{Cause, Readings, VerifyError, judge, reason};
use iltm_capture::{CellPlanes, PixelReadings, PixelViews};
use iltm_compile::{FineGains, Provenance, RefinedParts, Refinement, refined_table};
use iltm_picture::Lattice;
use iltm_runtime::{FrameSize, Grid, image::Table};
use rayon::prelude::*;
use std::path::Path;

/// Images from which a step can be made and held against one that it was made without.
const LEAST_IMAGES: usize = 3;

/// Least and most of a gain's change in one round.
const MOST_CHANGE: f32 = 0.5;

/// Width of the window in which two halves are compared, of the scale's own.
const WINDOW: usize = 2;

/// A table that photographs of its images were fed back into.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The image: the table's own if no step was confirmed.
    pub image: Vec<u8>,
    /// Relative error at camera pixels without noise, before the step.
    pub before: f64,
    /// The same after it, as images that it was not made from have it.
    pub after: f64,
    /// Change of the gains, root mean square.
    pub change: f64,
    /// Size of the gain map.
    pub gains: FrameSize,
    /// Photographs that were fed back.
    pub photographs: usize,
    /// Whether the step was taken.
    pub confirmed: bool,
}

/// Feeds the photographs of a folder back into the table that it was made with.
///
/// # Errors
/// [`VerifyError::NotFine`] if the folder has no images and stripes of the projector's own pixels,
/// [`VerifyError::Map`] if its stripes tell nothing, [`VerifyError::Refused`] if gates fail or the
/// photographs differ among themselves, those of [`judge`], [`VerifyError::Compile`] if the new gains cannot be stored.
pub fn refine(
    folder: &Path,
    image: &[u8],
    table: &Table<'_>,
    readings: &Readings,
) -> Result<Refined, VerifyError> {
    if readings.fine.len() < LEAST_IMAGES {
        return Err(VerifyError::NotFine);
    }
    let pixels = match &readings.revisited.pixels {
        None => return Err(VerifyError::NotFine),
        Some(Err(error)) => return Err(VerifyError::Map(error.clone())),
        Some(Ok(pixels)) => pixels,
    };
    if let Some((cause, gate)) = super::refused(&readings.revisited) {
        return Err(VerifyError::Refused {
            cause,
            what: gate.what.clone(),
        });
    }
    let verdict = judge(folder, table, readings, None)?;
    if verdict.cause == Some(Cause::Noise) {
        return Err(VerifyError::Refused {
            cause: Cause::Noise,
            what: reason(&verdict),
        });
    }
    let own = OwnGains::new(table, pixels.factor);
    let seen = Seen::new(table, readings, pixels);
    let views = pixels
        .views
        .over([own.fine.size.width(), own.fine.size.height()]);
    let sums: Vec<Vec<Sums>> = (0..seen.images[0].len())
        .into_par_iter()
        .map(|channel| {
            let images = seen.images.iter();
            images
                .map(|image| Sums::new(&views, &image[channel]))
                .collect()
        })
        .collect();
    let all: Vec<usize> = (0..readings.fine.len()).collect();
    // Square of the error that a step without the image takes away.
    let gained: f64 = all
        .par_iter()
        .map(|left_out| {
            let others: Vec<usize> = all.iter().copied().filter(|at| at != left_out).collect();
            let channels = sums.iter().enumerate().map(|(channel, sums)| {
                let step = step(sums, &others, views.size());
                seen.images[*left_out][channel].gained(&views, &step)
            });
            channels.sum::<f64>()
        })
        .sum();
    let before = (seen.square / seen.wanted).sqrt();
    let after = ((seen.square - seen.by_black - gained).max(0.0) / seen.wanted).sqrt();
    let confirmed = gained > 0.0;
    let steps: Vec<Vec<f32>> = sums
        .par_iter()
        .map(|sums| step(sums, &all, views.size()))
        .collect();
    let photographs = readings.fine.len();
    let image = if confirmed {
        let cell_steps = own.cell_steps(&steps, table.grid());
        let live = |plane: &Vec<f64>| -> Vec<f64> {
            let cells = plane.iter().zip(&readings.live);
            cells.filter_map(|(u, live)| live.then_some(*u)).collect()
        };
        let parts = RefinedParts {
            cell_change: root_mean_square(cell_steps.iter().flat_map(live)),
            cells: own.cells_after(&cell_steps),
            fine: own.fine_after(&steps),
            ambient: seen.ambient,
            refinement: Refinement {
                date: String::new(),
                photographs,
                before,
                after,
            },
        };
        refined_table(image, &parts)?
    } else {
        image.to_vec()
    };
    Ok(Refined {
        image,
        before,
        after: if confirmed { after } else { before },
        change: if confirmed {
            root_mean_square(steps.iter().flatten().map(|u| f64::from(*u)))
        } else {
            0.0
        },
        gains: own.fine.size,
        photographs,
        confirmed,
    })
}

/// Gains as a table has them, drive per reference light.
pub(super) struct OwnGains {
    cells: CellPlanes,
    pub(super) fine: FineGains,
}

impl OwnGains {
    /// Those of `table`, as fine as it has them or with `factor` samples along a cell's sides if
    /// these are more.
    pub(super) fn new(table: &Table<'_>, factor: [usize; 2]) -> Self {
        let grid = table.grid();
        let unit = f64::from(table.gain_fraction()).exp2();
        let channels = 0..usize::from(table.channels());
        let plane = |rows: usize, row: &dyn Fn(usize) -> Vec<u16>| -> Vec<f64> {
            let bits = (0..rows).flat_map(row);
            bits.map(|gain| f64::from(gain) / unit).collect()
        };
        let of_cells = |channel| plane(grid.rows(), &|row| table.gain_row(row, channel).collect());
        let cells: CellPlanes = channels.clone().map(of_cells).collect();
        let told = FrameSize::new(
            (grid.cols() * factor[0]) as u16,
            (grid.rows() * factor[1]) as u16,
        );
        let of_fine = table.fine_gain().map(|fine| {
            let rows = fine.size().height();
            let of = |channel| plane(rows, &|row| fine.row(row, channel).collect());
            (
                fine.size(),
                channels.clone().map(of).collect::<CellPlanes>(),
            )
        });
        let (size, planes) = of_fine.unwrap_or((FrameSize::of_grid(grid), cells.clone()));
        let finer = told.filter(|told| told.pixels() > size.pixels());
        let finer = finer.and_then(|finer| Some((finer, Lattice::between(size, finer)?)));
        let fine = match finer {
            None => FineGains {
                size,
                channels: planes,
            },
            Some((size, lattice)) => {
                let expand = |plane: &Vec<f64>| lattice.expand(plane).into_iter().map(f64::from);
                FineGains {
                    size,
                    channels: planes.iter().map(|plane| expand(plane).collect()).collect(),
                }
            }
        };
        Self { cells, fine }
    }

    fn fine_after(&self, steps: &[Vec<f32>]) -> FineGains {
        let changed = |(gains, step): (&Vec<f64>, &Vec<f32>)| {
            let gains = gains.iter().zip(step);
            gains
                .map(|(gain, u)| gain * (1.0 + f64::from(*u)))
                .collect()
        };
        FineGains {
            size: self.fine.size,
            channels: self.fine.channels.iter().zip(steps).map(changed).collect(),
        }
    }

    /// Mean of what each cell's samples change by, by channel.
    fn cell_steps(&self, steps: &[Vec<f32>], grid: Grid) -> CellPlanes {
        let size = self.fine.size;
        let mean = |step: &Vec<f32>| -> Vec<f64> {
            let mut sums = vec![(0.0, 0.0); grid.cells()];
            for (at, u) in step.iter().enumerate() {
                let row = at / size.width() * grid.rows() / size.height();
                let col = at % size.width() * grid.cols() / size.width();
                let (sum, count) = &mut sums[row * grid.cols() + col];
                *sum += f64::from(*u);
                *count += 1.0;
            }
            let means = sums.into_iter();
            means
                .map(|(sum, count)| sum / f64::max(count, 1.0))
                .collect()
        };
        steps.iter().map(mean).collect()
    }

    fn cells_after(&self, steps: &CellPlanes) -> CellPlanes {
        let changed = |(gains, step): (&Vec<f64>, &Vec<f64>)| {
            let gains = gains.iter().zip(step);
            gains.map(|(gain, u)| gain * (1.0 + u)).collect()
        };
        self.cells.iter().zip(steps).map(changed).collect()
    }
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v * v, count + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

/// What is wrong at every pixel, by image and channel.
struct Seen {
    images: Vec<Vec<Residual>>,
    /// Light under black as these photographs have it, where the table counts it.
    ambient: Option<CellPlanes>,
    /// Sum of the squares of what is wrong, without noise, as photographed; how much of it that
    /// black takes away; and the sum of the squares of what was wanted.
    square: f64,
    by_black: f64,
    wanted: f64,
}

/// One image in one channel, at every pixel.
struct Residual {
    /// What was wanted; 0 where the projector's range cut what the table asked for.
    wanted: Vec<f32>,
    /// How much light is missing of it.
    missing: Vec<f32>,
}

impl Seen {
    fn new(table: &Table<'_>, readings: &Readings, pixels: &PixelReadings) -> Self {
        let mut images: Vec<Vec<Residual>> = Vec::new();
        for (at, shown) in readings.fine.iter().enumerate() {
            let of_channel = |channel: usize| {
                let mut wanted = wanted_light(pixels, shown, channel);
                let cut = cut_at_pixels(pixels, shown, channel);
                for (wanted, cut) in wanted.iter_mut().zip(cut) {
                    if cut {
                        *wanted = 0.0;
                    }
                }
                Residual {
                    wanted,
                    missing: counted_light(table, pixels, (2 * at + 1, channel)),
                }
            };
            images.push((0..table.channels().into()).map(of_channel).collect());
        }
        // Camera units of reference white.
        let (mut product, mut wanted) = (0.0, 0.0);
        for residual in images.iter().flatten() {
            for (wanted_light, seen) in residual.wanted.iter().zip(&residual.missing) {
                product += f64::from(*wanted_light) * f64::from(*seen);
                wanted += f64::from(*wanted_light).powi(2);
            }
        }
        let white = (product / wanted).max(f64::MIN_POSITIVE);
        let mut square = 0.0;
        for image in &mut images {
            for (residual, noise) in image.iter_mut().zip(&readings.revisited.noise) {
                for (missing, wanted) in residual.missing.iter_mut().zip(&residual.wanted) {
                    let seen = f64::from(*missing);
                    let known = f64::from(u8::from(*wanted > 0.0));
                    let off = known * (f64::from(*wanted) - seen / white);
                    square += off * off - known * noise.variance(seen) / white.powi(2);
                    *missing = off as f32;
                }
            }
        }
        let (mut ambient, mut by_black) = (None, 0.0);
        if !Provenance::read(table.provenance()).ambient_kept {
            let expected = super::Expected::new(table);
            let own = expected.ambient();
            let now = black(readings, own, white);
            by_black = take_black(&mut images, pixels, table, (&now, own)).max(0.0);
            ambient = (by_black > 0.0).then_some(now);
        }
        Self {
            images,
            ambient,
            square: square.max(0.0),
            by_black,
            wanted,
        }
    }
}

/// Light under black in the cells, relative to reference white.
fn black(readings: &Readings, own: &CellPlanes, white: f64) -> CellPlanes {
    let channels = readings.revisited.black.iter().zip(own);
    let of_channel = |(now, own): (&Vec<f64>, &Vec<f64>)| {
        let cells = now.iter().zip(own).zip(&readings.live);
        cells
            .map(|((now, own), live)| {
                if *live {
                    (now / white).clamp(0.0, 1.0)
                } else {
                    *own
                }
            })
            .collect()
    };
    channels.map(of_channel).collect()
}

/// Counts another black than the table did, if images then show less error; by how much their
/// squares fall.
fn take_black(
    images: &mut [Vec<Residual>],
    pixels: &PixelReadings,
    table: &Table<'_>,
    (now, own): (&CellPlanes, &CellPlanes),
) -> f64 {
    let grid = table.grid();
    let cells = pixels.views.over([grid.cols(), grid.rows()]);
    let change = |channel: usize| -> Vec<f32> {
        let planes = now[channel].iter().zip(&own[channel]);
        let off: Vec<f32> = planes.map(|(now, own)| (now - own) as f32).collect();
        let at = |view| cells.seen(view).map(|(at, share)| share * off[at]).sum();
        cells.pixels().iter().map(at).collect()
    };
    let changes: Vec<Vec<f32>> = (0..now.len()).map(change).collect();
    let mut taken = 0.0;
    for image in images.iter() {
        for (residual, change) in image.iter().zip(&changes) {
            for ((missing, wanted), change) in
                residual.missing.iter().zip(&residual.wanted).zip(change)
            {
                if *wanted > 0.0 {
                    // More black counted is as much less projected.
                    let after = f64::from(missing + change);
                    taken += f64::from(*missing).powi(2) - after.powi(2);
                }
            }
        }
    }
    if taken > 0.0 {
        for image in images.iter_mut() {
            for (residual, change) in image.iter_mut().zip(&changes) {
                for ((missing, wanted), change) in residual
                    .missing
                    .iter_mut()
                    .zip(&residual.wanted)
                    .zip(change)
                {
                    if *wanted > 0.0 {
                        *missing += change;
                    }
                }
            }
        }
    }
    taken
}

impl Residual {
    /// Square of what is wrong that a step would take away.
    fn gained(&self, views: &PixelViews, step: &[f32]) -> f64 {
        let pixels = views
            .pixels()
            .iter()
            .zip(self.wanted.iter().zip(&self.missing));
        let of_pixel = |(view, (wanted, missing)): (_, (&f32, &f32))| {
            let u: f32 = views.seen(view).map(|(at, share)| share * step[at]).sum();
            let after = missing - u * wanted;
            f64::from(*missing).powi(2) - f64::from(after).powi(2)
        };
        pixels.map(of_pixel).sum()
    }
}

/// `sum w^2` and `sum w (w - l)` of each sample, over the pixels that see it.
#[derive(Clone)]
struct Sums {
    weight: Vec<f32>,
    missing: Vec<f32>,
}

impl Sums {
    fn new(views: &PixelViews, image: &Residual) -> Self {
        let mut weight = vec![0.0; views.samples()];
        let mut missing = vec![0.0; views.samples()];
        let pixels = views
            .pixels()
            .iter()
            .zip(image.wanted.iter().zip(&image.missing));
        for (view, (wanted, off)) in pixels {
            for (at, share) in views.seen(view) {
                weight[at] += share * wanted * wanted;
                missing[at] += share * wanted * off;
            }
        }
        Self { weight, missing }
    }

    fn of<'s>(sums: impl Iterator<Item = &'s Self>, samples: usize) -> Self {
        let mut all = Self {
            weight: vec![0.0; samples],
            missing: vec![0.0; samples],
        };
        for own in sums {
            let add = |to: &mut Vec<f32>, from: &[f32]| {
                to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
            };
            add(&mut all.weight, &own.weight);
            add(&mut all.missing, &own.missing);
        }
        all
    }

    /// Their ratio over squares of `2 reach + 1` samples; `coarser` where nothing is known.
    fn over(&self, width: usize, reach: usize, coarser: &[f32]) -> Vec<f32> {
        let weight = boxed(&self.weight, width, reach);
        let missing = boxed(&self.missing, width, reach);
        let pairs = missing.iter().zip(&weight).zip(coarser);
        pairs
            .map(|((missing, weight), coarser)| {
                if *weight > LEAST_WEIGHT {
                    missing / weight
                } else {
                    *coarser
                }
            })
            .collect()
    }
}

/// Sum of `w^2` below which a sample is not known.
const LEAST_WEIGHT: f32 = 1e-4;

/// What both halves of these images agree on, of every sample.
fn step(sums: &[Sums], images: &[usize], [width, height]: [usize; 2]) -> Vec<f32> {
    let samples = width * height;
    let half = |parity: usize| {
        let own = images.iter().skip(parity).step_by(2);
        Sums::of(own.map(|at| &sums[*at]), samples)
    };
    let halves = [half(0), half(1)];
    let both = Sums::of(halves.iter(), samples);
    // Weight of a sample where the halves are compared.
    let compared: Vec<f32> = (halves[0].weight.iter().zip(&halves[1].weight))
        .map(|(a, b)| if a.min(*b) > LEAST_WEIGHT { a + b } else { 0.0 })
        .collect();
    let mut reaches = vec![0];
    while let Some(last) = reaches
        .last()
        .filter(|last| 2 * **last + 1 < width.max(height))
    {
        reaches.push(2 * last + 1);
    }
    let mut coarser = [(); 3].map(|()| vec![0.0; samples]);
    let mut step = vec![0.0; samples];
    for reach in reaches.into_iter().rev() {
        let [first, second, own] = [&halves[0], &halves[1], &both];
        let level = [
            first.over(width, reach, &coarser[0]),
            second.over(width, reach, &coarser[1]),
            own.over(width, reach, &coarser[2]),
        ];
        let band = |at: usize, k: usize| level[k][at] - coarser[k][at];
        let product = |a: usize, b: usize| -> Vec<f32> {
            let of = |at: usize| band(at, a) * band(at, b) * compared[at];
            let products: Vec<f32> = (0..samples).map(of).collect();
            boxed(&products, width, WINDOW * (2 * reach + 1) / 2)
        };
        let (agreed, found) = (product(0, 1), product(2, 2));
        for (at, step) in step.iter_mut().enumerate() {
            if found[at] > 0.0 {
                *step += (agreed[at] / found[at]).clamp(0.0, 1.0) * band(at, 2);
            }
        }
        coarser = level;
    }
    for u in &mut step {
        *u = u.clamp(-MOST_CHANGE, MOST_CHANGE);
    }
    step
}

/// Sums over squares of `2 reach + 1` values, as much of them as is there.
fn boxed(values: &[f32], width: usize, reach: usize) -> Vec<f32> {
    if reach == 0 {
        return values.to_vec();
    }
    let height = values.len() / width;
    let mut rows = vec![0.0_f64; values.len()];
    for (row, sums) in values.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        let mut sum: f64 = row.iter().take(reach).map(|v| f64::from(*v)).sum();
        for (at, out) in sums.iter_mut().enumerate() {
            sum += row.get(at + reach).map_or(0.0, |v| f64::from(*v));
            if let Some(left) = at.checked_sub(reach + 1) {
                sum -= f64::from(row[left]);
            }
            *out = sum;
        }
    }
    let mut sums = vec![0.0_f64; width];
    let row = |y: usize| rows.get(y * width..(y + 1) * width);
    for y in 0..reach.min(height) {
        let line = row(y).unwrap_or_default();
        sums.iter_mut().zip(line).for_each(|(sum, v)| *sum += v);
    }
    let mut out = Vec::with_capacity(values.len());
    for y in 0..height {
        let below = row(y + reach).unwrap_or_default();
        sums.iter_mut().zip(below).for_each(|(sum, v)| *sum += v);
        if let Some(above) = y.checked_sub(reach + 1).and_then(row) {
            sums.iter_mut().zip(above).for_each(|(sum, v)| *sum -= v);
        }
        out.extend(sums.iter().map(|sum| *sum as f32));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_sums_what_is_within_reach_and_inside() {
        let values: Vec<f32> = (1..=12_u8).map(f32::from).collect();
        assert_eq!(boxed(&values, 4, 0), values);
        let at = |reach: usize, at: usize| boxed(&values, 4, reach)[at].round() as u32;
        assert_eq!(at(1, 0), 1 + 2 + 5 + 6);
        assert_eq!(at(1, 5), 1 + 2 + 3 + 5 + 6 + 7 + 9 + 10 + 11);
        assert_eq!(at(1, 11), 7 + 8 + 11 + 12);
        // A reach beyond every edge sums all.
        assert!((0..12).all(|place| at(9, place) == 78));
    }

    /// Sums of images of even light that miss `off` of it, with noise.
    fn images(width: usize, off: impl Fn(usize) -> f32, noise: f32, seed: u64) -> Vec<Sums> {
        let mut random = fastrand::Rng::with_seed(seed);
        let image = |_| Sums {
            weight: vec![1.0; width * width],
            missing: (0..width * width)
                .map(|at| off(at) + noise * (random.f32() + random.f32() - 1.0))
                .collect(),
        };
        (0..4).map(image).collect()
    }

    fn square(values: impl Iterator<Item = f32>) -> f64 {
        values.map(|v| f64::from(v).powi(2)).sum()
    }

    #[test]
    fn what_all_images_agree_on_is_found_and_noise_is_not() {
        let width = 48;
        // A line a sample wide, on one that is broad.
        let off = |at: usize| match at % width {
            20 => 0.1,
            col if col > 30 => -0.02,
            _ => 0.0,
        };
        let sums = images(width, off, 0.02, 1);
        let found = step(&sums, &[0, 1, 2, 3], [width, width]);
        let left = square((0..found.len()).map(|at| found[at] - off(at)));
        assert!(left < 0.1 * square((0..found.len()).map(off)), "{left}");
        let line = (0..width).map(|row| found[row * width + 20]).sum::<f32>() / width as f32;
        assert!((line - 0.1).abs() < 0.02, "{line}");

        let noise = images(width, |_| 0.0, 0.02, 2);
        let found = step(&noise, &[0, 1, 2, 3], [width, width]);
        let mean = Sums::of(noise.iter(), width * width);
        let own = square(mean.missing.iter().map(|sum| sum / 4.0));
        assert!(square(found.into_iter()) < 0.25 * own);
    }

    #[test]
    fn a_sample_that_no_pixel_sees_changes_as_its_neighbours_do() {
        let width = 16;
        let mut sums = images(width, |_| 0.05, 0.0, 3);
        for image in &mut sums {
            (image.weight[100], image.missing[100]) = (0.0, 0.0);
        }
        let found = step(&sums, &[0, 1, 2], [width, width]);
        assert!((found[100] - 0.05).abs() < 0.005, "{}", found[100]);
    }
}
