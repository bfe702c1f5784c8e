//! `iltm capture`

use super::args::Capture;
use super::failure::{Failure, Kind};
use super::interrupt;
use super::output::Output;
use super::progress::progress;
use crate::capture::{MANIFEST_FILE, PhotoStats, Role};
use crate::session::{
    CameraDriver, CaptureSession, CommandCamera, CommandScreen, DisplaySpan, Displays, Screen,
    SessionError, SessionOptions, ShootEvent, State, Summary, WatchedFolder, ranges, with_windows,
};
use iltm_picture::{foreign_file, png, progress::Progress};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Most numbers that `--again` may stand for.
const MOST_AGAIN: usize = 100_000;

/// White, of full scale, that is too bright, and too dark.
const TOO_BRIGHT: f64 = 0.95;
const TOO_DARK: f64 = 0.4;

pub(super) fn run(arguments: &Capture, output: &Output) -> Result<(), Failure> {
    let bars = progress(output);
    let folders = &arguments.captures;
    let open = |folder: &PathBuf| CaptureSession::open(folder, bars.as_ref());
    let mut sessions: Vec<CaptureSession> = folders.iter().map(open).collect::<Result<_, _>>()?;
    if arguments.list {
        for (at, (folder, session)) in folders.iter().zip(&sessions).enumerate() {
            let (data, text) = listed(session, folder);
            output.part_of_result(at + 1 == sessions.len(), &data, &text);
        }
        return Ok(());
    }
    if let Some(command) = &arguments.camera
        && !CommandCamera::is_complete(command)
    {
        return Err(Failure::new(
            Kind::Usage,
            format!("`{command}` does not say where the photograph goes"),
            "Put {photo} where the camera command takes the name of the file to write.",
        ));
    }
    let sizes: Vec<(u32, u32)> = sessions.iter().map(slide_size).collect();
    let displays = displays(arguments, &sizes)?;
    let numbers = arguments.again.iter().cloned().flatten();
    let options = SessionOptions {
        again: numbers.take(MOST_AGAIN).collect(),
        latency: arguments.latency.map(|ms| Duration::from_millis(ms.into())),
        retries: arguments.retries,
    };
    interrupt::catch();
    let mut teller = Teller {
        output,
        bars: bars.as_ref(),
        by_hand: arguments.watch.is_some(),
        left: 0,
    };
    let mut photograph =
        |at: usize, screen: &mut dyn Screen, stop: &dyn Fn() -> bool| -> Result<(), SessionError> {
            let mut camera = camera(arguments, stop);
            let session = &mut sessions[at];
            let tell = &mut |event: &ShootEvent<'_>| teller.tell(event);
            let summary = session.run(&options, screen, camera.as_mut(), stop, tell)?;
            bars.end();
            let (data, text) = finished(summary, folders, at);
            output.part_of_result(at + 1 == folders.len(), &data, &text);
            Ok(())
        };
    let done = if let Some(command) = &arguments.show {
        let stop = interrupt::stopped;
        photograph(0, &mut CommandScreen::new(command, &stop), &stop)
    } else {
        with_windows(&displays, |windows, closed| {
            let stop = || interrupt::stopped() || closed();
            (0..folders.len()).try_for_each(|at| photograph(at, &mut windows.screen(at), &stop))
        })
    };
    bars.end();
    match done {
        Err(SessionError::Stopped) => {
            let all = sessions.iter().flat_map(CaptureSession::list);
            let left = all.filter(|(_, state)| !matches!(state, State::Whole(_)));
            Err(Failure::new(
                Kind::Interrupted,
                format!("stopped; {} photographs are missing", left.count()),
                SessionError::Stopped.next_step(),
            ))
        }
        done => Ok(done?),
    }
}

