//! Near field: bounced light that differs within a patch. Beside a fold, a neighbour's light
//! falls off over less than a cell.
//!
//! A patch has one irradiance, the mean. What a point of it gets from patches nearby
//! differs from that mean by `F(point, q) - F_pq` of their light, and both are known
//! in closed form.

use super::form_factor::{Sampled, Tolerance, from_point, sampled_in_front};
use super::geometry::{Obstacles, Polygon};
use super::patches::Patch;
use nalgebra::Vector3;
use rayon::prelude::*;

/// How far nearby reaches, in sides of the larger patch: as far as the work allows,
/// at least 4. Beyond, what a patch gets from another varies by a few percent over
/// it, and evenly.
const REACHES: [f64; 4] = [f64::INFINITY, 16.0, 8.0, 4.0];
/// Neighbours of all pixels together that are worth their memory.
const MOST_ENTRIES: f64 = 8e6;

/// For each patch, those nearby that light it.
#[derive(Clone, Debug)]
pub(crate) struct NearField {
    near: Vec<Vec<(u32, f64)>>,
}

impl NearField {
    /// Looks for neighbours that exchange light, for a camera of so many pixels; with
    /// `obstacles`, only for those with a free view of each other.
    pub(crate) fn new(patches: &[Patch], obstacles: Option<&Obstacles>, pixels: usize) -> Self {
        // All pairs of many patches are too many to try.
        let reaches = &REACHES[usize::from(patches.len() > 2_000)..];
        let pairs = exchanging(reaches[0], patches, obstacles);
        let entries = |reach: f64| {
            let within = pairs.iter().flatten().filter(|pair| pair.apart < reach);
            2.0 * within.count() as f64 * pixels as f64 / patches.len() as f64
        };
        let narrow = REACHES[REACHES.len() - 1];
        let fits = reaches
            .iter()
            .find(|reach| entries(**reach) <= MOST_ENTRIES);
        let reach = *fits.unwrap_or(&narrow);
        let mut near = vec![Vec::new(); patches.len()];
        for (patch, pairs) in pairs.iter().enumerate() {
            for pair in pairs.iter().filter(|pair| pair.apart < reach) {
                for (here, there) in [(patch, pair.other), (pair.other, patch)] {
                    near[here].push((there as u32, pair.area / patches[here].polygon.area()));
                }
            }
        }
        Self { near }
    }

    /// Calls `each` with the patches whose light a point of `patch` gets more or less
    /// of than the patch's mean, and by how much.
    pub(crate) fn at(
        &self,
        patches: &[Patch],
        patch: usize,
        world: &Vector3<f64>,
        mut each: impl FnMut(u32, f64),
    ) {
        let normal = patches[patch].polygon.normal();
        for (other, mean) in &self.near[patch] {
            let here = from_point(world, &normal, &patches[*other as usize].polygon);
            each(*other, here - mean);
        }
    }

    /// Largest difference between a point's irradiance and its patch's, for the
    /// light that leaves each patch: near the corners, where it is largest.
    pub(crate) fn largest(&self, patches: &[Patch], leaving: &[f64]) -> f64 {
        let of = |patch: usize| {
            let polygon = &patches[patch].polygon;
            let centre = polygon.centroid();
            let places = polygon.corners().iter().map(|c| c + 0.2 * (centre - c));
            let difference = |world: Vector3<f64>| {
                let mut sum = 0.0;
                self.at(patches, patch, &world, |other, more| {
                    sum += more * leaving[other as usize];
                });
                sum.abs()
            };
            places.map(difference).fold(0.0, f64::max)
        };
        (0..patches.len())
            .into_par_iter()
            .map(of)
            .reduce(|| 0.0, f64::max)
    }

    /// Pairs of neighbours.
    pub(crate) fn pairs(&self) -> usize {
        self.near.iter().map(Vec::len).sum()
    }
}

/// Two patches that light each other.
struct ExchangingPair {
    other: usize,
    /// Between their centres, in sides of the larger one.
    apart: f64,
    /// Exchange area, m^2.
    area: f64,
}

/// For each patch, those after it that it exchanges light with, up to so far away; with `obstacles`,
/// only those with a free view of each other.
fn exchanging(
    reach: f64,
    patches: &[Patch],
    obstacles: Option<&Obstacles>,
) -> Vec<Vec<ExchangingPair>> {
    let sampled: Vec<_> = patches
        .iter()
        .map(|patch| Sampled::new(patch.polygon.clone()))
        .collect();
    let centres: Vec<_> = patches.iter().map(|p| p.polygon.centroid()).collect();
    let sides: Vec<_> = patches.iter().map(|p| p.polygon.area().sqrt()).collect();
    let pair = |patch: usize, other: usize| {
        let apart = (centres[other] - centres[patch]).norm() / sides[patch].max(sides[other]);
        if patches[other].facet == patches[patch].facet || apart >= reach {
            return None;
        }
        let (here, there) = sampled_in_front(&sampled[patch], &sampled[other])?;
        let area = here.exchange_area(&there, Tolerance::default());
        let open = |o| open(&patches[patch].polygon, &patches[other].polygon, o);
        let exchanges = area > 0.0 && obstacles.is_none_or(open);
        exchanges.then_some(ExchangingPair { other, apart, area })
    };
    (0..patches.len())
        .into_par_iter()
        .map(|patch| {
            let later = patch + 1..patches.len();
            later.filter_map(|other| pair(patch, other)).collect()
        })
        .collect()
}

/// Whether nothing stands between two polygons, as far as their centres and the
/// corners of each, seen from the other's centre, tell.
fn open(a: &Polygon, b: &Polygon, obstacles: &Obstacles) -> bool {
    let centres = (a.centroid(), b.centroid());
    let seen = |from: &Vector3<f64>, polygon: &Polygon| {
        let centre = polygon.centroid();
        let mut inside = polygon.corners().iter().map(|c| c + 0.05 * (centre - c));
        inside.all(|corner| !obstacles.blocked(from, &corner))
    };
    !obstacles.blocked(&centres.0, &centres.1) && seen(&centres.0, b) && seen(&centres.1, a)
}
