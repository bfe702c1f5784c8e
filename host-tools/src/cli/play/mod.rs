//! `iltm play`: mpv on a projector, with the table as its shader.
//!
//! Decoding, sound and clocks are mpv's. The compensation is a user shader: the runtime's
//! arithmetic in integers for frames of the table's projector, or that of `iltm export` where the
//! table does not say its pixels. The script `play.lua` runs within mpv: it has the keys, counts
//! frames that were dropped or late, and says what happens as JSON lines on standard output.

mod spanning;

use super::args::Play;
use super::failure::{Failure, Kind, cannot_write};
use super::interrupt;
use super::mpv::{mpv, start};
use super::output::Output;
use super::tables::{check_whole, chosen_tier, watch_table};
use crate::compile::shader::{integer_shader, user_shader};
use crate::video::watch::FileWatch;
use iltm_picture::Samples;
use iltm_picture::unfinished::TemporaryFolder;
use iltm_report::stills::test_card;
use iltm_runtime::FrameSize;
use iltm_runtime::image::Table;
use iltm_runtime::placement::ProjectorPixels;
use serde_json::{Value, json};
use spanning::SpanningWindow;
use std::ffi::OsString;
use std::fs;
use std::io::{self, BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStdout, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Between two looks at the table, the player, and whether the user wants an end.
const PERIOD: Duration = Duration::from_millis(50);

/// What asks the player to end: a file of this name.
const STOP: &str = "stop";

/// How long a player that was asked to end may take.
const PATIENCE: Duration = Duration::from_secs(5);

/// Different problems that are said in one show.
const MOST_PROBLEMS: usize = 200;

/// Exit codes that `play.lua` ends mpv with.
const STRICT: i32 = 5;
const WRONG_DISPLAY: i32 = 6;

/// Codes of a picture in white, wherever there is one.
const WHITE: &str =
    "//!HOOK MAIN\n//!BIND HOOKED\n//!DESC iltm: white\nvec4 hook() { return vec4(1.0); }\n";

pub(super) fn run(arguments: &Play, output: &Output) -> Result<(), Failure> {
    let (image, watch) = watch_table(&arguments.table)?;
    let table = check_whole(&arguments.table, &image)?;
    let tier = chosen_tier(&table, arguments.tier)?;
    let folder = TemporaryFolder::new().map_err(|error| cannot_write(Path::new("."), &error))?;
    let files = ShowFiles {
        folder: folder.path(),
        projector: table.projector(),
        tier,
    };
    files.prepare(&table)?;
    files.write("settings.lua", files.settings(arguments, table.top_tier()))?;
    if files.projector.is_none() {
        output.people("note        the table does not say the projector's pixels: the display is not checked, and films are stretched to fill it\n");
    }
    interrupt::catch();
    let start = Instant::now();
    let window = files.window(&arguments.display)?;
    let mut player = files.start(arguments, window.as_ref())?;
    let events = read(player.stdout.take().expect("it is piped"));
    let mut show = FilmShow {
        arguments,
        output,
        files: &files,
        window,
        struck: false,
        generation: 0,
        used: 0,
        before: None,
        said: Vec::new(),
        ended: None,
    };
    let status = show.follow(&mut player, &events, &watch)?;
    show.result(status, start.elapsed())
}

/// Files for the player, and how it is started.
struct ShowFiles<'s> {
    folder: &'s Path,
    projector: Option<ProjectorPixels>,
    tier: u8,
}