/// What the displays are for, with the slides' width and height in each folder.
fn displays(arguments: &Capture, sizes: &[(u32, u32)]) -> Result<Displays, Failure> {
    let refuse = |message: String, next_step| Err(Failure::new(Kind::Usage, message, next_step));
    let (folders, shown) = (sizes.len(), arguments.display.len());
    if folders > 1 && !arguments.again.is_empty() {
        return refuse(
            "--again does not say of which folder".to_owned(),
            "Give that folder alone, with its display, and the others' with --dark.",
        );
    }
    if arguments.show.is_some() {
        if folders > 1 {
            return refuse(
                format!("--show shows the slides of one folder, {folders} are given"),
                "Photograph one after the other, while the other projectors are black.",
            );
        }
        return Ok(Displays::default());
    }
    let numbers = || arguments.display.iter().chain(&arguments.dark);
    if let Some(twice) = numbers().find(|number| numbers().filter(|n| n == number).count() > 1) {
        return refuse(
            format!("display {twice} is named twice"),
            "Name each display once.",
        );
    }
    if folders > 1 && folders != shown {
        return refuse(
            format!("{folders} folders and {shown} displays"),
            "Give --display one display for each folder, in their order: --display 1,2.",
        );
    }
    let displays: Vec<usize> = arguments.display.iter().map(|n| usize::from(*n)).collect();
    // Wide slides of one folder lie over all displays.
    let spans = displays.chunks(if folders > 1 { 1 } else { shown.max(1) });
    let screens = spans.zip(sizes).map(|(displays, size)| DisplaySpan {
        displays: displays.to_vec(),
        size: *size,
    });
    Ok(Displays {
        screens: screens.collect(),
        dark: arguments.dark.iter().map(|n| usize::from(*n)).collect(),
    })
}

fn camera<'s>(arguments: &Capture, stop: &'s dyn Fn() -> bool) -> Box<dyn CameraDriver + 's> {
    let patience = Duration::from_secs(arguments.timeout.into());
    match (&arguments.watch, &arguments.camera) {
        (Some(folder), _) => Box::new(WatchedFolder::new(folder, patience, stop)),
        (None, command) => {
            let command = command.as_deref().unwrap_or_default();
            Box::new(CommandCamera::new(command, patience, stop))
        }
    }
}

/// Width and height of the slides: those of the first that can be read.
fn slide_size(session: &CaptureSession) -> (u32, u32) {
    let size = |path: &Path| {
        let picture = png::read(BufReader::new(foreign_file::open(path).ok()?)).ok()?;
        Some((
            picture.size().width() as u32,
            picture.size().height() as u32,
        ))
    };
    let mut sizes = session
        .list()
        .filter_map(|(planned, _)| size(&planned.slide));
    // A session without slides says so before it shows one.
    sizes.next().unwrap_or_default()
}

/// What there is and what is missing.
fn listed(session: &CaptureSession, folder: &Path) -> (Value, String) {
    let mut photographs = Vec::new();
    let mut missing = Vec::new();
    let mut bad = Vec::new();
    for (planned, state) in session.list() {
        let (word, why) = match state {
            State::Whole(_) => ("whole", None),
            State::Missing => ("missing", None),
            State::Bad(why) => ("bad", Some(why)),
        };
        match why {
            Some(why) => bad.push((planned.index, why)),
            None if word == "missing" => missing.push(planned.index),
            None => {}
        }
        photographs.push(json!({
            "index": planned.index,
            "role": planned.role,
            "photo": planned.photo.display().to_string(),
            "state": word,
            "reason": why,
        }));
    }
    let all = photographs.len();
    let whole = all - missing.len() - bad.len();
    let mut text = format!(
        "capture     {}: {whole} of {all} photographs are there\n",
        folder.display()
    );
    if !missing.is_empty() {
        let _ = writeln!(text, "missing     {}", ranges(&missing));
    }
    for (index, why) in &bad {
        let _ = writeln!(text, "bad         {index}: {why}");
    }
    let data = json!({
        "capture": folder.display().to_string(),
        "all": all,
        "whole": whole,
        "missing": missing,
        "bad": bad.iter().map(|(index, _)| index).collect::<Vec<_>>(),
        "photographs": photographs,
    });
    (data, text)
}

