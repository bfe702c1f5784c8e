//! Clipping thresholds: the reference white from which each sample of the content is cut,
//! and the brightest at which no more than a stated share is.
//!
//! A sample of wanted light `w d(x)` needs `p = w s - t` with `s = g d - U K A d` and
//! `t = g a - U K a`, so it is cut at the projector's white as soon as
//! `w > (1 + t) / s`. The share of samples whose threshold lies below `w` is the share that
//! is cut: the answer is a quantile, and needs no search.

use super::{CompileError, FineGains};
use iltm_picture::{Lattice, LightPicture};
use iltm_runtime::FrameSize;
use iltm_solve::{Interreflection, InverseTransport};
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// What of the content is cut.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Cut {
    /// Share of the samples that may be cut at the projector's white.
    pub allowed: f64,
    /// Share of the samples that are.
    pub bright: f64,
    /// Share of the samples that are cut at its black: more light arrives from elsewhere than
    /// is wanted.
    pub dark: f64,
    /// Frames looked at.
    pub frames: usize,
}

/// Where content is cut, sample by sample, on the grid of the fine gains or, without
/// any, of the cells.
#[derive(Debug)]
pub struct ClipThresholds {
    size: FrameSize,
    lattice: Lattice,
    channels: Vec<Channel>,
    /// Light that is wanted where frames are black, camera units.
    black: f64,
    /// Of every frame given so far. A negative one says from which white on the sample is cut
    /// at black.
    thresholds: Vec<Vec<f32>>,
}

#[derive(Debug)]
struct Channel {
    gain: Vec<f64>,
    operator: Interreflection,
    /// `t` of every sample.
    offset: Vec<f64>,
    /// `s` of every sample of an even white.
    even: Vec<f64>,
}

/// Threshold of a sample that is cut at black for any reference white.
const DARK: f32 = -f32::MIN_POSITIVE;

/// Threshold of a sample that nothing cuts.
const NEVER: f32 = f32::INFINITY;

impl ClipThresholds {
    /// For frames on `inverse`'s scene, light relative to white, of any size, with black raised to
    /// the light `black`, camera units; `None` if the fine gains are not of its grid.
    ///
    /// # Errors
    /// [`CompileError::GreyContent`].
    pub fn of(
        inverse: &InverseTransport,
        fine: Option<&FineGains>,
        frames: &[LightPicture],
        black: f64,
    ) -> Result<Option<Self>, CompileError> {
        let Some(mut thresholds) = Self::new(inverse, fine, black) else {
            return Ok(None);
        };
        if !frames.iter().all(|frame| thresholds.add(frame)) {
            return Err(CompileError::GreyContent);
        }
        Ok(Some(thresholds))
    }

    fn new(inverse: &InverseTransport, fine: Option<&FineGains>, black: f64) -> Option<Self> {
        let size = fine.map_or(FrameSize::of_grid(inverse.grid), |fine| fine.size);
        let lattice = Lattice::new(inverse.grid, size)?;
        let channel = |index: usize| {
            let own = &inverse.channels[index];
            let gain = fine.map_or_else(|| own.gain.clone(), |fine| fine.channels[index].clone());
            let operator = inverse.channel(index).operator;
            let ambient = DVector::from_column_slice(&own.ambient);
            let driven = DVector::from_column_slice(&own.gain).component_mul(&ambient);
            let offset = lattice.expand((driven - &operator * &ambient).as_slice());
            let received = &operator * &DVector::from_element(ambient.len(), 1.0);
            let received = lattice.expand(received.as_slice()).into_iter();
            let even = gain.iter().zip(received);
            Channel {
                even: even
                    .map(|(gain, received)| gain - f64::from(received))
                    .collect(),
                offset: offset.into_iter().map(f64::from).collect(),
                gain,
                operator,
            }
        };
        Some(Self {
            size,
            channels: (0..inverse.channels.len()).map(channel).collect(),
            lattice,
            black,
            thresholds: Vec::new(),
        })
    }

    /// Size of the maps.
    #[must_use]
    pub const fn size(&self) -> FrameSize {
        self.size
    }

    /// Takes a frame of content into account. A grey table shows each colour as it shows
    /// grey; `false` for a grey frame with a colour table, which cannot be shown.
    fn add(&mut self, frame: &LightPicture) -> bool {
        let colours = frame.planes().len();
        if colours < self.channels.len() {
            return false;
        }
        let planes = frame.planes().iter().enumerate();
        let thresholds = planes.flat_map(|(colour, plane)| {
            let channel = &self.channels[colour.min(self.channels.len() - 1)];
            self.of_plane(channel, &resampled(plane, frame.size(), self.size))
        });
        let thresholds = thresholds.collect();
        self.thresholds.push(thresholds);
        true
    }

