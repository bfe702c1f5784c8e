//! Blending of projectors whose pictures overlap: the share of each in the light of a place.
//!
//! A projector's share goes with the distance to where others light alone, against the sum of these
//! distances of all that light the place (after Raskar and others, *Multi-projector displays using
//! camera-based registration*, 1999). It is measured in the camera's picture. Photographs from several
//! places of the camera have no one picture; there it is measured in each projector's own, where a
//! place has the same share from everywhere.

use crate::cells::measurements::Measurements;
use crate::registration::projector_map::ProjectorMap;
use crate::wide_frame::place;

/// A sample of no picture.
const NONE: u32 = u32::MAX;

/// Camera pixels to a side of a sample: fewer leave samples that no pixel sees.
const PIXELS_OF_SAMPLE: f64 = 1.5;

/// Samples along a cell's side at most.
const MOST_SAMPLES: f64 = 32.0;

/// A projector's picture in square samples.
struct Samples {
    /// Samples along a cell's side.
    per_cell: f32,
    width: usize,
    height: usize,
    /// Places in samples that camera pixels see; `None` where the projector does not reach.
    places: Vec<Option<[f32; 2]>>,
}

impl Samples {
    fn new(own: &Measurements) -> Self {
        let per_cell = own.registration.cell_side() / PIXELS_OF_SAMPLE;
        let per_cell = per_cell.clamp(1.0, MOST_SAMPLES).floor();
        let (width, height) = own.registration.camera;
        // Finer than cells in any case.
        let of_cells = match &own.map {
            Some(Ok(_)) => None,
            _ => Some(ProjectorMap::of_cells(own)),
        };
        let places = (0..width * height).map(|pixel| {
            let place = match &of_cells {
                Some(map) => {
                    let place = map.position[pixel];
                    let known = place.iter().all(|side| side.is_finite());
                    known.then(|| map.in_cells(place, own.grid))?
                }
                None => place(own, pixel)?,
            };
            Some(place.map(|side| side * per_cell as f32))
        });
        Self {
            per_cell: per_cell as f32,
            width: own.grid.cols() * per_cell as usize,
            height: own.grid.rows() * per_cell as usize,
            places: places.collect(),
        }
    }

    /// The sample that a camera pixel sees, or [`NONE`].
    fn of_pixel(&self, pixel: usize) -> u32 {
        self.places[pixel].map_or(NONE, |[x, y]| {
            let within = |side: f32, most: usize| (side.max(0.0) as usize).min(most - 1);
            (within(y, self.height) * self.width + within(x, self.width)) as u32
        })
    }

    /// Samples that some camera pixel sees for which a condition holds, with holes up to a cell closed.
    fn seen(&self, holds: impl Fn(usize) -> bool) -> Vec<bool> {
        let mut seen = vec![false; self.width * self.height];
        for pixel in 0..self.places.len() {
            if let Some(seen) = seen.get_mut(self.of_pixel(pixel) as usize) {
                *seen |= holds(pixel);
            }
        }
        closed(&seen, self.width, self.per_cell)
    }

    /// Samples that this projector lights and another one does not.
    fn alone(&self, other: &Self) -> Vec<bool> {
        let lit = self.seen(|_| true);
        let by_both = self.seen(|pixel| other.places[pixel].is_some());
        let alone: Vec<bool> = lit
            .iter()
            .zip(by_both)
            .map(|(lit, both)| *lit && !both)
            .collect();
        // Where edges of pictures run beside each other, one reaches a little farther: no border.
        opened(&alone, self.width, self.per_cell / 2.0)
    }

    /// A value between the centres of four samples.
    fn between(&self, values: &[f32], [x, y]: [f32; 2]) -> f32 {
        let axis = |side: f32, count: usize| {
            let side = (side - 0.5).clamp(0.0, (count - 1) as f32);
            let first = (side as usize).min(count.saturating_sub(2));
            (first, (first + 1).min(count - 1), side - first as f32)
        };
        let (left, right, across) = axis(x, self.width);
        let (top, bottom, down) = axis(y, self.height);
        let row = |row: usize| {
            let of = |col: usize| values[row * self.width + col];
            of(left) * (1.0 - across) + of(right) * across
        };
        row(top) * (1.0 - down) + row(bottom) * down
    }
}

/// Share of each projector at each camera pixel, by projector and pixel; 0 where it does not reach.
pub(crate) fn pixel_shares(own: &[Measurements]) -> Vec<Vec<f32>> {
    let of_places = own.iter().any(|own| own.settings.camera.places > 1);
    let mut shares = if of_places {
        distances_in_own_pictures(own)
    } else {
        distances_in_photographs(own)
    };
    for pixel in 0..shares[0].len() {
        let sum: f32 = shares.iter().map(|shares| shares[pixel]).sum();
        if sum > 0.0 {
            for shares in &mut shares {
                shares[pixel] /= sum;
            }
        }
    }
    shares
}

