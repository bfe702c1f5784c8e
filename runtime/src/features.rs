//! Cargo features: the stages that a build of this crate has. All are on by default.
//!
//! A device that will only ever see grey frames, or a dark room, can be built without
//! what those need not (`docs/firmware.md` says what each takes). A table that lists a
//! stage that is not there is refused by its check; past it, the accessors of
//! [`Table`](crate::image::Table) hide what is not built, which is all that it takes
//! for the compiler to leave the stage's code out.

use core::fmt;
use serde::{Deserialize, Serialize};

/// A stage that a table may list; gain, clip and codes in proportion to drives are
/// always there. Its numbers go over the wire: do not reorder.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Stage {
    /// Both transforms and the interreflection operator between them.
    Operator,
    /// Ambient light is taken away.
    Ambient,
    /// Codes follow the response of a projector that is not linear.
    Response,
    /// Three channels instead of one.
    Colour,
    /// Frames larger than the grid, and gains finer than its cells.
    FullResolution,
    /// Light that other projectors throw on this one's surfaces.
    Neighbours,
}

impl Stage {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 6] = [
        Self::Operator,
        Self::Ambient,
        Self::Response,
        Self::Colour,
        Self::FullResolution,
        Self::Neighbours,
    ];

    /// Whether this build has it.
    #[inline]
    #[must_use]
    pub const fn is_built(self) -> bool {
        match self {
            Self::Operator => cfg!(feature = "operator"),
            Self::Ambient => cfg!(feature = "ambient"),
            Self::Response => cfg!(feature = "response"),
            Self::Colour => cfg!(feature = "colour"),
            Self::FullResolution => cfg!(feature = "full-resolution"),
            Self::Neighbours => cfg!(feature = "neighbours"),
        }
    }

    /// The feature that builds it.
    #[must_use]
    pub const fn feature(self) -> &'static str {
        match self {
            Self::Operator => "operator",
            Self::Ambient => "ambient",
            Self::Response => "response",
            Self::Colour => "colour",
            Self::FullResolution => "full-resolution",
            Self::Neighbours => "neighbours",
        }
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Operator => "interreflection",
            Self::Ambient => "ambient light",
            Self::Response => "a projector's response",
            Self::Colour => "three channels",
            Self::FullResolution => "frames larger than the grid",
            Self::Neighbours => "the light of other projectors",
        })
    }
}