impl ShowFiles<'_> {
    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<(), Failure> {
        let path = self.folder.join(name);
        fs::write(&path, bytes).map_err(|error| cannot_write(&path, &error))
    }

    fn prepare(&self, table: &Table<'_>) -> Result<(), Failure> {
        self.write("play.lua", include_str!("play.lua"))?;
        self.write("white.glsl", WHITE)?;
        if let Some(projector) = self.projector {
            self.write("card.bgra", card(projector.size()))?;
        }
        self.shaders(table, 0)
    }

    /// Removes the shaders of a table that is not in use any more.
    fn forget(&self, generation: u32) {
        for tier in 0..=u8::MAX {
            let path = self.folder.join(format!("{generation}-{tier}.glsl"));
            if fs::remove_file(path).is_err() {
                break;
            }
        }
    }

    /// Writes a table's shaders, one a tier.
    fn shaders(&self, table: &Table<'_>, generation: u32) -> Result<(), Failure> {
        for tier in 0..=table.top_tier() {
            let exact = self
                .projector
                .and_then(|projector| integer_shader(table, tier, projector));
            let shader = exact.unwrap_or_else(|| user_shader(table, tier));
            self.write(&format!("{generation}-{tier}.glsl"), shader)?;
        }
        Ok(())
    }

    /// Takes the place of the table before; `Err` says why it cannot.
    fn exchange(&self, bytes: &[u8], path: &Path, generation: u32) -> Result<(), String> {
        let table = check_whole(path, bytes).map_err(|failure| failure.message)?;
        if table.projector() != self.projector {
            return Err(format!(
                "{}: the table is for another projector or border",
                path.display()
            ));
        }
        let write = || {
            self.shaders(&table, generation)?;
            let newest = format!("{generation} {}\n", table.top_tier() + 1);
            self.write("newest.part", newest)
        };
        write().map_err(|failure| failure.message)?;
        let part = self.folder.join("newest.part");
        fs::rename(part, self.folder.join("newest")).map_err(|error| error.to_string())
    }

    /// What mpv is given to draw in, where displays are named and it does not take one by itself.
    fn window(&self, numbers: &[u16]) -> Result<Option<SpanningWindow>, Failure> {
        if numbers.is_empty() {
            return Ok(None);
        }
        if spanning::on_x11() {
            let size = self.projector.map(ProjectorPixels::size);
            return SpanningWindow::open(numbers, size).map(Some);
        }
        if numbers.len() > 1 {
            return Err(Failure::new(
                Kind::Display,
                "several displays need a desktop of X11, this is none",
                "Log in to a session of X11 (Xorg), or have the graphics driver present the displays \
                 as one.",
            ));
        }
        Ok(None)
    }

    fn start(&self, arguments: &Play, window: Option<&SpanningWindow>) -> Result<Child, Failure> {
        let mut command = mpv();
        command
            .env("ILTM_PLAY", self.folder)
            .stdout(Stdio::piped())
            .arg("--keepaspect=no")
            .args(["--force-window=immediate", "--cursor-autohide=always"])
            .args(["--input-default-bindings=no", "--osd-bar=no"])
            .args(["--quiet", "--msg-level=all=error"])
            // What the integer shader needs, and what shows its codes as they are.
            .args(["--fbo-format=rgba16", "--dither-depth=no"])
            // Its textures of 16 bits were read wrongly, and nothing said so.
            .arg("--opengl-es=no")
            .args(["--idle=yes", "--image-display-duration=10"])
            .arg("--gapless-audio=yes")
            // A stream that pauses is waited for.
            .arg("--network-timeout=0")
            // In step with the display, where its rate is known: frames last evenly, late ones
            // are counted, and sound follows.
            .arg("--video-sync=display-resample")
            .args(["--audio-fallback-to-null=yes"])
            // Subtitles would be drawn over the compensated picture, and turned films stretched.
            .args(["--sid=no", "--video-rotate=no"])
            .arg(path_option("--script=", &self.folder.join("play.lua")));
        if let Some(projector) = self.projector {
            command.arg(format!("--vf=lavfi=[{}]", filled(projector)));
        }
        match (window, &arguments.display[..]) {
            // Clicks are the window's, which asks for the keys then.
            (Some(window), _) => {
                command.arg(format!("--wid={}", window.id()));
                command.arg("--input-cursor=no");
            }
            (None, [display]) => {
                command.arg("--fullscreen");
                command.arg(format!("--screen={display}"));
                command.arg(format!("--fs-screen={display}"));
            }
            (None, _) => {
                command.arg("--fullscreen");
            }
        }
        if !arguments.once {
            command.arg("--loop-playlist=inf");
        }
        command.args(&arguments.mpv);
        command.arg("--").args(&arguments.films);
        start(&mut command)
    }

    /// What `play.lua` needs to know.
    fn settings(&self, arguments: &Play, top: u8) -> String {
        let (width, height) = self.projector.map_or((0, 0), |projector| {
            let size = projector.size();
            (size.width(), size.height())
        });
        format!(
            "return {{ width = {width}, height = {height}, tier = {}, tiers = {}, once = {}, strict = {} }}\n",
            self.tier,
            u16::from(top) + 1,
            arguments.once,
            arguments.strict,
        )
    }
}

