//! Virtual camera: one photograph after another of what the projector shows, as a session takes
//! them. The lamp drifts, and whatever is asked to go wrong does.

use super::description::{Projector, Scene};
use super::injected_fault::{CaptureFault, InjectedFault, InjectedFaults};
use super::pixel_sampling::FrameSampling;
use super::sensor::Sensor;
use super::simulation::{Simulation, SimulationError};
use iltm_capture::Pattern;
use iltm_picture::{FramePart, Response};
use iltm_runtime::{FrameSize, Grid, resample::area::AreaAverage};
use nalgebra::DMatrix;
use png::{BitDepth, ColorType, Compression, Encoder, Filter};
use rayon::prelude::*;
use std::io;

/// Photographs that are exposed together: their light is held in memory.
const TOGETHER: usize = 64;

/// What the projector is given for one photograph.
#[derive(Clone, PartialEq, Debug)]
pub struct ProjectedFrame {
    /// One pixel a cell, or a finer frame without its border.
    pub size: FrameSize,
    /// Input codes of every pixel, red, green and blue, 0 to 255, row by row.
    pub codes: Vec<[u8; 3]>,
    /// Exposure relative to that of the other photographs.
    pub exposure: f64,
}

impl ProjectedFrame {
    /// Lit cells white, the others black; the pattern is of this part of the grid.
    pub(super) fn of_pattern(grid: Grid, part: &FramePart, pattern: &Pattern) -> Self {
        let mut codes = vec![[0; 3]; grid.cells()];
        for (cell, lit) in part.places(grid.cols()).zip(&pattern.lit) {
            codes[cell] = [255 * u8::from(*lit); 3];
        }
        Self {
            size: FrameSize::of_grid(grid),
            codes,
            exposure: 1.0,
        }
    }
}

/// Values of a photograph's file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Photograph {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// One plane a channel, row by row, 0 to [`Photograph::scale`].
    pub values: Vec<Vec<u16>>,
    /// Full scale: 255 or 65,535.
    pub scale: u16,
}

impl Photograph {
    /// The bytes of a PNG of 8 or 16 bits, grey or in colour.
    ///
    /// # Errors
    /// What the encoder says.
    pub fn png(&self) -> io::Result<Vec<u8>> {
        let eight = self.scale == 255;
        let mut bytes = Vec::new();
        for pixel in 0..self.values[0].len() {
            for plane in &self.values {
                if eight {
                    bytes.push(plane[pixel] as u8);
                } else {
                    bytes.extend(plane[pixel].to_be_bytes());
                }
            }
        }
        let colour = match self.values.len() {
            1 => ColorType::Grayscale,
            _ => ColorType::Rgb,
        };
        let depth = if eight {
            BitDepth::Eight
        } else {
            BitDepth::Sixteen
        };
        png(&bytes, self.size, colour, depth)
    }
}

/// The bytes of a PNG with these samples, larger numbers with their high byte first.
/// Noise is most of a photograph, so compressing it well takes long and saves little.
pub(super) fn png(
    samples: &[u8],
    (width, height): (u32, u32),
    colour: ColorType,
    depth: BitDepth,
) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, width, height);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::Fast);
    encoder.set_filter(Filter::Adaptive);
    encoder.write_header()?.write_image_data(samples)?;
    Ok(bytes)
}

/// A camera set up before a scene, exposed for white.
#[derive(Clone, Debug)]
pub struct VirtualCamera<'s> {
    pub(super) scene: &'s Scene,
    pub(super) simulation: &'s Simulation<'s>,
    sensor: Sensor<'s>,
    /// Mean light of white.
    white: f64,
    seed: u64,
    faults: &'s [InjectedFault],
    /// Most bounces that white's light was followed over.
    bounces: usize,
}

impl<'s> VirtualCamera<'s> {
    /// Exposes for white. `seed` repeats the noise.
    ///
    /// # Errors
    /// [`SimulationError`] if there is no end to the bounces.
    pub fn new(
        scene: &'s Scene,
        simulation: &'s Simulation<'s>,
        seed: u64,
    ) -> Result<Self, SimulationError> {
        let flood = DMatrix::from_element(simulation.grid().cells(), 1, 1.0);
        let flood = simulation.expose(&flood)?;
        let planes = simulation.photograph(&flood, 0);
        Ok(Self {
            scene,
            simulation,
            sensor: simulation.sensor(&planes),
            white: mean(&planes),
            seed,
            faults: &[],
            bounces: flood.bounces,
        })
    }