/// Distance of each camera pixel, in the camera's picture, to where other projectors light alone, by projector
/// and pixel; 0 where the projector does not reach.
fn distances_in_photographs(own: &[Measurements]) -> Vec<Vec<f32>> {
    let (width, height) = own[0].registration.camera;
    let pixels = width * height;
    let lit: Vec<Vec<bool>> = own
        .iter()
        .map(|own| {
            let lit: Vec<bool> = (0..pixels)
                .map(|pixel| place(own, pixel).is_some())
                .collect();
            // Single pixels that tell no place are no border.
            closed(&lit, width, own.registration.cell_side() as f32)
        })
        .collect();
    let apart = |index: usize| {
        let others_alone = (0..pixels).map(|pixel| {
            let mut others = lit.iter().enumerate();
            let others = others.any(|(at, lit)| at != index && lit[pixel]);
            others && !lit[index][pixel]
        });
        // Where edges of pictures run beside each other, one reaches a little farther: no border
        // either.
        let half_a_cell = own[index].registration.cell_side() as f32 / 2.0;
        let others_alone = opened(&others_alone.collect::<Vec<_>>(), width, half_a_cell);
        let mut apart = distances(&others_alone, width);
        for (distance, lit) in apart.iter_mut().zip(&lit[index]) {
            // Finite, so that projectors which cover the same have equal shares.
            *distance = if *lit {
                distance.min(pixels as f32)
            } else {
                0.0
            };
        }
        apart
    };
    (0..own.len()).map(apart).collect()
}

/// The same, each in the projector's own picture.
fn distances_in_own_pictures(own: &[Measurements]) -> Vec<Vec<f32>> {
    let width = own[0].registration.camera.0;
    let pictures: Vec<Samples> = own.iter().map(Samples::new).collect();
    let of = |(index, own): (usize, &Measurements)| {
        let mut apart = distances_to_border(&pictures, index);
        // Single pixels that tell no place are as those beside them.
        fill(&mut apart, width, own.registration.cell_side() as f32);
        apart
    };
    own.iter().enumerate().map(of).collect()
}

/// Distance of camera pixels, in the picture of one projector, to where that ends and others go on, in
/// cells; 0 where the projector does not reach.
fn distances_to_border(pictures: &[Samples], index: usize) -> Vec<f32> {
    let picture = &pictures[index];
    let mut border = vec![false; picture.width * picture.height];
    for other in pictures.iter().enumerate().filter(|(at, _)| *at != index) {
        let (_, other) = other;
        let from_alone = distances(&other.alone(picture), other.width);
        for pixel in 0..other.places.len() {
            let (here, there) = (picture.of_pixel(pixel), other.of_pixel(pixel));
            // Right beside it, diagonally as well.
            if here != NONE && from_alone.get(there as usize).is_some_and(|way| *way < 1.5) {
                border[here as usize] = true;
            }
        }
    }
    let apart = distances(&border, picture.width);
    // Finite, so that projectors which cover the same have equal shares.
    let most = (picture.width + picture.height) as f32;
    // From the outer edge of the border's samples, so that what is lit has a share.
    let apart: Vec<f32> = apart.iter().map(|way| way.min(most) + 0.5).collect();
    let places = picture.places.iter();
    places
        .map(|place| {
            place.map_or(0.0, |place| {
                picture.between(&apart, place) / picture.per_cell
            })
        })
        .collect()
}

/// Gives zeros in holes and notches up to `reach` pixels the nearest value.
fn fill(values: &mut [f32], width: usize, reach: f32) {
    let known: Vec<bool> = values.iter().map(|value| *value > 0.0).collect();
    let wanted = closed(&known, width, reach);
    let mut unknown: Vec<usize> = (0..values.len())
        .filter(|at| wanted[*at] && !known[*at])
        .collect();
    while !unknown.is_empty() {
        let beside = |at: usize| {
            let (x, above) = (at % width, at.checked_sub(width));
            let left = (x > 0).then(|| at - 1);
            let right = (x + 1 < width).then_some(at + 1);
            let below = (at + width < values.len()).then_some(at + width);
            let beside = [above, left, right, below].into_iter().flatten();
            beside.map(|at| values[at]).fold(0.0, f32::max)
        };
        let found: Vec<(usize, f32)> = unknown.iter().map(|at| (*at, beside(*at))).collect();
        let before = unknown.len();
        for (at, value) in found {
            values[at] = value;
        }
        unknown.retain(|at| values[*at] <= 0.0);
        if unknown.len() == before {
            break;
        }
    }
}