fn finished(summary: Summary, folders: &[PathBuf], at: usize) -> (Value, String) {
    let capture = folders[at].display();
    let data = json!({
        "event": "done",
        "capture": capture.to_string(),
        "taken": summary.taken,
        "all": summary.all,
        "latency_ms": summary.latency.map(|latency| latency.wait.as_millis() as u64),
        "discard": summary.latency.map(|latency| latency.discard),
    });
    let mut text = format!(
        "capture     {capture}: {} taken, all {} photographs are there\n",
        summary.taken, summary.all
    );
    // A folder to verify a table with is none to solve.
    let to_solve = folders
        .iter()
        .all(|folder| folder.join(MANIFEST_FILE).exists());
    if at + 1 == folders.len() && to_solve {
        let names = folders.iter().map(|folder| folder.display().to_string());
        let _ = writeln!(
            text,
            "next        `iltm check {}`",
            names.collect::<Vec<_>>().join(" ")
        );
    }
    (data, text)
}

/// Says what happens: events for programs, a bar and remarks for people.
struct Teller<'a> {
    output: &'a Output,
    bars: &'a dyn Progress,
    /// Whether a person takes the photographs and has to know when.
    by_hand: bool,
    /// Photographs that are still missing.
    left: usize,
}

impl Teller<'_> {
    fn tell(&mut self, event: &ShootEvent<'_>) {
        self.output.event(&data(event));
        match event {
            ShootEvent::Begun { missing, .. } => self.left = *missing,
            ShootEvent::Measuring => self.bars.begin("flashing white and black", 0),
            ShootEvent::Latency(latency) => {
                self.bars.end();
                self.output.remark(&format!(
                    "latency     {} ms after each change, {} photographs thrown away",
                    latency.wait.as_millis(),
                    latency.discard
                ));
                if !self.by_hand {
                    self.bars.begin("photographing", self.left as u64);
                }
            }
            ShootEvent::Shown(planned) if self.by_hand => self.output.remark(&format!(
                "slide {:4}  take its photograph ({}); {} are missing",
                planned.index, planned.role, self.left
            )),
            ShootEvent::Shown(_) => {}
            ShootEvent::Failed { planned, reason } => self.output.remark(&format!(
                "slide {:4}  {reason}; it is taken again",
                planned.index
            )),
            ShootEvent::Taken {
                planned,
                exposed,
                left,
                ..
            } => {
                self.left = *left;
                self.bars.advance(1);
                let first = planned.role == Role::White.to_string() && planned.index == 0;
                if let Some(remark) = exposure(exposed).filter(|_| first) {
                    self.output.remark(&remark);
                }
            }
        }
    }
}

/// What is to be said about the exposure of white.
fn exposure(white: &PhotoStats) -> Option<String> {
    let percent = 100.0 * white.bright;
    if white.bright > TOO_BRIGHT {
        let advice = "expose shorter and begin again: nothing may clip";
        return Some(format!(
            "exposure    white reaches {percent:.0} % of full scale; {advice}"
        ));
    }
    (white.bright < TOO_DARK).then(|| {
        let advice = "about 80 % would give less noise; expose longer and begin again";
        format!("exposure    white reaches {percent:.0} % of full scale; {advice}")
    })
}

/// An event for programs.
fn data(event: &ShootEvent<'_>) -> Value {
    match event {
        ShootEvent::Begun { missing, all } => json!({
            "event": "begun", "missing": missing, "all": all,
        }),
        ShootEvent::Measuring => json!({ "event": "measuring" }),
        ShootEvent::Latency(latency) => json!({
            "event": "latency",
            "latency_ms": latency.wait.as_millis() as u64,
            "discard": latency.discard,
        }),
        ShootEvent::Shown(planned) => json!({
            "event": "shown",
            "index": planned.index,
            "role": planned.role,
            "slide": planned.slide.display().to_string(),
        }),
        ShootEvent::Failed { planned, reason } => json!({
            "event": "failed", "index": planned.index, "reason": reason,
        }),
        ShootEvent::Taken {
            planned,
            photo,
            exposed,
            left,
        } => json!({
            "event": "taken",
            "index": planned.index,
            "role": planned.role,
            "photo": photo.display().to_string(),
            "width": exposed.size.0,
            "height": exposed.size.1,
            "mean": exposed.mean,
            "bright": exposed.bright,
            "left": left,
        }),
    }
}
