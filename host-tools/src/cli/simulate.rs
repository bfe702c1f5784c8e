//! `iltm simulate`

use super::args::Simulate;
use super::failure::{Failure, Kind};
use super::output::Output;
use super::progress::progress;
use super::simulate_chain::ChainedSlides;
use super::tables::read_table;
use crate::capture::{MANIFEST_FILE, pattern_set};
use crate::scene::ablation::{Ablated, ablate};
use crate::scene::description::Scene;
use crate::scene::fill_capture::{FillCaptureError, UnfilledCapture};
use crate::scene::folder::{self, SimulatedCapture};
use crate::scene::{
    Decision, Forced, Simulation, SimulationError, SimulationOptions, VirtualCamera,
};
use iltm_picture::{numbers::percent, progress::Progress};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub(super) fn run(arguments: &Simulate, output: &Output) -> Result<(), Failure> {
    let start = Instant::now();
    let described = Scene::read(&arguments.scene)?;
    let pose = pose(arguments, &described)?;
    let posed = pose.map(|index| described.from_pose(index));
    let scene = posed.as_ref().unwrap_or(&described);
    // A folder that is in the way is known before the work, not after it.
    if let (Some(out), None) = (&arguments.output, &arguments.photograph) {
        iltm_picture::check_free(out)?;
    }
    check_used(arguments)?;
    let sessions = sessions(arguments, scene, pose)?;
    let only_these = arguments.shot.is_none() && !arguments.explain && !arguments.ablate;
    if let (Some(folder), true) = (&arguments.photograph, only_these) {
        let missing = sessions.iter().map(|(_, session)| session.missing());
        let missing: Vec<_> = missing.collect::<Result<_, _>>().map_err(not_taken)?;
        if missing.iter().all(Vec::is_empty) {
            // Nothing has to be simulated for that.
            let data = json!({ "folder": folder.display().to_string(), "photographs": 0 });
            let text = format!(
                "session     {}: every photograph is there\n",
                folder.display()
            );
            output.result(&data, &text);
            return Ok(());
        }
    }
    let options = SimulationOptions {
        forced: forced(arguments),
        threshold: arguments.threshold,
    };
    let bars = progress(output);
    let simulation = Simulation::new(scene, &options, bars.as_ref())?;
    let takes_photographs = !sessions.is_empty() || arguments.output.is_some();
    let first_place = match pose {
        Some(_) if takes_photographs => Some(Simulation::new(&described, &options, bars.as_ref())?),
        _ => None,
    };
    let ready = start.elapsed().as_secs_f64();
    let camera = || {
        let camera = VirtualCamera::new(scene, &simulation, arguments.seed)?;
        let camera = match &first_place {
            Some(first) => {
                camera.exposed_as(&VirtualCamera::new(&described, first, arguments.seed)?)
            }
            None => camera,
        };
        Ok(camera.with_faults(&arguments.fault))
    };
    let done = shoot(arguments, scene, sessions, &camera, bars.as_ref())?;
    let ablated = if arguments.ablate {
        ablate(scene, &options, bars.as_ref())?
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
    match done {
        Shot::Nothing => {}
        Shot::Capture(out, written) => {
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
        Shot::Missing(folder, taken) => {
            data["folder"] = json!(folder.display().to_string());
            data["photographs"] = json!(taken);
            let plural = if taken == 1 { "" } else { "s" };
            let _ = writeln!(
                text,
                "session     {}: {taken} photograph{plural} taken in {seconds:.2} s",
                folder.display(),
            );
        }
    }
    output.result(&data, &text);
    Ok(())
}

/// Refuses what would be dropped.
fn check_used(arguments: &Simulate) -> Result<(), Failure> {
    let takes_none = arguments.output.is_none() && arguments.photograph.is_none();
    let dropped =
        if arguments.photograph.is_some() && arguments.shot.is_none() && arguments.output.is_some()
        {
            "--output has no use beside --photograph, which writes into its own folder"
        } else if takes_none && !arguments.fault.is_empty() {
            "--fault has no use where no photograph is taken"
        } else {
            return Ok(());
        };
    Err(Failure::new(
        Kind::Usage,
        dropped,
        "Leave it away, or see `iltm simulate --help`.",
    ))
}

/// The folders that wait for photographs: the one that is given, or those in it that are called as the
/// scene's projectors.
fn sessions(
    arguments: &Simulate,
    scene: &Scene,
    pose: Option<usize>,
) -> Result<Vec<(PathBuf, UnfilledCapture)>, Failure> {
    let Some(folder) = &arguments.photograph else {
        return Ok(Vec::new());
    };
    let names = scene.projector_names();
    let inner: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    let is_capture = |folder: &PathBuf| folder.join(MANIFEST_FILE).exists();
    let all = arguments.projector.is_none()
        && arguments.shot.is_none()
        && arguments.chain.is_none()
        && !is_capture(folder)
        && inner.iter().all(is_capture);
    let folders = if all {
        inner
            .into_iter()
            .enumerate()
            .map(|(index, folder)| (folder, Some(index)))
            .collect()
    } else {
        vec![(folder.clone(), lit(arguments, scene)?)]
    };
    let read = |(folder, lit): (PathBuf, Option<usize>)| {
        let session = UnfilledCapture::read(&folder, scene, lit).map_err(not_taken)?;
        let session = match pose {
            Some(pose) => session.from_pose(pose),
            None => session,
        };
        Ok((folder, session))
    };
    folders.into_iter().map(read).collect()
}

/// The index of the projector that the slides are for; `None` for all side by side.
fn lit(arguments: &Simulate, scene: &Scene) -> Result<Option<usize>, Failure> {
    let Some(name) = &arguments.projector else {
        return Ok(None);
    };
    let lit = scene.projector_called(name).ok_or_else(|| {
        let names = scene.projector_names().join("`, `");
        Failure::new(
            Kind::Usage,
            format!(
                "{}: there is no projector `{name}`; there is `{names}`",
                arguments.scene.display()
            ),
            "Name one of these after --projector, or count them from 1.",
        )
    })?;
    Ok(Some(lit))
}

/// The index of the further place of the camera that is asked for; `None` for `[camera]`'s own.
fn pose(arguments: &Simulate, scene: &Scene) -> Result<Option<usize>, Failure> {
    let Some(name) = &arguments.pose else {
        return Ok(None);
    };
    let pose = scene.pose_called(name).ok_or_else(|| {
        let names = scene.pose_names();
        let (there, next) = if names.is_empty() {
            (
                "the scene has no [[pose]]".to_owned(),
                "Describe one in the scene file (docs/scenes.md), or leave --pose away.",
            )
        } else {
            (
                format!("there is `{}`", names.join("`, `")),
                "Name one of these after --pose, or count them from 1.",
            )
        };
        Failure::new(
            Kind::Usage,
            format!(
                "{}: there is no pose `{name}`; {there}",
                arguments.scene.display()
            ),
            next,
        )
    })?;
    Ok(Some(pose))
}

/// The effects that the command line turns on and off.
fn forced(arguments: &Simulate) -> Forced {
    let on = arguments.with.iter().map(|effect| (*effect, true));
    let off = arguments.without.iter().map(|effect| (*effect, false));
    on.chain(off)
        .fold(Forced::default(), |forced, (effect, on)| {
            forced.with(effect, on)
        })
}

/// What was photographed.
enum Shot<'a> {
    Nothing,
    /// A capture folder, made anew.
    Capture(&'a Path, SimulatedCapture),
    /// So many photographs of those that a folder calls for.
    Missing(&'a Path, usize),
}

fn shoot<'a, 's>(
    arguments: &'a Simulate,
    scene: &Scene,
    sessions: Vec<(PathBuf, UnfilledCapture)>,
    camera: &dyn Fn() -> Result<VirtualCamera<'s>, SimulationError>,
    progress: &dyn Progress,
) -> Result<Shot<'a>, Failure> {
    if let Some(folder) = &arguments.photograph {
        let camera = camera()?;
        let mut taken = 0;
        for (folder, session) in sessions {
            taken += photograph(arguments, &folder, session, (scene, &camera), progress)?;
        }
        return Ok(Shot::Missing(folder, taken));
    }
    let Some(out) = &arguments.output else {
        return Ok(Shot::Nothing);
    };
    let camera = camera()?;
    let patterns = pattern_set(camera.grid(), arguments.photos, arguments.seed);
    let written = folder::write(&camera, None, &patterns, out, progress)?;
    Ok(Shot::Capture(out, written))
}

/// Takes what a folder calls for; returns how many photographs.
fn photograph(
    arguments: &Simulate,
    folder: &Path,
    mut session: UnfilledCapture,
    (scene, camera): (&Scene, &VirtualCamera<'_>),
    progress: &dyn Progress,
) -> Result<usize, Failure> {
    if let (Some(chain), Some(path)) = (arguments.chain, &arguments.table) {
        let slides = ChainedSlides {
            folder,
            chain,
            table: &read_table(path)?,
            path,
            grid: session.grid(),
            response: scene.projectors[0].response,
        };
        let codes = slides.codes(&session.indices())?;
        session = session.showing(scene, codes);
    }
    let taken = match (arguments.shot, &arguments.output) {
        (Some(index), Some(file)) => session.take_one(camera, index, file).map(|()| 1),
        _ => session.take_missing(camera, progress),
    };
    taken.map_err(not_taken)
}

fn not_taken(error: FillCaptureError) -> Failure {
    let kind = match error {
        FillCaptureError::Capture(error) => return error.into(),
        FillCaptureError::Simulation(error) => return error.into(),
        FillCaptureError::Pattern { .. } => Kind::Capture,
        FillCaptureError::NoIndex { .. } | FillCaptureError::Missed { .. } => Kind::Usage,
        FillCaptureError::Io { .. } => Kind::Write,
    };
    Failure::new(kind, &error, error.next_step())
}

fn bounces(written: SimulatedCapture) -> String {
    match written.bounces {
        0 => "no bounces,".to_owned(),
        1 => "1 bounce,".to_owned(),
        n => format!("{n} bounces,"),
    }
}

fn effect(decision: &Decision) -> Value {
    json!({
        "effect": decision.effect.to_string(),
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
        "effect": ablated.effect.to_string(),
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
