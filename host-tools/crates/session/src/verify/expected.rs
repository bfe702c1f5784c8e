//! Expected light: what a table expects of any projector input, cell by cell.
//!
//! The pipeline read backwards, as `report/predict.rs` reads it at full resolution: it
//! makes `p = g d' - K d'` of the wanted light `d' = d - a`, so the light that an input
//! `p` makes is the `l` with `l = (p + K l) / g`, which iterating it converges to.

use iltm_capture::CellPlanes;
use iltm_compile::Provenance;
use iltm_runtime::{
    image::Table,
    pipeline::stages::correct,
    units::{CORRECTION_GUARD_BITS, Correction, Light},
};
use iltm_video::OperatorMemory;

/// Bounces after which the rest is below rounding for any scene that reflects less than
/// 97 % of what it receives.
const MOST_BOUNCES: usize = 400;

/// A cell's light that changes less than this between two bounces, relative to the
/// brightest cell's, has settled: less than what the runtime rounds to.
const SETTLED: f64 = 2e-5;

/// The same for light that does not grow: rounding may keep it from settling.
const FADING: f64 = 1e-3;

/// The scene as a table has it.
#[derive(Debug)]
pub struct Expected<'t, 'a> {
    table: &'t Table<'a>,
    memory: OperatorMemory,
    /// `g`, drive per reference light, one entry a channel; 0 where a cell took no part.
    gain: CellPlanes,
    /// `a`, relative to reference white.
    ambient: CellPlanes,
    /// Whether cells of several projectors light one place.
    overlapping: bool,
}

impl<'t, 'a> Expected<'t, 'a> {
    /// The scene of `table`.
    #[must_use]
    pub fn new(table: &'t Table<'a>) -> Self {
        let channels = || 0..usize::from(table.channels());
        let rows = || 0..table.grid().rows();
        let unit = f64::from(table.gain_fraction()).exp2();
        let provenance = Provenance::read(table.provenance());
        let (grid, parts) = (table.grid(), provenance.parts(table.grid()));
        // Below a lower frame gains go on, and nobody shows it.
        let is_shown = |cell: usize| {
            let parts = parts.as_ref();
            parts.is_none_or(|all| all.iter().any(|part| part.own(grid.cols(), cell).is_some()))
        };
        let gain = |channel| {
            let bits = rows().flat_map(|row| table.gain_row(row, channel));
            let shown = |(cell, gain)| {
                if is_shown(cell) {
                    f64::from(gain) / unit
                } else {
                    0.0
                }
            };
            bits.enumerate().map(shown).collect()
        };
        let ambient = |channel| {
            let own = rows().map(|row| table.ambient_row(row, channel));
            let light: Vec<f64> = own.flatten().flatten().map(Light::to_num).collect();
            if light.is_empty() {
                vec![0.0; table.grid().cells()]
            } else {
                light
            }
        };
        Self {
            table,
            memory: OperatorMemory::new(table),
            gain: channels().map(gain).collect(),
            ambient: channels().map(ambient).collect(),
            overlapping: provenance.overlapping,
        }
    }

    /// Whether each cell has a gain in every channel, length `N`.
    #[must_use]
    pub fn live(&self) -> Vec<bool> {
        let cells = 0..self.table.grid().cells();
        let live = |cell| self.gain.iter().all(|gain: &Vec<f64>| gain[cell] > 0.0);
        cells.map(live).collect()
    }

    /// The brightest even grey, ambient light included, that every cell reaches, relative
    /// to reference white: 1 unless reference white was chosen otherwise.
    #[must_use]
    pub fn even_grey(&mut self) -> f64 {
        let cells = self.table.grid().cells();
        let even = self.received(&vec![vec![1.0; cells]; self.gain.len()]);
        let ambient = self.ambient.clone();
        let bounced = self.received(&ambient);
        let mut least = f64::INFINITY;
        for channel in 0..self.gain.len() {
            for cell in 0..cells {
                let gain = self.gain[channel][cell];
                let slope = gain - even[channel][cell];
                // Where nothing is projected, nothing is asked for.
                if gain > 0.0 && slope > 0.0 {
                    let free = gain * ambient[channel][cell] - bounced[channel][cell];
                    least = least.min((1.0 + free) / slope);
                }
            }
        }
        if least.is_finite() { least } else { 1.0 }
    }

