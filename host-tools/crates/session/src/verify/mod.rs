//! Verification: whether a table keeps its promise on the wall.
//!
//! Test images are projected as they are and compensated, photographed, and compared with
//! what was wanted, cell by cell. The camera may stand elsewhere than when the table was
//! made: a Gray code among the pictures says anew where the cells are.
//!
//! ```text
//! table -> images     wanted light that the table can show
//!          folder     pictures to project, verify.csv, README.md
//! photographs -> session   what verify.csv and the pictures say, read back and checked
//!                expected  the light that the table expects of any input
//!                judge     errors before and after, drift, the verdict
//!                page      all of it for people, with maps of the worst cells
//! ```

mod error;
mod expected;
mod folder;
mod images;
mod judge;
mod manifest;
mod maps;
mod page;
mod readings;
mod response;
#[cfg(test)]
#[path = "../../../compile/src/test_scene.rs"]
mod test_scene;

pub use error::VerifyError;
pub use expected::Expected;
pub use folder::{Written, write};
pub use images::{TestImage, test_images};
pub use judge::{Bound, Drift, ImageVerdict, TableVerdict, WhiteChange, WorstCell, judge};
pub use manifest::{VerifyManifest, VerifyRole, VerifyShot};
pub use maps::pictures;
pub use page::{html, reason};
pub use readings::{Readings, Shown};
pub use response::ProjectorCurves;
