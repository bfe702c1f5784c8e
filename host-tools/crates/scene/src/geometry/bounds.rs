//! Boxes around surfaces in a tree, so that a ray meets few of many.

use super::polygon::Polygon;
use bvh::aabb::{Aabb, Bounded, IntersectsAabb};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use nalgebra::{Point3, Vector3};

/// Part of a surface's size that its box is wider: a flat box has no inside to hit.
const WIDER: f64 = 1e-6;

/// The boxes of all surfaces of a scene.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
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

impl Bounds {
    pub(super) fn new(facets: &[Polygon]) -> Self {
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
    pub(super) fn near<'a>(&'a self, stretch: &'a Stretch) -> impl Iterator<Item = usize> + 'a {
        let met = self.tree.traverse_iterator(stretch, &self.boxes);
        met.map(|near| near.facet)
    }
}

/// Part of a line, from `origin` to that many lengths of `direction` away.
pub(super) struct Stretch {
    pub(super) origin: Vector3<f64>,
    pub(super) direction: Vector3<f64>,
    pub(super) lengths: f64,
}

impl IntersectsAabb<f64, 3> for Stretch {
    fn intersects_aabb(&self, aabb: &Aabb<f64, 3>) -> bool {
        let (mut enters, mut leaves) = (0.0_f64, self.lengths);
        for axis in 0..3 {
            let (start, slope) = (self.origin[axis], self.direction[axis]);
            let (least, most) = (aabb.min[axis], aabb.max[axis]);
            if slope == 0.0 {
                if start < least || start > most {
                    return false;
                }
                continue;
            }
            let (a, b) = ((least - start) / slope, (most - start) / slope);
            enters = enters.max(a.min(b));
            leaves = leaves.min(a.max(b));
        }
        enters <= leaves
    }
}
