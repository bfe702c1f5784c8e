//! Effect estimates: how much an effect could change a photograph, from the scene alone. They
//! are what decisions are made by.
//!
//! Every estimate is a share of the light that the projector's white makes on the
//! surfaces, their mean, and is meant to be too large rather than too small.

use super::facets::Facets;
use super::form_factor::{facing, from_point};
use super::geometry::{Obstacles, Polygon};
use super::patches::split_by_frame;
use super::pinhole::Pinhole;
use nalgebra::Vector3;

/// Facets above which pairs are no longer looked at one by one.
const MOST_FACETS: usize = 400;

/// What is known of a scene before anything is simulated.
#[derive(Clone, Debug)]
pub(super) struct Estimate {
    /// Largest light that a surface sends on of what others send it, which one, and
    /// which of them sends most. `None` if no two surfaces face each other.
    pub(super) bounce: Option<StrongestBounce>,
    /// Largest light on what is beside the frame.
    pub(super) surroundings: Option<f64>,
    /// Largest light that back sides send to the camera or to front sides.
    pub(super) backs: Option<f64>,
    /// Pairs of facets that face each other, and all pairs.
    pub(super) facing: (usize, usize),
}

/// Light that one facet sends on, most of it from another.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct StrongestBounce {
    pub(super) light: f64,
    pub(super) from: usize,
    pub(super) to: usize,
}

/// One side of a facet, or a part of it.
struct Side<'p> {
    polygon: &'p Polygon,
    facet: usize,
    /// Largest diffuse reflectance, gloss and mirrors included.
    reflectance: f64,
    /// Largest irradiance by the projector's white and from elsewhere.
    lit: f64,
}

impl Estimate {
    /// Looks at all pairs of facets.
    pub(super) fn new(facets: &Facets<'_>, ambient: f64) -> Self {
        let count = facets.count();
        let pairs = count * count.saturating_sub(1) / 2;
        let projector = &facets.projector().view;
        let level = level(facets);
        let side = |facet: usize, polygon, lit: f64| Side {
            polygon,
            facet,
            reflectance: reflectance(facets, facet),
            lit: (lit + ambient) / level,
        };
        let lit = |f| irradiance(facets.polygon(f), projector);
        let fronts: Vec<_> = (0..count)
            .map(|f| side(f, facets.polygon(f), lit(f)))
            .collect();
        if count > MOST_FACETS {
            // A mesh of many facets is one that bends: it lights itself.
            let reflectance = fronts.iter().map(|f| f.reflectance).fold(0.0, f64::max);
            return Self {
                bounce: Some(StrongestBounce {
                    light: reflectance,
                    from: 0,
                    to: 0,
                }),
                surroundings: Some(reflectance),
                backs: Some(reflectance * reflectance),
                facing: (pairs, pairs),
            };
        }
        let flipped: Vec<_> = (0..count).map(|f| facets.polygon(f).flipped()).collect();
        let backs = flipped.iter().enumerate().map(|(f, p)| side(f, p, 0.0));
        // A back side matters if the camera sees it, or a front side.
        let camera = facets.scene().camera.view.position();
        let matters = |back: &Side<'_>| {
            back.polygon.plane().distance(&camera) > 0.0
                || fronts.iter().any(|to| faces(back, to, facets.obstacles()))
        };
        let seen: Vec<_> = backs.filter(matters).collect();
        let outside = |f| split_by_frame(facets.polygon(f), projector).1.into_iter();
        let beside: Vec<_> = (0..count)
            .flat_map(|f| outside(f).map(move |p| (f, p)))
            .collect();
        let beside: Vec<_> = beside.iter().map(|(f, p)| side(*f, p, 0.0)).collect();
        let (bounce, facing) = strongest_bounce(&fronts, facets.obstacles());
        Self {
            bounce,
            surroundings: largest_on(&beside, &fronts, facets.obstacles()),
            backs: largest_on(&seen, &fronts, facets.obstacles()),
            facing: (facing / 2, pairs),
        }
    }
}

