//! Specular reflection: light that mirrors and glossy lobes bring from one patch to another.
//!
//! Between two diffuse reflections light is followed over any number of mirrors, or
//! over one lobe. Light over two lobes in a row, or over a lobe and a mirror, is left
//! out: it is the product of two reflectances, spread out.

use super::description::Gloss;
use super::facets::Facets;
use super::form_factor::facing;
use super::patches::{Patch, Patches, samples};
use super::projector_light::ProjectorLight;
use super::radiosity::FormFactorMatrix;
use super::sparse::{SparseRows, merge};
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Samples along a mirror's side, as seen from a patch.
const MIRROR_SAMPLES: usize = 24;
/// Rays along a cell's side that are followed over mirrors.
const CELL_RAYS: usize = 8;
/// Mirrors in a row that are followed at most.
const MOST_MIRRORS: usize = 16;
/// Shares of light that are not worth an entry.
const LEAST: f64 = 1e-7;
/// Products of patches that a glossy scene may ask for: about a minute's work.
const MOST_PRODUCTS: usize = 2_000_000_000;

/// For each patch, where light comes from and how much.
type Entries = Vec<Vec<(u32, f64)>>;

/// Light by mirrors and lobes.
#[derive(Clone, Debug)]
pub(crate) struct Specular {
    /// Irradiance of patches by light that leaves patches, patches x patches.
    pub from_patches: SparseRows,
    /// Irradiance of patches by the projector, patches x cells.
    pub from_cells: SparseRows,
}

/// More glossy patches than can be simulated.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "{glossy} glossy patches among {patches} would take {}e9 products; at most {}e9 are made",
    glossy * patches / 1_000 * patches / 1_000_000,
    MOST_PRODUCTS / 1_000_000_000
)]
pub struct TooGlossy {
    /// Patches of glossy panels.
    pub glossy: usize,
    /// All patches.
    pub patches: usize,
}

/// The scene as the computation needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surfaces<'s> {
    /// Its facets.
    pub facets: &'s Facets<'s>,
    /// Its patches.
    pub patches: &'s Patches,
    /// The projector's light.
    pub light: &'s ProjectorLight<'s>,
    /// Irradiance of patches by cells, straight.
    pub on_patches: &'s SparseRows,
}

impl Specular {
    /// Follows light over mirrors if `mirrors`, over lobes if there is an `exchange`
    /// for them.
    ///
    /// # Errors
    /// [`TooGlossy`] if it would take too long.
    pub(crate) fn new(
        surfaces: Surfaces<'_>,
        mirrors: bool,
        lobes: Option<&FormFactorMatrix>,
    ) -> Result<Self, TooGlossy> {
        let count = surfaces.patches.all().len();
        let mut by_patches = vec![Vec::new(); count];
        let mut by_cells = vec![Vec::new(); count];
        if mirrors {
            by_patches = surfaces.over_mirrors();
            by_cells = surfaces.projector_over_mirrors();
        }
        if let Some(exchange) = lobes {
            let (patches, cells) = surfaces.over_lobes(exchange)?;
            for (all, more) in by_patches.iter_mut().zip(patches) {
                all.extend(more);
            }
            for (all, more) in by_cells.iter_mut().zip(cells) {
                all.extend(more);
            }
        }
        Ok(Self {
            from_patches: SparseRows::from_rows(by_patches.into_iter().map(merged)),
            from_cells: SparseRows::from_rows(by_cells.into_iter().map(merged)),
        })
    }
}

