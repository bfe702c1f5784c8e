//! Camera sampling: what each pixel sees, how much of it is light straight from which cell,
//! and how much is light that patches get from elsewhere.
//!
//! Both are linear in the projected pattern, so they are found once, by rays
//! through the pixel, and every photograph is a product with them.

use super::description::{Gloss, Panel};
use super::facets::Facets;
use super::form_factor::from_point;
use super::near_field::NearField;
use super::patches::{Patch, Patches};
use super::projector_light::ProjectorLight;
use super::sparse::{SparseRows, merge};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Rays along each side of a pixel.
const RAYS: usize = 6;
/// Rows of pixels that are sampled together.
const ROWS_TOGETHER: usize = 32;
/// Mirrors that a ray is followed over at most.
const MOST_MIRRORS: usize = 16;
/// Part of a ray that is followed no further.
const LEAST: f64 = 1e-5;

/// What is simulated of how surfaces look.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct SamplingOptions {
    /// 1 for grey, 3 for red, green and blue.
    pub channels: usize,
    /// Whether glossy panels have their lobe.
    pub gloss: bool,
    /// Whether mirrors reflect.
    pub mirrors: bool,
    /// Whether the camera's lens bends straight lines.
    pub distortion: bool,
}

/// What the camera's pixels see, row by row from the top left.
#[derive(Clone, Debug, Default)]
pub(crate) struct CameraSampling {
    /// Light straight from the projector, pixels x cells, one entry a channel.
    pub direct: Vec<SparseRows>,
    /// Light that comes to patches from elsewhere, pixels x patches, one entry a
    /// channel.
    pub indirect: Vec<SparseRows>,
    /// Light that leaves patches and reaches a pixel's surface more or less than its
    /// patch's mean, pixels x patches, one entry a channel.
    pub detail: Vec<SparseRows>,
    /// Light that leaves patches and reaches the pixel over lobes, pixels x patches,
    /// the same in all channels.
    pub lobes: SparseRows,
    /// Share of each pixel that sees no surface, and with it the light from
    /// elsewhere.
    pub open: Vec<f32>,
}

impl CameraSampling {
    /// Follows rays through every pixel.
    pub(crate) fn new(
        facets: &Facets<'_>,
        patches: &Patches,
        light: &ProjectorLight<'_>,
        near: Option<&NearField>,
        options: SamplingOptions,
    ) -> Self {
        let pixels = PixelSampler {
            facets,
            patches: Some(patches),
            light,
            near,
            options,
        };
        let channels = vec![SparseRows::default(); options.channels];
        let mut sampling = Self {
            direct: channels.clone(),
            indirect: channels.clone(),
            detail: channels,
            lobes: SparseRows::default(),
            open: Vec::new(),
        };
        pixels.each(|pixel| {
            push(&mut sampling.direct, &pixel.direct);
            push(&mut sampling.indirect, &pixel.indirect);
            push(&mut sampling.detail, &pixel.detail);
            push(std::slice::from_mut(&mut sampling.lobes), &pixel.lobes);
            sampling.open.push(pixel.open as f32);
        });
        sampling
    }
}

/// Light straight from the projector alone, pixels x what `light` tells apart, one entry a
/// channel.
pub(crate) fn direct(
    facets: &Facets<'_>,
    light: &ProjectorLight<'_>,
    options: SamplingOptions,
) -> Vec<SparseRows> {
    let pixels = PixelSampler {
        facets,
        patches: None,
        light,
        near: None,
        options,
    };
    let mut direct = vec![SparseRows::default(); options.channels];
    pixels.each(|pixel| push(&mut direct, &pixel.direct));
    direct
}

/// Adds a row of what a pixel sees to each channel's.
fn push(channels: &mut [SparseRows], seen: &[Contribution]) {
    for (channel, rows) in channels.iter_mut().enumerate() {
        rows.push(seen.iter().map(|(index, share)| (*index, share[channel])));
    }
}

/// One pixel's view of a cell or a patch: which, and how much of it by channel.
type Contribution = (u32, [f64; 3]);

#[derive(Default)]
struct PixelSamples {
    direct: Vec<Contribution>,
    indirect: Vec<Contribution>,
    detail: Vec<Contribution>,
    lobes: Vec<Contribution>,
    open: f64,
    /// Where each patch is seen, for what varies over it.
    places: Vec<PatchView>,
}

/// The mean of the points where a pixel's rays meet a patch.
struct PatchView {
    patch: usize,
    share: [f64; 3],
    world: Vector3<f64>,
    /// To the viewer.
    towards: Vector3<f64>,
    /// Lobe of the panel, if it is seen, times the rays' part.
    gloss: Option<(Gloss, f64)>,
    rays: f64,
}

