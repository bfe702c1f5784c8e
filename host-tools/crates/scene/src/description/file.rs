//! Scene file format: TOML, every key named, unknown ones refused.

use super::{Gloss, Projector};
use iltm_picture::Response;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::path::PathBuf;

/// Everything a scene file says.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFile {
    pub(super) name: Option<String>,
    #[serde(rename = "projector")]
    pub(super) projectors: ProjectorTables,
    pub(super) camera: CameraTable,
    #[serde(default, rename = "pose")]
    pub(super) poses: Vec<PoseTable>,
    /// Light from elsewhere.
    #[serde(default)]
    pub(super) ambient: ColourValue,
    #[serde(default, rename = "panel")]
    pub(super) panels: Vec<PanelTable>,
}

/// `[projector]`, or `[[projector]]` for each of several.
#[derive(Clone, Debug)]
pub(super) struct ProjectorTables(pub(super) Vec<ProjectorTable>);

impl<'de> Deserialize<'de> for ProjectorTables {
    // Not `untagged`, which would lose what is wrong with a key and where it stands.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrMore;

        impl<'de> Visitor<'de> for OneOrMore {
            type Value = ProjectorTables;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table, or one for each projector")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ProjectorTables, A::Error> {
                let one = ProjectorTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(ProjectorTables(vec![one]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<ProjectorTables, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(ProjectorTables)
            }
        }

        deserializer.deserialize_any(OneOrMore)
    }
}

/// A table of [`ProjectorTables`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProjectorTable {
    pub(super) name: Option<String>,
    pub(super) position: [f64; 3],
    pub(super) look_at: [f64; 3],
    #[serde(default = "up")]
    pub(super) up: [f64; 3],
    pub(super) field_of_view: f64,
    pub(super) rows: u16,
    pub(super) cols: u16,
    pub(super) aspect: Option<f64>,
    #[serde(default = "srgb")]
    pub(super) response: Response,
    #[serde(default)]
    pub(super) vignetting: f64,
    #[serde(default)]
    pub(super) blur: f64,
    #[serde(default)]
    pub(super) black: f64,
    #[serde(default)]
    pub(super) drift: f64,
    #[serde(default = "unmixed")]
    pub(super) mixing: [[f64; 3]; 3],
}

/// `[camera]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraTable {
    pub(super) position: [f64; 3],
    pub(super) look_at: [f64; 3],
    #[serde(default = "up")]
    pub(super) up: [f64; 3],
    pub(super) field_of_view: f64,
    pub(super) width: u32,
    pub(super) height: u32,
    #[serde(default = "exposed")]
    pub(super) white: f64,
    pub(super) full_well: Option<f64>,
    #[serde(default)]
    pub(super) read_noise: f64,
    pub(super) bits: Option<u8>,
    #[serde(default)]
    pub(super) response: Response,
    #[serde(default)]
    pub(super) distortion: [f64; 2],
}

/// `[[pose]]`: what it leaves out is the camera's.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PoseTable {
    pub(super) name: Option<String>,
    pub(super) position: [f64; 3],
    pub(super) look_at: [f64; 3],
    pub(super) up: Option<[f64; 3]>,
    pub(super) field_of_view: Option<f64>,
}

/// `[[panel]]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PanelTable {
    pub(super) name: Option<String>,
    pub(super) corners: Option<Vec<[f64; 3]>>,
    pub(super) mesh: Option<PathBuf>,
    pub(super) albedo: AlbedoValue,
    pub(super) gloss: Option<Gloss>,
    #[serde(default)]
    pub(super) mirror: f64,
}

/// One number for all channels, or red, green and blue.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged, expecting = "a number, or [red, green, blue]")]
pub(super) enum ColourValue {
    Grey(f64),
    Rgb([f64; 3]),
}

impl Default for ColourValue {
    fn default() -> Self {
        Self::Grey(0.0)
    }
}

impl ColourValue {
    pub(super) fn channels(self) -> [f64; 3] {
        match self {
            Self::Grey(value) => [value; 3],
            Self::Rgb(channels) => channels,
        }
    }
}

/// A colour, or the path of a picture.
#[derive(Clone, Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "a number, [red, green, blue], or the path of a PNG picture"
)]
pub(super) enum AlbedoValue {
    Uniform(ColourValue),
    Texture(PathBuf),
}

const fn up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

const fn srgb() -> Response {
    Response::Srgb
}

const fn unmixed() -> [[f64; 3]; 3] {
    Projector::UNMIXED
}

const fn exposed() -> f64 {
    0.8
}
