//! Shaft culling: what may stand between two groups of surfaces.
//!
//! The shaft between two convex hulls is the hull of both: all light between them
//! stays inside. A convex polygon outside it blocks nothing.
//!
//! Haines, Wallace, *Shaft Culling for Efficient Ray-Cast Radiosity* (1991).

use crate::geometry::{Plane, Polygon};
use nalgebra::Vector3;

/// Part of the size within which what touches counts as outside.
const TOUCHING: f64 = 1e-9;

/// A convex hull at one end of a shaft.
#[derive(Clone, Debug)]
pub(crate) struct Hull {
    points: Vec<Vector3<f64>>,
    /// Directions of its edges.
    edges: Vec<Vector3<f64>>,
    /// The plane in front of which all its light is, if it lies in one.
    plane: Option<Plane>,
    /// All corners of the surfaces inside, where the hull is much wider than they are;
    /// else empty. They decide on which side of a plane it is.
    corners: Vec<Vector3<f64>>,
}

impl Hull {
    /// Of a polygon.
    pub(crate) fn of(polygon: &Polygon) -> Self {
        Self::planar(polygon.corners().to_vec(), *polygon.plane())
    }

    /// Of points in order around a convex outline in a plane.
    pub(crate) fn planar(points: Vec<Vector3<f64>>, plane: Plane) -> Self {
        let next = points.iter().cycle().skip(1);
        Self {
            edges: points.iter().zip(next).map(|(a, b)| b - a).collect(),
            plane: Some(plane),
            corners: Vec::new(),
            points,
        }
    }

    /// A box along the axes around the corners of several surfaces.
    pub(crate) fn around(corners: Vec<Vector3<f64>>) -> Self {
        let nothing = Vector3::repeat(f64::INFINITY);
        let grow = |(l, m): (Vector3<f64>, Vector3<f64>), c: &Vector3<f64>| (l.inf(c), m.sup(c));
        let (least, most) = corners.iter().fold((nothing, -nothing), grow);
        let corner = |k: usize| {
            Vector3::from_fn(|axis, _| {
                if k >> axis & 1 == 0 {
                    least[axis]
                } else {
                    most[axis]
                }
            })
        };
        Self {
            points: (0..8).map(corner).collect(),
            edges: vec![Vector3::x(), Vector3::y(), Vector3::z()],
            plane: None,
            corners,
        }
    }

    /// The points that span it.
    pub(crate) fn points(&self) -> &[Vector3<f64>] {
        &self.points
    }

    /// Whether all of it is in front of the plane, or on it.
    pub(crate) fn in_front_of(&self, plane: &Plane) -> bool {
        let near = TOUCHING * (self.points[0] - self.points[self.points.len() / 2]).norm();
        self.tight().iter().all(|p| plane.distance(p) >= -near)
    }

    /// Whether any of it is in front of the plane.
    pub(crate) fn reaches_front_of(&self, plane: &Plane) -> bool {
        let near = TOUCHING * (self.points[0] - self.points[self.points.len() / 2]).norm();
        self.tight().iter().any(|p| plane.distance(p) > near)
    }

    /// Points whose own hull holds all surfaces as closely as is known.
    fn tight(&self) -> &[Vector3<f64>] {
        if self.corners.is_empty() {
            &self.points
        } else {
            &self.corners
        }
    }
}

/// Whether `polygon` may block light between both hulls; if not, it certainly
/// blocks none.
pub(crate) fn may_block(from: &Hull, to: &Hull, polygon: &Polygon) -> bool {
    let points = || from.points.iter().chain(&to.points);
    let near = TOUCHING * ((to.points[0] - from.points[0]).norm() + polygon.size());
    // All light stays on one side of it.
    let plane = polygon.plane();
    let tight = || from.tight().iter().chain(to.tight());
    if tight().all(|p| plane.distance(p) >= -near) || tight().all(|p| plane.distance(p) <= near) {
        return false;
    }
    // It is behind one of the ends.
    let behind = |hull: &Hull| {
        let plane = hull.plane.as_ref();
        plane.is_some_and(|plane| polygon.corners().iter().all(|c| plane.distance(c) <= near))
    };
    if behind(from) || behind(to) {
        return false;
    }
    // Most that stand between are met by the line between the middles.
    let middle = |hull: &Hull| hull.points.iter().sum::<Vector3<f64>>() / hull.points.len() as f64;
    let (start, end) = (middle(from), middle(to));
    let (here, there) = (plane.distance(&start), plane.distance(&end));
    if here * there < 0.0 && polygon.contains(&(start + (end - start) * (here / (here - there)))) {
        return true;
    }
    let separates = |axis: &Vector3<f64>| {
        let range = |points: &mut dyn Iterator<Item = &Vector3<f64>>| {
            points.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), p| {
                let along = axis.dot(p);
                (along.min(least), along.max(most))
            })
        };
        let (shaft, other) = (range(&mut points()), range(&mut polygon.corners().iter()));
        let near = near * axis.norm();
        other.0 >= shaft.1 - near || shaft.0 >= other.1 - near
    };
    if [Vector3::x(), Vector3::y(), Vector3::z()]
        .iter()
        .any(separates)
    {
        return false;
    }
    // Faces of the shaft, and planes through its long edges and the polygon's:
    // all directions in which convex bodies can be apart.
    let outline: Vec<_> = polygon.edges().map(|(a, b)| b - a).collect();
    let long = from
        .points
        .iter()
        .flat_map(|p| to.points.iter().map(move |q| q - p));
    let separated = long
        .flat_map(|long| {
            let edges = outline.iter().chain(&from.edges).chain(&to.edges);
            edges.map(move |edge| long.cross(edge))
        })
        .any(|axis| axis.norm_squared() > 0.0 && separates(&axis));
    !separated
}

