//! Test support: what the tests across crates share. A scene whose inverse is known exactly
//! and its tables, devices and lines that are simulated, boards in the emulator, fuzz
//! targets, and the cases whose results the pages list.

#![allow(
    clippy::missing_panics_doc,
    clippy::must_use_candidate,
    clippy::return_self_not_must_use,
    reason = "where a helper of a test panics, that test has failed"
)]

pub mod costs;
pub mod executed;
pub mod fake_device;
pub mod firmware;
pub mod flash_simulator;
pub mod fuzz;
pub mod gates;
pub mod hard_cases;
pub mod hard_frames;
pub mod instructions;
pub mod line_faults;
pub mod made_up;
pub mod neighbours;
pub mod overlapping;
pub mod reference_pages;
pub mod rights;
pub mod simulated;
pub mod slots;
pub mod stages;
pub mod verdicts;

use ed25519_dalek::SigningKey;
use ed25519_dalek::pkcs8::EncodePrivateKey;
use ed25519_dalek::pkcs8::spki::der::pem::LineEnding;
use iltm::compile::sign::{SealTerms, sign};
use iltm::compile::{CompileOptions, FineGains, compile};
use iltm::picture::Response;
use iltm::solve::{ChannelInverse, InverseTransport};
use iltm_runtime::image::Label;
use iltm_runtime::{FrameSize, Grid};
use nalgebra::DMatrix;

/// A grid of these sides.
pub fn grid(rows: u16, cols: u16) -> Grid {
    Grid::new(rows, cols).expect("within a grid's limits")
}

/// A key that signs tables, another one for each seed.
pub fn signing_key(seed: u8) -> SigningKey {
    SigningKey::from_bytes(&[seed; 32])
}

/// The file of a private key.
pub fn key_file(key: &SigningKey) -> String {
    let pem = key.to_pkcs8_pem(LineEnding::LF);
    pem.expect("a key has a form").to_string()
}

/// The file of a table that is signed with a key, for the device of this number or, with 0,
/// for any.
pub fn signed(table: &[u8], key: &SigningKey, version: u32, oldest: u32, device: u64) -> Vec<u8> {
    let terms = SealTerms {
        version,
        oldest,
        device,
    };
    sign(table, key, terms).expect("a table")
}

/// A Lambertian wedge of two square panels at a right angle, hinged in the
/// middle column, lit evenly.
///
/// `K` is exact for point patches: `F_ij = cos_i cos_j A / (pi r^2)`, scaled where
/// needed so that no cell sends out more than it receives. With three channels
/// the albedos differ by channel and panel, and the blue channel has a small
/// deviation and half the projector's light.
pub fn wedge(grid: Grid, channels: usize) -> InverseTransport {
    let cells = grid.cells();
    let place = |cell: usize| {
        let (row, col) = (cell / grid.cols(), cell % grid.cols());
        let along = (col as f64 + 0.5) / grid.cols() as f64 * 2.0 - 1.0;
        let height = (row as f64 + 0.5) / grid.rows() as f64;
        // The left panel lies in x < 0, the right one stands up in z.
        if along < 0.0 {
            ([along, height, 0.0], [0.0, 0.0, 1.0])
        } else {
            ([0.0, height, along], [-1.0, 0.0, 0.0])
        }
    };
    let area = 2.0 / cells as f64;
    let mut shared = DMatrix::from_fn(cells, cells, |i, j| {
        let ((here, normal), (there, other)) = (place(i), place(j));
        let mut way = [0.0; 3];
        for axis in 0..3 {
            way[axis] = there[axis] - here[axis];
        }
        let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let squared = dot(way, way);
        let (leaves, arrives) = (dot(way, normal), -dot(way, other));
        if leaves <= 0.0 || arrives <= 0.0 {
            return 0.0;
        }
        leaves * arrives * area / (std::f64::consts::PI * squared * squared)
    });
    let most = shared.row_iter().map(|row| row.sum()).fold(0.0, f64::max);
    if most > 0.5 {
        shared *= 0.5 / most;
    }
    let albedo = |channel: usize, cell: usize| {
        let right = cell % grid.cols() * 2 >= grid.cols();
        [[0.8, 0.8], [0.7, 0.4], [0.45, 0.75]][channel][usize::from(right)]
    };
    let of_channel = |channel: usize| ChannelInverse {
        gain: (0..cells).map(|cell| 1.0 / albedo(channel, cell)).collect(),
        scale: if channel == 2 { 0.5 } else { 1.0 },
        deviation: (channel == 2).then(|| {
            let added = DMatrix::from_fn(cells, cells, |i, j| {
                if i != j && (i + 3 * j).is_multiple_of(17) {
                    0.002
                } else {
                    0.0
                }
            });
            added.into()
        }),
        ambient: vec![0.01; cells],
    };
    InverseTransport {
        grid,
        live: vec![true; cells],
        shared: shared.into(),
        channels: (0..channels).map(of_channel).collect(),
    }
}

/// The table image of [`wedge`] for an sRGB projector.
pub fn wedge_table(rows: u16, cols: u16, channels: usize) -> Vec<u8> {
    wedge_table_for(Response::Srgb, rows, cols, channels)
}

/// A small grey table image with this name and day.
pub fn named_table(name: &str, date: u32) -> Vec<u8> {
    let options = CompileOptions {
        label: Label::new(name, date),
        ..CompileOptions::default()
    };
    let compiled = compile(&wedge(grid(4, 6), 1), None, &options);
    compiled.expect("the wedge is a plain scene").image
}

/// A small grey table image with this many gains along each cell's sides.
pub fn fine_table(side: usize) -> Vec<u8> {
    let (rows, cols) = (4, 6);
    let size = FrameSize::new((side * cols) as u16, (side * rows) as u16);
    let size = size.expect("sides fit 16 bits");
    let fine = FineGains {
        size,
        channels: vec![vec![1.5; size.pixels()]],
    };
    let grid = grid(rows as u16, cols as u16);
    let compiled = compile(&wedge(grid, 1), Some(&fine), &CompileOptions::default());
    compiled.expect("the wedge is a plain scene").image
}

/// The table image of [`wedge`].
pub fn wedge_table_for(projector: Response, rows: u16, cols: u16, channels: usize) -> Vec<u8> {
    let options = CompileOptions {
        projector: projector.into(),
        inverse_error: 0.005,
        provenance: "scene = \"wedge\"\n".to_owned(),
        ..CompileOptions::default()
    };
    let compiled = compile(&wedge(grid(rows, cols), channels), None, &options);
    compiled.expect("the wedge is a plain scene").image
}
