//! Wide frame: the frames of several projectors side by side, from left to right, as one grid of cells,
//! one registration and one map.

use crate::blending::pixel_shares;
use crate::cells::cell_pixels::CellPixels;
use crate::cells::measurements::Measurements;
use crate::cells::pixel_views::PixelViews;
use crate::format::error::CaptureError;
use crate::registration::cell_map::{NO_CELL, Registration};
use crate::registration::projector_map::{MapError, ProjectorMap};
use iltm_picture::FramePart;
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::{FrameSize, Grid};
use std::path::PathBuf;

/// The frames of all projectors side by side.
pub(crate) struct WideFrame {
    pub(crate) grid: Grid,
    /// What was measured of each projector by itself.
    pub(crate) own: Vec<Measurements>,
    /// The cells of each.
    pub(crate) parts: Vec<FramePart>,
    /// Share of each projector at each camera pixel; 0 where it does not reach.
    pub(crate) pixel_shares: Vec<Vec<f32>>,
}

impl WideFrame {
    /// Puts projectors beside each other; `folders` say where their photographs are from.
    ///
    /// # Errors
    /// [`CaptureError::Unlike`] where they do not fit.
    pub(crate) fn new(folders: &[PathBuf], own: Vec<Measurements>) -> Result<Self, CaptureError> {
        let first = &own[0];
        for (folder, other) in folders.iter().zip(&own) {
            let refuse = |reason: String, next_step| {
                Err(CaptureError::Unlike {
                    path: folder.clone(),
                    reason,
                    next_step,
                })
            };
            let camera = |of: &Measurements| (of.registration.camera, of.registration.binning);
            if camera(first) != camera(other) || first.channels.len() != other.channels.len() {
                let reason = format!("other photographs than in {}", folders[0].display());
                return refuse(
                    reason,
                    "Photograph all projectors with one camera that stays.",
                );
            }
            if let Some(reason) = unlike_cells(first, other) {
                let next_step = "Make patterns without a border, with --rows and --cols that divide \
                                 all frames into cells of the same number of pixels.";
                return refuse(reason, next_step);
            }
            if other.diagnostics.images > 0 {
                let reason = "it has photographs of images".to_owned();
                return refuse(reason, "Use Bernoulli patterns for several projectors.");
            }
        }
        let grids = own.iter().map(|own| [own.grid.rows(), own.grid.cols()]);
        let parts = FramePart::side_by_side(grids);
        let grid = FramePart::grid(&parts).ok_or_else(|| {
            let [rows, cols] = FramePart::around(&parts);
            CaptureError::Unlike {
                path: folders[0].clone(),
                reason: format!("{rows} x {cols} cells in all"),
                next_step: "Make patterns with fewer cells.",
            }
        })?;
        Ok(Self {
            pixel_shares: pixel_shares(&own),
            grid,
            own,
            parts,
        })
    }

    /// The cell in the wide frame of a projector's own.
    pub(crate) fn place(&self, projector: usize, cell: usize) -> usize {
        self.parts[projector].place(self.grid.cols(), cell)
    }

    /// The projector of a cell, and its number there; `None` of a cell below a lower frame.
    pub(crate) fn own_cell(&self, cell: usize) -> Option<(usize, usize)> {
        let cols = self.grid.cols();
        let mut parts = self.parts.iter().enumerate();
        parts.find_map(|(projector, part)| Some((projector, part.own(cols, cell)?)))
    }

    /// An entry a cell from those of each projector's own cells; nothing for cells of no projector.
    pub(crate) fn of_cells<T: Default>(&self, of: impl Fn(usize, usize) -> T) -> Vec<T> {
        let of_cell = |cell| {
            let own = self.own_cell(cell);
            own.map_or_else(T::default, |(projector, own)| of(projector, own))
        };
        (0..self.grid.cells()).map(of_cell).collect()
    }

    /// Pixels of all cells, without those that are saturated in the photographs of their projector; one
    /// may be of a cell of each.
    pub(crate) fn pixels(&self, saturated: &[&[bool]]) -> CellPixels {
        let own = self.own.iter().zip(saturated);
        let own: Vec<CellPixels> = own
            .map(|(own, saturated)| CellPixels::choose(&own.registration, saturated))
            .collect();
        CellPixels::joined(&self.of_cells(|projector, cell| Some((&own[projector], cell))))
    }

    /// The projector with the largest share of each camera pixel.
    fn owners(&self) -> Vec<Option<usize>> {
        let shares = &self.pixel_shares;
        let owner = |pixel: usize| {
            let shares = shares.iter().map(|shares| shares[pixel]).enumerate();
            let most = shares.max_by(|(_, a), (_, b)| a.total_cmp(b));
            most.filter(|(_, share)| *share > 0.0)
                .map(|(projector, _)| projector)
        };
        (0..shares[0].len()).map(owner).collect()
    }

    /// Where the cells of all are; a camera pixel is of the projector with the largest share.
    pub(crate) fn registration(&self) -> Registration {
        let owners = self.owners();
        let labels = |of: fn(&Registration) -> &Vec<u32>| {
            let pixels = owners.iter().enumerate();
            let label = |(pixel, owner): (usize, &Option<usize>)| {
                let Some(projector) = *owner else {
                    return NO_CELL;
                };
                match of(&self.own[projector].registration)[pixel] {
                    NO_CELL => NO_CELL,
                    cell => self.place(projector, cell as usize) as u32,
                }
            };
            pixels.map(label).collect()
        };
        Registration {
            cell_of_pixel: labels(|registration| &registration.cell_of_pixel),
            seen_cell: labels(|registration| &registration.seen_cell),
            centre: self.of_cells(|projector, cell| self.own[projector].registration.centre[cell]),
            ..self.own[0].registration.clone()
        }
    }