    /// Light under black, relative to reference white.
    #[must_use]
    pub const fn ambient(&self) -> &CellPlanes {
        &self.ambient
    }

    /// The light of every cell, ambient light included, relative to reference white, of an
    /// input relative to the projector's white; both one entry a channel. `None` if the
    /// table's bounces do not fade: it may compensate what is projected, but it does not
    /// tell what light comes of an input. Nor does that of projectors that overlap: it says how much of
    /// wanted light each shows, not how bright either makes the place that both light.
    #[must_use]
    pub fn photograph(&mut self, input: &CellPlanes) -> Option<CellPlanes> {
        if self.overlapping {
            return None;
        }
        let mut light = self.reflect(input, None);
        let mut fading = false;
        for _ in 0..MOST_BOUNCES {
            let received = self.received(&light);
            let next = self.reflect(input, Some(&received));
            let brightest = next.iter().flatten().fold(0.0_f64, |a, b| a.max(*b));
            let pairs = next.iter().flatten().zip(light.iter().flatten());
            let change = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            light = next;
            fading = change <= FADING * brightest;
            if change <= SETTLED * brightest {
                break;
            }
        }
        if !fading {
            return None;
        }
        for (light, ambient) in light.iter_mut().zip(&self.ambient) {
            light.iter_mut().zip(ambient).for_each(|(l, a)| *l += a);
        }
        Some(light)
    }

    /// The same of a picture that lies elsewhere on the wall than the cells: `onto` brings its
    /// planes to the cells, and `back` those of the cells to it. Bounced light and gains are
    /// smooth and may be looked up between cells; what is projected is not.
    pub(super) fn photograph_elsewhere(
        &mut self,
        input: &CellPlanes,
        onto: impl Fn(&CellPlanes) -> CellPlanes,
        back: impl Fn(&CellPlanes) -> CellPlanes,
    ) -> Option<CellPlanes> {
        let mut light = self.photograph(&onto(input))?;
        for (light, ambient) in light.iter_mut().zip(&self.ambient) {
            light.iter_mut().zip(ambient).for_each(|(l, a)| *l -= a);
        }
        let mut received = back(&self.received(&light));
        let (gain, ambient) = (back(&self.gain), back(&self.ambient));
        for (channel, plane) in received.iter_mut().enumerate() {
            for (cell, light) in plane.iter_mut().enumerate() {
                let gain = gain[channel][cell];
                let lit = input[channel][cell] + *light;
                let own = if gain > 0.0 { lit / gain } else { 0.0 };
                *light = own.max(0.0) + ambient[channel][cell];
            }
        }
        Some(received)
    }

    /// `(p + K l) / g`; dark where the table knows nothing.
    fn reflect(&self, input: &CellPlanes, received: Option<&CellPlanes>) -> CellPlanes {
        let channels = self.gain.iter().zip(input).enumerate();
        let of_channel = |(channel, (gain, input)): (usize, (&Vec<f64>, &Vec<f64>))| {
            let cells = gain.iter().zip(input).enumerate();
            let light = cells.map(|(cell, (gain, input))| {
                let received = received.map_or(0.0, |received| received[channel][cell]);
                if *gain > 0.0 {
                    ((input + received) / gain).max(0.0)
                } else {
                    0.0
                }
            });
            light.collect()
        };
        channels.map(of_channel).collect()
    }

