//! Layout of the cells on the projector's pixels.

use super::PatternsError;
use iltm_picture::{LightPicture, MAX_PIXELS, Picture, Response, Samples};
use iltm_runtime::{FrameSize, Grid, resample::area::AreaAverage};

/// Pixels of the camera along a cell's side below which smaller cells gain next to nothing
/// (docs/accuracy.md).
const CAMERA_PIXELS: f64 = 7.0;
/// Pixels of the projector along the side of the smallest cells that were measured.
const PROJECTOR_PIXELS: f64 = 4.0;
/// Part of a side of the camera's picture that the projection fills, if it shows little else.
const FILLED: f64 = 0.75;
/// Most cells of a proposed grid: a solve takes less than a minute, and a table 2 MB.
const MOST_CELLS: u16 = 3072;

/// How pictures of one pixel a cell become pictures of the projector's size: by the
/// rule by which the runtime averages a frame over the cells, so that a cell is lit
/// where compensated video will be looked at. Cells need not be of one size.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    grid: Grid,
    projector: FrameSize,
    border: u16,
    cells: AreaAverage,
    inner: FrameSize,
}

impl Layout {
    /// `grid` over all of `projector` but `border` pixels on every side.
    ///
    /// # Errors
    /// [`PatternsError::Projector`] if that is more than any projector has,
    /// [`PatternsError::Cells`] if a cell would have no pixel.
    pub fn new(grid: Grid, projector: FrameSize, border: u16) -> Result<Self, PatternsError> {
        if projector.pixels() > MAX_PIXELS {
            return Err(PatternsError::Projector { projector });
        }
        let left = |side: usize| {
            u16::try_from(side)
                .ok()?
                .checked_sub(border.checked_mul(2)?)
        };
        let size = left(projector.width()).zip(left(projector.height()));
        let inner = size.and_then(|(width, height)| FrameSize::new(width, height));
        inner
            .and_then(|inner| Some((AreaAverage::new(grid, inner)?, inner)))
            .map(|(cells, inner)| Self {
                grid,
                projector,
                border,
                cells,
                inner,
            })
            .ok_or(PatternsError::Cells {
                grid,
                projector,
                border,
            })
    }

