//! What can be wrong with a scene file.

use crate::geometry::PolygonError;
use iltm_runtime::GridError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a scene cannot be simulated as it is described.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The scene file is not TOML of the form that is described.
    #[error("{}: {reason}", path.display())]
    Syntax {
        /// The scene file.
        path: PathBuf,
        /// What the reader said, with line and column.
        reason: String,
    },
    /// A number is out of its range.
    #[error("{}: {key} is {value}; it must be {must}", path.display())]
    Value {
        /// The scene file.
        path: PathBuf,
        /// Where it stands.
        key: String,
        /// What it is.
        value: String,
        /// What it may be.
        must: &'static str,
    },
    /// The projector or the camera has no direction.
    #[error("{}: [{which}] looks nowhere: position, look_at and up do not make a direction", path.display())]
    View {
        /// The scene file.
        path: PathBuf,
        /// `projector` or `camera`.
        which: &'static str,
    },
    /// The projector's cells do not make a grid.
    #[error("{}: [projector]: {source}", path.display())]
    Grid {
        /// The scene file.
        path: PathBuf,
        /// What is wrong.
        source: GridError,
    },
    /// A panel cannot be a surface.
    #[error("{}: panel `{panel}`: {reason}", path.display())]
    Panel {
        /// The scene file.
        path: PathBuf,
        /// Its name, or its number.
        panel: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A panel's outline is not convex and planar.
    #[error("{}: panel `{panel}`{}: {source}", path.display(), place(*.face))]
    Outline {
        /// The scene file.
        path: PathBuf,
        /// Its name, or its number.
        panel: String,
        /// Face of its mesh, if it is one.
        face: Option<usize>,
        /// What is wrong.
        source: PolygonError,
    },
    /// There is nothing to project onto.
    #[error("{}: there is no [[panel]]", path.display())]
    NoPanels {
        /// The scene file.
        path: PathBuf,
    },
}

fn place(face: Option<usize>) -> String {
    face.map_or_else(String::new, |face| format!(", face {face}"))
}

impl SceneError {
    /// What to do next, a sentence.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::Io { .. } => "Check the path; paths in a scene file are relative to its folder.",
            Self::Syntax { .. } => "Correct that line; docs/scenes.md lists every key.",
            Self::Value { .. } => "Change the number; docs/scenes.md gives units and ranges.",
            Self::View { .. } => {
                "Put look_at away from position, and up in another direction than between the two."
            }
            Self::Grid { .. } => "Change `rows` and `cols`.",
            Self::Panel { .. } => "Correct the panel; docs/scenes.md lists what a panel may have.",
            Self::Outline { .. } => "List the corners in order around a flat, convex outline.",
            Self::NoPanels { .. } => {
                "Describe at least one surface: [[panel]] with `corners` or `mesh`."
            }
        }
    }
}
