//! Points, planes, polygons, and what is in whose way.

mod bounds;
mod obstacles;
mod plane;
mod polygon;

pub use obstacles::{Hit, Obstacles};
pub use plane::Plane;
pub use polygon::{Polygon, PolygonError};