    /// The projector's cells.
    #[must_use]
    pub fn grid(&self) -> Grid {
        self.simulation.grid()
    }

    /// The same, with things that go wrong.
    #[must_use]
    pub fn with_faults(mut self, faults: &'s [InjectedFault]) -> Self {
        self.faults = faults;
        if let Some(fault) = faults.iter().find(|f| f.kind == CaptureFault::Gamma) {
            self.sensor = self.sensor.responding(Response::Gamma(fault.size));
        }
        self
    }

    /// The same with the exposure that was set at another place.
    #[must_use]
    pub fn exposed_as(mut self, other: &Self) -> Self {
        self.sensor = other.sensor;
        self
    }

    /// The same with the noise of another session; the first is 0.
    pub(super) fn in_session(&self, session: u64) -> Self {
        Self {
            seed: self.seed ^ (session << 32),
            ..self.clone()
        }
    }

    /// Takes the photographs at `places` of a session that shows `frames`, and hands
    /// each to `keep` with its place; `None` where the camera missed it. Returns the
    /// most bounces that light was followed over.
    ///
    /// # Errors
    /// [`SimulationError`], or the first error of `keep`.
    ///
    /// # Panics
    /// If a place is beyond the frames, or a frame has not one code a pixel or fewer pixels than
    /// cells.
    pub fn take<E>(
        &self,
        frames: &[ProjectedFrame],
        places: &[usize],
        keep: impl Fn(usize, Option<Photograph>) -> Result<(), E> + Sync,
    ) -> Result<usize, E>
    where
        E: From<SimulationError> + Send,
    {
        let faults = InjectedFaults {
            faults: self.faults,
            count: frames.len(),
        };
        let mut bounces = self.bounces;
        let cells = FrameSize::of_grid(self.grid());
        let mut finer: Vec<FrameSampling> = Vec::new();
        let shown = places.iter().filter_map(|place| faults.shown_at(*place));
        for size in shown.map(|shown| frames[shown].size) {
            if size != cells && finer.iter().all(|known| known.size != size) {
                finer.push(FrameSampling::new(self.simulation, size));
            }
        }
        for places in places.chunks(TOGETHER) {
            let shown: Vec<(usize, &ProjectedFrame)> = places
                .iter()
                .filter_map(|place| Some((*place, &frames[faults.shown_at(*place)?])))
                .collect();
            for place in places.iter().filter(|p| faults.shown_at(**p).is_none()) {
                keep(*place, None)?;
            }
            let (projected, lamps) = self.projected(&faults, &shown);
            let exposed = self.simulation.expose_projected(&projected, &lamps)?;
            bounces = bounces.max(exposed.bounces);
            let kept = shown
                .par_iter()
                .enumerate()
                .map(|(column, (place, frame))| {
                    let pixels = finer.iter().find(|pixels| pixels.size == frame.size);
                    let mut light = match pixels {
                        Some(pixels) => {
                            let projected = self.projected_pixels(frame, &faults);
                            let lamps: Vec<_> = lamps.iter().map(|lamp| lamp[column]).collect();
                            let of = self.simulation;
                            of.photograph_of_pixels(&exposed, column, pixels, &projected, &lamps)
                        }
                        None => self.simulation.photograph(&exposed, column),
                    };
                    faults.disturb(&mut light, self.scene.camera.size.0 as usize, *place);
                    let exposure = frame.exposure * faults.exposure(mean(&light), self.white);
                    keep(*place, Some(self.photograph(&light, exposure, *place)))
                });
            kept.collect::<Result<Vec<()>, E>>()?;
        }
        Ok(bounces)
    }

