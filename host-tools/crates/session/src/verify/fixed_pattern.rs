//! Fixed-pattern error: what all images have too much or too little of at the same pixels.
//!
//! A wrong gain, a wall painted since and a projector that was nudged spoil every image alike. Noise,
//! blocks of JPEG files, a camera that shakes, is out of focus or knows its places less well spoil each
//! image in another way. With `m` missing and `w` wanted light of images `i` and `j` at a pixel, products
//! of two images keep the former alone: the square of the error is `sum m_i m_j / sum w_i w_j`, over
//! pixels, channels and pairs of images.
//!
//! A picture that lies `e` projector pixels from where it lay when the table was made meets the gains
//! `g(x + e)` and was made with `g(x)`: of wanted light it lacks the part `1 - g(x) / g(x + e)`.

use super::pixels::{counted_light, cut_at_pixels, wanted_light};
use super::readings::FineShown;
use super::refine::OwnGains;
use iltm_capture::PixelReadings;
use iltm_compile::{FineGains, Provenance};
use iltm_runtime::image::Table;
use rayon::prelude::*;

/// Farthest that a picture is looked for on each side, projector pixels.
const FARTHEST: i16 = 8;

/// Pixels that are looked at for that.
const LOOKED_AT: usize = 10_000;

/// Part of the error's square that a shift must explain to be named: creases keep errors of their own.
const EXPLAINED: f64 = 0.2;

/// Part of the error's square that each square of a pixel's shift must explain more of: where nothing
/// tells a direction, the shorter shift is taken.
const OF_LENGTH: f64 = 0.001;

/// Error that all images share.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FixedPattern {
    /// Relative error, root mean square; 0 where images share none.
    pub error: f64,
    /// How far right and down the picture lies of where it lay when the table was made, projector
    /// pixels, if that explains a fifth of the error's square or more.
    pub shift: Option<[f64; 2]>,
}

/// Sums over pairs of images at a pixel: of `m_i m_j`, `m_i w_j + m_j w_i` and `w_i w_j`.
#[derive(Clone, Copy, Default)]
pub(super) struct Pairs([f64; 3]);

impl Pairs {
    /// Of each image's missing and wanted light.
    pub(super) fn new(images: impl Iterator<Item = [f64; 2]>) -> Self {
        let (mut sums, mut squares) = ([0.0; 2], [0.0; 3]);
        for [missing, wanted] in images {
            sums[0] += missing;
            sums[1] += wanted;
            squares[0] += missing * missing;
            squares[1] += missing * wanted;
            squares[2] += wanted * wanted;
        }
        let [missing, wanted] = sums;
        Self([
            (missing * missing - squares[0]) / 2.0,
            missing * wanted - squares[1],
            (wanted * wanted - squares[2]) / 2.0,
        ])
    }

    /// Sum of `m_i m_j`.
    pub(super) const fn missing(self) -> f64 {
        self.0[0]
    }

    /// Sum of `w_i w_j`.
    pub(super) const fn wanted(self) -> f64 {
        self.0[2]
    }

    /// The first sum, had each image shown `part` of its wanted light more.
    fn after(self, part: f64) -> f64 {
        let [missing, mixed, wanted] = self.0;
        missing - part * mixed + part * part * wanted
    }
}

impl FixedPattern {
    /// Of photographs whose reference white has `white` camera units; `None` with a single image.
    pub(super) fn new(
        table: &Table<'_>,
        pixels: &PixelReadings,
        (fine, white): (&[FineShown], &[f64]),
    ) -> Option<Self> {
        if fine.len() < 2 {
            return None;
        }
        let step = pixels.views.pixels().len().div_ceil(LOOKED_AT).max(1);
        let channels: Vec<([f64; 2], Vec<Pairs>)> = (0..usize::from(table.channels()))
            .into_par_iter()
            .map(|channel| {
                let pairs = pairs(table, pixels, (fine, white), channel);
                let sums = pairs.iter().fold([0.0; 2], |[missing, wanted], pairs| {
                    [missing + pairs.missing(), wanted + pairs.wanted()]
                });
                (sums, pairs.into_iter().step_by(step).collect())
            })
            .collect();
        let sum = |part: usize| channels.iter().map(|(sums, _)| sums[part]).sum::<f64>();
        let (error, wanted) = (sum(0), sum(1));
        let looked_at = channels.into_iter().map(|(_, pairs)| pairs).collect();
        let sites = Sites::new(table, pixels, step, looked_at);
        (wanted > 0.0).then(|| Self {
            error: (error / wanted).max(0.0).sqrt(),
            // Projectors that overlap move each by itself.
            shift: (!Provenance::read(table.provenance()).overlapping)
                .then(|| sites.shift())
                .flatten(),
        })
    }
}