impl Surfaces<'_> {
    /// What each patch gets from others over mirrors.
    fn over_mirrors(&self) -> Entries {
        let mirrors: Vec<usize> = (0..self.facets.count())
            .filter(|facet| self.mirror(*facet) > 0.0)
            .collect();
        let of = |patch: &Patch| {
            let mut entries = Vec::new();
            for mirror in &mirrors {
                self.over_mirror(patch, *mirror, &mut entries);
            }
            entries
        };
        self.patches.all().par_iter().map(of).collect()
    }

    fn over_mirror(&self, patch: &Patch, mirror: usize, entries: &mut Vec<(u32, f64)>) {
        let polygon = self.facets.polygon(mirror);
        if patch.facet == mirror || !facing(&patch.polygon, polygon) {
            return;
        }
        let Some(seen) = polygon.clipped(patch.polygon.plane()) else {
            return;
        };
        let (place, normal) = (patch.polygon.centroid(), patch.polygon.normal());
        for (on_mirror, area) in samples(&seen, MIRROR_SAMPLES) {
            let way = on_mirror - place;
            let (here, there) = (normal.dot(&way), -polygon.normal().dot(&way));
            if here <= 0.0 || there <= 0.0 || self.facets.obstacles().blocked(&place, &on_mirror) {
                continue;
            }
            let share = here * there * area / (PI * way.norm_squared().powi(2));
            if let Some((other, kept)) = self.follow(on_mirror, way, mirror) {
                entries.push((other as u32, share * kept));
            }
        }
    }

    /// What each patch gets from the projector over mirrors.
    fn projector_over_mirrors(&self) -> Entries {
        let projector = self.facets.projector();
        let (view, grid) = (&projector.view, projector.grid);
        let rays = (grid.cols() * CELL_RAYS, grid.rows() * CELL_RAYS);
        // Each ray stands for a part of the frame, and for the flux through it.
        let flux = view.frame_area() * view.focus().powi(2) / (rays.0 * rays.1) as f64;
        let along = |k: usize, count: usize| (k as f64 + 0.5) / count as f64;
        let mut entries = vec![Vec::new(); self.patches.all().len()];
        for ray in 0..rays.0 * rays.1 {
            let (across, down) = (along(ray % rays.0, rays.0), along(ray / rays.0, rays.1));
            let way = view.ray(across, down);
            let obstacles = self.facets.obstacles();
            let Some(hit) = obstacles.first_hit(&view.position(), &way, 0.0) else {
                continue;
            };
            let on_mirror = view.position() + hit.along * way;
            let front = self.facets.polygon(hit.facet).normal().dot(&way) < 0.0;
            if !front || self.mirror(hit.facet) == 0.0 {
                continue;
            }
            let Some((patch, kept)) = self.follow(on_mirror, way, hit.facet) else {
                continue;
            };
            let Some(place) = view.place(&on_mirror) else {
                continue;
            };
            let light =
                flux * kept * self.light.vignette(place) / self.patches.all()[patch].polygon.area();
            self.light.cells(place, |cell, share| {
                entries[patch].push((cell, share * light));
            });
        }
        entries
    }

    /// Follows light from a mirror to the patch where it ends: which, and how much
    /// arrives. A mirror's own patch is such an end for what it does not mirror.
    fn follow(
        &self,
        mut origin: Vector3<f64>,
        mut way: Vector3<f64>,
        mut mirror: usize,
    ) -> Option<(usize, f64)> {
        let view = &self.facets.projector().view;
        let mut kept = 1.0;
        for _ in 0..MOST_MIRRORS {
            kept *= self.mirror(mirror);
            let normal = self.facets.polygon(mirror).normal();
            way -= 2.0 * way.dot(&normal) * normal;
            let obstacles = self.facets.obstacles();
            let hit = obstacles.first_hit(&origin, &way, 1e-9 / way.norm())?;
            origin += hit.along * way;
            let back = self.facets.polygon(hit.facet).normal().dot(&way) > 0.0;
            if back || self.mirror(hit.facet) == 0.0 {
                let patch = self.patches.at(view, hit.facet, back, &origin, None)?;
                return Some((patch, kept));
            }
            mirror = hit.facet;
        }
        None
    }

    /// What each patch gets from others, and from cells, over one lobe.
    fn over_lobes(&self, exchange: &FormFactorMatrix) -> Result<(Entries, Entries), TooGlossy> {
        let patches = self.patches.all();
        let glossy: Vec<(usize, Gloss)> = patches
            .iter()
            .enumerate()
            .filter_map(|(at, patch)| Some((at, self.gloss(patch)?)))
            .collect();
        if glossy.len() * patches.len() > MOST_PRODUCTS / patches.len().max(1) {
            return Err(TooGlossy {
                glossy: glossy.len(),
                patches: patches.len(),
            });
        }
        // What each patch gets of a glossy patch's light, patches x glossy patches; the
        // other way round it is the same but for the areas.
        let shining = DMatrix::from_fn(patches.len(), glossy.len(), |patch, k| {
            f64::from(u8::from(glossy[k].0 == patch))
        });
        let factors = exchange.irradiance(&shining);
        let area = |patch: usize| patches[patch].polygon.area();
        let centres: Vec<_> = patches.iter().map(|p| p.polygon.centroid()).collect();
        let projector = self.facets.projector().view.position();
        let to = |to: usize| {
            let (mut by_patches, mut by_cells) = (vec![0.0; patches.len()], Vec::new());
            for (k, (at, gloss)) in glossy.iter().enumerate() {
                let there = factors[(to, k)];
                if there == 0.0 {
                    continue;
                }
                let lobe = Lobe {
                    gloss: *gloss,
                    centre: centres[*at],
                    normal: patches[*at].polygon.normal(),
                };
                let towards = lobe.towards(&patches[to]);
                let shine = lobe.send(&towards, projector - centres[*at], 0.0);
                for (cell, light) in self.on_patches.row(*at) {
                    by_cells.push((*cell, there * shine * f64::from(*light)));
                }
                for (from, sum) in by_patches.iter_mut().enumerate() {
                    let here = factors[(from, k)] * area(from) / area(*at);
                    if here > 0.0 {
                        let wide = lobe.spread(&patches[from]);
                        *sum +=
                            there * here * lobe.send(&towards, centres[from] - centres[*at], wide);
                    }
                }
            }
            let entries = (0_u32..)
                .zip(by_patches)
                .filter(|(_, share)| *share > LEAST);
            (entries.collect::<Vec<_>>(), by_cells)
        };
        Ok((0..patches.len()).into_par_iter().map(to).unzip())
    }

    fn mirror(&self, facet: usize) -> f64 {
        self.facets.scene().panels[self.facets.panel(facet)].mirror
    }

    fn gloss(&self, patch: &Patch) -> Option<Gloss> {
        let gloss = self.facets.scene().panels[self.facets.panel(patch.facet)].gloss;
        gloss.filter(|_| !patch.back)
    }
}

