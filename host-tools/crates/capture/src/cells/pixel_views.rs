//! Pixel views: which samples of a grid over the projection each camera pixel sees, and how much of
//! each: a sparse matrix `A` of shares, a row a pixel.

use crate::registration::cell_map::Registration;
use crate::registration::projector_map::ProjectorMap;
use iltm_runtime::Grid;

/// A camera pixel, and the place that it sees.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PixelView {
    /// Its index in the registered photographs.
    pub pixel: u32,
    /// The middle of what it sees, in samples from the left and upper edge.
    pub place: [f32; 2],
}

/// Which samples of a grid camera pixels see.
#[derive(Clone, PartialEq, Debug)]
pub struct PixelViews {
    /// Columns and rows of samples.
    size: [usize; 2],
    /// Width and height of a camera's pixel in samples.
    side: [f32; 2],
    pixels: Vec<PixelView>,
}

impl PixelViews {
    /// Of all pixels inside the projection whose place is known; a cell has `factor` samples
    /// along its width and height.
    pub(crate) fn new(
        map: &ProjectorMap,
        grid: Grid,
        factor: [usize; 2],
        registration: &Registration,
    ) -> Self {
        let places = map.position.iter().enumerate().filter_map(|(pixel, at)| {
            let [across, down] = map.in_cells(*at, grid);
            let place = [across * factor[0] as f32, down * factor[1] as f32];
            let known = !place[0].is_nan() && !place[1].is_nan();
            (known && registration.is_inside(pixel)).then_some((pixel as u32, place))
        });
        let side = registration.cell_side();
        Self::of_places(
            [grid.cols() * factor[0], grid.rows() * factor[1]],
            // As wide as a pixel is, it sees what it covers.
            factor.map(|factor| (factor as f64 / side) as f32),
            places,
        )
    }

    /// Of pixels of one size at places, both in samples.
    pub(crate) fn of_places(
        size: [usize; 2],
        side: [f32; 2],
        places: impl Iterator<Item = (u32, [f32; 2])>,
    ) -> Self {
        let pixels = places.map(|(pixel, place)| PixelView { pixel, place });
        Self {
            size,
            side,
            pixels: pixels.collect(),
        }
    }

    /// The same pixels over a grid of another size on the same projection.
    #[must_use]
    pub fn over(&self, size: [usize; 2]) -> Self {
        let scale = [0, 1].map(|axis: usize| size[axis] as f32 / self.size[axis] as f32);
        let scaled = |[x, y]: [f32; 2]| [x * scale[0], y * scale[1]];
        let places = self.pixels.iter().map(|v| (v.pixel, scaled(v.place)));
        Self::of_places(size, scaled(self.side), places)
    }

    /// The same and further pixels, before these, at places in samples of the same grid.
    pub(crate) fn after(&self, others: impl Iterator<Item = (u32, [f32; 2])>) -> Self {
        let own = self.pixels.iter().map(|view| (view.pixel, view.place));
        Self::of_places(self.size, self.side, others.chain(own))
    }

    /// Without the pixels that are marked, by their indices.
    pub(crate) fn without(mut self, marked: &[bool]) -> Self {
        self.pixels.retain(|view| !marked[view.pixel as usize]);
        self
    }

    /// Columns and rows of samples.
    #[must_use]
    pub const fn size(&self) -> [usize; 2] {
        self.size
    }

    /// All samples.
    #[must_use]
    pub const fn samples(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Share of a sample that a pixel covers.
    #[must_use]
    pub const fn area(&self) -> f32 {
        self.side[0] * self.side[1]
    }

    /// The pixels.
    #[must_use]
    pub fn pixels(&self) -> &[PixelView] {
        &self.pixels
    }

    /// Samples that a pixel covers and its shares of them, of its own area.
    pub fn seen(&self, view: &PixelView) -> impl Iterator<Item = (usize, f32)> {
        let [across, down] = view.place;
        let ([width, height], [cols, rows]) = (self.side, self.size);
        covered(down, height, rows).flat_map(move |(row, tall)| {
            covered(across, width, cols)
                .map(move |(col, wide)| (row * cols + col, tall * wide / (width * height)))
        })
    }
}

/// Samples along a side of `count` that an interval of `side` around `middle` covers, and how much
/// of each.
fn covered(middle: f32, side: f32, count: usize) -> impl Iterator<Item = (usize, f32)> {
    let (from, to) = (middle - side / 2.0, middle + side / 2.0);
    let last = (to.ceil().max(0.0) as usize).min(count);
    (from.max(0.0) as usize..last).filter_map(move |at| {
        let share = to.min(at as f32 + 1.0) - from.max(at as f32);
        (share > 0.0).then_some((at, share))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_adds_to_each_sample_by_as_much_as_it_covers() {
        let shares = |middle: f32| -> Vec<(usize, f32)> {
            let covered = covered(middle, 0.5, 4);
            covered
                .map(|(at, share)| (at, (100.0 * share).round() / 100.0))
                .collect()
        };
        assert_eq!(shares(1.25), [(1, 0.5)]);
        assert_eq!(shares(2.0), [(1, 0.25), (2, 0.25)]);
        assert_eq!(shares(-0.1), [(0, 0.15)]);
        assert_eq!(shares(4.1), [(3, 0.15)]);
        assert_eq!((shares(-3.0), shares(9.0)), (vec![], vec![]));
    }

    #[test]
    fn over_another_grid_a_pixel_sees_the_same_part_of_the_projection() {
        let views = PixelViews::of_places([4, 2], [0.5, 1.0], [(7, [1.25, 0.5])].into_iter());
        let finer = views.over([8, 4]);
        let seen: Vec<(usize, f32)> = finer.seen(&finer.pixels()[0]).collect();
        assert_eq!(seen, [(2, 0.5), (10, 0.5)]);
        assert_eq!(finer.pixels()[0].pixel, 7);
    }
}
