//! Linearisation: one photograph file, decoded, in linear light and averaged over squares
//! of pixels.

use crate::format::error::CaptureError;
use crate::format::picture_file::{FileFormat, Opened, Samples, Source};
use crate::format::settings::Reading;
use iltm_picture::DeviceResponse;
use std::path::{Path, PathBuf};

/// Pixels a photograph is kept at. A larger one is averaged over squares of
/// pixels: a cell needs tens of pixels, a sensor of 24 megapixels has thousands
/// a cell, and memory would grow with them.
const WORKING_PIXELS: u64 = 4 << 20;

/// Value, of full scale, from which a sample counts as saturated: sensors bend
/// and clip a little below the last code.
const SATURATED_VALUE: f64 = 0.98;

/// A photograph in linear light, 0 to 1 of the camera's full scale, saturated
/// samples as [`Photo::SATURATED`].
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Photo {
    /// One plane a channel, each row by row, length `width * height`.
    pub(crate) planes: Vec<Vec<f32>>,
}

impl Photo {
    /// What a sample near full scale reads as. A squared-up pixel has it as soon
    /// as one of its samples does.
    pub(crate) const SATURATED: f32 = 1.0;

    /// Turns the planes into those of the projector's channels by the `inverse` of the
    /// colour mixing. A pixel that is `saturated` in one channel is in all: its light is
    /// not known.
    pub(crate) fn unmix(&mut self, inverse: &[[f32; 3]; 3], saturated: f32) {
        let [red, green, blue] = self.planes.as_mut_slice() else {
            return;
        };
        for ((red, green), blue) in red.iter_mut().zip(green).zip(blue) {
            let seen = [*red, *green, *blue];
            let unmixed = if seen.iter().any(|light| *light >= saturated) {
                [saturated; 3]
            } else {
                inverse.map(|row| row.iter().zip(seen).map(|(m, light)| m * light).sum())
            };
            [*red, *green, *blue] = unmixed;
        }
    }
}

/// What all photographs of a capture share, taken from the first of them.
#[derive(Clone, Debug)]
pub(crate) struct PhotoFormat {
    /// File the format was taken from.
    first: PathBuf,
    /// Width and height in the files.
    file_size: (u32, u32),
    /// Colour channels, 1 or 3.
    pub(crate) channels: usize,
    /// Side of the square of pixels in the file that make one.
    pub(crate) binning: usize,
    /// Width after binning.
    pub(crate) width: usize,
    /// Height after binning.
    pub(crate) height: usize,
    /// What the file is.
    pub(crate) file: FileFormat,
    /// Bits of a sample, 32 for floating point.
    pub(crate) bits: u8,
    /// Bytes of memory that decoding a file takes.
    memory: usize,
    /// How values become light.
    pub(crate) reading: Reading,
    /// Light of each 8-bit value.
    eight: [f32; 256],
    /// Light of each 16-bit value.
    sixteen: Vec<f32>,
}

impl PhotoFormat {
    /// Reads the format of the first photograph.
    ///
    /// # Errors
    /// As [`Opened::open`].
    pub(crate) fn of_first(source: Source<'_>, reading: &Reading) -> Result<Self, CaptureError> {
        let opened = Opened::open(source)?;
        let (width, height) = opened.size();
        let pixels = u64::from(width) * u64::from(height);
        let binning = (pixels as f64 / WORKING_PIXELS as f64)
            .sqrt()
            .ceil()
            .max(1.0) as usize;
        Ok(Self {
            first: source.path.to_owned(),
            file_size: (width, height),
            channels: opened.channels(),
            binning,
            width: (width as usize / binning).max(1),
            height: (height as usize / binning).max(1),
            file: opened.format(),
            bits: opened.bits(),
            memory: opened.memory() as usize,
            eight: std::array::from_fn(|value| light_of(&reading.response, value as f64 / 255.0)),
            sixteen: (0..=u16::MAX)
                .map(|value| light_of(&reading.response, f64::from(value) / 65_535.0))
                .collect(),
            reading: reading.clone(),
        })
    }

    /// Pixels after binning.
    pub(crate) fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Bytes of one photograph while it is being decoded.
    pub(crate) fn decoding_bytes(&self) -> usize {
        self.memory + self.bytes()
    }

