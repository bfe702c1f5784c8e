//! Patches: the pieces that surfaces are cut into, of one radiosity each.
//!
//! What the projector lights is cut along the borders of its cells, so that a patch
//! gets light from one cell only (while nothing is blurred). What lies beside the
//! frame, and the sides that are turned away from the projector, are cut into pieces
//! of about a cell's size.

use super::facets::{Facets, NEAREST};
use super::geometry::{Plane, Polygon};
use super::pinhole::Pinhole;
use nalgebra::Vector3;
use std::collections::HashMap;

/// Side of a piece that no cell lights, in sides of a mean patch in the frame.
const COARSE: f64 = 2.0;
/// Samples along each side of a patch that its albedo is averaged over.
const ALBEDO_SAMPLES: usize = 8;

/// A flat piece of a surface.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    /// Where it is; its normal is on the side that reflects.
    pub polygon: Polygon,
    /// Which facet it is part of.
    pub facet: usize,
    /// Whether it is the side that is turned away from the projector.
    pub back: bool,
    /// The projector's cell whose frame it is in, `row * cols + col`; `None` beside
    /// the frame and on back sides.
    pub cell: Option<u32>,
    /// Mean diffuse reflectance, by channel.
    pub albedo: [f64; 3],
}

/// What is to be cut.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct PatchExtent {
    /// Whether what lies beside the frame is cut as well.
    pub surroundings: bool,
    /// Whether back sides are.
    pub backs: bool,
}

/// All patches of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Patches {
    rows: usize,
    cols: usize,
    all: Vec<Patch>,
    /// Patch of a facet in a cell.
    in_frame: HashMap<(usize, usize), usize>,
    /// Other patches by facet and side.
    beside: HashMap<(usize, bool), Vec<BesidePatch>>,
}

/// A patch that no cell of the projector lights, and a sphere around it.
#[derive(Clone, Copy, Debug)]
struct BesidePatch {
    index: usize,
    centre: Vector3<f64>,
    /// A little more than its radius, squared.
    reach: f64,
}

impl BesidePatch {
    fn new(index: usize, polygon: &Polygon) -> Self {
        let centre = polygon.centroid();
        let distances = polygon
            .corners()
            .iter()
            .map(|corner| (corner - centre).norm_squared());
        Self {
            index,
            centre,
            reach: 1.01 * distances.fold(0.0, f64::max),
        }
    }
}

impl Patches {
    /// Cuts all facets.
    pub(crate) fn new(facets: &Facets<'_>, cut: PatchExtent) -> Self {
        let projector = facets.projector();
        let mut patches = Self {
            rows: projector.grid.rows(),
            cols: projector.grid.cols(),
            all: Vec::new(),
            in_frame: HashMap::new(),
            beside: HashMap::new(),
        };
        let mut beside = Vec::new();
        for facet in 0..facets.count() {
            let polygon = facets.polygon(facet);
            // A surface seen edge-on gets no light.
            let lit = polygon.plane().distance(&projector.view.position()) > 0.0;
            let (inside, outside) = split_by_frame(polygon, &projector.view);
            match inside {
                Some(inside) if lit => patches.cut_cells(facets, facet, &inside),
                Some(inside) => beside.push((facet, false, inside)),
                None => {}
            }
            if cut.surroundings {
                beside.extend(outside.into_iter().map(|part| (facet, false, part)));
            }
            if cut.backs {
                beside.push((facet, true, polygon.flipped()));
            }
        }
        let side = patches.piece_side(facets);
        for (facet, back, part) in beside {
            let mut pieces = Vec::new();
            chop(part, side, &mut pieces);
            for piece in pieces {
                let index = patches.push(facets, piece, facet, back, None);
                let patch = BesidePatch::new(index, &patches.all[index].polygon);
                patches.beside.entry((facet, back)).or_default().push(patch);
            }
        }
        patches
    }

    /// The patches.
    pub(crate) fn all(&self) -> &[Patch] {
        &self.all
    }

