//! Geometry: planes, polygons, and what is in whose way.

mod obstacles;
mod polygon;

pub use obstacles::{Hit, Obstacles};
pub use polygon::{Plane, Polygon, PolygonError};

/// A polygon of these corners, which must make one.
#[cfg(test)]
pub(crate) fn polygon(corners: &[[f64; 3]]) -> Polygon {
    Polygon::new(corners.iter().map(|c| (*c).into()).collect()).unwrap()
}
