//! Correspondences of two projectors' pixels: which pixel of one lights the place that a pixel of the
//! other lights, by the projector maps of one camera. They depend on projectors and surfaces, not on
//! where the camera stands, so that those of one session can be held against those of another.

use super::projector_map::ProjectorMap;
use iltm_picture::statistics::median;
use std::collections::HashMap;

/// Pixels of the first projector along its width and height that are looked at.
const LOOKED_AT: [usize; 2] = [96, 64];

/// A pixel of one projector and the place of another's picture that lights the same place.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Correspondence {
    /// Numbers of both, from 0.
    pub projectors: [usize; 2],
    /// Column and row of the pixel.
    pub pixel: [u16; 2],
    /// Place in the picture of the other, `[x, y]` in its pixels.
    pub place: [f32; 2],
}

/// Correspondences of all pairs of projectors, both ways, at some of the pixels of the first, given each
/// map's [`inverse`](ProjectorMap::inverse).
pub(crate) fn find(
    maps: &[&ProjectorMap],
    inverse: &[Vec<Option<[f32; 2]>>],
) -> Vec<Correspondence> {
    let mut found = Vec::new();
    for (first, (map, inverse)) in maps.iter().zip(inverse).enumerate() {
        let size = map.projector.size();
        let step = [size.width(), size.height()];
        let step = [0, 1].map(|axis: usize| step[axis].div_ceil(LOOKED_AT[axis]).max(1));
        for y in (0..size.height()).step_by(step[1]) {
            for x in (0..size.width()).step_by(step[0]) {
                let Some(seen) = inverse[y * size.width() + x] else {
                    continue;
                };
                let others = maps.iter().enumerate().filter(|(other, _)| *other != first);
                found.extend(others.filter_map(|(other, map)| {
                    Some(Correspondence {
                        projectors: [first, other],
                        pixel: [x as u16, y as u16],
                        place: at(map, seen)?,
                    })
                }));
            }
        }
    }
    found
}

/// A map's place between four pixels of the camera; `None` where one of them knows none.
fn at(map: &ProjectorMap, [x, y]: [f32; 2]) -> Option<[f32; 2]> {
    let (width, height) = map.camera;
    let (left, top) = (x.max(0.0) as usize, y.max(0.0) as usize);
    if left + 1 >= width || top + 1 >= height {
        return None;
    }
    let (right, down) = (x - left as f32, y - top as f32);
    let corners = [
        (top * width + left, (1.0 - down) * (1.0 - right)),
        (top * width + left + 1, (1.0 - down) * right),
        ((top + 1) * width + left, down * (1.0 - right)),
        ((top + 1) * width + left + 1, down * right),
    ];
    let mean = |axis: usize| -> f32 {
        let corners = corners.iter();
        corners
            .map(|(pixel, share)| share * map.position[*pixel][axis])
            .sum()
    };
    let place = [mean(0), mean(1)];
    place.iter().all(|side| side.is_finite()).then_some(place)
}

/// How far the pictures of two projectors lie from where they lay against each other.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PictureShift {
    /// Numbers of both projectors, from 0.
    pub projectors: [usize; 2],
    /// Median distance, pixels of the second; infinite if they overlap at other pixels altogether.
    pub pixels: f64,
    /// How far right and down the second picture lies, seen from the first: medians, pixels of the
    /// second.
    pub shift: [f64; 2],
}

/// Places that must be known both times to compare them.
const LEAST_KNOWN: usize = 16;

impl PictureShift {
    /// Pairs of projectors, from 0, whose pictures overlapped `before`, and of which `now` shows too few
    /// places that both light.
    #[must_use]
    pub fn unseen(before: &[Correspondence], now: &[Correspondence]) -> Vec<[usize; 2]> {
        let known = |list: &[Correspondence], pair| of_pair(list, pair).len() >= LEAST_KNOWN;
        let all = pairs(before).into_iter();
        all.filter(|pair| known(before, *pair) && !known(now, *pair))
            .collect()
    }

    /// Of every pair of projectors whose pictures overlapped `before` and overlap `now`.
    #[must_use]
    pub fn find(before: &[Correspondence], now: &[Correspondence]) -> Vec<Self> {
        let of_pair = |projectors: [usize; 2]| {
            let (before, now) = (of_pair(before, projectors), of_pair(now, projectors));
            if before.len().min(now.len()) < LEAST_KNOWN {
                return None;
            }
            let moved = before.iter().filter_map(|(pixel, was)| {
                let is = now.get(pixel)?;
                // The pixel lights what one farther right lit, so the picture lies farther left.
                Some([0, 1].map(|axis: usize| f64::from(was[axis] - is[axis])))
            });
            let moved: Vec<[f64; 2]> = moved.collect();
            let median = |of: fn(&[f64; 2]) -> f64| median(moved.iter().map(of).collect());
            if moved.len() < LEAST_KNOWN {
                return Some(Self {
                    projectors,
                    pixels: f64::INFINITY,
                    shift: [0.0; 2],
                });
            }
            Some(Self {
                projectors,
                pixels: median(|way| way[0].hypot(way[1]))?,
                shift: [median(|way| way[0])?, median(|way| way[1])?],
            })
        };
        pairs(before).into_iter().filter_map(of_pair).collect()
    }