    /// The patch at a point of a facet; `None` where nothing was cut. The patch `before` is likely
    /// to be this one too, and is tried first.
    pub(crate) fn at(
        &self,
        view: &Pinhole,
        facet: usize,
        back: bool,
        world: &Vector3<f64>,
        before: Option<usize>,
    ) -> Option<usize> {
        if !back && let Some(patch) = self.in_cell(view, facet, world) {
            return Some(patch);
        }
        let same = |patch: &Patch| {
            (patch.facet, patch.back, patch.cell) == (facet, back, None)
                && patch.polygon.contains(world)
        };
        if let Some(before) = before.filter(|before| same(&self.all[*before])) {
            return Some(before);
        }
        let candidates = self.beside.get(&(facet, back))?;
        let distance = |patch: &BesidePatch| (patch.centre - world).norm_squared();
        let inside = |patch: &&BesidePatch| {
            distance(patch) <= patch.reach && self.all[patch.index].polygon.contains(world)
        };
        let found = candidates.iter().find(inside);
        // Rounding leaves points on the borders between pieces to neither.
        let found = found.or_else(|| {
            candidates
                .iter()
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        });
        found.map(|patch| patch.index)
    }

    fn in_cell(&self, view: &Pinhole, facet: usize, world: &Vector3<f64>) -> Option<usize> {
        let place = view.place(world)?;
        let inside = |x: f64| (0.0..1.0).contains(&x);
        if !inside(place.across) || !inside(place.down) {
            return None;
        }
        let col = (place.across * self.cols as f64) as usize;
        let row = (place.down * self.rows as f64) as usize;
        let cell = row.min(self.rows - 1) * self.cols + col.min(self.cols - 1);
        self.in_frame.get(&(facet, cell)).copied()
    }

    /// Cuts the part of a facet that is in the frame along rows and columns.
    fn cut_cells(&mut self, facets: &Facets<'_>, facet: usize, part: &Polygon) {
        let view = &facets.projector().view;
        let columns = range(part, self.cols, |c| view.place(c).map(|p| p.across));
        for col in columns {
            let [left, right] =
                [col, col + 1].map(|c| view.column_plane(c as f64 / self.cols as f64));
            let Some(strip) = between(part, &left, &right) else {
                continue;
            };
            let rows = range(&strip, self.rows, |c| view.place(c).map(|p| p.down));
            for row in rows {
                let [top, bottom] =
                    [row, row + 1].map(|r| view.row_plane(r as f64 / self.rows as f64));
                let Some(piece) = between(&strip, &top, &bottom) else {
                    continue;
                };
                let cell = row * self.cols + col;
                let index = self.push(facets, piece, facet, false, Some(cell as u32));
                self.in_frame.insert((facet, cell), index);
            }
        }
    }

    fn push(
        &mut self,
        facets: &Facets<'_>,
        polygon: Polygon,
        facet: usize,
        back: bool,
        cell: Option<u32>,
    ) -> usize {
        let albedo = mean_albedo(facets, facet, &polygon);
        self.all.push(Patch {
            polygon,
            facet,
            back,
            cell,
            albedo,
        });
        self.all.len() - 1
    }

    /// Side of the pieces that no cell lights, metres.
    fn piece_side(&self, facets: &Facets<'_>) -> f64 {
        let lit: f64 = self.all.iter().map(|patch| patch.polygon.area()).sum();
        let area = if lit > 0.0 {
            lit / self.all.len() as f64
        } else {
            let total: f64 = (0..facets.count()).map(|f| facets.polygon(f).area()).sum();
            total / (self.rows * self.cols) as f64
        };
        COARSE * area.sqrt()
    }
}

