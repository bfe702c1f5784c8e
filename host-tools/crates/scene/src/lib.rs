//! A described scene's light, and photographs of it as a camera would take them.
//!
//! ```text
//! description        scene.toml: panels, projector, camera, ambient light
//! facets             flat parts, turned to the projector      geometry, pinhole
//! decide             which effects the scene calls for        effects, estimate
//! patches            facets cut along the projector's cells
//! projector_light    straight light on patches and points
//! radiosity          light between patches                    form_factor
//! near_field         what differs within a patch
//! specular           light over mirrors and lobes
//! camera_sampling    what each camera pixel sees              sparse
//! simulation         all of it, ready for patterns            interreflection
//! exposure           light under patterns, what pixels see of it
//! sensor             exposure, noise, bits, response
//! pixel_sampling   what it sees of frames finer than the cells
//! virtual_camera     one photograph after another, drift      injected_fault
//! folder             the photographs as a capture
//! fill_capture       the photographs that a folder of patterns calls for
//! ablation           what each effect contributes
//! coaxial            scenes whose transport is known exactly, cell by cell
//! ```
//!
//! Surfaces are Lambertian unless they say otherwise; each patch has one radiosity
//! `B = R (E0 + F B)`, with `R` the albedo, `E0` the projector's light and the ambient
//! light, `F` the form factors (Goral, Torrance, Greenberg, Battaile, *Modeling the
//! interaction of light between diffuse surfaces*, 1984).

pub mod ablation;
mod camera_sampling;
pub mod coaxial;
mod decide;
pub mod description;
mod effects;
mod estimate;
mod exposure;
mod facets;
pub mod fill_capture;
pub mod folder;
pub mod form_factor;
pub mod geometry;
mod injected_fault;
mod interreflection;
mod near_field;
mod patches;
mod pinhole;
mod pixel_sampling;
mod projector_light;
pub mod radiosity;
mod sensor;
mod simulation;
mod sparse;
mod specular;
mod virtual_camera;

pub use effects::{Decision, Effect, Forced, UnknownEffect};
pub use exposure::Exposed;
pub use injected_fault::{CaptureFault, InjectedFault, UnknownFault};
pub use pinhole::{FramePlace, Pinhole};
pub use sensor::Sensor;
pub use simulation::{Simulation, SimulationError, SimulationOptions, Work};
pub use specular::TooGlossy;
pub use virtual_camera::{Photograph, ProjectedFrame, VirtualCamera};
