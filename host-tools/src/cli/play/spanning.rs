//! A window over displays beside each other, in which mpv draws.
//!
//! mpv fills one display, and window managers keep windows to one. This window is not theirs
//! (`override_redirect`: Xlib manual, 3.2.8), so nobody gives it the keyboard either: it asks for the
//! keys itself, and again at a click.

use super::super::failure::{Failure, Kind};
use iltm_runtime::FrameSize;
use std::env;
use std::fmt;
use x11rb::connection::Connection;
use x11rb::errors::{ConnectError, ConnectionError, ReplyError, ReplyOrIdError};
use x11rb::protocol::Event;
use x11rb::protocol::randr::{ConnectionExt as _, NotifyMask};
use x11rb::protocol::xproto::{
    ConnectionExt as _, CreateWindowAux, EventMask, InputFocus, Window, WindowClass,
};
use x11rb::rust_connection::RustConnection;
use x11rb::{COPY_DEPTH_FROM_PARENT, COPY_FROM_PARENT, CURRENT_TIME};

/// A display of the desktop, in its pixels.
#[derive(Clone, PartialEq, Eq, Debug)]
struct DesktopDisplay {
    name: String,
    left: i16,
    top: i16,
    width: u16,
    height: u16,
}

impl fmt::Display for DesktopDisplay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {} x {} pixels at {}, {}",
            self.name, self.width, self.height, self.left, self.top
        )
    }
}

/// The window, while mpv draws in it.
#[derive(Debug)]
pub(super) struct SpanningWindow {
    connection: RustConnection,
    root: Window,
    id: Window,
    /// With their numbers, from left to right.
    displays: Vec<(u16, DesktopDisplay)>,
    /// mpv's own window within.
    player: Option<Window>,
}

/// Whether mpv draws on an X server here: it prefers Wayland, where programs cannot place windows.
pub(super) fn on_x11() -> bool {
    let set = |name| env::var_os(name).is_some_and(|value| !value.is_empty());
    cfg!(all(unix, not(target_os = "macos"))) && set("DISPLAY") && !set("WAYLAND_DISPLAY")
}

impl SpanningWindow {
    /// Covers the displays of these numbers with black. Together they must have `size` pixels, if
    /// that is known.
    pub(super) fn open(numbers: &[u16], size: Option<FrameSize>) -> Result<Self, Failure> {
        let (connection, screen) =
            x11rb::connect(None).map_err(|error: ConnectError| lost(&error))?;
        let root = connection.setup().roots[screen].root;
        let all = displays(&connection, root).map_err(|error| lost(&error))?;
        let displays = beside(numbers, &all)?;
        if let Some(size) = size {
            let found = size_of(&displays);
            let wanted = [size.width(), size.height()];
            if found != wanted {
                let (which, have) = if displays.len() > 1 {
                    ("displays", "have together")
                } else {
                    ("display", "has")
                };
                return Err(Failure::new(
                    Kind::Display,
                    format!(
                        "the {which} {have} {} x {} pixels, the table's projector {} x {}",
                        found[0], found[1], wanted[0], wanted[1]
                    ),
                    "Set displays to the projectors' own modes, and name all that show a wide frame: \
                     --display 1,2.",
                ));
            }
        }
        Self::cover(connection, screen, displays).map_err(|error| lost(&error))
    }

    fn cover(
        connection: RustConnection,
        screen: usize,
        displays: Vec<(u16, DesktopDisplay)>,
    ) -> Result<Self, ReplyOrIdError> {
        let (root, black) = {
            let screen = &connection.setup().roots[screen];
            (screen.root, screen.black_pixel)
        };
        let id = connection.generate_id()?;
        let first = &displays[0].1;
        let how = CreateWindowAux::new()
            .override_redirect(1)
            .background_pixel(black)
            .event_mask(EventMask::SUBSTRUCTURE_NOTIFY | EventMask::BUTTON_PRESS);
        let [width, height] =
            size_of(&displays).map(|side| u16::try_from(side).unwrap_or(u16::MAX));
        connection
            .create_window(
                COPY_DEPTH_FROM_PARENT,
                id,
                root,
                first.left,
                first.top,
                width,
                height,
                0,
                WindowClass::INPUT_OUTPUT,
                COPY_FROM_PARENT,
                &how,
            )?
            .check()?;
        connection.map_window(id)?;
        let changes = NotifyMask::SCREEN_CHANGE | NotifyMask::CRTC_CHANGE;
        connection.randr_select_input(root, changes)?;
        connection.flush()?;
        Ok(Self {
            connection,
            root,
            id,
            displays,
            player: None,
        })
    }

    /// For mpv's `--wid`.
    pub(super) const fn id(&self) -> Window {
        self.id
    }

    /// Gives mpv the keys where they are due, and says what became of the displays, if anything.
    pub(super) fn look(&mut self) -> Option<String> {
        self.events()
            .unwrap_or_else(|error| Some(format!("the desktop is lost: {error}")))
    }

