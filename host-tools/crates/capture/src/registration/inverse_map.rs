//! Inverse map: where in the camera's picture each pixel of a projector lies.
//!
//! A projector map says which place of the projector's picture each camera pixel sees. Three camera
//! pixels side by side make a triangle of the projector's picture; within it, places in the camera's
//! picture are linear. What lies beside all triangles, as at the borders, has the mean of its
//! neighbours' places.

use super::projector_map::ProjectorMap;

/// How many times larger than usual a triangle may be: across the edge of a surface they are.
const MOST_STRETCHED: f32 = 8.0;

/// Farthest from a known place that others are guessed, in usual sides of a triangle.
const FARTHEST: f32 = 3.0;

/// Part of a triangle by which pixels outside count to it, so that none falls between two.
const BESIDE: f32 = 1e-4;

impl ProjectorMap {
    /// Where in the camera's picture, `[x, y]` with the centre of its first pixel at `[0, 0]`, each
    /// pixel of the projector's picture lies, row by row, border included; `None` where the camera
    /// does not see it.
    #[must_use]
    pub fn inverse(&self) -> Vec<Option<[f32; 2]>> {
        let size = self.projector.size();
        let mut found = InversePlaces::new(size.width(), size.height());
        let (width, height) = self.camera;
        // Projector pixels along the side of a camera pixel.
        let usual = (size.pixels() as f32 / self.known().max(1) as f32)
            .sqrt()
            .max(1.0);
        for (x, y) in (1..height).flat_map(|y| (1..width).map(move |x| (x, y))) {
            let corner = |left: usize, up: usize| {
                let (x, y) = (x - left, y - up);
                let place = self.position[y * width + x];
                let known = place.iter().all(|side| side.is_finite());
                known.then_some((place, [x as f32, y as f32]))
            };
            let corners = [corner(1, 1), corner(0, 1), corner(1, 0), corner(0, 0)];
            for sides in [[0, 1, 2], [3, 1, 2]] {
                let [Some(a), Some(b), Some(c)] = sides.map(|at| corners[at]) else {
                    continue;
                };
                found.add([a, b, c], MOST_STRETCHED * usual);
            }
        }
        found.filled((FARTHEST * usual).ceil() as usize)
    }
}

/// A place of the projector's picture, and where the camera sees it.
type PlacePair = ([f32; 2], [f32; 2]);

struct InversePlaces {
    width: usize,
    height: usize,
    /// Place in the camera's picture and size of the triangle that said it.
    places: Vec<Option<([f32; 2], f32)>>,
}

impl InversePlaces {
    fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            places: vec![None; width * height],
        }
    }

    /// Adds the pixels of a triangle; where two overlap, the smaller one is right.
    fn add(&mut self, [a, b, c]: [PlacePair; 3], most: f32) {
        let axis = |axis: usize| [a.0[axis], b.0[axis], c.0[axis]];
        let least = [0, 1].map(|at| axis(at).into_iter().fold(f32::INFINITY, f32::min));
        let last = [0, 1].map(|at| axis(at).into_iter().fold(f32::NEG_INFINITY, f32::max));
        if (0..2).any(|at: usize| last[at] - least[at] > most) {
            return;
        }
        let cross = |p: [f32; 2], q: [f32; 2], r: [f32; 2]| {
            (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        };
        let area = cross(a.0, b.0, c.0);
        let pixels = |at: usize, side: usize| {
            let first = least[at].ceil().max(0.0) as usize;
            first..(last[at].floor() + 1.0).clamp(0.0, side as f32) as usize
        };
        if area.abs() < f32::EPSILON {
            return;
        }
        for y in pixels(1, self.height) {
            for x in pixels(0, self.width) {
                let at = [x as f32, y as f32];
                let shares = [
                    cross(at, b.0, c.0),
                    cross(a.0, at, c.0),
                    cross(a.0, b.0, at),
                ];
                let shares = shares.map(|share| share / area);
                let known = self.places[y * self.width + x];
                let smaller = known.is_none_or(|(_, other)| area.abs() < other);
                if smaller && shares.iter().all(|share| *share >= -BESIDE) {
                    let mean = |axis: usize| {
                        let corners = [a.1[axis], b.1[axis], c.1[axis]];
                        corners.iter().zip(shares).map(|(c, share)| c * share).sum()
                    };
                    self.places[y * self.width + x] = Some(([mean(0), mean(1)], area.abs()));
                }
            }
        }
    }

    /// The places, those up to `reach` pixels beside known ones guessed.
    fn filled(self, reach: usize) -> Vec<Option<[f32; 2]>> {
        let places = self.places.into_iter();
        let mut places: Vec<Option<[f32; 2]>> =
            places.map(|found| found.map(|(place, _)| place)).collect();
        for _ in 0..reach {
            let before = places.clone();
            for (at, place) in places.iter_mut().enumerate() {
                if place.is_none() {
                    *place = mean_beside(&before, at, self.width);
                }
            }
        }
        places
    }
}

