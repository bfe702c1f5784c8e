//! Options of a [`FormFactorMatrix`](super::FormFactorMatrix), and why one was refused.

use crate::form_factor::Tolerance;
use thiserror::Error;

/// Where visibility is tested.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Occlusion {
    /// Only between patches that something could stand between.
    #[default]
    Decide,
    /// Nowhere: surfaces shine through each other.
    Ignore,
    /// Between all patches, against all surfaces: what `Decide` must agree with,
    /// at many times the cost.
    Everywhere,
}

/// How exact and how large a [`FormFactorMatrix`](super::FormFactorMatrix) may be.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FormFactorOptions {
    /// Relative error of each form factor that is evaluated.
    pub tolerance: Tolerance,
    /// Error of each that obstacles hide in part, relative to the geometric mean of what they
    /// leave and the whole.
    pub visibility: Tolerance,
    /// Relative error of the irradiance that blocks of low rank may add, on top.
    pub compression: f64,
    /// Where visibility is tested.
    pub occlusion: Occlusion,
    /// Two groups of patches whose distance is the diameter of the smaller divided by
    /// this may be stored with low rank.
    pub separation: f64,
    /// Patches that are grouped no further.
    pub leaf: usize,
    /// Number of patches up to which one dense matrix is kept.
    pub dense_limit: usize,
    /// Bytes that the blocks may take; beyond, the exchange is refused.
    pub most_bytes: usize,
}

impl Default for FormFactorOptions {
    /// Irradiance to better than 1e-4 where nothing is hidden in part, dense up to 1024 patches (8 MB), at most 1.5 GB.
    fn default() -> Self {
        Self {
            tolerance: Tolerance::default(),
            visibility: Tolerance::new(2e-3),
            compression: 2e-5,
            occlusion: Occlusion::default(),
            separation: 2.0,
            leaf: 48,
            dense_limit: 1024,
            most_bytes: 1_500_000_000,
        }
    }
}

/// Why patches have no [`FormFactorMatrix`](super::FormFactorMatrix).
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum FormFactorError {
    /// A patch names a surface that is not among the obstacles.
    #[error("patch {patch} lies on surface {facet}, but there are only {facets} surfaces")]
    NoSuchFacet {
        /// Index of the patch.
        patch: usize,
        /// The surface that it names.
        facet: usize,
        /// How many there are.
        facets: usize,
    },
    /// The blocks take too much memory.
    #[error(
        "the light exchanged by {patches} patches takes more than {limit} bytes; \
         use fewer patches, or allow more memory"
    )]
    TooLarge {
        /// Number of patches.
        patches: usize,
        /// Bytes that were allowed.
        limit: usize,
    },
}
