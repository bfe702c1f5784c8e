//! Evidence: what the phases found in a capture, one after the other. [`gates`](crate::gates)
//! judge it afterwards; what is left of it are [`Measurements`].

use crate::cells::CellEvidence;
use crate::cells::cell_pixels::CellPixels;
use crate::cells::images::{self, KnownImages};
use crate::cells::measurements::{ChannelMeasurements, Diagnostics, Measurements};
use crate::cells::noise::NoiseModel;
use crate::devices::{CameraFit, Devices, MeasuredDevices, Unmixing};
use crate::format::error::CaptureError;
use crate::format::picture_file::FileFormat;
use crate::format::sequence::Sequence;
use crate::format::settings::Settings;
use crate::photographs::channel_sum;
use crate::photographs::clipping::{self, Clipped};
use crate::photographs::linearise::LinearPhotographs;
use crate::photographs::order::{self, Order};
use crate::photographs::sampled::Sampled;
use crate::registration::cell_map::{NO_CELL, Registration};
use crate::registration::movement::{self, Moved};
use crate::registration::projector_map::{MapError, ProjectorMap};
use crate::registration::{self, Registered, image_tracking};
use iltm_picture::Declared;
use iltm_picture::progress::Progress;
use iltm_picture::statistics::quantile;
use std::path::Path;

/// What the photographs of a sequence show.
pub(crate) struct CaptureEvidence {
    /// What the photographs' files are, and bits of a sample in them.
    pub(crate) files: (FileFormat, u8),
    /// Whether `capture.toml` says how the files follow the light.
    pub(crate) response_stated: bool,
    pub(crate) clipped: Clipped,
    pub(crate) devices: Devices,
    pub(crate) order: Option<Order>,
    pub(crate) registered: Registered,
    pub(crate) pixels: CellPixels,
    pub(crate) moved: Option<Moved>,
    /// `None` if no cell was found.
    pub(crate) cells: Option<CellEvidence>,
    /// The projector map of stripes finer than the cells, if there are any.
    pub(crate) map: Option<Result<ProjectorMap, MapError>>,
    /// The photograph of white, as it is drawn.
    pub(crate) white: WhitePhotograph,
    /// White's light with black subtracted, one plane a channel, and how many photographs of white
    /// it is as good as.
    flood: (Vec<Vec<f32>>, usize),
}

/// The photograph of white, for whoever draws it.
#[derive(Clone, PartialEq, Debug)]
pub struct WhitePhotograph {
    /// Width and height in pixels.
    pub size: (usize, usize),
    /// Its light, mean of the channels, row by row.
    pub light: Vec<f32>,
    /// Which pixels are clipped in it.
    pub clipped: Vec<bool>,
    /// Whether a pixel sees any cell of the projection.
    pub lit: Vec<bool>,
}

impl WhitePhotograph {
    fn new(linear: &LinearPhotographs<'_>, registration: &Registration) -> Self {
        let share = 1.0 / linear.flood.len().max(1) as f32;
        let light = channel_sum(&linear.flood)
            .into_iter()
            .map(|sum| share * sum);
        Self {
            size: registration.camera,
            light: light.collect(),
            clipped: linear.saturated.clone(),
            lit: registration
                .seen_cell
                .iter()
                .map(|cell| *cell != NO_CELL)
                .collect(),
        }
    }
}

impl CaptureEvidence {
    /// Reads the photographs and goes through all phases.
    ///
    /// # Errors
    /// A photograph's own error, or a phase's.
    pub(crate) fn collect<'f>(
        folder: &'f Path,
        sequence: &Sequence,
        (settings, unmixing): (&Settings, Unmixing<'_>),
        progress: &dyn Progress,
    ) -> Result<(Self, LinearPhotographs<'f>), CaptureError> {
        let reading = settings.camera.reading();
        let mut linear = LinearPhotographs::read(folder, sequence, &reading, progress)?;
        let found = Self::find(
            folder,
            sequence,
            (settings, unmixing),
            &mut linear,
            progress,
        )?;
        Ok((found, linear))
    }

