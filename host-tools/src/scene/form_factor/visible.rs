//! The exchange area of two polygons with obstacles between them.
//!
//! From a point of one polygon, the other one is seen without the shadows that
//! the obstacles cast on it: convex pieces, so their form factors are exact. Over the
//! first polygon the share that is seen is integrated adaptively, and the exact
//! exchange area without obstacles is multiplied by that share.

use super::quadrature::samples;
use super::shaft::{Hull, blocks_all, may_block};
use super::{Sampled, Tolerance, from_point, ordered, parts_in_front};
use crate::scene::geometry::{Obstacles, Plane, Polygon};
use nalgebra::Vector3;

/// How often a part of the first polygon is quartered at most.
const QUARTERINGS: usize = 9;
/// Order of the rule on each part.
const ORDER: usize = 2;

/// Exchange area `A_a F_ab`, m^2, with what `obstacles` leave of it; the same
/// to the last bit whichever comes first. The error of the share that is seen is relative
/// to the exchange area without obstacles.
#[must_use]
pub fn visible_exchange_area(
    a: &Polygon,
    b: &Polygon,
    tolerance: Tolerance,
    obstacles: &Obstacles,
) -> f64 {
    let (a, b) = ordered(a, b);
    let Some((a, b)) = parts_in_front(a, b) else {
        return 0.0;
    };
    let between: Vec<_> = obstacles.facets().iter().collect();
    let whole = Sampled::new(a.clone()).exchange_area(&Sampled::new(b.clone()), tolerance);
    whole * visible_share(&a, &b, tolerance, &between)
}

/// The share of the exchange area of two polygons, wholly in front of each other's
/// planes and in the order of `ordered`, that `obstacles` leave.
pub(crate) fn visible_share(
    a: &Polygon,
    b: &Polygon,
    tolerance: Tolerance,
    obstacles: &[&Polygon],
) -> f64 {
    let scene = Scene {
        normal: a.normal(),
        b,
        hull: Hull::of(b),
    };
    let from = Hull::of(a);
    let between = obstacles.iter().copied();
    let between: Vec<_> = between
        .filter(|o| may_block(&from, &scene.hull, o))
        .collect();
    if between.is_empty() {
        return 1.0;
    }
    let root = scene.part(a.clone(), &between);
    let error = tolerance.relative() * root.light.whole;
    let light = scene.refined(&root, error, QUARTERINGS);
    if light.whole > 0.0 {
        (light.seen / light.whole).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// Light from `b` that arrives on a part of `a`, as exchange area, m^2.
#[derive(Clone, Copy, Debug, Default)]
struct Light {
    seen: f64,
    whole: f64,
}

/// A part of `a`, and what may stand between it and `b`.
struct Part<'o> {
    polygon: Polygon,
    between: Vec<&'o Polygon>,
    light: Light,
}

struct Scene<'b> {
    normal: Vector3<f64>,
    b: &'b Polygon,
    hull: Hull,
}

impl Scene<'_> {
    fn part<'o>(&self, polygon: Polygon, obstacles: &[&'o Polygon]) -> Part<'o> {
        let hull = Hull::of(&polygon);
        let between = obstacles.iter().copied();
        let mut between: Vec<_> = between
            .filter(|o| may_block(&hull, &self.hull, o))
            .collect();
        let dark = between.iter().any(|o| blocks_all(&hull, &self.hull, o));
        let mut light = Light::default();
        for (place, area) in samples(&polygon, ORDER) {
            let whole = from_point(&place, &self.normal, self.b);
            light.whole += area * whole;
            light.seen += area
                * match (dark, between.is_empty()) {
                    (true, _) => 0.0,
                    (false, true) => whole,
                    (false, false) => self.seen(&place, &between),
                };
        }
        if dark {
            between.clear();
        }
        Part {
            polygon,
            between,
            light,
        }
    }

    /// Quarters a part until its quarters agree with it to `error`, m^2.
    fn refined(&self, part: &Part<'_>, error: f64, quarterings: usize) -> Light {
        if part.between.is_empty() || quarterings == 0 {
            return part.light;
        }
        let quarters = quartered(&part.polygon);
        let quarters: Vec<_> = quarters.map(|q| self.part(q, &part.between)).collect();
        let sum = |f: fn(&Light) -> f64| quarters.iter().map(|q| f(&q.light)).sum::<f64>();
        let light = Light {
            seen: sum(|l| l.seen),
            whole: sum(|l| l.whole),
        };
        // The first look may miss a shadow between its few places.
        let share = |l: Light| l.seen * light.whole / l.whole.max(f64::MIN_POSITIVE);
        let agree = (share(part.light) - light.seen).abs() <= error;
        if agree && quarterings < QUARTERINGS {
            return light;
        }
        let mut light = Light::default();
        for quarter in quarters {
            // Edges of shadows are lines: half of the quarters hold one.
            let refined = self.refined(&quarter, error / 2.0, quarterings - 1);
            light.seen += refined.seen;
            light.whole += refined.whole;
        }
        light
    }

    /// Form factor from a place to what of `b` is seen past the obstacles.
    fn seen(&self, place: &Vector3<f64>, between: &[&Polygon]) -> f64 {
        let mut pieces = vec![self.b.clone()];
        for obstacle in between {
            let mut rest = Vec::with_capacity(pieces.len() + 1);
            for piece in pieces {
                without_shadow(place, piece, obstacle, &mut rest);
            }
            pieces = rest;
        }
        pieces
            .iter()
            .map(|p| from_point(place, &self.normal, p))
            .sum()
    }
}

