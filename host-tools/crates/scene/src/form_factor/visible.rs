//! Visibility: the exchange area of two polygons with obstacles between them.
//!
//! From a point of one polygon, the other one is seen without the shadows that
//! the obstacles cast on it: convex pieces, so their form factors are exact. Over the
//! first polygon the share that is seen is integrated adaptively, and the exact
//! exchange area without obstacles is multiplied by that share.

use super::point::above_horizon;
use super::quadrature::samples;
use super::shaft::{Hull, blocks_all, may_block};
use super::{Sampled, Tolerance, from_point, ordered, parts_in_front};
use crate::geometry::{Obstacles, Plane, Polygon};
use nalgebra::Vector3;

/// Share below which what is seen is not asked for more exactly: the tolerance is
/// relative to the geometric mean of what is seen and the whole.
const LEAST_SHARE: f64 = 1e-2;
/// How often a part of the first polygon is quartered at most.
const QUARTERINGS: usize = 9;
/// Order of the rule on each part.
const ORDER: usize = 2;
/// Obstacles that are not looked at again for every part.
const FEW: usize = 3;

/// Exchange area `A_a F_ab`, m^2, with what `obstacles` leave of it; the same
/// to the last bit whichever comes first. The tolerance is relative to the geometric
/// mean of the exchange areas with and without obstacles.
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
    let receiver = Receiver {
        normal: a.normal(),
        b,
        hull: Hull::of(b),
    };
    let between = receiver.between(a, obstacles);
    if between.is_empty() {
        return 1.0;
    }
    let from = Hull::of(a);
    if between.iter().any(|o| blocks_all(&from, &receiver.hull, o)) {
        return 0.0;
    }
    let light = receiver.light(a, &between);
    let share = (light.seen / light.whole.max(f64::MIN_POSITIVE)).clamp(LEAST_SHARE, 1.0);
    let error = tolerance.relative() * light.whole * share.sqrt();
    let light = receiver.refined(a, light, &between, error, QUARTERINGS);
    if light.whole > 0.0 {
        (light.seen / light.whole).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// Light from `b` that arrives on a part of `a`, as exchange area, m^2.
#[derive(Clone, Copy, Debug, Default)]
struct SeenLight {
    seen: f64,
    whole: f64,
}

impl std::ops::AddAssign for SeenLight {
    fn add_assign(&mut self, other: Self) {
        self.seen += other.seen;
        self.whole += other.whole;
    }
}

/// What parts of a polygon with this normal see of `b`.
struct Receiver<'b> {
    normal: Vector3<f64>,
    b: &'b Polygon,
    hull: Hull,
}

impl Receiver<'_> {
    /// The obstacles that may stand between a part and `b`.
    fn between<'o>(&self, part: &Polygon, obstacles: &[&'o Polygon]) -> Vec<&'o Polygon> {
        let hull = Hull::of(part);
        let may = |o: &&&Polygon| may_block(&hull, &self.hull, o);
        obstacles.iter().filter(may).copied().collect()
    }

    /// What a part receives, by the rule of its few places.
    fn light(&self, part: &Polygon, between: &[&Polygon]) -> SeenLight {
        let mut light = SeenLight::default();
        for (place, area) in samples(part, ORDER) {
            light.whole += area * from_point(&place, &self.normal, self.b);
            light.seen += area * self.seen(&place, between);
        }
        light
    }

    /// Quarters a part until its quarters agree with it to `error`, m^2.
    fn refined(
        &self,
        part: &Polygon,
        coarse: SeenLight,
        between: &[&Polygon],
        error: f64,
        quarterings: usize,
    ) -> SeenLight {
        let quarters: Vec<_> = quartered(part)
            .map(|quarter| {
                let light = self.light(&quarter, between);
                (quarter, light)
            })
            .collect();
        let mut fine = SeenLight::default();
        for (_, light) in &quarters {
            fine += *light;
        }
        let share = coarse.seen * fine.whole / coarse.whole.max(f64::MIN_POSITIVE);
        // The rule is of second order where shadows end: of what both differ by, the
        // finer one is off by a third.
        let agree = (share - fine.seen).abs() <= 3.0 * error;
        if quarterings == 0 || (agree && !self.missed(part, fine, between)) {
            return fine;
        }
        let mut light = SeenLight::default();
        for (quarter, coarse) in quarters {
            // Few obstacles cost less to look past than to rule out.
            let nearer = (between.len() > FEW).then(|| self.between(&quarter, between));
            let between = nearer.as_deref().unwrap_or(between);
            // Edges of shadows are lines: half of the quarters hold one.
            light += self.refined(&quarter, coarse, between, error / 2.0, quarterings - 1);
        }
        light
    }

    /// Whether a part that seems to see all or nothing sees something else from a corner.
    fn missed(&self, part: &Polygon, light: SeenLight, between: &[&Polygon]) -> bool {
        let share = light.seen / light.whole.max(f64::MIN_POSITIVE);
        let even = !(1e-9..=1.0 - 1e-9).contains(&share);
        let centre = part.centroid();
        even && part.corners().iter().any(|corner| {
            // Just inside: the corner itself may lie on an obstacle.
            let place = corner + (centre - corner) * 1e-3;
            let whole = from_point(&place, &self.normal, self.b);
            (self.seen(&place, between) - share * whole).abs() > 1e-6 * whole
        })
    }

    /// Form factor from a place to what of `b` is seen past the obstacles.
    fn seen(&self, place: &Vector3<f64>, between: &[&Polygon]) -> f64 {
        let whole = from_point(place, &self.normal, self.b);
        let Some((last, others)) = between.split_last() else {
            return whole;
        };
        let mut hidden = 0.0;
        let mut pieces = vec![self.b.corners().to_vec()];
        for obstacle in others {
            let mut rest = Vec::with_capacity(pieces.len() + 1);
            for piece in pieces {
                let shadow = Shadow::new(place, obstacle, &piece);
                let dark = shadow.of(piece, Some(&mut rest));
                hidden += self.received(place, &dark);
            }
            pieces = rest;
        }
        for piece in pieces {
            let dark = Shadow::new(place, last, &piece).of(piece, None);
            hidden += self.received(place, &dark);
        }
        (whole - hidden).max(0.0)
    }

    /// Form factor to a part of `b`.
    fn received(&self, place: &Vector3<f64>, corners: &[Vector3<f64>]) -> f64 {
        if corners.len() < 3 || self.b.plane().distance(place) <= 0.0 {
            return 0.0;
        }
        let horizon = Plane::through(*place, self.normal);
        if corners.iter().all(|c| horizon.distance(c) >= 0.0) {
            return above_horizon(place, &self.normal, corners);
        }
        above_horizon(place, &self.normal, &side_of(corners, &horizon, 1.0))
    }
}

