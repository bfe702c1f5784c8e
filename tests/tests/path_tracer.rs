//! The simulator beside photographs that an independent path tracer made of the same
//! scene (Mitsuba 3, the sample captures).

use iltm::capture::{Manifest, Role, Shot};
use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm::scene::{Simulation, SimulationOptions};
use nalgebra::DMatrix;
use std::path::{Path, PathBuf};

fn host_tools() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-tools")
}

/// Planes of a photograph in linear light, 0 to 1.
fn photograph(path: &Path) -> Vec<Vec<f64>> {
    let picture = image::open(path).unwrap();
    let channels = usize::from(picture.color().channel_count());
    let scale = if picture.color().bytes_per_pixel() as usize > channels { 65_535.0 } else { 255.0 };
    let samples: Vec<f64> = match scale {
        255.0 => picture.as_bytes().iter().map(|v| f64::from(*v)).collect(),
        _ => picture.as_bytes().chunks(2).map(|v| f64::from(u16::from_ne_bytes([v[0], v[1]]))).collect(),
    };
    let gamma = if scale == 255.0 { 2.0 } else { 1.0 };
    (0..channels)
        .map(|c| samples.iter().skip(c).step_by(channels).map(|v| (v / scale).powf(gamma)).collect())
        .collect()
}

#[test]
fn photographs_of_the_path_tracer_differ_by_their_noise() {
    for (scene, sample) in [("m-panels", std::env::var("CAP").unwrap_or("m-panels".into()))] {
        let scene = Scene::read(&host_tools().join(format!("scenes/{scene}.toml"))).unwrap();
        let simulation = Simulation::new(&scene, &SimulationOptions::default(), &Silent).unwrap();
        let folder = host_tools().join("samples").join(sample);
        let manifest = Manifest::read(&folder).unwrap();
        let pattern = |path: &Path| image::open(folder.join(path)).unwrap().to_luma8().into_raw();
        let shots: Vec<&Shot> = manifest.shots.iter().collect();
        let lit: Vec<_> = shots.iter().map(|s| pattern(&s.pattern)).collect();
        let patterns = DMatrix::from_fn(lit[0].len(), lit.len(), |c, k| f64::from(lit[k][c]) / 255.0);
        let exposed = simulation.expose(&patterns).unwrap();
        let simulated: Vec<Vec<f64>> = (0..shots.len()).map(|k| simulation.photograph(&exposed, k)[0].iter().map(|v| f64::from(*v)).collect()).collect();
        let seen: Vec<Vec<f64>> = shots.iter().map(|s| photograph(&folder.join(&s.photo)).remove(0)).collect();
        let (mut both, mut norm) = (0.0, 0.0);
        for (a, b) in seen.iter().flatten().zip(simulated.iter().flatten()) {
            both += a * b;
            norm += b * b;
        }
        let unit = both / norm;
        // Mean over all photographs, pixel by pixel.
        let n = seen[0].len();
        let mean = |planes: &[Vec<f64>]| -> Vec<f64> { (0..n).map(|p| planes.iter().map(|s| s[p]).sum::<f64>() / planes.len() as f64).collect() };
        let (ms, mm) = (mean(&seen), mean(&simulated));
        let top = ms.iter().copied().fold(0.0, f64::max);
        let bytes: Vec<u8> = ms.iter().zip(&mm).map(|(a, b)| (128.0 + (a - unit * b) / top * 2000.0).clamp(0.0, 255.0) as u8).collect();
        image::save_buffer("/tmp/mean.png", &bytes, 192, 132, image::ColorType::L8).unwrap();
        let d: f64 = ms.iter().zip(&mm).map(|(a, b)| (a - unit * b).powi(2)).sum();
        let s: f64 = ms.iter().map(|a| a * a).sum();
        println!("unit {unit:.5}, means differ by {:.5}", (d / s).sqrt());
        // Noise by pairs.
        let place = |role: Role| shots.iter().position(|s| s.role == role);
        let pairs: Vec<(usize, usize)> = shots.iter().enumerate().filter_map(|(k, s)| match s.role {
            Role::Column { inverse: false, .. } | Role::Row { inverse: false, .. } => Some((k, place(s.role.complement()?)?)),
            _ => None,
        }).collect();
        let (mut noise, mut residual, mut res1) = (0.0, 0.0, 0.0);
        for p in 0..n {
            let sums: Vec<f64> = pairs.iter().map(|(a, b)| seen[*a][p] + seen[*b][p]).collect();
            let m = sums.iter().sum::<f64>() / sums.len() as f64;
            noise += sums.iter().map(|s| (s - m).powi(2)).sum::<f64>() / (sums.len() - 1) as f64 * sums.len() as f64;
            for (a, b) in &pairs {
                let r = |k: usize| seen[k][p] - unit * simulated[k][p];
                residual += (r(*a) + r(*b)).powi(2);
                res1 += r(*a).powi(2) + r(*b).powi(2);
            }
        }
        println!("residual/noise of sums {:.4}, of photographs {:.4}", residual / noise, res1 / noise);
    }
}
