//! Projected pattern: which cells are lit.

use super::code::{Code, lit_by_role};
use super::error::CaptureError;
use super::picture_file::{EXPORT, FileFormat, Opened, Samples, Source};
use super::role::Role;
use iltm_runtime::Grid;

/// A pattern, one entry a cell (`row * cols + col`), `true` where lit.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Pattern {
    /// Rows of cells.
    pub rows: usize,
    /// Columns of cells.
    pub cols: usize,
    /// Whether each cell is lit, length `rows * cols`.
    pub lit: Vec<bool>,
}

impl Pattern {
    /// The pattern that `role` stands for on a grid whose Gray codes have
    /// `column_bits` and `row_bits` bits; `None` for a Bernoulli pattern, which
    /// only its file knows, and for a bit beyond the code.
    ///
    /// ```
    /// use iltm_capture::{Pattern, Role};
    /// let grid = iltm_runtime::Grid::new(1, 4)?;
    /// let stripes = Pattern::of_role(grid, Role::Column { bit: 1, inverse: false }, 2, 0);
    /// assert_eq!(stripes.map(|p| p.lit), Some(vec![false, true, true, false]));
    /// # Ok::<(), iltm_runtime::GridError>(())
    /// ```
    #[must_use]
    pub fn of_role(grid: Grid, role: Role, column_bits: u8, row_bits: u8) -> Option<Self> {
        let codes = [column_bits, row_bits].map(|bits| Code { bits, offset: 0 });
        Self::of_codes((grid.rows(), grid.cols()), role, codes)
    }

    /// The same on any number of rows and columns, whose Gray codes are `codes`, that of
    /// the columns first.
    #[must_use]
    pub fn of_codes((rows, cols): (usize, usize), role: Role, codes: [Code; 2]) -> Option<Self> {
        let lit = (0..rows * cols).map(|cell| lit_by_role(role, codes, cell / cols, cell % cols));
        let lit = lit.collect::<Option<_>>()?;
        Some(Self { rows, cols, lit })
    }

    /// Reads a pattern: a PNG of one pixel a cell with 8 bits or fewer, grey or
    /// with equal colours, every value 0 or 255, of at most `most` cells.
    ///
    /// # Errors
    /// [`CaptureError::Picture`] with the first cell that is neither, or
    /// what [`Opened`] returns.
    pub(crate) fn read(source: Source<'_>, most: u64) -> Result<Self, CaptureError> {
        let picture = Opened::open(source)?;
        let refuse = |reason, next_step| CaptureError::Picture {
            path: source.path.to_owned(),
            reason,
            next_step,
        };
        // What `iltm patterns` writes and scripts beside this tool read.
        if picture.format() != FileFormat::Png {
            let reason = format!("a pattern is a PNG, this is {}", picture.format());
            return Err(refuse(reason, EXPORT));
        }
        let (width, height) = picture.size();
        let channels = picture.channels();
        // More cells than any grid: refused before its pixels are decoded.
        if u64::from(width) * u64::from(height) > most {
            return Err(CaptureError::TooLarge {
                path: source.path.to_owned(),
                width,
                height,
                limit: most,
            });
        }
        let refuse = |at: usize, value: String| {
            let (row, col) = (at as u32 / width, at as u32 % width);
            refuse(
                format!("row {row}, column {col} is {value}; a pattern holds only 0 and 255"),
                "Use the pattern file as `iltm patterns` wrote it: one pixel a cell, not scaled.",
            )
        };
        let samples = match picture.decode()? {
            Samples::Eight(samples) => samples,
            Samples::Sixteen(samples) => {
                let first = samples.first().copied().unwrap_or(0);
                return Err(refuse(0, format!("{first} of 65535 (16 bit)")));
            }
            Samples::Float(_) => return Err(refuse(0, "floating point".to_owned())),
        };
        let mut lit = Vec::with_capacity(samples.len() / channels);
        for (at, pixel) in samples.chunks_exact(channels).enumerate() {
            match pixel {
                [0] | [0, 0, 0] => lit.push(false),
                [255] | [255, 255, 255] => lit.push(true),
                [grey] => return Err(refuse(at, grey.to_string())),
                _ => return Err(refuse(at, format!("{pixel:?}"))),
            }
        }
        Ok(Self {
            rows: height as usize,
            cols: width as usize,
            lit,
        })
    }

