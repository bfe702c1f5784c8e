//! Wanted image: how it is treated, and what is predicted of each treatment on the wall.

use super::{Comparison, Projection};
use iltm_picture::{LightPicture, Picture, ProjectorResponse, Response};
use iltm_runtime::image::Table;
use iltm_video::{CompensateOptions, Compensator, VideoError};

/// An image to be projected.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// Short name for files: lower-case letters and `-`.
    pub name: &'static str,
    /// What it is, for people.
    pub title: String,
    /// What to look for in it.
    pub remark: String,
    /// Its sRGB codes, three channels a pixel or one as the table has.
    pub picture: Picture,
}

/// What is done to a wanted image before it is projected.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Treatment {
    /// Nothing.
    None,
    /// Gains and ambient: tier 0.
    GainOnly,
    /// The table's top tier.
    Compensated,
}

impl Treatment {
    /// All, least first.
    pub const ALL: [Self; 3] = [Self::None, Self::GainOnly, Self::Compensated];

    /// Short name for files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "uncompensated",
            Self::GainOnly => "gain-only",
            Self::Compensated => "compensated",
        }
    }

    /// What it is, for people.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::None => "Without compensation",
            Self::GainOnly => "Gain only",
            Self::Compensated => "Compensated",
        }
    }
}

/// A treated image and the photograph that it is predicted to give.
#[derive(Clone, Debug)]
pub struct TreatedImage {
    /// What was done.
    pub treatment: Treatment,
    /// Projector input, codes for the projector.
    pub input: Picture,
    /// Share of the input's samples that were clipped: at black, and at white.
    pub clipped: [f64; 2],
    /// The photograph relative to reference white, at [`Comparison::scale`].
    pub photograph: LightPicture,
    /// How far it is from the wanted image.
    pub comparison: Comparison,
}

/// A wanted image under every treatment.
#[derive(Clone, Debug)]
pub struct Example {
    /// The image.
    pub wanted: Wanted,
    /// In the order of [`Treatment::ALL`].
    pub shown: Vec<TreatedImage>,
    /// Light that the compensated photograph would have too much of without the
    /// operator: what arrives by way of other cells.
    pub bounced: LightPicture,
}

impl Example {
    /// Treats and predicts. `projection` is of the picture's size; `projector` is
    /// the response of the projector that the table was made for.
    ///
    /// # Errors
    /// [`VideoError`] if the picture does not suit the table.
    pub fn new(
        table: &Table<'_>,
        projection: &Projection,
        projector: &ProjectorResponse,
        wanted: Wanted,
    ) -> Result<Self, VideoError> {
        let light = LightPicture::decode(&wanted.picture, Response::Srgb);
        let light = light.raised(table.black().to_num());
        let mut shown = Vec::new();
        for treatment in Treatment::ALL {
            let mut input = wanted.picture.clone();
            let tier = match treatment {
                Treatment::None => None,
                Treatment::GainOnly => Some(0),
                Treatment::Compensated => Some(table.top_tier()),
            };
            let mut clipped = [0.0; 2];
            if tier.is_some() {
                let settings = CompensateOptions {
                    tier,
                    ..CompensateOptions::default()
                };
                let summary = Compensator::new(table, settings)?.picture(&mut input)?;
                let white = summary.clipped_white;
                clipped = [summary.clipped - white, white]
                    .map(|count| count as f64 / summary.samples.max(1) as f64);
            }
            let drive = LightPicture::decode(&input, projector.clone());
            let photograph = projection.photograph(&drive);
            let comparison = Comparison::new(&photograph, &light);
            shown.push(TreatedImage {
                treatment,
                input,
                clipped,
                photograph: photograph.scaled(comparison.scale),
                comparison,
            });
        }
        let bounced = projection.bounced(&light);
        Ok(Self {
            wanted,
            shown,
            bounced,
        })
    }

    /// How much brighter a picture of [`bounced`](Self::bounced) can be: a whole
    /// number.
    #[must_use]
    pub fn brightening(&self) -> f64 {
        let brightest = self.bounced.quantile(0.995);
        if brightest > 0.0 {
            (1.0 / brightest).floor().clamp(1.0, 100.0)
        } else {
            1.0
        }
    }
}
