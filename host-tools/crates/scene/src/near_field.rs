//! Near field: bounced light that differs within a patch. Beside a fold, a neighbour's light
//! falls off over less than a cell.
//!
//! A patch has one irradiance, the mean. What a point of it gets from patches nearby
//! differs from that mean by `F(point, q) - F_pq` of their light, and both are known
//! in closed form.

use super::form_factor::{Tolerance, exchange_area, from_point};
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
        let entries = |near: &Self| near.pairs() as f64 * pixels as f64 / patches.len() as f64;
        let wide = REACHES.iter().take(REACHES.len() - 1).filter(|reach| {
            // All pairs of many patches are too many to try.
            reach.is_finite() || patches.len() <= 2_000
        });
        wide.map(|reach| Self::within(*reach, patches, obstacles))
            .find(|near| entries(near) <= MOST_ENTRIES)
            .unwrap_or_else(|| Self::within(REACHES[REACHES.len() - 1], patches, obstacles))
    }

    fn within(reach: f64, patches: &[Patch], obstacles: Option<&Obstacles>) -> Self {
        let centres: Vec<_> = patches.iter().map(|p| p.polygon.centroid()).collect();
        let sides: Vec<_> = patches.iter().map(|p| p.polygon.area().sqrt()).collect();
        let near = |patch: usize| {
            let close = |other: &usize| {
                patches[*other].facet != patches[patch].facet
                    && (centres[*other] - centres[patch]).norm()
                        < reach * sides[patch].max(sides[*other])
            };
            let here = &patches[patch].polygon;
            let factor = |other: usize| {
                let there = &patches[other].polygon;
                let factor = exchange_area(here, there, Tolerance::default()) / here.area();
                let seen = factor > 0.0 && obstacles.is_none_or(|o| open(here, there, o));
                seen.then_some((other as u32, factor))
            };
            (0..patches.len())
                .filter(close)
                .filter_map(factor)
                .collect()
        };
        Self {
            near: (0..patches.len()).into_par_iter().map(near).collect(),
        }
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
