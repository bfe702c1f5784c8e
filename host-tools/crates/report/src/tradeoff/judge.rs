//! Errors of natural images, predicted and true.

use super::float_table::{FloatTable, HaarEntries};
use iltm_compile::haar_entries::HaarEntry;
use iltm_compile::ladder::relative_error;
use iltm_runtime::Grid;
use iltm_solve::{InverseTransport, natural_images, wanted_images};
use nalgebra::DMatrix;

/// Error of too much or too little `light` of a channel, all channels together as the
/// root of the mean of squares. Infinite where light does not fade.
fn error_of(
    channels: usize,
    images: &DMatrix<f64>,
    light: impl Fn(usize) -> Option<DMatrix<f64>>,
) -> f64 {
    let of_channel = |channel: usize| {
        light(channel).map_or(f64::INFINITY, |light| relative_error(&light, images))
    };
    let squares: f64 = (0..channels)
        .map(|channel| of_channel(channel).powi(2))
        .sum();
    (squares / channels.max(1) as f64).sqrt()
}

/// Natural images, cells without a gain dark.
fn images(numbers: &FloatTable<'_>) -> DMatrix<f64> {
    let mut images = natural_images(numbers.pixels());
    for (pixel, mut row) in images.row_iter_mut().enumerate() {
        if !numbers.is_lit(pixel, 0) {
            row.fill(0.0);
        }
    }
    images
}

/// Predicted error of `given` where `exact` would be right, in the scene that a table
/// describes with `scene`: one list of entries a channel.
pub(super) fn of_change(
    numbers: &FloatTable<'_>,
    scene: &[HaarEntries],
    exact: &[HaarEntries],
    given: &[HaarEntries],
) -> f64 {
    let images = images(numbers);
    error_of(numbers.channels(), &images, |channel| {
        let change = difference(&exact[channel], &given[channel]);
        let drives = numbers.bounced(&change, &images);
        numbers.light(channel, &scene[channel], &drives)
    })
}

/// Predicted error of `entries` in a scene that `inverse` describes; `white` is the
/// light of the table's reference white, camera units.
pub(super) fn of_other_grid(
    numbers: &FloatTable<'_>,
    entries: &[HaarEntries],
    inverse: &InverseTransport,
    white: f64,
) -> f64 {
    let images = images(numbers);
    error_of(numbers.channels(), &images, |channel| {
        let truth = inverse.channel(channel);
        // Drives to the projector's white, light to reference white.
        let wanted = &truth.operator * &images * white;
        let given = numbers.bounced(&entries[channel], &images);
        Some(truth.light(&(wanted - given))? / white)
    })
}

fn difference(exact: &[HaarEntry], given: &[HaarEntry]) -> HaarEntries {
    let negative = given.iter().map(|entry| HaarEntry {
        value: -entry.value,
        ..*entry
    });
    exact.iter().copied().chain(negative).collect()
}

/// The transport itself, and the light that images are wanted in.
pub(super) struct ReferenceTransport {
    pub(super) transports: Vec<DMatrix<f64>>,
    /// Light of reference white, camera units: one for all tables, so that all are asked
    /// for the same.
    pub(super) white: f64,
    pub(super) live: Vec<bool>,
    pub(super) grid: Grid,
}

impl ReferenceTransport {
    /// Mean over images and channels of `||T p - d|| / ||d||`. `white` is the table's
    /// own reference white.
    pub(super) fn error(
        &self,
        numbers: &FloatTable<'_>,
        entries: &[HaarEntries],
        white: f64,
    ) -> f64 {
        let mut wanted = wanted_images(self.grid) * self.white;
        for (mut row, _) in wanted
            .row_iter_mut()
            .zip(&self.live)
            .filter(|(_, live)| !**live)
        {
            row.fill(0.0);
        }
        let relative = &wanted / white;
        let errors = self
            .transports
            .iter()
            .enumerate()
            .map(|(channel, transport)| {
                let drives = numbers.drives(channel, &entries[channel], &relative);
                let mut light = transport * drives;
                for (mut row, _) in light
                    .row_iter_mut()
                    .zip(&self.live)
                    .filter(|(_, live)| !**live)
                {
                    row.fill(0.0);
                }
                relative_error(&(light - &wanted), &wanted)
            });
        errors.sum::<f64>() / self.transports.len().max(1) as f64
    }
}
