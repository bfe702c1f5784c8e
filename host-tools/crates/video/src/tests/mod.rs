//! Tests of the whole way through a table.

mod exactness;
mod fit;
#[cfg(feature = "gpu")]
mod gpu;
mod kinds;
mod live;
mod reference;
mod streams;

use crate::VideoError;
use iltm_picture::{Picture, Samples};
use iltm_runtime::{FrameSize, Grid, image::Table, pipeline::Encoding};
use iltm_tests::made_up::MadeUp;

use super::{CompensateOptions, Compensator, FrameTotals};

fn grid(rows: u16, cols: u16) -> Grid {
    Grid::new(rows, cols).expect("a small grid")
}

fn size(width: u16, height: u16) -> FrameSize {
    FrameSize::new(width, height).expect("not empty")
}

fn settings(encoding: Encoding) -> CompensateOptions {
    CompensateOptions {
        encoding,
        threads: 2,
        ..CompensateOptions::default()
    }
}

/// Random samples, as many as the picture needs.
fn random_picture(size: FrameSize, channels: usize, wide: bool, seed: u64) -> Picture {
    let mut random = fastrand::Rng::with_seed(seed);
    let count = size.pixels() * channels;
    let samples = if wide {
        Samples::Sixteen((0..count).map(|_| random.u16(..)).collect())
    } else {
        Samples::Eight((0..count).map(|_| random.u8(..)).collect())
    };
    Picture::new(size, samples).expect("as many samples as pixels")
}

/// The picture through a table.
fn compensated(
    table: &MadeUp,
    settings: CompensateOptions,
    picture: &Picture,
) -> Result<(Picture, FrameTotals), VideoError> {
    let image = table.image();
    let table = Table::check(&image).expect("a sample table is whole");
    let mut picture = picture.clone();
    let summary = Compensator::new(&table, settings)?.picture(&mut picture)?;
    Ok((picture, summary))
}
