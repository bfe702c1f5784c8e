//! Ray casting: which surface a ray meets first, and whether two places see each other. Where
//! there are many surfaces, a tree of their bounding boxes comes first.

use super::polygon::Polygon;
use bvh::aabb::{Aabb, Bounded, IntersectsAabb};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use nalgebra::{Point3, Vector3};

/// Part of a segment at either end that no surface blocks: the surfaces that it
/// starts and ends on.
const ENDS: f64 = 1e-6;

/// Surfaces from which on looking through their boxes first is faster.
const MANY: usize = 16;

/// All surfaces of a scene as obstacles to light, whichever way they face.
#[derive(Clone, Debug)]
pub struct Obstacles {
    facets: Vec<Polygon>,
    /// Boxes around them, if there are [`MANY`].
    bounds: Option<BoundingBoxes>,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hit {
    /// Index of the surface in [`Obstacles::facets`].
    pub facet: usize,
    /// How far along the ray, in lengths of its direction.
    pub along: f64,
}

impl Obstacles {
    /// Obstacles in the order that [`Hit::facet`] counts them.
    #[must_use]
    pub fn new(facets: Vec<Polygon>) -> Self {
        let bounds = (facets.len() >= MANY).then(|| BoundingBoxes::new(&facets));
        Self { facets, bounds }
    }

    /// The surfaces.
    #[must_use]
    pub fn facets(&self) -> &[Polygon] {
        &self.facets
    }

    /// The first surface beyond `least` along a ray; back sides count.
    #[must_use]
    pub fn first_hit(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        least: f64,
    ) -> Option<Hit> {
        let stretch = Stretch::new(origin, direction, f64::INFINITY);
        let mut first: Option<Hit> = None;
        self.near(&stretch, |facet| {
            // Of surfaces met together, the first in the list.
            let nearer = |along| first.is_none_or(|f| (along, facet) < (f.along, f.facet));
            let wanted = |along| along > least && nearer(along);
            if let Some(along) = meets(&self.facets[facet], origin, direction, wanted) {
                first = Some(Hit { facet, along });
            }
            false
        });
        first
    }

    /// Whether a surface stands between two places that are on surfaces
    /// themselves.
    #[must_use]
    pub fn blocked(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        let direction = to - from;
        let stretch = Stretch::new(from, &direction, 1.0);
        self.near(&stretch, |facet| {
            let between = |along| along > ENDS && along < 1.0 - ENDS;
            meets(&self.facets[facet], from, &direction, between).is_some()
        })
    }

    /// Shows the surfaces near a stretch until one is the last; whether one was.
    fn near(&self, stretch: &Stretch, mut last: impl FnMut(usize) -> bool) -> bool {
        match &self.bounds {
            Some(bounds) => bounds.near(stretch).any(last),
            None => (0..self.facets.len()).any(&mut last),
        }
    }
}

/// How far along the ray it meets the polygon, if that is `wanted`: it is known before the longer
/// question whether the place lies inside.
fn meets(
    polygon: &Polygon,
    origin: &Vector3<f64>,
    direction: &Vector3<f64>,
    wanted: impl Fn(f64) -> bool,
) -> Option<f64> {
    let slope = polygon.normal().dot(direction);
    if slope == 0.0 {
        return None;
    }
    let along = -polygon.plane().distance(origin) / slope;
    let inside = || polygon.contains(&(origin + direction * along));
    (along.is_finite() && wanted(along) && inside()).then_some(along)
}

/// Part of a surface's size that its box is wider: a flat box has no inside to hit.
const WIDER: f64 = 1e-6;

/// The boxes of all surfaces of a scene.
#[derive(Clone, Debug)]
struct BoundingBoxes {
    tree: Bvh<f64, 3>,
    boxes: Vec<BoxOfFacet>,
}

#[derive(Clone, Debug)]
struct BoxOfFacet {
    bounds: Aabb<f64, 3>,
    facet: usize,
    node: usize,
}

impl Bounded<f64, 3> for BoxOfFacet {
    fn aabb(&self) -> Aabb<f64, 3> {
        self.bounds
    }
}

impl BHShape<f64, 3> for BoxOfFacet {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl BoundingBoxes {
    fn new(facets: &[Polygon]) -> Self {
        let mut boxes: Vec<_> = facets
            .iter()
            .enumerate()
            .map(|(facet, polygon)| {
                let first = polygon.corners()[0];
                let corners = polygon.corners().iter();
                let (least, most) = corners.fold((first, first), |(l, m), c| (l.inf(c), m.sup(c)));
                let wider = Vector3::repeat(WIDER * polygon.size());
                let (least, most) = (Point3::from(least - wider), Point3::from(most + wider));
                BoxOfFacet {
                    bounds: Aabb::with_bounds(least, most),
                    facet,
                    node: 0,
                }
            })
            .collect();
        Self {
            tree: Bvh::build(&mut boxes),
            boxes,
        }
    }

