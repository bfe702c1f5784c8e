//! Contour integration: the exchange area of two polygons by Stokes' theorem, as integrals along
//! both outlines.
//!
//! `S = 1/(2 pi) sum over pairs of edges (u . v) I`, `I` the integral of
//! `ln r` over both edges of directions `u` and `v`. Edges at right angles give
//! nothing, parallel ones have an elementary closed form; for others the inner
//! integral is closed and the outer one a Gauss rule, graded towards the place
//! where the edges come nearest, so that shared corners and edges converge too.
//!
//! Sources: Sparrow, *A New and Simpler Formulation for Radiative Angle Factors*
//! (1963); Schroeder, Hanrahan, *On the Form Factor between Two Polygons* (1993).

use super::quadrature::{MOST_NODES, rule};
use crate::geometry::Polygon;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Sine of the angle below which edges count as parallel.
const PARALLEL: f64 = 1e-11;
/// Cosine below which edges count as at right angles.
const RIGHT: f64 = 1e-15;
/// Grading of the outer integral towards the nearest place: `s = x^GRADE`
/// makes the `t ln t` of a shared corner six times differentiable.
const GRADE: i32 = 6;
/// How often a graded stretch is halved at most.
const HALVINGS: usize = 12;
/// Part of the edges' lengths that rounding leaves no hope below.
const ROUNDING: f64 = 1e-14;

/// Exchange area, m^2, of polygons that are wholly in front of each other, to
/// about `error` m^2.
pub(super) fn exchange_area(a: &Polygon, b: &Polygon, error: f64) -> f64 {
    // The unit of length drops out because outlines are closed; near 1, the
    // logarithms are small and cancel least.
    let origin = a.centroid();
    let unit = (b.centroid() - origin).norm().max(a.size()).max(b.size());
    let edges = |polygon: &Polygon| -> Vec<Edge> {
        polygon
            .edges()
            .filter_map(|(from, to)| Edge::new((from - origin) / unit, (to - origin) / unit))
            .collect()
    };
    let (a, b) = (edges(a), edges(b));
    let share = TAU * error / (unit * unit * (a.len() * b.len()) as f64);
    let pairs = a.iter().flat_map(|e| b.iter().map(move |f| (e, f)));
    pairs.map(|(e, f)| edge_pair(e, f, share)).sum::<f64>() / TAU * unit * unit
}

/// An edge by its start, unit direction and length.
#[derive(Clone, Copy, Debug)]
struct Edge {
    start: Vector3<f64>,
    direction: Vector3<f64>,
    length: f64,
}

impl Edge {
    fn new(from: Vector3<f64>, to: Vector3<f64>) -> Option<Self> {
        let length = (to - from).norm();
        (length > 0.0).then(|| Self {
            start: from,
            direction: (to - from) / length,
            length,
        })
    }

    fn at(&self, along: f64) -> Vector3<f64> {
        self.start + self.direction * along
    }

    /// Place nearest to a point, as a length along the edge.
    fn nearest(&self, place: &Vector3<f64>) -> f64 {
        let along = (place - self.start).dot(&self.direction);
        along.clamp(0.0, self.length)
    }
}

/// `(u . v)` times the integral of `ln r` over both edges.
fn edge_pair(a: &Edge, b: &Edge, error: f64) -> f64 {
    let cosine = a.direction.dot(&b.direction);
    if cosine.abs() < RIGHT {
        return 0.0;
    }
    if a.direction.cross(&b.direction).norm() < PARALLEL {
        return cosine * parallel(a, b, cosine);
    }
    // The shorter edge sees the other one vary less.
    let (outer, inner) = if b.length < a.length { (b, a) } else { (a, b) };
    cosine * skew(outer, inner, error / cosine.abs())
}

/// The integral of `ln r` over two parallel edges, closed form.
fn parallel(a: &Edge, b: &Edge, cosine: f64) -> f64 {
    let start = if cosine > 0.0 {
        b.start
    } else {
        b.at(b.length)
    };
    let offset = a.start - start;
    let along = offset.dot(&a.direction);
    let distance = (offset - a.direction * along).norm();
    let h = |z: f64| twice_integrated_logarithm(z, distance);
    h(along + a.length) + h(along - b.length) - h(along + a.length - b.length) - h(along)
}