    /// What pixels see of all projectors, given what they see of the one with the largest share: a pixel
    /// is there for each that it sees.
    pub(crate) fn views(&self, of_owners: &PixelViews) -> PixelViews {
        let owners = self.owners();
        let [width, height] = of_owners.size();
        let of_projector = |(index, own): (usize, &Measurements)| {
            let columns = self.parts[index].columns.start as f32;
            let scale = [
                width as f32 / self.grid.cols() as f32,
                height as f32 / self.grid.rows() as f32,
            ];
            let others = owners
                .iter()
                .enumerate()
                .filter(|(_, owner)| **owner != Some(index));
            let seen = others.filter_map(|(pixel, _)| {
                let map = own.map.as_ref()?.as_ref().ok()?;
                let [x, y] = map.in_cells(map.position[pixel], own.grid);
                let known = x.is_finite() && y.is_finite() && own.registration.is_inside(pixel);
                known.then(|| (pixel as u32, [(x + columns) * scale[0], y * scale[1]]))
            });
            seen.collect::<Vec<_>>()
        };
        let others = self.own.iter().enumerate().flat_map(of_projector);
        of_owners.after(others)
    }

    /// Why a projector has no map, if its stripes give none.
    pub(crate) fn without_map(&self) -> Option<&MapError> {
        let mut maps = self.own.iter().filter_map(|own| own.map.as_ref());
        maps.find_map(|map| map.as_ref().err())
    }

    /// The projector map of each, if all have one.
    pub(crate) fn maps(&self) -> Option<Vec<&ProjectorMap>> {
        let maps = self.own.iter().map(|own| own.map.as_ref()?.as_ref().ok());
        maps.collect()
    }

    /// The projector map of the wide frame, if all projectors have one.
    pub(crate) fn map(&self) -> Option<ProjectorMap> {
        let maps = self.maps()?;
        let frame = wide_size(&maps)?;
        let mut before = Vec::new();
        let mut pixels = 0;
        for map in &maps {
            before.push(pixels as f32);
            pixels += map.projector.size().width();
        }
        let unknown = ([f32::NAN; 2], f32::NAN);
        let place = |(pixel, owner): (usize, Option<usize>)| {
            owner.map_or(unknown, |projector| {
                let [x, y] = maps[projector].position[pixel];
                let place = [x + before[projector], y];
                (place, maps[projector].uncertainty[pixel])
            })
        };
        let (position, uncertainty) = self.owners().into_iter().enumerate().map(place).unzip();
        Some(ProjectorMap {
            projector: ProjectorPixels::new(frame, 0)?,
            position,
            uncertainty,
            ..maps[0].clone()
        })
    }
}

/// Why the cells of two projectors do not fit into one grid.
fn unlike_cells(first: &Measurements, other: &Measurements) -> Option<String> {
    let pixels = |of: &Measurements| {
        let pixels = of.settings.projector.pixels()?;
        Some((pixels.border(), pixels.size(), of.grid))
    };
    let ((own_border, own, grid), (border, size, cells)) = match (pixels(first), pixels(other)) {
        // Of slides with a pixel a cell, cells are alike.
        (None, None) => return None,
        (Some(own), Some(other)) => (own, other),
        _ => return Some("the size is known of some projectors, and not of others".to_owned()),
    };
    if own_border.max(border) > 0 {
        return Some("a border lies around the cells".to_owned());
    }
    let whole = |size: FrameSize, grid: Grid| size.width().is_multiple_of(grid.cols());
    let alike = |size: usize, cells: usize, others: usize, by: usize| size * by == others * cells;
    let fits = whole(own, grid)
        && whole(size, cells)
        && alike(own.width(), grid.cols(), size.width(), cells.cols())
        && alike(own.height(), grid.rows(), size.height(), cells.rows());
    let of_cell = |size: FrameSize, grid: Grid| {
        let side = |pixels: usize, cells: usize| (100 * pixels / cells) as f64 / 100.0;
        let across = side(size.width(), grid.cols());
        format!("{across} x {}", side(size.height(), grid.rows()))
    };
    (!fits).then(|| {
        let (found, must) = (of_cell(size, cells), of_cell(own, grid));
        format!("its cells have {found} pixels, those of the first {must}")
    })
}

/// Pixels of frames side by side; `None` if no frame has so many.
pub(crate) fn wide_size(maps: &[&ProjectorMap]) -> Option<FrameSize> {
    let sizes = maps.iter().map(|map| map.projector.size());
    let parts = FramePart::side_by_side(sizes.map(|size| [size.height(), size.width()]));
    let [height, width] = FramePart::around(&parts);
    FrameSize::new(width.try_into().ok()?, height.try_into().ok()?)
}

/// Where a camera pixel lies in a projector's picture, in cells from the left and upper edge of the
/// first; `None` where the projector does not reach.
pub(crate) fn place(own: &Measurements, pixel: usize) -> Option<[f32; 2]> {
    let grid = own.grid;
    if let Some(Ok(map)) = &own.map {
        let place = map.position[pixel];
        if place.iter().all(|side| side.is_finite()) {
            return Some(map.in_cells(place, grid));
        }
    }
    let cell = own.registration.seen_cell[pixel];
    let cell = (cell != NO_CELL).then_some(cell as usize)?;
    let centre = |at: usize| at as f32 + 0.5;
    Some([centre(cell % grid.cols()), centre(cell / grid.cols())])
}
