//! Gauss-Legendre rules on an interval and on convex polygons.

use crate::geometry::Polygon;
use gauss_quad::legendre::GaussLegendre;
use nalgebra::Vector3;
use std::num::NonZeroUsize;
use std::sync::LazyLock;

/// The most nodes a rule on an interval has.
pub(super) const MOST_NODES: usize = 16;
/// The most nodes per direction a rule on a polygon has.
pub(super) const MOST_ORDER: usize = 4;

/// Node in 0..1 and weight, the weights of a rule summing to 1.
pub(super) type Node = (f64, f64);

static RULES: LazyLock<Vec<Vec<Node>>> = LazyLock::new(|| {
    let rule = |nodes: usize| match NonZeroUsize::new(nodes) {
        Some(nodes) => GaussLegendre::new(nodes)
            .iter()
            .map(|(x, w)| (f64::midpoint(*x, 1.0), w / 2.0))
            .collect(),
        None => Vec::new(),
    };
    (0..=MOST_NODES).map(rule).collect()
});

/// The rule of this many nodes, at most [`MOST_NODES`].
pub(super) fn rule(nodes: usize) -> &'static [Node] {
    &RULES[nodes.min(MOST_NODES)]
}

/// A place on a polygon and the area, m^2, that it stands for.
pub(super) type QuadraturePoint = (Vector3<f64>, f64);

/// Places on a convex polygon that integrate polynomials of degree
/// `2 order - 1` over it exactly, `2 order - 2` if it is a quadrangle but no
/// parallelogram; the areas sum to the polygon's.
pub(super) fn samples(polygon: &Polygon, order: usize) -> Vec<QuadraturePoint> {
    let corners = polygon.corners();
    if order <= 1 {
        return vec![(polygon.centroid(), polygon.area())];
    }
    if let [a, b, c, d] = corners {
        return quadrangle(&[*a, *b, *c, *d], order);
    }
    let triangles = corners[1..].windows(2);
    triangles
        .flat_map(|side| triangle(&[corners[0], side[0], side[1]], order))
        .collect()
}

/// How far a quadrangle is from a parallelogram, in parts of its size; 0 for other polygons.
pub(super) fn irregularity(polygon: &Polygon) -> f64 {
    match polygon.corners() {
        [a, b, c, d] => (a - b + c - d).norm() / polygon.size(),
        _ => 0.0,
    }
}

/// The product rule, mapped bilinearly.
pub(super) fn quadrangle([a, b, c, d]: &[Vector3<f64>; 4], order: usize) -> Vec<QuadraturePoint> {
    let mut samples = Vec::with_capacity(order * order);
    for (x, wx) in rule(order) {
        let (bottom, top) = (a + (b - a) * *x, d + (c - d) * *x);
        for (y, wy) in rule(order) {
            let along = (b - a) * (1.0 - y) + (c - d) * *y;
            let stretch = along.cross(&(top - bottom)).norm();
            samples.push((bottom + (top - bottom) * *y, wx * wy * stretch));
        }
    }
    samples
}

/// The product rule on the square that collapses into the triangle; one node
/// more across, where the width adds a degree.
fn triangle([a, b, c]: &[Vector3<f64>; 3], order: usize) -> Vec<QuadraturePoint> {
    let area = (b - a).cross(&(c - a)).norm() / 2.0;
    let mut samples = Vec::with_capacity((order + 1) * order);
    for (x, wx) in rule(order + 1) {
        for (y, wy) in rule(order) {
            let place = a + ((b - a) * (1.0 - y) + (c - a) * *y) * *x;
            samples.push((place, 2.0 * x * wx * wy * area));
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_integrate_the_area_and_the_centre_of_any_convex_polygon() {
        for corners in 3..9_usize {
            let corner = |k: usize| {
                let angle = k as f64 / corners as f64 * std::f64::consts::TAU;
                Vector3::new(2.0 * angle.cos(), angle.sin(), 0.3 * angle.cos())
            };
            let polygon = Polygon::new((0..corners).map(corner).collect()).unwrap();
            for order in 1..=MOST_ORDER {
                let samples = samples(&polygon, order);
                let area: f64 = samples.iter().map(|s| s.1).sum();
                let centre = samples.iter().map(|s| s.0 * s.1).sum::<Vector3<f64>>() / area;
                assert!((area - polygon.area()).abs() < 1e-14 * area, "{corners}");
                assert!((centre - polygon.centroid()).norm() < 1e-14, "{corners}");
            }
        }
    }
}
