//! Report pages: what was learned of a scene, in files that a browser shows without
//! network.
//!
//! | what | file |
//! |---|---|
//! | what a photograph of a projection would show | `predict.rs` |
//! | how far it is from what was wanted | `comparison.rs` |
//! | a wanted image with and without compensation | `example.rs` |
//! | the operator in the Haar domain | `coefficient_map.rs` |
//! | what each tier costs | `ladder.rs` |
//! | one picture of it all | `files.rs` |
//! | pictures as PNG files, one of a few colours | `files.rs` |
//! | what the solve says about itself | `facts.rs` |
//! | what the gates say, a page of its own | `gates.rs`, `gates.css` |
//! | the page | `page.rs` |
//! | pages of a solve and of its trade-off, with more | [`solve_page`], [`tradeoff`] |
//! | a photograph bounce by bounce | [`bounces`] |
//! | test images | [`stills`] |

pub mod bounces;
mod coefficient_map;
mod comparison;
mod example;
mod facts;
mod files;
pub mod gates;
mod ladder;
pub(crate) mod page;
mod predict;
pub mod solve_page;
pub mod stills;
#[cfg(test)]
#[path = "../../compile/src/test_scene.rs"]
mod test_scene;
pub mod tradeoff;

pub use coefficient_map::{CoefficientMap, MapLevel};
pub use comparison::Comparison;
pub use example::{Example, TreatedImage, Treatment, Wanted};
pub use ladder::{TierCost, TimedTier, ladder, microseconds, microseconds_at, tier_costs};
pub use page::{Command, Words};
pub use predict::Projection;

use iltm_compile::build_table::BuiltTable;
use iltm_picture::{
    ColourScale, LightPicture, Palette, Picture, html::PictureFile, progress::Progress,
    statistics::quantile,
};
use iltm_runtime::{
    FrameSize,
    image::{ImageError, Table},
    pipeline::FrameError,
};
use iltm_video::VideoError;

/// Share of the flood photograph's pixels that may be brighter than the white of
/// its picture: glints would otherwise darken all else.
const GLINTS: f64 = 0.002;

/// Share of the pixels of the gain-only error maps that may be beyond the colour
/// scale.
const BEYOND_SCALE: f64 = 0.005;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The table is not the one that was compiled.
    #[error("the table cannot be read back: {0}")]
    Table(ImageError),
    /// A wanted image does not suit the table.
    #[error("the wanted image `{name}` cannot be shown: {source}")]
    Wanted {
        /// Its name.
        name: &'static str,
        /// What is wrong with it.
        source: VideoError,
    },
    /// A wanted image has another size or number of channels than the table can
    /// show.
    #[error("the wanted image `{name}` has {size}, which the table cannot show")]
    Size {
        /// Its name.
        name: &'static str,
        /// Its size.
        size: FrameSize,
    },
    /// The tiers could not be timed.
    #[error("the tiers cannot be timed: {0}")]
    Timing(FrameError),
}

/// Everything that a page shows, computed.
#[derive(Debug)]
pub struct Report<'a> {
    /// What was learned.
    pub learned: &'a BuiltTable,
    /// The wanted images.
    pub examples: Vec<Example>,
    /// Colours of all error maps.
    pub errors: ColourScale,
    /// The operator.
    pub coefficients: CoefficientMap,
    /// The tiers, gain only first.
    pub ladder: Vec<TimedTier>,
    /// All pictures: those of the page, and the summary.
    pub files: Vec<PictureFile>,
}

impl<'a> Report<'a> {
    /// Predicts how the wanted images would look, and draws everything else.
    ///
    /// # Errors
    /// [`ReportError`] if a wanted image is smaller than the grid or has another
    /// number of channels than the table.
    pub fn new(
        learned: &'a BuiltTable,
        wanted: Vec<Wanted>,
        progress: &dyn Progress,
    ) -> Result<Self, ReportError> {
        let table = Table::check(&learned.compiled.image).map_err(ReportError::Table)?;
        let projector = &learned.measurements.devices.projector;
        let white = learned.compiled.white;
        progress.begin("predicting photographs", wanted.len() as u64);
        let mut examples = Vec::new();
        for wanted in wanted {
            let (name, size) = (wanted.name, wanted.picture.size());
            let channels = wanted.picture.channels();
            let projection = Projection::new(&table, &learned.inverse, white, size)
                .filter(|_| channels == usize::from(table.channels()))
                .ok_or(ReportError::Size { name, size })?;
            let example = Example::new(&table, &projection, projector, wanted);
            examples.push(example.map_err(|source| ReportError::Wanted { name, source })?);
            progress.advance(1);
        }
        progress.end();
        progress.begin("timing the tiers", 0);
        let ladder = ladder(&table).map_err(ReportError::Timing)?;
        progress.end();
        let errors = ColourScale::linear(Palette::Magma, largest_error(&examples));
        let coefficients = CoefficientMap::new(&learned.inverse);
        progress.begin("drawing the pictures", 0);
        let files = files::encode(flood(learned), &coefficients, &examples, &errors);
        progress.end();
        Ok(Self {
            learned,
            examples,
            errors,
            coefficients,
            ladder,
            files,
        })
    }
}

/// The flood photograph, black subtracted, as bright as a screen can show it;
/// `None` of a camera whose sides a frame's do not reach.
fn flood(learned: &BuiltTable) -> Option<Picture> {
    let (width, height) = learned.measurements.registration.camera;
    let size = frame_size(width, height)?;
    let flood = LightPicture::new(size, learned.measurements.flood.clone())?;
    let white = flood.quantile(1.0 - GLINTS);
    let scale = if white > 0.0 { 1.0 / white } else { 0.0 };
    Some(flood.scaled(scale).for_display())
}

/// A round number that nearly all errors stay below once each pixel has its gain.
/// Without any compensation errors are so much larger that a scale for them would
/// hide all others.
fn largest_error(examples: &[Example]) -> f64 {
    let shown = examples.iter().flat_map(|example| &example.shown);
    let shown = shown.filter(|shown| shown.treatment == Treatment::GainOnly);
    let mut errors: Vec<f32> = shown
        .flat_map(|shown| &shown.comparison.map)
        .copied()
        .collect();
    let high = quantile(&mut errors, 1.0 - BEYOND_SCALE).map_or(0.0, f64::from);
    let high = high.max(1e-3);
    let power = 10_f64.powf(high.log10().floor());
    // Ends that a tick falls on.
    let ends = [1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0].map(|digit| digit * power);
    ends.into_iter().find(|end| *end >= high).unwrap_or(high)
}

/// `None` of more than 65,535 pixels a side.
fn frame_size(width: usize, height: usize) -> Option<FrameSize> {
    FrameSize::new(u16::try_from(width).ok()?, u16::try_from(height).ok()?)
}
