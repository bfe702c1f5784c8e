//! From a described scene to the photographs that a camera would take of it.
//!
//! ```text
//! description   scene.toml: panels, projector, camera, ambient light
//! facets        flat parts, turned to the projector      geometry, view
//! decide        which effects the scene calls for        effects, estimate
//! patches       facets cut along the projector's cells
//! projector_light   straight light on patches and points
//! exchange      light between patches                    form_factor
//! near          what differs within a patch
//! specular      light over mirrors and lobes
//! sight         what each camera pixel sees              sparse
//! simulation    all of it, ready for patterns            between
//! exposure      light under patterns, what pixels see of it
//! sensor        exposure, noise, bits, response
//! shooting      one photograph after another, drift   fault
//! folder        the photographs as a capture
//! retake        the photographs that a folder of patterns calls for
//! ablation      what each effect contributes
//! coaxial       scenes whose transport is known exactly, cell by cell
//! ```
//!
//! Surfaces are Lambertian unless they say otherwise; each patch has one radiosity
//! `B = R (E0 + F B)`, with `R` the albedo, `E0` the projector's light and the ambient
//! light, `F` the form factors (Goral, Torrance, Greenberg, Battaile, *Modeling the
//! interaction of light between diffuse surfaces*, 1984).

pub mod ablation;
mod between;
pub mod coaxial;
mod decide;
pub mod description;
mod effects;
mod estimate;
pub mod exchange;
mod exposure;
mod facets;
mod fault;
pub mod folder;
pub mod form_factor;
pub mod geometry;
mod near;
mod patches;
mod projector_light;
pub mod retake;
mod sensor;
mod shooting;
mod sight;
mod simulation;
mod sparse;
mod specular;
mod view;

pub use effects::{Decision, Decisions, Effect, Forced, UnknownEffect};
pub use exposure::Exposed;
pub use facets::Facets;
pub use fault::{Fault, Mishap, UnknownFault};
pub use near::NearLight;
pub use patches::{Cut, Patch, Patches};
pub use projector_light::{Beam, ProjectorLight};
pub use sensor::{Readout, Sensor};
pub use shooting::{Photograph, Shooting, Slide};
pub use sight::{Looks, Sight};
pub use simulation::{Simulation, SimulationError, SimulationOptions, Work};
pub use sparse::Rows;
pub use specular::{Specular, Surfaces, TooGlossy};
pub use view::{FramePlace, View};
