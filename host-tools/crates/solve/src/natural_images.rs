//! Natural images as dead leaves: what video looks like, to choose and judge tiers by.
//!
//! Dead leaves are opaque discs over each other with radii of density `r^-3`, which
//! give the scale invariance, edges and power spectrum of natural images (Lee,
//! Mumford and Huang, *Occlusion models for natural images*, 2001). The seed is
//! fixed, so a table comes out the same every time.

use iltm_runtime::{Grid, pipeline::srgb};
use nalgebra::DMatrix;

/// Images in a set.
pub const IMAGES: usize = 16;

/// Samples along each side of a cell.
pub const SUPERSAMPLING: usize = 4;

/// Discs an image; enough that no part of it stays bare.
const DISCS: usize = 1_500;

/// Smallest radius, in units of the image's longer side.
const LEAST_RADIUS: f64 = 0.004;

/// Largest radius, likewise.
const MOST_RADIUS: f64 = 0.4;

/// Linear light of natural-looking images, `N x IMAGES`, 0 to 1.
#[must_use]
pub fn natural_images(grid: Grid) -> DMatrix<f64> {
    let mut images = DMatrix::zeros(grid.cells(), IMAGES);
    for (mut image, fine) in images.column_iter_mut().zip(fine_natural_images(grid)) {
        let width = grid.cols() * SUPERSAMPLING;
        for (index, light) in fine.iter().enumerate() {
            let (row, col) = (index / width / SUPERSAMPLING, index % width / SUPERSAMPLING);
            image[row * grid.cols() + col] += light / (SUPERSAMPLING * SUPERSAMPLING) as f64;
        }
    }
    images
}

/// The same images with [`SUPERSAMPLING`] times the grid's rows and columns, row by row.
pub fn fine_natural_images(grid: Grid) -> impl Iterator<Item = Vec<f64>> {
    let mut random = fastrand::Rng::with_seed(0x1E4F);
    (0..IMAGES).map(move |_| dead_leaves(grid, &mut random))
}

/// Darkest light of [`wanted_images`], of white: walls that light each other cannot be
/// black beside white.
pub const DARKEST_WANTED: f64 = 0.2;

/// The same of an image that is only shown, where a little clipping does not matter.
pub const DARKEST_SHOWN: f64 = 0.1;

/// Natural images that a scene with interreflection can show, `N x IMAGES`, linear light
/// from [`DARKEST_WANTED`] to 1.
#[must_use]
pub fn wanted_images(grid: Grid) -> DMatrix<f64> {
    natural_images(grid).map(|light| DARKEST_WANTED + (1.0 - DARKEST_WANTED) * light)
}

/// One image, row by row, `SUPERSAMPLING` times finer than the grid.
fn dead_leaves(grid: Grid, random: &mut fastrand::Rng) -> Vec<f64> {
    let (height, width) = (grid.rows() * SUPERSAMPLING, grid.cols() * SUPERSAMPLING);
    let longer = height.max(width) as f64;
    let code = |random: &mut fastrand::Rng| srgb::decode(random.u8(..)).to_num::<f64>();
    let background = code(random);
    let mut image = vec![background; height * width];
    for _ in 0..DISCS {
        // Radii of density r^-3 by the inverse of their distribution.
        let (least, most) = (LEAST_RADIUS.powi(-2), MOST_RADIUS.powi(-2));
        let radius = longer / (least + random.f64() * (most - least)).sqrt();
        let (row, col) = (random.f64() * height as f64, random.f64() * width as f64);
        let light = code(random);
        let clip = |value: f64, limit: usize| (value.max(0.0) as usize).min(limit);
        for y in clip(row - radius, height)..clip(row + radius + 1.0, height) {
            for x in clip(col - radius, width)..clip(col + radius + 1.0, width) {
                let (dy, dx) = (y as f64 + 0.5 - row, x as f64 + 0.5 - col);
                if dy * dy + dx * dx <= radius * radius {
                    image[y * width + x] = light;
                }
            }
        }
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_repeatable_and_span_the_range_of_light() {
        let grid = Grid::new(13, 21).expect("a small grid");
        let images = natural_images(grid);
        assert_eq!(images, natural_images(grid));
        assert!(images.iter().all(|light| (0.0..=1.0).contains(light)));
        for image in images.column_iter() {
            let mean = image.mean();
            assert!((0.05..0.95).contains(&mean), "mean {mean}");
            assert!(image.variance().sqrt() > 0.05);
        }
    }
}
