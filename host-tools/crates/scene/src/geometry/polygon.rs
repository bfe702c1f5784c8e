//! Convex planar polygons, and the planes they lie in: what surfaces, patches and their
//! shadows are made of.

use nalgebra::Vector3;
use thiserror::Error;

/// An oriented plane; metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Plane {
    normal: Vector3<f64>,
    offset: f64,
}

impl Plane {
    /// The plane through `place` with this unit normal.
    #[must_use]
    pub fn through(place: Vector3<f64>, normal: Vector3<f64>) -> Self {
        Self {
            normal,
            offset: normal.dot(&place),
        }
    }

    /// Unit normal.
    #[must_use]
    pub fn normal(&self) -> Vector3<f64> {
        self.normal
    }

    /// Distance of a point, positive on the side that the normal points to.
    #[must_use]
    pub fn distance(&self, place: &Vector3<f64>) -> f64 {
        self.normal.dot(place) - self.offset
    }

    /// The same plane facing the other way.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self {
            normal: -self.normal,
            offset: -self.offset,
        }
    }
}

/// Relative distance of a corner from the polygon's plane that still counts as
/// on it.
const PLANAR: f64 = 1e-6;
/// Areas below this part of the squared size count as none.
const FLAT: f64 = 1e-12;

/// A convex planar polygon, its corners counter-clockwise seen from the side that
/// its normal points to. Its area is positive. Lengths are in metres.
#[derive(Clone, PartialEq, Debug)]
pub struct Polygon {
    corners: Vec<Vector3<f64>>,
    plane: Plane,
    area: f64,
}

/// Why corners do not make a [`Polygon`].
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum PolygonError {
    /// Fewer than three corners.
    #[error("it has {0} corners; a surface needs 3 or more")]
    TooFewCorners(usize),
    /// A coordinate is NaN or infinite.
    #[error("corner {0} is not made of finite numbers")]
    NotFinite(usize),
    /// All corners are on one line, or on one point.
    #[error("its corners are all on one line, so it has no area")]
    NoArea,
    /// A corner is off the plane of the others.
    #[error(
        "corner {corner} is {distance:.2e} m off the plane of the others; split it into triangles"
    )]
    NotPlanar {
        /// Index of the corner.
        corner: usize,
        /// Its distance, metres.
        distance: f64,
    },
    /// The outline turns both ways.
    #[error("it is not convex at corner {corner}; split it into convex parts")]
    NotConvex {
        /// Index of the corner.
        corner: usize,
    },
}

impl Polygon {
    /// A polygon of these corners, in order around it.
    ///
    /// # Errors
    /// [`PolygonError`] unless they are finite, planar, convex and span an area.
    pub fn new(corners: Vec<Vector3<f64>>) -> Result<Self, PolygonError> {
        if corners.len() < 3 {
            return Err(PolygonError::TooFewCorners(corners.len()));
        }
        let not_finite = |c: &Vector3<f64>| c.iter().any(|x| !x.is_finite());
        if let Some(corner) = corners.iter().position(not_finite) {
            return Err(PolygonError::NotFinite(corner));
        }
        let polygon = Self::trusted(corners).ok_or(PolygonError::NoArea)?;
        let size = polygon.size();
        for (corner, place) in polygon.corners.iter().enumerate() {
            let distance = polygon.plane.distance(place).abs();
            if distance > PLANAR * size {
                return Err(PolygonError::NotPlanar { corner, distance });
            }
        }
        let n = polygon.corners.len();
        for corner in 0..n {
            let [a, b, c] = [corner + n - 1, corner, corner + 1].map(|k| polygon.corners[k % n]);
            let turn = (b - a).cross(&(c - b)).dot(&polygon.plane.normal());
            if turn < -PLANAR * size * size {
                return Err(PolygonError::NotConvex { corner });
            }
        }
        Ok(polygon)
    }

    /// A polygon of corners that are known to be planar and convex, such as those
    /// of a part of another one; `None` if they span no area.
    pub(crate) fn trusted(corners: Vec<Vector3<f64>>) -> Option<Self> {
        let first = *corners.first()?;
        let (mut doubled, mut size) = (Vector3::zeros(), 0.0_f64);
        for pair in corners.windows(2) {
            doubled += (pair[0] - first).cross(&(pair[1] - first));
            size = size.max((pair[1] - first).norm_squared());
        }
        let norm = doubled.norm();
        // Written so that NaN is refused too.
        let spans = norm > FLAT * size && norm > 0.0;
        if !spans {
            return None;
        }
        let mean = corners.iter().sum::<Vector3<f64>>() / corners.len() as f64;
        Some(Self {
            plane: Plane::through(mean, doubled / norm),
            area: norm / 2.0,
            corners,
        })
    }

    /// The corners in order, at least three.
    #[must_use]
    pub fn corners(&self) -> &[Vector3<f64>] {
        &self.corners
    }