/// A region without its holes and notches up to `reach` pixels.
fn closed(region: &[bool], width: usize, reach: f32) -> Vec<bool> {
    let near = distances(region, width);
    let outside: Vec<bool> = near.iter().map(|distance| *distance > reach).collect();
    let away = distances(&outside, width);
    let within = away.iter().zip(region);
    within.map(|(away, own)| *own || *away > reach).collect()
}

/// A region without its parts that are thinner than twice `reach` pixels.
fn opened(region: &[bool], width: usize, reach: f32) -> Vec<bool> {
    let rest: Vec<bool> = region.iter().map(|within| !within).collect();
    let closed = closed(&rest, width, reach);
    closed.iter().map(|rest| !rest).collect()
}

/// Distance of each pixel to the nearest of a region, in pixels along the eight directions;
/// infinite if it is empty.
fn distances(region: &[bool], width: usize) -> Vec<f32> {
    let mut found: Vec<f32> = (region.iter())
        .map(|within| if *within { 0.0 } else { f32::INFINITY })
        .collect();
    let height = found.len() / width;
    let diagonal = std::f32::consts::SQRT_2;
    let mut visit = |pixel: usize, row: isize, side: isize| {
        let (x, y) = (pixel % width, pixel / width);
        let beside = [
            (row, -1, diagonal),
            (row, 0, 1.0),
            (row, 1, diagonal),
            (0, side, 1.0),
        ];
        for (down, right, step) in beside {
            let x = x.checked_add_signed(right).filter(|x| *x < width);
            let y = y.checked_add_signed(down).filter(|y| *y < height);
            if let (Some(x), Some(y)) = (x, y) {
                found[pixel] = found[pixel].min(found[y * width + x] + step);
            }
        }
    };
    (0..region.len()).for_each(|pixel| visit(pixel, -1, -1));
    (0..region.len()).rev().for_each(|pixel| visit(pixel, 1, 1));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_go_along_the_eight_directions_and_are_infinite_without_a_region() {
        let mut region = vec![false; 7 * 5];
        assert!(distances(&region, 7).iter().all(|way| way.is_infinite()));
        region[2 * 7 + 3] = true;
        let found = distances(&region, 7);
        let diagonal = std::f32::consts::SQRT_2;
        for (pixel, way) in found.iter().enumerate() {
            let (x, y) = ((pixel % 7).abs_diff(3), (pixel / 7).abs_diff(2));
            let (least, most) = (x.min(y) as f32, x.max(y) as f32);
            let expected = diagonal * least + most - least;
            assert!((way - expected).abs() < 1e-5, "{pixel}: {way} {expected}");
        }
    }

    #[test]
    fn holes_are_closed_and_what_lies_far_from_a_region_stays_outside() {
        let (width, height) = (24, 20);
        let within = |pixel: usize| (4..20).contains(&(pixel % width)) && pixel / width >= 6;
        let whole: Vec<bool> = (0..width * height).map(within).collect();
        let mut holed = whole.clone();
        for (x, y) in [(10, 10), (11, 10), (12, 14), (6, 12)] {
            holed[y * width + x] = false;
        }
        assert_eq!(closed(&holed, width, 3.0), whole);
        assert_eq!(closed(&whole, width, 3.0), whole);
    }

    #[test]
    fn what_is_thinner_than_twice_the_reach_is_no_part_of_an_opened_region() {
        let (width, height) = (40, 30);
        let part = |from: [usize; 2], to: [usize; 2]| -> Vec<bool> {
            let within = |pixel: usize| {
                (from[0]..to[0]).contains(&(pixel % width))
                    && (from[1]..to[1]).contains(&(pixel / width))
            };
            (0..width * height).map(within).collect()
        };
        let wide = part([4, 6], [16, 22]);
        let sliver = part([16, 20], [36, 22]);
        let both: Vec<bool> = wide.iter().zip(&sliver).map(|(a, b)| a | b).collect();
        let found = opened(&both, width, 2.0);
        // The sliver is gone, and corners are rounded by three pixels each.
        let differs = (0..width * height).filter(|pixel| found[*pixel] != wide[*pixel]);
        let differs: Vec<usize> = differs.collect();
        assert!(differs.iter().all(|pixel| wide[*pixel]));
        assert_eq!(differs.len(), 4 * 3, "{differs:?}");
        assert_eq!(opened(&sliver, width, 2.0), vec![false; width * height]);
        assert_eq!(opened(&sliver, width, 0.5), sliver);
    }
}
