//! Form factors of convex polygons: how much light two surfaces exchange.
//!
//! Surfaces are one-sided and Lambertian. Their exchange area `S_ab = A_a F_ab`,
//! m^2, is the same both ways; `F_ab = S_ab / A_a` is the form factor: the
//! share of the light leaving `a` that arrives on `b`.
//!
//! - [`exchange_area`] without anything between them: by both outlines
//!   (`contour.rs`) when near, where parallel and perpendicular edges are exact;
//!   by Gauss rules on both areas (`quadrature.rs`) when far, where the outlines
//!   cancel. What lies behind the other's plane is clipped away first.
//! - [`from_point`]: a point and a polygon, Lambert's closed form.
//! - [`visible_exchange_area`]: with obstacles between them.
//!
//! Sources: Goral, Torrance, Greenberg, Battaile, *Modeling the Interaction of
//! Light Between Diffuse Surfaces* (1984); Cohen, Wallace, *Radiosity and
//! Realistic Image Synthesis* (1993).

mod contour;
mod point;
mod quadrature;
mod sampled;
pub(crate) mod shaft;
#[cfg(test)]
mod tests;
pub(crate) mod visible;

pub use point::from_point;
pub use sampled::Sampled;
pub use visible::visible_exchange_area;

use crate::geometry::Polygon;
use std::borrow::Cow;
use std::cmp::Ordering;

/// Relative error asked of an exchange area.
#[derive(Clone, Copy, PartialEq, PartialOrd, Debug)]
pub struct Tolerance(f64);

impl Tolerance {
    /// A tolerance; what is beyond 1e-12..0.1 is taken as the nearer end.
    #[must_use]
    pub fn new(relative: f64) -> Self {
        Self(relative.clamp(1e-12, 0.1))
    }

    /// The relative error.
    #[must_use]
    pub fn relative(self) -> f64 {
        self.0
    }
}

impl Default for Tolerance {
    /// A millionth: a hundredth of what the irradiance is asked for.
    fn default() -> Self {
        Self(1e-6)
    }
}

/// Whether part of each is in front of the other's plane, so that they can
/// light each other.
#[must_use]
pub fn facing(a: &Polygon, b: &Polygon) -> bool {
    let reaches = |a: &Polygon, b: &Polygon| {
        let near = 1e-9 * (a.size() + b.size());
        a.corners().iter().any(|c| b.plane().distance(c) > near)
    };
    reaches(a, b) && reaches(b, a)
}

/// Exchange area `A_a F_ab`, m^2, with nothing between them; the same to the
/// last bit whichever comes first, and 0 if they do not face each other.
#[must_use]
pub fn exchange_area(a: &Polygon, b: &Polygon, tolerance: Tolerance) -> f64 {
    let (a, b) = ordered(a, b);
    match parts_in_front(a, b) {
        Some((a, b)) => Sampled::new(a).exchange_area(&Sampled::new(b), tolerance),
        None => 0.0,
    }
}

/// The parts of sampled polygons that are in front of each other's planes; those of which nothing
/// is cut away keep their places.
pub(crate) fn sampled_in_front<'s>(
    a: &'s Sampled,
    b: &'s Sampled,
) -> Option<(Cow<'s, Sampled>, Cow<'s, Sampled>)> {
    let (first, second) = ordered(a.polygon(), b.polygon());
    let (first, second) = parts_in_front(first, second)?;
    let areas = a.polygon().area() + b.polygon().area();
    if (first.area() + second.area() - areas).abs() <= 1e-12 * areas {
        return Some((Cow::Borrowed(a), Cow::Borrowed(b)));
    }
    let [first, second] = [first, second].map(|part| Cow::Owned(Sampled::new(part)));
    Some((first, second))
}

/// The parts that are in front of each other's planes.
pub(crate) fn parts_in_front(a: &Polygon, b: &Polygon) -> Option<(Polygon, Polygon)> {
    if !facing(a, b) {
        return None;
    }
    Some((a.clipped(b.plane())?, b.clipped(a.plane())?))
}

/// Both in an order that depends on nothing but where they are, so that either
/// way round gives the same bits.
pub(crate) fn ordered<'a>(a: &'a Polygon, b: &'a Polygon) -> (&'a Polygon, &'a Polygon) {
    let coordinates = |p: &'a Polygon| p.corners().iter().flat_map(|c| c.iter());
    let first = a.area().total_cmp(&b.area()).then_with(|| {
        let mut pairs = coordinates(a).zip(coordinates(b));
        pairs
            .find_map(|(x, y)| Some(x.total_cmp(y)).filter(|o| o.is_ne()))
            .unwrap_or(Ordering::Equal)
    });
    if first == Ordering::Greater {
        (b, a)
    } else {
        (a, b)
    }
}
