//! Form factors against formulas and constructions from outside this code.

use super::*;
use crate::geometry::polygon;
use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;
use std::f64::consts::PI;

fn tight() -> Tolerance {
    Tolerance::new(1e-10)
}

/// Rectangle 0..w x 0..h in the plane z = 0, facing up.
fn floor(w: f64, h: f64) -> Polygon {
    polygon(&[[0., 0., 0.], [w, 0., 0.], [w, h, 0.], [0., h, 0.]])
}

/// The same rectangle at height `z`, facing down.
fn ceiling(w: f64, h: f64, z: f64) -> Polygon {
    polygon(&[[0., 0., z], [0., h, z], [w, h, z], [w, 0., z]])
}

/// Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*, C-11:
/// identical, parallel, directly opposed rectangles.
fn howell_c11(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (x1, y1) = (1.0 + x * x, 1.0 + y * y);
    let root = (x1 * y1 / (1.0 + x * x + y * y)).ln() / 2.0;
    let (rx, ry) = (x1.sqrt(), y1.sqrt());
    2.0 / (PI * x * y)
        * (root + x * ry * (x / ry).atan() + y * rx * (y / rx).atan() - x * x.atan() - y * y.atan())
}

/// Howell C-14: two rectangles with a common edge of length `l` at right angles,
/// from the one of height `h` to the one of width `w`; here from w to h with
/// H = h/l, W = w/l.
fn howell_c14(w: f64, h: f64, l: f64) -> f64 {
    let (h, w) = (h / l, w / l);
    let (h2, w2) = (h * h, w * w);
    let root = (h2 + w2).sqrt();
    let logarithm = ((1.0 + w2) * (1.0 + h2) / (1.0 + w2 + h2)).ln()
        + w2 * (w2 * (1.0 + w2 + h2) / ((1.0 + w2) * (w2 + h2))).ln()
        + h2 * (h2 * (1.0 + h2 + w2) / ((1.0 + h2) * (h2 + w2))).ln();
    (w * (1.0 / w).atan() + h * (1.0 / h).atan() - root * (1.0 / root).atan() + logarithm / 4.0)
        / (PI * w)
}

#[test]
fn opposed_rectangles_give_the_catalogues_factor_to_rounding() {
    for (a, b, c) in [
        (1.0, 1.0, 1.0),
        (2.0, 0.5, 0.1),
        (3.0, 1.0, 1.5),
        (1.0, 0.02, 0.3),
    ] {
        let found = exchange_area(&floor(a, b), &ceiling(a, b, c), tight()) / (a * b);
        let known = howell_c11(a, b, c);
        assert!(
            (found / known - 1.0).abs() < 1e-11,
            "{a} {b} {c}: {found} {known}"
        );
    }
}

#[test]
fn rectangles_at_a_right_angle_give_the_catalogues_factor_to_rounding() {
    for (w, h, l) in [
        (1.0, 1.0, 1.0),
        (0.3, 2.0, 1.0),
        (5.0, 0.1, 1.0),
        (0.01, 0.01, 1.0),
    ] {
        let wall = polygon(&[[0., 0., 0.], [0., l, 0.], [0., l, h], [0., 0., h]]);
        let found = exchange_area(&floor(w, l), &wall, tight()) / (w * l);
        let known = howell_c14(w, h, l);
        assert!(
            (found / known - 1.0).abs() < 1e-10,
            "{w} {h} {l}: {found} {known}"
        );
    }
}

/// The closed forms at a cube: .19982 across, .20004 beside; five see a sixth wholly.
#[test]
fn the_faces_of_a_cube_see_each_other_wholly() {
    let across = exchange_area(&floor(1.0, 1.0), &ceiling(1.0, 1.0, 1.0), tight());
    let wall = polygon(&[[0., 0., 0.], [0., 1., 0.], [0., 1., 1.], [0., 0., 1.]]);
    let beside = exchange_area(&floor(1.0, 1.0), &wall, tight());
    assert!(
        (across - 0.199_824_895_698_387_18).abs() < 1e-12,
        "{across}"
    );
    assert!((beside - 0.200_043_776).abs() < 1e-8, "{beside}");
    assert!((across + 4.0 * beside - 1.0).abs() < 1e-12);
}

/// Hottel's crossed strings, *Radiant Heat Transmission* (1954): two strips of
/// widths a, b with a common edge of angle t: F = (a + b - c) / 2a. The strips are
/// finite here; ends of a strip of length l cost about (a + b) / l.
#[test]
fn long_strips_of_a_wedge_of_any_angle_give_hottels_crossed_strings() {
    for degrees in [10.0_f64, 30.0, 75.0, 90.0, 120.0, 170.0] {
        let angle = degrees.to_radians();
        let (a, b) = (1.0, 0.6);
        let c = ((b * angle.cos() - a).powi(2) + (b * angle.sin()).powi(2)).sqrt();
        let known = (a + b - c) / (2.0 * a);
        let found = |l: f64| {
            let (x, z) = (b * angle.cos(), b * angle.sin());
            let wall = polygon(&[[0., 0., 0.], [0., l, 0.], [x, l, z], [x, 0., z]]);
            exchange_area(&floor(a, l), &wall, tight()) / (a * l)
        };
        // The end effect is c1 / l + O(l^-2): Richardson takes c1 out.
        let (short, long) = (found(500.0), found(1000.0));
        let limit = 2.0 * long - short;
        assert!(
            (limit - known).abs() < 1e-5 * known,
            "{degrees}: {limit} {known}"
        );
    }
}

