//! `iltm` learns a scene's sparse inverse light transport from photographs,
//! compiles it into a table for the runtime, and compensates frames with it.
//!
//! This package is the command and a front door: the work is done in the crates below,
//! each of which knows only those under it.
//!
//! ```text
//! scene -> photographs -> capture -> solve -> compile -> .iltm image -> runtime -> frames
//! ```

pub mod cli;
pub mod demo;

pub use iltm_capture as capture;
pub use iltm_compare as compare;
pub use iltm_compile as compile;
pub use iltm_compile::build_table;
pub use iltm_device as device;
pub use iltm_device::user;
pub use iltm_picture as picture;
pub use iltm_picture::progress;
pub use iltm_report as report;
pub use iltm_report::{bounces, solve_page, tradeoff};
pub use iltm_scene as scene;
pub use iltm_session as session;
pub use iltm_session::verify;
pub use iltm_solve as solve;
pub use iltm_video as video;
