//! The page that shows the experiments, and every file it needs.

use super::complexity::{self, Timed};
use super::feasible::{self, Place};
use super::sample::{self, Sample as Pictures};
use super::scenes::{Condition, surface};
use super::seeds::{self, Mean, SEEDS, Sample};
use super::sparsity::{self, Counted};
use super::{File, claims, second_bounce, sections};
use crate::chart::{Curve, Interval, curves, intervals};
use crate::contest::Row;
use iltm_picture::{Picture, chart::PALETTE, png, progress::Progress};
use iltm_solve::Method;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;
use thiserror::Error;

/// Why the experiments could not be shown.
#[derive(Debug, Error)]
pub enum PaperError {
    /// A picture has no size or does not fit one.
    #[error("the picture of {what} cannot be drawn")]
    Picture {
        /// Which.
        what: &'static str,
    },
    /// The photographs that the program carries gave nothing.
    #[error("the photographs that the program carries cannot be used: {why}")]
    Sample {
        /// What went wrong.
        why: String,
    },
}

/// All files of the page. `capture` is the folder of photographs whose trade-off and
/// bounces are shown.
///
/// # Errors
/// [`PaperError`] if something cannot be drawn.
pub fn files(
    contests: &[(&str, Vec<Row>, Vec<Row>)],
    capture: &Path,
    progress: &dyn Progress,
) -> Result<Vec<File>, PaperError> {
    let start = Instant::now();
    let samples = seeds::run(SEEDS, &seeds::ENTRIES, progress);
    let timed = complexity::run(progress);
    let sample = sample::pictures(capture, progress)?;
    progress.begin("drawing", 0);
    let (lit, bounces) = second_bounce::panels().ok_or(PaperError::Picture { what: "Fig. 3" })?;
    let places = feasible::places();
    let mut files = vec![
        file("fig2.svg", feasible::chart(&places)),
        file("fig2.csv", places_csv(&places)),
        picture("fig1.png", "Fig. 1", sparsity::picture())?,
        picture("fig3.png", "Fig. 3", Some(lit))?,
        picture(
            "fig4-uniform.png",
            "Fig. 4",
            second_bounce::compared(Condition::ALL[0]),
        )?,
        picture(
            "fig4-textured.png",
            "Fig. 4",
            second_bounce::compared(Condition::ALL[2]),
        )?,
        file("fig4-seeds.svg", seeds_chart(&samples)),
        file("complexity-cells.svg", by_cells(&timed)),
        file("complexity-photographs.svg", by_photographs(&timed)),
        file("fig1.csv", sparsity_csv(&sparsity::counts())),
        file("fig3.csv", bounces_csv(&bounces)),
        file("fig4.csv", seeds_csv(&samples)),
        file("complexity.csv", complexity_csv(&timed)),
    ];
    progress.end();
    let text = page(&Experiments {
        samples: &samples,
        counts: &sparsity::counts(),
        places: &places,
        bounces: &bounces,
        timed: &timed,
        sample: &sample,
        contests,
        seconds: start.elapsed().as_secs_f64(),
    });
    files.push(file("README.md", text));
    files.extend(sample.files);
    Ok(files)
}

fn file(name: &str, text: String) -> File {
    File {
        name: name.to_owned(),
        bytes: text.into_bytes(),
    }
}

fn picture(name: &str, what: &'static str, picture: Option<Picture>) -> Result<File, PaperError> {
    let picture = picture.ok_or(PaperError::Picture { what })?;
    Ok(File {
        name: name.to_owned(),
        bytes: png::encode_small(&picture),
    })
}

fn seeds_chart(samples: &[Sample]) -> String {
    let of = |condition: Condition| {
        let own = samples.iter().filter(move |s| s.condition == condition);
        let rows = own.filter(|s| !s.errors.is_empty()).map(interval);
        (condition.name(), rows.collect::<Vec<Interval>>())
    };
    let title = format!("{SEEDS} draws, their mean and its 95 % interval");
    let x = "error of the second bounce under white";
    intervals(&title, x, Condition::ALL.map(of)).file()
}

fn interval(sample: &Sample) -> Interval {
    let values = sample.second_bounce();
    let mean = Mean::of(&values);
    Interval {
        label: sections::words(sample.method, sample.photographs),
        colour: match sample.method {
            Method::TwoStage => PALETTE[1],
            Method::Direct => PALETTE[0],
            _ => PALETTE[2],
        },
        low: (mean.mean - mean.half).max(mean.mean / 10.0),
        middle: mean.mean,
        high: mean.mean + mean.half,
        values,
    }
}

