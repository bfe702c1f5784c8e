//! Form factor matrix entries: the exchange of two patches.

use super::{Element, FormFactorOptions, Occlusion};
use crate::form_factor::visible::visible_share;
use crate::form_factor::{Sampled, Tolerance, ordered, sampled_in_front};
use crate::geometry::Polygon;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Evaluates entries of the symmetric exchange `S_pq / sqrt(A_p A_q)`, without unit.
pub(super) struct Entries<'a> {
    patches: Vec<Sampled>,
    facet: Vec<usize>,
    obstacles: &'a [Polygon],
    everything: Vec<usize>,
    tolerance: Tolerance,
    visibility: Tolerance,
    occlusion: Occlusion,
    evaluated: AtomicU64,
    tested: AtomicU64,
}

/// What is known of the pairs of patches in a block.
#[derive(Clone, Debug)]
pub(super) struct KnownVisibility {
    /// All are wholly in front of each other's planes.
    pub(super) in_front: bool,
    /// Obstacles that may stand between.
    pub(super) between: Vec<usize>,
}

impl<'a> Entries<'a> {
    pub(super) fn new(
        patches: &[Element],
        obstacles: &'a [Polygon],
        options: &FormFactorOptions,
    ) -> Self {
        Self {
            patches: patches
                .iter()
                .map(|p| Sampled::new(p.polygon.clone()))
                .collect(),
            facet: patches.iter().map(|p| p.facet).collect(),
            obstacles,
            everything: (0..obstacles.len()).collect(),
            tolerance: options.tolerance,
            visibility: options.visibility,
            occlusion: options.occlusion,
            evaluated: AtomicU64::new(0),
            tested: AtomicU64::new(0),
        }
    }

    /// One entry.
    pub(super) fn entry(&self, p: usize, q: usize, known: &KnownVisibility) -> f64 {
        if self.facet[p] == self.facet[q] {
            return 0.0;
        }
        self.evaluated.fetch_add(1, Relaxed);
        let (a, b) = (&self.patches[p], &self.patches[q]);
        let sizes = (a.polygon().area() * b.polygon().area()).sqrt();
        let between = match self.occlusion {
            Occlusion::Ignore => &[][..],
            Occlusion::Decide => &known.between,
            Occlusion::Everywhere => &self.everything,
        };
        if known.in_front {
            self.between_parts(a, b, between) / sizes
        } else {
            self.clipped(a, b, between) / sizes
        }
    }

    /// Of patches that may reach behind each other's planes.
    fn clipped(&self, a: &Sampled, b: &Sampled, between: &[usize]) -> f64 {
        sampled_in_front(a, b).map_or(0.0, |(a, b)| self.between_parts(&a, &b, between))
    }

    fn between_parts(&self, a: &Sampled, b: &Sampled, between: &[usize]) -> f64 {
        let whole = a.exchange_area(b, self.tolerance);
        if whole == 0.0 || between.is_empty() {
            return whole;
        }
        self.tested.fetch_add(1, Relaxed);
        let (first, second) = ordered(a.polygon(), b.polygon());
        let between: Vec<_> = between.iter().map(|o| &self.obstacles[*o]).collect();
        whole * visible_share(first, second, self.visibility, &between)
    }

    /// Entries evaluated so far, and those for which visibility was tested.
    pub(super) fn counts(&self) -> (u64, u64) {
        (self.evaluated.load(Relaxed), self.tested.load(Relaxed))
    }

    pub(super) fn patch(&self, p: usize) -> &Polygon {
        self.patches[p].polygon()
    }
}