    /// The two projectors that show each other's pictures, if everything lies where it lay once they
    /// are exchanged, to within `most` pixels.
    #[must_use]
    pub fn exchanged(
        before: &[Correspondence],
        now: &[Correspondence],
        most: f64,
    ) -> Option<[usize; 2]> {
        let as_it_was = |now: &[Correspondence]| {
            let shifts = Self::find(before, now);
            !shifts.is_empty() && shifts.iter().all(|shift| shift.pixels <= most)
        };
        let all = before.iter().flat_map(|known| known.projectors).max()?;
        let swaps = (0..all).flat_map(|a| (a + 1..=all).map(move |b| [a, b]));
        let told = |[a, b]: [usize; 2]| {
            let renamed = |number: usize| match number {
                number if number == a => b,
                number if number == b => a,
                number => number,
            };
            let renamed = now.iter().map(|known| Correspondence {
                projectors: known.projectors.map(renamed),
                ..*known
            });
            as_it_was(&renamed.collect::<Vec<_>>())
        };
        if as_it_was(now) {
            return None;
        }
        swaps.into_iter().find(|swap| told(*swap))
    }
}

/// Pairs of projectors, the first before the second.
fn pairs(known: &[Correspondence]) -> Vec<[usize; 2]> {
    let mut pairs: Vec<[usize; 2]> = known.iter().map(|known| known.projectors).collect();
    pairs.retain(|[first, second]| first < second);
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Places of a pair, by pixel.
fn of_pair(known: &[Correspondence], projectors: [usize; 2]) -> HashMap<[u16; 2], [f32; 2]> {
    let own = known.iter().filter(|known| known.projectors == projectors);
    own.map(|known| (known.pixel, known.place)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::inverse_map::tests::map;

    /// Maps of two projectors of 60 x 40 pixels on a wall, as a camera at `camera` with so many pixels
    /// of the wall in one of its own sees them; the second lies at `second`, turned by `turn`.
    fn seen((camera, scale): ([f32; 2], f32), second: [f32; 2], turn: f32) -> [ProjectorMap; 2] {
        let map = |place: &dyn Fn(f32, f32) -> [f32; 2]| {
            let of_pixel = |x, y| place(camera[0] + scale * x, camera[1] + scale * y);
            map((60, 40), (120, 80), of_pixel)
        };
        let (sin, cos) = turn.sin_cos();
        [
            map(&|x, y| [x, y]),
            map(&|x, y| {
                let (x, y) = (x - second[0], y - second[1]);
                [cos * x + sin * y, cos * y - sin * x]
            }),
        ]
    }

    fn found(camera: ([f32; 2], f32), second: [f32; 2], turn: f32) -> Vec<Correspondence> {
        let [first, second] = seen(camera, second, turn);
        between([&first, &second])
    }

    fn between(maps: [&ProjectorMap; 2]) -> Vec<Correspondence> {
        find(&maps, &maps.map(ProjectorMap::inverse))
    }

    #[test]
    fn pictures_that_stay_are_told_from_those_that_move_wherever_the_camera_stands() {
        let before = found(([-10.0, -8.0], 1.0), [40.0, 2.0], 0.02);
        let shift = |camera, second, turn| {
            let shifts = PictureShift::find(&before, &found(camera, second, turn));
            assert_eq!(shifts.len(), 1);
            assert_eq!(shifts[0].projectors, [0, 1]);
            shifts[0]
        };
        let elsewhere = ([-6.5, -7.3], 1.13);
        assert!(shift(elsewhere, [40.0, 2.0], 0.02).pixels < 0.01);
        let moved = shift(elsewhere, [40.7, 1.6], 0.02);
        let [right, down] = moved.shift;
        assert!(
            (right - 0.7).abs() < 0.03 && (down + 0.4).abs() < 0.03,
            "{moved:?}"
        );
        assert!(
            (moved.pixels - 0.7_f64.hypot(0.4)).abs() < 0.03,
            "{moved:?}"
        );
        // Turned about the middle of what both light, it lies elsewhere at its ends.
        let turned = shift(elsewhere, [40.0, 2.0], 0.12);
        assert!(turned.pixels > 1.0, "{turned:?}");
    }

    #[test]
    fn projectors_that_show_each_others_pictures_are_told() {
        let camera = ([-10.0, -8.0], 1.0);
        let before = found(camera, [40.0, 2.0], 0.02);
        let [first, second] = &seen(([-6.5, -7.3], 1.13), [40.0, 2.0], 0.02);
        let swapped = between([second, first]);
        assert_eq!(
            PictureShift::exchanged(&before, &swapped, 0.1),
            Some([0, 1])
        );
        assert!(
            PictureShift::find(&before, &swapped)[0]
                .pixels
                .is_infinite()
        );
        for now in [
            &before,
            &between([first, second]),
            &found(camera, [44.0, 2.0], 0.02),
        ] {
            assert_eq!(PictureShift::exchanged(&before, now, 0.1), None);
        }
        assert_eq!(PictureShift::exchanged(&[], &swapped, 0.1), None);
    }

    #[test]
    fn pictures_that_do_not_overlap_are_not_compared() {
        let apart = found(([-10.0, -8.0], 1.0), [70.0, 2.0], 0.0);
        assert_eq!(apart, Vec::new());
        let overlapping = found(([-10.0, -8.0], 1.0), [40.0, 2.0], 0.0);
        assert_eq!(PictureShift::find(&overlapping, &apart), Vec::new());
        assert_eq!(PictureShift::unseen(&overlapping, &apart), [[0, 1]]);
        assert!(PictureShift::unseen(&overlapping, &overlapping).is_empty());
        assert_eq!(PictureShift::find(&apart, &overlapping), Vec::new());
    }
}
