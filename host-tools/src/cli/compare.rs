//! `iltm compare`

use super::args::Compare;
use super::failure::{Failure, Kind, cannot_write};
use super::output::{Output, make_folder, write_files};
use super::progress::progress;
use crate::compare::benchmark::{self, BenchmarkRow};
use crate::compare::benchmark_scene::{BenchmarkScene, BenchmarkSceneError};
use crate::compare::page::{self, BenchmarkPage};
use crate::compare::paper::{self, Condition, File};
use crate::compare::{Meter, table};
use crate::demo;
use iltm_picture::progress::Progress;
use iltm_picture::unfinished::TemporaryFolder;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

pub(super) fn run(
    arguments: &Compare,
    meter: Option<Meter>,
    output: &Output,
) -> Result<(), Failure> {
    let start = Instant::now();
    // A folder that cannot be made is known before the work, not after it.
    let folder = &arguments.output;
    make_folder(folder)?;
    let bars = progress(output);
    let compared = match &arguments.light {
        Some(light) => of_light(light, arguments, meter, bars.as_ref()),
        None => of_paper(arguments, meter, bars.as_ref()),
    };
    bars.end();
    let Compared {
        files,
        mut text,
        mut data,
    } = compared?;
    let files: Vec<_> = files.iter().map(|file| (&file.name, &file.bytes)).collect();
    write_files(folder, &files)?;
    let seconds = start.elapsed().as_secs_f64();
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    data["output"] = json!(folder.display().to_string());
    data["files"] = json!(names);
    data["seconds"] = json!(seconds);
    let _ = writeln!(
        text,
        "{}: {}, in {seconds:.0} s",
        folder.display(),
        names.join(", ")
    );
    output.result(&data, &text);
    Ok(())
}

/// What is written and said.
struct Compared {
    files: Vec<File>,
    text: String,
    data: Value,
}

fn of_light(
    path: &Path,
    arguments: &Compare,
    meter: Option<Meter>,
    progress: &dyn Progress,
) -> Result<Compared, Failure> {
    let light = if path.is_dir() {
        BenchmarkScene::of_capture(path, arguments.seed, progress)
    } else {
        BenchmarkScene::of_scene(path, arguments.seed, progress)
    };
    let light = light.map_err(dark)?;
    let (photographed, inverted) = benchmark::every(
        (&light.truth, &light.rig),
        light.methods(arguments.photos, arguments.seed),
        meter,
        progress,
    );
    let contest = BenchmarkPage {
        name: &path.display().to_string(),
        light: &light,
        photographed: &photographed,
        inverted: &inverted,
    };
    let groups = [
        ("photograph", photographed.as_slice()),
        ("invert", inverted.as_slice()),
    ];
    let files = vec![
        File::new("index.html", contest.html()),
        File::new("compare.csv", table::csv(&groups)),
    ];
    let truth = &light.truth;
    let photographs = match &photographed[..] {
        [] => format!("{}\n", page::OVERLAP.to_lowercase()),
        rows => format!("\nways to photograph\n{}", table::text(rows)),
    };
    let text = format!(
        "{} cells, {} lit and seen{}; the transport is {}\nerrors are of the mean light of cells; `iltm verify` measures what a viewer sees at pixels\n{photographs}\nways to invert, given the transport\n{}\n",
        truth.grid,
        truth.live_cells(),
        if light.colour { ", green channel" } else { "" },
        light.known,
        table::text(&inverted),
    );
    let data = json!({
        "light": path.display().to_string(),
        "known": light.known,
        "channel": if light.colour { "green" } else { "grey" },
        "rows": truth.grid.rows(),
        "cols": truth.grid.cols(),
        "photographed": photographed.iter().map(row).collect::<Vec<_>>(),
        "inverted": inverted.iter().map(row).collect::<Vec<_>>(),
    });
    Ok(Compared { files, text, data })
}

fn of_paper(
    arguments: &Compare,
    meter: Option<Meter>,
    progress: &dyn Progress,
) -> Result<Compared, Failure> {
    let mut contests = Vec::new();
    for condition in Condition::ALL
        .into_iter()
        .filter(|condition| condition.noisy)
    {
        if let Some((truth, rig)) = condition.world(arguments.seed) {
            let methods = benchmark::all(&[], arguments.photos, arguments.seed);
            let (photographed, inverted) =
                benchmark::every((&truth, &rig), methods, meter, progress);
            contests.push((condition.name(), photographed, inverted));
        }
    }
    let room =
        TemporaryFolder::new().map_err(|error| cannot_write(&std::env::temp_dir(), &error))?;
    let sample = room.path().join("m-panels-colour");
    demo::sample::write(&sample)?;
    let mut files = paper::files(&contests, &sample, progress).map_err(|error| {
        Failure::new(
            Kind::Write,
            error,
            "Please report this: it needs nothing from outside.",
        )
    })?;
    let groups: Vec<(&str, &[BenchmarkRow])> = contests
        .iter()
        .flat_map(|(name, photographed, inverted)| {
            [
                (*name, photographed.as_slice()),
                (*name, inverted.as_slice()),
            ]
        })
        .collect();
    files.push(File::new("methods.csv", table::csv(&groups)));
    Ok(Compared {
        files,
        text: String::new(),
        data: json!({}),
    })
}

fn row(row: &BenchmarkRow) -> Value {
    let done = row.result.as_ref().ok();
    json!({
        "method": row.method.name,
        "source": row.method.source.to_string(),
        "photographs": done.map(|done| done.photographs),
        "seconds": done.map(|done| done.seconds),
        "bytes": done.and_then(|done| done.memory),
        "multiplications_a_frame": done.and_then(|done| done.multiplications),
        "inverse_error": done.and_then(|done| done.errors.inverse),
        "second_bounce_error": done.and_then(|done| done.errors.second_bounce),
        "compensation_error": done.map(|done| done.errors.compensation),
        "remark": done.map(|done| &done.remark),
        "no_answer": row.result.as_ref().err().map(ToString::to_string),
    })
}

/// Why there is nothing to compare on.
fn dark(error: BenchmarkSceneError) -> Failure {
    match error {
        BenchmarkSceneError::Capture(error) => error.into(),
        BenchmarkSceneError::Solve(error) => error.into(),
        BenchmarkSceneError::Reference(error) => {
            let next_step = error.next_step();
            Failure::new(Kind::Capture, error, next_step)
        }
        BenchmarkSceneError::Scene(error) => error.into(),
        BenchmarkSceneError::Simulation(error) => error.into(),
        BenchmarkSceneError::Folder(error) => error.into(),
        BenchmarkSceneError::Room(error) => cannot_write(&std::env::temp_dir(), &error),
        BenchmarkSceneError::TooLarge { .. } => Failure::new(
            Kind::Usage,
            error,
            "Compare on a coarser grid of the same scene.",
        ),
        BenchmarkSceneError::Singular => Failure::new(
            Kind::Solve,
            error,
            "Look at `iltm solve`: it says which cells cannot be solved for.",
        ),
    }
}
