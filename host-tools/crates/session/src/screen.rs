//! Screens: slides shown by a command, or in windows that fill displays, pixel by pixel
//! and nothing else.
//!
//! The system wants its windows served by the thread that the process began with,
//! at any time; so the session runs on another one and hands slides over.

use super::SessionError;
use super::plan::Planned;
use super::shell::{self, Ran};
use iltm_picture::{Picture, Samples, foreign_file, png};
use iltm_runtime::FrameSize;
use std::io::BufReader;
use std::num::NonZeroU32;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;
use winit::application::ApplicationHandler;
use winit::error::EventLoopError;
use winit::event::{ElementState, WindowEvent};
use winit::event_loop::{ActiveEventLoop, EventLoop, EventLoopProxy};
use winit::keyboard::{Key, NamedKey};
use winit::monitor::MonitorHandle;
use winit::window::{Fullscreen, Window, WindowId};

/// Longest that a user's command may take to show a slide.
const SHOWING: Duration = Duration::from_secs(30);

/// Shows slides full screen.
pub trait Screen {
    /// Shows a slide; on return, the system has it.
    ///
    /// # Errors
    /// [`SessionError::Display`], or [`SessionError::Stopped`].
    fn show(&mut self, planned: &Planned) -> Result<(), SessionError>;
}

/// Shows a slide by a command that the user gave.
pub struct CommandScreen<'a> {
    command: String,
    stop: &'a dyn Fn() -> bool,
}

impl<'a> CommandScreen<'a> {
    /// `command` has `{slide}` where the picture's name belongs, and returns as soon
    /// as that is shown.
    #[must_use]
    pub fn new(command: &str, stop: &'a dyn Fn() -> bool) -> Self {
        Self {
            command: command.to_owned(),
            stop,
        }
    }
}

impl Screen for CommandScreen<'_> {
    fn show(&mut self, planned: &Planned) -> Result<(), SessionError> {
        let refuse = |reason: String| SessionError::Display { reason };
        let command = &self.command;
        let line = shell::filled(command, planned, &planned.photo);
        match shell::run(&line, SHOWING, self.stop) {
            Ok(Ran::Ended(status, _)) if status.success() => Ok(()),
            Ok(Ran::Ended(status, words)) => Err(refuse(format!(
                "`{command}` ended with {status}{}",
                shell::says(&words)
            ))),
            Ok(Ran::TooLong(words)) => Err(refuse(format!(
                "`{command}` did not return within {} s{}",
                SHOWING.as_secs(),
                shell::says(&words)
            ))),
            Ok(Ran::Stopped) => Err(SessionError::Stopped),
            Err(error) => Err(refuse(format!("`{command}` cannot be run: {error}"))),
        }
    }
}

/// Longest that a window may take to open, or a slide to be drawn.
const PATIENCE: Duration = Duration::from_secs(20);

/// Given to the desktop to bring the window to its size, with whatever it likes to
/// show meanwhile.
const SETTLING: Duration = Duration::from_secs(1);

/// What the displays of a session are for; none is named twice.
#[derive(Clone, Debug, Default)]
pub struct Displays {
    /// Screens that slides are shown on, each while all others are black.
    pub screens: Vec<DisplaySpan>,
    /// Displays that stay black.
    pub dark: Vec<usize>,
}

/// Displays beside each other that show one slide; the first display of a desktop is 0.
#[derive(Clone, Debug)]
pub struct DisplaySpan {
    /// From left to right in the slide.
    pub displays: Vec<usize>,
    /// Width and height of the slides, in pixels.
    pub size: (u32, u32),
}

/// What the session's thread asks of the windows'.
enum Order {
    /// Show this picture on a screen, and black on all others.
    Show(usize, Picture),
    /// The session is over.
    Close,
}

/// What the windows' thread answers.
type Answer = Result<(), SessionError>;

