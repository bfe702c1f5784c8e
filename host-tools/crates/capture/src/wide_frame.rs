//! Wide frame: the frames of several projectors side by side, from left to right, as one grid of cells,
//! one registration and one map.

use crate::blending::pixel_shares;
use crate::cells::cell_pixels::CellPixels;
use crate::cells::measurements::Measurements;
use crate::cells::pixel_views::PixelViews;
use crate::format::error::CaptureError;
use crate::registration::cell_map::{NO_CELL, Registration};
use crate::registration::projector_map::{MapError, ProjectorMap};
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::{FrameSize, Grid};
use std::ops::Range;
use std::path::PathBuf;

/// The frames of all projectors side by side.
pub(crate) struct WideFrame {
    pub(crate) grid: Grid,
    /// What was measured of each projector by itself.
    pub(crate) own: Vec<Measurements>,
    /// Columns of cells of each.
    pub(crate) columns: Vec<Range<usize>>,
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
            if first.grid.rows() != other.grid.rows() {
                let (rows, others) = (first.grid.rows(), other.grid.rows());
                let reason = format!("{others} rows of cells beside {rows}");
                return refuse(
                    reason,
                    "Make patterns with the same --rows for all projectors.",
                );
            }
            let cell = |of: &Measurements| {
                let pixels = of.settings.projector.pixels()?;
                let (inner, grid) = (pixels.inner(), of.grid);
                let whole = pixels.border() == 0 && inner.width() % grid.cols() == 0;
                let width = whole.then(|| inner.width() / grid.cols());
                Some((width, inner.height()))
            };
            let fits = matches!(cell(other), None | Some((Some(_), _)));
            if cell(first) != cell(other) || !fits {
                let reason = "its cells have not as many pixels as those of the others, or a \
                              border lies around them"
                    .to_owned();
                let next_step = "Use projectors of one height without a border, and columns that \
                                 divide their widths into cells of the same number of pixels.";
                return refuse(reason, next_step);
            }
            if other.diagnostics.images > 0 {
                let reason = "it has photographs of images".to_owned();
                return refuse(reason, "Use Bernoulli patterns for several projectors.");
            }
        }
        let mut columns = Vec::new();
        let mut cols = 0;
        for own in &own {
            columns.push(cols..cols + own.grid.cols());
            cols += own.grid.cols();
        }
        let side = |side: usize| u16::try_from(side).unwrap_or(u16::MAX);
        let grid =
            Grid::new(side(first.grid.rows()), side(cols)).map_err(|_| CaptureError::Unlike {
                path: folders[0].clone(),
                reason: format!("{} x {cols} cells in all", first.grid.rows()),
                next_step: "Make patterns with fewer cells.",
            })?;
        Ok(Self {
            pixel_shares: pixel_shares(&own),
            grid,
            own,
            columns,
        })
    }

    /// The cell in the wide frame of a projector's own.
    pub(crate) fn place(&self, projector: usize, cell: usize) -> usize {
        let cols = self.own[projector].grid.cols();
        cell / cols * self.grid.cols() + self.columns[projector].start + cell % cols
    }

    /// The projector of a cell, and its number there.
    pub(crate) fn own_cell(&self, cell: usize) -> (usize, usize) {
        let (row, col) = (cell / self.grid.cols(), cell % self.grid.cols());
        let projector = self.columns.iter().position(|all| all.contains(&col));
        let projector = projector.expect("all columns are a projector's");
        let columns = &self.columns[projector];
        (projector, row * columns.len() + col - columns.start)
    }

    /// An entry a cell from those of each projector's own cells.
    pub(crate) fn of_cells<T>(&self, of: impl Fn(usize, usize) -> T) -> Vec<T> {
        let cells = 0..self.grid.cells();
        cells
            .map(|cell| {
                let (projector, own) = self.own_cell(cell);
                of(projector, own)
            })
            .collect()
    }

    /// Pixels of all cells, without those that are saturated in the photographs of their projector; one
    /// may be of a cell of each.
    pub(crate) fn pixels(&self, saturated: &[&[bool]]) -> CellPixels {
        let own = self.own.iter().zip(saturated);
        let own: Vec<CellPixels> = own
            .map(|(own, saturated)| CellPixels::choose(&own.registration, saturated))
            .collect();
        CellPixels::joined(&self.of_cells(|projector, cell| (&own[projector], cell)))
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
            let columns = self.columns[index].start as f32;
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

/// Pixels of frames side by side; `None` if no frame has so many.
pub(crate) fn wide_size(maps: &[&ProjectorMap]) -> Option<FrameSize> {
    let sizes = maps.iter().map(|map| map.projector.size());
    let width: usize = sizes.clone().map(FrameSize::width).sum();
    let height = sizes.map(FrameSize::height).next()?;
    FrameSize::new(u16::try_from(width).ok()?, u16::try_from(height).ok()?)
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
