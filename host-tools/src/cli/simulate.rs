//! `iltm simulate`

use super::args::Simulate;
use super::failure::{Failure, Kind, kind_of};
use super::output::{Output, cannot_write};
use super::progress::progress;
use crate::capture::pattern_set;
use crate::scene::ablation::{Ablated, ablate};
use crate::scene::description::{Scene, SceneError};
use crate::scene::folder::{self, CaptureFolderError, Written};
use crate::scene::retake::{RetakeError, Session};
use crate::scene::{
    Decision, Effect, Forced, Shooting, Simulation, SimulationError, SimulationOptions, percent,
};
use iltm_picture::{FolderError, progress::Progress};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

pub(super) fn run(arguments: &Simulate, output: &Output) -> Result<(), Failure> {
    let start = Instant::now();
    let scene = Scene::read(&arguments.scene).map_err(|error| unreadable(&error))?;
    // A folder that is in the way is known before the work, not after it.
    if let (Some(out), None) = (&arguments.output, &arguments.photograph) {
        iltm_picture::check_free(out).map_err(unwritten)?;
    }
    let mut forced = Forced::default();
    let wanted = |effects: &[Effect], on| {
        effects
            .iter()
            .map(move |effect| (*effect, on))
            .collect::<Vec<_>>()
    };
    for (effect, on) in [
        wanted(&arguments.with, true),
        wanted(&arguments.without, false),
    ]
    .concat()
    {
        forced = forced.with(effect, on);
    }
    let options = SimulationOptions {
        forced,
        threshold: arguments.threshold,
    };
    let bars = progress(output);
    let simulation = Simulation::new(&scene, &options, bars.as_ref());
    let simulation = simulation.map_err(|error| unsimulated(&error))?;
    let ready = start.elapsed().as_secs_f64();
    let mut written = None;
    let mut taken = None;
    if arguments.output.is_some() || arguments.photograph.is_some() {
        let shooting = Shooting::new(&scene, &simulation, arguments.seed);
        let shooting = shooting.map_err(|error| unsimulated(&error))?;
        let shooting = shooting.with_faults(&arguments.fault);
        if let Some(folder) = &arguments.photograph {
            let count = photograph(arguments, folder, &shooting, bars.as_ref());
            taken = Some(count.map_err(|error| not_taken(&error))?);
        } else if let Some(out) = &arguments.output {
            let patterns = pattern_set(simulation.grid(), arguments.photos, arguments.seed);
            let done = folder::write(&shooting, &patterns, out, bars.as_ref());
            written = Some(done.map_err(untaken)?);
        }
    }
    let ablated = if arguments.ablate {
        ablate(&scene, &options, bars.as_ref()).map_err(|error| unsimulated(&error))?
    } else {
        Vec::new()
    };
    bars.end();
    let seconds = start.elapsed().as_secs_f64();
    let decisions = simulation.decisions();
    let mut data = json!({
        "scene": arguments.scene.display().to_string(),
        "rows": simulation.grid().rows(),
        "cols": simulation.grid().cols(),
        "channels": simulation.channels(),
        "patches": simulation.patches(),
        "threshold": simulation.threshold(),
        "effects": decisions.iter().map(effect).collect::<Vec<_>>(),
        "seconds": seconds,
    });
    let mut text = String::new();
    if arguments.explain {
        explain(&simulation, &decisions, &mut text);
    }
    if arguments.ablate {
        data["ablated"] = ablated.iter().map(difference).collect();
        differences(&ablated, &mut text);
    }
    if let (Some(out), Some(written)) = (&arguments.output, written) {
        data["capture"] = json!(out.display().to_string());
        data["photographs"] = json!(written.photographs);
        data["bounces"] = json!(written.bounces);
        let _ = writeln!(
            text,
            "capture     {}: {} photographs, {} in {seconds:.2} s ({ready:.2} s before the first)",
            out.display(),
            written.photographs,
            bounces(written),
        );
    }
    if let (Some(folder), Some(taken)) = (&arguments.photograph, taken) {
        data["folder"] = json!(folder.display().to_string());
        data["photographs"] = json!(taken);
        let photographs = if taken == 1 {
            "photograph"
        } else {
            "photographs"
        };
        let _ = writeln!(
            text,
            "{:<11} {}: {taken} {photographs} taken in {seconds:.2} s",
            "session",
            folder.display(),
        );
    }
    output.result(&data, &text);
    Ok(())
}

