//! Path tracer: the simulator beside photographs that an independent path tracer made of
//! the same scenes: Mitsuba 3, the sample captures. Nothing is fitted but the unit of
//! light and the ambient light.

use iltm::capture::{CaptureOptions, Manifest, Role};
use iltm::progress::Silent;
use iltm::scene::Forced;
use iltm::solve::SolveOptions;
use iltm_tests::simulated::{host_tools, scene, simulation};
use nalgebra::DMatrix;
use std::path::Path;

/// The samples are stored with 8 bits: the value is the root of the light.
const GAMMA: f64 = 2.0;

/// Photographs by channel and shot, linear light.
struct Photographs {
    roles: Vec<Role>,
    seen: Vec<Vec<Vec<f64>>>,
    simulated: Vec<Vec<Vec<f64>>>,
    width: usize,
}

impl Photographs {
    fn new(name: &str, sample: &str) -> Self {
        let scene = scene(name, &[]);
        let simulation = simulation(&scene, Forced::default());
        let folder = host_tools().join("samples").join(sample);
        let manifest = Manifest::read(&folder).unwrap();
        let open = |path: &Path| image::open(folder.join(path)).unwrap();
        let shots = &manifest.shots;
        let lit: Vec<_> = shots
            .iter()
            .map(|s| open(&s.pattern).to_luma8().into_raw())
            .collect();
        let patterns = DMatrix::from_fn(lit[0].len(), lit.len(), |cell, k| {
            f64::from(lit[k][cell]) / 255.0
        });
        let exposed = simulation.expose(&patterns).unwrap();
        let channels = simulation.channels();
        let (mut seen, mut simulated) = (vec![Vec::new(); channels], vec![Vec::new(); channels]);
        for (k, shot) in shots.iter().enumerate() {
            let picture = open(&shot.photo);
            assert_eq!(usize::from(picture.color().channel_count()), channels);
            for (channel, plane) in simulation.photograph(&exposed, k).iter().enumerate() {
                let values = picture.as_bytes().iter().skip(channel).step_by(channels);
                let light = values.map(|v| (f64::from(*v) / 255.0).powf(GAMMA));
                seen[channel].push(light.collect());
                simulated[channel].push(plane.iter().map(|v| f64::from(*v)).collect());
            }
        }
        Self {
            roles: shots.iter().map(|shot| shot.role).collect(),
            seen,
            simulated,
            width: scene.camera.size.0 as usize,
        }
    }

    /// Brings the simulated light of a channel to the photographs' unit.
    fn in_camera_units(&self, channel: usize) -> Vec<Vec<f64>> {
        let black = self.roles.iter().position(|r| *r == Role::Black).unwrap();
        let (seen, simulated) = (&self.seen[channel], &self.simulated[channel]);
        // What black shows is the ambient light, of which only the sum is compared.
        let sum = |plane: &[f64]| plane.iter().sum::<f64>();
        let (mut both, mut norm) = (0.0, 0.0);
        for (a, b) in seen.iter().zip(simulated) {
            for p in 0..a.len() {
                let lit = b[p] - simulated[black][p];
                both += (a[p] - seen[black][p]) * lit;
                norm += lit * lit;
            }
        }
        let unit = both / norm;
        let dark = sum(&seen[black]) / sum(&simulated[black]);
        let bring = |plane: &Vec<f64>| {
            let pixels = plane.iter().zip(&simulated[black]);
            pixels
                .map(|(light, black)| unit * (light - black) + dark * black)
                .collect()
        };
        simulated.iter().map(bring).collect()
    }

    /// Places of the Gray code's patterns and of their inverses.
    fn pairs(&self) -> Vec<(usize, usize)> {
        let place = |role: Role| self.roles.iter().position(|r| *r == role);
        let pair = |(k, role): (usize, &Role)| match role {
            Role::Column { inverse: false, .. } | Role::Row { inverse: false, .. } => {
                Some((k, place(role.complement()?)?))
            }
            _ => None,
        };
        self.roles.iter().enumerate().filter_map(pair).collect()
    }
}