/// The part of a facet in the projector's frame, and what is beside it.
pub(super) fn split_by_frame(polygon: &Polygon, view: &Pinhole) -> (Option<Polygon>, Vec<Polygon>) {
    let borders = [
        view.depth_plane(NEAREST),
        view.column_plane(0.0),
        view.column_plane(1.0).flipped(),
        view.row_plane(0.0),
        view.row_plane(1.0).flipped(),
    ];
    let mut outside = Vec::new();
    let mut inside = polygon.clone();
    for border in borders {
        outside.extend(inside.clipped(&border.flipped()));
        match inside.clipped(&border) {
            Some(part) => inside = part,
            None => return (None, outside),
        }
    }
    (Some(inside), outside)
}

/// The part in front of one plane and behind the other.
fn between(polygon: &Polygon, first: &Plane, second: &Plane) -> Option<Polygon> {
    polygon.clipped(first)?.clipped(&second.flipped())
}

/// Rows or columns that a polygon reaches.
fn range(
    polygon: &Polygon,
    count: usize,
    place: impl Fn(&Vector3<f64>) -> Option<f64>,
) -> std::ops::Range<usize> {
    let places = || polygon.corners().iter().filter_map(&place);
    let low = places().fold(f64::INFINITY, f64::min) * count as f64;
    let high = places().fold(f64::NEG_INFINITY, f64::max) * count as f64;
    let low = (low + 1e-9).floor().max(0.0) as usize;
    let high = (high - 1e-9).ceil().max(0.0) as usize;
    low..high.min(count)
}

/// Cuts a piece across its longest side until it is small enough.
fn chop(piece: Polygon, side: f64, pieces: &mut Vec<Polygon>) {
    let corners = piece.corners();
    let longest = piece
        .edges()
        .map(|(a, b)| b - a)
        .max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    let direction = longest.and_then(|edge| edge.try_normalize(0.0));
    let Some(direction) = direction else {
        return;
    };
    let extent = |way: &Vector3<f64>| {
        let along = || corners.iter().map(|c| c.dot(way));
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
    };
    let across = piece.normal().cross(&direction);
    let ways = [direction, across];
    let widest = ways
        .iter()
        .max_by(|a, b| extent(a).total_cmp(&extent(b)))
        .copied()
        .unwrap_or(direction);
    if extent(&widest) <= side {
        pieces.push(piece);
        return;
    }
    let plane = Plane::through(piece.centroid(), widest);
    let halves = [piece.clipped(&plane), piece.clipped(&plane.flipped())];
    for half in halves.into_iter().flatten() {
        chop(half, side, pieces);
    }
}

fn mean_albedo(facets: &Facets<'_>, facet: usize, polygon: &Polygon) -> [f64; 3] {
    use super::description::Albedo;
    let albedo = &facets.scene().panels[facets.panel(facet)].albedo;
    if let Albedo::Uniform(channels) = albedo {
        return *channels;
    }
    let described = facets.described(facet);
    let (mut sum, mut weight) = ([0.0; 3], 0.0);
    for (place, share) in samples(polygon, ALBEDO_SAMPLES) {
        let channels = albedo.at(described, &place);
        for (sum, value) in sum.iter_mut().zip(channels) {
            *sum += share * value;
        }
        weight += share;
    }
    sum.map(|sum| sum / weight)
}

/// Places spread over a polygon, each with the area that it stands for: every
/// triangle of its fan is sampled along `count` lines.
pub(super) fn samples(
    polygon: &Polygon,
    count: usize,
) -> impl Iterator<Item = (Vector3<f64>, f64)> + '_ {
    let corners = polygon.corners();
    let first = corners[0];
    let steps = count as f64;
    corners[1..].windows(2).flat_map(move |pair| {
        let (a, b) = (pair[0] - first, pair[1] - first);
        let doubled = a.cross(&b).norm();
        (0..count * count).map(move |k| {
            let (s, t) = ((k / count) as f64 + 0.5, (k % count) as f64 + 0.5);
            let (s, t) = (s / steps, t / steps);
            // A square folded onto a triangle; the area goes with s.
            let place = first + s * ((1.0 - t) * a + t * b);
            (place, doubled * s / (steps * steps))
        })
    })
}