/// A glossy patch.
struct Lobe {
    gloss: Gloss,
    centre: Vector3<f64>,
    normal: Vector3<f64>,
}

/// A direction and the square of the angle that a patch spans there.
struct Towards {
    way: Vector3<f64>,
    spread: f64,
}

impl Lobe {
    fn towards(&self, patch: &Patch) -> Towards {
        Towards {
            way: (patch.polygon.centroid() - self.centre).normalize(),
            spread: self.spread(patch),
        }
    }

    /// Square of the angle that a patch spans, seen from here.
    fn spread(&self, patch: &Patch) -> f64 {
        patch.polygon.area() / (PI * (patch.polygon.centroid() - self.centre).norm_squared())
    }

    /// Part of the light from one place that goes on to another. A lobe narrower than
    /// the patches is widened to them: it is their mean that is wanted.
    fn send(&self, towards: &Towards, from: Vector3<f64>, spread: f64) -> f64 {
        let exponent = 1.0 / (1.0 / self.gloss.exponent + f64::midpoint(towards.spread, spread));
        let widened = Gloss {
            exponent,
            ..self.gloss
        };
        widened.towards(&self.normal, &from.normalize(), &towards.way)
    }
}

/// Adds up entries of the same index, without those that are not worth one.
fn merged(mut entries: Vec<(u32, f64)>) -> Vec<(u32, f64)> {
    merge(&mut entries, |sum, more| *sum += more);
    entries.retain(|(_, share)| *share > LEAST);
    entries
}
