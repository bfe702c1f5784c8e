//! Picture error: how far a picture is from the wanted one, pixel by pixel, in numbers that other
//! people use too.

use crate::numbers::percent;
use crate::statistics::quantile;
use crate::{LightPicture, Response};
use palette::color_difference::Ciede2000;
use palette::white_point::D65;
use palette::{FromColor, Lab, LinSrgb};
use serde::{Deserialize, Serialize};

/// How far a picture is from the wanted one. One factor on its brightness is free.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct PictureError {
    /// Root mean square of the difference over pixels and channels, in linear light, of the
    /// wanted light's.
    pub relative: f64,
    /// The same of the mean over 5 x 5 pixels that 99 of 100 are below: what an eye rests on.
    pub worst_places: f64,
    /// Peak signal-to-noise ratio of sRGB values in decibels, white being 1; infinite for the
    /// wanted picture itself.
    pub psnr: f64,
    /// Structural similarity of sRGB values (Wang, Bovik, Sheikh, Simoncelli, *Image quality
    /// assessment*, IEEE Trans. Image Processing 2004), mean over all windows of 11 x 11 pixels;
    /// `None` if no window fits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ssim: Option<f64>,
    /// CIE Delta E 2000, mean over pixels; 1 is just seen.
    pub delta_e: f64,
}

/// Pixels on each side of the middle of the means over 5 x 5.
const AREA_REACH: usize = 2;

/// Share of the means over 5 x 5 pixels below [`PictureError::worst_places`].
const NEARLY_ALL: f64 = 0.99;

/// Pixels on each side of the middle of a window of SSIM, and its standard deviation.
const SSIM_REACH: usize = 5;
const SSIM_DEVIATION: f64 = 1.5;

/// What keeps SSIM from dividing by nothing, for values up to 1.
const SSIM_MEAN: f64 = 0.01 * 0.01;
const SSIM_VARIANCE: f64 = 0.03 * 0.03;

impl PictureError {
    /// Mean of each figure; `None` of none.
    #[must_use]
    pub fn mean(errors: &[Self]) -> Option<Self> {
        let count = errors.len() as f64;
        let of = |figure: fn(&Self) -> f64| errors.iter().map(figure).sum::<f64>() / count;
        let ssims: Option<Vec<f64>> = errors.iter().map(|error| error.ssim).collect();
        (!errors.is_empty()).then(|| Self {
            relative: of(|error| error.relative),
            worst_places: of(|error| error.worst_places),
            psnr: of(|error| error.psnr),
            ssim: ssims.map(|ssims| ssims.iter().sum::<f64>() / count),
            delta_e: of(|error| error.delta_e),
        })
    }

    /// The figures for people.
    #[must_use]
    pub fn words(&self) -> String {
        let similar = self
            .ssim
            .map_or_else(String::new, |ssim| format!(", SSIM {ssim:.3}"));
        format!(
            "99 % of places within {}, PSNR {:.1} dB{similar}, Delta E 2000 {:.2}",
            percent(self.worst_places),
            self.psnr,
            self.delta_e,
        )
    }

    /// Compares linear light, the wanted white being 1, in the pixels `judged`. `None` if there
    /// are none, if the wanted picture is black there or the other one as a whole is no brighter
    /// than black, or if the two are not of one kind.
    #[must_use]
    pub fn new(shown: &LightPicture, wanted: &LightPicture, judged: &[bool]) -> Option<Self> {
        let size = wanted.size();
        let channels = wanted.planes().len();
        let alike = shown.size() == size && shown.planes().len() == channels;
        if !alike || judged.len() != size.pixels() {
            return None;
        }
        let places: Vec<usize> = (0..judged.len()).filter(|at| judged[*at]).collect();
        let product = |a: &LightPicture, b: &LightPicture| -> f64 {
            let planes = a.planes().iter().zip(b.planes());
            let of = |(a, b): (&Vec<f32>, &Vec<f32>)| -> f64 {
                let pixels = places.iter();
                pixels.map(|&at| f64::from(a[at]) * f64::from(b[at])).sum()
            };
            planes.map(of).sum()
        };
        let asked = product(wanted, wanted);
        let scale = product(shown, wanted) / asked;
        // Written so that what is not a number is refused too.
        let usable = asked > 0.0 && scale > 0.0;
        if !usable {
            return None;
        }
        let light = |picture: &LightPicture, at: usize, channel: usize| {
            f64::from(picture.planes()[channel][at])
        };
        let mut squares = vec![0.0; judged.len()];
        for &at in &places {
            let off = |c| light(shown, at, c) / scale - light(wanted, at, c);
            squares[at] = (0..channels).map(|c| off(c).powi(2)).sum();
        }
        let total: f64 = places.iter().map(|at| squares[*at]).sum();
        let area = |at: &usize| mean_around(&squares, judged, size.width(), *at);
        let mut areas: Vec<f64> = places.iter().map(area).collect();
        let worst = quantile(&mut areas, NEARLY_ALL).unwrap_or(0.0);
        let count = places.len() as f64;

        let codes = |picture: &LightPicture, scale: f64| -> Vec<Vec<f64>> {
            let code =
                |light: &f32| Response::Srgb.value((f64::from(*light) / scale).clamp(0.0, 1.0));
            let planes = picture.planes().iter();
            planes
                .map(|plane| plane.iter().map(code).collect())
                .collect()
        };
        let (shown_codes, wanted_codes) = (codes(shown, scale), codes(wanted, 1.0));
        let squared_codes = |(a, b): (&Vec<f64>, &Vec<f64>)| -> f64 {
            places.iter().map(|&at| (a[at] - b[at]).powi(2)).sum()
        };
        let pairs = || shown_codes.iter().zip(&wanted_codes);
        let mean_square = pairs().map(squared_codes).sum::<f64>() / count / channels as f64;
        let windows = windows(judged, size.width());
        let similar = |(a, b): (&Vec<f64>, &Vec<f64>)| similarity(a, b, size.width(), &windows);
        let ssim = pairs().map(similar).sum::<f64>() / windows.len() as f64 / channels as f64;
        let lab = |picture: &LightPicture, at: usize, scale: f64| -> Lab<D65, f64> {
            let light =
                |c: usize| (light(picture, at, c.min(channels - 1)) / scale).clamp(0.0, 1.0);
            Lab::from_color(LinSrgb::new(light(0), light(1), light(2)))
        };
        let difference = |&at: &usize| lab(shown, at, scale).difference(lab(wanted, at, 1.0));
        Some(Self {
            relative: (total / asked).sqrt(),
            worst_places: (worst * count / asked).sqrt(),
            psnr: -10.0 * mean_square.log10(),
            ssim: (!windows.is_empty()).then_some(ssim),
            delta_e: places.iter().map(difference).sum::<f64>() / count,
        })
    }
}

