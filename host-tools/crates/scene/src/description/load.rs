//! Scene file reader: reads a scene file and checks what it says.

use super::file::{
    AlbedoValue, CameraTable, ColourValue, PanelTable, PoseTable, ProjectorTable, SceneFile,
};
use super::{
    Albedo, Camera, Facet, Gloss, Panel, Pose, Projector, Scene, SceneError, SceneProblem, Texture,
    mesh, parts,
};
use crate::geometry::Polygon;
use crate::pinhole::Pinhole;
use iltm_picture::{FramePart, foreign_file};
use iltm_runtime::Grid;
use nalgebra::{Vector2, Vector3};
use std::fmt::Display;
use std::io::Read;
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
        let mut bytes = Vec::new();
        let read =
            foreign_file::open(path).and_then(|f| f.take(MOST_BYTES + 1).read_to_end(&mut bytes));
        read.map_err(|source| SceneError {
            path: path.to_owned(),
            problem: source.into(),
        })?;
        Self::parse(&bytes, path)
    }

    /// Reads the contents of a scene file; `path` is for errors and for what stands
    /// beside it.
    ///
    /// # Errors
    /// Those of [`Scene::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, SceneError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let scene = table(bytes).and_then(|file| scene(file, folder));
        scene.map_err(|problem| SceneError {
            path: path.to_owned(),
            problem,
        })
    }
}

fn table(bytes: &[u8]) -> Result<SceneFile, SceneProblem> {
    if bytes.len() as u64 > MOST_BYTES {
        let reason = format!("it is longer than {MOST_BYTES} bytes");
        return Err(SceneProblem::Syntax(reason));
    }
    let text = std::str::from_utf8(bytes);
    let text = text.map_err(|error| SceneProblem::Syntax(error.to_string()))?;
    toml::from_str(text)
        .map_err(|error| SceneProblem::Syntax(error.to_string().trim_end().to_owned()))
}

/// Checks a scene file whose meshes and textures are in `folder`.
fn scene(file: SceneFile, folder: &Path) -> Result<Scene, SceneProblem> {
    if file.panels.is_empty() {
        return Err(SceneProblem::NoPanels);
    }
    let projectors = file.projectors.0.iter().map(projector);
    let projectors: Vec<_> = projectors.collect::<Result<_, _>>()?;
    if projectors.is_empty() {
        return Err(SceneProblem::NoProjector);
    }
    let names = projectors.iter().map(|one| &one.name);
    check_names("projector", &names.collect::<Vec<_>>())?;
    let sides = FramePart::around(&parts(&projectors));
    let [rows, cols] = sides.map(|count| count.try_into().unwrap_or(u16::MAX));
    Grid::new(rows, cols)?;
    let panels = file.panels.into_iter().enumerate();
    Ok(Scene {
        name: file.name,
        projectors,
        camera: camera(&file.camera)?,
        poses: poses(&file.poses, &file.camera)?,
        ambient: ambient(file.ambient)?,
        panels: panels
            .map(|(index, table)| panel(index, table, folder))
            .collect::<Result<_, _>>()?,
    })
}

/// Refuses names by which one projector, or one pose, could not be told from the others.
fn check_names(of: &str, names: &[&Option<String>]) -> Result<(), SceneProblem> {
    let names: Vec<_> = names.iter().filter_map(|name| name.as_ref()).collect();
    for (at, name) in names.iter().enumerate() {
        let must = if names[..at].contains(name) {
            format!("another for each {of}")
        } else if name.trim().is_empty() || name.parse::<usize>().is_ok() {
            format!("a word: a {of} without a name is called by its number")
        } else {
            continue;
        };
        return Err(refused(&format!("[{of}] name"), format!("{name:?}"), &must));
    }
    Ok(())
}

fn projector(table: &ProjectorTable) -> Result<Projector, SceneProblem> {
    let grid = Grid::new(table.rows, table.cols)?;
    let square = f64::from(table.cols) / f64::from(table.rows);
    let within =
        |key: &str, value, range, unit| within(&format!("[projector] {key}"), value, range, unit);
    let aspect = within("aspect", table.aspect.unwrap_or(square), [1e-3, 1e3], "")?;
    let places = [table.position, table.look_at, table.up];
    Ok(Projector {
        name: table.name.clone(),
        view: pinhole("projector", places, table.field_of_view, aspect)?,
        grid,
        response: table.response,
        vignetting: within("vignetting", table.vignetting, [0.0, 0.95], "")?,
        blur: within("blur", table.blur, [0.0, 4.0], " cells")?,
        black: within("black", table.black, [0.0, 0.5], " of white")?,
        drift: within("drift", table.drift, [0.0, 0.5], " of the light")?,
        mixing: mixing(table.mixing)?,
    })
}

fn mixing(mixing: [[f64; 3]; 3]) -> Result<[[f64; 3]; 3], SceneProblem> {
    let key = "[projector] mixing";
    for value in mixing.as_flattened() {
        within(key, *value, [0.0, 10.0], "")?;
    }
    let dark = |row: &[f64; 3]| row.iter().sum::<f64>() <= 0.0;
    if mixing.iter().any(dark) {
        let must = "some light in every channel of the camera, a row each";
        return Err(refused(key, format!("{mixing:?}"), must));
    }
    Ok(mixing)
}

