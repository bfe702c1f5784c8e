//! Camera places of a wide frame: where the camera that took several projectors' captures sees each of
//! their pixels, and how much light their white made. Pictures that are drawn on the camera's picture
//! look the same in every projector's part of the frame.

use crate::cells::cell_pixels::CellPixels;
use crate::format::error::CaptureError;
use crate::format::sequence::CaptureOptions;
use crate::gate::GateName;
use crate::registration::correspondence::{self, Correspondence};
use crate::remeasure::CellPlanes;
use crate::several::{as_the_first, check_once};
use crate::wide_frame::{WideFrame, wide_size};
use iltm_picture::{FramePart, progress::Progress};
use iltm_runtime::{FrameSize, Grid};
use std::path::PathBuf;

/// Where a camera sees the pixels of a wide frame.
#[derive(Clone, Debug)]
pub struct CameraPlaces {
    /// Cells of the wide frame.
    pub grid: Grid,
    /// Pixels of the wide frame.
    pub frame: FrameSize,
    /// The cells of each projector.
    pub parts: Vec<FramePart>,
    /// Place of each pixel of the wide frame in the camera's picture, `[x, y]` with the centre of its
    /// first pixel at `[0, 0]`, row by row; `None` where the camera does not see it.
    pub places: Vec<Option<[f32; 2]>>,
    /// Side of a cell in the camera's pixels.
    pub cell_side: f64,
    /// Light of each cell under white of all projectors, ambient light included, camera units; 0 where a
    /// cell was not measured.
    pub white: CellPlanes,
    /// Pixels of two projectors that light one place.
    pub correspondences: Vec<Correspondence>,
}

/// Reads captures of several projectors, from left to right in the wide frame, for the places alone:
/// gates are not looked at.
///
/// # Errors
/// Those of [`read_several`](crate::read_several); [`CaptureError::Unlike`] where a capture has no
/// stripes finer than the cells.
pub fn camera_places(
    folders: &[PathBuf],
    progress: &dyn Progress,
) -> Result<CameraPlaces, CaptureError> {
    check_once(folders)?;
    let options = CaptureOptions {
        ignore: GateName::ALL.to_vec(),
        ..CaptureOptions::default()
    };
    let (mut own, mut linear) = (Vec::new(), Vec::new());
    for folder in folders {
        let (measurements, (_, mut photographs, _)) =
            crate::read_keeping(folder, &options, as_the_first(&own), progress)?;
        photographs.photographs.forget();
        own.push(measurements);
        linear.push(photographs);
    }
    let wide = WideFrame::new(folders, own)?;
    for (folder, own) in folders.iter().zip(&wide.own) {
        let (reason, next_step) = match &own.map {
            Some(Ok(_)) => continue,
            Some(Err(error)) => (error.to_string(), error.next_step()),
            None => (
                "it has no stripes finer than the cells".to_owned(),
                "Make the captures with `iltm patterns`, which has them unless --no-dense is given.",
            ),
        };
        return Err(CaptureError::Unlike {
            path: folder.clone(),
            reason,
            next_step,
        });
    }
    let maps = wide.maps().unwrap_or_default();
    let frame = wide_size(&maps).ok_or_else(|| CaptureError::Unlike {
        path: folders[0].clone(),
        reason: "its frame and those beside it have more pixels than any".to_owned(),
        next_step: "Use projectors of fewer pixels.",
    })?;
    let inverse: Vec<_> = maps.iter().map(|map| map.inverse()).collect();
    let row = |row: usize| {
        let each = maps.iter().zip(&inverse);
        each.flat_map(move |(map, places)| {
            let width = map.projector.size().width();
            // Below a lower frame there is nothing to see.
            (row * width..(row + 1) * width).map(|at| places.get(at).copied().flatten())
        })
    };
    let saturated: Vec<&[bool]> = linear.iter().map(|linear| &linear.saturated[..]).collect();
    let pixels = wide.pixels(&saturated);
    let black = linear.iter().map(|linear| &linear.black[..]);
    let flood = wide.own.iter().map(|own| &own.flood[..]);
    Ok(CameraPlaces {
        places: (0..frame.height()).flat_map(row).collect(),
        cell_side: wide.registration().cell_side(),
        correspondences: correspondence::find(&maps, &inverse),
        white: white(&pixels, flood, black),
        grid: wide.grid,
        frame,
        parts: wide.parts,
    })
}

/// Light of the cells under white of all projectors: what each adds, and the mean of black.
fn white<'p>(
    pixels: &CellPixels,
    floods: impl Iterator<Item = &'p [Vec<f32>]>,
    blacks: impl ExactSizeIterator<Item = &'p [Vec<f32>]>,
) -> CellPlanes {
    let share = 1.0 / blacks.len().max(1) as f64;
    let mut white: CellPlanes = Vec::new();
    let weighted = floods.map(|planes| (planes, 1.0));
    for (planes, weight) in weighted.chain(blacks.map(|planes| (planes, share))) {
        white.resize(planes.len(), vec![0.0; pixels.live.len()]);
        for (sum, plane) in white.iter_mut().zip(planes) {
            let light = pixels.mean(plane).into_iter();
            sum.iter_mut()
                .zip(light)
                .for_each(|(sum, light)| *sum += weight * light);
        }
    }
    white
}
