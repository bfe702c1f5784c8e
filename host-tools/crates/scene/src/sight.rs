//! What each camera pixel sees: how much of it is light straight from which cell,
//! and how much is light that patches get from elsewhere.
//!
//! Both are linear in the projected pattern, so they are found once, by rays
//! through the pixel, and every photograph is a product with them.

use super::description::{Gloss, Panel};
use super::facets::Facets;
use super::form_factor::from_point;
use super::near::NearLight;
use super::patches::Patches;
use super::projector_light::ProjectorLight;
use super::sparse::Rows;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Rays along each side of a pixel.
const RAYS: usize = 6;
/// Mirrors that a ray is followed over at most.
const MOST_MIRRORS: usize = 16;
/// Part of a ray that is followed no further.
const LEAST: f64 = 1e-5;

/// What is simulated of how surfaces look.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Looks {
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
#[derive(Clone, Debug)]
pub struct Sight {
    /// Light straight from the projector, pixels x cells, one entry a channel.
    pub direct: Vec<Rows>,
    /// Light that comes to patches from elsewhere, pixels x patches, one entry a
    /// channel.
    pub indirect: Vec<Rows>,
    /// Light that leaves patches and reaches a pixel's surface more or less than its
    /// patch's mean, pixels x patches, one entry a channel.
    pub detail: Vec<Rows>,
    /// Light that leaves patches and reaches the pixel over lobes, pixels x patches,
    /// the same in all channels.
    pub lobes: Rows,
    /// Share of each pixel that sees no surface, and with it the light from
    /// elsewhere.
    pub open: Vec<f32>,
}

impl Sight {
    /// Sees nothing.
    #[must_use]
    pub fn blind() -> Self {
        Self {
            direct: Vec::new(),
            indirect: Vec::new(),
            detail: Vec::new(),
            lobes: Rows::from_rows([]),
            open: Vec::new(),
        }
    }

    /// Follows rays through every pixel.
    #[must_use]
    pub fn new(
        facets: &Facets<'_>,
        patches: &Patches,
        light: &ProjectorLight<'_>,
        near: Option<&NearLight>,
        looks: Looks,
    ) -> Self {
        let eye = Eye {
            facets,
            patches,
            light,
            near,
            looks,
        };
        let (width, height) = facets.scene().camera.size;
        let pixels: Vec<Pixel> = (0..width * height)
            .into_par_iter()
            .map(|pixel| eye.pixel(pixel % width, pixel / width))
            .collect();
        let rows = |of: fn(&Pixel) -> &Vec<Seen>| {
            (0..looks.channels)
                .map(|channel| {
                    let entry = |seen: &Seen| (seen.index, seen.share[channel]);
                    Rows::from_rows(pixels.iter().map(|p| of(p).iter().map(entry).collect()))
                })
                .collect()
        };
        Self {
            direct: rows(|pixel| &pixel.direct),
            indirect: rows(|pixel| &pixel.indirect),
            detail: rows(|pixel| &pixel.detail),
            lobes: Rows::from_rows(pixels.iter().map(|pixel| {
                let lobes = pixel.lobes.iter();
                lobes.map(|seen| (seen.index, seen.share[0])).collect()
            })),
            open: pixels.iter().map(|pixel| pixel.open as f32).collect(),
        }
    }
}

/// One pixel's view of a cell or a patch.
struct Seen {
    index: u32,
    share: [f64; 3],
}

#[derive(Default)]
struct Pixel {
    direct: Vec<Seen>,
    indirect: Vec<Seen>,
    detail: Vec<Seen>,
    lobes: Vec<Seen>,
    open: f64,
    /// Where each patch is seen, for what varies over it.
    places: Vec<Place>,
}

/// The mean of the points where a pixel's rays meet a patch.
struct Place {
    patch: usize,
    share: [f64; 3],
    world: Vector3<f64>,
    /// To the viewer.
    towards: Vector3<f64>,
    /// Lobe of the panel, if it is seen, times the rays' part.
    gloss: Option<(Gloss, f64)>,
    rays: f64,
}

struct Eye<'e> {
    facets: &'e Facets<'e>,
    patches: &'e Patches,
    light: &'e ProjectorLight<'e>,
    near: Option<&'e NearLight>,
    looks: Looks,
}

/// Where a ray ends.
struct Point<'e> {
    facet: usize,
    back: bool,
    world: Vector3<f64>,
    /// Towards the viewer, unit length.
    towards: Vector3<f64>,
    /// On the side that is seen.
    normal: Vector3<f64>,
    panel: &'e Panel,
}