    /// Surfaces whose boxes a stretch of a line meets.
    fn near<'a>(&'a self, stretch: &'a Stretch) -> impl Iterator<Item = usize> + 'a {
        let met = self.tree.traverse_iterator(stretch, &self.boxes);
        met.map(|near| near.facet)
    }
}

/// Part of a line, from a place to that many lengths of a direction away.
struct Stretch {
    origin: Vector3<f64>,
    /// One over the direction along each axis: boxes are met often, and divisions take long.
    inverse: Vector3<f64>,
    lengths: f64,
}

impl Stretch {
    fn new(origin: &Vector3<f64>, direction: &Vector3<f64>, lengths: f64) -> Self {
        Self {
            origin: *origin,
            inverse: direction.map(f64::recip),
            lengths,
        }
    }
}

impl IntersectsAabb<f64, 3> for Stretch {
    fn intersects_aabb(&self, aabb: &Aabb<f64, 3>) -> bool {
        let (mut enters, mut leaves) = (0.0_f64, self.lengths);
        for axis in 0..3 {
            let (start, inverse) = (self.origin[axis], self.inverse[axis]);
            let (least, most) = (aabb.min[axis], aabb.max[axis]);
            if inverse.is_infinite() {
                if start < least || start > most {
                    return false;
                }
                continue;
            }
            let (a, b) = ((least - start) * inverse, (most - start) * inverse);
            enters = enters.max(a.min(b));
            leaves = leaves.min(a.max(b));
        }
        enters <= leaves
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn square(z: f64) -> Polygon {
        crate::geometry::polygon(&[[-1., -1., z], [1., -1., z], [1., 1., z], [-1., 1., z]])
    }

    #[test]
    fn the_nearest_of_two_squares_is_met_and_blocks_the_other() {
        let obstacles = Obstacles::new(vec![square(0.0), square(1.0), square(2.0)]);
        let origin = Vector3::new(0.2, 0.1, 5.0);
        let hit = obstacles.first_hit(&origin, &-Vector3::z(), 0.0).unwrap();
        assert_eq!(hit.facet, 2);
        assert!((hit.along - 3.0).abs() < 1e-12);
        let (bottom, top) = (Vector3::zeros(), Vector3::new(0.0, 0.0, 2.0));
        assert!(obstacles.blocked(&bottom, &top));
        assert!(!obstacles.blocked(&bottom, &Vector3::new(0.0, 0.0, 1.0)));
        let past = Vector3::new(3.0, 0.0, 1.0);
        assert!(!obstacles.blocked(&bottom, &past));
    }

    /// Triangles in all directions, some in planes along the axes.
    fn scattered(seed: u64, many: usize) -> Vec<Polygon> {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut triangles = Vec::new();
        while triangles.len() < many {
            let centre = Vector3::from_fn(|_, _| 4.0 * random.f64() - 2.0);
            let flat = random.usize(0..6);
            let corners = (0..3).map(|_| {
                Vector3::from_fn(|axis, _| {
                    let off = if axis == flat {
                        0.0
                    } else {
                        random.f64() - 0.5
                    };
                    centre[axis] + off
                })
            });
            triangles.extend(Polygon::new(corners.collect()).ok());
        }
        triangles
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// The reference looks at every surface.
        #[test]
        fn boxes_first_meet_what_looking_at_every_surface_meets(seed in any::<u64>(), many in 16..400_usize) {
            let fast = Obstacles::new(scattered(seed, many));
            let plain = Obstacles { bounds: None, ..fast.clone() };
            prop_assert!(fast.bounds.is_some());
            let mut random = fastrand::Rng::with_seed(!seed);
            for _ in 0..50 {
                let mut place = || Vector3::from_fn(|_, _| 5.0 * random.f64() - 2.5);
                let (from, mut to) = (place(), place());
                if random.bool() {
                    to[random.usize(0..3)] = from[0];
                }
                let least = random.f64() * 0.3;
                let direction = to - from;
                prop_assert_eq!(fast.first_hit(&from, &direction, least), plain.first_hit(&from, &direction, least));
                prop_assert_eq!(fast.blocked(&from, &to), plain.blocked(&from, &to));
            }
        }
    }
}
