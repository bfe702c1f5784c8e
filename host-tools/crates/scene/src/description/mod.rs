//! Scene description, checked: panels, projector, camera, ambient light.
//!
//! ```text
//! file       scene.toml as it is written
//! mesh       panels from OBJ files
//! texture    albedo from pictures
//! error      what can be wrong with them
//! ```
//!
//! Lengths are in metres, angles in degrees. Light is relative to what the
//! projector's white throws onto a surface that faces it at the place it looks at;
//! a perfect white surface there sends back 1.

mod error;
mod file;
mod load;
mod mesh;
mod texture;

pub use error::{SceneError, SceneProblem};
pub use mesh::{MeshError, parse as parse_mesh};
pub use texture::Texture;

use super::geometry::Polygon;
use super::pinhole::Pinhole;
use iltm_picture::{FramePart, Response};
use iltm_runtime::{FrameSize, Grid};
use nalgebra::{Vector2, Vector3};
use serde::Deserialize;

/// A scene and who looks at it.
#[derive(Clone, Debug)]
pub struct Scene {
    /// For people; `None` if the file names none.
    pub name: Option<String>,
    /// What lights it, at least one. Their frames stand side by side, from left to right, and
    /// make one frame.
    pub projectors: Vec<Projector>,
    /// What photographs it.
    pub camera: Camera,
    /// Where else the camera may stand.
    pub poses: Vec<Pose>,
    /// Light from all around, by channel: what a surface with nothing in view gets,
    /// and what the camera sees beside the scene.
    pub ambient: [f64; 3],
    /// Its surfaces, at least one.
    pub panels: Vec<Panel>,
}

/// The projector.
#[derive(Clone, Debug)]
pub struct Projector {
    /// What it is called by, none of the others' and no number; `None` for its number alone.
    pub name: Option<String>,
    /// Where it stands and what it looks at.
    pub view: Pinhole,
    /// Its cells, spread evenly over the frame.
    pub grid: Grid,
    /// From input values to light; photographs of patterns do not depend on it.
    pub response: Response,
    /// Light lost in the corners of the frame, as a share: it falls off with the
    /// square of the distance from the centre.
    pub vignetting: f64,
    /// Standard deviation of the Gaussian that a point of the frame becomes,
    /// cells.
    pub blur: f64,
    /// Light of black, as a share of white.
    pub black: f64,
    /// Light that the lamp has lost at the end of a session of photographs, as a
    /// share: most of it early, as a lamp does that was switched on just before.
    pub drift: f64,
    /// Light of each of the projector's channels (columns) in each of the camera's
    /// (rows).
    pub mixing: [[f64; 3]; 3],
}

/// The camera.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Where it stands and what it looks at.
    pub view: Pinhole,
    /// Pixels across and down.
    pub size: (u32, u32),
    /// Share of full scale that the bright parts of a flood photograph reach: its
    /// 99.5th percentile.
    pub white: f64,
    /// Electrons at full scale, which make shot noise; `None` for a camera without.
    pub full_well: Option<f64>,
    /// Noise of reading a pixel, electrons.
    pub read_noise: f64,
    /// Bits of its converter; `None` for as many as the file has.
    pub bits: Option<u8>,
    /// From light to the file's values.
    pub response: Response,
    /// Radial distortion of the lens; see [`Camera::ray`].
    pub distortion: [f64; 2],
}

impl Projector {
    /// [`Projector::mixing`] of a camera that sees each channel by itself.
    pub const UNMIXED: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// Largest share of a camera channel's light that comes from the two of the
    /// projector's channels that it is not named after.
    #[must_use]
    pub fn foreign_light(&self) -> f64 {
        let of = |(channel, row): (usize, &[f64; 3])| {
            let all: f64 = row.iter().sum();
            (all - row[channel]) / all
        };
        self.mixing.iter().enumerate().map(of).fold(0.0, f64::max)
    }
}

impl Camera {
    /// The way from the pinhole to what is seen at a place in the photograph, of
    /// depth 1, through a lens with `distortion` `[a, b]`: what is seen at the distance
    /// `r` from the centre (in half widths) would be at `r (1 + a r^2 + b r^4)` without
    /// it. A positive `a` makes a barrel of a square.
    #[must_use]
    pub fn ray(&self, across: f64, down: f64, distortion: [f64; 2]) -> Vector3<f64> {
        let [across, down] = self.undistorted([across, down], distortion);
        self.view.ray(across, down)
    }