    fn of_plane(&self, channel: &Channel, light: &[f32]) -> Vec<f32> {
        let cells = self.lattice.average(light);
        let received = &channel.operator * &DVector::from_column_slice(&cells);
        let received = self.lattice.expand(received.as_slice());
        let samples = channel.gain.iter().zip(&channel.even);
        let samples = samples
            .zip(&channel.offset)
            .zip(light.iter().zip(&received));
        let threshold = |(((gain, even), offset), (light, received)): (((&f64, &f64), &f64), _)| {
            let (light, received): (&f32, &f32) = (light, received);
            // Where no cell was measured, nothing is projected.
            if *gain <= 0.0 {
                return NEVER;
            }
            let slope = gain * f64::from(*light) - f64::from(*received);
            let offset = offset - self.black * (even - slope);
            if slope > 0.0 {
                ((1.0 + offset) / slope) as f32
            } else if *light <= 0.0 && *received <= 0.0 {
                NEVER
            } else {
                ((offset / -slope) as f32).min(DARK)
            }
        };
        samples.map(threshold).collect()
    }

    /// The brightest reference white at which at most `share` of all samples is cut at the
    /// projector's white, camera units, with what that cuts; `None` without content that
    /// could be cut.
    #[must_use]
    pub fn choose(&self, share: f64) -> Option<(f64, Cut)> {
        let mut bright: Vec<f32> = Vec::new();
        let total = self.thresholds.iter().map(Vec::len).sum::<usize>();
        let all = self.thresholds.iter().flatten();
        bright.extend(all.filter(|threshold| threshold.is_finite() && **threshold >= 0.0));
        // As many as may be cut, and the next one is the first that may not.
        let allowed = ((share * total as f64) as usize).min(bright.len().checked_sub(1)?);
        let (_, light, _) = bright.select_nth_unstable_by(allowed, f32::total_cmp);
        let light = f64::from(*light);
        let (bright, dark) = self.cut(light);
        let cut = Cut {
            allowed: share,
            bright,
            dark,
            frames: self.thresholds.len(),
        };
        Some((light, cut))
    }

    /// Share of all frames' samples that are cut at a reference white: at the projector's
    /// white and at its black.
    #[must_use]
    pub fn cut(&self, white: f64) -> (f64, f64) {
        let total = self.thresholds.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let count = |of: fn(f32, f64) -> bool| {
            let all = self.thresholds.iter().flatten();
            all.filter(|threshold| of(**threshold, white)).count() as f64 / total
        };
        (count(is_bright), count(is_dark))
    }

    /// For each place of [`size`](Self::size), the share of frames `from` to `to` in which
    /// any colour of it is cut: at the projector's white, and at its black.
    #[must_use]
    pub fn maps(&self, white: f64, frames: std::ops::Range<usize>) -> [Vec<f64>; 2] {
        let pixels = self.size.pixels();
        let mut maps = [vec![0.0; pixels], vec![0.0; pixels]];
        let chosen = self.thresholds.get(frames).unwrap_or_default();
        let part = 1.0 / chosen.len().max(1) as f64;
        for frame in chosen {
            let [bright, dark] = &mut maps;
            for (at, (bright, dark)) in bright.iter_mut().zip(dark).enumerate() {
                let colours = || frame.iter().skip(at).step_by(pixels);
                if colours().any(|t| is_bright(*t, white)) {
                    *bright += part;
                } else if colours().any(|t| is_dark(*t, white)) {
                    *dark += part;
                }
            }
        }
        maps
    }
}

/// Whether a sample with this threshold is cut at the projector's white.
fn is_bright(threshold: f32, white: f64) -> bool {
    threshold >= 0.0 && f64::from(threshold) < white
}

/// Whether it is cut at its black.
fn is_dark(threshold: f32, white: f64) -> bool {
    threshold < 0.0 && f64::from(-threshold) < white
}

