//! The bounds against exact constants, found by going through every support.

use super::super::forward::Inverse;
use super::super::haar::Haar;
use super::super::test_scene::{Corner, patterns};
use super::*;
use iltm_runtime::Grid;
use nalgebra::DVector;

fn haar(rows: u16, cols: u16) -> Haar {
    Haar::new(Grid::new(rows, cols).unwrap())
}

/// `W`, column by column.
fn basis(haar: &Haar) -> DMatrix<f64> {
    let cells = haar.grid().cells();
    haar.synthesise_columns(&DMatrix::identity(cells, cells))
}

/// Entries of +1 and -1.
fn random_signs(cells: usize, photographs: usize, seed: u64) -> DMatrix<f64> {
    let mut random = fastrand::Rng::with_seed(seed);
    DMatrix::from_fn(
        cells,
        photographs,
        |_, _| if random.bool() { 1.0 } else { -1.0 },
    )
}

/// Every support of `size` coefficients of `cells`.
fn supports(cells: usize, size: usize) -> Vec<Vec<usize>> {
    (0_u32..1 << cells)
        .filter(|set| set.count_ones() as usize == size)
        .map(|set| (0..cells).filter(|k| set >> k & 1 == 1).collect())
        .collect()
}

/// Squares of the extreme singular values over all supports, as largest over smallest.
fn exact(matrix: impl Fn(&[usize]) -> DMatrix<f64>, supports: &[Vec<usize>]) -> f64 {
    let (mut most, mut least) = (0.0_f64, f64::INFINITY);
    for support in supports {
        let values = matrix(support).singular_values();
        most = most.max(values.max());
        least = least.min(values.min());
    }
    (most / least).powi(2)
}

#[test]
fn exact_constants_of_small_problems_lie_between_the_bounds() {
    let haar = haar(2, 5);
    let w = basis(&haar);
    let cells = w.nrows();
    for seed in 0..12 {
        let mut random = fastrand::Rng::with_seed(seed);
        let spread = 0.02 + 0.02 * seed as f64;
        let transport = DMatrix::from_fn(cells, cells, |i, j| {
            f64::from(u8::from(i == j)) + spread * random.f64()
        });
        // From few photographs to so many that discs stay away from zero.
        let photographs = [14, 40, 4000][seed as usize % 3];
        let patterns = random_signs(cells, photographs, seed);
        let forward = transport.transpose() * &w;
        let sensed = patterns.transpose() * &forward;
        let sensing = Sensing::new(&transport, &haar, &patterns);
        for k in [1, 2] {
            let all = supports(cells, 2 * k);
            let kappa = exact(|s| forward.select_columns(s), &all).sqrt();
            let ratio = exact(|s| sensed.select_columns(s), &all);
            // Images of one support by an orthonormal basis of them, whose singular
            // values are the quotients.
            let gamma = exact(
                |s| patterns.transpose() * forward.select_columns(s).qr().q(),
                &all,
            );
            for random in [0, 300] {
                let sampling = Sampling {
                    random,
                    ..Sampling::default()
                };
                let bounds = sensing.bounds(k, sampling);
                for (bounds, exact) in [
                    (bounds.kappa, kappa),
                    (bounds.gamma, gamma),
                    (bounds.ratio, ratio),
                    (bounds.product, kappa * kappa * gamma),
                ] {
                    assert!(bounds.lower <= exact * (1.0 + 1e-9), "{bounds:?} {exact}");
                    assert!(bounds.upper >= exact * (1.0 - 1e-9), "{bounds:?} {exact}");
                    // Most of 45 or 210 supports are among so many.
                    assert!(
                        random == 0 || bounds.lower > 0.8 * exact,
                        "{bounds:?} {exact}"
                    );
                }
                assert!(bounds.product.lower >= bounds.ratio.lower * (1.0 - 1e-9));
                // Discs stay away from zero where columns are nearly orthogonal.
                let near = seed == 2 && k == 1;
                assert!(!near || bounds.ratio.upper.is_finite(), "{bounds:?}");
            }
        }
    }
}

#[test]
fn an_orthonormal_transport_has_kappa_one_and_orthogonal_patterns_gamma_one() {
    let haar = haar(4, 4);
    // Any orthonormal matrix will do for T; Hadamard's for the patterns (Sylvester).
    let transport = basis(&super::tests::haar(2, 8));
    let sign = |i: usize, j: usize| {
        if (i & j).count_ones().is_multiple_of(2) {
            1.0
        } else {
            -1.0
        }
    };
    let hadamard = DMatrix::from_fn(16, 16, sign);
    for k in [1, 3, 8] {
        let sensing = Sensing::new(&transport, &haar, &hadamard);
        let bounds = sensing.bounds(k, Sampling::default());
        for bounds in [bounds.kappa, bounds.gamma, bounds.ratio, bounds.product] {
            assert!((bounds.lower - 1.0).abs() < 1e-9, "{bounds:?}");
            assert!((bounds.upper - 1.0).abs() < 1e-9, "{bounds:?}");
        }
        assert!(bounds.product.upper < LIMIT);
    }
}