    /// Where a place in the photograph would be without `distortion`.
    #[must_use]
    pub fn undistorted(&self, [across, down]: [f64; 2], [a, b]: [f64; 2]) -> [f64; 2] {
        let shape = f64::from(self.size.1) / f64::from(self.size.0);
        let (x, y) = (2.0 * across - 1.0, (2.0 * down - 1.0) * shape);
        let r2 = x * x + y * y;
        let farther = 1.0 + r2 * (a + b * r2);
        [across, down].map(|place| 0.5 + (place - 0.5) * farther)
    }

    /// Whether the lens displaces anything.
    #[must_use]
    pub fn distorts(&self) -> bool {
        self.distortion.iter().any(|term| term.abs() > 0.0)
    }

    /// Most pixels by which the lens displaces anything in the photograph.
    #[must_use]
    pub fn most_displaced(&self) -> f64 {
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        let of = |place: [f64; 2]| {
            let [across, down] = self.undistorted(place, self.distortion);
            ((across - place[0]) * width).hypot((down - place[1]) * height)
        };
        // Not only in the corner: the two terms may cancel there.
        let along = (0..=16).map(|k| 0.5 * f64::from(k) / 16.0);
        along.map(|d| of([0.5 + d, 0.5 + d])).fold(0.0, f64::max)
    }
}

/// A further place of the camera.
#[derive(Clone, Debug)]
pub struct Pose {
    /// What it is called by, none of the others' and no number; `None` for its number alone.
    pub name: Option<String>,
    /// Where the camera stands and what it looks at.
    pub view: Pinhole,
}

/// A named part of the scene with one surface.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Its name, or `panel 3`.
    pub name: String,
    /// Its flat parts.
    pub facets: Vec<Facet>,
    /// Share of light that it sends back in all directions alike.
    pub albedo: Albedo,
    /// Light that it sends back around the mirror direction, if it is glossy.
    pub gloss: Option<Gloss>,
    /// Share of light that it sends back as a mirror.
    pub mirror: f64,
}

/// A flat part of a panel.
#[derive(Clone, Debug)]
pub struct Facet {
    /// Where it is.
    pub polygon: Polygon,
    /// Where each corner is in the panel's texture: from the left and from the top, 0
    /// to 1.
    pub texture: Vec<Vector2<f64>>,
}

/// Diffuse reflectance, by channel.
#[derive(Clone, Debug)]
pub enum Albedo {
    /// The same everywhere.
    Uniform([f64; 3]),
    /// From a picture.
    Texture(Texture),
}

/// A lobe around the mirror direction: the energy-conserving form of Phong's,
/// `reflectance (n + 2) / (2 pi) cos^n` (Lafortune, Willems, *Using the modified
/// Phong reflectance model for physically based rendering*, 1994).
#[derive(Clone, Copy, PartialEq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gloss {
    /// Share of light in the lobe at normal incidence.
    pub reflectance: f64,
    /// The exponent `n`: a lobe of about `1 / sqrt n` radians.
    pub exponent: f64,
}

impl Facet {
    /// Where a point of the facet is in the texture.
    #[must_use]
    pub fn texture_place(&self, world: &Vector3<f64>) -> Vector2<f64> {
        let corners = self.polygon.corners();
        let normal = self.polygon.normal();
        let mut best = (f64::NEG_INFINITY, self.texture[0]);
        for k in 1..corners.len() - 1 {
            let [a, b, c] = [corners[0], corners[k], corners[k + 1]];
            let doubled = (b - a).cross(&(c - a)).dot(&normal);
            let share = |p: Vector3<f64>, q: Vector3<f64>| {
                (p - world).cross(&(q - world)).dot(&normal) / doubled
            };
            let weights = [share(b, c), share(c, a), share(a, b)];
            let least = weights.iter().copied().fold(f64::INFINITY, f64::min);
            if least > best.0 {
                let place = self.texture[0] * weights[0]
                    + self.texture[k] * weights[1]
                    + self.texture[k + 1] * weights[2];
                best = (least, place);
            }
        }
        best.1
    }
}

