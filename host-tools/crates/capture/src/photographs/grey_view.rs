//! Grey view: a photograph made small and grey, to see what it shows before it has a place
//! in a capture.

use crate::format::error::CaptureError;
use crate::format::picture_file::{Opened, Samples, Source};
use iltm_picture::LightPicture;
use iltm_runtime::FrameSize;
use std::path::Path;

/// The mean of a photograph's channels, as the file has them, at most `side` pixels long and
/// wide. Integers are 0 to 1; floating point numbers stay as they are.
///
/// # Errors
/// [`CaptureError`] if the file cannot be read or is no picture.
pub fn grey_view(path: &Path, side: usize) -> Result<LightPicture, CaptureError> {
    let source = Source {
        path,
        what: "photograph",
        line: 0,
    };
    let opened = Opened::open(source)?;
    let ((width, height), channels) = (opened.size(), opened.channels());
    let camera = (width as usize, height as usize);
    let step = camera.0.max(camera.1).div_ceil(side.max(1)).max(1);
    let step = step.min(camera.0).min(camera.1);
    let grey = match opened.decode()? {
        Samples::Eight(values) => means(&values, channels, camera, step, |value| {
            f32::from(value) / 255.0
        }),
        Samples::Sixteen(values) => {
            let light = |value| f32::from(value) / 65_535.0;
            means(&values, channels, camera, step, light)
        }
        Samples::Float(values) => means(&values, channels, camera, step, |value| value),
    };
    let size = FrameSize::new((camera.0 / step) as u16, (camera.1 / step) as u16);
    let view = size.and_then(|size| LightPicture::new(size, vec![grey]));
    view.ok_or_else(|| CaptureError::Picture {
        path: path.to_owned(),
        reason: format!("it has {width} x {height} pixels, which is no photograph"),
        next_step: "Take it away, or export the photograph again.",
    })
}

/// Means of all channels over squares of `step` pixels, row by row; no more than a row of
/// squares is held beside the values.
fn means<T: Copy>(
    values: &[T],
    channels: usize,
    (width, height): (usize, usize),
    step: usize,
    light: impl Fn(T) -> f32,
) -> Vec<f32> {
    let mean = |pixel: &[T]| {
        let sum = pixel.iter().map(|value| light(*value)).sum::<f32>();
        sum / channels as f32
    };
    let rows = values.chunks_exact(channels * width * step);
    let squares = rows.take(height / step).flat_map(|row| {
        let row: Vec<f32> = row.chunks_exact(channels).map(mean).collect();
        shrunk(&row, (width, step), step)
    });
    squares.collect()
}

/// The means of squares of `step` pixels of a plane; what is left at the end is left out.
pub(crate) fn shrunk(plane: &[f32], (width, height): (usize, usize), step: usize) -> Vec<f32> {
    let (across, down) = (width / step, height / step);
    let mean = |at: usize| {
        let first = at / across * step * width + at % across * step;
        let rows = (0..step).map(|row| &plane[first + row * width..][..step]);
        rows.flatten().sum::<f32>() / (step * step) as f32
    };
    (0..across * down).map(mean).collect()
}
