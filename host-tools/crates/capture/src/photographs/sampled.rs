//! Sampled squares: some camera pixels of every photograph, enough to see which pattern a
//! photograph shows and whether the picture moved, without decoding all again.

use super::Photographs;
use crate::format::error::CaptureError;
use iltm_picture::progress::Progress;

/// Pixels along a square's side.
pub(crate) const SIDE: usize = 16;

/// Squares at most.
const MOST_SQUARES: usize = 256;

/// Bytes that the samples may take.
const MOST_BYTES: usize = 128 << 20;

/// Squares of pixels, evenly over the whole photograph, in every photograph.
pub(crate) struct Sampled {
    /// Pixels of all squares, square after square, each row by row.
    pub(crate) pixels: Vec<u32>,
    /// Sum over the channels of those pixels, by shot.
    pub(crate) shots: Vec<Vec<f32>>,
}

impl Sampled {
    /// Chooses the squares and takes them from all photographs.
    ///
    /// # Errors
    /// A photograph's own error.
    pub(crate) fn take(
        photographs: &mut Photographs<'_>,
        shots: usize,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        let (width, height) = (photographs.format.width, photographs.format.height);
        // What becomes of them are the channels' light and its sum, by shot.
        let values = (photographs.format.channels + 1) * shots.max(1);
        let fits = MOST_BYTES / (SIDE * SIDE * size_of::<f32>() * values);
        let pixels = squares(width, height, fits.clamp(16, MOST_SQUARES));
        let mut taken = Vec::with_capacity(shots);
        progress.begin("comparing photographs and patterns", shots as u64);
        let all: Vec<usize> = (0..shots).collect();
        photographs.for_batches(&all, progress, |photos| {
            for (_, photo) in photos {
                let light = |&pixel: &u32| -> f32 {
                    photo.planes.iter().map(|plane| plane[pixel as usize]).sum()
                };
                taken.push(pixels.iter().map(light).collect());
            }
        })?;
        progress.end();
        Ok(Self {
            pixels,
            shots: taken,
        })
    }

    /// Mean of some photographs.
    pub(crate) fn mean(&self, shots: &[usize]) -> Vec<f32> {
        let share = 1.0 / shots.len().max(1) as f32;
        let at = |k: usize| share * shots.iter().map(|&s| self.shots[s][k]).sum::<f32>();
        (0..self.pixels.len()).map(at).collect()
    }
}

/// Pixels of at most `most` squares that lie evenly over a photograph.
fn squares(width: usize, height: usize, most: usize) -> Vec<u32> {
    let (across, down) = (width / SIDE, height / SIDE);
    let all: Vec<(usize, usize)> = (0..down)
        .flat_map(|row| (0..across).map(move |col| (row, col)))
        .collect();
    let step = (all.len() as f64 / most as f64).max(1.0);
    let chosen = (0..all.len().min(most)).map(|k| all[(k as f64 * step) as usize]);
    chosen
        .flat_map(|(row, col)| {
            (0..SIDE * SIDE).map(move |k| {
                let (y, x) = (row * SIDE + k / SIDE, col * SIDE + k % SIDE);
                (y * width + x) as u32
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_whole_and_lie_evenly_over_the_photograph() {
        let (width, height) = (5 * SIDE + 3, 4 * SIDE + 7);
        for most in [100, 5] {
            let pixels = squares(width, height, most);
            assert_eq!(pixels.len(), most.min(20) * SIDE * SIDE);
            let mut rows = Vec::new();
            for square in pixels.chunks(SIDE * SIDE) {
                let (left, top) = (square[0] as usize % width, square[0] as usize / width);
                assert!(left + SIDE <= width && top + SIDE <= height);
                rows.push(top / SIDE);
                for (at, pixel) in square.iter().enumerate() {
                    let wanted = (top + at / SIDE) * width + left + at % SIDE;
                    assert_eq!(*pixel as usize, wanted);
                }
            }
            rows.dedup();
            assert_eq!(rows, [0, 1, 2, 3]);
        }
    }

    #[test]
    fn the_mean_of_photographs_is_taken_pixel_by_pixel() {
        let sampled = Sampled {
            pixels: vec![7, 9],
            shots: vec![vec![1.0, 2.0], vec![9.0, 9.0], vec![3.0, 6.0]],
        };
        assert_eq!(sampled.mean(&[0, 2]), [2.0, 4.0]);
        assert_eq!(sampled.mean(&[]), [0.0, 0.0]);
    }
}