/// Inside a sphere `F_pq = A_q / (4 pi R^2)` whatever the places; facets of an
/// inscribed polyhedron come near it as they shrink.
#[test]
fn small_facets_inside_a_sphere_exchange_by_their_areas_alone() {
    let facet = |size: f64, turn: Rotation3<f64>| {
        let ring = (0..5).map(|k| {
            let angle = -f64::from(k) / 5.0 * 2.0 * PI;
            let (x, y) = (size * angle.cos(), size * angle.sin());
            turn * Vector3::new(x, y, (1.0 - size * size).sqrt())
        });
        Polygon::new(ring.collect()).unwrap()
    };
    let mut last = f64::INFINITY;
    for size in [0.2, 0.1, 0.05, 0.025] {
        let a = facet(size, Rotation3::identity());
        let mut worst = 0.0_f64;
        for angle in [0.6, 1.0, 2.0, 3.0] {
            let b = facet(size, Rotation3::from_euler_angles(angle, 0.3, 0.1));
            let found = exchange_area(&a, &b, tight());
            let known = a.area() * b.area() / (4.0 * PI);
            worst = worst.max((found / known - 1.0).abs());
        }
        assert!(worst < 2.0 * size * size && worst < last, "{size}: {worst}");
        last = worst;
    }
}

fn unit(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
}

/// Triangles and quadrangles anywhere near the origin, some sharing a corner.
fn anywhere() -> impl Strategy<Value = Polygon> {
    let part = -1.0..1.0_f64;
    let at = (part.clone(), part.clone(), part.clone()).prop_map(|(x, y, z)| unit(x, y, z));
    let corner = prop_oneof![at.clone(), Just(unit(0.2, 0.1, 0.0))];
    (
        corner,
        at.clone(),
        at,
        0.2..1.5_f64,
        0.2..1.5_f64,
        any::<bool>(),
    )
        .prop_filter_map("spans an area", |(a, u, v, p, q, triangle)| {
            let corners = if triangle {
                vec![a, a + u, a + v]
            } else {
                vec![a, a + u, a + u * p + v * q, a + v]
            };
            Polygon::new(corners).ok().filter(|p| p.area() > 1e-3)
        })
}

proptest! {
    #[test]
    fn exchange_is_the_same_both_ways_and_no_more_than_all_light(
        a in anywhere(), b in anywhere(),
    ) {
        let there = exchange_area(&a, &b, Tolerance::default());
        let back = exchange_area(&b, &a, Tolerance::default());
        prop_assert_eq!(there.to_bits(), back.to_bits());
        prop_assert!(there >= 0.0);
        prop_assert!(there <= a.area().min(b.area()) * (1.0 + 1e-6), "{there}");
    }

    #[test]
    fn a_cut_polygons_parts_exchange_what_the_whole_does(
        a in anywhere(), b in anywhere(), x in -0.5..0.5_f64, angle in 0.0..6.3_f64,
    ) {
        let normal = unit(angle.cos(), angle.sin(), 0.3).normalize();
        let plane = crate::geometry::Plane::through(b.centroid() + normal * (x * b.size()), normal);
        let whole = exchange_area(&a, &b, Tolerance::new(1e-8));
        let parts = [b.clipped(&plane), b.clipped(&plane.flipped())];
        let sum: f64 = parts.iter().flatten().map(|p| exchange_area(&a, p, Tolerance::new(1e-8))).sum();
        // What is below 1e-9 of the areas is lost in the clipping's own tolerance.
        let slack = 1e-7 * whole + 1e-9 * a.area().min(b.area());
        prop_assert!((sum - whole).abs() <= slack, "{whole} {sum}");
    }

    /// The contour and the rules on both areas are two methods: they must agree
    /// on far polygons to the tolerance that was asked for.
    #[test]
    fn far_polygons_exchange_the_same_by_area_as_by_outline(
        a in anywhere(), b in anywhere(), away in 3.0..60.0_f64, tolerance in 3.0..9.0_f64,
    ) {
        let move_by = unit(0.3, -0.5, 0.8).normalize() * away;
        let far = Polygon::new(b.corners().iter().map(|c| c + move_by).collect()).unwrap();
        let (a, far) = ordered(&a, &far);
        if let Some((a, b)) = parts_in_front(a, far) {
            let tolerance = Tolerance::new(10.0_f64.powf(-tolerance));
            let found = exchange_area(&a, &b, tolerance);
            let outline = contour::exchange_area(&a, &b, 1e-13 * found);
            // The outlines cancel more, the farther they are.
            let rounding = 1e-14 * away * a.size().max(b.size()).powi(2);
            prop_assert!(
                (found - outline).abs() <= tolerance.relative() * outline + rounding,
                "{found} {outline} {}", found / outline - 1.0
            );
        }
    }
}