/// Those of every pixel in a channel; none where the projector's range cut an image.
fn pairs(
    table: &Table<'_>,
    pixels: &PixelReadings,
    (fine, white): (&[FineShown], &[f64]),
    channel: usize,
) -> Vec<Pairs> {
    let of_image = |(at, shown): (usize, &FineShown)| -> Vec<[f64; 2]> {
        let wanted = wanted_light(pixels, shown, channel);
        let seen = counted_light(table, pixels, (2 * at + 1, channel));
        let cut = cut_at_pixels(pixels, shown, channel);
        let light = cut.into_iter().zip(wanted.iter().zip(&seen));
        light
            .map(|(cut, (wanted, seen))| {
                if cut {
                    return [0.0; 2];
                }
                let wanted = f64::from(*wanted);
                [wanted - f64::from(*seen) / white[at], wanted]
            })
            .collect()
    };
    let images: Vec<Vec<[f64; 2]>> = fine.iter().enumerate().map(of_image).collect();
    (0..pixels.views.pixels().len())
        .map(|pixel| Pairs::new(images.iter().map(|image| image[pixel])))
        .collect()
}

/// Some of the pixels, each with its place among the table's gains.
struct Sites {
    gains: FineGains,
    /// Gain samples in a pixel of the projector.
    scale: [f64; 2],
    places: Vec<[f64; 2]>,
    /// By channel and site.
    pairs: Vec<Vec<Pairs>>,
}

impl Sites {
    fn new(table: &Table<'_>, pixels: &PixelReadings, step: usize, pairs: Vec<Vec<Pairs>>) -> Self {
        let gains = OwnGains::new(table, pixels.factor).fine;
        let (size, own) = (gains.size, pixels.views.size());
        let views = pixels.views.over([size.width(), size.height()]);
        let places = views.pixels().iter().step_by(step);
        Self {
            scale: [
                size.width() as f64 / own[0] as f64,
                size.height() as f64 / own[1] as f64,
            ],
            places: places.map(|view| view.place.map(f64::from)).collect(),
            gains,
            pairs,
        }
    }

    /// The shift that explains most, if it explains enough.
    fn shift(&self) -> Option<[f64; 2]> {
        let still = self.left([0.0; 2]);
        let own: Vec<[f64; 2]> = (-FARTHEST..=FARTHEST)
            .flat_map(|down| (-FARTHEST..=FARTHEST).map(move |right| [right, down].map(f64::from)))
            .collect();
        let mut best = self.least(&own)?;
        let mut step = 0.5;
        while step > 0.05 {
            let around: Vec<[f64; 2]> = (0..9)
                .map(|at| {
                    let [right, down] = [at % 3, at / 3].map(|k| step * (f64::from(k) - 1.0));
                    [best[0] + right, best[1] + down]
                })
                .collect();
            best = self.least(&around)?;
            step /= 2.0;
        }
        // At the end of what was looked at, the picture lies still farther off, or elsewhere.
        let within = best.iter().all(|e| e.abs() < f64::from(FARTHEST));
        let explains = self.left(best) < (1.0 - EXPLAINED) * still;
        (within && still > 0.0 && explains).then_some(best)
    }

    fn least(&self, shifts: &[[f64; 2]]) -> Option<[f64; 2]> {
        let still = self.left([0.0; 2]);
        let cost = |shift: [f64; 2]| {
            self.left(shift) + OF_LENGTH * still * (shift[0].powi(2) + shift[1].powi(2))
        };
        let left = shifts.par_iter().map(|shift| (*shift, cost(*shift)));
        let best = left.min_by(|a, b| a.1.total_cmp(&b.1));
        best.map(|(shift, _)| shift)
    }

    /// What a shift leaves of the error's square.
    fn left(&self, shift: [f64; 2]) -> f64 {
        let moved = [0, 1].map(|axis| shift[axis] * self.scale[axis]);
        let of_channel = |(plane, pairs): (&Vec<f64>, &Vec<Pairs>)| -> f64 {
            let sites = self.places.iter().zip(pairs);
            let of_site = |(place, pairs): (&[f64; 2], &Pairs)| {
                let there = [place[0] + moved[0], place[1] + moved[1]];
                let [own, met] = [*place, there].map(|place| self.gain(plane, place));
                // Where no gain is known, nothing is explained.
                pairs.after(if own > 0.0 && met > 0.0 {
                    1.0 - own / met
                } else {
                    0.0
                })
            };
            sites.map(of_site).sum()
        };
        let channels = self.gains.channels.iter().zip(&self.pairs);
        channels.map(of_channel).sum()
    }