/// Runs `session` with a window on each display. The session's `stop` is true once the user closes
/// a window or presses Escape. Call it from the thread that the process began with.
///
/// # Errors
/// [`SessionError::Display`], [`SessionError::NoDisplay`] or
/// [`SessionError::DisplaySize`] if there are no such windows, or what `session`
/// returns.
pub fn with_windows<T: Send>(
    displays: &Displays,
    session: impl FnOnce(&mut Windows, &(dyn Fn() -> bool + Sync)) -> Result<T, SessionError> + Send,
) -> Result<T, SessionError> {
    let refuse = |error: EventLoopError| {
        let text = error.to_string();
        // Without the line of source that an error of the system begins with.
        let words = match &error {
            EventLoopError::Os(_) => text.split_once(": ").map_or(&*text, |(_, words)| words),
            _ => &text,
        };
        SessionError::Display {
            reason: format!("there is no desktop to show it on: {words}"),
        }
    };
    let events = EventLoop::with_user_event().build().map_err(refuse)?;
    let proxy = events.create_proxy();
    let (answer, answers) = channel();
    let closed = AtomicBool::new(false);
    let mut wall = Wall {
        displays,
        answer,
        closed: &closed,
        windows: Vec::new(),
    };
    thread::scope(|scope| {
        let closed = &closed;
        let running = scope.spawn(move || {
            let mut windows = Windows { proxy, answers };
            // The first answer: there are windows.
            let result = windows.answer().and_then(|()| {
                thread::sleep(SETTLING);
                session(&mut windows, &|| closed.load(Ordering::SeqCst))
            });
            // Without an event loop nobody has to be told.
            let _ = windows.proxy.send_event(Order::Close);
            result
        });
        let ran = events.run_app(&mut wall).map_err(refuse);
        // Ends a session that still waits for an answer.
        closed.store(true, Ordering::SeqCst);
        drop(wall);
        let result = running.join().unwrap_or_else(|_| {
            Err(SessionError::Display {
                reason: "the session ended unexpectedly".to_owned(),
            })
        });
        ran.and(result)
    })
}

/// The session's side of the windows.
#[derive(Debug)]
pub struct Windows {
    proxy: EventLoopProxy<Order>,
    answers: Receiver<Answer>,
}

impl Windows {
    /// The screen of this place in [`Displays::screens`].
    pub fn screen(&mut self, number: usize) -> impl Screen {
        WindowScreen {
            windows: self,
            number,
        }
    }

    fn answer(&self) -> Answer {
        self.answers
            .recv_timeout(PATIENCE)
            .unwrap_or_else(|error| match error {
                RecvTimeoutError::Disconnected => Err(SessionError::Stopped),
                RecvTimeoutError::Timeout => Err(SessionError::Display {
                    reason: format!("the window did not draw it within {} s", PATIENCE.as_secs()),
                }),
            })
    }
}

struct WindowScreen<'w> {
    windows: &'w mut Windows,
    number: usize,
}

impl Screen for WindowScreen<'_> {
    fn show(&mut self, planned: &Planned) -> Result<(), SessionError> {
        let refuse = |reason: String| SessionError::Display {
            reason: format!("{}: {reason}", planned.slide.display()),
        };
        let file = foreign_file::open(&planned.slide).map_err(|error| refuse(error.to_string()))?;
        let picture = png::read(BufReader::new(file)).map_err(|error| refuse(error.to_string()))?;
        if !matches!(picture.samples(), Samples::Eight(_)) {
            return Err(refuse("a display shows 8 bits, it has 16".to_owned()));
        }
        let order = Order::Show(self.number, picture);
        if self.windows.proxy.send_event(order).is_err() {
            return Err(SessionError::Stopped);
        }
        self.windows.answer()
    }
}

/// The windows' side.
struct Wall<'a> {
    displays: &'a Displays,
    answer: Sender<Answer>,
    closed: &'a AtomicBool,
    windows: Vec<DisplayWindow>,
}

type Surface = softbuffer::Surface<Rc<Window>, Rc<Window>>;

/// A window that fills a display.
struct DisplayWindow {
    surface: Surface,
    /// Its screen, if it is not one that stays black, and the part of the slides that is shown here;
    /// `None` for all of them.
    shows: Option<(usize, Option<SlidePart>)>,
    /// Black if left out.
    picture: Option<Picture>,
    /// Whether the session waits for the picture to be drawn.
    waiting: bool,
}

/// Corner and size, in pixels.
type SlidePart = ([usize; 2], FrameSize);

impl ApplicationHandler<Order> for Wall<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if !self.windows.is_empty() {
            return;
        }
        let opened = self.open_all(events);
        let failed = opened.is_err();
        let answer = opened.map(|windows| {
            for window in &windows {
                window.surface.window().request_redraw();
            }
            self.windows = windows;
        });
        let _ = self.answer.send(answer);
        if failed {
            events.exit();
        }
    }

    fn user_event(&mut self, events: &ActiveEventLoop, order: Order) {
        match order {
            Order::Show(screen, picture) => {
                if let Err(error) = self.show(screen, &picture) {
                    let _ = self.answer.send(Err(error));
                }
            }
            Order::Close => events.exit(),
        }
    }

    fn window_event(&mut self, _events: &ActiveEventLoop, window: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::RedrawRequested => self.draw(window),
            WindowEvent::CloseRequested => self.closed.store(true, Ordering::SeqCst),
            WindowEvent::KeyboardInput { event, .. }
                if event.state == ElementState::Pressed
                    && event.logical_key == Key::Named(NamedKey::Escape) =>
            {
                self.closed.store(true, Ordering::SeqCst);
            }
            _ => {}
        }
    }
}

