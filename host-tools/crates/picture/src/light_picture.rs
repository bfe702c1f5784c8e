//! Linear light of a picture: it adds up, which codes do not.

use crate::{Picture, ProjectorResponse, Response, Samples, statistics::quantile};
use iltm_runtime::FrameSize;

/// Linear light (or linear projector input) of one or three channels.
#[derive(Clone, PartialEq, Debug)]
pub struct LightPicture {
    size: FrameSize,
    planes: Vec<Vec<f32>>,
}

impl LightPicture {
    /// A picture of these planes, each row by row; `None` unless there are one or
    /// three and all have a value for each pixel.
    #[must_use]
    pub fn new(size: FrameSize, planes: Vec<Vec<f32>>) -> Option<Self> {
        let fits = planes.iter().all(|plane| plane.len() == size.pixels());
        (fits && matches!(planes.len(), 1 | 3)).then_some(Self { size, planes })
    }

    /// The light that codes stand for under `response`, 0 to 1.
    #[must_use]
    pub fn decode(picture: &Picture, response: impl Into<ProjectorResponse>) -> Self {
        let channels = picture.channels();
        let response = response.into();
        let plane = |channel: usize| -> Vec<f32> {
            let light = |value: f64| response.channel(channel).light(value) as f32;
            let own = (channel..picture.samples().len()).step_by(channels);
            match picture.samples() {
                Samples::Eight(codes) => {
                    let by_code: Vec<f32> = (0..=u8::MAX)
                        .map(|code| light(f64::from(code) / f64::from(u8::MAX)))
                        .collect();
                    own.map(|at| by_code[usize::from(codes[at])]).collect()
                }
                Samples::Sixteen(codes) => own
                    .map(|at| light(f64::from(codes[at]) / f64::from(u16::MAX)))
                    .collect(),
            }
        };
        Self {
            size: picture.size(),
            planes: (0..channels).map(plane).collect(),
        }
    }

    /// 8-bit sRGB codes for a screen. Light outside 0 to 1 is cut.
    #[must_use]
    pub fn for_display(&self) -> Picture {
        let code = |light: f32| {
            let value = Response::Srgb.value(f64::from(light));
            (value * f64::from(u8::MAX)).round() as u8
        };
        Picture::of_codes(self.size, self.planes.len(), |pixel, channel| {
            code(self.planes[channel][pixel])
        })
    }

    /// A picture of 1 or 3 channels, the light of each from its channel and its pixel, row
    /// by row.
    ///
    /// # Panics
    /// If it has another number of channels.
    #[must_use]
    pub fn from_fn(size: FrameSize, channels: usize, light: impl Fn(usize, usize) -> f32) -> Self {
        assert!(matches!(channels, 1 | 3), "{channels} channels");
        let plane = |channel| (0..size.pixels()).map(|at| light(channel, at)).collect();
        Self {
            size,
            planes: (0..channels).map(plane).collect(),
        }
    }

    /// The picture with other planes, each made from its channel's number and its light.
    ///
    /// # Panics
    /// If a plane is made of another length.
    #[must_use]
    pub fn with_planes(&self, plane: impl Fn(usize, &[f32]) -> Vec<f32>) -> Self {
        let planes = self.planes.iter().enumerate();
        let planes: Vec<_> = planes.map(|(at, light)| plane(at, light)).collect();
        let fits = planes.iter().all(|plane| plane.len() == self.size.pixels());
        assert!(fits, "a plane has a value for each pixel");
        Self {
            size: self.size,
            planes,
        }
    }

    /// All light times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        self.with_planes(|_, plane| plane.iter().map(|light| light * factor as f32).collect())
    }

    /// What is shown where black is raised to `black` and white stays: `black + (1 - black) light`.
    #[must_use]
    pub fn raised(&self, black: f64) -> Self {
        let raised = |light: &f32| (black + (1.0 - black) * f64::from(*light)) as f32;
        self.with_planes(|_, plane| plane.iter().map(raised).collect())
    }

    /// The light that this share (0 to 1) of all pixels and channels stays below.
    #[must_use]
    pub fn quantile(&self, share: f64) -> f64 {
        let mut values: Vec<f32> = self.planes.iter().flatten().copied().collect();
        quantile(&mut values, share).map_or(0.0, f64::from)
    }

    /// The mean of every 2 x 2 pixels; an odd last row or column is left out. A
    /// picture of a single row or column stays as it is.
    #[must_use]
    pub fn halved(&self) -> Self {
        let (width, height) = (self.size.width() / 2, self.size.height() / 2);
        let Some(size) = FrameSize::new(width as u16, height as u16) else {
            return self.clone();
        };
        let row = self.size.width();
        let plane = |plane: &Vec<f32>| {
            let mean = |at: usize| {
                let first = at / width * 2 * row + at % width * 2;
                let [top, bottom] = [first, first + row].map(|at| plane[at] + plane[at + 1]);
                (top + bottom) / 4.0
            };
            (0..size.pixels()).map(mean).collect()
        };
        Self {
            size,
            planes: self.planes.iter().map(plane).collect(),
        }
    }

    /// Its size.
    #[must_use]
    pub const fn size(&self) -> FrameSize {
        self.size
    }

    /// One plane a channel, row by row.
    #[must_use]
    pub fn planes(&self) -> &[Vec<f32>] {
        &self.planes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_survives_the_way_to_light_and_back() {
        let size = FrameSize::new(256, 1).unwrap();
        let codes: Vec<u8> = (0..=u8::MAX)
            .flat_map(|code| [code, 255 - code, code / 2])
            .collect();
        let given = Picture::new(size, Samples::Eight(codes)).unwrap();
        let light = LightPicture::decode(&given, Response::Srgb);
        assert_eq!(light.planes().len(), 3);
        assert_eq!(light.for_display(), given);
    }

    #[test]
    fn halving_keeps_the_mean_and_leaves_out_odd_ends() {
        let size = FrameSize::new(5, 2).unwrap();
        let plane = vec![0.0, 0.4, 0.1, 0.1, 9.0, 0.2, 0.2, 0.1, 0.1, 9.0];
        let halved = LightPicture::new(size, vec![plane]).unwrap().halved();
        assert_eq!(halved.size(), FrameSize::new(2, 1).unwrap());
        assert!((halved.planes()[0][0] - 0.2).abs() < 1e-6);
        assert!((halved.planes()[0][1] - 0.1).abs() < 1e-6);
    }

    #[test]
    fn two_planes_are_no_picture() {
        let size = FrameSize::new(2, 1).unwrap();
        assert_eq!(LightPicture::new(size, vec![vec![0.0; 2]; 2]), None);
        assert_eq!(LightPicture::new(size, vec![vec![0.0; 3]]), None);
    }
}