/// Mean over the judged pixels around one.
fn mean_around(values: &[f64], judged: &[bool], width: usize, at: usize) -> f64 {
    let (row, col) = (at / width, at % width);
    let around =
        |at: usize, end: usize| at.saturating_sub(AREA_REACH)..(at + AREA_REACH + 1).min(end);
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for row in around(row, values.len() / width) {
        for at in around(col, width).map(|col| row * width + col) {
            if judged[at] {
                sum += values[at];
                count += 1.0;
            }
        }
    }
    // One pixel alone is not an area.
    sum / count.max((2 * AREA_REACH + 1) as f64)
}

/// Middles of the windows that hold judged pixels only.
fn windows(judged: &[bool], width: usize) -> Vec<usize> {
    let height = judged.len() / width;
    let whole = |at: &usize| {
        let (row, col) = (at / width, at % width);
        let fits = |at: usize, end: usize| at >= SSIM_REACH && at + SSIM_REACH < end;
        fits(row, height)
            && fits(col, width)
            && (row - SSIM_REACH..=row + SSIM_REACH).all(|row| {
                let first = row * width + col - SSIM_REACH;
                judged[first..=first + 2 * SSIM_REACH]
                    .iter()
                    .all(|judged| *judged)
            })
    };
    (0..judged.len()).filter(whole).collect()
}

/// Sum of the SSIM of all windows with these middles.
fn similarity(a: &[f64], b: &[f64], width: usize, windows: &[usize]) -> f64 {
    if windows.is_empty() {
        return 0.0;
    }
    let products = |a: &[f64], b: &[f64]| -> Vec<f64> {
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| a * b).collect()
    };
    let means = |values: &[f64]| weighted(&weighted(values, 1), width);
    let (x, y) = (means(a), means(b));
    let (xx, yy, xy) = (
        means(&products(a, a)),
        means(&products(b, b)),
        means(&products(a, b)),
    );
    let of = |&at: &usize| {
        let (x, y) = (x[at], y[at]);
        let (squares, product) = (x * x + y * y, x * y);
        let (variances, covariance) = (xx[at] + yy[at] - squares, xy[at] - product);
        let means = (2.0 * product + SSIM_MEAN) / (squares + SSIM_MEAN);
        means * (2.0 * covariance + SSIM_VARIANCE) / (variances + SSIM_VARIANCE)
    };
    windows.iter().map(of).sum()
}

