//! Sampled polygons, made ready for many form factors.

use super::quadrature::{MOST_ORDER, QuadraturePoint, irregularity, samples};
use super::{Tolerance, contour, ordered};
use crate::geometry::Polygon;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Product of the cosines at both ends below which two polygons are taken as
/// in one plane: they exchange less than that part of their areas.
const IN_ONE_PLANE: f64 = 1e-15;

/// How much larger than `ellipse^(-2 order)` the error of a Gauss rule on the kernel
/// gets. With this, 50,000 random pairs stay within their tolerance (`PROPTEST_CASES=50000
/// cargo test -p iltm-scene --lib far_polygons`).
const KERNEL: f64 = 8.0;

/// A polygon with places on it for Gauss rules of every order.
#[derive(Clone, Debug)]
pub struct Sampled {
    polygon: Polygon,
    centre: Vector3<f64>,
    /// Of the circle around the centre of area that holds it, metres.
    radius: f64,
    irregularity: f64,
    samples: Vec<Vec<QuadraturePoint>>,
}

impl Sampled {
    /// Places on `polygon`.
    #[must_use]
    pub fn new(polygon: Polygon) -> Self {
        let centre = polygon.centroid();
        let distance = |c: &Vector3<f64>| (c - centre).norm();
        Self {
            radius: polygon.corners().iter().map(distance).fold(0.0, f64::max),
            samples: (1..=MOST_ORDER).map(|n| samples(&polygon, n)).collect(),
            irregularity: irregularity(&polygon),
            centre,
            polygon,
        }
    }

    /// The polygon.
    #[must_use]
    pub fn polygon(&self) -> &Polygon {
        &self.polygon
    }

    /// Exchange area, m^2, of two polygons that are wholly in front of each
    /// other's planes, with nothing between them. The same bits either way
    /// round.
    #[must_use]
    pub fn exchange_area(&self, other: &Self, tolerance: Tolerance) -> f64 {
        let apart = other.centre - self.centre;
        let squared = apart.norm_squared();
        let cosines = (
            self.polygon.normal().dot(&apart),
            -other.polygon.normal().dot(&apart),
        );
        let product = cosines.0 * cosines.1;
        // Written so that NaN of coinciding centres is refused too.
        let exchanges = cosines.0 > 0.0 && product > IN_ONE_PLANE * squared;
        if !exchanges {
            return 0.0;
        }
        let areas = self.polygon.area() * other.polygon.area();
        let estimate = areas * product / (PI * squared * squared);
        let order = self.order(other, squared.sqrt(), cosines, tolerance);
        match order {
            Some(1) => estimate,
            Some(order) => self.by_samples(other, order),
            None => self.by_contour(other, estimate, tolerance),
        }
    }

    /// Order of the Gauss rule on both areas that reaches the tolerance; `None`
    /// if the outlines do it better.
    ///
    /// The rule converges like `ellipse^(-2 order)`, the ellipse set by how far
    /// the other polygon is in units of the own size; a cosine near 0 varies by
    /// more than itself and leaves less.
    fn order(
        &self,
        other: &Self,
        distance: f64,
        cosines: (f64, f64),
        tolerance: Tolerance,
    ) -> Option<usize> {
        let radius = self.radius.max(other.radius);
        let apart = (distance - radius) / radius;
        if apart <= 2.0 {
            return None;
        }
        let cosine = cosines.0.min(cosines.1) / distance;
        let ellipse = apart + (apart * apart - 1.0).sqrt();
        let wanted = tolerance.relative() * cosine / KERNEL;
        let irregularity = self.irregularity.max(other.irregularity);
        (1..=MOST_ORDER).find(|order| {
            // The centre of area has no term of first order, whatever the shape.
            let irregular = if *order > 1 {
                irregularity * ellipse
            } else {
                0.0
            };
            (1.0 + irregular) * ellipse.powi(-2 * *order as i32) <= wanted
        })
    }

    /// By Gauss rules on both areas.
    fn by_samples(&self, other: &Self, order: usize) -> f64 {
        let (a, b) = self.in_order(other);
        let normals = (a.polygon.normal(), b.polygon.normal());
        let mut sum = 0.0;
        for (x, area) in &a.samples[order - 1] {
            let mut from_x = 0.0;
            for (y, weight) in &b.samples[order - 1] {
                let apart = y - x;
                let squared = apart.norm_squared();
                let cosines = normals.0.dot(&apart) * -normals.1.dot(&apart);
                from_x += weight * cosines / (squared * squared);
            }
            sum += area * from_x;
        }
        (sum / PI).max(0.0)
    }

    /// By the outlines. `estimate` sets what error, m^2, the tolerance means; where
    /// the answer turns out much smaller, it is asked for again.
    fn by_contour(&self, other: &Self, estimate: f64, tolerance: Tolerance) -> f64 {
        let (a, b) = self.in_order(other);
        let most = a.polygon.area().min(b.polygon.area());
        let by = |size: f64| {
            let error = tolerance.relative() * size;
            contour::exchange_area(&a.polygon, &b.polygon, error).clamp(0.0, most)
        };
        let estimate = estimate.min(most);
        let found = by(estimate);
        if found > 0.0 && found < estimate / 4.0 {
            by(found)
        } else {
            found
        }
    }

    fn in_order<'a>(&'a self, other: &'a Self) -> (&'a Self, &'a Self) {
        let (first, _) = ordered(&self.polygon, &other.polygon);
        if std::ptr::eq(first, &raw const self.polygon) {
            (self, other)
        } else {
            (other, self)
        }
    }
}
