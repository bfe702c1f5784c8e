//! Reads a scene file and checks what it says.

use super::file::{AlbedoValue, CameraTable, Colour, PanelTable, ProjectorTable, SceneFile};
use super::{Albedo, Camera, Facet, Gloss, Panel, Projector, Scene, SceneError, Texture, mesh};
use crate::geometry::Polygon;
use crate::view::View;
use iltm_runtime::Grid;
use nalgebra::{Vector2, Vector3};
use std::fmt::Display;
use std::fs::File;
use std::io::Read;
use std::ops::RangeInclusive;
use std::path::Path;

/// Bytes of a scene file at most: a person writes it.
const MOST_BYTES: u64 = 1 << 20;
/// Pixels of a simulated photograph at most.
const MOST_PIXELS: u64 = 16_000_000;
/// Metres from the origin at most: beyond, a mistake in the unit is likelier.
const FARTHEST: f64 = 1e4;

impl Scene {
    /// Reads a scene file; meshes and textures are looked for beside it.
    ///
    /// # Errors
    /// [`SceneError`] with the key, the panel or the line.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let io = |source| SceneError::Io {
            path: path.to_owned(),
            source,
        };
        let mut bytes = Vec::new();
        let file = File::open(path).map_err(io)?;
        file.take(MOST_BYTES + 1)
            .read_to_end(&mut bytes)
            .map_err(io)?;
        Self::parse(&bytes, path)
    }

    /// Reads the contents of a scene file; `path` is for errors and for what stands
    /// beside it.
    ///
    /// # Errors
    /// Those of [`Scene::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, SceneError> {
        let refuse = |reason| SceneError::Syntax {
            path: path.to_owned(),
            reason,
        };
        if bytes.len() as u64 > MOST_BYTES {
            return Err(refuse(format!("it is longer than {MOST_BYTES} bytes")));
        }
        let text = std::str::from_utf8(bytes).map_err(|error| refuse(error.to_string()))?;
        let file: SceneFile = toml::from_str(text)
            .map_err(|error| refuse(error.to_string().trim_end().to_owned()))?;
        Check { path }.scene(file)
    }
}

/// Checks with the file's name at hand.
struct Check<'p> {
    path: &'p Path,
}

