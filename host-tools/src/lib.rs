//! `iltm` learns a scene's sparse inverse light transport from photographs,
//! compiles it into a table for the runtime, and compensates frames with it.
//!
//! Light flows one way through the crate:
//!
//! ```text
//! scene::Simulation -> photographs -> capture::Measurements -> solve::InverseTransport -> compile -> .iltm image -> iltm_runtime -> frames
//! ```

pub mod bounces;
pub mod capture;
pub mod cli;
pub mod compare;
pub mod compile;
pub mod content;
pub mod demo;
pub mod device;
pub mod learn;
pub mod report;
pub mod scene;
pub mod session;
pub mod solve;
pub mod solved;
pub mod tradeoff;
pub mod user;
pub mod verify;
pub mod video;

pub use iltm_picture as picture;
pub use iltm_picture::progress;