/// A second antiderivative of `ln sqrt(z^2 + d^2)` over z.
fn twice_integrated_logarithm(z: f64, d: f64) -> f64 {
    let (z2, d2) = (z * z, d * d);
    if z2 + d2 == 0.0 {
        return 0.0;
    }
    // d = 0: z d atan(z / d) vanishes, and atan2 needs no division.
    0.25 * (z2 - d2) * (z2 + d2).ln() + z * d * z.atan2(d) - 0.75 * z2
}

/// The integral of `ln r` over two edges at an angle.
fn skew(outer: &Edge, inner: &Edge, error: f64) -> f64 {
    let nearest = nearest_along(outer, inner);
    let gap = {
        let place = outer.at(nearest);
        (place - inner.at(inner.nearest(&place))).norm()
    };
    let integrand = |along: f64| logarithm_over(inner, &outer.at(along));
    let wanted = error / (outer.length * inner.length);
    if let Some(nodes) = nodes(gap / outer.length, wanted) {
        let sum = rule(nodes)
            .iter()
            .map(|(x, w)| w * integrand(x * outer.length));
        return outer.length * sum.sum::<f64>();
    }
    // Two stretches, each graded towards the nearest place.
    let stretch = |length: f64, sign: f64| {
        let graded = |x: f64| {
            let slope = length * f64::from(GRADE) * x.powi(GRADE - 1);
            slope * integrand(nearest + sign * length * x.powi(GRADE))
        };
        if length > 0.0 {
            let least = ROUNDING * outer.length * inner.length;
            adaptive(&graded, (0.0, 1.0), (error / 2.0).max(least), HALVINGS)
        } else {
            0.0
        }
    };
    stretch(nearest, -1.0) + stretch(outer.length - nearest, 1.0)
}

/// Nodes that reach a relative error when the singularity is `gap` lengths from
/// the interval: the rule converges as the ellipse of analyticity allows
/// (Trefethen, *Is Gauss Quadrature Better than Clenshaw-Curtis?*, 2008).
/// `None` if a graded rule does it with fewer.
fn nodes(gap: f64, error: f64) -> Option<usize> {
    let height = 2.0 * gap;
    let ellipse = height + height.hypot(1.0);
    let nodes = -error.max(1e-16).ln() / (2.0 * ellipse.ln()) + 1.0;
    (nodes <= MOST_NODES as f64).then(|| nodes.ceil().max(2.0) as usize)
}

/// Where `outer` comes nearest to `inner`, as a length along it.
fn nearest_along(outer: &Edge, inner: &Edge) -> f64 {
    let apart = inner.start - outer.start;
    let cosine = outer.direction.dot(&inner.direction);
    let (x, y) = (apart.dot(&outer.direction), apart.dot(&inner.direction));
    let crossing = (x - cosine * y) / (1.0 - cosine * cosine);
    let on_outer = crossing.clamp(0.0, outer.length);
    let on_inner = inner.nearest(&outer.at(on_outer));
    outer.nearest(&inner.at(on_inner))
}

/// The integral of `ln r` from a place over an edge, closed form.
fn logarithm_over(edge: &Edge, place: &Vector3<f64>) -> f64 {
    let apart = place - edge.start;
    let before = apart.dot(&edge.direction);
    let after = edge.length - before;
    let distance = (apart - edge.direction * before).norm();
    let part = |z: f64| {
        let squared = z * z + distance * distance;
        if squared > 0.0 { z * squared.ln() } else { 0.0 }
    };
    let angle = (edge.length * distance).atan2(distance * distance - before * after);
    0.5 * (part(before) + part(after)) - edge.length + distance * angle
}

/// Halves an interval until two rules agree on each part to `error`.
fn adaptive(f: &dyn Fn(f64) -> f64, (from, to): (f64, f64), error: f64, halvings: usize) -> f64 {
    let by = |nodes: usize| -> f64 {
        let sum = rule(nodes)
            .iter()
            .map(|(x, w)| w * f(from + (to - from) * x));
        (to - from) * sum.sum::<f64>()
    };
    let (coarse, fine) = (by(6), by(10));
    if halvings == 0 || (fine - coarse).abs() <= error {
        return fine;
    }
    let middle = f64::midpoint(from, to);
    adaptive(f, (from, middle), error, halvings - 1)
        + adaptive(f, (middle, to), error, halvings - 1)
}
