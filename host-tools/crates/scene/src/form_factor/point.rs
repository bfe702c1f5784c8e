//! Point-to-polygon form factor: how much of what a point receives comes from a polygon.

use crate::geometry::{Plane, Polygon};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Form factor from a point with this unit normal to a polygon, 0 to 1: the
/// share of the light leaving the point that arrives, and the irradiance there
/// of a polygon of radiosity 1. What is below the point's horizon gives
/// nothing; a point behind the polygon receives nothing.
///
/// Lambert, *Photometria* (1760); Baum, Rushmeier, Winget, *Improving Radiosity
/// Solutions through the Use of Analytically Determined Form-Factors* (1989).
#[must_use]
pub fn from_point(place: &Vector3<f64>, normal: &Vector3<f64>, polygon: &Polygon) -> f64 {
    if polygon.plane().distance(place) <= 0.0 {
        return 0.0;
    }
    let horizon = Plane::through(*place, *normal);
    let below = |corner: &Vector3<f64>| horizon.distance(corner) < 0.0;
    if polygon.corners().iter().any(below) {
        return match polygon.clipped(&horizon) {
            Some(part) => above_horizon(place, normal, part.corners()),
            None => 0.0,
        };
    }
    above_horizon(place, normal, polygon.corners())
}

/// The same for corners that are all above the horizon, in the order of a
/// polygon that faces the point.
pub(super) fn above_horizon(
    place: &Vector3<f64>,
    normal: &Vector3<f64>,
    corners: &[Vector3<f64>],
) -> f64 {
    let mut sum = 0.0;
    let Some(last) = corners.last() else {
        return 0.0;
    };
    let mut from = last - place;
    for corner in corners {
        let to = corner - place;
        let across = from.cross(&to);
        let sine = across.norm();
        if sine > 0.0 {
            sum += sine.atan2(from.dot(&to)) * across.dot(normal) / sine;
        }
        from = to;
    }
    // Counter-clockwise for who faces the polygon is clockwise around its own
    // normal's far side: the sum is negative.
    (-sum / TAU).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(width: f64, height: f64, distance: f64) -> Polygon {
        let (w, h, z) = (width, height, distance);
        // Faces down, to the origin.
        crate::geometry::polygon(&[[0., 0., z], [0., h, z], [w, h, z], [w, 0., z]])
    }

    /// Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*, B-3:
    /// a plane element to a parallel rectangle, over its corner.
    fn howell_b3(width: f64, height: f64, distance: f64) -> f64 {
        let (a, b) = (width / distance, height / distance);
        let (p, q) = (a.hypot(1.0), b.hypot(1.0));
        (a / p * (b / p).atan() + b / q * (a / q).atan()) / TAU
    }

    #[test]
    fn a_rectangle_over_a_point_gives_the_catalogues_factor() {
        for (w, h, d) in [(1.0, 1.0, 1.0), (3.0, 0.2, 0.7), (100.0, 80.0, 0.01)] {
            let found = from_point(&Vector3::zeros(), &Vector3::z(), &rectangle(w, h, d));
            assert!((found - howell_b3(w, h, d)).abs() < 1e-14, "{found}");
        }
    }

    #[test]
    fn a_point_sees_nothing_of_a_polygons_back_and_below_its_horizon() {
        let back = rectangle(1.0, 1.0, 1.0).flipped();
        assert!(from_point(&Vector3::zeros(), &Vector3::z(), &back).abs() < f64::MIN_POSITIVE);
        let polygon = rectangle(1.0, 1.0, 1.0);
        assert!(from_point(&Vector3::zeros(), &-Vector3::z(), &polygon).abs() < f64::MIN_POSITIVE);
    }

    /// Howell B-4: a plane element to a perpendicular rectangle standing on its
    /// plane.
    #[test]
    fn a_wall_that_reaches_below_the_horizon_counts_down_to_it() {
        let (width, height, distance) = (2.0_f64, 1.5_f64, 0.8_f64);
        let (y, x) = (width / distance, height / distance);
        let root = x.hypot(1.0);
        let known = (y.atan() - (y / root).atan() / root) / TAU;
        let (x0, h, w) = (distance, height, width);
        let wall = [[x0, 0., -3.], [x0, 0., h], [x0, w, h], [x0, w, -3.]];
        let wall = crate::geometry::polygon(&wall);
        let found = from_point(&Vector3::zeros(), &Vector3::z(), &wall);
        assert!((found - known).abs() < 1e-14, "{found} {known}");
    }
}
