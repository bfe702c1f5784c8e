//! Scratch.
use iltm_tests::hard_cases::{capture::Capture, closed_loop::errors, scene::{Panels, Scene}};
use iltm_runtime::Grid;
fn show(name: &str, scene: &Scene, make: impl Fn(u64) -> Capture) {
    let mut all = Vec::new();
    for seed in 0..std::env::args().nth(1).map_or(3, |s| s.parse().unwrap()) {
        let capture = make(seed);
        let t = std::time::Instant::now();
        match capture.solve() {
            Ok((found, report)) => {
                let e = errors(scene, &found);
                if seed == 0 {
                    println!("{name:24} none {:.4} gain {:.4} perfect {:.4} | pred {:?} | lambda {} it {} cond {:.1} {:.2}s", e.nothing, e.gain_only, e.perfect, report.prediction, report.lambda, report.iterations, report.condition, t.elapsed().as_secs_f64());
                }
                all.push(e.compensated);
            }
            Err(e) => println!("{name} {e}"),
        }
    }
    all.sort_by(f64::total_cmp);
    println!("{name:24} median {:.5} worst {:.5}", all[all.len()/2], all[all.len()-1]);
}
fn main() {
    let grid = Grid::new(13, 21).unwrap();
    let p = Panels::m_shape(grid, 75.0);
    let flat = Scene::new(grid, &p, 0.7);
    let tex = flat.clone().textured(0.25, 0.95, 1);
    let blur = flat.clone().blurred(0.5);
    let texblur = tex.clone().blurred(0.5);
    show("uniform 60", &flat, |s| Capture::new(&flat, 60, s));
    show("textured 60", &tex, |s| Capture::new(&tex, 60, s));
    show("blur .5 60", &blur, |s| { let mut c = Capture::new(&blur, 60, s); c.blur = 0.5; c });
    show("blur .5 120", &blur, |s| { let mut c = Capture::new(&blur, 120, s); c.blur = 0.5; c });
    show("textured blur .5 120", &texblur, |s| { let mut c = Capture::new(&texblur, 120, s); c.blur = 0.5; c });
    show("40 dB 200", &flat, |s| Capture::new(&flat, 200, s).noisy(40.0, s));
    show("50 dB 200", &flat, |s| Capture::new(&flat, 200, s).noisy(50.0, s));
    show("tex 40 dB 200", &tex, |s| Capture::new(&tex, 200, s).noisy(40.0, s));
    show("tex 50 dB 200", &tex, |s| Capture::new(&tex, 200, s).noisy(50.0, s));
    let vig = flat.clone().vignetted(0.4);
    show("vignetted 60", &vig, |s| Capture::new(&vig, 60, s));
    for (lo, hi) in [(0.4, 0.9), (0.25, 0.7), (0.1, 0.1)] {
        let q = Panels { folds: p.folds.iter().map(|f| lo + f / 21.0 * (21.0 - 2.0 * lo - 0.6)).collect(), rows: (1.0 - hi, 12.0 + lo), wedge: 75.0 };
        let part = Scene::new(grid, &q, 0.7).textured(0.4, 0.9, 2);
        let make = |s: u64, db: Option<f64>| { let mut c = Capture::new(&part, 80, s);
            for (live, cov) in c.live.iter_mut().zip(part.coverage.iter()) { *live = *cov > 0.4; }
            if let Some(db) = db { c = c.noisy(db, s) }
            for i in 0..273 { if !c.live[i] { c.light[0].row_mut(i).fill(0.0); } } c };
        println!("live {}", make(0, None).live.iter().filter(|l| **l).count());
        show(&format!("part {lo} {hi}"), &part, |s| make(s, None));
        show(&format!("part {lo} {hi} 50 dB"), &part, |s| make(s, Some(50.0)));
    }
}
