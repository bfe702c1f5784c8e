//! A plane with a front and a back.

use nalgebra::Vector3;

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

    /// Where a point's mirror image is.
    #[must_use]
    pub fn mirrored(&self, place: &Vector3<f64>) -> Vector3<f64> {
        place - 2.0 * self.distance(place) * self.normal
    }
}
