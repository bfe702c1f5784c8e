//! Image matching: which cell lights each camera pixel, from the light of known pictures over time
//! (temporal correlation), without any Gray code.
//!
//! Each pixel takes the cell whose light in all pictures, random patterns and images, explains the
//! pixel's best, beside a constant and the pictures' brightness, which stands for light that bounces.

use super::cell_map::{CellLabels, NO_CELL};
use super::sites::Sites;
use crate::cells::images::KnownImages;
use crate::format::error::CaptureError;
use crate::format::sequence::Sequence;
use crate::photographs::linearise::LinearPhotographs;
use crate::photographs::photo::Photo;
use crate::photographs::{Photographs, channel_sum};
use iltm_picture::progress::Progress;
use iltm_runtime::Grid;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Pixels of a cell that are compared with all cells.
const SITES_A_CELL: usize = 6;

/// Pixels that are compared with all cells, at most.
const MOST_SITES: usize = 60_000;

/// Share of a pixel's light, over the pictures, that its place must explain.
const LEAST_EXPLAINED: f32 = 0.5;

/// Cells that a pixel may be off what those around it say.
const MOST_CELLS_OFF: f32 = 2.0;

/// What the projector adds to a pixel, of what it adds under white.
pub(super) struct RelativeLight {
    dark: Vec<f32>,
    white: Vec<f32>,
}

impl RelativeLight {
    pub(super) fn new(linear: &LinearPhotographs<'_>) -> Self {
        Self {
            dark: channel_sum(&linear.black),
            white: linear.flood_light().pixels,
        }
    }

    pub(super) fn of(&self, photo: &Photo, pixel: usize) -> f32 {
        let sum: f32 = photo.planes.iter().map(|plane| plane[pixel]).sum();
        (sum - self.dark[pixel]) / self.white[pixel]
    }
}

/// Finds the cell of each pixel by random patterns and images alone.
///
/// # Errors
/// A picture's or a photograph's own error; [`CaptureError::NoLight`] if flood and black are the same.
pub(crate) fn label(
    sequence: &Sequence,
    linear: &mut LinearPhotographs<'_>,
    (images, of_images): (&KnownImages<'_>, &mut Photographs<'_>),
    progress: &dyn Progress,
) -> Result<CellLabels, CaptureError> {
    let flood = linear.enough_flood_light(sequence)?;
    let grid = sequence.grid;
    let camera = (
        linear.photographs.format.width,
        linear.photographs.format.height,
    );
    let lit: Vec<bool> = (0..flood.pixels.len()).map(|at| flood.is_lit(at)).collect();
    let count = flood.lit().len();
    let wanted = (SITES_A_CELL * grid.cells()).min(MOST_SITES);
    let side = (count as f64 / wanted as f64).sqrt().ceil().max(1.0);
    let sites = Sites::new(&lit, camera, side as usize);
    let pixels: Vec<usize> = sites.pixel.iter().flatten().copied().collect();
    let relative = RelativeLight::new(linear);
    let views = &sequence.views[sequence.bernoulli()];
    let shown = images.len();
    let mut seen = DMatrix::<f32>::zeros(views.len() + shown, pixels.len());
    let taken: usize = views.iter().map(|view| view.shots.len()).sum();
    progress.begin("matching pixels and pictures", (taken + shown) as u64);
    let photographs = &mut linear.photographs;
    for (at, view) in views.iter().enumerate() {
        let share = 1.0 / view.shots.len() as f32;
        photographs.for_batches(&view.shots, progress, |photos| {
            for (_, photo) in photos {
                for (site, pixel) in pixels.iter().enumerate() {
                    seen[(at, site)] += share * relative.of(photo, *pixel);
                }
            }
        })?;
    }
    let mut planes: Vec<Vec<Vec<f64>>> = (views.iter())
        .map(|view| vec![view.lit.iter().map(|lit| f64::from(*lit)).collect()])
        .collect();
    let all: Vec<usize> = (0..shown).collect();
    of_images.for_batches(&all, progress, |photos| {
        for (at, photo) in photos {
            for (site, pixel) in pixels.iter().enumerate() {
                seen[(views.len() + at, site)] = relative.of(photo, *pixel);
            }
        }
    })?;
    let means: Vec<_> = all.par_iter().map(|at| images.cell_means(*at)).collect();
    for means in means {
        planes.push(means?);
    }
    let matched = Matcher::new(&planes, grid).matches(&seen);
    progress.end();
    let mut found = matched.into_iter();
    let matched: Vec<Option<(u32, f32)>> = (sites.pixel.iter())
        .map(|pixel| pixel.and_then(|_| found.next().flatten()))
        .collect();
    let cols = grid.cols();
    let place = |cell: u32| [(cell as usize % cols) as f32, (cell as usize / cols) as f32];
    let mut places: Vec<Option<[f32; 2]>> = (matched.iter())
        .map(|found| found.map(|(cell, _)| place(cell)))
        .collect();
    sites.settle(&mut places, 2, MOST_CELLS_OFF);
    sites.fill(&mut places, 2);
    let square = |pixel: usize| {
        let square = sites.square_of(pixel, camera.0);
        let [col, row] = places[square].filter(|_| lit[pixel])?;
        let explained = matched[square].map_or(0.0, |(_, explained)| explained);
        Some((row as u32 * cols as u32 + col as u32, explained))
    };
    let found: Vec<Option<(u32, f32)>> = (0..lit.len()).map(square).collect();
    Ok(CellLabels {
        cell: (found.iter())
            .map(|found| found.map_or(NO_CELL, |(cell, _)| cell))
            .collect(),
        margin: (found.iter())
            .map(|found| found.map_or(0.0, |(_, explained)| explained))
            .collect(),
        light: flood.pixels,
        lit: count,
    })
}

