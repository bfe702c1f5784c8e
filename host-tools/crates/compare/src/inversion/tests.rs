//! What every way to invert has to stand.

use super::{Cancellation, Clustered, Exact, Inversion, KnownTransport, StoredElements, all};
use crate::Unfit;
use crate::benchmark::invert;
use crate::known_scene::KnownScene;
use iltm_solve::inverted;
use nalgebra::{DMatrix, DVector};

/// `T^-1 = (I - r 11^T / N) / r` inside of a sphere.
#[test]
fn ways_that_are_exact_find_a_spheres_inverse() {
    let before = KnownScene::sphere(4, 5, 0.7);
    let wanted = KnownScene::sphere_inverse(20, 0.7);
    let exact: [&dyn Inversion; 4] = [
        &Exact,
        &Cancellation,
        &Clustered {
            limit: 20,
            lumped: false,
        },
        &StoredElements { columns: 20 },
    ];
    for method in exact {
        let off = (before.matrix(method) - &wanted).norm();
        assert!(off < 1e-11 * wanted.norm(), "{}: {off:e}", method.name());
    }
}

/// Those that cannot be exact on cells that do not light each other, and why.
const NOT_EXACT: [&str; 5] = [
    // Gains that differ are not sparse in Haar.
    "wavelet",
    // Has one gain for all.
    "no compensation",
    // Has half of the resolution.
    "pseudo-inverse",
    // The lens.
    "out of focus",
    // A step for each different gain.
    "optical GMRES, steps",
];

#[test]
fn cells_that_do_not_light_each_other_are_divided_by_their_light() {
    let before = KnownScene::flat(3, 5);
    let exact = inverted(&before.transport, &before.live).unwrap();
    let wanted = DVector::from_fn(15, |cell, _| {
        if before.live[cell] {
            0.1 + 0.01 * cell as f64
        } else {
            0.0
        }
    });
    for method in all(&[]) {
        let name = method.name();
        let scaled = name.ends_with("scaled by flood");
        if NOT_EXACT.iter().any(|start| name.starts_with(start)) && !scaled {
            continue;
        }
        let drive = before.drive(method.as_ref(), &wanted);
        let off = (drive - &exact * &wanted).norm();
        assert!(off < 1e-7, "{name}: {off:e}");
    }
}

#[test]
fn a_single_cell_is_a_division() {
    let before = KnownScene::new(1, 1, DMatrix::from_element(1, 1, 0.5), vec![true]);
    for method in all(&[]) {
        if method.name().starts_with("out of focus") {
            continue;
        }
        let drive = before.drive(method.as_ref(), &DVector::from_element(1, 0.2));
        assert!((drive[0] - 0.4).abs() < 1e-6, "{}: {drive}", method.name());
    }
}

/// Whatever is asked, dead cells are not driven and every number is one.
#[test]
fn dead_cells_stay_dark_on_every_grid() {
    for (rows, cols) in [(1, 7), (3, 5), (5, 2)] {
        let cells = usize::from(rows) * usize::from(cols);
        let full = KnownScene::panels(rows, cols).transport;
        let live: Vec<bool> = (0..cells)
            .map(|cell| cell != 1 && cell != cells - 1)
            .collect();
        let seen = |i: usize, j: usize| {
            if live[i] && live[j] {
                full[(i, j)]
            } else {
                0.0
            }
        };
        let transport = DMatrix::from_fn(cells, cells, seen);
        let before = KnownScene::new(rows, cols, transport, live.clone());
        let wanted = DVector::from_element(cells, 0.3);
        for method in all(&[]) {
            let drive = before.drive(method.as_ref(), &wanted);
            assert!(drive.iter().all(|p| p.is_finite()), "{}", method.name());
            let dark = |cell: usize| live[cell] || drive[cell].abs() < 1e-300;
            assert!((0..cells).all(dark), "{}: {drive}", method.name());
        }
    }
}

/// Darkness, one light that is never seen, two cells that look alike, negative light,
/// and the largest numbers: an answer or a reason, never a panic.
#[test]
fn transports_that_have_no_inverse_are_answered_or_refused() {
    let mut unseen = KnownScene::panels(2, 3).transport;
    unseen.row_mut(2).fill(0.0);
    let mut alike = KnownScene::panels(2, 3).transport;
    let copy = alike.row(0).into_owned();
    alike.set_row(3, &copy);
    let hard = [
        DMatrix::zeros(6, 6),
        DMatrix::from_element(6, 6, 0.1),
        DMatrix::from_element(6, 6, f64::MAX),
        DMatrix::from_element(6, 6, f64::MIN_POSITIVE),
        -KnownScene::panels(2, 3).transport,
        unseen,
        alike,
    ];
    let wanted = DVector::from_element(6, 0.2);
    for transport in hard {
        let scene = KnownScene::new(2, 3, transport, vec![true; 6]);
        let known = scene.known();
        for method in all(&[]) {
            match method.invert(known) {
                Ok(found) => {
                    assert_eq!(found.answer.input(&wanted).len(), 6);
                }
                Err(why) => assert!(matches!(why, Unfit::Singular | Unfit::Condition(_))),
            }
        }
        let dead = vec![false; 6];
        let none = KnownTransport {
            live: &dead,
            ..known
        };
        for method in all(&[])
            .into_iter()
            .filter(|method| method.name() != "exact inverse")
        {
            assert!(method.invert(none).is_err(), "{}", method.name());
        }
    }
}

/// The floor and the ceiling of what can be had: between them is everybody who knows of
/// light between cells, as long as his series converges.
#[test]
fn on_a_moderate_scene_every_method_is_between_floor_and_ceiling() {
    let before = KnownScene::panels(8, 12);
    let truth = before.truth();
    let compensation = |name: &str| {
        let method = all(&[]).into_iter().find(|method| method.name() == name);
        let row = invert(method.unwrap().as_ref(), before.known(), &truth, None);
        row.result.unwrap().errors.compensation
    };
    let floor = compensation("gain of each cell, d / flood");
    let ceiling = compensation("bounded least squares");
    assert!(ceiling < 0.01 && 5.0 * ceiling < floor);
    for name in [
        "exact inverse",
        "interreflection cancellation",
        "Neumann series, order 8",
        "Jacobi, sweeps 3",
        "Gauss-Seidel, sweeps 3",
        "optical GMRES, steps 8",
    ] {
        let error = compensation(name);
        assert!(ceiling - 1e-7 <= error && error < floor, "{name}: {error}");
    }
}
