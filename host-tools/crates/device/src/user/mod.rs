//! What belongs to the user rather than to a project: settings, and what is kept
//! between two commands.
//!
//! | what | file |
//! |---|---|
//! | where | [`folders`] |
//! | settings: the port, and ports never to open | [`config`] |
//! | ports of emulated boards that run now | [`emulated`] |
//! | transcripts of the last transfers | [`transcripts`] |

pub mod config;
pub mod emulated;
pub mod folders;
pub mod transcripts;

pub use config::{Config, ConfigError};
pub use folders::Folders;
