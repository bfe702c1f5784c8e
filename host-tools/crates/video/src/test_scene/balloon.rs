//! Balloons.

use super::colour::Colour;
use super::noise::swing;

/// What a balloon looks like and how it flies.
struct Plan {
    /// Where it is at the start.
    start: (f32, f32),
    /// Heights of the picture a second to the right.
    speed: f32,
    radius: f32,
    /// Seconds of a slow up and down.
    period: f32,
    colours: [Colour; 3],
}

const RED: Colour = Colour::new(0.80, 0.035, 0.03);
const YELLOW: Colour = Colour::new(0.95, 0.62, 0.03);
const WHITE: Colour = Colour::new(0.90, 0.86, 0.80);
const BLUE: Colour = Colour::new(0.03, 0.10, 0.62);
const GREEN: Colour = Colour::new(0.03, 0.42, 0.12);
const VIOLET: Colour = Colour::new(0.32, 0.04, 0.50);

const PLANS: [Plan; 4] = [
    Plan {
        start: (0.62, 0.10),
        speed: -0.012,
        radius: 0.030,
        period: 19.0,
        colours: [VIOLET, YELLOW, VIOLET],
    },
    Plan {
        start: (-0.12, 0.17),
        speed: 0.016,
        radius: 0.050,
        period: 16.0,
        colours: [BLUE, WHITE, GREEN],
    },
    Plan {
        start: (-0.52, 0.19),
        speed: 0.030,
        radius: 0.125,
        period: 13.0,
        colours: [RED, YELLOW, RED],
    },
    Plan {
        start: (0.16, 0.35),
        speed: -0.021,
        radius: 0.070,
        period: 17.0,
        colours: [GREEN, WHITE, RED],
    },
];

/// A balloon at one moment.
pub(super) struct Balloon {
    plan: &'static Plan,
    u: f32,
    v: f32,
}

/// All balloons, the farthest first.
pub(super) fn all(time: f32) -> Vec<Balloon> {
    let at = |plan: &'static Plan| Balloon {
        plan,
        u: plan.start.0 + plan.speed * time,
        v: plan.start.1 + 0.25 * plan.radius * swing(time / plan.period),
    };
    PLANS.iter().map(at).collect()
}

impl Balloon {
    /// The balloon before a light.
    pub(super) fn cover(&self, u: f32, v: f32, pixel: f32, behind: Colour) -> Colour {
        let radius = self.plan.radius;
        let (x, y) = ((u - self.u) / radius, (v - self.v) / radius);
        if x.abs() > 1.1 || !(-2.0..=1.1).contains(&y) {
            return behind;
        }
        let soft = pixel / radius;
        let light = Self::basket(x, y, soft, behind);
        // Half the width at this height: a ball, and below it a taper to the mouth.
        let half_width = if y > -0.45 {
            (1.0 - y * y).max(0.0).sqrt()
        } else {
            let down = (y + 1.28) / 0.83;
            0.17 + 0.723 * down * (1.0 - 0.1 * (1.0 - down))
        };
        if y < -1.28 {
            return light;
        }
        let covered = ((half_width - x.abs()) / soft + 0.5).clamp(0.0, 1.0);
        let open = ((y + 1.28) / soft).clamp(0.0, 1.0);
        light.mix(self.envelope(x, y, half_width), covered * open)
    }

    /// Light of the cloth.
    fn envelope(&self, x: f32, y: f32, half_width: f32) -> Colour {
        let across = (x / half_width.max(0.02)).clamp(-1.0, 1.0);
        // Gores are equally wide on the ball, and narrow towards its sides.
        let around = across * (0.64 + 0.36 * across * across);
        let gore = ((around + 1.0) * 5.0).floor();
        let [first, second, band] = self.plan.colours;
        let cloth = if (0.08..0.30).contains(&y) {
            band.mix(WHITE, 0.35)
        } else if gore as i32 % 2 == 0 {
            first
        } else {
            second
        };
        // Seams are a little darker; the cloth bulges between them.
        let in_gore = ((around + 1.0) * 5.0 - gore - 0.5) * 2.0;
        let bulge = 1.0 - 0.22 * in_gore * in_gore;
        let facing = (1.0 - across * across).max(0.0).sqrt();
        // The sun comes from the right, the sky from above, and some of the sun
        // through the cloth.
        let lit =
            0.18 + 0.62 * (0.55 * across + 0.25 * y + 0.45 * facing).max(0.0) + 0.10 * (1.0 + y);
        let sun = Colour::new(1.25, 1.0, 0.76);
        cloth.filter(sun) * (lit * bulge * 1.35) + cloth * 0.10
    }

    /// The basket and its ropes before a light.
    fn basket(x: f32, y: f32, soft: f32, behind: Colour) -> Colour {
        let wicker = Colour::new(0.16, 0.085, 0.035);
        if (-1.78..=-1.55).contains(&y) {
            let covered = ((0.13 - x.abs()) / soft + 0.5).clamp(0.0, 1.0);
            let weave = 0.8 + 0.4 * (((y * 40.0).floor() + (x * 30.0).floor()) as i32 & 1) as f32;
            return behind.mix(wicker * (weave * (1.0 + 2.0 * (x + 0.13))), covered);
        }
        if (-1.55..=-1.28).contains(&y) {
            let place = 0.11 + 0.05 * (y + 1.55) / 0.27;
            let rope = (1.0 - ((x.abs() - place).abs() / soft.max(0.015))).clamp(0.0, 1.0);
            return behind.mix(wicker * 0.6, 0.8 * rope);
        }
        behind
    }
}
