//! Verification: whether a table keeps its promise on the wall.
//!
//! Test images are projected as they are and compensated, photographed, and compared with
//! what was wanted, cell by cell. The camera may stand elsewhere than when the table was
//! made: a Gray code among the pictures says anew where the cells are.
//!
//! ```text
//! table -> images     wanted light that the table can show
//!          folder     pictures to project, verify.csv, README.md
//!          several    the same for projectors that overlap
//!          card       numbers the slides of a film
//! photographs -> recognise  which slide each photograph of a film shows
//!                readings   what verify.csv and the pictures say, read back and checked
//!                expected  the light that the table expects of any input
//!                judge     errors before and after, drift, what they are held against
//!                chain     what a chain did that was to compensate
//!                noise     what photographs of one picture differ by
//!                pixels    what a viewer sees, at every pixel of the camera
//!                refine    photographs fed back into the table's gains
//!                outcome   passed, failed, or these photographs cannot tell; and why
//!                page      all of it for people, with maps of the worst cells
//! ```

mod card;
mod chain;
mod error;
mod expected;
mod fixed_pattern;
mod folder;
mod images;
mod judge;
mod manifest;
mod maps;
mod noise;
mod outcome;
mod page;
mod pixels;
mod readings;
mod recognise;
mod refine;
mod response;
mod several;
#[cfg(test)]
#[path = "../../../compile/src/test_scene.rs"]
mod test_scene;

pub use chain::ChainFault;
pub use error::VerifyError;
pub use expected::Expected;
pub use fixed_pattern::FixedPattern;
pub use folder::{Slides, Written, write};
pub use images::{TestImage, fine_images, test_images};
pub use judge::{Bound, Curve, Drift, ImageVerdict, TableVerdict, WhiteChange, WorstCell, judge};
pub use manifest::{VerifyManifest, VerifyRole, VerifyShot};
pub use maps::pictures;
pub use outcome::{Cause, Outcome, refused};
pub use page::{
    Handover, brightness_words, fixed_words, html, moved_words, overlap_words, reason, shift_words,
    unseen_words,
};
pub use pixels::{PixelBound, PixelVerdict};
pub use readings::{FineShown, Readings, Shown};
pub use recognise::{Recognised, recognise};
pub use refine::{Refined, refine};
pub use response::ProjectorCurves;
