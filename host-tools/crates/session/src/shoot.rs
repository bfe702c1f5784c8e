//! A session: slide by slide, shown, waited for, photographed, looked at.

use super::latency::{Flash, LatencyProbe};
use super::plan::{self, Planned, State, endings, unlike};
use super::shell;
use super::{CameraDriver, Latency, Screen, SessionError, measure, states};
use iltm_capture::{PhotoStats, Role};
use iltm_picture::progress::Progress;
use iltm_picture::unfinished::TemporaryFolder;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How to photograph.
#[derive(Clone, Debug, Default)]
pub struct SessionOptions {
    /// Places in the order of showing that are photographed although a whole
    /// photograph is there.
    pub again: Vec<u32>,
    /// How long to wait after each change of the picture; measured if left out.
    pub latency: Option<Duration>,
    /// How often a photograph that fails is tried again.
    pub retries: u32,
}

/// Something that happened.
#[derive(Clone, Debug)]
pub enum ShootEvent<'a> {
    /// The session begins, or goes on.
    Begun {
        /// Photographs to take.
        missing: usize,
        /// Photographs in all.
        all: usize,
    },
    /// Latency is to be measured.
    Measuring,
    /// What is done after every change of the picture.
    Latency(Latency),
    /// A slide is on the wall and stands.
    Shown(&'a Planned),
    /// A photograph failed; it is tried again.
    Failed {
        /// Which.
        planned: &'a Planned,
        /// Why.
        reason: &'a str,
    },
    /// A photograph is in its place.
    Taken {
        /// Which.
        planned: &'a Planned,
        /// Its file.
        photo: &'a Path,
        /// What it is like.
        exposed: PhotoStats,
        /// Photographs that are still missing.
        left: usize,
    },
}

/// What a session came to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Summary {
    /// Photographs that were taken.
    pub taken: usize,
    /// Photographs in all, all of them there.
    pub all: usize,
    /// What was done after every change of the picture; `None` if nothing was
    /// missing.
    pub latency: Option<Latency>,
}

/// What is to be photographed, and what of it is there.
#[derive(Debug)]
pub struct CaptureSession {
    folder: PathBuf,
    list: Vec<Planned>,
    states: Vec<State>,
}

impl CaptureSession {
    /// Opens a capture folder and looks at the photographs that are there.
    ///
    /// # Errors
    /// As [`plan::planned`].
    pub fn open(folder: &Path, progress: &dyn Progress) -> Result<Self, SessionError> {
        let list = plan::planned(folder)?;
        let states = states(&list, progress);
        Ok(Self {
            folder: folder.to_owned(),
            list,
            states,
        })
    }

    /// Everything to photograph, and how that is.
    pub fn list(&self) -> impl Iterator<Item = (&Planned, &State)> {
        self.list.iter().zip(&self.states)
    }

    /// Takes every photograph that is missing, of no use, or asked for again.
    ///
    /// # Errors
    /// [`SessionError`]; photographs that were taken before it stay.
    pub fn run(
        &mut self,
        options: &SessionOptions,
        screen: &mut dyn Screen,
        camera: &mut dyn CameraDriver,
        stop: &dyn Fn() -> bool,
        tell: &mut dyn FnMut(&ShootEvent<'_>),
    ) -> Result<Summary, SessionError> {
        let todo = self.todo(&options.again)?;
        let (missing, all) = (todo.len(), self.list.len());
        tell(&ShootEvent::Begun { missing, all });
        if todo.is_empty() {
            return Ok(Summary {
                taken: 0,
                all,
                latency: None,
            });
        }
        let mut shooting = Shooting {
            screen,
            camera,
            stop,
        };
        let latency = match options.latency {
            Some(wait) => Latency { wait, discard: 0 },
            // A person looks before pressing the button.
            None if !shooting.camera.is_prompt() => Latency::default(),
            None => {
                tell(&ShootEvent::Measuring);
                shooting.latency(&self.list, &self.folder)?
            }
        };
        tell(&ShootEvent::Latency(latency));
        for (done, at) in todo.into_iter().enumerate() {
            let planned = &self.list[at];
            let like = self.like(at);
            let mut attempt = 0;
            let (photo, exposed) = loop {
                match shooting.one(planned, latency, like.as_ref(), tell) {
                    Err(SessionError::Camera { reason, .. }) if attempt < options.retries => {
                        attempt += 1;
                        let reason = &reason;
                        tell(&ShootEvent::Failed { planned, reason });
                    }
                    other => break other?,
                }
            };
            tell(&ShootEvent::Taken {
                planned,
                photo: &photo,
                exposed,
                left: missing - done - 1,
            });
            self.states[at] = State::Whole(exposed);
        }
        Ok(Summary {
            taken: missing,
            all,
            latency: Some(latency),
        })
    }

    /// Places in the list that have to be photographed.
    fn todo(&self, again: &[u32]) -> Result<Vec<usize>, SessionError> {
        for index in again {
            if !self.list.iter().any(|planned| planned.index == *index) {
                return Err(SessionError::NoIndex {
                    folder: self.folder.clone(),
                    index: *index,
                    last: self.list.last().map_or(0, |planned| planned.index),
                });
            }
        }
        let wanted = |at: &usize| {
            let whole = matches!(self.states[*at], State::Whole(_));
            !whole || again.contains(&self.list[*at].index)
        };
        let todo: Vec<usize> = (0..self.list.len()).filter(wanted).collect();
        // Known now, rather than in the middle of the night.
        let slides = todo.iter().map(|at| &self.list[*at].slide);
        if let Some(path) = slides.into_iter().find(|slide| !slide.is_file()) {
            return Err(SessionError::NoSlide { path: path.clone() });
        }
        Ok(todo)
    }

    /// Another photograph, that the one at this place has to be like.
    fn like(&self, at: usize) -> Option<PhotoStats> {
        let others = self.states.iter().enumerate();
        others
            .filter(|(other, _)| *other != at)
            .find_map(|(_, state)| match state {
                State::Whole(exposed) => Some(*exposed),
                _ => None,
            })
    }
}

/// Screen and camera at work.
struct Shooting<'a> {
    screen: &'a mut dyn Screen,
    camera: &'a mut dyn CameraDriver,
    stop: &'a dyn Fn() -> bool,
}

