//! Screens: slides shown by a command, or in a window that fills a display, pixel by pixel
//! and nothing else.
//!
//! The system wants its windows served by the thread that the process began with,
//! at any time; so the session runs on another one and hands slides over.

use super::SessionError;
use super::plan::Planned;
use super::shell::{self, Ran};
use iltm_picture::{Picture, Samples, foreign_file, png};
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

/// What the session's thread asks of the window's.
enum Order {
    /// Show this picture.
    Show(Picture),
    /// The session is over.
    Close,
}

/// What the window's thread answers.
type Answer = Result<(), SessionError>;

/// Runs `session` with a window on display `display`, the first being 0, for slides
/// of `size` pixels (width, height). The session's `stop` is true once the user closes
/// the window or presses Escape. Call it from the thread that the process began with.
///
/// # Errors
/// [`SessionError::Display`], [`SessionError::NoDisplay`] or
/// [`SessionError::DisplaySize`] if there is no such window, or what `session`
/// returns.
pub fn with_window<T: Send>(
    display: usize,
    size: (u32, u32),
    session: impl FnOnce(&mut dyn Screen, &(dyn Fn() -> bool + Sync)) -> Result<T, SessionError> + Send,
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
        display,
        size,
        answer,
        closed: &closed,
        surface: None,
        picture: None,
        waiting: false,
    };
    thread::scope(|scope| {
        let closed = &closed;
        let running = scope.spawn(move || {
            let mut screen = WindowScreen { proxy, answers };
            // The first answer: there is a window.
            let result = screen.answer().and_then(|()| {
                thread::sleep(SETTLING);
                session(&mut screen, &|| closed.load(Ordering::SeqCst))
            });
            // Without an event loop nobody has to be told.
            let _ = screen.proxy.send_event(Order::Close);
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

/// The session's side of the window.
struct WindowScreen {
    proxy: EventLoopProxy<Order>,
    answers: Receiver<Answer>,
}

impl WindowScreen {
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

impl Screen for WindowScreen {
    fn show(&mut self, planned: &Planned) -> Result<(), SessionError> {
        let refuse = |reason: String| SessionError::Display {
            reason: format!("{}: {reason}", planned.slide.display()),
        };
        let file = foreign_file::open(&planned.slide).map_err(|error| refuse(error.to_string()))?;
        let picture = png::read(BufReader::new(file)).map_err(|error| refuse(error.to_string()))?;
        if !matches!(picture.samples(), Samples::Eight(_)) {
            return Err(refuse("a display shows 8 bits, it has 16".to_owned()));
        }
        if self.proxy.send_event(Order::Show(picture)).is_err() {
            return Err(SessionError::Stopped);
        }
        self.answer()
    }
}

/// The window's side.
struct Wall<'a> {
    display: usize,
    size: (u32, u32),
    answer: Sender<Answer>,
    closed: &'a AtomicBool,
    surface: Option<Surface>,
    picture: Option<Picture>,
    /// Whether the session waits for the picture to be drawn.
    waiting: bool,
}

type Surface = softbuffer::Surface<Rc<Window>, Rc<Window>>;

impl ApplicationHandler<Order> for Wall<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.surface.is_some() {
            return;
        }
        let opened = self.open(events);
        let failed = opened.is_err();
        let answer = opened.map(|surface| {
            surface.window().request_redraw();
            self.surface = Some(surface);
        });
        let _ = self.answer.send(answer);
        if failed {
            events.exit();
        }
    }

    fn user_event(&mut self, events: &ActiveEventLoop, order: Order) {
        match order {
            Order::Show(picture) => {
                self.picture = Some(picture);
                self.waiting = true;
                if let Some(surface) = &self.surface {
                    surface.window().request_redraw();
                }
            }
            Order::Close => events.exit(),
        }
    }

    fn window_event(&mut self, _events: &ActiveEventLoop, _window: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::RedrawRequested => {
                let drawn = self.draw();
                if std::mem::take(&mut self.waiting) {
                    let _ = self.answer.send(drawn);
                }
            }
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
    /// Opens the window.
    fn open(&self, events: &ActiveEventLoop) -> Result<Surface, SessionError> {
        let monitors: Vec<MonitorHandle> = events.available_monitors().collect();
        let Some(chosen) = monitors.get(self.display) else {
            return Err(SessionError::NoDisplay {
                asked: self.display,
                found: (0..).zip(&monitors).map(|(n, m)| described(n, m)).collect(),
            });
        };
        let found = (chosen.size().width, chosen.size().height);
        if found != self.size {
            return Err(SessionError::DisplaySize {
                display: self.display,
                found,
                slides: self.size,
            });
        }
        let refuse = |reason: String| SessionError::Display { reason };
        let attributes = Window::default_attributes()
            .with_title("iltm")
            // For a desktop without a window manager, which full screen is a wish to.
            .with_position(chosen.position())
            .with_inner_size(chosen.size())
            .with_decorations(false)
            .with_fullscreen(Some(Fullscreen::Borderless(Some(chosen.clone()))));
        let window = events.create_window(attributes);
        let window = Rc::new(window.map_err(|error| refuse(error.to_string()))?);
        window.set_cursor_visible(false);
        let context = softbuffer::Context::new(Rc::clone(&window));
        let context = context.map_err(|error| refuse(error.to_string()))?;
        softbuffer::Surface::new(&context, window).map_err(|error| refuse(error.to_string()))
    }

    /// Draws the picture in the middle of the window, black around it and before the
    /// first one.
    fn draw(&mut self) -> Result<(), SessionError> {
        let Some(surface) = &mut self.surface else {
            return Ok(());
        };
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
    use iltm_runtime::FrameSize;

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