/// Whether a pixel or one beside it sees the border of something: there, the path
/// tracer's few rays a pixel and ours hit other sides of it.
fn at_a_border(white: &[f64], width: usize) -> Vec<bool> {
    let height = white.len() / width;
    let largest = white.iter().copied().fold(0.0, f64::max);
    let value = |x: usize, y: usize| white[y * width + x];
    (0..white.len())
        .map(|p| {
            let (x, y) = (p % width, p / width);
            let around = || {
                (y.saturating_sub(1)..(y + 2).min(height)).flat_map(|v| {
                    (x.saturating_sub(1)..(x + 2).min(width)).map(move |u| value(u, v))
                })
            };
            let high = around().fold(0.0, f64::max);
            let low = around().fold(f64::INFINITY, f64::min);
            high - low > 0.2 * largest
        })
        .collect()
}

/// What is found of a sample: energy of the residual over that of the noise, in sums
/// of a pattern and its inverse; how far the mean of all photographs is off, and how
/// far it would be by its noise alone.
fn compared(photographs: &Photographs) -> (f64, f64, f64) {
    let pairs = photographs.pairs();
    let (mut noise, mut residual, mut off, mut all) = (0.0, 0.0, 0.0, 0.0);
    for channel in 0..photographs.seen.len() {
        let seen = &photographs.seen[channel];
        let simulated = photographs.in_camera_units(channel);
        let border = at_a_border(&simulated[0], photographs.width);
        for pixel in (0..border.len()).filter(|p| !border[*p]) {
            let sum =
                |planes: &[Vec<f64>], (a, b): (usize, usize)| planes[a][pixel] + planes[b][pixel];
            let sums: Vec<f64> = pairs.iter().map(|pair| sum(seen, *pair)).collect();
            let mean = sums.iter().sum::<f64>() / sums.len() as f64;
            // All sums show the same light: what scatters is noise.
            let scatter: f64 = sums.iter().map(|s| (s - mean).powi(2)).sum();
            noise += scatter / (sums.len() - 1) as f64;
            let squares = pairs
                .iter()
                .map(|pair| (sum(seen, *pair) - sum(&simulated, *pair)).powi(2));
            residual += squares.sum::<f64>() / sums.len() as f64;
            let mean = |planes: &[Vec<f64>]| {
                planes.iter().map(|p| p[pixel]).sum::<f64>() / planes.len() as f64
            };
            off += (mean(seen) - mean(&simulated)).powi(2);
            all += mean(seen).powi(2);
        }
    }
    // A sum has the noise of two photographs, the mean that of one over their number.
    let of_noise = noise / 2.0 / photographs.roles.len() as f64;
    (
        residual / noise,
        (off / all).sqrt(),
        (of_noise / all).sqrt(),
    )
}

#[test]
fn photographs_of_the_path_tracer_differ_by_their_noise() {
    let samples = [
        ("m-panels", "m-panels"),
        ("m-panels-painted", "m-panels-colour"),
    ];
    for (scene, sample) in samples {
        let photographs = Photographs::new(scene, sample);
        let (ratio, off, by_noise) = compared(&photographs);
        println!(
            "{sample}: residual over noise {ratio:.4}; the mean of {} photographs is off by {:.2} %, by noise {:.2} %",
            photographs.roles.len(),
            100.0 * off,
            100.0 * by_noise
        );
        assert!((0.98..1.02).contains(&ratio), "{sample}: {ratio}");
        // What is left beside the noise.
        let beside = (off * off - by_noise * by_noise).max(0.0).sqrt();
        assert!(beside < 0.006, "{sample}: {beside}");
    }
}

/// The samples' tables, compensated frames of which the path tracer rendered
/// (`tests/closed_loop.py`), against what their photographs predict.
#[test]
fn what_a_viewer_sees_is_predicted_as_the_path_tracer_shows_it() {
    for (sample, rendered) in [("m-panels", 0.0139), ("m-panels-colour", 0.0435)] {
        let capture = host_tools().join("samples").join(sample);
        let learned = iltm::build_table::build_table(
            &capture,
            &CaptureOptions::default(),
            &SolveOptions::default(),
            &iltm::build_table::TableOptions::default(),
            &Silent,
        );
        let predicted = learned.unwrap().predicted;
        println!("{sample}: {predicted:?}");
        let factor = predicted.compensated / rendered;
        assert!((1.0 / 1.3..1.3).contains(&factor), "{sample}: {factor}");
        let figures = predicted.figures.expect("pixels are seen");
        assert!(figures.relative.to_bits() == predicted.compensated.to_bits());
        assert!(figures.worst_places > 2.0 * figures.relative);
        assert!(figures.ssim.is_some_and(|ssim| ssim > 0.95));
    }
}