/// Mean of what is known beside a pixel.
fn mean_beside(places: &[Option<[f32; 2]>], at: usize, width: usize) -> Option<[f32; 2]> {
    let beside = [
        at.checked_sub(width),
        Some(at + width),
        (!at.is_multiple_of(width)).then(|| at - 1),
        (at % width + 1 < width).then_some(at + 1),
    ];
    let known = beside.into_iter().flatten();
    let known = known.filter_map(|at| places.get(at).copied().flatten());
    let (sum, count) = known.fold(([0.0; 2], 0.0), |([x, y], count), place| {
        ([x + place[0], y + place[1]], count + 1.0)
    });
    (count > 0.0).then(|| sum.map(|sum: f32| sum / count))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::registration::projector_map::MapSource;
    use iltm_runtime::FrameSize;
    use iltm_runtime::placement::ProjectorPixels;

    /// The map of a camera of this size that sees `place` of the projector's picture.
    pub(crate) fn map(
        projector: (u16, u16),
        camera: (usize, usize),
        place: impl Fn(f32, f32) -> [f32; 2],
    ) -> ProjectorMap {
        let size = FrameSize::new(projector.0, projector.1).unwrap();
        let pixels = 0..camera.0 * camera.1;
        let of_pixel = |at: usize| {
            let [x, y] = place((at % camera.0) as f32, (at / camera.0) as f32);
            let inside = |at: f32, side: u16| (-0.5..f32::from(side) - 0.5).contains(&at);
            if inside(x, projector.0) && inside(y, projector.1) {
                [x, y]
            } else {
                [f32::NAN; 2]
            }
        };
        let position: Vec<[f32; 2]> = pixels.map(of_pixel).collect();
        ProjectorMap {
            source: MapSource::Waves,
            projector: ProjectorPixels::whole(size),
            camera,
            binning: 1,
            uncertainty: position
                .iter()
                .map(|place| 0.1 * place[0] / place[0])
                .collect(),
            position,
        }
    }

    /// A slanted look: the picture lies turned and is wider on the right.
    fn slanted(scale: f32) -> impl Fn(f32, f32) -> [f32; 2] {
        move |x, y| {
            let (x, y) = (x * scale - 6.0, y * scale - 4.0);
            let far = 1.0 + 0.004 * x;
            [(x + 0.1 * y) / far, (y - 0.15 * x) / far]
        }
    }

    #[test]
    fn cameras_finer_and_coarser_than_the_projector_say_where_its_pixels_lie() {
        for (scale, camera) in [(0.4, (180, 140)), (1.0, (72, 56)), (2.3, (32, 25))] {
            let place = slanted(scale);
            let map = map((40, 30), camera, &place);
            let inverse = map.inverse();
            let mut inside = 0;
            for (at, found) in inverse.iter().enumerate() {
                let (x, y) = ((at % 40) as f32, (at / 40) as f32);
                let found = found.expect("the camera sees the whole picture");
                let [own_x, own_y] = place(found[0], found[1]);
                let off = (own_x - x).hypot(own_y - y);
                // Beside the outermost camera pixels only neighbours say something.
                let border = [x, y, 39.0 - x, 29.0 - y];
                let reach = scale.max(1.0) * 1.3;
                if border.into_iter().all(|way| way >= reach) {
                    inside += 1;
                    assert!(off < 0.05 * scale.max(1.0), "{scale}: {x} {y}: {off}");
                } else {
                    assert!(off < 2.0 * reach, "{scale}: {x} {y}: {off}");
                }
            }
            assert!(inside > 700, "{inside}");
        }
    }

    #[test]
    fn what_the_camera_does_not_see_has_no_place() {
        // Half of the picture lies beside the camera's.
        let half = map((40, 30), (20, 30), |x, y| [x, y]).inverse();
        for (at, found) in half.iter().enumerate() {
            let (x, y) = ((at % 40) as f32, (at / 40) as f32);
            match found {
                Some(place) if x <= 19.0 => {
                    let off = (place[0] - x).hypot(place[1] - y);
                    assert!(off < 1e-4, "{x} {y}: {off}");
                }
                Some(_) => assert!(x < 25.0, "{x}"),
                None => assert!(x > 20.0, "{x}"),
            }
        }
        let nothing = map((4, 3), (5, 5), |_, _| [-9.0; 2]).inverse();
        assert_eq!(nothing, vec![None; 12]);
    }

    #[test]
    fn a_wrong_place_among_right_ones_moves_only_its_own_pixels() {
        let mut wrong = map((40, 30), (40, 30), |x, y| [x, y]);
        wrong.position[15 * 40 + 20] = [23.0, 15.0];
        let inverse = wrong.inverse();
        let moved = |(at, place): (usize, &Option<[f32; 2]>)| {
            let [x, y] = place.unwrap();
            let off = (x - (at % 40) as f32).hypot(y - (at / 40) as f32);
            off > 0.01
        };
        let moved = inverse.iter().enumerate().filter(|one| moved(*one)).count();
        assert!(moved <= 5, "{moved}");
    }
}
