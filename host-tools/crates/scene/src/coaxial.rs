//! Coaxial scenes, whose light transport is known exactly, cell by cell.
//!
//! Folded panels stand along the columns; the projector and the camera look at
//! them from far away along the same direction, so that every cell of the frame
//! is as wide as any other. Two panels that form a valley exchange light by
//! exact form factors; ridges shield valleys from each
//! other. What the surface covers of a cell has one albedo and one brightness:
//!
//! ```text
//! T = (I + M) (I - R F)^-1 R E B
//! ```
//!
//! `R` albedo, `F` form factors, `E` irradiance, `B` the projector's blur, `M`
//! what the camera sees mirrored in glossy panels.

use crate::form_factor::{Tolerance, exchange_area};
use crate::geometry::Polygon;
use iltm_runtime::Grid;
use nalgebra::{DMatrix, DVector, Vector3};

/// What light meets.
#[derive(Clone, Debug)]
pub struct CoaxialScene {
    /// Cells of the projector.
    pub grid: Grid,
    /// Part of each cell that the surface covers.
    pub coverage: DVector<f64>,
    /// Albedo of each cell.
    pub albedo: DVector<f64>,
    /// Irradiance of each cell's covered part under white.
    pub irradiance: DVector<f64>,
    /// `F`, rows sum to at most 1.
    pub form_factors: DMatrix<f64>,
    /// `B`: columns sum to at most 1.
    pub blur: Option<DMatrix<f64>>,
    /// `M`: what each cell shows of others besides its own light.
    pub mirror: Option<DMatrix<f64>>,
}

/// Panels, in units of cells of the frame.
#[derive(Clone, Debug)]
pub struct Panels {
    /// Columns at which panels begin and the last one ends, ascending.
    pub folds: Vec<f64>,
    /// Rows from and to which the panels reach.
    pub rows: (f64, f64),
    /// Angle of each valley, degrees.
    pub wedge: f64,
}

impl Panels {
    /// Four panels, two valleys, as wide and high as the frame.
    #[must_use]
    pub fn m_shape(grid: Grid, wedge: f64) -> Self {
        let (rows, cols) = (grid.rows() as f64, grid.cols() as f64);
        Self {
            folds: [0.0, 0.25, 0.5, 0.75, 1.0]
                .map(|part| (part * cols).round())
                .to_vec(),
            rows: (0.0, rows),
            wedge,
        }
    }

    /// Two panels that fill the frame.
    #[must_use]
    pub fn corner(grid: Grid, wedge: f64) -> Self {
        let cols = grid.cols() as f64;
        Self {
            folds: vec![0.0, (cols / 2.0).round(), cols],
            rows: (0.0, grid.rows() as f64),
            wedge,
        }
    }
}

/// The part of a panel that one cell lights.
struct PanelCell {
    cell: usize,
    panel: usize,
    place: Rectangle,
}

impl CoaxialScene {
    /// Panels of one albedo under even light.
    #[must_use]
    pub fn new(grid: Grid, panels: &Panels, albedo: f64) -> Self {
        let cells = grid.cells();
        let patches = patches(grid, panels);
        let stretch = 1.0 / (panels.wedge / 2.0).to_radians().sin();
        let mut area = DVector::zeros(cells);
        for patch in &patches {
            area[patch.cell] += patch.place.area();
        }
        let mut form_factors = DMatrix::zeros(cells, cells);
        for a in patches.iter().filter(|a| a.panel % 2 == 0) {
            for b in patches.iter().filter(|b| b.panel == a.panel + 1) {
                let light = exchange(&a.place, &b.place, panels.wedge.to_radians());
                form_factors[(a.cell, b.cell)] += light / area[a.cell];
                form_factors[(b.cell, a.cell)] += light / area[b.cell];
            }
        }
        Self {
            grid,
            coverage: area / stretch,
            albedo: DVector::from_element(cells, albedo),
            irradiance: DVector::from_element(cells, 1.0),
            form_factors,
            blur: None,
            mirror: None,
        }
    }

    /// Another albedo in every cell, evenly distributed between two.
    #[must_use]
    pub fn textured(mut self, least: f64, most: f64, seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        self.albedo
            .apply(|albedo| *albedo = least + (most - least) * random.f64());
        self
    }

    /// Cells of both albedos in turn.
    #[must_use]
    pub fn checkered(mut self, least: f64, most: f64) -> Self {
        let cols = self.grid.cols();
        for (cell, albedo) in self.albedo.iter_mut().enumerate() {
            let odd = (cell / cols + cell % cols) % 2 == 1;
            *albedo = if odd { most } else { least };
        }
        self
    }

    /// Light that falls to `corner` in the frame's corners, as `cos^4` does.
    #[must_use]
    pub fn vignetted(mut self, corner: f64) -> Self {
        let (rows, cols) = (self.grid.rows(), self.grid.cols());
        let off = |index: usize, count: usize| (index as f64 + 0.5) / count as f64 - 0.5;
        for (cell, light) in self.irradiance.iter_mut().enumerate() {
            let (y, x) = (off(cell / cols, rows), off(cell % cols, cols));
            // cos^4 falls to `corner` where x^2 + y^2 is 1/2.
            let squared_tangent = (corner.powf(-0.5) - 1.0) * 2.0 * (x * x + y * y);
            *light *= (1.0 + squared_tangent).powi(-2);
        }
        self
    }