struct PixelSampler<'e> {
    facets: &'e Facets<'e>,
    /// Those that light bounces from; `None` if only the projector's own light is wanted.
    patches: Option<&'e Patches>,
    light: &'e ProjectorLight<'e>,
    near: Option<&'e NearField>,
    options: SamplingOptions,
}

/// Where a ray ends.
struct SurfacePoint<'e> {
    facet: usize,
    back: bool,
    world: Vector3<f64>,
    /// Towards the viewer, unit length.
    towards: Vector3<f64>,
    /// On the side that is seen.
    normal: Vector3<f64>,
    panel: &'e Panel,
}

impl<'e> PixelSampler<'e> {
    /// Hands over every pixel, row by row. What a pixel sees takes much more memory here than in
    /// sparse rows, so that only some rows of pixels are held at a time.
    fn each(&self, mut with: impl FnMut(PixelSamples)) {
        let (width, height) = self.facets.scene().camera.size;
        for top in (0..height).step_by(ROWS_TOGETHER) {
            let below = height.min(top + ROWS_TOGETHER as u32);
            let pixels: Vec<_> = (top * width..below * width)
                .into_par_iter()
                .map(|pixel| self.pixel(pixel % width, pixel / width))
                .collect();
            pixels.into_iter().for_each(&mut with);
        }
    }

    fn pixel(&self, col: u32, row: u32) -> PixelSamples {
        let camera = &self.facets.scene().camera;
        let (width, height) = camera.size;
        let distortion = if self.options.distortion {
            camera.distortion
        } else {
            [0.0; 2]
        };
        let mut pixel = PixelSamples::default();
        for ray in 0..RAYS * RAYS {
            let offset = |k: usize| (k as f64 + 0.5) / RAYS as f64;
            let across = (f64::from(col) + offset(ray % RAYS)) / f64::from(width);
            let down = (f64::from(row) + offset(ray / RAYS)) / f64::from(height);
            let way = camera.ray(across, down, distortion);
            self.follow(camera.view.position(), way, &mut pixel);
        }
        self.vary(&mut pixel);
        for seen in [
            &mut pixel.direct,
            &mut pixel.indirect,
            &mut pixel.detail,
            &mut pixel.lobes,
        ] {
            let add = |sum: &mut [f64; 3], more: [f64; 3]| {
                sum.iter_mut()
                    .zip(more)
                    .for_each(|(sum, more)| *sum += more);
            };
            merge(seen, add);
            let shares = seen.iter_mut().flat_map(|(_, share)| share);
            shares.for_each(|share| *share *= 1.0 / (RAYS * RAYS) as f64);
        }
        pixel
    }

    /// Adds what a ray sees, over mirrors.
    fn follow(&self, mut origin: Vector3<f64>, mut way: Vector3<f64>, pixel: &mut PixelSamples) {
        let mut part = 1.0;
        let mut least = 0.0;
        for _ in 0..=MOST_MIRRORS {
            let Some(point) = self.point(&origin, &way, least) else {
                pixel.open += part / (RAYS * RAYS) as f64;
                return;
            };
            self.look(&point, part, pixel);
            if !self.options.mirrors || point.panel.mirror == 0.0 || point.back {
                return;
            }
            part *= point.panel.mirror;
            if part < LEAST {
                return;
            }
            way -= 2.0 * way.dot(&point.normal) * point.normal;
            origin = point.world;
            least = 1e-9 / way.norm();
        }
    }