/// Adds to `rest` the parts of `piece` that are seen from `place` past an obstacle.
fn without_shadow(
    place: &Vector3<f64>,
    piece: Polygon,
    obstacle: &Polygon,
    rest: &mut Vec<Polygon>,
) {
    let side = obstacle.plane().distance(place);
    if side.abs() <= 1e-12 * obstacle.size() {
        rest.push(piece);
        return;
    }
    let middle = obstacle.centroid() - place;
    let mut shadowed = piece;
    for (from, to) in obstacle.edges() {
        let across = (from - place).cross(&(to - place));
        let inwards = across * across.dot(&middle).signum();
        let Some(normal) = inwards.try_normalize(0.0) else {
            continue;
        };
        let rim = Plane::through(*place, normal);
        rest.extend(shadowed.clipped(&rim.flipped()));
        match shadowed.clipped(&rim) {
            Some(part) => shadowed = part,
            None => return,
        }
    }
    // What is nearer than the obstacle is not in its shadow.
    let plane = obstacle.plane();
    let near = if side > 0.0 { *plane } else { plane.flipped() };
    rest.extend(shadowed.clipped(&near));
}

/// Four parts of a triangle or quadrangle, the triangles of any other polygon's fan.
fn quartered(polygon: &Polygon) -> impl Iterator<Item = Polygon> {
    let c = polygon.corners();
    let middle = |i: usize, j: usize| (c[i] + c[j]) / 2.0;
    let parts: Vec<Vec<Vector3<f64>>> = match c.len() {
        3 => {
            let (ab, bc, ca) = (middle(0, 1), middle(1, 2), middle(2, 0));
            vec![
                vec![c[0], ab, ca],
                vec![ab, c[1], bc],
                vec![ca, bc, c[2]],
                vec![ab, bc, ca],
            ]
        }
        4 => {
            let (ab, bc, cd, da) = (middle(0, 1), middle(1, 2), middle(2, 3), middle(3, 0));
            let centre = (ab + cd) / 2.0;
            vec![
                vec![c[0], ab, centre, da],
                vec![ab, c[1], bc, centre],
                vec![centre, bc, c[2], cd],
                vec![da, centre, cd, c[3]],
            ]
        }
        n => (1..n - 1).map(|k| vec![c[0], c[k], c[k + 1]]).collect(),
    };
    parts.into_iter().filter_map(Polygon::trusted)
}

#[cfg(test)]
mod tests {
    use super::super::exchange_area;
    use super::*;
    use proptest::prelude::*;

    fn polygon(corners: &[[f64; 3]]) -> Polygon {
        Polygon::new(corners.iter().map(|c| Vector3::from(*c)).collect()).unwrap()
    }

    fn rectangle(x: [f64; 2], y: [f64; 2], z: f64) -> Polygon {
        polygon(&[
            [x[0], y[0], z],
            [x[1], y[0], z],
            [x[1], y[1], z],
            [x[0], y[1], z],
        ])
    }

    fn share(between: Vec<Polygon>) -> (f64, f64, f64) {
        let floor = rectangle([0.0, 1.0], [0.0, 1.0], 0.0);
        let ceiling = rectangle([0.0, 1.0], [0.0, 1.0], 1.0).flipped();
        let tolerance = Tolerance::new(1e-6);
        let left = polygon(&[[0., 0., 1.], [0., 1., 1.], [0.5, 1., 1.], [0.5, 0., 1.]]);
        let half = exchange_area(&floor, &left, tolerance);
        let whole = exchange_area(&floor, &ceiling, tolerance);
        let obstacles = Obstacles::new(between);
        (
            visible_exchange_area(&floor, &ceiling, tolerance, &obstacles),
            half,
            whole,
        )
    }