    fn events(&mut self) -> Result<Option<String>, ReplyError> {
        let mut changed = false;
        while let Some(event) = self.connection.poll_for_event()? {
            match event {
                Event::MapNotify(mapped) if mapped.event == self.id => {
                    self.player = Some(mapped.window);
                    self.take_keys()?;
                }
                Event::ButtonPress(_) => self.take_keys()?,
                Event::RandrScreenChangeNotify(_) | Event::RandrNotify(_) => changed = true,
                _ => (),
            }
        }
        if !changed {
            return Ok(None);
        }
        let now = displays(&self.connection, self.root)?;
        let gone = self
            .displays
            .iter()
            .find(|(_, display)| !now.contains(display));
        Ok(gone
            .map(|(number, _)| format!("display {number} is gone, or its mode or place changed")))
    }

    fn take_keys(&self) -> Result<(), ConnectionError> {
        let window = self.player.unwrap_or(self.id);
        self.connection
            .set_input_focus(InputFocus::PARENT, window, CURRENT_TIME)?;
        self.connection.flush()
    }
}

fn lost(error: &dyn fmt::Display) -> Failure {
    Failure::new(
        Kind::Display,
        format!("there is no desktop to show it on: {error}"),
        "Check that a desktop is running and the projector is part of it.",
    )
}

/// All that are on, numbered as `iltm capture` and mpv number them: the primary display first, the others
/// in the order of their controllers.
fn displays(connection: &RustConnection, root: Window) -> Result<Vec<DesktopDisplay>, ReplyError> {
    let resources = connection
        .randr_get_screen_resources_current(root)?
        .reply()?;
    let mut displays = Vec::new();
    for controller in resources.crtcs {
        let info = connection
            .randr_get_crtc_info(controller, CURRENT_TIME)?
            .reply()?;
        let Some(output) = info.outputs.first().filter(|_| info.width > 0) else {
            continue;
        };
        let output = connection
            .randr_get_output_info(*output, CURRENT_TIME)?
            .reply()?;
        displays.push(DesktopDisplay {
            name: String::from_utf8_lossy(&output.name).into_owned(),
            left: info.x,
            top: info.y,
            width: info.width,
            height: info.height,
        });
    }
    Ok(displays)
}

/// The displays of these numbers, if each lies to the right of the one before, their upper edges at
/// one height.
fn beside(numbers: &[u16], all: &[DesktopDisplay]) -> Result<Vec<(u16, DesktopDisplay)>, Failure> {
    let chosen = numbers.iter().map(|number| {
        let display = all.get(usize::from(*number)).ok_or_else(|| {
            let listed: Vec<String> = (0..)
                .zip(all)
                .map(|(number, display): (u16, _)| format!("{number} is {display}"))
                .collect();
            Failure::new(
                Kind::Display,
                format!("there is no display {number}; {}", listed.join("; ")),
                "Choose one of these, or switch the projector on and extend the desktop to it.",
            )
        })?;
        Ok((*number, display.clone()))
    });
    let chosen: Vec<_> = chosen.collect::<Result<_, Failure>>()?;
    for pair in chosen.windows(2) {
        let [(left, a), (right, b)] = pair else {
            continue;
        };
        let edge = i32::from(a.left) + i32::from(a.width);
        if edge != i32::from(b.left) || a.top != b.top {
            return Err(Failure::new(
                Kind::Display,
                format!(
                    "display {right} does not lie beside display {left}, to its right and with its upper \
                     edge at the same height: {left} is {a}; {right} is {b}"
                ),
                "Place the displays beside each other in the desktop's settings, in the order of the \
                 wide frame, with their upper edges at one height.",
            ));
        }
    }
    Ok(chosen)
}

/// Width and height of what covers all of them.
fn size_of(displays: &[(u16, DesktopDisplay)]) -> [usize; 2] {
    let width = displays.iter().map(|(_, one)| usize::from(one.width)).sum();
    let height = displays.iter().map(|(_, one)| one.height).max();
    [width, height.map_or(0, usize::from)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn display(left: i16, top: i16, width: u16, height: u16) -> DesktopDisplay {
        DesktopDisplay {
            name: "one".to_owned(),
            left,
            top,
            width,
            height,
        }
    }

    #[test]
    fn displays_of_a_wide_frame_touch_in_its_order() {
        let all = [
            display(0, 0, 64, 48),
            display(64, 0, 80, 48),
            display(144, 0, 80, 50),
            display(144, 48, 80, 48),
            display(-32, 0, 32, 48),
        ];
        for good in [&[0][..], &[0, 1], &[4, 0, 1], &[3], &[1, 2]] {
            let found = beside(good, &all).unwrap_or_else(|error| panic!("{}", error.message));
            assert!(found.iter().map(|(number, _)| number).eq(good));
        }
        for bad in [&[1, 0][..], &[0, 2], &[1, 3], &[0, 0], &[0, 5]] {
            let refused = beside(bad, &all).map(|_| ()).unwrap_err();
            assert_eq!(refused.kind, Kind::Display, "{bad:?}");
        }
        assert_eq!(size_of(&beside(&[4, 0, 1, 2], &all).unwrap()), [256, 50]);
    }
}