impl Shooting<'_> {
    fn stopped(&self) -> Result<(), SessionError> {
        if (self.stop)() {
            return Err(SessionError::Stopped);
        }
        Ok(())
    }

    /// Shows one slide and puts its photograph in its place.
    fn one(
        &mut self,
        planned: &Planned,
        latency: Latency,
        like: Option<&PhotoStats>,
        tell: &mut dyn FnMut(&ShootEvent<'_>),
    ) -> Result<(PathBuf, PhotoStats), SessionError> {
        self.stopped()?;
        self.screen.show(planned)?;
        if !shell::wait(latency.wait, self.stop) {
            return Err(SessionError::Stopped);
        }
        for _ in 0..latency.discard {
            let folder = beside(&planned.photo)?;
            self.camera.shoot(planned, folder.path())?;
        }
        tell(&ShootEvent::Shown(planned));
        let folder = beside(&planned.photo)?;
        let (taken, exposed) = self.whole(planned, folder.path())?;
        if let Some(why) = like.and_then(|like| unlike(&exposed, like)) {
            return Err(SessionError::Camera {
                index: planned.index,
                reason: why,
            });
        }
        let photo = put_in_place(&taken, &planned.photo)?;
        Ok((photo, exposed))
    }

    /// Takes a photograph and decodes it.
    fn whole(
        &mut self,
        planned: &Planned,
        folder: &Path,
    ) -> Result<(PathBuf, PhotoStats), SessionError> {
        let taken = self.camera.shoot(planned, folder)?;
        match PhotoStats::read(&taken) {
            Ok(exposed) => Ok((taken, exposed)),
            Err(error) => Err(SessionError::Camera {
                index: planned.index,
                reason: format!(
                    "the camera wrote a file that is no whole photograph: {}",
                    // The temporary name helps nobody.
                    error.to_string().replace(&*folder.to_string_lossy(), "")
                ),
            }),
        }
    }

    /// Measures the latency with white and black of the list.
    fn latency(&mut self, list: &[Planned], folder: &Path) -> Result<Latency, SessionError> {
        let of = |role: Role| {
            let role = role.to_string();
            list.iter().find(|planned| planned.role == role)
        };
        let (Some(white), Some(black)) = (of(Role::White), of(Role::Black)) else {
            let reason = format!("{} has no slides of white and black", folder.display());
            return Err(SessionError::Latency { reason });
        };
        let stop = self.stop;
        let mut flashing = Flashing {
            shooting: self,
            white,
            black,
            shown: black,
        };
        measure(&mut flashing, stop)
    }
}

/// Screen and camera while latency is measured.
struct Flashing<'f, 'a, 'l> {
    shooting: &'f mut Shooting<'a>,
    white: &'l Planned,
    black: &'l Planned,
    shown: &'l Planned,
}

impl LatencyProbe for Flashing<'_, '_, '_> {
    fn show(&mut self, flash: Flash) -> Result<(), SessionError> {
        self.shooting.stopped()?;
        self.shown = match flash {
            Flash::White => self.white,
            Flash::Black => self.black,
        };
        self.shooting.screen.show(self.shown)
    }

    fn level(&mut self) -> Result<f64, SessionError> {
        self.shooting.stopped()?;
        let folder = beside(&self.shown.photo)?;
        let (_, exposed) = self.shooting.whole(self.shown, folder.path())?;
        Ok(exposed.mean)
    }
}

/// An empty folder beside a photograph's place, gone when it is dropped.
fn beside(photo: &Path) -> Result<TemporaryFolder, SessionError> {
    let parent = photo.parent().unwrap_or(Path::new("."));
    let make = || {
        fs::create_dir_all(parent)?;
        TemporaryFolder::within(parent, ".shot-")
    };
    make().map_err(|source| SessionError::Write {
        path: parent.to_owned(),
        source,
    })
}

/// Gives a photograph its place, in one step, and removes one of the same name with
/// another ending.
fn put_in_place(taken: &Path, photo: &Path) -> Result<PathBuf, SessionError> {
    let place = photo.with_extension(taken.extension().unwrap_or_default());
    let put = || {
        // Where that cannot be had, a power cut may cost this photograph.
        let _ = fs::File::open(taken).and_then(|file| file.sync_all());
        fs::rename(taken, &place)?;
        for other in endings(photo).into_iter().filter(|file| *file != place) {
            fs::remove_file(other)?;
        }
        Ok(())
    };
    put().map_err(|source| SessionError::Write {
        path: place.clone(),
        source,
    })?;
    Ok(place)
}