/// The front that sends on most of what other fronts send it, if any does, and how many
/// fronts face another, counted from both sides.
fn strongest_bounce(
    fronts: &[Side<'_>],
    obstacles: &Obstacles,
) -> (Option<StrongestBounce>, usize) {
    let mut facing = 0;
    let mut bounce: Option<StrongestBounce> = None;
    for to in fronts {
        let mut all = 0.0;
        let mut most = (0.0, to.facet);
        for from in fronts {
            let Some(arriving) = bounced(from, to, obstacles) else {
                continue;
            };
            facing += 1;
            all += arriving;
            if arriving > most.0 {
                most = (arriving, from.facet);
            }
        }
        let light = all * to.reflectance;
        if all > 0.0 && bounce.is_none_or(|pair| light > pair.light) {
            bounce = Some(StrongestBounce {
                light,
                from: most.1,
                to: to.facet,
            });
        }
    }
    (bounce, facing)
}

/// Largest light that any of `sides` gets from `fronts` or from elsewhere and sends
/// on; `None` if there are no such sides, or nothing reaches them.
fn largest_on(sides: &[Side<'_>], fronts: &[Side<'_>], obstacles: &Obstacles) -> Option<f64> {
    let on = |side: &Side<'_>| {
        let from_fronts = fronts
            .iter()
            .filter_map(|front| bounced(front, side, obstacles));
        side.reflectance * (side.lit + from_fronts.sum::<f64>())
    };
    let largest = sides.iter().map(on).fold(0.0, f64::max);
    (largest > 0.0).then_some(largest)
}

/// Light that comes to one side from another after a bounce there: largest over the
/// places looked at. `None` if the two do not face each other, or nothing is sent.
fn bounced(from: &Side<'_>, to: &Side<'_>, obstacles: &Obstacles) -> Option<f64> {
    if from.lit == 0.0 || from.reflectance == 0.0 || !faces(from, to, obstacles) {
        return None;
    }
    let seen = to.polygon.clipped(from.polygon.plane())?;
    let visible = from.polygon.clipped(to.polygon.plane())?;
    let normal = to.polygon.normal();
    let factor = |place: &Vector3<f64>| from_point(place, &normal, &visible);
    let largest = places(&seen).iter().map(factor).fold(0.0, f64::max);
    Some(largest * from.reflectance * from.lit)
}

/// Whether light goes between two sides: parts of them are in front of each other,
/// and not all is hidden.
fn faces(from: &Side<'_>, to: &Side<'_>, obstacles: &Obstacles) -> bool {
    if from.facet == to.facet || !facing(from.polygon, to.polygon) {
        return false;
    }
    let seen = to.polygon.clipped(from.polygon.plane());
    let visible = from.polygon.clipped(to.polygon.plane());
    let (Some(seen), Some(visible)) = (seen, visible) else {
        return false;
    };
    // Only what is hidden from every place looked at counts as hidden.
    let others = places(&visible);
    let open = |a: &Vector3<f64>| others.iter().any(|b| !obstacles.blocked(a, b));
    places(&seen).iter().any(open)
}

/// Just inside the corners, where form factors are largest and still defined, and the
/// centre.
fn places(polygon: &Polygon) -> Vec<Vector3<f64>> {
    let centre = polygon.centroid();
    let corners = polygon.corners().iter().map(|c| c + 0.01 * (centre - c));
    corners.chain([centre]).collect()
}

fn reflectance(facets: &Facets<'_>, facet: usize) -> f64 {
    let panel = &facets.scene().panels[facets.panel(facet)];
    let diffuse = panel.albedo.largest().into_iter().fold(0.0, f64::max);
    diffuse + panel.gloss.map_or(0.0, |gloss| gloss.reflectance) + panel.mirror
}

/// Largest irradiance by the projector's white on the part of a polygon in its frame.
fn irradiance(polygon: &Polygon, view: &Pinhole) -> f64 {
    let Some(part) = split_by_frame(polygon, view).0 else {
        return 0.0;
    };
    let normal = part.normal();
    let at = |world: &Vector3<f64>| irradiance_at(world, &normal, view);
    part.corners().iter().map(at).fold(0.0, f64::max)
}

/// Light that the projector's white makes on the surfaces in its frame, without
/// bounces: the mean over their area.
pub(super) fn level(facets: &Facets<'_>) -> f64 {
    let projector = &facets.projector().view;
    let (mut light, mut areas) = (0.0, 0.0);
    for facet in 0..facets.count() {
        let Some(part) = split_by_frame(facets.polygon(facet), projector).0 else {
            continue;
        };
        let lit = irradiance_at(&part.centroid(), &part.normal(), projector);
        light += part.area() * lit * reflectance(facets, facet);
        areas += part.area();
    }
    let level = light / areas;
    if level.is_finite() && level > 0.0 {
        level
    } else {
        1.0
    }
}

/// Irradiance of a point by the projector's white.
fn irradiance_at(world: &Vector3<f64>, normal: &Vector3<f64>, view: &Pinhole) -> f64 {
    let way = world - view.position();
    let depth = way.dot(&view.forward());
    (-normal.dot(&way) * view.focus().powi(2) / depth.powi(3)).max(0.0)
}