    /// Bytes of one decoded photograph.
    pub(crate) fn bytes(&self) -> usize {
        self.pixels() * self.channels * size_of::<f32>()
    }

    /// Reads a photograph of this format.
    ///
    /// # Errors
    /// [`CaptureError::Unlike`] before any pixel is decoded; otherwise what [`Opened`]
    /// returns.
    pub(crate) fn read(&self, source: Source<'_>) -> Result<Photo, CaptureError> {
        let opened = Opened::open(source)?;
        self.check_kind(source.path, opened.size(), opened.channels())?;
        let file = opened.format();
        Ok(match opened.decode()? {
            Samples::Eight(samples) => self.linear(&samples, |v| self.eight[usize::from(v)]),
            Samples::Sixteen(samples) => self.linear(&samples, |v| self.sixteen[usize::from(v)]),
            Samples::Float(samples) => self.linear(&samples, |value| self.float(file, value)),
        })
    }

    /// Refuses a photograph of another size or colour than the first one.
    fn check_kind(
        &self,
        path: &Path,
        size: (u32, u32),
        channels: usize,
    ) -> Result<(), CaptureError> {
        let (width, height) = self.file_size;
        let first = self.first.display();
        let (reason, next_step) = if size != self.file_size {
            (
                format!(
                    "{} x {} pixels, but {first} has {width} x {height}",
                    size.0, size.1
                ),
                "Take all photographs with one camera setting, without cropping.",
            )
        } else if channels != self.channels {
            (
                format!(
                    "{channels} colour channels, but {first} has {}",
                    self.channels
                ),
                "Export all photographs grey, or all in colour.",
            )
        } else {
            return Ok(());
        };
        Err(CaptureError::Unlike {
            path: path.to_owned(),
            reason,
            next_step,
        })
    }

    /// Refuses photographs of another size or colour than these.
    ///
    /// # Errors
    /// [`CaptureError::Unlike`].
    pub(crate) fn check_like(&self, other: &Self) -> Result<(), CaptureError> {
        self.check_kind(&other.first, other.file_size, other.channels)
    }

    /// Light of a floating point value. What noise and a subtracted dark frame
    /// made negative stays so: its mean is right.
    fn float(&self, file: FileFormat, value: f32) -> f32 {
        let value = f64::from(value) / self.reading.full_scale;
        if value < SATURATED_VALUE && (file == FileFormat::OpenExr || value < 0.0) {
            value as f32
        } else {
            light_of(&self.reading.response, value)
        }
    }

    /// Looks up the light of every sample and averages squares of pixels.
    fn linear<T: Copy>(&self, samples: &[T], light: impl Fn(T) -> f32) -> Photo {
        Photo {
            planes: if self.channels == 1 {
                self.averaged::<T, 1>(samples, light).into()
            } else {
                self.averaged::<T, 3>(samples, light).into()
            },
        }
    }

    /// One plane of each of `C` channels. Rows and columns that do not fill a square are
    /// cut off, unless there would be nothing left.
    fn averaged<T: Copy, const C: usize>(
        &self,
        samples: &[T],
        light: impl Fn(T) -> f32,
    ) -> [Vec<f32>; C] {
        let (width, height) = (self.file_size.0 as usize, self.file_size.1 as usize);
        let (across, down) = (self.binning.min(width), self.binning.min(height));
        let share = 1.0 / (across * down) as f32;
        let mut planes = [(); C].map(|()| Vec::with_capacity(self.pixels()));
        for rows in samples.chunks(width * C * down).take(self.height) {
            let rows: Vec<&[T]> = rows.chunks_exact(width * C).collect();
            for at in (0..self.width).map(|col| col * across * C) {
                let mut sums = [0.0; C];
                for row in &rows {
                    for pixel in row[at..][..across * C].chunks_exact(C) {
                        for (sum, value) in sums.iter_mut().zip(pixel) {
                            *sum += light(*value);
                        }
                    }
                }
                for (plane, sum) in planes.iter_mut().zip(sums) {
                    let known = sum < SATURATED_SAMPLE;
                    plane.push(if known { share * sum } else { Photo::SATURATED });
                }
            }
        }
        planes
    }
}