    fn point(
        &self,
        origin: &Vector3<f64>,
        way: &Vector3<f64>,
        least: f64,
    ) -> Option<SurfacePoint<'e>> {
        let hit = self.facets.obstacles().first_hit(origin, way, least)?;
        let normal = self.facets.polygon(hit.facet).normal();
        let back = normal.dot(way) > 0.0;
        Some(SurfacePoint {
            facet: hit.facet,
            back,
            world: origin + hit.along * way,
            towards: -way.normalize(),
            normal: if back { -normal } else { normal },
            panel: &self.facets.scene().panels[self.facets.panel(hit.facet)],
        })
    }

    /// Adds `part` of what a point of a surface options like.
    fn look(&self, point: &SurfacePoint<'_>, part: f64, pixel: &mut PixelSamples) {
        let view = &self.facets.projector().view;
        let described = self.facets.described(point.facet);
        let albedo = point.panel.albedo.at(described, &point.world);
        let before = pixel.indirect.last().map(|(patch, _)| *patch as usize);
        let at =
            |patches: &Patches| patches.at(view, point.facet, point.back, &point.world, before);
        if let Some(patch) = self.patches.and_then(at) {
            pixel
                .indirect
                .push((patch as u32, albedo.map(|a| part * a)));
            self.remember(point, part, patch, albedo, pixel);
        }
        if point.back {
            return;
        }
        let Some(place) = view.place(&point.world) else {
            return;
        };
        let irradiance = self.light.irradiance(place, &point.world, &point.normal);
        if irradiance == 0.0 || self.light.shaded(point.facet, &point.world) {
            return;
        }
        let lobe = self.lobe(point, &(view.position() - point.world).normalize());
        let share = albedo.map(|a| part * irradiance * (a + lobe));
        self.light.cells(place, |cell, weight| {
            pixel.direct.push((cell, share.map(|s| weight * s)));
        });
    }

    /// Adds a point to those where the pixel sees a patch.
    fn remember(
        &self,
        point: &SurfacePoint<'_>,
        part: f64,
        patch: usize,
        albedo: [f64; 3],
        pixel: &mut PixelSamples,
    ) {
        let seen = self.options.gloss && !point.back;
        let gloss = point.panel.gloss.filter(|_| seen);
        if self.near.is_none() && gloss.is_none() {
            return;
        }
        let same = pixel.places.iter_mut().find(|place| place.patch == patch);
        let share = albedo.map(|a| part * a);
        if let Some(place) = same {
            place.rays += 1.0;
            place.world += (point.world - place.world) / place.rays;
            for (sum, more) in place.share.iter_mut().zip(share) {
                *sum += more;
            }
            if let Some((_, sum)) = &mut place.gloss {
                *sum += part;
            }
            return;
        }
        pixel.places.push(PatchView {
            patch,
            share,
            world: point.world,
            towards: point.towards,
            gloss: gloss.map(|gloss| (gloss, part)),
            rays: 1.0,
        });
    }

    /// Adds what varies over the patches that the pixel sees: bounced light beside a
    /// fold, and what lobes send of it.
    fn vary(&self, pixel: &mut PixelSamples) {
        let patches = self.patches.map_or(&[][..], Patches::all);
        for place in &pixel.places {
            if let Some(near) = self.near {
                near.at(patches, place.patch, &place.world, |other, more| {
                    let share = place.share.map(|share| share * more);
                    pixel.detail.push((other, share));
                });
            }
            if let Some((gloss, part)) = place.gloss {
                self.shine(patches, place, gloss, part, &mut pixel.lobes);
            }
        }
    }

    /// What a lobe sends to the viewer of the light that leaves patches.
    fn shine(
        &self,
        patches: &[Patch],
        place: &PatchView,
        gloss: Gloss,
        part: f64,
        seen: &mut Vec<Contribution>,
    ) {
        let normal = patches[place.patch].polygon.normal();
        for (index, other) in patches.iter().enumerate() {
            if other.facet == patches[place.patch].facet {
                continue;
            }
            let way = other.polygon.centroid() - place.world;
            // Most directions are far from the lobe.
            let lobe = gloss.towards(&normal, &way.normalize(), &place.towards);
            let hidden = |to| self.facets.obstacles().blocked(&place.world, to);
            if lobe <= LEAST || hidden(&other.polygon.centroid()) {
                continue;
            }
            let share = part * lobe * from_point(&place.world, &normal, &other.polygon);
            if share > 0.0 {
                seen.push((index as u32, [share; 3]));
            }
        }
    }

    /// What the lobe sends to the viewer of light from a direction, times pi, as the
    /// albedo does.
    fn lobe(&self, point: &SurfacePoint<'_>, from: &Vector3<f64>) -> f64 {
        match point.panel.gloss {
            Some(gloss) if self.options.gloss => gloss.towards(&point.normal, from, &point.towards),
            _ => 0.0,
        }
    }
}

impl Gloss {
    /// The lobe's part in the light that goes `towards` a viewer where light comes
    /// `from` a direction, both unit vectors away from the surface: `pi` times the
    /// reflectance distribution.
    #[must_use]
    pub fn towards(
        &self,
        normal: &Vector3<f64>,
        from: &Vector3<f64>,
        towards: &Vector3<f64>,
    ) -> f64 {
        let mirrored = 2.0 * normal.dot(from) * normal - from;
        let cosine = mirrored.dot(towards).max(0.0);
        self.reflectance * (self.exponent + 2.0) / 2.0 * cosine.powf(self.exponent)
    }
}