    /// Light of each of the projector's channels under some frames, cells x frames, one entry
    /// where all channels show the same; and of each projector's lamp under each.
    fn projected(
        &self,
        faults: &InjectedFaults<'_>,
        shown: &[(usize, &ProjectedFrame)],
    ) -> (Vec<DMatrix<f64>>, Vec<Vec<f64>>) {
        let grid = self.grid();
        let mut channels = vec![DMatrix::zeros(grid.cells(), shown.len()); 3];
        for (column, (_, frame)) in shown.iter().enumerate() {
            assert_eq!(frame.codes.len(), frame.size.pixels(), "a code a pixel");
            let owners = AreaAverage::new(grid, frame.size).expect("a pixel a cell or more");
            let (light, width) = (self.light_of_codes(frame.size), frame.size.width());
            let mut pixels = vec![0.0_f64; grid.cells()];
            for (pixel, codes) in frame.codes.iter().enumerate() {
                let Some(cell) = owners.owner(pixel % width, pixel / width) else {
                    continue;
                };
                pixels[cell] += 1.0;
                let projected = faults.projected(light.at(pixel, *codes));
                for (channel, light) in channels.iter_mut().zip(projected) {
                    channel[(cell, column)] += light;
                }
            }
            for channel in &mut channels {
                for (light, pixels) in channel.column_mut(column).iter_mut().zip(&pixels) {
                    *light /= pixels.max(1.0);
                }
            }
        }
        let last = faults.count.saturating_sub(1).max(1) as f64;
        let mut lamps = vec![Vec::new(); self.scene.projectors.len()];
        for (column, (place, _)) in shown.iter().enumerate() {
            let mean = channels
                .iter()
                .map(|c| c.column(column).mean())
                .sum::<f64>()
                / 3.0;
            let dimmed = faults.dimmed(mean);
            let of_moment = self.simulation.lamps(*place as f64 / last);
            for (lamp, of_moment) in lamps.iter_mut().zip(of_moment) {
                lamp.push(of_moment * dimmed);
            }
        }
        if channels[0] == channels[1] && channels[0] == channels[2] {
            channels.truncate(1);
        }
        (channels, lamps)
    }

    /// Light that the projectors make of a frame's codes.
    fn light_of_codes(&self, frame: FrameSize) -> CodeLight {
        let of_codes = |projector: &Projector| {
            let light = |code| projector.response.light(f64::from(code) / 255.0);
            (0..=255_u8).map(light).collect()
        };
        // Frames that are shown have whole pixels of each.
        let parts = self.scene.parts_of(frame).unwrap_or_default();
        CodeLight {
            width: frame.width(),
            projectors: parts
                .into_iter()
                .zip(self.scene.projectors.iter().map(of_codes))
                .collect(),
        }
    }

    /// Light of each of the projector's channels in every pixel of a fine frame, one entry
    /// where all show the same.
    fn projected_pixels(
        &self,
        frame: &ProjectedFrame,
        faults: &InjectedFaults<'_>,
    ) -> Vec<DMatrix<f64>> {
        let light = self.light_of_codes(frame.size);
        let projected =
            |(pixel, codes): (usize, &[u8; 3])| faults.projected(light.at(pixel, *codes));
        let grey = frame.codes.iter().all(|[r, g, b]| r == g && g == b);
        let of_channel = |channel: usize| {
            let codes = frame.codes.iter().enumerate();
            let light = codes.map(|of_pixel| projected(of_pixel)[channel]);
            DMatrix::from_iterator(frame.codes.len(), 1, light)
        };
        (0..if grey { 1 } else { 3 }).map(of_channel).collect()
    }

    fn photograph(&self, light: &[Vec<f32>], exposure: f64, place: usize) -> Photograph {
        let seed = self.seed.wrapping_add(place as u64);
        let exposed = |plane: &Vec<f32>| -> Vec<f32> {
            plane
                .iter()
                .map(|l| (f64::from(*l) * exposure) as f32)
                .collect()
        };
        let values = (light.iter().zip(0_u64..))
            // Each channel has noise of its own.
            .map(|(plane, channel)| self.sensor.values(&exposed(plane), seed ^ (channel << 40)));
        Photograph {
            size: self.scene.camera.size,
            values: values.collect(),
            scale: self.sensor.file_scale(),
        }
    }
}

/// Light, 0 to 1, of the input codes of a wide frame.
struct CodeLight {
    width: usize,
    /// The pixels of each projector, and its light of each code.
    projectors: Vec<(FramePart, Vec<f64>)>,
}

impl CodeLight {
    /// Of the codes of a pixel; none below a lower frame.
    fn at(&self, pixel: usize, codes: [u8; 3]) -> [f64; 3] {
        let own = |part: &FramePart| part.own(self.width, pixel).is_some();
        let light = self.projectors.iter().find(|(part, _)| own(part));
        codes.map(|code| light.map_or(0.0, |(_, light)| light[usize::from(code)]))
    }
}

/// Mean of all channels.
fn mean(planes: &[Vec<f32>]) -> f64 {
    let sum: f64 = planes.iter().flatten().map(|light| f64::from(*light)).sum();
    sum / planes.iter().map(Vec::len).sum::<usize>().max(1) as f64
}