    /// Goes through all phases. Where a mixing is undone, `linear` is afterwards in the projector's
    /// channels.
    ///
    /// # Errors
    /// A photograph's own error, or a phase's.
    pub(crate) fn find(
        folder: &Path,
        sequence: &Sequence,
        (settings, unmixing): (&Settings, Unmixing<'_>),
        linear: &mut LinearPhotographs<'_>,
        progress: &dyn Progress,
    ) -> Result<Self, CaptureError> {
        // In the camera's own channels, where a ceiling is one value.
        let clipped = clipping::find(sequence, linear, progress)?;
        let known = (settings, unmixing);
        let mut devices = MeasuredDevices::measure(folder, sequence, known, linear, progress)?;
        let sampled = Sampled::take(&mut linear.photographs, sequence.shots.len(), progress)?;
        let mut images = match &sequence.images[..] {
            [] => None,
            images => Some(linear.others(folder, images.to_vec())?),
        };
        let projector = &settings.projector;
        let response = devices.devices.projector.clone();
        let known = &KnownImages::new(folder, sequence, projector.pixels(), response);
        let shown = images.as_mut().map(|images| (known, images));
        let mut registered =
            registration::register(folder, (sequence, projector), linear, shown, progress)?;
        let registration = &registered.registration;
        let pixels = CellPixels::choose(registration, &linear.saturated);
        let photographs = &mut linear.photographs;
        let contradicted = devices
            .devices
            .camera_fit
            .as_ref()
            .filter(|fit| fit.contradicts());
        let power = contradicted.map(CameraFit::power);
        let measure = || {
            CellEvidence::measure(
                sequence,
                (photographs, images.as_mut()),
                registration,
                (&pixels, &linear.saturated),
                &sampled,
                power,
                progress,
            )
        };
        let found = pixels.live.contains(&true);
        let cells = found.then(measure).transpose()?;
        let map = match (registered.map.take(), &mut images) {
            (None, Some(images)) => {
                let images = (known, images);
                image_tracking::map(sequence.grid, linear, images, registration, progress)?.map(Ok)
            }
            (map, _) => map,
        };
        if let (true, Some(Ok(map)), Some(images)) =
            (devices.projector_unknown(), &map, &mut images)
        {
            let found = image_tracking::response(map, linear, (known, images), progress)?;
            if let Some(response) = found {
                devices.take_response(response);
            }
        }
        let format = &linear.photographs.format;
        let files = (format.file, format.bits);
        let white = WhitePhotograph::new(linear, registration);
        let models = cells.iter().flat_map(|cells| &cells.channels);
        let models: Vec<NoiseModel> = models.map(|channel| channel.noise_model).collect();
        let flood = linear.flood_of_pairs(sequence, &models, progress)?;
        let blur = settings.projector.blur;
        Ok(Self {
            files,
            response_stated: settings.camera.response != Declared::Unsaid,
            clipped,
            devices: devices.with_blur(sequence.grid, registration, &flood.0, blur),
            order: order::find(sequence, &sampled),
            moved: movement::find(sequence, &sampled, registration),
            cells,
            registered,
            pixels,
            map,
            white,
            flood,
        })
    }

    /// What a solve needs of it; `None` if no cell was found.
    ///
    /// # Errors
    /// Those of [`images::add`].
    pub(crate) fn into_measurements(
        self,
        folder: &Path,
        sequence: &Sequence,
        settings: &Settings,
    ) -> Result<Option<Measurements>, CaptureError> {
        let Some(cells) = self.cells else {
            return Ok(None);
        };
        let diagnostics = Diagnostics {
            file: self.files.0,
            bits: self.files.1,
            photographs: (sequence.brackets.iter().chain(&sequence.images))
                .map(|b| b.shots.len())
                .sum(),
            images: sequence.images.len(),
            bernoulli: sequence.bernoulli().len(),
            bernoulli_taken: sequence.bernoulli().len(),
            method: self.registered.method,
            pixels: self.registered.count,
            exposure: exposure(&cells.channels, &self.pixels.live),
            noise: cells.noise,
            superposition: cells.sums.map(|sums| sums.overall),
            left_out: self.pixels.left_out.clone(),
            gates: Vec::new(),
        };
        let views = &sequence.views;
        let mut measurements = Measurements {
            grid: sequence.grid,
            roles: views.iter().map(|view| view.role).collect(),
            repeats: views.iter().map(|view| view.shots.len() as u32).collect(),
            channels: cells.channels,
            pixel_light: cells.pixel_light,
            pixels: self.pixels.counts(),
            live: self.pixels.live,
            registration: self.registered.registration,
            flood: self.flood.0,
            flood_photographs: self.flood.1,
            // Found afterwards, by those who need it.
            even: None,
            map: self.map,
            devices: self.devices,
            settings: settings.clone(),
            diagnostics,
        };
        images::add(folder, sequence, &mut measurements)?;
        Ok(Some(measurements))
    }
}

/// 95th percentile of the flood light over the live cells, in the brightest
/// channel, ambient included.
fn exposure(channels: &[ChannelMeasurements], live: &[bool]) -> f64 {
    let of_channel = |channel: &ChannelMeasurements| {
        let flood = channel.observations.column(Measurements::WHITE);
        let mut light: Vec<f32> = (flood.iter().zip(&channel.ambient).zip(live))
            .filter(|(_, live)| **live)
            .map(|((flood, ambient), _)| (flood + ambient) as f32)
            .collect();
        quantile(&mut light, 0.95).map_or(0.0, f64::from)
    };
    channels.iter().map(of_channel).fold(0.0, f64::max)
}