impl<'e> Eye<'e> {
    fn pixel(&self, col: u32, row: u32) -> Pixel {
        let camera = &self.facets.scene().camera;
        let (width, height) = camera.size;
        let distortion = if self.looks.distortion {
            camera.distortion
        } else {
            [0.0; 2]
        };
        let mut pixel = Pixel::default();
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
            merge(seen, 1.0 / (RAYS * RAYS) as f64);
        }
        pixel
    }

    /// Adds what a ray sees, over mirrors.
    fn follow(&self, mut origin: Vector3<f64>, mut way: Vector3<f64>, pixel: &mut Pixel) {
        let mut part = 1.0;
        let mut least = 0.0;
        for _ in 0..=MOST_MIRRORS {
            let Some(point) = self.point(&origin, &way, least) else {
                pixel.open += part / (RAYS * RAYS) as f64;
                return;
            };
            self.look(&point, part, pixel);
            if !self.looks.mirrors || point.panel.mirror == 0.0 || point.back {
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

    fn point(&self, origin: &Vector3<f64>, way: &Vector3<f64>, least: f64) -> Option<Point<'e>> {
        let hit = self.facets.obstacles().first_hit(origin, way, least)?;
        let normal = self.facets.polygon(hit.facet).normal();
        let back = normal.dot(way) > 0.0;
        Some(Point {
            facet: hit.facet,
            back,
            world: origin + hit.along * way,
            towards: -way.normalize(),
            normal: if back { -normal } else { normal },
            panel: &self.facets.scene().panels[self.facets.panel(hit.facet)],
        })
    }

    /// Adds `part` of what a point of a surface looks like.
    fn look(&self, point: &Point<'_>, part: f64, pixel: &mut Pixel) {
        let view = &self.facets.scene().projector.view;
        let described = self.facets.described(point.facet);
        let albedo = point.panel.albedo.at(described.texture_place(&point.world));
        if let Some(patch) = self.patches.at(view, point.facet, point.back, &point.world) {
            pixel.indirect.push(Seen {
                index: patch as u32,
                share: albedo.map(|a| part * a),
            });
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
            pixel.direct.push(Seen {
                index: cell,
                share: share.map(|s| weight * s),
            });
        });
    }

    /// Adds a point to those where the pixel sees a patch.
    fn remember(
        &self,
        point: &Point<'_>,
        part: f64,
        patch: usize,
        albedo: [f64; 3],
        pixel: &mut Pixel,
    ) {
        let gloss = point
            .panel
            .gloss
            .filter(|_| self.looks.gloss && !point.back);
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
        pixel.places.push(Place {
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
    fn vary(&self, pixel: &mut Pixel) {
        for place in &pixel.places {
            if let Some(near) = self.near {
                near.at(
                    self.patches.all(),
                    place.patch,
                    &place.world,
                    |other, more| {
                        pixel.detail.push(Seen {
                            index: other,
                            share: place.share.map(|share| share * more),
                        });
                    },
                );
            }
            if let Some((gloss, part)) = place.gloss {
                self.shine(place, gloss, part, &mut pixel.lobes);
            }
        }
    }

    /// What a lobe sends to the viewer of the light that leaves patches.
    fn shine(&self, place: &Place, gloss: Gloss, part: f64, seen: &mut Vec<Seen>) {
        let patches = self.patches.all();
        let normal = patches[place.patch].polygon.normal();
        for (index, other) in patches.iter().enumerate() {
            if other.facet == patches[place.patch].facet {
                continue;
            }
            let way = other.polygon.centroid() - place.world;
            // Most directions are far from the lobe.
            let lobe = gloss.towards(&normal, &way.normalize(), &place.towards);
            if lobe <= LEAST
                || self
                    .facets
                    .obstacles()
                    .blocked(&place.world, &other.polygon.centroid())
            {
                continue;
            }
            let share = part * lobe * from_point(&place.world, &normal, &other.polygon);
            if share > 0.0 {
                seen.push(Seen {
                    index: index as u32,
                    share: [share; 3],
                });
            }
        }
    }

    /// What the lobe sends to the viewer of light from a direction, times pi, as the
    /// albedo does.
    fn lobe(&self, point: &Point<'_>, from: &Vector3<f64>) -> f64 {
        match point.panel.gloss {
            Some(gloss) if self.looks.gloss => gloss.towards(&point.normal, from, &point.towards),
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

/// Adds up entries of the same index and scales them.
fn merge(seen: &mut Vec<Seen>, scale: f64) {
    seen.sort_by_key(|seen| seen.index);
    seen.dedup_by(|next, kept| {
        let same = next.index == kept.index;
        if same {
            for (sum, more) in kept.share.iter_mut().zip(next.share) {
                *sum += more;
            }
        }
        same
    });
    for seen in seen.iter_mut() {
        for share in &mut seen.share {
            *share *= scale;
        }
    }
}
