//! Meshes: panels from Wavefront OBJ files.

use super::Facet;
use crate::geometry::{Polygon, PolygonError};
use nalgebra::{Vector2, Vector3};
use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use thiserror::Error;

/// Bytes of a mesh file at most.
const MOST_BYTES: u64 = 64 << 20;
/// Faces of a mesh at most.
const MOST_FACES: usize = 100_000;

/// Why a file is not a mesh of flat surfaces.
#[derive(Debug, Error)]
pub enum MeshError {
    /// It cannot be read.
    #[error("{0}")]
    Read(#[from] std::io::Error),
    /// It is a pipe, a folder or a device.
    #[error("it is not a regular file")]
    NotAFile,
    /// It is longer than any mesh.
    #[error("it is longer than {MOST_BYTES} bytes")]
    TooLong,
    /// It is not written like one.
    #[error("it is no Wavefront OBJ file ({0})")]
    Obj(#[from] tobj::LoadError),
    /// It has more faces than can be simulated.
    #[error("it has {0} faces; at most {MOST_FACES} can be simulated")]
    TooManyFaces(usize),
    /// It has none.
    #[error("it has no faces")]
    Empty,
    /// A face is not flat and convex.
    #[error("face {face}: {source}")]
    Face {
        /// Its number, from 0.
        face: usize,
        /// What is wrong with it.
        source: PolygonError,
    },
}

/// Reads the faces of a mesh; materials are not looked at.
pub(super) fn read(path: &Path) -> Result<Vec<Facet>, MeshError> {
    // Opening a pipe would wait for a writer for ever.
    if !std::fs::metadata(path)?.is_file() {
        return Err(MeshError::NotAFile);
    }
    let mut bytes = Vec::new();
    File::open(path)?
        .take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)?;
    parse(&bytes)
}

/// Faces of the contents of an OBJ file.
///
/// # Errors
/// [`MeshError`] for what is no OBJ, or whose faces are no flat surfaces.
///
/// # Fuzzing
/// Any bytes give a mesh or an error.
pub fn parse(bytes: &[u8]) -> Result<Vec<Facet>, MeshError> {
    if bytes.len() as u64 > MOST_BYTES {
        return Err(MeshError::TooLong);
    }
    let no_materials = |_: &Path| Ok((Vec::new(), HashMap::new()));
    let options = tobj::LoadOptions::default();
    let (models, _) = tobj::load_obj_buf(&mut &*bytes, &options, no_materials)?;
    let faces: usize = models
        .iter()
        .map(|model| face_sizes(&model.mesh).count())
        .sum();
    if faces > MOST_FACES {
        return Err(MeshError::TooManyFaces(faces));
    }
    let mut facets = Vec::with_capacity(faces);
    for model in &models {
        let mesh = &model.mesh;
        let mut next = 0;
        for size in face_sizes(mesh) {
            let face = facets.len();
            let corners = next..next + size;
            next += size;
            facets.push(facet(mesh, corners, face)?);
        }
    }
    if facets.is_empty() {
        return Err(MeshError::Empty);
    }
    Ok(facets)
}

/// Corners of each face.
fn face_sizes(mesh: &tobj::Mesh) -> impl Iterator<Item = usize> + '_ {
    // Without sizes all faces are triangles.
    let triangles = if mesh.face_arities.is_empty() {
        mesh.indices.len() / 3
    } else {
        0
    };
    let sizes = mesh.face_arities.iter().map(|size| *size as usize);
    sizes.chain(std::iter::repeat_n(3, triangles))
}

fn facet(
    mesh: &tobj::Mesh,
    corners: std::ops::Range<usize>,
    face: usize,
) -> Result<Facet, MeshError> {
    let refuse = |source| MeshError::Face { face, source };
    let place = |index: &u32| {
        let from = 3 * *index as usize;
        let at = mesh.positions.get(from..from + 3);
        at.map_or(Vector3::repeat(f64::NAN), Vector3::from_column_slice)
    };
    // From the left and from the bottom in the file.
    let in_texture = |index: &u32| {
        let from = 2 * *index as usize;
        let at = mesh.texcoords.get(from..from + 2);
        at.map_or(Vector2::zeros(), |at| Vector2::new(at[0], 1.0 - at[1]))
    };
    let indices = mesh.indices.get(corners.clone()).unwrap_or_default();
    let polygon = Polygon::new(indices.iter().map(place).collect()).map_err(refuse)?;
    let texture = match mesh.texcoord_indices.get(corners) {
        Some(indices) if !mesh.texcoords.is_empty() => indices.iter().map(in_texture).collect(),
        _ => vec![Vector2::zeros(); polygon.corners().len()],
    };
    Ok(Facet { polygon, texture })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TENT: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv .5 2 1\n\
        vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\nf 4/4 3/3 5/2\n";

    #[test]
    fn faces_of_any_number_of_corners_become_facets() {
        let facets = parse(TENT.as_bytes()).unwrap();
        assert_eq!(facets.len(), 2);
        assert!((facets[0].polygon.area() - 1.0).abs() < 1e-12);
        assert_eq!(facets[1].polygon.corners().len(), 3);
        // The file counts from the bottom of the picture, a texture from its top.
        let place = facets[0].texture_place(&Vector3::new(0.25, 0.25, 0.0));
        assert!((place - Vector2::new(0.25, 0.75)).norm() < 1e-12, "{place}");
    }

    #[test]
    fn what_is_no_surface_is_refused_with_the_face() {
        let bent = TENT.replace("v 1 1 0", "v 1 1 .3");
        let error = parse(bent.as_bytes()).unwrap_err().to_string();
        assert!(
            error.contains("face 0") && error.contains("triangles"),
            "{error}"
        );
        for text in ["", "hello", "f 1 2 3\n", "v 0 0 0\nf 1 1 1\n", "v a b c\n"] {
            assert!(parse(text.as_bytes()).is_err(), "{text:?}");
        }
    }
}
