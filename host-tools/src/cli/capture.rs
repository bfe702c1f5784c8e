//! `iltm capture`

use super::args::Capture;
use super::failure::{Failure, Kind};
use super::interrupt;
use super::output::Output;
use super::progress::progress;
use crate::capture::{MANIFEST_FILE, PhotoStats, Role};
use crate::session::{
    CameraDriver, CaptureSession, CommandCamera, CommandScreen, Screen, SessionError,
    SessionOptions, ShootEvent, State, Summary, WatchedFolder, ranges, with_window,
};
use iltm_picture::{foreign_file, png, progress::Progress};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::BufReader;
use std::path::Path;
use std::time::Duration;

/// Most numbers that `--again` may stand for.
const MOST_AGAIN: usize = 100_000;

/// White, of full scale, that is too bright, and too dark.
const TOO_BRIGHT: f64 = 0.95;
const TOO_DARK: f64 = 0.4;

pub(super) fn run(arguments: &Capture, output: &Output) -> Result<(), Failure> {
    let bars = progress(output);
    let mut session = CaptureSession::open(&arguments.capture, bars.as_ref())?;
    if arguments.list {
        let (data, text) = listed(&session, arguments);
        output.result(&data, &text);
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
    let numbers = arguments.again.iter().cloned().flatten();
    let options = SessionOptions {
        again: numbers.take(MOST_AGAIN).collect(),
        latency: arguments.latency.map(|ms| Duration::from_millis(ms.into())),
        retries: arguments.retries,
    };
    interrupt::catch();
    let size = slide_size(&session);
    let mut teller = Teller {
        output,
        bars: bars.as_ref(),
        by_hand: arguments.watch.is_some(),
        left: session.list().count(),
    };
    let done = match (&arguments.show, arguments.display) {
        (Some(command), _) => {
            let stop = interrupt::stopped;
            let mut screen = CommandScreen::new(command, &stop);
            photograph(
                &mut session,
                arguments,
                &options,
                &mut screen,
                &stop,
                &mut teller,
            )
        }
        (None, display) => with_window(display.unwrap_or(0).into(), size, |screen, closed| {
            let stop = || interrupt::stopped() || closed();
            photograph(
                &mut session,
                arguments,
                &options,
                screen,
                &stop,
                &mut teller,
            )
        }),
    };
    bars.end();
    let left = teller.left;
    match done {
        Ok(summary) => {
            let (data, text) = finished(summary, arguments);
            output.result(&data, &text);
            Ok(())
        }
        Err(SessionError::Stopped) => Err(Failure::new(
            Kind::Interrupted,
            format!("stopped; {left} photographs are missing"),
            SessionError::Stopped.next_step(),
        )),
        Err(error) => Err(error.into()),
    }
}

fn photograph(
    session: &mut CaptureSession,
    arguments: &Capture,
    options: &SessionOptions,
    screen: &mut dyn Screen,
    stop: &dyn Fn() -> bool,
    teller: &mut Teller<'_>,
) -> Result<Summary, SessionError> {
    let patience = Duration::from_secs(arguments.timeout.into());
    let mut camera: Box<dyn CameraDriver> = match (&arguments.watch, &arguments.camera) {
        (Some(folder), _) => Box::new(WatchedFolder::new(folder, patience, stop)),
        (None, command) => {
            let command = command.as_deref().unwrap_or_default();
            Box::new(CommandCamera::new(command, patience, stop))
        }
    };
    session.run(options, screen, camera.as_mut(), stop, &mut |event| {
        teller.tell(event);
    })
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
fn listed(session: &CaptureSession, arguments: &Capture) -> (Value, String) {
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
        arguments.capture.display()
    );
    if !missing.is_empty() {
        let _ = writeln!(text, "missing     {}", ranges(&missing));
    }
    for (index, why) in &bad {
        let _ = writeln!(text, "bad         {index}: {why}");
    }
    let data = json!({
        "capture": arguments.capture.display().to_string(),
        "all": all,
        "whole": whole,
        "missing": missing,
        "bad": bad.iter().map(|(index, _)| index).collect::<Vec<_>>(),
        "photographs": photographs,
    });
    (data, text)
}

fn finished(summary: Summary, arguments: &Capture) -> (Value, String) {
    let capture = arguments.capture.display();
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
    if arguments.capture.join(MANIFEST_FILE).exists() {
        let _ = writeln!(text, "next        `iltm check {capture}`");
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