/// Means over the pixels of each place, or the pixel there.
fn resampled(plane: &[f32], from: FrameSize, to: FrameSize) -> Vec<f32> {
    let range = |place: usize, length: usize, places: usize| {
        let start = place * length / places;
        start..((place + 1) * length / places).max(start + 1)
    };
    let columns: Vec<_> = (0..to.width())
        .map(|x| range(x, from.width(), to.width()))
        .collect();
    let rows = (0..to.height()).map(|y| range(y, from.height(), to.height()));
    rows.flat_map(|rows| {
        let columns = columns.iter();
        columns.map(move |columns| {
            let lines = rows.clone().map(|row| &plane[row * from.width()..]);
            let sum: f32 = lines.flat_map(|line| &line[columns.clone()]).sum();
            sum / (rows.len() * columns.len()) as f32
        })
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference_white::uniform_white;
    use crate::test_scene::scene;

    fn grey(inverse: &InverseTransport, light: impl Fn(usize) -> f32) -> LightPicture {
        let size = FrameSize::of_grid(inverse.grid);
        LightPicture::new(size, vec![(0..size.pixels()).map(light).collect()]).unwrap()
    }

    #[test]
    fn for_even_white_with_nothing_cut_it_is_the_uniform_reference_white() {
        let inverse = scene(1);
        let mut thresholds = ClipThresholds::new(&inverse, None, 0.0).unwrap();
        assert!(thresholds.add(&grey(&inverse, |_| 1.0)));
        let (light, cut) = thresholds.choose(0.0).unwrap();
        let uniform = uniform_white(&inverse).unwrap();
        assert!((light / uniform - 1.0).abs() < 1e-6);
        assert!(cut.bright <= 0.0 && cut.dark <= 0.0);
    }

    #[test]
    fn content_of_half_the_light_gets_twice_the_white_but_for_ambient_light() {
        let mut inverse = scene(1);
        inverse.channels[0].ambient.fill(0.0);
        let mut thresholds = ClipThresholds::new(&inverse, None, 0.0).unwrap();
        thresholds.add(&grey(&inverse, |_| 0.5));
        let uniform = uniform_white(&inverse).unwrap();
        let chosen = thresholds.choose(0.0).unwrap().0;
        assert!((chosen / (2.0 * uniform) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn no_more_than_the_share_is_cut_and_a_little_more_white_cuts_more() {
        let inverse = scene(1);
        let mut thresholds = ClipThresholds::new(&inverse, None, 0.0).unwrap();
        for frame in 0..8_usize {
            thresholds.add(&grey(&inverse, |cell| {
                0.3 + 0.7 * ((cell * 7 + frame * 13) % 40) as f32 / 40.0
            }));
        }
        let mut before = 0.0;
        for share in [0.0, 0.01, 0.05, 0.2] {
            let (light, cut) = thresholds.choose(share).unwrap();
            assert!(cut.bright <= share && light >= before, "{cut:?}");
            let (more, _) = thresholds.cut(light * 1.000_01);
            assert!(more > share, "{more} {share}");
            let [map, _] = thresholds.maps(light, 0..8);
            let mean = map.iter().sum::<f64>() / map.len() as f64;
            assert!((mean - cut.bright).abs() < 1e-9);
            before = light;
        }
    }

    #[test]
    fn what_bounces_onto_wanted_black_is_cut_at_any_white() {
        let inverse = scene(1);
        let mut thresholds = ClipThresholds::new(&inverse, None, 0.0).unwrap();
        thresholds.add(&grey(&inverse, |cell| f32::from(cell != 11)));
        let (light, cut) = thresholds.choose(0.0).unwrap();
        assert!((cut.dark - 1.0 / 40.0).abs() < 1e-9, "{cut:?}");
        let [_, dark] = thresholds.maps(light, 0..1);
        assert!(
            dark.iter()
                .enumerate()
                .all(|(cell, cut)| (*cut > 0.5) == (cell == 11))
        );
    }

    /// By the formula itself, for every cell of a picture with black beside white.
    #[test]
    fn where_black_is_raised_less_is_cut_at_black_as_the_light_says() {
        let inverse = scene(1);
        let channel = &inverse.channels[0];
        let operator = inverse.channel(0).operator;
        let frame = grey(&inverse, |cell| if cell % 3 == 0 { 0.0 } else { 0.9 });
        let light = frame.planes()[0].iter().map(|light| f64::from(*light));
        let light: Vec<f64> = light.collect();
        let white = uniform_white(&inverse).unwrap();
        let mut shares = Vec::new();
        for black in [0.0, 0.1 * white, 0.8 * white] {
            let mut thresholds = ClipThresholds::new(&inverse, None, black).unwrap();
            assert!(thresholds.add(&frame));
            for white in [0.7 * white, white, 1.5 * white] {
                let wanted = light.iter().zip(&channel.ambient);
                let wanted = wanted.map(|(d, ambient)| black + (white - black) * d - ambient);
                let wanted = DVector::from_iterator(light.len(), wanted);
                let own = DVector::from_column_slice(&channel.gain).component_mul(&wanted);
                let drive = own - &operator * &wanted;
                let count = |of: &dyn Fn(f64) -> bool| {
                    drive.iter().filter(|drive| of(**drive)).count() as f64 / light.len() as f64
                };
                let (bright, dark) = thresholds.cut(white);
                assert!((bright - count(&|drive| drive > 1.0)).abs() < 1e-9);
                assert!(
                    (dark - count(&|drive| drive < 0.0)).abs() < 1e-9,
                    "{black} {white}"
                );
            }
            shares.push(thresholds.cut(white).1);
        }
        assert!(shares[0] > 0.3 && shares[2] < shares[0], "{shares:?}");
    }
}
