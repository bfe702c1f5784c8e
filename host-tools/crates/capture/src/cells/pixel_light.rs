//! Pixel light: some camera pixels in every view, to judge by what a viewer sees rather than by
//! means over cells.

use super::drift::Drift;
use super::measure::ImageLight;
use super::measurements::Measurements;
use crate::format::bracket::Bracket;
use crate::format::sequence::Sequence;
use crate::photographs::photo::Photo;
use crate::photographs::sampled::SIDE;
use crate::registration::projector_map::ProjectorMap;
use std::borrow::Cow;

/// Light of some camera pixels.
#[derive(Clone, PartialEq, Debug)]
pub struct PixelLight {
    /// Index of each in the registered photographs: whole squares of [`PixelLight::SIDE`] pixels
    /// a side, one after the other, each row by row.
    pub pixels: Vec<u32>,
    /// Whether none of a pixel's photographs of white is saturated.
    pub sound: Vec<bool>,
    /// Light by channel and view, black subtracted, camera units.
    pub channels: Vec<Vec<Vec<f32>>>,
    /// What the projector throws there, relative to its white, by channel and image: the last
    /// views. NaN where a pixel sees no part of the projection, or the image has one pixel a cell.
    pub thrown: Vec<Vec<Vec<f32>>>,
}

impl PixelLight {
    /// Pixels along a square's side.
    pub const SIDE: usize = SIDE;
}

/// Light of those pixels in each photograph.
pub(crate) struct PixelSamples {
    pixels: Vec<u32>,
    /// By shot and channel.
    shots: Vec<Vec<Vec<f32>>>,
}

impl PixelSamples {
    pub(crate) fn new(pixels: &[u32], shots: usize) -> Self {
        Self {
            pixels: pixels.to_vec(),
            shots: vec![Vec::new(); shots],
        }
    }

    /// Takes what is needed of a photograph.
    pub(crate) fn keep(&mut self, shot: usize, photo: &Photo) {
        self.shots[shot] = self.taken(photo);
    }

    /// What is needed of a photograph, by channel.
    pub(crate) fn taken(&self, photo: &Photo) -> Vec<Vec<f32>> {
        let values = |plane: &Vec<f32>| self.pixels.iter().map(|&p| plane[p as usize]).collect();
        photo.planes.iter().map(values).collect()
    }

    /// Divides slow changes out, subtracts black and averages the photographs of each view;
    /// `images` are the photographs of images.
    pub(crate) fn average(
        self,
        sequence: &Sequence,
        images: &[ImageLight],
        drift: &Drift,
        saturated: &[bool],
    ) -> PixelLight {
        let channels = self.shots.first().map_or(0, Vec::len);
        let of_channel = |channel: usize| -> Vec<Vec<f32>> {
            let mut black = vec![0.0; self.pixels.len()];
            let share = 1.0 / sequence.black.len() as f32;
            for &shot in &sequence.black {
                for (black, light) in black.iter_mut().zip(&self.shots[shot][channel]) {
                    *black += share * light;
                }
            }
            let of_view = |shots: &Vec<usize>| {
                let mut mean = vec![0.0; self.pixels.len()];
                for &shot in shots {
                    let gain = drift.gain(channel, shot) as f32 * shots.len() as f32;
                    let dark = drift.dark(channel, shot) as f32;
                    let light = self.shots[shot][channel].iter().zip(&black);
                    for (mean, (light, black)) in mean.iter_mut().zip(light) {
                        *mean += (light - dark * black) / gain;
                    }
                }
                mean
            };
            let of_image = |(bracket, image): (&Bracket, &ImageLight)| {
                let (gain, dark) = drift.between(sequence, channel, bracket.shots[0].index);
                let light = image.pixels[channel].iter().zip(&black);
                light
                    .map(|(light, black)| (light - dark as f32 * black) / gain as f32)
                    .collect()
            };
            let views = sequence.views.iter().map(|view| of_view(&view.shots));
            let images = sequence.images.iter().zip(images).map(of_image);
            views.chain(images).collect()
        };
        PixelLight {
            channels: (0..channels).map(of_channel).collect(),
            thrown: vec![Vec::new(); channels],
            sound: self
                .pixels
                .iter()
                .map(|at| !saturated[*at as usize])
                .collect(),
            pixels: self.pixels,
        }
    }
}

impl Measurements {
    /// Where each of the [pixels](Measurements::pixel_light) looks, in cells from the left and
    /// upper edge of the first; `None` of one at the border of the projection, outside it, or
    /// that is saturated.
    #[must_use]
    pub fn places(&self) -> Vec<Option<[f32; 2]>> {
        let map = match &self.map {
            Some(Ok(map)) => Cow::Borrowed(map),
            _ => Cow::Owned(ProjectorMap::of_cells(self)),
        };
        let light = &self.pixel_light;
        let place = |(&pixel, &sound): (&u32, &bool)| {
            let pixel = pixel as usize;
            let place = map.in_cells(map.position[pixel], self.grid);
            let known = place.iter().all(|at| at.is_finite());
            (known && sound && self.registration.is_inside(pixel)).then_some(place)
        };
        light.pixels.iter().zip(&light.sound).map(place).collect()
    }
}