#[test]
fn fewer_photographs_than_coefficients_have_no_finite_gamma() {
    let haar = haar(4, 4);
    let bounds = |k| {
        let patterns = random_signs(16, 12, 3);
        Sensing::new(&DMatrix::identity(16, 16), &haar, &patterns).bounds(k, Sampling::default())
    };
    assert!(bounds(7).gamma.lower.is_infinite());
    assert!((bounds(7).kappa.lower - 1.0).abs() < 1e-9);
    assert!(bounds(1).gamma.lower < f64::INFINITY);
}

#[test]
fn more_supports_never_weaken_a_bound() {
    let haar = haar(5, 7);
    let corner = Corner::new(5, 7, |cell| 0.4 + 0.1 * (cell % 5) as f64);
    let transport = corner.inverse().try_inverse().unwrap();
    let patterns = random_signs(35, 25, 9);
    let sensing = Sensing::new(&transport, &haar, &patterns);
    let lower = |random| {
        let sampling = Sampling {
            random,
            ..Sampling::default()
        };
        sensing.bounds(3, sampling).product.lower
    };
    assert!(lower(0) <= lower(40) && lower(40) <= lower(400));
    // The greedy ones alone find more than many at random do.
    let blind = Sampling {
        starts: 0,
        random: 400,
        ..Sampling::default()
    };
    assert!(sensing.bounds(3, blind).product.lower < lower(0));
}

/// A corner's report, and the same from its dense transport.
fn corner_report(cells: (usize, usize), photographs: usize) -> (Recovery, RecoveryBounds) {
    let haar = haar(cells.0 as u16, cells.1 as u16);
    let corner = Corner::new(cells.0, cells.1, |cell| 0.5 + 0.1 * (cell % 4) as f64);
    let transport = corner.inverse().try_inverse().unwrap();
    let shown = patterns(cells.0 * cells.1, photographs);
    let flood = DVector::from_element(shown.nrows(), 1.0);
    let inverse = Inverse::new(corner.gain.clone(), corner.operator.clone());
    let report = of_direct(&[&inverse], &haar, &shown, &flood).unwrap();
    let combined = signed(&shown, &flood);
    let sensing = Sensing::new(&transport, &haar, &combined);
    let bounds = sensing.bounds(report.k, Sampling::default());
    (report, bounds)
}

#[test]
fn a_capture_reports_what_its_transport_and_patterns_give() {
    let (report, bounds) = corner_report((6, 8), 30);
    assert!(report.k >= 1 && report.k < 48, "{report:?}");
    assert_eq!(report.photographs, 31);
    for (found, exact) in [
        (report.kappa_at_least, bounds.kappa.lower),
        (report.gamma_at_least, bounds.gamma.lower),
        (report.product_at_least, bounds.product.lower),
        (report.ratio_at_least, bounds.ratio.lower),
        (report.kappa_at_most, bounds.kappa.upper),
    ] {
        // Light is followed until a bounce adds a millionth.
        let same =
            (found - exact).abs() < 1e-4 * exact || found.is_infinite() && exact.is_infinite();
        assert!(same, "{found} {exact}");
    }
    // The mean of patterns of 0 and 1 alone: a constant image against any other.
    assert!(report.gamma_as_shown_at_least > 10.0, "{report:?}");
    assert!(report.coherence > 0.2 && report.coherence < 1.0);
    assert_eq!(report.verdict(), Isometry::Fails);
    assert_eq!((report.k_may_hold, report.k_holds), (0, 0));
    let said = report.lines().concat();
    assert!(said.contains("promises nothing here, for no k"), "{said}");
    // Both bounds are said, or that there is but one.
    let both = said.contains("(sampled)")
        && (said.contains("(Gershgorin)") || said.contains("no bound from above"));
    assert!(both || report.product_at_least.is_infinite(), "{said}");
}

#[test]
fn many_more_photographs_than_cells_are_promised_something() {
    let haar = haar(2, 4);
    let inverse = Inverse::new(DVector::from_element(8, 1.4), DMatrix::zeros(8, 8));
    let flood = DVector::from_element(8, 1.0);
    let shown = patterns(8, 3000);
    let report = of_direct(&[&inverse], &haar, &shown, &flood).unwrap();
    assert_eq!(report.k, 1);
    assert_eq!(report.verdict(), Isometry::Holds, "{report:?}");
    assert!(
        report.k_holds >= 1 && report.k_may_hold >= report.k_holds,
        "{report:?}"
    );
    assert!(report.lines().concat().contains("finds such rows exactly"));
}

#[test]
fn large_grids_are_bounded_by_some_of_their_coefficients() {
    let (report, _) = corner_report((18, 24), 20);
    assert!(report.kappa_at_most.is_infinite());
    assert!(report.product_at_least >= LIMIT);
    assert_eq!(report.verdict(), Isometry::Fails);
}