/// The shadow that an obstacle casts from a place on a convex outline: inside all of
/// these planes, those that the outline crosses.
enum Shadow {
    Misses,
    Within(Vec<Plane>),
}

impl Shadow {
    fn new(place: &Vector3<f64>, obstacle: &Polygon, outline: &[Vector3<f64>]) -> Self {
        let plane = obstacle.plane();
        let side = plane.distance(place);
        if side.abs() <= 1e-12 * obstacle.size() {
            return Self::Misses;
        }
        let corners = obstacle.corners();
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0 - place;
        let rim_through = |(from, to): (Vector3<f64>, Vector3<f64>)| {
            let across = (from - place).cross(&(to - place));
            let normal = (across * across.dot(&middle).signum()).try_normalize(0.0)?;
            Some(Plane::through(*place, normal))
        };
        // What is nearer than the obstacle is not in its shadow.
        let top = if side > 0.0 { plane.flipped() } else { *plane };
        let mut crossed = Vec::with_capacity(corners.len() + 1);
        for rim in [top]
            .into_iter()
            .chain(obstacle.edges().filter_map(rim_through))
        {
            let inside = outline.iter().filter(|c| rim.distance(c) >= 0.0).count();
            if inside == 0 {
                return Self::Misses;
            }
            if inside < outline.len() {
                crossed.push(rim);
            }
        }
        Self::Within(crossed)
    }

    /// The part of the outline in the shadow; those in the light are added to `rest`.
    fn of(
        self,
        outline: Vec<Vector3<f64>>,
        mut rest: Option<&mut Vec<Vec<Vector3<f64>>>>,
    ) -> Vec<Vector3<f64>> {
        let Self::Within(rims) = self else {
            if let Some(rest) = rest {
                rest.push(outline);
            }
            return Vec::new();
        };
        let mut dark = outline;
        for rim in rims {
            if let Some(rest) = &mut rest {
                let lit = side_of(&dark, &rim, -1.0);
                if lit.len() > 2 {
                    rest.push(lit);
                }
            }
            dark = side_of(&dark, &rim, 1.0);
            if dark.len() < 3 {
                return Vec::new();
            }
        }
        dark
    }
}

/// The part of a convex outline on one side of a plane, to the last bit: what one side
/// loses, the other one has.
fn side_of(outline: &[Vector3<f64>], plane: &Plane, sign: f64) -> Vec<Vector3<f64>> {
    let mut kept = Vec::with_capacity(outline.len() + 1);
    let Some(last) = outline.last() else {
        return kept;
    };
    let (mut from, mut here) = (*last, sign * plane.distance(last));
    for corner in outline {
        let there = sign * plane.distance(corner);
        if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
            kept.push(from + (corner - from) * (here / (here - there)));
        }
        if there >= 0.0 {
            kept.push(*corner);
        }
        (from, here) = (*corner, there);
    }
    kept
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
    use crate::geometry::polygon;
    use proptest::prelude::*;

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