    /// A projector out of focus, whose light spreads by `blur`, `N x N`.
    #[must_use]
    pub fn blurred(mut self, blur: DMatrix<f64>) -> Self {
        self.blur = Some(blur);
        self
    }

    /// Cells that are covered by any surface.
    #[must_use]
    pub fn covered(&self) -> Vec<bool> {
        self.coverage.iter().map(|part| *part > 1e-9).collect()
    }

    /// `T`, `N x N`; rows of cells that nothing covers are zero.
    ///
    /// # Panics
    /// If light in the scene grows from bounce to bounce.
    #[must_use]
    pub fn transport(&self) -> DMatrix<f64> {
        let cells = self.grid.cells();
        let mut reflected = self.form_factors.clone();
        for (mut row, albedo) in reflected.row_iter_mut().zip(self.albedo.iter()) {
            row *= *albedo;
        }
        let mut direct = DMatrix::zeros(cells, cells);
        for cell in 0..cells {
            if self.coverage[cell] > 1e-9 {
                direct[(cell, cell)] = self.albedo[cell] * self.irradiance[cell];
            }
        }
        let system = DMatrix::identity(cells, cells) - reflected;
        let mut transport = system.lu().solve(&direct).expect("light fades");
        if let Some(mirror) = &self.mirror {
            transport += mirror * transport.clone();
        }
        match &self.blur {
            Some(blur) => transport * blur,
            None => transport,
        }
    }
}

/// Cuts panels into cells.
fn patches(grid: Grid, panels: &Panels) -> Vec<PanelCell> {
    let stretch = 1.0 / (panels.wedge / 2.0).to_radians().sin();
    let mut patches = Vec::new();
    for (panel, ends) in panels.folds.windows(2).enumerate() {
        // Valleys lie between panels 0 and 1, 2 and 3, and so on.
        let hinge = if panel % 2 == 0 { ends[1] } else { ends[0] };
        for row in 0..grid.rows() {
            let y = (
                panels.rows.0.max(row as f64),
                panels.rows.1.min((row + 1) as f64),
            );
            for col in 0..grid.cols() {
                let x = (ends[0].max(col as f64), ends[1].min((col + 1) as f64));
                if x.1 - x.0 < 1e-9 || y.1 - y.0 < 1e-9 {
                    continue;
                }
                let (a, b) = ((x.0 - hinge).abs() * stretch, (x.1 - hinge).abs() * stretch);
                patches.push(PanelCell {
                    cell: row * grid.cols() + col,
                    panel,
                    place: Rectangle {
                        u: (a.min(b), a.max(b)),
                        y,
                    },
                });
            }
        }
    }
    patches
}

/// A rectangle on a wall of a wedge: a half plane that starts at the hinge, the `y` axis.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Rectangle {
    /// Distance from the hinge, from and to.
    u: (f64, f64),
    /// Place along the hinge, from and to.
    y: (f64, f64),
}

impl Rectangle {
    /// Its area.
    fn area(&self) -> f64 {
        (self.u.1 - self.u.0) * (self.y.1 - self.y.0)
    }
}

/// `A1 F12 = A2 F21` of rectangles on either wall of a wedge of `angle` radians; 0 for
/// one without area.
fn exchange(a: &Rectangle, b: &Rectangle, angle: f64) -> f64 {
    // The walls' fronts face each other.
    let first = [
        (a.u.0, a.y.0),
        (a.u.1, a.y.0),
        (a.u.1, a.y.1),
        (a.u.0, a.y.1),
    ];
    let second = [
        (b.u.0, b.y.0),
        (b.u.0, b.y.1),
        (b.u.1, b.y.1),
        (b.u.1, b.y.0),
    ];
    let first = first.map(|(u, y)| Vector3::new(u, y, 0.0));
    let second = second.map(|(u, y)| Vector3::new(u * angle.cos(), y, u * angle.sin()));
    let walls = (Polygon::new(first.to_vec()), Polygon::new(second.to_vec()));
    match walls {
        (Ok(a), Ok(b)) => exchange_area(&a, &b, Tolerance::default()),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_cell_sends_out_more_than_it_receives_and_light_goes_both_ways() {
        let grid = Grid::new(9, 14).unwrap();
        for wedge in [30.0, 75.0, 90.0] {
            let scene = CoaxialScene::new(grid, &Panels::m_shape(grid, wedge), 0.7);
            for i in 0..grid.cells() {
                assert!(scene.form_factors.row(i).sum() <= 1.0);
                for j in 0..i {
                    let there = scene.coverage[i] * scene.form_factors[(i, j)];
                    let back = scene.coverage[j] * scene.form_factors[(j, i)];
                    assert!((there - back).abs() < 1e-15);
                }
            }
        }
    }
}
