//! Crossing light: what one of several projectors throws on what another one lights, by bounces
//! and where they overlap.

use iltm_picture::FramePart;
use nalgebra::{Matrix2, Vector2};

/// Light that one projector throws on what another one lights.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CrossingLight {
    /// Number of the one that throws it, from 0.
    pub from: usize,
    /// Number of the other one.
    pub to: usize,
    /// Light that bounces from the first one's white to where the second one lights alone, of the
    /// light there under its own white; 0 if it lights nothing alone.
    pub bounced: f64,
    /// Part of the second one's picture, as the camera sees it, that the first one lights itself.
    pub overlap: f64,
}

/// What each of several projectors lights, and how they share the light.
#[derive(Clone, Debug)]
pub struct ProjectorAreas {
    /// Whether cells of two projectors light one place.
    pub overlap: bool,
    /// Who lights whom, of all pairs.
    pub crossing: Vec<CrossingLight>,
    /// Share of the light that each cell's projector shows there, length `N`.
    pub cell_shares: Vec<f64>,
    /// The cells of each projector in the wide frame.
    pub parts: Vec<FramePart>,
    /// Share of each projector at each camera pixel; 0 where it does not reach.
    pub pixel_shares: Vec<Vec<f32>>,
}

impl ProjectorAreas {
    /// Part of a projector's picture, as the camera sees it, that no other one lights itself.
    #[must_use]
    pub fn alone(&self, projector: usize) -> f64 {
        let shares = &self.pixel_shares[projector];
        let count = |least: f32| shares.iter().filter(|share| **share >= least).count() as f64;
        count(1.0) / count(f32::MIN_POSITIVE).max(1.0)
    }
}

/// Who lights whom, of all pairs: by the shares of each projector at each camera pixel, and `white`,
/// the light of a projector's white at a pixel.
pub(crate) fn crossing_light(
    shares: &[Vec<f32>],
    white: impl Fn(usize, usize) -> f64,
) -> Vec<CrossingLight> {
    let pairs = (0..shares.len()).flat_map(|from| (0..shares.len()).map(move |to| (from, to)));
    let of_pair = |(from, to): (usize, usize)| {
        let (mut reached, mut both, mut bounced, mut own) = (0.0, 0.0, 0.0, 0.0);
        for pixel in (0..shares[to].len()).filter(|pixel| shares[to][*pixel] > 0.0) {
            reached += 1.0;
            if shares[from][pixel] > 0.0 {
                both += 1.0;
            } else if shares[to][pixel] >= 1.0 {
                bounced += white(from, pixel);
                own += white(to, pixel);
            }
        }
        CrossingLight {
            from,
            to,
            bounced: if own > 0.0 { bounced / own } else { 0.0 },
            overlap: both / f64::max(reached, 1.0),
        }
    };
    pairs.filter(|(from, to)| from != to).map(of_pair).collect()
}

/// Part of what the light under black of two captures differs by that whites must explain.
const EXPLAINED: f64 = 0.8;

/// Most that the capture's own white may take of it, of what the other's takes: light in the room
/// falls on what both light.
const OWN_WHITE: f64 = 0.2;

/// Share of its white that another projector showed while one was photographed and it should be dark: by
/// the light under black of both captures and by their white at every pixel, the first one's first.
/// `None` if something else is the difference.
pub(crate) fn shown_under_black(pixels: impl Iterator<Item = [[f64; 2]; 2]>) -> Option<f64> {
    let mut normal = Matrix2::zeros();
    let mut right = Vector2::zeros();
    let mut all = 0.0;
    for [black, white] in pixels {
        let whites = Vector2::from(white);
        let more = black[0] - black[1];
        normal += whites * whites.transpose();
        right += whites * more;
        all += more * more;
    }
    let shares = normal.try_inverse()? * right;
    let explained = right.dot(&shares) / all;
    let [by_own, by_other] = shares.into();
    (explained > EXPLAINED && by_own < OWN_WHITE * by_other).then_some(by_other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_of_a_projector_that_was_not_dark_is_told_from_light_in_the_room() {
        // The first lights the left half, the second the right one, and each a little of the other's.
        let white = [[1.0, 0.9, 0.1, 0.1], [0.1, 0.1, 0.8, 0.7]];
        let room = [0.02, 0.02, 0.01, 0.03];
        let black = |shown: [f64; 2], lamp: f64, pixel: usize| {
            shown[0] * white[0][pixel] + shown[1] * white[1][pixel] + (1.0 + lamp) * room[pixel]
        };
        let found = |own: [f64; 2], other: [f64; 2], lamp: f64| {
            shown_under_black((0..4).map(|pixel| {
                let black = [black(own, lamp, pixel), black(other, 0.0, pixel)];
                [black, white.map(|white| white[pixel])]
            }))
        };
        let near = |found: Option<f64>, share: f64| (found.unwrap() - share).abs() < 1e-9;
        assert!(near(found([0.0, 0.5], [0.0; 2], 0.0), 0.5));
        assert!(near(found([0.0, 0.003], [0.0; 2], 0.0), 0.003));
        // Neither was dark in the other's capture.
        assert!(near(found([0.0, 0.4], [0.3, 0.0], 0.0), 0.4));
        // A lamp lights what both light; the same black of a projector is in both captures.
        assert_eq!(found([0.0; 2], [0.0; 2], 5.0), None);
        assert_eq!(found([0.002; 2], [0.002; 2], 0.0), None);
        // The other one was off in this capture.
        assert!(found([0.0; 2], [0.0, 0.01], 0.0).is_none_or(|share| share < 0.0));
    }

    #[test]
    fn bounces_count_where_one_lights_alone_and_overlaps_where_both_do() {
        // Ten pixels in a row: the first lights six, the second five, both the one in the middle.
        let shares = vec![
            [1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0].to_vec(),
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 1.0].to_vec(),
        ];
        // The first is twice as bright; a tenth of what either throws is seen everywhere.
        let white = |of: usize, pixel: usize| {
            let strength = if of == 0 { 2.0 } else { 1.0 };
            let direct = if shares[of][pixel] > 0.0 { 0.9 } else { 0.0 };
            strength * (direct + 0.1)
        };
        let found = crossing_light(&shares, white);
        let expected = [(0, 1, 0.2, 1.0 / 5.0), (1, 0, 0.05, 1.0 / 6.0)];
        assert_eq!(found.len(), expected.len());
        for (found, (from, to, bounced, overlap)) in found.iter().zip(expected) {
            assert_eq!((found.from, found.to), (from, to));
            assert!((found.bounced - bounced).abs() < 1e-12, "{found:?}");
            assert!((found.overlap - overlap).abs() < 1e-12, "{found:?}");
        }
        let areas = ProjectorAreas {
            overlap: true,
            crossing: found,
            cell_shares: Vec::new(),
            parts: Vec::new(),
            pixel_shares: shares,
        };
        assert!((areas.alone(0) - 5.0 / 6.0).abs() < 1e-12);
        assert!((areas.alone(1) - 4.0 / 5.0).abs() < 1e-12);
    }
}