impl Wall<'_> {
    /// Opens all windows, once every display is known to be there and of the slides' size.
    fn open_all(&self, events: &ActiveEventLoop) -> Result<Vec<DisplayWindow>, SessionError> {
        let monitors: Vec<MonitorHandle> = events.available_monitors().collect();
        let chosen = |number: &usize| {
            let missing = || SessionError::NoDisplay {
                asked: *number,
                found: (0..).zip(&monitors).map(|(n, m)| described(n, m)).collect(),
            };
            monitors.get(*number).ok_or_else(missing)
        };
        let mut places = Vec::new();
        for (screen, span) in self.displays.screens.iter().enumerate() {
            let shown: Vec<&MonitorHandle> =
                span.displays.iter().map(chosen).collect::<Result<_, _>>()?;
            let sizes = shown.iter().map(|monitor| monitor.size());
            let sizes: Vec<_> = sizes.map(|size| (size.width, size.height)).collect();
            let parts = parts(&sizes, span.size).ok_or_else(|| SessionError::DisplaySize {
                found: span.displays.iter().copied().zip(sizes).collect(),
                slides: span.size,
            })?;
            let shows = parts.into_iter().map(|part| Some((screen, part)));
            places.extend(shown.into_iter().zip(shows));
        }
        for number in &self.displays.dark {
            places.push((chosen(number)?, None));
        }
        let windows = places.into_iter().map(|(monitor, shows)| {
            Ok(DisplayWindow {
                surface: open(events, monitor)?,
                shows,
                picture: None,
                waiting: false,
            })
        });
        windows.collect()
    }

    /// Has the picture drawn on a screen and black on the others.
    fn show(&mut self, screen: usize, picture: &Picture) -> Result<(), SessionError> {
        let parts = self.windows.iter().map(|window| match window.shows {
            Some((shows, None)) if shows == screen => Ok(Some(picture.clone())),
            Some((shows, Some((corner, size)))) if shows == screen => {
                let part = picture.part(corner, size);
                let missing = || SessionError::Display {
                    reason: format!("it has {} pixels, other slides have more", picture.size()),
                };
                part.map(Some).ok_or_else(missing)
            }
            _ => Ok(None),
        });
        let parts: Vec<Option<Picture>> = parts.collect::<Result<_, _>>()?;
        for (window, part) in self.windows.iter_mut().zip(parts) {
            // What is black already is not drawn again.
            window.waiting = part.is_some() || window.picture.is_some();
            window.picture = part;
            if window.waiting {
                window.surface.window().request_redraw();
            }
        }
        Ok(())
    }

    /// Draws a window, and tells the session once it waits for none any more.
    fn draw(&mut self, id: WindowId) {
        let waits = |windows: &[DisplayWindow]| windows.iter().any(|window| window.waiting);
        let waited = waits(&self.windows);
        let mut all = self.windows.iter_mut();
        let Some(window) = all.find(|window| window.surface.window().id() == id) else {
            return;
        };
        window.waiting = false;
        let drawn = window.draw();
        if drawn.is_err() {
            for window in &mut self.windows {
                window.waiting = false;
            }
        }
        if waited && !waits(&self.windows) {
            let _ = self.answer.send(drawn);
        }
    }
}

/// Opens a window that fills a display.
fn open(events: &ActiveEventLoop, monitor: &MonitorHandle) -> Result<Surface, SessionError> {
    let refuse = |reason: String| SessionError::Display { reason };
    let attributes = Window::default_attributes()
        .with_title("iltm")
        // For a desktop without a window manager, which full screen is a wish to.
        .with_position(monitor.position())
        .with_inner_size(monitor.size())
        .with_decorations(false)
        .with_fullscreen(Some(Fullscreen::Borderless(Some(monitor.clone()))));
    let window = events.create_window(attributes);
    let window = Rc::new(window.map_err(|error| refuse(error.to_string()))?);
    window.set_cursor_visible(false);
    let context = softbuffer::Context::new(Rc::clone(&window));
    let context = context.map_err(|error| refuse(error.to_string()))?;
    softbuffer::Surface::new(&context, window).map_err(|error| refuse(error.to_string()))
}

