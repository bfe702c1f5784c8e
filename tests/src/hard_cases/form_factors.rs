//! Exact form factors between rectangles on the two walls of a wedge.
//!
//! A wall is a half plane that starts at the wedge's hinge, the `y` axis; a
//! rectangle on it reaches from `u.0` to `u.1` away from the hinge and from `y.0`
//! to `y.1` along it. Stokes' theorem turns the four-fold integral over both
//! areas into one over both contours (Sparrow, *A new and simpler formulation
//! for radiative angle factors*, 1963):
//!
//! ```text
//! A1 F12 = |sum over edges of both  (e1 . e2)  int int ln r| / (2 pi)
//! ```
//!
//! Edges along the hinge are parallel and have a closed form. Edges away from it
//! have one for the inner integral; the outer one is by Gauss and Legendre.

use std::f64::consts::PI;

/// A rectangle on a wall of a wedge.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rectangle {
    /// Distance from the hinge, from and to.
    pub u: (f64, f64),
    /// Place along the hinge, from and to.
    pub y: (f64, f64),
}

impl Rectangle {
    /// Its area.
    #[must_use]
    pub fn area(&self) -> f64 {
        (self.u.1 - self.u.0) * (self.y.1 - self.y.0)
    }
}

/// `A1 F12 = A2 F21` of rectangles on either wall of a wedge of `angle` radians.
#[must_use]
pub fn exchange(a: &Rectangle, b: &Rectangle, angle: f64) -> f64 {
    let mut sum = 0.0;
    for (sign_a, u) in [(-1.0, a.u.0), (1.0, a.u.1)] {
        for (sign_b, v) in [(-1.0, b.u.0), (1.0, b.u.1)] {
            let squared = u * u + v * v - 2.0 * u * v * angle.cos();
            sum += sign_a * sign_b * parallel(squared.max(0.0).sqrt(), a.y, b.y);
        }
    }
    if angle.cos().abs() > 1e-12 {
        for (sign_a, y) in [(1.0, a.y.0), (-1.0, a.y.1)] {
            for (sign_b, z) in [(1.0, b.y.0), (-1.0, b.y.1)] {
                sum += sign_a * sign_b * angle.cos() * slanted(y - z, a.u, b.u, angle);
            }
        }
    }
    sum.abs() / (2.0 * PI)
}

/// `int int ln r` over two parallel edges at `distance`.
fn parallel(distance: f64, a: (f64, f64), b: (f64, f64)) -> f64 {
    // Twice integrated ln sqrt(distance^2 + t^2), up to what is linear in t.
    let twice = |t: f64| {
        let squared = distance * distance + t * t;
        if squared == 0.0 {
            return 0.0;
        }
        let turn = if distance > 0.0 {
            distance * t * (t / distance).atan()
        } else {
            0.0
        };
        0.25 * (t * t - distance * distance) * squared.ln() - 0.75 * t * t + turn
    };
    twice(a.1 - b.0) - twice(a.1 - b.1) - twice(a.0 - b.0) + twice(a.0 - b.1)
}

/// `int int ln r` over two edges that leave the hinge, `apart` along it.
fn slanted(apart: f64, a: (f64, f64), b: (f64, f64), angle: f64) -> f64 {
    let inner = |u: f64| {
        let height = (u * u * angle.sin().powi(2) + apart * apart).sqrt();
        let once = |v: f64| {
            let t = v - u * angle.cos();
            let squared = t * t + height * height;
            if squared == 0.0 {
                return 0.0;
            }
            let turn = if height > 0.0 {
                height * (t / height).atan()
            } else {
                0.0
            };
            0.5 * t * squared.ln() - t + turn
        };
        once(b.1) - once(b.0)
    };
    // The integrand bends most at the hinge: halves that shrink towards it.
    let width = a.1 - a.0;
    let cuts = [0.0, 1.0 / 64.0, 1.0 / 16.0, 0.25, 1.0];
    let parts = cuts.windows(2).map(|cut| {
        let (from, to) = (a.0 + cut[0] * width, a.0 + cut[1] * width);
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let nodes = GAUSS.iter().map(|(node, weight)| {
            weight * (inner(middle - half * node) + inner(middle + half * node))
        });
        half * nodes.sum::<f64>()
    });
    parts.sum()
}

/// Positive nodes and weights of the Gauss-Legendre rule of 10 points.
const GAUSS: [(f64, f64); 5] = [
    (0.148_874_338_981_631_2, 0.295_524_224_714_752_9),
    (0.433_395_394_129_247_2, 0.269_266_719_309_996_4),
    (0.679_409_568_299_024_4, 0.219_086_362_515_982_04),
    (0.865_063_366_688_984_5, 0.149_451_349_150_580_6),
    (0.973_906_528_517_171_7, 0.066_671_344_308_688_14),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*,
    /// C-14: rectangles with a common edge at a right angle, `h = w = 1`.
    #[test]
    fn squares_at_a_right_angle_have_the_catalogues_factor() {
        let square = Rectangle {
            u: (0.0, 1.0),
            y: (0.0, 1.0),
        };
        let found = exchange(&square, &square, PI / 2.0);
        assert!((found - 0.200_044).abs() < 1e-6, "{found}");
    }

    /// Infinite wedge of equal walls: `F = 1 - sin(angle / 2)` (crossed strings,
    /// Hottel 1954).
    #[test]
    fn a_long_wedge_has_the_factor_of_crossed_strings() {
        for angle in [30.0_f64, 60.0, 75.0, 90.0, 120.0] {
            let angle = angle.to_radians();
            let long = 4e4;
            let wall = Rectangle {
                u: (0.0, 1.0),
                y: (0.0, long),
            };
            let found = exchange(&wall, &wall, angle) / wall.area();
            let wanted = 1.0 - (angle / 2.0).sin();
            assert!((found - wanted).abs() < 2e-4, "{angle}: {found} {wanted}");
        }
    }

    #[test]
    fn parts_add_up_to_the_whole() {
        let angle = 30.0_f64.to_radians();
        let whole = Rectangle {
            u: (0.0, 1.0),
            y: (0.0, 1.0),
        };
        let parts = [0.0, 0.3, 1.0];
        let mut sum = 0.0;
        for a in parts.windows(2) {
            for b in parts.windows(2) {
                let part = Rectangle {
                    u: (a[0], a[1]),
                    y: (b[0], b[1]),
                };
                sum += exchange(&part, &whole, angle);
            }
        }
        let found = exchange(&whole, &whole, angle);
        assert!((sum - found).abs() < 1e-8, "{sum} {found}");
    }
}