/// All cells' light in all pictures.
struct Matcher {
    /// A constant and the pictures' brightness, orthonormal, as columns.
    common: DMatrix<f32>,
    /// Of each cell what its light spans beside them, orthonormal, as rows: all cells' brightness,
    /// then their colours.
    spans: Vec<DMatrix<f32>>,
}

impl Matcher {
    /// `planes` are the light of each cell, by picture and channel.
    fn new(planes: &[Vec<Vec<f64>>], grid: Grid) -> Self {
        let (pictures, cells) = (planes.len(), grid.cells());
        let of = |channel: usize| {
            DMatrix::from_fn(pictures, cells, |picture, cell| {
                let planes = &planes[picture];
                planes[channel.min(planes.len() - 1)][cell] as f32
            })
        };
        let colours = planes.iter().map(Vec::len).max().unwrap_or(1);
        let light: Vec<DMatrix<f32>> = (0..colours).map(of).collect();
        let share = 1.0 / colours as f32;
        let grey = light
            .iter()
            .fold(DMatrix::zeros(pictures, cells), |sum, l| sum + l * share);
        let constant = DVector::from_element(pictures, (pictures as f32).sqrt().recip());
        let brightness = grey.column_mean();
        let brightness = &brightness - &constant * constant.dot(&brightness);
        let mut common = vec![constant];
        if brightness.norm() > 1e-3 {
            common.push(brightness.normalize());
        }
        let common = DMatrix::from_columns(&common);
        let beside = |light: &DMatrix<f32>| light - &common * (common.transpose() * light);
        let grey = beside(&grey);
        let size: Vec<f32> = grey.column_iter().map(|column| column.norm()).collect();
        let mut spans: Vec<DMatrix<f32>> = Vec::new();
        // The third colour follows from brightness and the other two.
        for light in std::iter::once(&grey).chain(light.iter().take(colours - 1)) {
            let mut left = beside(light);
            for span in &spans {
                for (mut left, span) in left.column_iter_mut().zip(span.row_iter()) {
                    let along = (span * &left)[0];
                    left.axpy(-along, &span.transpose(), 1.0);
                }
            }
            for (mut left, size) in left.column_iter_mut().zip(&size) {
                let norm = left.norm();
                // Pictures without colours have none to tell cells by.
                let told = norm > 0.03 * size && *size > 0.0;
                left *= if told { norm.recip() } else { 0.0 };
            }
            spans.push(left.transpose());
        }
        Self { common, spans }
    }

    /// The cell that explains most of each column of light, and the share that it explains.
    fn matches(&self, seen: &DMatrix<f32>) -> Vec<Option<(u32, f32)>> {
        let of_columns = |first: usize| {
            let count = (seen.ncols() - first).min(256);
            let seen = seen.columns(first, count).into_owned();
            let seen = &seen - &self.common * (self.common.transpose() * &seen);
            let along: Vec<DMatrix<f32>> = self.spans.iter().map(|span| span * &seen).collect();
            let of_site = |site: usize| {
                let square = seen.column(site).norm_squared();
                let explained = |cell: usize| {
                    let squares = along.iter().map(|along| along[(cell, site)].powi(2));
                    squares.sum::<f32>() / square
                };
                let brightens = |cell: &usize| along[0][(*cell, site)] > 0.0;
                let cells = (0..along[0].nrows()).filter(brightens);
                let all = cells.map(|cell| (cell as u32, explained(cell)));
                all.max_by(|a, b| a.1.total_cmp(&b.1))
                    .filter(|(_, explained)| *explained > LEAST_EXPLAINED)
            };
            (0..count).map(of_site).collect::<Vec<_>>()
        };
        let firsts: Vec<usize> = (0..seen.ncols()).step_by(256).collect();
        firsts.into_par_iter().flat_map_iter(of_columns).collect()
    }
}