/// Takes what a folder calls for; returns how many photographs.
fn photograph(
    arguments: &Simulate,
    folder: &Path,
    shooting: &Shooting<'_>,
    progress: &dyn Progress,
) -> Result<usize, RetakeError> {
    let session = Session::read(folder, shooting.grid())?;
    match (arguments.shot, &arguments.output) {
        (Some(index), Some(file)) => session.take_one(shooting, index, file).map(|()| 1),
        _ => session.take_missing(shooting, progress),
    }
}

fn not_taken(error: &RetakeError) -> Failure {
    let kind = match error {
        RetakeError::Capture(error) => {
            return Failure::new(kind_of(error), error, error.next_step());
        }
        RetakeError::Simulation(error) => return unsimulated(error),
        RetakeError::Pattern { .. } => Kind::Capture,
        RetakeError::NoIndex { .. } | RetakeError::Missed { .. } => Kind::Usage,
        RetakeError::Io { .. } => Kind::Write,
    };
    Failure::new(kind, error, error.next_step())
}

fn bounces(written: Written) -> String {
    match written.bounces {
        0 => "no bounces,".to_owned(),
        1 => "1 bounce,".to_owned(),
        n => format!("{n} bounces,"),
    }
}

fn effect(decision: &Decision) -> Value {
    json!({
        "effect": decision.effect.name(),
        "on": decision.on,
        "forced": decision.forced,
        "reason": decision.reason,
        "seconds": decision.seconds,
    })
}

/// The table of what is simulated and why.
fn explain(simulation: &Simulation<'_>, decisions: &[Decision], text: &mut String) {
    let _ = writeln!(
        text,
        "{} x {} cells, {} patches; an effect is left out below {} of white\n",
        simulation.grid().rows(),
        simulation.grid().cols(),
        simulation.patches(),
        percent(simulation.threshold()),
    );
    for decision in decisions {
        let on = match (decision.on, decision.forced) {
            (true, false) => "on",
            (false, false) => "off",
            (true, true) => "on, asked for",
            (false, true) => "off, asked for",
        };
        let seconds = match decision.seconds {
            0.0 => String::new(),
            seconds if seconds < 0.01 => "<0.01 s".to_owned(),
            seconds => format!("{seconds:.2} s"),
        };
        let _ = writeln!(
            text,
            "{:16} {on:14} {seconds:>8}  {}",
            decision.effect, decision.reason
        );
    }
    let _ = writeln!(
        text,
        "{:16} {:14} {:>6.2} s  what each pixel sees, whatever the effects\n",
        "camera's rays",
        "",
        simulation.rays_seconds()
    );
}

fn difference(ablated: &Ablated) -> Value {
    json!({
        "effect": ablated.effect.name(),
        "on": ablated.on,
        "error": ablated.error,
        "largest": ablated.largest,
        "seconds": ablated.seconds,
    })
}

/// The table of what each effect contributes.
fn differences(ablated: &[Ablated], text: &mut String) {
    let _ = writeln!(
        text,
        "{:16} {:7} {:>12} {:>12} {:>10}   (shares of white)",
        "turned", "", "rms change", "largest", "it costs"
    );
    for ablated in ablated {
        let _ = writeln!(
            text,
            "{:16} {:7} {:>12} {:>12} {:>8.2} s",
            ablated.effect,
            if ablated.on { "off" } else { "on" },
            percent(ablated.error),
            percent(ablated.largest),
            ablated.seconds,
        );
    }
    text.push('\n');
}

pub(super) fn unreadable(error: &SceneError) -> Failure {
    let kind = match error {
        SceneError::Io { .. } => Kind::Read,
        _ => Kind::Scene,
    };
    Failure::new(kind, error, error.next_step())
}

pub(super) fn unsimulated(error: &SimulationError) -> Failure {
    Failure::new(Kind::Scene, error, error.next_step())
}

pub(super) fn untaken(error: CaptureFolderError) -> Failure {
    match error {
        CaptureFolderError::Simulation(error) => unsimulated(&error),
        CaptureFolderError::Folder(error) => unwritten(error),
    }
}

pub(super) fn unwritten(error: FolderError) -> Failure {
    match error {
        FolderError::Taken { .. } => Failure::new(
            Kind::Write,
            error,
            "Choose another folder, or move that one away.",
        ),
        FolderError::Io { path, source } => cannot_write(&path, &source),
    }
}
