//! Form factors between rectangles on the two walls of a wedge, by the simulator's own
//! closed forms.
//!
//! A wall is a half plane that starts at the wedge's hinge, the `y` axis; a
//! rectangle on it reaches from `u.0` to `u.1` away from the hinge and from `y.0`
//! to `y.1` along it.

use crate::form_factor::{Tolerance, exchange_area};
use crate::geometry::Polygon;
use nalgebra::Vector3;

/// A rectangle on a wall of a wedge.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Rectangle {
    /// Distance from the hinge, from and to.
    pub(super) u: (f64, f64),
    /// Place along the hinge, from and to.
    pub(super) y: (f64, f64),
}

impl Rectangle {
    /// Its area.
    #[must_use]
    pub(super) fn area(&self) -> f64 {
        (self.u.1 - self.u.0) * (self.y.1 - self.y.0)
    }
}

/// `A1 F12 = A2 F21` of rectangles on either wall of a wedge of `angle` radians; 0 for
/// one without area.
#[must_use]
pub(super) fn exchange(a: &Rectangle, b: &Rectangle, angle: f64) -> f64 {
    // The walls' fronts face each other.
    let first = [
        (a.u.0, a.y.0),
        (a.u.1, a.y.0),
        (a.u.1, a.y.1),
        (a.u.0, a.y.1),
    ];
    let second = [
        (b.u.0, b.y.0),
        (b.u.0, b.y.1),
        (b.u.1, b.y.1),
        (b.u.1, b.y.0),
    ];
    let first = first.map(|(u, y)| Vector3::new(u, y, 0.0));
    let second = second.map(|(u, y)| Vector3::new(u * angle.cos(), y, u * angle.sin()));
    let walls = (Polygon::new(first.to_vec()), Polygon::new(second.to_vec()));
    match walls {
        (Ok(a), Ok(b)) => exchange_area(&a, &b, Tolerance::default()),
        _ => 0.0,
    }
}
