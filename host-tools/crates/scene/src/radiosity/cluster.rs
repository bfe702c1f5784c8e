//! Cluster tree: patches in groups of groups, near ones together.

use super::Element;
use crate::form_factor::shaft::Hull;
use crate::geometry::{Plane, Polygon};
use nalgebra::Vector3;
use std::ops::Range;

/// Patches of a small surface.
const SMALL: usize = 4;

/// A group of patches.
#[derive(Debug)]
pub(super) struct Cluster {
    /// Places of its patches in [`Clusters::order`].
    pub(super) range: Range<usize>,
    /// A convex hull that holds them.
    pub(super) hull: Hull,
    /// The middle of that, and how far it reaches from there, metres.
    pub(super) centre: Vector3<f64>,
    pub(super) radius: f64,
    /// The surfaces that they lie on, ascending.
    pub(super) facets: Vec<usize>,
    /// Two halves, unless it is small.
    pub(super) halves: Option<[usize; 2]>,
}

impl Cluster {
    /// The only surface that its patches lie on.
    pub(super) fn facet(&self) -> Option<usize> {
        (self.facets.len() == 1).then(|| self.facets[0])
    }
}

/// A binary tree of clusters: first surfaces apart, then parts of a surface.
#[derive(Debug)]
pub(super) struct Clusters {
    /// Patches so that every cluster's are next to each other.
    pub(super) order: Vec<usize>,
    /// The tree, its root first; empty without patches.
    pub(super) nodes: Vec<Cluster>,
}

impl Clusters {
    /// Halves patches along their largest extent until at most `leaf` are
    /// together, on one surface, or on many small ones.
    pub(super) fn new(patches: &[Element], leaf: usize) -> Self {
        let mut clusters = Self {
            order: (0..patches.len()).collect(),
            nodes: Vec::new(),
        };
        if !patches.is_empty() {
            let centres: Vec<_> = patches.iter().map(|p| p.polygon.centroid()).collect();
            clusters.grow(patches, &centres, 0..patches.len(), leaf);
        }
        clusters
    }

    fn grow(
        &mut self,
        patches: &[Element],
        centres: &[Vector3<f64>],
        range: Range<usize>,
        leaf: usize,
    ) -> usize {
        let index = self.nodes.len();
        let members = &mut self.order[range.clone()];
        let node = cluster(patches, members, range.clone());
        // Surfaces of a few patches each are decided on pair by pair of patches;
        // others by the surface.
        let small = node.facet().is_some() || node.facets.len() * SMALL > range.len();
        let split =
            (range.len() > leaf.max(1) || !small).then(|| halve(patches, centres, members, &node));
        self.nodes.push(node);
        if let Some(split) = split {
            let middle = range.start + split;
            let first = self.grow(patches, centres, range.start..middle, leaf);
            let second = self.grow(patches, centres, middle..range.end, leaf);
            self.nodes[index].halves = Some([first, second]);
        }
        index
    }
}

fn cluster(patches: &[Element], members: &[usize], range: Range<usize>) -> Cluster {
    let mut facets: Vec<usize> = members.iter().map(|p| patches[*p].facet).collect();
    facets.sort_unstable();
    facets.dedup();
    let hull = if facets.len() == 1 {
        planar_hull(patches, members)
    } else {
        let corners = members.iter().flat_map(|p| patches[*p].polygon.corners());
        Hull::around(corners.copied().collect())
    };
    let points = hull.points();
    let centre = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let reach = points.iter().map(|p| (p - centre).norm());
    Cluster {
        radius: reach.fold(0.0, f64::max),
        range,
        centre,
        facets,
        halves: None,
        hull,
    }
}

/// The rectangle, along the first patch's first edge, around patches of one plane.
fn planar_hull(patches: &[Element], members: &[usize]) -> Hull {
    let first: &Polygon = &patches[members[0]].polygon;
    let (origin, normal) = (first.corners()[0], first.normal());
    let along = (first.corners()[1] - origin).normalize();
    let across = normal.cross(&along);
    let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in members.iter().flat_map(|p| patches[*p].polygon.corners()) {
        for (axis, direction) in [along, across].iter().enumerate() {
            let distance = direction.dot(&(corner - origin));
            least[axis] = least[axis].min(distance);
            most[axis] = most[axis].max(distance);
        }
    }
    let at = |x: f64, y: f64| origin + along * x + across * y;
    let outline = vec![
        at(least[0], least[1]),
        at(most[0], least[1]),
        at(most[0], most[1]),
        at(least[0], most[1]),
    ];
    Hull::planar(outline, Plane::through(origin, normal))
}

/// Sorts members along their largest extent and says where to cut: between surfaces, if
/// there are several.
fn halve(
    patches: &[Element],
    centres: &[Vector3<f64>],
    members: &mut [usize],
    node: &Cluster,
) -> usize {
    let place_of = |patch: usize| match node.facet() {
        Some(_) => centres[patch],
        None => Vector3::zeros(),
    };
    if node.facet().is_some() {
        let axis = widest(members.iter().map(|p| place_of(*p)));
        members.sort_by(|a, b| {
            let along = |p: usize| axis.dot(&centres[p]);
            along(*a).total_cmp(&along(*b)).then(a.cmp(b))
        });
        return members.len() / 2;
    }
    // Surfaces stay whole: each is sorted by the middle of its patches.
    let middles: Vec<Vector3<f64>> = node
        .facets
        .iter()
        .map(|facet| {
            let own = members.iter().filter(|p| patches[**p].facet == *facet);
            let (sum, count) = own.fold((Vector3::zeros(), 0.0), |(s, n), p| {
                (s + centres[*p], n + 1.0)
            });
            sum / count
        })
        .collect();
    let axis = widest(middles.iter().copied());
    let along = |patch: usize| {
        let facet = patches[patch].facet;
        let index = node.facets.binary_search(&facet).unwrap_or(0);
        axis.dot(&middles[index])
    };
    members.sort_by(|a, b| {
        let facets = patches[*a].facet.cmp(&patches[*b].facet);
        along(*a).total_cmp(&along(*b)).then(facets).then(a.cmp(b))
    });
    // The cut between surfaces that is nearest to the middle.
    let cuts =
        (1..members.len()).filter(|k| patches[members[*k]].facet != patches[members[k - 1]].facet);
    let middle = members.len() / 2;
    cuts.min_by_key(|k| k.abs_diff(middle)).unwrap_or(middle)
}

/// The axis of the coordinates along which places are widest apart, or a diagonal of
/// two, so that a slanted surface is cut across.
fn widest(places: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let places: Vec<_> = places.collect();
    let middle = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
    let spread = places
        .iter()
        .map(|p| (p - middle) * (p - middle).transpose());
    let spread = spread.fold(nalgebra::Matrix3::zeros(), |sum, s| sum + s);
    let axes = spread.symmetric_eigen();
    let axis = axes
        .eigenvectors
        .column(axes.eigenvalues.imax())
        .into_owned();
    // Which way an eigenvector points is arbitrary.
    axis * if axis.sum() < 0.0 { -1.0 } else { 1.0 }
}