/// The part of slides of this width and height that each display shows, given theirs; `None` for one
/// that shows whole slides. `None` if the displays do not have the slides' pixels: as many columns in all,
/// and as many rows as the highest.
fn parts(displays: &[(u32, u32)], slides: (u32, u32)) -> Option<Vec<Option<SlidePart>>> {
    let width: u32 = displays.iter().map(|(width, _)| width).sum();
    let height = displays.iter().map(|(_, height)| height).max();
    let fit = width == slides.0 && height == Some(&slides.1);
    if !fit || displays.len() == 1 {
        return fit.then(|| vec![None]);
    }
    let mut left = 0;
    let parts = displays.iter().map(|(width, height)| {
        let size = FrameSize::new(u16::try_from(*width).ok()?, u16::try_from(*height).ok()?)?;
        let part = ([left, 0], size);
        left += size.width();
        Some(Some(part))
    });
    parts.collect()
}

impl DisplayWindow {
    /// Draws the picture in the middle of the window, black around it and before the
    /// first one.
    fn draw(&mut self) -> Result<(), SessionError> {
        let surface = &mut self.surface;
        let refuse = |error: softbuffer::SoftBufferError| SessionError::Display {
            reason: error.to_string(),
        };
        let size = surface.window().inner_size();
        let sides = NonZeroU32::new(size.width).zip(NonZeroU32::new(size.height));
        let Some((width, height)) = sides else {
            return Ok(());
        };
        surface.resize(width, height).map_err(refuse)?;
        let mut buffer = surface.buffer_mut().map_err(refuse)?;
        buffer.fill(0);
        if let Some(picture) = &self.picture {
            paint(picture, &mut buffer, size.width as usize);
        }
        buffer.present().map_err(refuse)
    }
}

/// A display in words.
fn described(number: usize, monitor: &MonitorHandle) -> String {
    let (size, place) = (monitor.size(), monitor.position());
    format!(
        "{number} is {}, {} x {} pixels at {}, {}",
        monitor
            .name()
            .unwrap_or_else(|| "without a name".to_owned()),
        size.width,
        size.height,
        place.x,
        place.y
    )
}

/// Paints the picture into the middle of a window of this width, `0RGB` a pixel.
fn paint(picture: &Picture, window: &mut [u32], width: usize) {
    let Samples::Eight(samples) = picture.samples() else {
        return;
    };
    let channels = picture.channels();
    let lines = samples.chunks_exact(picture.size().width() * channels);
    let height = window.len() / width.max(1);
    let middle =
        |room: usize, own: usize| (room.saturating_sub(own) / 2, own.saturating_sub(room) / 2);
    let (down, above) = middle(height, picture.size().height());
    let (right, left) = middle(width, picture.size().width());
    let rows = window.chunks_exact_mut(width).skip(down);
    for (row, line) in rows.zip(lines.skip(above)) {
        let pixels = line.chunks_exact(channels).skip(left);
        for (pixel, values) in row.iter_mut().skip(right).zip(pixels) {
            let [red, green, blue] = match *values {
                [red, green, blue] => [red, green, blue],
                [grey, ..] => [grey; 3],
                [] => [0; 3],
            };
            *pixel = u32::from_be_bytes([0, red, green, blue]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displays_beside_each_other_have_the_pixels_of_the_slides() {
        let part = |left, width, height| Some(([left, 0], FrameSize::new(width, height).unwrap()));
        assert_eq!(parts(&[(64, 48)], (64, 48)), Some(vec![None]));
        assert_eq!(
            parts(&[(64, 48), (80, 48)], (144, 48)),
            Some(vec![part(0, 64, 48), part(64, 80, 48)])
        );
        assert_eq!(
            parts(&[(64, 40), (80, 48)], (144, 48)),
            Some(vec![part(0, 64, 40), part(64, 80, 48)])
        );
        for (displays, slides) in [
            (&[(64, 48)][..], (144, 48)),
            (&[(64, 48), (80, 48)], (143, 48)),
            (&[(64, 48), (80, 49)], (144, 48)),
            (&[], (64, 48)),
        ] {
            assert_eq!(parts(displays, slides), None, "{displays:?} {slides:?}");
        }
    }

    #[test]
    fn a_picture_lies_in_the_middle_of_its_window() {
        let size = FrameSize::new(2, 1).unwrap();
        let colours = Samples::Eight(vec![1, 2, 3, 4, 5, 6]);
        let picture = Picture::new(size, colours).unwrap();
        let mut window = [0; 12];
        paint(&picture, &mut window, 4);
        assert_eq!(
            window,
            [0, 0, 0, 0, 0, 0x01_02_03, 0x04_05_06, 0, 0, 0, 0, 0]
        );
        let grey = Picture::new(size, Samples::Eight(vec![7, 8])).unwrap();
        let mut window = [0; 1];
        paint(&grey, &mut window, 1);
        assert_eq!(window, [0x07_07_07]);
    }
}