    /// `K l`, by the runtime's own operator at the table's top tier.
    fn received(&mut self, light: &CellPlanes) -> CellPlanes {
        let brightest = light.iter().flatten().fold(0.0_f64, |a, b| a.max(*b));
        if brightest <= 0.0 {
            return light.clone();
        }
        // The operator is linear, and its input ends at 1.
        let one = f64::from(Light::ONE.to_bits());
        let bits = |light: &f64| (light / brightest * one).round() as i32;
        let mut cells: Vec<i32> = light.iter().flatten().map(bits).collect();
        let top = self.table.top_tier();
        if correct(self.table, top, &mut cells, &mut self.memory.workspace()).is_err() {
            unreachable!("the memory was sized for this table");
        }
        // What `correct` returns is half a step of a drive too large.
        let half = if self.table.operator().is_some() && top > 0 {
            1 << (CORRECTION_GUARD_BITS - 1)
        } else {
            0
        };
        let unit = brightest / f64::from(Correction::FRAC_NBITS).exp2();
        let count = self.table.grid().cells();
        let channels = cells.chunks_exact(count);
        channels
            .map(|cells| cells.iter().map(|c| f64::from(c - half) * unit).collect())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::test_scene::scene;
    use crate::verify::{ProjectorCurves, test_images};
    use iltm_compile::{CompileOptions, compile};
    use iltm_picture::{LightPicture, Picture, Response, Samples};

    /// Light of 8-bit codes, channel by channel.
    fn light(picture: &Picture, of: impl Fn(usize, u8) -> f64) -> CellPlanes {
        let Samples::Eight(samples) = picture.samples() else {
            panic!("8 bits");
        };
        let channels = picture.channels();
        let plane = |channel: usize| {
            let codes = samples.iter().skip(channel).step_by(channels);
            codes.map(|code| of(channel, *code)).collect()
        };
        (0..channels).map(plane).collect()
    }

    fn error(seen: &CellPlanes, wanted: &CellPlanes) -> f64 {
        let pairs = || seen.iter().flatten().zip(wanted.iter().flatten());
        let off: f64 = pairs().map(|(s, w)| (s - w).powi(2)).sum();
        (off / pairs().map(|(_, w)| w * w).sum::<f64>()).sqrt()
    }

    #[test]
    fn the_light_of_a_compensated_image_is_the_wanted_one_and_that_of_others_is_not() {
        for channels in [1, 3] {
            let options = CompileOptions {
                projector: Response::Gamma(2.2).into(),
                ..CompileOptions::default()
            };
            let compiled = compile(&scene(channels), None, &options).unwrap();
            let table = Table::check(&compiled.image).unwrap();
            let curves = ProjectorCurves::new(&table);
            let mut expected = Expected::new(&table);
            assert!(expected.live().iter().all(|live| *live));
            assert!(
                (expected.even_grey() - 1.0).abs() < 0.01,
                "{}",
                expected.even_grey()
            );
            for image in test_images(&table).unwrap() {
                let decoded = LightPicture::decode(&image.wanted, Response::Srgb);
                let wanted: CellPlanes = decoded
                    .planes()
                    .iter()
                    .map(|plane| plane.iter().map(|light| f64::from(*light)).collect())
                    .collect();
                let drive = |channel, code| curves.drive(channel, code);
                let seen = expected
                    .photograph(&light(&image.compensated, drive))
                    .unwrap();
                // Steps of 8-bit codes, and up to .5 % of the samples cut.
                assert!(
                    error(&seen, &wanted) < 0.02,
                    "{}: {}",
                    image.title,
                    error(&seen, &wanted)
                );
                let plain = expected.photograph(&wanted).unwrap();
                assert!(error(&plain, &wanted) > 0.1, "{}", image.title);
            }
        }
    }

    #[test]
    fn bounces_that_do_not_fade_tell_no_light() {
        let mut inverse = scene(1);
        inverse.shared *= 6.0;
        let compiled = compile(&inverse, None, &CompileOptions::default()).unwrap();
        let table = Table::check(&compiled.image).unwrap();
        let mut expected = Expected::new(&table);
        let cells = table.grid().cells();
        assert_eq!(expected.photograph(&vec![vec![1.0; cells]]), None);
    }
}
