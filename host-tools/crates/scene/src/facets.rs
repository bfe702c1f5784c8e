//! Facets: the scene's flat parts as light sees them, turned to the projector, and which of
//! them may throw a shadow onto which.

use super::description::{Facet, Projector, Scene};
use super::geometry::{Obstacles, Polygon};
use super::pinhole::Pinhole;
use nalgebra::Vector2;

/// Metres in front of the projector where its light begins.
pub(super) const NEAREST: f64 = 1e-3;
/// Overlap in the frame that still counts as touching: panels share edges.
const TOUCHING: f64 = 1e-9;

/// Every facet of a scene, in the order of its panels.
#[derive(Clone, Debug)]
pub(crate) struct Facets<'s> {
    scene: &'s Scene,
    index: usize,
    described: Vec<(usize, &'s Facet)>,
    obstacles: Obstacles,
    /// Facets that may stand between the projector and each facet.
    shaded_by: Vec<Vec<usize>>,
}

impl<'s> Facets<'s> {
    /// Turns every facet's normal to the side of the projector with this index.
    pub(crate) fn new(scene: &'s Scene, index: usize) -> Self {
        let projector = &scene.projectors[index].view;
        let turned = |facet: &Facet| {
            if facet.polygon.plane().distance(&projector.position()) < 0.0 {
                facet.polygon.flipped()
            } else {
                facet.polygon.clone()
            }
        };
        let described: Vec<_> = scene.facets().collect();
        let polygons: Vec<_> = described.iter().map(|(_, facet)| turned(facet)).collect();
        Self {
            scene,
            index,
            described,
            shaded_by: shaded_by(&polygons, projector),
            obstacles: Obstacles::new(polygons),
        }
    }

    /// The scene they are of.
    pub(crate) fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// The projector that they are turned to.
    pub(crate) fn projector(&self) -> &'s Projector {
        &self.scene.projectors[self.index]
    }

    /// Light from all around that is added to this projector's.
    pub(crate) fn ambient(&self) -> [f64; 3] {
        self.scene.ambient_beside(self.index)
    }

    /// All of them as obstacles; each faces the projector.
    pub(crate) fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.described.len()
    }

    /// One of them, turned to the projector.
    pub(crate) fn polygon(&self, facet: usize) -> &Polygon {
        &self.obstacles.facets()[facet]
    }

    /// One of them as it is described.
    pub(crate) fn described(&self, facet: usize) -> &'s Facet {
        self.described[facet].1
    }

    /// Index of the panel that it is part of.
    pub(crate) fn panel(&self, facet: usize) -> usize {
        self.described[facet].0
    }

    /// The panel's name.
    pub(crate) fn name(&self, facet: usize) -> &'s str {
        &self.scene.panels[self.panel(facet)].name
    }

    /// Facets that may stand in the projector's light to this one.
    pub(crate) fn shaded_by(&self, facet: usize) -> &[usize] {
        &self.shaded_by[facet]
    }
}

/// For each facet, those that overlap it in the projector's frame and have a part on
/// the projector's side of its plane.
fn shaded_by(polygons: &[Polygon], projector: &Pinhole) -> Vec<Vec<usize>> {
    let near = projector.depth_plane(NEAREST);
    let outlines: Vec<Option<Outline>> = polygons
        .iter()
        .map(|polygon| Outline::of(&polygon.clipped(&near)?, projector))
        .collect();
    let nearer = |polygon: &Polygon, other: &Polygon| {
        let least = TOUCHING * polygon.size();
        other
            .corners()
            .iter()
            .any(|c| polygon.plane().distance(c) > least)
    };
    let of = |facet: usize| {
        let Some(outline) = &outlines[facet] else {
            return Vec::new();
        };
        let shades = |other: &usize| {
            *other != facet
                && outlines[*other]
                    .as_ref()
                    .is_some_and(|o| o.overlaps(outline))
                && nearer(&polygons[facet], &polygons[*other])
        };
        (0..polygons.len()).filter(shades).collect()
    };
    (0..polygons.len()).map(of).collect()
}

/// A convex outline in a frame.
struct Outline {
    corners: Vec<Vector2<f64>>,
    low: Vector2<f64>,
    high: Vector2<f64>,
}

impl Outline {
    fn of(polygon: &Polygon, view: &Pinhole) -> Option<Self> {
        let in_frame = |corner| {
            let place = view.place(corner)?;
            Some(Vector2::new(place.across, place.down))
        };
        let corners: Vec<_> = polygon
            .corners()
            .iter()
            .map(in_frame)
            .collect::<Option<_>>()?;
        let (mut low, mut high) = (corners[0], corners[0]);
        for corner in &corners {
            low = low.inf(corner);
            high = high.sup(corner);
        }
        Some(Self { corners, low, high })
    }

    /// Whether the two share more than their border: no edge of either separates
    /// them.
    fn overlaps(&self, other: &Self) -> bool {
        let apart = |axis: usize| {
            self.high[axis] <= other.low[axis] + TOUCHING
                || other.high[axis] <= self.low[axis] + TOUCHING
        };
        !(apart(0) || apart(1) || self.separates(other) || other.separates(self))
    }

    fn separates(&self, other: &Self) -> bool {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).any(|(a, b)| {
            let Some(along) = (b - a).try_normalize(TOUCHING) else {
                return false;
            };
            let across = Vector2::new(-along.y, along.x);
            let reach = |outline: &Self, sign: f64| {
                let far = |c: &Vector2<f64>| sign * across.dot(&(c - a));
                outline
                    .corners
                    .iter()
                    .map(far)
                    .fold(f64::NEG_INFINITY, f64::max)
            };
            let (mine, other_least) = (reach(self, 1.0), -reach(other, -1.0));
            let (least, others) = (-reach(self, -1.0), reach(other, 1.0));
            other_least >= mine - TOUCHING || others <= least + TOUCHING
        })
    }
}