impl Check<'_> {
    fn scene(&self, file: SceneFile) -> Result<Scene, SceneError> {
        if file.panels.is_empty() {
            return Err(SceneError::NoPanels {
                path: self.path.to_owned(),
            });
        }
        let panels = file.panels.into_iter().enumerate();
        Ok(Scene {
            name: file.name,
            projector: self.projector(&file.projector)?,
            camera: self.camera(&file.camera)?,
            ambient: self.light("ambient", file.ambient)?,
            panels: panels
                .map(|(index, panel)| self.panel(index, panel))
                .collect::<Result<_, _>>()?,
        })
    }

    fn projector(&self, table: &ProjectorTable) -> Result<Projector, SceneError> {
        let grid = Grid::new(table.rows, table.cols).map_err(|source| SceneError::Grid {
            path: self.path.to_owned(),
            source,
        })?;
        let square = f64::from(table.cols) / f64::from(table.rows);
        let aspect = table.aspect.unwrap_or(square);
        self.within(
            "[projector] aspect",
            aspect,
            1e-3..=1e3,
            "from 0.001 to 1000",
        )?;
        Ok(Projector {
            view: self.view(
                "projector",
                [table.position, table.look_at, table.up],
                table.field_of_view,
                aspect,
            )?,
            grid,
            response: table.response,
            vignetting: self.within(
                "[projector] vignetting",
                table.vignetting,
                0.0..=0.95,
                "from 0 to 0.95",
            )?,
            blur: self.within(
                "[projector] blur",
                table.blur,
                0.0..=4.0,
                "from 0 to 4 cells",
            )?,
            black: self.within(
                "[projector] black",
                table.black,
                0.0..=0.5,
                "from 0 to 0.5 of white",
            )?,
            drift: self.within(
                "[projector] drift",
                table.drift,
                0.0..=0.5,
                "from 0 to 0.5 of the light",
            )?,
            mixing: self.mixing(table.mixing)?,
        })
    }

    fn mixing(&self, mixing: [[f64; 3]; 3]) -> Result<[[f64; 3]; 3], SceneError> {
        let key = "[projector] mixing";
        for value in mixing.as_flattened() {
            self.within(key, *value, 0.0..=10.0, "from 0 to 10")?;
        }
        let dark = |row: &[f64; 3]| row.iter().sum::<f64>() <= 0.0;
        if mixing.iter().any(dark) {
            let must = "some light in every channel of the camera, a row each";
            return Err(self.value(key, format!("{mixing:?}"), must));
        }
        Ok(mixing)
    }

    fn camera(&self, table: &CameraTable) -> Result<Camera, SceneError> {
        let pixels = u64::from(table.width) * u64::from(table.height);
        if pixels == 0 || pixels > MOST_PIXELS {
            return Err(self.value(
                "[camera] width and height",
                format!("{} x {}", table.width, table.height),
                "1 to 16,000,000 pixels together",
            ));
        }
        let bits = table.bits.map_or(16.0, f64::from);
        self.within("[camera] bits", bits, 4.0..=16.0, "from 4 to 16")?;
        if let Some(full_well) = table.full_well {
            self.within(
                "[camera] full_well",
                full_well,
                10.0..=1e9,
                "from 10 to 1e9 electrons",
            )?;
        } else if table.read_noise != 0.0 {
            return Err(self.value(
                "[camera] read_noise",
                table.read_noise,
                "0 where no full_well is given: it is in electrons",
            ));
        }
        let aspect = f64::from(table.width) / f64::from(table.height);
        Ok(Camera {
            view: self.view(
                "camera",
                [table.position, table.look_at, table.up],
                table.field_of_view,
                aspect,
            )?,
            size: (table.width, table.height),
            white: self.within(
                "[camera] white",
                table.white,
                0.01..=10.0,
                "from 0.01 to 10 of full scale",
            )?,
            full_well: table.full_well,
            read_noise: self.within(
                "[camera] read_noise",
                table.read_noise,
                0.0..=1e6,
                "from 0 to 1e6 electrons",
            )?,
            bits: table.bits,
            response: table.response,
            distortion: self.distortion(table.distortion)?,
        })
    }

    /// Beyond half, a lens of this kind would fold the picture over.
    fn distortion(&self, terms: [f64; 2]) -> Result<[f64; 2], SceneError> {
        for term in terms {
            self.within(
                "[camera] distortion",
                term,
                -0.15..=0.5,
                "from -0.15 to 0.5",
            )?;
        }
        Ok(terms)
    }

    fn view(
        &self,
        which: &'static str,
        [position, target, up]: [[f64; 3]; 3],
        field_of_view: f64,
        aspect: f64,
    ) -> Result<View, SceneError> {
        for (key, place) in [("position", position), ("look_at", target), ("up", up)] {
            for value in place {
                self.within(
                    &format!("[{which}] {key}"),
                    value,
                    -FARTHEST..=FARTHEST,
                    "within 10 km of the origin, in metres",
                )?;
            }
        }
        self.within(
            &format!("[{which}] field_of_view"),
            field_of_view,
            0.1..=170.0,
            "from 0.1 to 170 degrees",
        )?;
        let [position, target, up] = [position, target, up].map(Vector3::from);
        View::new(position, target, up, field_of_view, aspect).ok_or_else(|| SceneError::View {
            path: self.path.to_owned(),
            which,
        })
    }

    fn panel(&self, index: usize, table: PanelTable) -> Result<Panel, SceneError> {
        let name = table.name.unwrap_or_else(|| format!("panel {}", index + 1));
        let refuse = |reason: String| SceneError::Panel {
            path: self.path.to_owned(),
            panel: name.clone(),
            reason,
        };
        let facets = match (table.corners, &table.mesh) {
            (Some(corners), None) => vec![self.quad(&name, &corners)?],
            (None, Some(mesh)) => mesh::read(&self.beside(mesh))
                .map_err(|error| refuse(format!("{}: {error}", mesh.display())))?,
            _ => return Err(refuse("it needs either `corners` or `mesh`".to_owned())),
        };
        let albedo = match table.albedo {
            AlbedoValue::Uniform(colour) => Albedo::Uniform(colour.channels()),
            AlbedoValue::Texture(path) => {
                Albedo::Texture(Texture::read(&self.beside(&path)).map_err(refuse)?)
            }
        };
        let gloss = table.gloss.map(|gloss| Gloss {
            reflectance: gloss.reflectance,
            exponent: gloss.exponent,
        });
        let shares = [
            ("albedo", albedo.largest().into_iter().fold(0.0, f64::max)),
            (
                "gloss reflectance",
                gloss.map_or(0.0, |gloss| gloss.reflectance),
            ),
            ("mirror", table.mirror),
        ];
        if let Albedo::Uniform(channels) = albedo
            && channels.iter().any(|value| !(0.0..=1.0).contains(value))
        {
            return Err(refuse(format!(
                "albedo is {channels:?}; it must be from 0 to 1"
            )));
        }
        for (what, value) in shares {
            if !(0.0..=1.0).contains(&value) {
                return Err(refuse(format!("{what} is {value}; it must be from 0 to 1")));
            }
        }
        let together: f64 = shares.iter().map(|(_, value)| value).sum();
        if together > 1.0 + 1e-9 {
            return Err(refuse(format!(
                "albedo, gloss and mirror together send back {together:.3} of the light; at most 1 is possible"
            )));
        }
        if let Some(Gloss { exponent, .. }) = gloss
            && !(1.0..=1e5).contains(&exponent)
        {
            return Err(refuse(format!(
                "the gloss exponent is {exponent}; it must be from 1 to 100000"
            )));
        }
        Ok(Panel {
            name,
            facets,
            albedo,
            gloss,
            mirror: table.mirror,
        })
    }

    /// A panel of corners; its texture is spread over the first, second and last
    /// one, as the top left, top right and bottom left corner of the picture.
    fn quad(&self, name: &str, corners: &[[f64; 3]]) -> Result<Facet, SceneError> {
        let places: Vec<_> = corners.iter().map(|c| Vector3::from(*c)).collect();
        let polygon = Polygon::new(places).map_err(|source| SceneError::Outline {
            path: self.path.to_owned(),
            panel: name.to_owned(),
            face: None,
            source,
        })?;
        let texture = match polygon.corners().len() {
            4 => [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
                .map(Vector2::from)
                .to_vec(),
            _ => across(&polygon),
        };
        Ok(Facet { polygon, texture })
    }

    fn light(&self, key: &str, colour: Colour) -> Result<[f64; 3], SceneError> {
        let channels = colour.channels();
        for value in channels {
            self.within(
                key,
                value,
                0.0..=10.0,
                "from 0 to 10 of the projector's white",
            )?;
        }
        Ok(channels)
    }

    fn within(
        &self,
        key: &str,
        value: f64,
        range: RangeInclusive<f64>,
        must: &'static str,
    ) -> Result<f64, SceneError> {
        // NaN is in no range.
        if range.contains(&value) {
            return Ok(value);
        }
        Err(self.value(key, value, must))
    }

    fn value(&self, key: &str, value: impl Display, must: &'static str) -> SceneError {
        SceneError::Value {
            path: self.path.to_owned(),
            key: key.to_owned(),
            value: value.to_string(),
            must,
        }
    }

    fn beside(&self, path: &Path) -> std::path::PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }
}

/// Texture places of an outline that is not a quadrilateral: its bounding rectangle,
/// along its first edge.
fn across(polygon: &Polygon) -> Vec<Vector2<f64>> {
    let corners = polygon.corners();
    let right = (corners[1] - corners[0]).normalize();
    let down = polygon.normal().cross(&right);
    let places: Vec<_> = corners
        .iter()
        .map(|c| Vector2::new((c - corners[0]).dot(&right), (c - corners[0]).dot(&down)))
        .collect();
    let (mut low, mut high) = (places[0], places[0]);
    for place in &places {
        low = low.inf(place);
        high = high.sup(place);
    }
    let span = (high - low).sup(&Vector2::repeat(f64::MIN_POSITIVE));
    places
        .iter()
        .map(|p| (p - low).component_div(&span))
        .collect()
}