impl Albedo {
    /// Albedo at a point of a facet.
    #[must_use]
    pub fn at(&self, facet: &Facet, world: &Vector3<f64>) -> [f64; 3] {
        match self {
            Self::Uniform(channels) => *channels,
            Self::Texture(texture) => texture.at(facet.texture_place(world)),
        }
    }

    /// The largest in any place, by channel.
    #[must_use]
    pub fn largest(&self) -> [f64; 3] {
        match self {
            Self::Uniform(channels) => *channels,
            Self::Texture(texture) => texture.largest(),
        }
    }
}

/// The index of what has this name, or this number, counted from 1.
fn called<'n>(
    names: impl ExactSizeIterator<Item = &'n Option<String>>,
    name: &str,
) -> Option<usize> {
    let count = names.len();
    let mut names = names;
    let named = names.position(|one| one.as_deref() == Some(name));
    named.or_else(|| {
        name.parse::<usize>()
            .ok()?
            .checked_sub(1)
            .filter(|index| *index < count)
    })
}

/// Each one's name, or its number, counted from 1.
fn names<'n>(names: impl Iterator<Item = &'n Option<String>>) -> Vec<String> {
    let numbered = (1_usize..).zip(names);
    let named = |(number, name): (usize, &Option<String>)| {
        name.clone().unwrap_or_else(|| number.to_string())
    };
    numbered.map(named).collect()
}

/// The part that each projector has of the frame of all.
fn parts(projectors: &[Projector]) -> Vec<FramePart> {
    let grids = projectors
        .iter()
        .map(|one| [one.grid.rows(), one.grid.cols()]);
    FramePart::side_by_side(grids)
}

impl Scene {
    /// Cells of the frame of all projectors side by side.
    #[must_use]
    pub fn grid(&self) -> Grid {
        // What reads scenes has made sure that there is such a grid.
        FramePart::grid(&self.parts()).unwrap_or(self.projectors[0].grid)
    }

    /// The part of [`grid`](Self::grid) that each projector has.
    #[must_use]
    pub fn parts(&self) -> Vec<FramePart> {
        parts(&self.projectors)
    }

    /// The index of the projector of this name, or of this number, counted from 1; `None` if
    /// there is none.
    #[must_use]
    pub fn projector_called(&self, name: &str) -> Option<usize> {
        called(self.projectors.iter().map(|one| &one.name), name)
    }

    /// The index of the further place of the camera of this name, or of this number, counted from 1;
    /// `None` if there is none.
    #[must_use]
    pub fn pose_called(&self, name: &str) -> Option<usize> {
        called(self.poses.iter().map(|one| &one.name), name)
    }

    /// What each further place of the camera is called: its name, or its number, counted from 1.
    #[must_use]
    pub fn pose_names(&self) -> Vec<String> {
        names(self.poses.iter().map(|one| &one.name))
    }

    /// The same scene with its camera at one of its further places.
    ///
    /// # Panics
    /// If there is none with this index.
    #[must_use]
    pub fn from_pose(&self, index: usize) -> Self {
        let mut scene = self.clone();
        scene.camera.view = scene.poses[index].view.clone();
        scene
    }

    /// What each projector is called: its name, or its number, counted from 1.
    #[must_use]
    pub fn projector_names(&self) -> Vec<String> {
        names(self.projectors.iter().map(|one| &one.name))
    }

    /// The part of a frame of this size that each projector has; `None` if a pixel would be shared.
    #[must_use]
    pub fn parts_of(&self, frame: FrameSize) -> Option<Vec<FramePart>> {
        let grid = self.grid();
        let parts = self.parts().into_iter();
        parts.map(|part| part.pixels(grid, frame)).collect()
    }

    /// Light from all around, by channel, that is added to that of the projector with this index:
    /// to the first one's, so that it is added once.
    #[must_use]
    pub(crate) fn ambient_beside(&self, projector: usize) -> [f64; 3] {
        match projector {
            0 => self.ambient,
            _ => [0.0; 3],
        }
    }

    /// All facets with the index of their panel, in the order of the panels.
    pub fn facets(&self) -> impl Iterator<Item = (usize, &Facet)> {
        let panels = self.panels.iter().enumerate();
        panels.flat_map(|(index, panel)| panel.facets.iter().map(move |facet| (index, facet)))
    }
}