    #[test]
    fn a_plate_close_before_half_of_another_leaves_the_other_half() {
        // 1e-7 away: what passes between is below the tolerance.
        let (found, half, _) = share(vec![rectangle([0.5, 2.0], [-1.0, 2.0], 1.0 - 1e-7)]);
        assert!((found - half).abs() < 1e-6, "{found} {half}");
    }

    /// A vertical wall at x = .5 between floor and ceiling hides from each half the other
    /// half: what is left is twice the exchange of the halves that are opposite.
    #[test]
    fn a_wall_between_two_halves_leaves_what_the_halves_opposite_exchange() {
        let wall = polygon(&[[0.5, -1., 0.], [0.5, 2., 0.], [0.5, 2., 1.], [0.5, -1., 1.]]);
        let (found, _, _) = share(vec![wall]);
        let floor = rectangle([0.0, 0.5], [0.0, 1.0], 0.0);
        let ceiling = rectangle([0.0, 0.5], [0.0, 1.0], 1.0).flipped();
        let known = 2.0 * exchange_area(&floor, &ceiling, Tolerance::new(1e-10));
        assert!((found / known - 1.0).abs() < 1e-5, "{found} {known}");
    }

    #[test]
    fn a_wall_that_hides_all_leaves_nothing_and_one_beside_hides_nothing() {
        let (found, _, _) = share(vec![rectangle([-1.0, 2.0], [-1.0, 2.0], 0.5)]);
        assert!(found.abs() < f64::MIN_POSITIVE, "{found}");
        let (found, _, whole) = share(vec![rectangle([1.0, 2.0], [0.0, 1.0], 0.5)]);
        assert!((found - whole).abs() < f64::MIN_POSITIVE, "{found} {whole}");
    }

    #[test]
    fn two_plates_that_overlap_hide_what_their_union_hides() {
        let parts = vec![
            rectangle([0.2, 0.6], [0.1, 0.8], 0.4),
            rectangle([0.4, 0.7], [0.1, 0.8], 0.4),
        ];
        let (found, _, whole) = share(parts);
        let (known, _, _) = share(vec![rectangle([0.2, 0.7], [0.1, 0.8], 0.4)]);
        assert!((found - known).abs() < 2e-6 * whole, "{found} {known}");
        assert!(known < 0.7 * whole && known > 0.0);
    }

    #[test]
    fn outer_panels_of_an_m_face_each_other_and_are_blocked_wholly() {
        let panel = |k: i32| {
            let (x, z) = (f64::from(k) - 2.0, -f64::from(k & 1));
            let (x1, z1) = (x + 1.0, -f64::from((k + 1) & 1));
            polygon(&[[x, 0., z], [x1, 0., z1], [x1, 2.5, z1], [x, 2.5, z]])
        };
        let panels: Vec<_> = (0..4).map(panel).collect();
        let obstacles = Obstacles::new(panels.clone());
        let tolerance = Tolerance::default();
        assert!(super::super::facing(&panels[0], &panels[3]));
        assert!(exchange_area(&panels[0], &panels[3], tolerance) > 0.1);
        let found = visible_exchange_area(&panels[0], &panels[3], tolerance, &obstacles);
        assert!(found.abs() < f64::MIN_POSITIVE, "{found}");
        let valley = visible_exchange_area(&panels[0], &panels[1], tolerance, &obstacles);
        let free = exchange_area(&panels[0], &panels[1], tolerance);
        assert!((valley - free).abs() < f64::MIN_POSITIVE);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        /// The reference: lines between random places, weighted by the kernel.
        #[test]
        fn what_is_seen_past_a_triangle_is_what_lines_between_places_say(
            c in prop::collection::vec([-0.3..1.3_f64, -0.3..1.3, 0.1..0.9], 3), seed in any::<u64>(),
        ) {
            let triangle = Polygon::new(c.into_iter().map(Vector3::from).collect());
            prop_assume!(triangle.as_ref().is_ok_and(|t| t.area() > 0.02));
            let obstacles = vec![triangle.unwrap()];
            let (found, _, whole) = share(obstacles.clone());
            let obstacles = Obstacles::new(obstacles);
            let mut random = fastrand::Rng::with_seed(seed);
            let (mut seen, mut all) = (0.0, 0.0);
            for _ in 0..40_000 {
                let mut at = |z| Vector3::new(random.f64(), random.f64(), z);
                let (from, to) = (at(0.0), at(1.0));
                let kernel = (to - from).norm_squared().powi(-2);
                all += kernel;
                seen += if obstacles.blocked(&from, &to) { 0.0 } else { kernel };
            }
            prop_assert!((found / whole - seen / all).abs() < 0.012, "{} {}", found / whole, seen / all);
        }
    }
}
