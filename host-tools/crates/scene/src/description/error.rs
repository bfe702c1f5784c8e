//! Scene file errors: what can be wrong with a scene file.

use crate::geometry::PolygonError;
use iltm_runtime::GridError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a scene cannot be simulated as it is described.
#[derive(Debug, Error)]
#[error("{}: {problem}", path.display())]
pub struct SceneError {
    /// The scene file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: SceneProblem,
}

/// What is wrong with a scene file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SceneProblem {
    /// It cannot be read.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// It is not TOML of the form that is described; what the reader said, with line and
    /// column.
    #[error("{0}")]
    Syntax(String),
    /// A number is out of its range, or a name is not one of its own.
    #[error("{key} is {value}; it must be {must}")]
    Value {
        /// Where it stands.
        key: String,
        /// What it is.
        value: String,
        /// What it may be.
        must: String,
    },
    /// The `projector`, the `camera` or a `pose` of it has no direction.
    #[error("[{0}] looks nowhere: position, look_at and up do not make a direction")]
    View(&'static str),
    /// The projector's cells do not make a grid.
    #[error("[projector]: {0}")]
    Grid(#[from] GridError),
    /// A panel cannot be a surface.
    #[error("panel `{panel}`: {reason}")]
    Panel {
        /// Its name, or its number.
        panel: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A panel's outline is not convex and planar.
    #[error("panel `{panel}`: {source}")]
    Outline {
        /// Its name, or its number.
        panel: String,
        /// What is wrong.
        source: PolygonError,
    },
    /// There is nothing to project with.
    #[error("there is no [projector]")]
    NoProjector,
    /// There is nothing to project onto.
    #[error("there is no [[panel]]")]
    NoPanels,
}

impl SceneError {
    /// What to do next, a sentence.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self.problem {
            SceneProblem::Io(_) => {
                "Check the path; paths in a scene file are relative to its folder."
            }
            SceneProblem::Syntax(_) => "Correct that line; docs/scenes.md lists every key.",
            SceneProblem::Value { .. } => {
                "Change the value; docs/scenes.md gives units and ranges."
            }
            SceneProblem::View(_) => {
                "Put look_at away from position, and up in another direction than between the two."
            }
            SceneProblem::Grid(_) => "Change `rows` and `cols`.",
            SceneProblem::Panel { .. } => {
                "Correct the panel; docs/scenes.md lists what a panel may have."
            }
            SceneProblem::Outline { .. } => {
                "List the corners in order around a flat, convex outline."
            }
            SceneProblem::NoProjector => "Describe one: [projector], or [[projector]] for each.",
            SceneProblem::NoPanels => {
                "Describe at least one surface: [[panel]] with `corners` or `mesh`."
            }
        }
    }
}
