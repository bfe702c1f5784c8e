//! Experiments page: the page that shows the experiments, and every file it needs.

use super::complexity::{self, Timed};
use super::feasible::{self, TheoremBounds};
use super::scenes::{Condition, surface};
use super::seeds::{self, DrawErrors, Mean, SEEDS};
use super::sparsity::{self, Counted};
use super::{File, claims, second_bounce, sections};
use crate::benchmark::BenchmarkRow;
use crate::chart::{Interval, intervals};
use iltm_picture::chart::{ChartCurve, PALETTE, curves};
use iltm_picture::{Picture, png, progress::Progress};
use iltm_report::{
    bounces::{self, BouncesOptions},
    tradeoff::Tradeoff,
};
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
    contests: &[(&str, Vec<BenchmarkRow>, Vec<BenchmarkRow>)],
    capture: &Path,
    progress: &dyn Progress,
) -> Result<Vec<File>, PaperError> {
    let start = Instant::now();
    let samples = seeds::run(SEEDS, &seeds::ENTRIES, progress);
    let timed = complexity::run(progress);
    let sample = pictures(capture, progress)?;
    progress.begin("drawing", 0);
    let (lit, bounces) = second_bounce::panels().ok_or(PaperError::Picture { what: "Fig. 3" })?;
    let places = feasible::places();
    let counts = sparsity::counts();
    let picture = |name, what, picture: Option<Picture>| {
        let picture = picture.ok_or(PaperError::Picture { what })?;
        Ok(File::new(name, png::encode_small(&picture)))
    };
    let [uniform, textured] = [Condition::ALL[0], Condition::ALL[2]].map(second_bounce::compared);
    let mut files = vec![
        File::new("fig2.svg", feasible::chart(&places)),
        File::new("fig2.csv", places_csv(&places)),
        picture("fig1.png", "Fig. 1", sparsity::picture())?,
        picture("fig3.png", "Fig. 3", Some(lit))?,
        picture("fig4-uniform.png", "Fig. 4", uniform)?,
        picture("fig4-textured.png", "Fig. 4", textured)?,
        File::new("fig4-seeds.svg", seeds_chart(&samples)),
        File::new("complexity-cells.svg", by_cells(&timed)),
        File::new("complexity-photographs.svg", by_photographs(&timed)),
        File::new("fig1.csv", sparsity_csv(&counts)),
        File::new("fig3.csv", bounces_csv(&bounces)),
        File::new("fig4.csv", seeds_csv(&samples)),
        File::new("complexity.csv", complexity_csv(&timed)),
    ];
    progress.end();
    let mut text = include_str!("opening.md").to_owned();
    claims::claims(&mut text, &samples);
    sections::fourth(&mut text, &samples);
    sections::sparse(&mut text, &counts);
    sections::second(&mut text, &places, &counts);
    sections::third(&mut text, &bounces);
    sections::cost(&mut text, &timed);
    sections::time(&mut text, &sample);
    sections::every(&mut text, contests);
    let _ = writeln!(
        text,
        "\nThe experiments of this page took {:.0} s on the machine that wrote it, the \
         tables of every method not counted.",
        start.elapsed().as_secs_f64()
    );
    files.push(File::new("README.md", text));
    files.extend(sample.files);
    Ok(files)
}

fn seeds_chart(samples: &[DrawErrors]) -> String {
    let of = |condition: Condition| {
        let own = samples.iter().filter(move |s| s.condition == condition);
        let rows = own.filter(|s| !s.errors.is_empty()).map(interval);
        (condition.name(), rows.collect::<Vec<Interval>>())
    };
    let title = format!("{SEEDS} draws, their mean and its 95 % interval");
    let x = "error of the second bounce under white";
    intervals(&title, x, Condition::ALL.map(of)).file()
}

fn interval(sample: &DrawErrors) -> Interval {
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
) -> Vec<ChartCurve> {
    let of = |method: Method| {
        let own = timed.iter().filter(|t| t.method == method && chosen(t));
        let mut points: Vec<(f64, f64)> = own.map(&point).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by(|a, b| a.0.total_cmp(&b.0).is_eq());
        (method.to_string(), points)
    };
    complexity::METHODS.map(of).to_vec()
}

