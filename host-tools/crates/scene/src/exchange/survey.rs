//! Which surfaces face each other, and what stands between them.

use super::report::{ExchangeReport, FacetPair};
use super::{Occlusion, Patch};
use crate::form_factor::facing;
use crate::form_factor::shaft::{Hull, blocks_all, may_block};
use crate::geometry::{Obstacles, Polygon};
use rayon::prelude::*;

/// Pairs for which third surfaces are looked for: all of a scene of a few hundred
/// surfaces.
const MOST_SURVEYED: usize = 20_000;

/// Fills in how the surfaces that carry patches stand to each other.
pub(super) fn survey(
    patches: &[Patch],
    obstacles: &Obstacles,
    occlusion: Occlusion,
    report: &mut ExchangeReport,
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
    report.pairs = listed.take(ExchangeReport::MOST_PAIRS).collect();
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
