//! What an exchange consists of and what it took.

/// How two surfaces that both carry patches stand to each other.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FacetPair {
    /// The two surfaces, the smaller index first.
    pub facets: (usize, usize),
    /// A third one that reaches between them.
    pub between: Option<usize>,
    /// Whether a single third one blocks all light between them.
    pub blocked: bool,
}

/// What an [`Exchange`](super::Exchange) consists of and what it took.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct ExchangeReport {
    /// Number of patches.
    pub patches: usize,
    /// Pairs of surfaces that face each other.
    pub facing: usize,
    /// Pairs of surfaces that cannot light each other, wherever third ones are.
    pub not_facing: usize,
    /// Pairs that face each other and for which third surfaces were looked for: all
    /// of them up to 20,000, none if occlusion is ignored.
    pub surveyed: usize,
    /// Pairs of those that a third surface may stand between.
    pub occludable: usize,
    /// Pairs of those that a single third surface blocks wholly.
    pub blocked: usize,
    /// The pairs that were looked at, those with something between first, at most
    /// [`ExchangeReport::MOST_PAIRS`].
    pub pairs: Vec<FacetPair>,
    /// Blocks stored in full; 1 if there is one dense matrix.
    pub dense_blocks: usize,
    /// Blocks stored as a product of two thin matrices.
    pub low_rank_blocks: usize,
    /// Largest number of columns of those.
    pub largest_rank: usize,
    /// Bytes stored.
    pub bytes: usize,
    /// Form factors evaluated.
    pub evaluated: u64,
    /// Form factors of those for which visibility was tested.
    pub visibility_tested: u64,
    /// The most by which a row sum was above 1 before all were scaled to at most 1.
    pub excess: f64,
    /// Seconds to find all this.
    pub seconds: f64,
}

impl ExchangeReport {
    /// Pairs of surfaces that are listed one by one.
    pub const MOST_PAIRS: usize = 64;
}
