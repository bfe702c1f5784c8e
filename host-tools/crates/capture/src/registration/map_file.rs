//! Map file: a projector map for other programs, as `.npy` or `.exr`.

use super::projector_map::ProjectorMap;
use iltm_picture::npy;
use image::codecs::openexr::OpenExrEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageResult};
use std::io::Cursor;
use std::path::Path;

/// Kind of a map's file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MapFormat {
    /// `NumPy`, 32-bit floats `height x width x 2`: the map that `OpenCV`'s `remap` takes.
    Npy,
    /// `OpenEXR`, 32-bit floats: x in red, y in green, the uncertainty in blue.
    Exr,
}

impl MapFormat {
    /// The kind that a file's name ends with; `None` if it is neither.
    ///
    /// ```
    /// use iltm_capture::MapFormat;
    /// use std::path::Path;
    /// assert_eq!(MapFormat::of(Path::new("maps/wall.NPY")), Some(MapFormat::Npy));
    /// assert_eq!(MapFormat::of(Path::new("wall.png")), None);
    /// ```
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?;
        let named = |name: &str| ending.eq_ignore_ascii_case(name);
        match () {
            () if named("npy") => Some(Self::Npy),
            () if named("exr") => Some(Self::Exr),
            () => None,
        }
    }
}

impl ProjectorMap {
    /// The bytes of its file.
    ///
    /// # Errors
    /// What the encoder says.
    pub fn file(&self, format: MapFormat) -> ImageResult<Vec<u8>> {
        let (width, height) = self.camera;
        match format {
            MapFormat::Npy => {
                let values: Vec<f32> = self.position.iter().flatten().copied().collect();
                Ok(npy::write(&[height, width, 2], &values))
            }
            MapFormat::Exr => {
                let pixels = self.position.iter().zip(&self.uncertainty);
                let values = pixels.flat_map(|([x, y], uncertainty)| [*x, *y, *uncertainty]);
                exr((width, height), values)
            }
        }
    }
}

/// An `OpenEXR` file of three channels, in 32-bit floats: `values` of each pixel side by side,
/// row by row.
///
/// # Errors
/// What the encoder says, as of another number of values.
pub fn exr(
    (width, height): (usize, usize),
    values: impl Iterator<Item = f32>,
) -> ImageResult<Vec<u8>> {
    let bytes: Vec<u8> = values.flat_map(f32::to_ne_bytes).collect();
    let mut file = Cursor::new(Vec::new());
    let colours = ExtendedColorType::Rgb32F;
    OpenExrEncoder::new(&mut file).write_image(&bytes, width as u32, height as u32, colours)?;
    Ok(file.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::projector_map::MapSource;
    use iltm_runtime::FrameSize;
    use iltm_runtime::placement::ProjectorPixels;
    use image::ImageFormat;

    #[test]
    fn both_files_hold_positions_row_by_row_and_nan_where_nothing_is_known() {
        let map = ProjectorMap {
            source: MapSource::Code,
            projector: ProjectorPixels::whole(FrameSize::new(40, 30).unwrap()),
            camera: (2, 1),
            binning: 1,
            position: vec![[3.5, 7.25], [f32::NAN; 2]],
            uncertainty: vec![0.5, f32::NAN],
        };
        let npy = npy::FloatArray::read(&map.file(MapFormat::Npy).unwrap()).unwrap();
        assert_eq!(npy.shape, [1, 2, 2]);
        assert_eq!(npy.values[..2], [3.5, 7.25]);
        assert!(npy.values[2..].iter().all(|value| value.is_nan()));
        let exr = map.file(MapFormat::Exr).unwrap();
        let picture = image::load_from_memory_with_format(&exr, ImageFormat::OpenExr).unwrap();
        let picture = picture.into_rgb32f();
        assert_eq!(picture.dimensions(), (2, 1));
        assert_eq!(
            picture[(0, 0)].0.map(f32::to_bits),
            [3.5, 7.25, 0.5_f32].map(f32::to_bits)
        );
        assert!(picture[(1, 0)].0.iter().all(|value| value.is_nan()));
    }
}