fn path_option(option: &str, path: &Path) -> OsString {
    let mut text = OsString::from(option);
    text.push(path);
    text
}

/// A filter that makes frames of the projector's size: as large as fits inside its border, in
/// their aspect on a screen, black around.
fn filled(projector: ProjectorPixels) -> String {
    let (whole, inner) = (projector.size(), projector.inner());
    let (width, height) = (inner.width(), inner.height());
    format!(
        "scale=w='round(min({width},{height}*dar))':h='round(min({height},{width}/dar))':\
         flags=bicubic+accurate_rnd,pad={}:{}:-1:-1,setsar=1",
        whole.width(),
        whole.height(),
    )
}

/// The test card as mpv's overlays are: blue, green, red, opaque.
fn card(size: FrameSize) -> Vec<u8> {
    let card = test_card(size).picture;
    let codes: Vec<u8> = match card.samples() {
        Samples::Eight(samples) => samples.clone(),
        Samples::Sixteen(samples) => samples.iter().map(|code| (code >> 8) as u8).collect(),
    };
    let pixels = codes.chunks_exact(card.channels());
    let pixel = |codes: &[u8]| {
        let of = |channel: usize| codes[channel.min(codes.len() - 1)];
        [of(2), of(1), of(0), u8::MAX]
    };
    pixels.flat_map(pixel).collect()
}

/// Lines of the player, as they come.
fn read(stdout: ChildStdout) -> Receiver<String> {
    let (send, lines) = channel();
    thread::spawn(move || {
        for line in BufReader::new(stdout).lines().map_while(io::Result::ok) {
            if send.send(line).is_err() {
                break;
            }
        }
    });
    lines
}

/// What happens while the player runs.
struct FilmShow<'s> {
    arguments: &'s Play,
    output: &'s Output,
    files: &'s ShowFiles<'s>,
    window: Option<SpanningWindow>,
    /// Whether a problem of the displays ends it, as was asked for.
    struck: bool,
    /// The number of the newest table that was looked at, of the one in use, and of the one
    /// before that.
    generation: u32,
    used: u32,
    before: Option<u32>,
    /// What went wrong, in order.
    said: Vec<String>,
    /// The counts at the end.
    ended: Option<Value>,
}