    /// A gain between samples; 0 if one of them has none.
    fn gain(&self, plane: &[f64], place: [f64; 2]) -> f64 {
        let size = self.gains.size;
        let along = |at: f64, count: usize| {
            let at = (at - 0.5).clamp(0.0, (count - 1) as f64);
            let before = at as usize;
            (before, (before + 1).min(count - 1), at.fract())
        };
        let (left, right, x) = along(place[0], size.width());
        let (top, bottom, y) = along(place[1], size.height());
        let at = |row: usize, col: usize| plane[row * size.width() + col];
        let corners = [
            (at(top, left), (1.0 - y) * (1.0 - x)),
            (at(top, right), (1.0 - y) * x),
            (at(bottom, left), y * (1.0 - x)),
            (at(bottom, right), y * x),
        ];
        if corners
            .iter()
            .any(|(gain, share)| *gain <= 0.0 && *share > 0.0)
        {
            return 0.0;
        }
        corners.iter().map(|(gain, share)| gain * share).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::FrameSize;

    #[test]
    fn pairs_of_images_keep_what_images_share() {
        let pairs = Pairs::new([[0.1, 0.5], [0.2, 1.0], [0.0, 0.25]].into_iter());
        let close = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-12, "{found}");
        close(pairs.0[0], 0.1 * 0.2);
        close(pairs.0[1], 0.1 * 1.25 + 0.2 * 0.75);
        close(pairs.0[2], 0.5 + 0.125 + 0.25);
        // A fifth of the light is missing in the first two.
        let after = |part: f64| {
            let left = [0.1 - part * 0.5, 0.2 - part, -part * 0.25];
            left[0] * left[1] + left[0] * left[2] + left[1] * left[2]
        };
        for part in [0.0, 0.1, 0.2, -0.3] {
            close(pairs.after(part), after(part));
        }
    }

    /// Sites on a wall with these gains, of pictures that lie elsewhere by a shift.
    fn sites(gain: impl Fn(f64, f64) -> f64, shift: [f64; 2], noise: f64) -> Sites {
        let size = FrameSize::new(96, 64).unwrap();
        // Two pixels of the projector a sample, a camera pixel each.
        let places: Vec<[f64; 2]> = (0..192 * 128)
            .map(|at| [at % 192, at / 192].map(|place| 0.5 * f64::from(place) + 0.25))
            .collect();
        let sample = |at: usize| [at % 96, at / 96].map(|place| place as f64 + 0.5);
        let own = (0..size.pixels()).map(|at| {
            let [x, y] = sample(at);
            gain(x, y)
        });
        let mut random = fastrand::Rng::with_seed(7);
        let pairs = places.iter().map(|[x, y]| {
            let met = gain(x + shift[0] / 2.0, y + shift[1] / 2.0);
            let part = 1.0 - gain(*x, *y) / met;
            Pairs::new([0.3, 0.5, 0.4, 0.6].into_iter().map(|wanted| {
                let off = noise * (random.f64() - 0.5);
                [wanted * part + off, wanted]
            }))
        });
        Sites {
            gains: FineGains {
                size,
                channels: vec![own.collect()],
            },
            scale: [0.5; 2],
            pairs: vec![pairs.collect()],
            places,
        }
    }

    /// A mural: waves of many lengths and directions.
    fn mural(x: f64, y: f64) -> f64 {
        let wave = |across: f64, down: f64| (x / across + y / down).sin();
        (0.2 * (wave(3.0, 9.0) + wave(7.0, -4.0) + wave(-20.0, 5.0))).exp()
    }

    #[test]
    fn a_shifted_picture_is_found_to_a_fifth_of_a_pixel_and_noise_is_none() {
        for shift in [[0.4, -0.2], [1.0, 2.5], [-6.0, 3.0]] {
            let found = sites(mural, shift, 0.02).shift().unwrap();
            let off = [0, 1].map(|axis| (found[axis] - shift[axis]).abs());
            assert!(off.iter().all(|off| *off < 0.2), "{shift:?} {found:?}");
        }
        assert_eq!(sites(mural, [0.0; 2], 0.05).shift(), None);
        // A wall of one colour has no detail that could lie elsewhere.
        assert_eq!(sites(|_, _| 1.0, [2.0, 0.0], 0.05).shift(), None);
    }

    #[test]
    fn where_nothing_tells_a_direction_the_shorter_shift_is_taken() {
        let stripes = |x: f64, _: f64| mural(x, 0.0);
        let found = sites(stripes, [1.5, 4.0], 0.02).shift().unwrap();
        assert!(
            (found[0] - 1.5).abs() < 0.2 && found[1].abs() < 0.5,
            "{found:?}"
        );
    }

    #[test]
    fn paint_that_faded_is_no_shift() {
        let mut sites = sites(mural, [0.0; 2], 0.02);
        for (place, pairs) in sites.places.iter().zip(&mut sites.pairs[0]) {
            let part = 0.2 * mural(place[0], place[1]).ln();
            *pairs = Pairs::new([0.3, 0.5, 0.4].into_iter().map(|w| [w * part, w]));
        }
        assert_eq!(sites.shift(), None);
    }
}