fn camera(table: &CameraTable) -> Result<Camera, SceneProblem> {
    let within =
        |key: &str, value, range, unit| within(&format!("[camera] {key}"), value, range, unit);
    let pixels = u64::from(table.width) * u64::from(table.height);
    if pixels == 0 || pixels > MOST_PIXELS {
        return Err(refused(
            "[camera] width and height",
            format!("{} x {}", table.width, table.height),
            "1 to 16,000,000 pixels together",
        ));
    }
    within("bits", table.bits.map_or(16.0, f64::from), [4.0, 16.0], "")?;
    if let Some(full_well) = table.full_well {
        within("full_well", full_well, [10.0, 1e9], " electrons")?;
    } else if table.read_noise != 0.0 {
        let must = "0 where no full_well is given: it is in electrons";
        return Err(refused("[camera] read_noise", table.read_noise, must));
    }
    let aspect = f64::from(table.width) / f64::from(table.height);
    let places = [table.position, table.look_at, table.up];
    let camera = Camera {
        view: pinhole("camera", places, table.field_of_view, aspect)?,
        size: (table.width, table.height),
        white: within("white", table.white, [0.01, 10.0], " of full scale")?,
        full_well: table.full_well,
        read_noise: within("read_noise", table.read_noise, [0.0, 1e6], " electrons")?,
        bits: table.bits,
        response: table.response,
        distortion: table.distortion,
    };
    // Beyond half, a lens of this kind would fold the picture over.
    for term in camera.distortion {
        within("distortion", term, [-0.15, 0.5], "")?;
    }
    Ok(camera)
}

fn poses(tables: &[PoseTable], of: &CameraTable) -> Result<Vec<Pose>, SceneProblem> {
    let names: Vec<_> = tables.iter().map(|pose| &pose.name).collect();
    check_names("pose", &names)?;
    let aspect = f64::from(of.width) / f64::from(of.height);
    let pose = |table: &PoseTable| {
        let places = [table.position, table.look_at, table.up.unwrap_or(of.up)];
        let field_of_view = table.field_of_view.unwrap_or(of.field_of_view);
        Ok(Pose {
            name: table.name.clone(),
            view: pinhole("pose", places, field_of_view, aspect)?,
        })
    };
    tables.iter().map(pose).collect()
}

fn pinhole(
    which: &'static str,
    [position, target, up]: [[f64; 3]; 3],
    field_of_view: f64,
    aspect: f64,
) -> Result<Pinhole, SceneProblem> {
    for (key, place) in [("position", position), ("look_at", target), ("up", up)] {
        // NaN is in no range.
        let far = |value: &&f64| !(-FARTHEST..=FARTHEST).contains(*value);
        if let Some(value) = place.iter().find(far) {
            let must = "within 10 km of the origin, in metres";
            return Err(refused(&format!("[{which}] {key}"), value, must));
        }
    }
    let key = format!("[{which}] field_of_view");
    within(&key, field_of_view, [0.1, 170.0], " degrees")?;
    let [position, target, up] = [position, target, up].map(Vector3::from);
    Pinhole::new(position, target, up, field_of_view, aspect).ok_or(SceneProblem::View(which))
}

fn panel(index: usize, table: PanelTable, folder: &Path) -> Result<Panel, SceneProblem> {
    let name = table.name.unwrap_or_else(|| format!("panel {}", index + 1));
    let refuse = |reason: String| SceneProblem::Panel {
        panel: name.clone(),
        reason,
    };
    let facets = match (table.corners, &table.mesh) {
        (Some(corners), None) => vec![quad(&name, &corners)?],
        (None, Some(mesh)) => mesh::read(&folder.join(mesh))
            .map_err(|error| refuse(format!("{}: {error}", mesh.display())))?,
        _ => return Err(refuse("it needs either `corners` or `mesh`".to_owned())),
    };
    let albedo = match table.albedo {
        AlbedoValue::Uniform(colour) => Albedo::Uniform(colour.channels()),
        AlbedoValue::Texture(path) => {
            Albedo::Texture(Texture::read(&folder.join(&path)).map_err(refuse)?)
        }
    };
    let reflectance = table.gloss.map_or(0.0, |gloss| gloss.reflectance);
    let shares = [
        ("albedo", albedo.largest().into_iter().fold(0.0, f64::max)),
        ("gloss reflectance", reflectance),
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
    if let Some(Gloss { exponent, .. }) = table.gloss
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
        gloss: table.gloss,
        mirror: table.mirror,
    })
}

/// A panel of corners; its texture is spread over the first, second and last
/// one, as the top left, top right and bottom left corner of the picture.
fn quad(name: &str, corners: &[[f64; 3]]) -> Result<Facet, SceneProblem> {
    let places: Vec<_> = corners.iter().map(|c| Vector3::from(*c)).collect();
    let polygon = Polygon::new(places).map_err(|source| SceneProblem::Outline {
        panel: name.to_owned(),
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

fn ambient(colour: ColourValue) -> Result<[f64; 3], SceneProblem> {
    let channels = colour.channels();
    for value in channels {
        within("ambient", value, [0.0, 10.0], " of the projector's white")?;
    }
    Ok(channels)
}

/// A value that is in its range, which is named with its unit if it is not.
fn within(key: &str, value: f64, [low, high]: [f64; 2], unit: &str) -> Result<f64, SceneProblem> {
    // NaN is in no range.
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    let high = if high < 1e6 {
        high.to_string()
    } else {
        format!("{high:e}")
    };
    Err(refused(key, value, &format!("from {low} to {high}{unit}")))
}

fn refused(key: &str, value: impl Display, must: &str) -> SceneProblem {
    SceneProblem::Value {
        key: key.to_owned(),
        value: value.to_string(),
        must: must.to_owned(),
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