impl FilmShow<'_> {
    fn follow(
        &mut self,
        player: &mut Child,
        events: &Receiver<String>,
        watch: &FileWatch,
    ) -> Result<ExitStatus, Failure> {
        let mut asked: Option<Instant> = None;
        loop {
            match events.recv_timeout(PERIOD) {
                Ok(line) => self.take(&line),
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => (),
            }
            if let Some(bytes) = watch.newer() {
                self.exchange(&bytes);
            }
            if let Some(problem) = self.window.as_mut().and_then(SpanningWindow::look) {
                self.problem(&problem);
                self.struck |= self.arguments.strict;
            }
            if interrupt::stopped() || self.struck {
                if asked.is_none() {
                    self.files.write(STOP, "")?;
                }
                if asked.get_or_insert_with(Instant::now).elapsed() > PATIENCE {
                    let _ = player.kill();
                }
            }
        }
        player.wait().map_err(|error| {
            Failure::new(
                Kind::Player,
                format!("mpv was lost: {error}"),
                "Run it again.",
            )
        })
    }

    /// A line of the player: an object of `play.lua`, or its own words.
    fn take(&mut self, line: &str) {
        let Ok(event) = serde_json::from_str::<Value>(line) else {
            if !line.trim().is_empty() {
                self.problem(&format!("mpv: {line}"));
            }
            return;
        };
        if let Some(counts) = event.get("ended") {
            self.ended = Some(counts.clone());
        } else if let Some(display) = event.get("display") {
            self.problem(&format!(
                "the display has {} x {} pixels, the table's projector {}",
                display["width"],
                display["height"],
                self.projector(),
            ));
        } else if let Some(problem) = event["problem"].as_str() {
            let film = event["film"].as_str();
            let text = film.map_or_else(|| problem.to_owned(), |film| format!("{film}: {problem}"));
            self.problem(&text);
        } else if event.get("table").is_some() {
            let path = self.arguments.table.display();
            self.output.people(&format!(
                "table       {path} has changed and is used from now on\n"
            ));
            let event = json!({ "event": "table", "table": path.to_string() });
            self.output.event(&event);
        }
    }

    fn projector(&self) -> String {
        self.files.projector.map_or_else(String::new, |projector| {
            let size = projector.size();
            format!("{} x {}", size.width(), size.height())
        })
    }

    /// Each is said once: a loop meets the same ones again and again.
    fn problem(&mut self, text: &str) {
        if self.said.len() >= MOST_PROBLEMS || self.said.iter().any(|said| said == text) {
            return;
        }
        self.output.people(&format!("problem     {text}\n"));
        self.output
            .event(&json!({ "event": "problem", "problem": text }));
        self.said.push(text.to_owned());
    }

    fn exchange(&mut self, bytes: &[u8]) {
        self.generation += 1;
        let path = &self.arguments.table;
        if let Err(why) = self.files.exchange(bytes, path, self.generation) {
            self.problem(&format!("{why}; the table before goes on"));
            self.files.forget(self.generation);
            return;
        }
        // The player may not have seen yet that there is a newer one.
        if let Some(older) = self.before.replace(self.used) {
            self.files.forget(older);
        }
        self.used = self.generation;
    }

    fn result(self, status: ExitStatus, time: Duration) -> Result<(), Failure> {
        let last = || self.said.last().cloned();
        let failed = |kind, otherwise: &str, next: &str| {
            let message = last().unwrap_or_else(|| otherwise.to_owned());
            Err(Failure::new(kind, message, next))
        };
        match status.code() {
            Some(WRONG_DISPLAY) => {
                return failed(
                    Kind::Display,
                    "the display has another size than the table's projector",
                    "Set the display to the projector's own mode, or choose another with --display.",
                );
            }
            code if self.struck || code == Some(STRICT) => {
                return failed(
                    Kind::Player,
                    "the show was ended",
                    "Mend it, or leave --strict away to let shows go on.",
                );
            }
            _ => (),
        }
        let Some(counts) = &self.ended else {
            return failed(
                Kind::Player,
                "mpv ended before the show",
                "See whether `mpv --vo=gpu FILM` plays.",
            );
        };
        if counts["shown"] == false && counts["failed"] != 0 {
            return failed(
                Kind::Frames,
                "nothing could be played",
                "Check the films, and whether `mpv FILM` plays them.",
            );
        }
        let data = json!({
            "event": "end",
            "seconds": time.as_secs_f64(),
            "films": counts["films"],
            "failed": counts["failed"],
            "dropped": counts["dropped"],
            "late": counts["late"],
            "problems": self.said,
        });
        let late = match &counts["late"] {
            Value::Null => "late ones cannot be told: the display's rate is not known".to_owned(),
            late => format!("{late} late"),
        };
        let text = format!(
            "played      {:.0} s\n\
             films       {} begun, {} that could not be played\n\
             frames      {} dropped, {late}\n",
            time.as_secs_f64(),
            counts["films"],
            counts["failed"],
            counts["dropped"],
        );
        self.output.result(&data, &text);
        Ok(())
    }
}