    /// The edges in order, each from a corner to the next.
    pub fn edges(&self) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().copied().zip(next.copied())
    }

    /// The plane it lies in; the normal is on the side that reflects light.
    #[must_use]
    pub fn plane(&self) -> &Plane {
        &self.plane
    }

    /// Unit normal.
    #[must_use]
    pub fn normal(&self) -> Vector3<f64> {
        self.plane.normal()
    }

    /// Area in square metres.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Largest distance of a corner from the first one, metres.
    #[must_use]
    pub fn size(&self) -> f64 {
        let from_first = |c: &Vector3<f64>| (c - self.corners[0]).norm();
        self.corners.iter().map(from_first).fold(0.0, f64::max)
    }

    /// Centre of area.
    #[must_use]
    pub fn centroid(&self) -> Vector3<f64> {
        let first = self.corners[0];
        let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
        for pair in self.corners[1..].windows(2) {
            let doubled = (pair[0] - first).cross(&(pair[1] - first));
            let weight = doubled.dot(&self.plane.normal());
            sum += weight * (first + pair[0] + pair[1]) / 3.0;
            weights += weight;
        }
        sum / weights
    }

    /// The same place seen from behind: normal and order reversed.
    #[must_use]
    pub fn flipped(&self) -> Self {
        let mut corners = self.corners.clone();
        corners.reverse();
        Self {
            corners,
            plane: self.plane.flipped(),
            area: self.area,
        }
    }

    /// The part on the side that `plane`'s normal points to; `None` if nothing is.
    ///
    /// Sutherland, Hodgman, *Reentrant Polygon Clipping* (1974).
    #[must_use]
    pub fn clipped(&self, plane: &Plane) -> Option<Self> {
        // Corners this close are on the plane: a sliver is nobody's patch.
        let near = 1e-9 * self.size();
        let distances: Vec<f64> = self.corners.iter().map(|c| plane.distance(c)).collect();
        if distances.iter().all(|d| *d >= -near) {
            return Some(self.clone());
        }
        if distances.iter().all(|d| *d <= near) {
            return None;
        }
        let mut kept = Vec::with_capacity(self.corners.len() + 1);
        for (k, (a, b)) in self.edges().enumerate() {
            let (da, db) = (distances[k], distances[(k + 1) % distances.len()]);
            if da >= 0.0 {
                kept.push(a);
            }
            if (da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0) {
                kept.push(a + (b - a) * (da / (da - db)));
            }
        }
        let mut part = Self::trusted(kept)?;
        // The whole polygon's plane is the better known one.
        part.plane = self.plane;
        Some(part)
    }

    /// Whether a point of its plane is inside, the outline included.
    #[must_use]
    pub fn contains(&self, place: &Vector3<f64>) -> bool {
        let normal = self.plane.normal();
        let least = -1e-9 * self.area;
        // Asked for every ray, and faster so than by the iterator of edges.
        let mut a = self.corners[self.corners.len() - 1];
        self.corners.iter().all(|b| {
            let inside = (b - a).cross(&(place - a)).dot(&normal) >= least;
            a = *b;
            inside
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn square() -> Polygon {
        crate::geometry::polygon(&[[0., 0., 0.], [2., 0., 0.], [2., 2., 0.], [0., 2., 0.]])
    }

    #[test]
    fn a_square_has_the_area_centre_and_normal_of_a_square() {
        let square = square();
        assert!((square.area() - 4.0).abs() < 1e-15);
        assert!((square.centroid() - Vector3::new(1.0, 1.0, 0.0)).norm() < 1e-15);
        assert!((square.normal() - Vector3::z()).norm() < 1e-15);
        assert!((square.flipped().normal() + Vector3::z()).norm() < 1e-15);
    }

    #[test]
    fn what_is_no_convex_surface_is_refused_with_the_corner() {
        let refused = |corners: &[[f64; 3]]| {
            Polygon::new(corners.iter().map(|c| Vector3::from(*c)).collect()).unwrap_err()
        };
        let bent = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.1], [0., 1., 0.]];
        assert!(matches!(refused(&bent), PolygonError::NotPlanar { .. }));
        let dart = [[0., 0., 0.], [1., 0., 0.], [0.2, 0.2, 0.], [0., 1., 0.]];
        assert_eq!(refused(&dart), PolygonError::NotConvex { corner: 2 });
        let line = [[0., 0., 0.], [1., 0., 0.], [2., 0., 0.]];
        assert_eq!(refused(&line), PolygonError::NoArea);
        let odd = [[0., 0., 0.], [f64::NAN, 0., 0.], [2., 1., 0.]];
        assert_eq!(refused(&odd), PolygonError::NotFinite(1));
        assert_eq!(refused(&[[0.; 3]; 2]), PolygonError::TooFewCorners(2));
    }

    proptest! {
        #[test]
        fn a_plane_cuts_a_polygon_into_two_parts_of_the_same_area_together(
            angle in 0.0..6.3_f64, x in 0.1..1.9_f64, y in 0.1..1.9_f64,
        ) {
            let square = square();
            let plane = Plane::through(Vector3::new(x, y, 0.0), Vector3::new(angle.cos(), angle.sin(), 0.0));
            let parts = [square.clipped(&plane), square.clipped(&plane.flipped())];
            let total: f64 = parts.iter().flatten().map(Polygon::area).sum();
            prop_assert!((total - 4.0).abs() < 1e-9, "{total}");
            for part in parts.iter().flatten() {
                prop_assert!(square.contains(&part.centroid()));
            }
        }
    }
}