fn by_cells(timed: &[Timed]) -> String {
    let mut all = of_methods(
        timed,
        |t| t.photographs == complexity::PHOTOGRAPHS,
        |t| (t.cells as f64, t.seconds),
    );
    let own = timed.iter().filter(|t| t.method == Method::Direct);
    let own = own.filter(|t| t.photographs == complexity::PHOTOGRAPHS);
    all.push((
        "exact inversion alone".to_owned(),
        own.map(|t| (t.cells as f64, t.inversion)).collect(),
    ));
    let title = "Time of a solve against cells, 150 photographs";
    curves(title, ("cells N", "seconds"), all).file()
}

fn by_photographs(timed: &[Timed]) -> String {
    let all = of_methods(
        timed,
        |t| t.cells == 13 * 21,
        |t| {
            let each = t.seconds / f64::from(t.iterations);
            (t.photographs as f64, 1e3 * each)
        },
    );
    let title = "Time of an iteration against photographs, 13 x 21 cells";
    let axes = ("photographs m", "milliseconds an iteration");
    curves(title, axes, all).file()
}

fn of_methods(
    timed: &[Timed],
    chosen: impl Fn(&Timed) -> bool,
    point: impl Fn(&Timed) -> (f64, f64),
) -> Vec<Curve> {
    let of = |method: Method| {
        let own = timed.iter().filter(|t| t.method == method && chosen(t));
        let mut points: Vec<(f64, f64)> = own.map(&point).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by(|a, b| a.0.total_cmp(&b.0).is_eq());
        (method.to_string(), points)
    };
    complexity::METHODS.map(of).to_vec()
}

fn sparsity_csv(counts: &[Counted]) -> String {
    let mut text = "scene,matrix,99 %,99.9 %,99.99 %,all\n".to_owned();
    for counted in counts {
        let scene = surface(counted.textured);
        let [a, b, c] = counted.counts;
        let _ = writeln!(text, "{scene},{},{a},{b},{c},{}", counted.name, counted.all);
    }
    text
}

fn places_csv(places: &[Place]) -> String {
    let mut text =
        "scene,photographs,k,kappa_at_least,gamma_at_least,product_at_least,product_at_most\n"
            .to_owned();
    for place in places {
        let scene = surface(place.textured);
        let _ = writeln!(
            text,
            "{scene},{},{},{:.4},{:.4},{:.4},{:.4}",
            place.photographs, place.k, place.kappa, place.gamma, place.product.0, place.product.1
        );
    }
    text
}

fn bounces_csv(bounces: &[second_bounce::Lit]) -> String {
    let mut text = "lit,second_bounce_error\n".to_owned();
    for lit in bounces {
        let _ = writeln!(text, "{},{:.6}", lit.name, lit.error);
    }
    text
}

fn seeds_csv(samples: &[Sample]) -> String {
    let mut text =
        "condition,method,photographs,seed,second_bounce_error,compensation_error\n".to_owned();
    for sample in samples {
        for (seed, second, compensation) in &sample.errors {
            let _ = writeln!(
                text,
                "\"{}\",{},{},{seed},{second:.6},{compensation:.6}",
                sample.condition.name(),
                sample.method,
                sample.photographs
            );
        }
    }
    text
}

fn complexity_csv(timed: &[Timed]) -> String {
    let mut text = "method,cells,photographs,seconds,iterations,inversion_seconds\n".to_owned();
    for t in timed {
        let _ = writeln!(
            text,
            "{},{},{},{:.5},{},{:.5}",
            t.method, t.cells, t.photographs, t.seconds, t.iterations, t.inversion
        );
    }
    text
}

/// What the page is written from.
struct Experiments<'e> {
    samples: &'e [Sample],
    counts: &'e [Counted],
    places: &'e [Place],
    bounces: &'e [second_bounce::Lit],
    timed: &'e [Timed],
    sample: &'e Pictures,
    contests: &'e [(&'e str, Vec<Row>, Vec<Row>)],
    seconds: f64,
}

fn page(all: &Experiments<'_>) -> String {
    let mut text = String::new();
    let _ = write!(text, "{}", include_str!("opening.md"));
    claims::claims(&mut text, all.samples);
    sections::fourth(&mut text, all.samples);
    sections::sparse(&mut text, all.counts);
    sections::second(&mut text, all.places, all.counts);
    sections::third(&mut text, all.bounces);
    sections::cost(&mut text, all.timed);
    sections::time(&mut text, all.sample);
    sections::every(&mut text, all.contests);
    let _ = writeln!(
        text,
        "\nThe experiments of this page took {:.0} s on the machine that wrote it, the \
         tables of every method not counted.",
        all.seconds
    );
    text
}
