//! What the light exchange of many patches takes: time, memory, error.
//!
//! `cargo bench -p iltm --bench radiosity` prints one line a size for M-shaped panels whose
//! cells are no rectangles; `-- 12288` does one size, `-- vane` the panels with
//! a vane in a valley that hides parts, and
//! `-- cholesky` what the ways to the light cost where the matrix is stored whole.
//! The peak is that of building. The error is that of the irradiance of 24 patches, against form factors asked
//! to 1e-9 one by one.

#![allow(missing_docs)]

use iltm::progress::Silent;
use iltm::scene::form_factor::{Tolerance, visible_exchange_area};
use iltm::scene::geometry::{Obstacles, Polygon};
use iltm::scene::radiosity::{Element, FormFactorMatrix, FormFactorOptions, StopRule, radiosity};
use nalgebra::{DMatrix, Vector3};
use peak_alloc::PeakAlloc;
use std::time::Instant;

/// Rows and columns of cells on all four panels together.
const SIZES: [(usize, usize); 5] = [(16, 16), (32, 32), (64, 64), (96, 128), (128, 192)];
/// Columns of light: white, black, Gray code and 200 Bernoulli patterns.
const COLUMNS: usize = 230;

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    let named = |name: &str| words.iter().any(|w| w == name);
    if named("cholesky") {
        return cholesky();
    }
    println!(
        "patches  build s  stored MB  peak MB  dense  low rank  largest rank  form factors  \
         visibility  product s  light s  bounces  error"
    );
    let only: Option<usize> = words.iter().find_map(|w| w.parse().ok());
    for (rows, columns) in SIZES {
        if only.is_none_or(|only| only == rows * columns) {
            measure(&panels(rows, columns / 4, named("vane")));
        }
    }
}

/// M-shaped panels x = -2..2 by 1, z = 0,-1,0,-1,0, 2.5 high.
fn panels(rows: usize, columns: usize, vane: bool) -> (Vec<Element>, Obstacles) {
    let (mut patches, mut facets) = (Vec::new(), Vec::new());
    for k in 0..4_u8 {
        let (x, z) = (f64::from(k) - 2.0, -f64::from(k & 1));
        let slope = if k & 1 == 0 { -1.0 } else { 1.0 };
        // As the cells of a projector at an angle: wider towards one corner.
        let at = |u: f64, v: f64| {
            let u = u + 0.15 * u * (1.0 - u) * v;
            let v = v + 0.15 * v * (1.0 - v) * u;
            Vector3::new(x + u, 2.5 * v, z + slope * u)
        };
        let polygon = |u: [f64; 2], v: [f64; 2]| {
            let corners = [(u[0], v[0]), (u[1], v[0]), (u[1], v[1]), (u[0], v[1])];
            Polygon::new(corners.map(|(u, v)| at(u, v)).to_vec()).expect("a convex cell")
        };
        for i in 0..rows {
            for j in 0..columns {
                let cut = |k: usize, n: usize| [k, k + 1].map(|k| k as f64 / n as f64);
                let polygon = polygon(cut(j, columns), cut(i, rows));
                patches.push(Element {
                    polygon,
                    facet: facets.len(),
                });
            }
        }
        facets.push(polygon([0.0, 1.0], [0.0, 1.0]));
    }
    if vane {
        let corner = |y: f64, z: f64| Vector3::new(-1.0, y, z);
        let corners = vec![
            corner(0.3, -0.9),
            corner(1.2, -0.9),
            corner(1.2, 0.2),
            corner(0.3, 0.2),
        ];
        facets.push(Polygon::new(corners).expect("a convex vane"));
    }
    (patches, Obstacles::new(facets))
}

fn measure((patches, obstacles): &(Vec<Element>, Obstacles)) {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let options = FormFactorOptions {
        dense_limit: 0,
        ..FormFactorOptions::default()
    };
    let exchange = match FormFactorMatrix::new(patches, obstacles, &options, &Silent) {
        Ok(exchange) => exchange,
        Err(error) => return println!("{:7}  {error}", patches.len()),
    };
    let peak = MEMORY.peak_usage() - before;
    let light = DMatrix::from_fn(patches.len(), COLUMNS, |p, c| {
        1.0 + f64::from(u8::from((p * 7919 + c * 104_729) % 13 < 6))
    });
    let start = Instant::now();
    let irradiance = exchange.irradiance(&light);
    let product = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let solved = radiosity(
        &exchange,
        &vec![0.7; patches.len()],
        &light,
        StopRule::Share(1e-4),
    );
    let seconds = start.elapsed().as_secs_f64();
    let bounces = solved.map_or(0, |solved| solved.bounces);
    let report = exchange.report();
    println!(
        "{:7}  {:7.2}  {:9.1}  {:7.1}  {:5}  {:8}  {:12}  {:12}  {:10}  {product:9.2}  {seconds:7.2}  {bounces:7}  {:.1e}",
        patches.len(),
        report.seconds,
        report.bytes as f64 / 1e6,
        peak as f64 / 1e6,
        report.dense_blocks,
        report.low_rank_blocks,
        report.largest_rank,
        report.evaluated,
        report.visibility_tested,
        error(patches, obstacles, &light, &irradiance),
    );
}

/// The largest error of the irradiance of some patches, relative to the most that one of
/// them receives.
fn error(
    patches: &[Element],
    obstacles: &Obstacles,
    light: &DMatrix<f64>,
    irradiance: &DMatrix<f64>,
) -> f64 {
    let (mut most, mut off) = (0.0_f64, 0.0_f64);
    for k in 0..24 {
        let p = (2 * k + 1) * patches.len() / 48;
        let exchanged = |q: &Element| {
            let tolerance = Tolerance::new(1e-9);
            if q.facet == patches[p].facet {
                return 0.0;
            }
            visible_exchange_area(&patches[p].polygon, &q.polygon, tolerance, obstacles)
        };
        let known = patches
            .iter()
            .enumerate()
            .map(|(q, patch)| exchanged(patch) * light[(q, 0)]);
        let known = known.sum::<f64>() / patches[p].polygon.area();
        most = most.max(known);
        off = off.max((irradiance[(p, 0)] - known).abs());
    }
    off / most
}

/// Bounces against Cholesky's factors, in one product each.
fn cholesky() {
    println!("patches  columns  product s  Cholesky s  multiply-add costs");
    for (rows, columns) in [(16, 16), (24, 32), (32, 32)] {
        let (patches, obstacles) = panels(rows, columns / 4, false);
        let n = patches.len();
        let Ok(exchange) =
            FormFactorMatrix::new(&patches, &obstacles, &FormFactorOptions::default(), &Silent)
        else {
            return;
        };
        let light = DMatrix::from_element(n, COLUMNS, 1.0);
        let start = Instant::now();
        let once = exchange.irradiance(&light);
        let product = start.elapsed().as_secs_f64();
        let matrix = DMatrix::from_fn(n, n, |p, q| if p == q { 2.0 } else { 1e-6 });
        let start = Instant::now();
        let solved = matrix.cholesky().map(|factors| factors.solve(&once));
        let seconds = start.elapsed().as_secs_f64();
        let (size, columns) = (n as f64, COLUMNS as f64);
        let ratio = (size.powi(3) / 6.0 + size * size * columns) / (size * size * columns);
        println!(
            "{n:7}  {COLUMNS:7}  {product:9.4}  {seconds:10.4}  {:.1}",
            seconds / (product * ratio) * f64::from(u8::from(solved.is_some()))
        );
    }
}

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;