/// Whether `polygon` blocks all light between both hulls.
///
/// Seen from any point at one end, the other end's outline on the polygon's plane is a
/// perspective image, which keeps what is convex convex; so it is enough to look at
/// the lines between the points that span both.
pub(crate) fn blocks_all(from: &Hull, to: &Hull, polygon: &Polygon) -> bool {
    let plane = polygon.plane();
    let distances =
        |hull: &Hull| -> Vec<f64> { hull.points.iter().map(|p| plane.distance(p)).collect() };
    let (mut here, mut there) = (distances(from), distances(to));
    let near = TOUCHING * ((to.points[0] - from.points[0]).norm() + polygon.size());
    if here.iter().sum::<f64>() < 0.0 {
        here.iter_mut().chain(&mut there).for_each(|d| *d = -*d);
    }
    // Ends may touch the plane, but none may lie in it: lines within it are not
    // blocked.
    let apart = |d: &[f64]| d.iter().all(|d| *d >= -near) && d.iter().any(|d| *d > near);
    for distance in &mut there {
        *distance = -*distance;
    }
    if !apart(&here) || !apart(&there) {
        return false;
    }
    let crossing = |(p, dp): (&Vector3<f64>, &f64), (q, dq): (&Vector3<f64>, &f64)| {
        let (dp, dq) = (dp.max(0.0), dq.max(0.0));
        // Both on the plane: no light passes between places on the same side's rim.
        if dp + dq <= near {
            return polygon.contains(p) && polygon.contains(q);
        }
        polygon.contains(&(p + (q - p) * (dp / (dp + dq))))
    };
    let ends = |points: &'_ [Vector3<f64>]| points.len();
    (0..ends(&from.points)).all(|i| {
        (0..ends(&to.points))
            .all(|j| crossing((&from.points[i], &here[i]), (&to.points[j], &there[j])))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn triangle(corners: [[f64; 3]; 3]) -> Option<Polygon> {
        Polygon::new(corners.iter().map(|c| Vector3::from(*c)).collect())
            .ok()
            .filter(|p| p.area() > 1e-3)
    }

    fn anywhere() -> impl Strategy<Value = Polygon> {
        let part = -1.0..1.0_f64;
        let corner = [part.clone(), part.clone(), part];
        [corner.clone(), corner.clone(), corner].prop_filter_map("area", triangle)
    }

    /// Places by weights of the corners, and whether the line between meets the polygon.
    fn met(a: &Polygon, b: &Polygon, polygon: &Polygon, weights: [f64; 4]) -> bool {
        let place = |p: &Polygon, u: f64, v: f64| {
            let (u, v) = if u + v > 1.0 {
                (1.0 - u, 1.0 - v)
            } else {
                (u, v)
            };
            let c = p.corners();
            c[0] + (c[1] - c[0]) * u + (c[2] - c[0]) * v
        };
        let (from, to) = (
            place(a, weights[0], weights[1]),
            place(b, weights[2], weights[3]),
        );
        crate::geometry::Obstacles::new(vec![polygon.clone()]).blocked(&from, &to)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn what_is_outside_the_shaft_blocks_no_line_and_what_blocks_all_blocks_every_line(
            a in anywhere(), b in anywhere(), c in anywhere(), away in 0.0..4.0_f64,
            weights in prop::collection::vec([0.01..0.99_f64, 0.01..0.99, 0.01..0.99, 0.01..0.99], 20),
        ) {
            let moved = Polygon::new(
                b.corners().iter().map(|p| p + Vector3::new(0.0, 0.0, away)).collect()).unwrap();
            // Both ends' planes are ignored: lines here leave at either side.
            let [mut from, mut to] = [Hull::of(&a), Hull::of(&moved)];
            (from.plane, to.plane) = (None, None);
            let may = may_block(&from, &to, &c);
            let all = blocks_all(&from, &to, &c);
            for w in weights {
                let met = met(&a, &moved, &c, w);
                prop_assert!(may || !met);
                prop_assert!(met || !all);
            }
        }
    }
}