/// Lines below a heading.
fn csv(heading: &str, lines: impl IntoIterator<Item = String>) -> String {
    let lines = lines.into_iter().map(|line| line + "\n");
    [heading.to_owned() + "\n"]
        .into_iter()
        .chain(lines)
        .collect()
}

fn sparsity_csv(counts: &[Counted]) -> String {
    let line = |counted: &Counted| {
        let (scene, [a, b, c]) = (surface(counted.textured), counted.counts);
        format!("{scene},{},{a},{b},{c},{}", counted.name, counted.all)
    };
    csv(
        "scene,matrix,99 %,99.9 %,99.99 %,all",
        counts.iter().map(line),
    )
}

fn places_csv(places: &[TheoremBounds]) -> String {
    let heading =
        "scene,photographs,k,kappa_at_least,gamma_at_least,product_at_least,product_at_most";
    let line = |place: &TheoremBounds| {
        let (scene, (low, high)) = (surface(place.textured), place.product);
        let (photographs, k, kappa, gamma) = (place.photographs, place.k, place.kappa, place.gamma);
        format!("{scene},{photographs},{k},{kappa:.4},{gamma:.4},{low:.4},{high:.4}")
    };
    csv(heading, places.iter().map(line))
}

fn bounces_csv(bounces: &[second_bounce::Lit]) -> String {
    let line = |lit: &second_bounce::Lit| format!("{},{:.6}", lit.name, lit.error);
    csv("lit,second_bounce_error", bounces.iter().map(line))
}

fn seeds_csv(samples: &[DrawErrors]) -> String {
    let heading = "condition,method,photographs,seed,second_bounce_error,compensation_error";
    let lines = samples.iter().flat_map(|sample| {
        let (name, method) = (sample.condition.name(), sample.method);
        let errors = sample.errors.iter();
        errors.map(move |(seed, second, compensation)| {
            let photographs = sample.photographs;
            format!("\"{name}\",{method},{photographs},{seed},{second:.6},{compensation:.6}")
        })
    });
    csv(heading, lines)
}

fn complexity_csv(timed: &[Timed]) -> String {
    let line = |t: &Timed| {
        let (seconds, inversion) = (t.seconds, t.inversion);
        let (method, cells, photographs) = (t.method, t.cells, t.photographs);
        format!(
            "{method},{cells},{photographs},{seconds:.5},{},{inversion:.5}",
            t.iterations
        )
    };
    let heading = "method,cells,photographs,seconds,iterations,inversion_seconds";
    csv(heading, timed.iter().map(line))
}

/// The files, and what they say in a line.
#[derive(Debug)]
pub(super) struct CapturePictures {
    pub(super) files: Vec<File>,
    /// The one line of advice.
    pub(super) advice: String,
    /// Share of the light that is direct, and what the second bounce has of it.
    pub(super) shares: (f64, f64),
}

/// Both pictures of the capture in `folder`.
pub(super) fn pictures(
    folder: &Path,
    progress: &dyn Progress,
) -> Result<CapturePictures, PaperError> {
    let failed = |error: &dyn std::error::Error| PaperError::Sample {
        why: error.to_string(),
    };
    let found = Tradeoff::of_capture(folder, progress).map_err(|error| failed(&error))?;
    let light = bounces::bounces(folder, &BouncesOptions::default(), progress)
        .map_err(|error| failed(&error))?;
    let missing = |what| PaperError::Picture { what };
    let sheet = bounces::sheet(&light).ok_or(missing("the bounces"))?;
    let picture = found.svg().ok_or(missing("the trade-off"))?;
    let share = |layer: usize| {
        let layer = light.separated.layers.get(layer);
        layer.map_or(0.0, |layer| layer.light_share)
    };
    Ok(CapturePictures {
        files: vec![
            File::new("tradeoff.svg", picture),
            File::new("tradeoff.csv", found.csv()),
            File::new("tradeoff.html", found.html()),
            File::new("bounces.png", png::encode_small(&sheet)),
        ],
        advice: found.advice(),
        shares: (share(0), share(1)),
    })
}