/// What a saturated sample adds to the sum of a square of pixels, so that the sum tells.
const SATURATED_SAMPLE: f32 = f32::INFINITY;

/// Light of a value of full scale.
fn light_of(response: &DeviceResponse, value: f64) -> f32 {
    let light = response.light(value) as f32;
    if value >= SATURATED_VALUE || light >= Photo::SATURATED {
        SATURATED_SAMPLE
    } else {
        light
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::picture_tests::source;
    use iltm_picture::Response;
    use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb, RgbImage};

    fn read(picture: impl Into<DynamicImage>, response: Response) -> Result<Photo, CaptureError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.png");
        picture.into().save(&path).unwrap();
        PhotoFormat::of_first(source(&path), &response.into())?.read(source(&path))
    }

    #[test]
    fn eight_and_sixteen_bits_are_the_same_light() {
        let eight = read(GrayImage::from_pixel(1, 1, Luma([51])), Response::Linear).unwrap();
        let wide: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_pixel(1, 1, Luma([13107]));
        assert_eq!(eight, read(wide, Response::Linear).unwrap());
        assert!((eight.planes[0][0] - 0.2).abs() < 1e-7);
    }

    #[test]
    fn colours_become_planes_and_a_response_is_undone() {
        let photo = read(
            RgbImage::from_pixel(2, 1, Rgb([255, 128, 0])),
            Response::Srgb,
        )
        .unwrap();
        assert_eq!(photo.planes[0], [Photo::SATURATED; 2]);
        assert!((photo.planes[1][1] - 0.215_861).abs() < 1e-6);
        assert_eq!(photo.planes[2], [0.0; 2]);
    }

    #[test]
    fn a_photograph_of_another_size_or_colour_is_refused_before_decoding() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b, c) = (
            folder.path().join("a"),
            folder.path().join("b"),
            folder.path().join("c"),
        );
        let png = image::ImageFormat::Png;
        GrayImage::new(4, 3).save_with_format(&a, png).unwrap();
        GrayImage::new(3, 4).save_with_format(&b, png).unwrap();
        RgbImage::new(4, 3).save_with_format(&c, png).unwrap();
        let format = PhotoFormat::of_first(source(&a), &Response::Linear.into()).unwrap();
        let error = format.read(source(&b)).unwrap_err().to_string();
        assert!(
            error.contains("3 x 4 pixels, but") && error.contains("has 4 x 3"),
            "{error}"
        );
        let error = format.read(source(&c)).unwrap_err().to_string();
        assert!(
            error.contains("3 colour channels, but") && error.contains("has 1"),
            "{error}"
        );
    }

    #[test]
    fn a_large_photograph_is_averaged_in_linear_light_and_stays_saturated() {
        // 4096 x 2048 is twice the working size: squares of 2 x 2.
        let value = |x, y| match (x, y) {
            (0, 0) => 255,
            (2 | 3, 0) => 128,
            _ => 0,
        };
        let picture = GrayImage::from_fn(4096, 2048, |x, y| Luma([value(x, y)]));
        let photo = read(picture, Response::Srgb).unwrap();
        assert_eq!(photo.planes[0].len(), 2048 * 1024);
        assert!(photo.planes[0][0] >= Photo::SATURATED);
        assert!((photo.planes[0][1] - 0.215_861 / 2.0).abs() < 1e-6);
    }

    #[test]
    fn floats_of_openexr_are_light_and_those_of_other_files_follow_the_response() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.png");
        GrayImage::new(1, 1).save(&path).unwrap();
        let format = PhotoFormat::of_first(source(&path), &Response::Srgb.into()).unwrap();
        let tiff = FileFormat::Tiff;
        let near = |found: f32, wanted: f32| (found - wanted).abs() < 1e-6;
        assert!(near(format.float(FileFormat::OpenExr, 0.5), 0.5));
        assert!(near(format.float(tiff, 0.5), 0.214_041));
        assert!(near(format.float(tiff, -0.25), -0.25));
        // Full scale is saturated in both, and so is what a gamma darkens to less than white.
        let saturated = [
            format.float(FileFormat::OpenExr, 1.0),
            format.float(tiff, 0.985),
        ];
        assert!(saturated.iter().all(|light| light.is_infinite()));
    }
}