    /// Square cells over all of `projector` but `border` pixels on every side, as small as
    /// is of use to a camera with pictures of the size `camera`, and no more than are solved
    /// within a minute.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn proposed(
        projector: FrameSize,
        border: u16,
        camera: FrameSize,
    ) -> Result<Self, PatternsError> {
        let whole = Self::new(Grid::new(1, 1)?, projector, border)?;
        let (width, height) = (whole.inner.width() as f64, whole.inner.height() as f64);
        let (across, upwards) = (camera.width() as f64, camera.height() as f64);
        let camera_pixels = FILLED * f64::min(across / width, upwards / height);
        let side = (CAMERA_PIXELS / camera_pixels)
            .max(PROJECTOR_PIXELS)
            .max((width * height / f64::from(MOST_CELLS)).sqrt())
            // A picture that is no higher than a cell has one row all the same.
            .max(width.max(height) / f64::from(MOST_CELLS));
        let cells = |pixels: f64| (pixels / side).floor().max(1.0) as u16;
        Self::new(Grid::new(cells(height), cells(width))?, projector, border)
    }

    /// The cells.
    #[must_use]
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// The projector's size.
    #[must_use]
    pub const fn projector(&self) -> FrameSize {
        self.projector
    }

    /// Pixels left black on every side.
    #[must_use]
    pub const fn border(&self) -> u16 {
        self.border
    }

    /// Pixels of all cells together: what a border leaves of the projector's.
    #[must_use]
    pub const fn inner(&self) -> FrameSize {
        self.inner
    }

    /// Cells of as many pixels as these on another projector; `None` if there is no whole number of
    /// them.
    #[must_use]
    pub fn grid_of(&self, other: FrameSize) -> Option<Grid> {
        let (own, grid) = (self.projector, self.grid);
        let is_whole = own.width().is_multiple_of(grid.cols()) && self.border == 0;
        let cells = |own: usize, cells: usize, other: usize| {
            let whole = (other * cells).is_multiple_of(own);
            whole.then_some(other * cells / own)?.try_into().ok()
        };
        let rows = cells(own.height(), grid.rows(), other.height())?;
        let cols = cells(own.width(), grid.cols(), other.width())?;
        Grid::new(rows, cols).ok().filter(|_| is_whole)
    }

    /// The cells nearest to these, in size, of which every one of the projectors has a whole number: rows
    /// and columns of this one.
    #[must_use]
    pub fn nearest_common(&self, projectors: &[FrameSize]) -> [usize; 2] {
        let side = |of: fn(FrameSize) -> usize, cells: usize| {
            let own = of(self.projector);
            let divides = |pixels: usize| {
                let mut others = projectors.iter().map(|other| of(*other));
                own.is_multiple_of(pixels) && others.all(|other| other.is_multiple_of(pixels))
            };
            let counts = (1..=own).filter(|pixels| divides(*pixels));
            let counts = counts.map(|pixels| own / pixels);
            let far = |count: &usize| (*count as f64 / cells as f64).ln().abs();
            let nearest = counts.min_by(|a, b| far(a).total_cmp(&far(b)));
            nearest.unwrap_or(cells)
        };
        let grid = self.grid;
        [
            side(FrameSize::height, grid.rows()),
            side(FrameSize::width, grid.cols()),
        ]
    }

    /// A picture of [`inner`](Self::inner) with its black border, of the projector's size;
    /// `None` if it has another size or depth.
    #[must_use]
    pub fn framed(&self, picture: &Picture) -> Option<Picture> {
        let Samples::Eight(samples) = picture.samples() else {
            return None;
        };
        if picture.size() != self.inner {
            return None;
        }
        let channels = picture.channels();
        let (width, border) = (self.projector.width(), usize::from(self.border));
        let mut slide = vec![0; self.projector.pixels() * channels];
        let lines = samples.chunks_exact(self.inner.width() * channels);
        for (y, line) in lines.enumerate() {
            let start = ((y + border) * width + border) * channels;
            slide
                .get_mut(start..start + line.len())?
                .copy_from_slice(line);
        }
        Picture::new(self.projector, Samples::Eight(slide))
    }

    /// What a border leaves of a picture of the projector's size; `None` if it has another
    /// size or depth.
    #[must_use]
    pub fn unframed(&self, picture: &Picture) -> Option<Picture> {
        let slide =
            matches!(picture.samples(), Samples::Eight(_)) && picture.size() == self.projector;
        slide.then(|| picture.without_border(self.border)).flatten()
    }

    /// Mean light of every cell in a picture of the projector's size, `N` entries for each of
    /// its channels; `None` if it has another size or depth.
    #[must_use]
    pub fn cell_light(&self, picture: &Picture, response: Response) -> Option<Vec<Vec<f64>>> {
        let inner = LightPicture::decode(&self.unframed(picture)?, response);
        let plane = |plane: &Vec<f32>| {
            let mut sums = vec![(0.0, 0_u32); self.grid.cells()];
            for (at, light) in plane.iter().enumerate() {
                let (x, y) = (at % self.inner.width(), at / self.inner.width());
                let (sum, count) = sums.get_mut(self.cells.owner(x, y)?)?;
                *sum += f64::from(*light);
                *count += 1;
            }
            let means = sums.into_iter();
            Some(
                means
                    .map(|(sum, count)| sum / f64::from(count.max(1)))
                    .collect(),
            )
        };
        inner.planes().iter().map(plane).collect()
    }

    /// The projector's picture of a picture of one pixel a cell, or of one of
    /// [`inner`](Self::inner), 8 bits, grey or RGB.
    ///
    /// # Errors
    /// [`PatternsError::NotCells`] if that is of another size or depth.
    pub fn slide(&self, cells: &Picture) -> Result<Picture, PatternsError> {
        let slide = self.enlarged(cells).or_else(|| self.framed(cells));
        slide.ok_or_else(|| PatternsError::NotCells {
            found: cells.size(),
            grid: self.grid,
        })
    }

    fn enlarged(&self, cells: &Picture) -> Option<Picture> {
        let Samples::Eight(samples) = cells.samples() else {
            return None;
        };
        if cells.size() != FrameSize::of_grid(self.grid) {
            return None;
        }
        let channels = cells.channels();
        let mut slide = vec![0; self.projector.pixels() * channels];
        let border = usize::from(self.border);
        let rows = slide
            .chunks_exact_mut(self.projector.width() * channels)
            .skip(border);
        for (y, row) in rows.take(self.inner.height()).enumerate() {
            let pixels = row.chunks_exact_mut(channels).skip(border);
            for (x, pixel) in pixels.take(self.inner.width()).enumerate() {
                let cell = self.cells.owner(x, y)?;
                pixel.copy_from_slice(samples.get(cell * channels..(cell + 1) * channels)?);
            }
        }
        Picture::new(self.projector, Samples::Eight(slide))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::units::Light;
    use proptest::prelude::*;

    #[test]
    fn cells_of_another_projector_have_as_many_pixels() {
        let size = |width, height| FrameSize::new(width, height).unwrap();
        let grid = |rows, cols| Grid::new(rows, cols).unwrap();
        let full = size(1920, 1080);
        let layout = |rows, cols| Layout::new(grid(rows, cols), full, 0).unwrap();
        for (own, other, expected) in [
            ((54, 96), size(1280, 800), Some(grid(40, 64))),
            ((90, 120), size(1024, 768), Some(grid(64, 64))),
            // Cells may have parts of pixels down, where the frames are as high.
            ((64, 96), size(960, 1080), Some(grid(64, 48))),
            ((54, 96), size(1024, 768), None),
            ((54, 100), size(1280, 800), None),
        ] {
            assert_eq!(layout(own.0, own.1).grid_of(other), expected, "{own:?}");
        }
        for (other, expected) in [(size(1280, 800), [54, 96]), (size(1024, 768), [45, 120])] {
            let nearest = layout(50, 100).nearest_common(&[full, other]);
            assert_eq!(nearest, expected);
            let [rows, cols] = nearest.map(|side| side as u16);
            assert!(layout(rows, cols).grid_of(other).is_some());
        }
        let border = Layout::new(grid(54, 96), full, 4).unwrap();
        assert_eq!(border.grid_of(full), None);
    }

    fn eight(picture: &Picture) -> &[u8] {
        match picture.samples() {
            Samples::Eight(samples) => samples,
            Samples::Sixteen(_) => panic!("8 bits"),
        }
    }

    fn grey(grid: Grid, samples: Vec<u8>) -> Picture {
        Picture::new(FrameSize::of_grid(grid), Samples::Eight(samples)).unwrap()
    }

    #[test]
    fn a_border_is_black_and_cells_are_as_even_as_the_pixels_allow() {
        let grid = Grid::new(1, 3).unwrap();
        let layout = Layout::new(grid, FrameSize::new(9, 4).unwrap(), 1).unwrap();
        let slide = layout.slide(&grey(grid, vec![10, 20, 30])).unwrap();
        // Borders at 7/3 and 14/3: pixels 0, 1 | 2, 3, 4 | 5, 6 by their centres.
        let row = [0, 10, 10, 20, 20, 20, 30, 30, 0];
        let expected = [[0; 9], row, row, [0; 9]].concat();
        assert_eq!(eight(&slide), expected);
    }

    #[test]
    fn colours_stay_together() {
        let grid = Grid::new(1, 2).unwrap();
        let layout = Layout::new(grid, FrameSize::new(4, 1).unwrap(), 0).unwrap();
        let slide = layout.slide(&grey(grid, vec![1, 2, 3, 4, 5, 6])).unwrap();
        assert_eq!(eight(&slide), [1, 2, 3, 1, 2, 3, 4, 5, 6, 4, 5, 6]);
    }

    #[test]
    fn more_cells_than_pixels_are_refused_with_both_numbers() {
        let grid = Grid::new(4, 10).unwrap();
        let error = Layout::new(grid, FrameSize::new(12, 12).unwrap(), 2).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("4 x 10 cells"), "{text}");
        assert!(text.contains("8 x 8 pixels"), "{text}");
        let huge = FrameSize::new(65_535, 65_535).unwrap();
        let error = Layout::new(grid, huge, 0).unwrap_err();
        assert!(matches!(error, PatternsError::Projector { .. }), "{error}");
        assert!(Layout::new(grid, FrameSize::new(30, 30).unwrap(), u16::MAX).is_err());
    }

    /// Rows and columns that are proposed for a projector, its border and a camera.
    fn proposed(projector: (u16, u16), border: u16, camera: (u16, u16)) -> (usize, usize) {
        let size = |(width, height)| FrameSize::new(width, height).unwrap();
        let layout = Layout::proposed(size(projector), border, size(camera)).unwrap();
        (layout.grid().rows(), layout.grid().cols())
    }

    #[test]
    fn proposed_cells_are_as_small_as_a_camera_has_use_for() {
        // A camera of 384 x 264 pixels sees 52 x 84 cells no better than 26 x 42.
        assert_eq!(proposed((1344, 832), 0, (384, 264)), (25, 41));
        // The same cells, whatever the projector's pixels are, and the camera upright or not.
        assert_eq!(proposed((2688, 1664), 0, (384, 264)), (25, 41));
        assert_eq!(proposed((832, 1344), 0, (264, 384)), (41, 25));
        // The height of a wide camera's picture is what the projection fills.
        assert_eq!(proposed((1344, 832), 0, (4000, 264)), (28, 45));
        // A phone has use for more cells than are solved within a minute.
        assert_eq!(proposed((1920, 1080), 0, (4032, 3024)), (41, 73));
        assert_eq!(proposed((1280, 800), 0, (4032, 3024)), (43, 70));
        // Cells lie within the border.
        assert_eq!(proposed((1344, 832), 256, (384, 264)), (15, 41));
        // Never less than a cell, nor smaller ones than were measured.
        assert_eq!(proposed((1920, 1080), 0, (5, 5)), (1, 1));
        assert_eq!(proposed((64, 40), 0, (4032, 3024)), (10, 16));
        assert_eq!(proposed((3, 9), 0, (4032, 3024)), (2, 1));
    }

    proptest! {
        #[test]
        fn a_grid_is_proposed_for_all_sizes(
            projector in (1_u16.., 1_u16..=8192), camera in (1_u16.., 1_u16..), border in 0_u16..40,
        ) {
            let size = |(width, height)| FrameSize::new(width, height).unwrap();
            let proposed = Layout::proposed(size(projector), border, size(camera));
            let one = Layout::new(Grid::new(1, 1).unwrap(), size(projector), border);
            prop_assert_eq!(proposed.is_ok(), one.is_ok());
            let cells = proposed.map_or(1, |layout| layout.grid().cells());
            prop_assert!(cells <= usize::from(MOST_CELLS));
        }

        /// Against the runtime's own averages: no cell has more of a pixel than the
        /// one whose colour it gets.
        #[test]
        fn a_pixel_shows_the_cell_that_has_most_of_it(
            rows in 1_u16..6, cols in 1_u16..6, more in (0_u16..14, 0_u16..14),
        ) {
            let grid = Grid::new(rows, cols).unwrap();
            let size = FrameSize::new(cols + more.0, rows + more.1).unwrap();
            let area = AreaAverage::new(grid, size).unwrap();
            let layout = Layout::new(grid, size, 0).unwrap();
            let numbered = grey(grid, (0..grid.cells()).map(|cell| cell as u8).collect());
            let slide = layout.slide(&numbered).unwrap();
            for y in 0..size.height() {
                for x in 0..size.width() {
                    let mut light = vec![Light::ZERO; size.width()];
                    light[x] = Light::ONE;
                    let mut sums = vec![0; grid.cells()];
                    area.add_row(y, &light, &mut sums);
                    let shown = usize::from(eight(&slide)[y * size.width() + x]);
                    prop_assert_eq!(sums[shown], *sums.iter().max().unwrap());
                }
            }
        }
    }
}
