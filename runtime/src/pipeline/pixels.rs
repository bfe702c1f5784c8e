//! Pixels of a frame of the grid's size, as the transforms read them.

use super::sample::Sample;
use super::stages::subtract_ambient;
use crate::haar::{CellRow, CellSource};
use crate::kernel::{Block, Plane};
use crate::units::{InputCoefficient, Light};

/// One channel of pixels of `C` samples, a cell each, and its curves.
#[derive(Clone, Copy, Debug)]
pub struct Pixels<'f, S: Sample, const C: usize> {
    /// The pixels.
    pub plane: Plane<'f, S, C>,
    /// The channel's curves.
    pub curves: S::Curves<'f>,
}

impl<S: Sample, const C: usize> Pixels<'_, S, C> {
    /// Light of a pixel without the ambient light; none past the end.
    #[inline]
    #[must_use]
    pub fn light(&self, index: usize) -> Light {
        let plane = &self.plane;
        let code = plane
            .codes
            .get(index)
            .and_then(|pixel| pixel.get(plane.channel));
        let light = code.map_or(Light::ZERO, |code| code.light(self.curves));
        let Some(ambient) = plane.ambient else {
            return light;
        };
        let ambient = ambient
            .get(index)
            .and_then(|pixel| pixel.get(plane.channel));
        let ambient = ambient.map_or(Light::ZERO, |bits| {
            Light::from_bits(u16::from_le_bytes(*bits))
        });
        subtract_ambient(light, ambient)
    }
}

/// One row of [`Pixels`].
#[derive(Clone, Copy, Debug)]
pub struct PixelRow<'r, 'f, S: Sample, const C: usize> {
    pixels: &'r Pixels<'f, S, C>,
    start: usize,
}

impl<S: Sample, const C: usize> CellRow for PixelRow<'_, '_, S, C> {
    #[inline]
    fn pairs(self) -> impl Iterator<Item = [i32; 2]> {
        (0..self.pixels.plane.cols / 2).map(move |pair| [self.at(2 * pair), self.at(2 * pair + 1)])
    }

    #[inline]
    fn at(self, index: usize) -> i32 {
        self.pixels.light(self.start + index).to_bits().into()
    }
}

impl<'f, S: Sample, const C: usize> CellSource for Pixels<'f, S, C> {
    type Row<'r>
        = PixelRow<'r, 'f, S, C>
    where
        Self: 'r;

    #[inline]
    fn rows(&self) -> impl Iterator<Item = PixelRow<'_, 'f, S, C>> {
        let starts = (0..self.plane.codes.len()).step_by(self.plane.cols.max(1));
        starts.map(|start| PixelRow {
            pixels: self,
            start,
        })
    }

    #[inline]
    fn merge(
        &self,
        block: Block,
        shift: u32,
        sums: &mut [i32],
        details: &mut [[InputCoefficient; 3]],
    ) -> bool {
        S::merge(self, block, shift, sums, details)
    }
}