/// Mean around each value, of those `stride` apart, by the weights of SSIM's window. Where a window
/// does not fit, it means nothing.
fn weighted(values: &[f64], stride: usize) -> Vec<f64> {
    let weight = |offset: usize| {
        let apart = offset as f64 - SSIM_REACH as f64;
        (-apart * apart / (2.0 * SSIM_DEVIATION * SSIM_DEVIATION)).exp()
    };
    let total: f64 = (0..=2 * SSIM_REACH).map(weight).sum();
    let reach = SSIM_REACH * stride;
    let mut means = vec![0.0; values.len()];
    for offset in 0..=2 * SSIM_REACH {
        let share = weight(offset) / total;
        let whole = values.len() - 2 * reach;
        let terms = &values[offset * stride..][..whole];
        for (mean, term) in means[reach..][..whole].iter_mut().zip(terms) {
            *mean += share * term;
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::FrameSize;

    fn pair(channels: usize) -> [LightPicture; 2] {
        let size = FrameSize::new(32, 24).unwrap();
        let wave = |across: f64, down: f64, turn: f64, channel: usize, at: usize| {
            let (y, x) = ((at / 32) as f64, (at % 32) as f64);
            (across * x + down * y + turn * channel as f64).sin()
        };
        let wanted = |c, at| 0.5 + 0.35 * wave(0.31, 0.17, 1.0, c, at);
        let shown = |c, at| 0.8 * wanted(c, at) * (1.0 + 0.06 * wave(0.9, -0.7, 2.0, c, at));
        [
            LightPicture::from_fn(size, channels, |c, at| shown(c, at) as f32),
            LightPicture::from_fn(size, channels, |c, at| wanted(c, at) as f32),
        ]
    }

    /// What scikit-image 0.26 and `OpenCV` say of the same pictures:
    ///
    /// ```text
    /// import numpy as np, cv2
    /// from skimage.color import deltaE_ciede2000, rgb2lab
    /// from skimage.metrics import structural_similarity, peak_signal_noise_ratio
    /// y, x, c = np.meshgrid(np.arange(24), np.arange(32), np.arange(3), indexing="ij")
    /// w = 0.5 + 0.35*np.sin(0.31*x + 0.17*y + c)
    /// g = 0.8*w*(1 + 0.06*np.sin(0.9*x - 0.7*y + 2*c))
    /// for w, g in (w[..., :1], g[..., :1]), (w, g):
    ///     s = (g*w).sum()/(w*w).sum(); square = ((g - s*w)**2).mean(-1); norm = s*s*(w*w).mean()
    ///     blur = lambda a: cv2.blur(a, (5, 5), borderType=cv2.BORDER_CONSTANT)
    ///     area = blur(square)/blur(np.ones_like(square))
    ///     srgb = lambda l: np.where(l <= .0031308, 12.92*l, 1.055*l**(1/2.4) - .055)
    ///     a, b = srgb(np.clip(w, 0, 1)), srgb(np.clip(g/s, 0, 1)); lab = lambda v: rgb2lab(v*np.ones(3))
    ///     print(np.sqrt(square.mean()/norm), np.sqrt(np.percentile(area, 99, method="higher")/norm),
    ///           peak_signal_noise_ratio(a, b, data_range=1),
    ///           structural_similarity(a, b, channel_axis=-1, data_range=1, gaussian_weights=True,
    ///                                 sigma=1.5, use_sample_covariance=False),
    ///           deltaE_ciede2000(lab(a), lab(b)).mean())
    /// ```
    #[test]
    fn figures_are_those_that_scikit_image_prints() {
        let theirs = [
            (1, [0.042_422, 0.063_860, 37.2785, 0.981_479, 0.83782]),
            (3, [0.042_433, 0.057_671, 37.3300, 0.981_561, 2.32810]),
        ];
        for (channels, theirs) in theirs {
            let [shown, wanted] = pair(channels);
            let all = vec![true; wanted.size().pixels()];
            let ours = PictureError::new(&shown, &wanted, &all).unwrap();
            let ssim = ours.ssim.unwrap();
            let ours = [
                ours.relative,
                ours.worst_places,
                ours.psnr,
                ssim,
                ours.delta_e,
            ];
            for (ours, theirs) in ours.into_iter().zip(theirs) {
                assert!((ours / theirs - 1.0).abs() < 1e-4, "{ours} {theirs}");
            }
        }
    }

    #[test]
    fn only_judged_pixels_count() {
        let [shown, wanted] = pair(1);
        let left: Vec<bool> = (0..32 * 24).map(|at| at % 32 < 16).collect();
        let spoiled = shown.with_planes(|_, plane| {
            let pixels = plane.iter().zip(&left);
            pixels
                .map(|(light, judged)| if *judged { *light } else { 9.0 })
                .collect()
        });
        let error = PictureError::new(&shown, &wanted, &left);
        assert_eq!(error, PictureError::new(&spoiled, &wanted, &left));
        assert!(error.unwrap().ssim.is_some());
        let few: Vec<bool> = (0..32 * 24).map(|at| at < 64).collect();
        assert_eq!(PictureError::new(&shown, &wanted, &few).unwrap().ssim, None);
    }

    #[test]
    fn brightness_is_free_and_darkness_no_picture() {
        let [shown, wanted] = pair(3);
        let all = vec![true; 32 * 24];
        let same = PictureError::new(&wanted.scaled(0.3), &wanted, &all).unwrap();
        assert!(same.relative < 1e-6 && same.delta_e < 1e-3 && same.psnr > 100.0);
        assert!((same.ssim.unwrap() - 1.0).abs() < 1e-9);
        assert_eq!(PictureError::new(&shown.scaled(0.0), &wanted, &all), None);
        assert_eq!(PictureError::new(&shown, &wanted.scaled(0.0), &all), None);
        assert_eq!(
            PictureError::new(&shown, &wanted, &vec![false; 32 * 24]),
            None
        );
    }
}
