//! Occlusion survey: which surfaces face each other, and what stands between them.

use super::{Element, Occlusion};
use crate::form_factor::facing;
use crate::form_factor::shaft::{Hull, blocks_all, may_block};
use crate::geometry::{Obstacles, Polygon};
use rayon::prelude::*;

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

/// What a [`FormFactorMatrix`](super::FormFactorMatrix) consists of and what it took.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct FormFactorReport {
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
    /// [`FormFactorReport::MOST_PAIRS`].
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

impl FormFactorReport {
    /// Pairs of surfaces that are listed one by one.
    pub const MOST_PAIRS: usize = 64;
}

/// Pairs for which third surfaces are looked for: all of a scene of a few hundred
/// surfaces.
const MOST_SURVEYED: usize = 20_000;

/// Fills in how the surfaces that carry patches stand to each other.
pub(super) fn survey(
    patches: &[Element],
    obstacles: &Obstacles,
    occlusion: Occlusion,
    report: &mut FormFactorReport,
) {
    let mut facets: Vec<usize> = patches.iter().map(|p| p.facet).collect();
    facets.sort_unstable();
    facets.dedup();
    let polygons = obstacles.facets();
    let pairs: Vec<(usize, usize)> = facets
        .par_iter()
        .enumerate()
        .flat_map_iter(|(k, a)| {
            let others = facets[k + 1..].iter();
            let face = others.filter(move |b| facing(&polygons[*a], &polygons[**b]));
            face.map(move |b| (*a, *b))
        })
        .collect();
    report.facing = pairs.len();
    report.not_facing = facets.len() * facets.len().saturating_sub(1) / 2 - pairs.len();
    if occlusion == Occlusion::Ignore {
        return;
    }
    report.surveyed = pairs.len().min(MOST_SURVEYED);
    let found: Vec<FacetPair> = pairs[..report.surveyed]
        .par_iter()
        .map(|pair| between(*pair, polygons))
        .collect();
    report.occludable = found.iter().filter(|p| p.between.is_some()).count();
    report.blocked = found.iter().filter(|p| p.blocked).count();
    let (with, without): (Vec<_>, Vec<_>) = found.into_iter().partition(|p| p.between.is_some());
    let listed = with.into_iter().chain(without);
    report.pairs = listed.take(FormFactorReport::MOST_PAIRS).collect();
}

fn between((a, b): (usize, usize), polygons: &[Polygon]) -> FacetPair {
    let ends = [(a, b), (b, a)].map(|(own, other)| {
        let part = polygons[own].clipped(polygons[other].plane());
        Hull::of(part.as_ref().unwrap_or(&polygons[own]))
    });
    let others = (0..polygons.len()).filter(|o| *o != a && *o != b);
    let mut pair = FacetPair {
        facets: (a, b),
        between: None,
        blocked: false,
    };
    for other in others {
        if may_block(&ends[0], &ends[1], &polygons[other]) {
            let blocked = blocks_all(&ends[0], &ends[1], &polygons[other]);
            if pair.between.is_none() || blocked {
                pair.between = Some(other);
            }
            if blocked {
                pair.blocked = true;
                break;
            }
        }
    }
    pair
}