    /// The same at some rows and columns only.
    pub(crate) fn sampled(&self, rows: &[usize], cols: &[usize]) -> Self {
        let at = |&row: &usize| cols.iter().map(move |&col| row * self.cols + col);
        Self {
            rows: rows.len(),
            cols: cols.len(),
            lit: rows.iter().flat_map(at).map(|at| self.lit[at]).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::picture_tests::source;
    use image::{DynamicImage, GrayImage, ImageBuffer, Luma, RgbImage};

    fn read(picture: impl Into<DynamicImage>) -> Result<Pattern, CaptureError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.png");
        picture.into().save(&path).unwrap();
        Pattern::read(source(&path), Grid::MAX_CELLS as u64)
    }

    #[test]
    fn neighbouring_columns_differ_in_one_bit_of_the_gray_code() {
        let grid = Grid::new(1, 21).unwrap();
        let bits = 5;
        let code = |col: usize| -> Vec<bool> {
            let stripes = (0..bits).map(|bit| Role::Column {
                bit,
                inverse: false,
            });
            stripes
                .map(|role| Pattern::of_role(grid, role, bits, 0).unwrap().lit[col])
                .collect()
        };
        for col in 1..21 {
            let changes = code(col)
                .iter()
                .zip(code(col - 1))
                .filter(|(a, b)| *a != b)
                .count();
            assert_eq!(changes, 1, "between columns {} and {col}", col - 1);
        }
    }

    #[test]
    fn an_inverse_lights_what_the_pattern_leaves_dark() {
        let grid = Grid::new(5, 6).unwrap();
        for role in [
            Role::Column {
                bit: 1,
                inverse: false,
            },
            Role::Row {
                bit: 2,
                inverse: true,
            },
        ] {
            let one = Pattern::of_role(grid, role, 3, 3).unwrap();
            let other = Pattern::of_role(grid, role.complement().unwrap(), 3, 3).unwrap();
            assert!(one.lit.iter().zip(&other.lit).all(|(a, b)| a != b));
        }
    }

    #[test]
    fn a_value_between_dark_and_lit_is_named_with_its_cell() {
        let grey = |x, y| {
            if (x, y) == (3, 1) {
                Luma([254])
            } else {
                Luma([255])
            }
        };
        let error = read(GrayImage::from_fn(5, 2, grey)).unwrap_err();
        assert!(
            error.to_string().contains("row 1, column 3 is 254"),
            "{error}"
        );
        let error = read(RgbImage::from_pixel(1, 1, image::Rgb([255, 0, 255]))).unwrap_err();
        assert!(error.to_string().contains("[255, 0, 255]"), "{error}");
        let wide: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_pixel(1, 1, Luma([u16::MAX]));
        let error = read(wide).unwrap_err();
        assert!(error.to_string().contains("16 bit"), "{error}");
    }

    #[test]
    fn grey_and_equal_colours_are_the_same_pattern() {
        let lit = |x: u32, y: u32| 255 * ((x + y) % 2) as u8;
        let grey = read(GrayImage::from_fn(4, 3, |x, y| Luma([lit(x, y)]))).unwrap();
        let colour = read(RgbImage::from_fn(4, 3, |x, y| image::Rgb([lit(x, y); 3]))).unwrap();
        assert_eq!(grey, colour);
        assert_eq!((grey.rows, grey.cols, grey.lit[1]), (3, 4, true));
    }

    #[test]
    fn a_photograph_in_place_of_a_pattern_is_refused_by_its_size() {
        let error = read(GrayImage::new(640, 480)).unwrap_err();
        assert!(
            matches!(error, CaptureError::TooLarge { limit: 32_768, .. }),
            "{error}"
        );
    }
}
