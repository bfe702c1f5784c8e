//! Sessions with a camera of a few shell commands: what is shown is copied to a file
//! `now`, which is the wall, and a photograph is a copy of that.

use super::*;
use iltm_capture::{CameraSettings, PhotoStats};
use iltm_picture::{png, progress::Silent};
use iltm_runtime::{FrameSize, Grid};
use std::cell::Cell;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;
use tempfile::TempDir;

const NEVER: fn() -> bool = || false;

/// A camera that works.
const GOOD: &str = "cp now {photo}";

/// A capture folder of a few slides, and what stands beside it.
struct Rig {
    folder: TempDir,
    slides: usize,
}

impl Rig {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let grid = Grid::new(3, 4).unwrap();
        let layout = Layout::new(grid, FrameSize::new(24, 18).unwrap(), 0).unwrap();
        let slides = order(
            &layout,
            &OrderOptions {
                bernoulli: 3,
                ramp: 0,
                ..OrderOptions::default()
            },
        );
        // A name that the shell has to be told about.
        let out = folder.path().join("the wall's");
        let made = write(&slides, &layout, &CameraSettings::default(), &out, &Silent).unwrap();
        Self {
            folder,
            slides: made.slides,
        }
    }

    fn capture(&self) -> PathBuf {
        self.folder.path().join("the wall's")
    }

    fn photos(&self) -> Vec<String> {
        let entries = fs::read_dir(self.capture().join("photos")).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    /// A command beside the folder.
    fn here(&self, command: &str) -> String {
        format!("cd '{}' && {command}", self.folder.path().display())
    }

    fn screen(&self) -> CommandScreen<'static> {
        CommandScreen::new(&self.here("cp {slide} now"), &NEVER)
    }

    fn camera(&self, command: &str) -> CommandCamera<'static> {
        CommandCamera::new(&self.here(command), Duration::from_secs(20), &NEVER)
    }

    fn open(&self) -> CaptureSession {
        CaptureSession::open(&self.capture(), &Silent).unwrap()
    }

    /// Runs a session with this camera and counts its photographs.
    fn run(
        &self,
        camera: &str,
        options: &SessionOptions,
    ) -> (Result<Summary, SessionError>, usize) {
        let mut taken = 0;
        let summary = self.open().run(
            options,
            &mut self.screen(),
            &mut self.camera(camera),
            &NEVER,
            &mut |event| taken += usize::from(matches!(event, ShootEvent::Taken { .. })),
        );
        (summary, taken)
    }

    /// Whether every photograph is of its own slide.
    fn all_are_right(&self) -> bool {
        let read = |path: &Path| png::read(fs::File::open(path).unwrap()).unwrap();
        let session = self.open();
        session.list().all(|(planned, state)| {
            matches!(state, State::Whole(_)) && read(&planned.photo) == read(&planned.slide)
        })
    }
}

/// No wait.
fn at_once() -> SessionOptions {
    SessionOptions {
        latency: Some(Duration::ZERO),
        ..SessionOptions::default()
    }
}

#[test]
fn a_session_photographs_every_slide_as_itself() {
    let rig = Rig::new();
    let (summary, taken) = rig.run(GOOD, &at_once());
    assert_eq!(summary.unwrap().taken, rig.slides);
    assert_eq!((taken, rig.photos().len()), (rig.slides, rig.slides));
    assert!(rig.all_are_right());
}

#[test]
fn an_interrupted_session_goes_on_where_it_stopped() {
    let rig = Rig::new();
    let taken = Cell::new(0);
    let stop = || taken.get() == 5;
    let stopped = rig.open().run(
        &at_once(),
        &mut rig.screen(),
        &mut rig.camera(GOOD),
        &stop,
        &mut |event| {
            taken.set(taken.get() + usize::from(matches!(event, ShootEvent::Taken { .. })));
        },
    );
    assert!(matches!(stopped, Err(SessionError::Stopped)), "{stopped:?}");
    assert_eq!(
        rig.photos().len(),
        5,
        "no half photograph: {:?}",
        rig.photos()
    );
    let (summary, taken) = rig.run(GOOD, &at_once());
    assert_eq!(summary.unwrap().taken, rig.slides - 5);
    assert_eq!(taken, rig.slides - 5);
    assert!(rig.all_are_right());
    // And nothing is left to do.
    assert_eq!(rig.run("false", &at_once()).0.unwrap().taken, 0);
}

#[test]
fn a_stop_while_the_camera_works_ends_the_camera() {
    let rig = Rig::new();
    let begun = std::time::Instant::now();
    let stop = || begun.elapsed() > Duration::from_millis(400);
    let command = rig.here("sleep 60; cp now {photo}");
    let mut camera = CommandCamera::new(&command, Duration::from_secs(90), &stop);
    let mut screen = rig.screen();
    let stopped = rig
        .open()
        .run(&at_once(), &mut screen, &mut camera, &stop, &mut |_| ());
    assert!(matches!(stopped, Err(SessionError::Stopped)), "{stopped:?}");
    assert!(rig.photos().is_empty());
}

/// What a session says when the camera goes wrong at the fourth slide.
fn fails_at_three(rig: &Rig, wrong: &str) -> String {
    let command = format!("if [ {{index}} = 3 ]; then {wrong}; else {GOOD}; fi");
    let (failed, taken) = rig.run(&command, &at_once());
    let error = failed.unwrap_err();
    assert!(
        matches!(error, SessionError::Camera { index: 3, .. }),
        "{error}"
    );
    assert_eq!((taken, rig.photos().len()), (3, 3), "{:?}", rig.photos());
    error.to_string()
}

#[test]
fn a_camera_that_goes_wrong_is_told_and_leaves_nothing_behind() {
    let rig = Rig::new();
    let text = fails_at_three(&rig, "echo no battery >&2; false");
    assert!(text.contains("no battery"), "{text}");
    for (wrong, said) in [
        ("true", "wrote no 003.png"),
        ("cp now {stem}.tif; cp now {stem}.jpg", "wrote 2 files"),
        ("head -c 50 now > {photo}", "no whole photograph"),
        ("echo P > {photo}", "no whole photograph"),
    ] {
        let rig = Rig::new();
        let text = fails_at_three(&rig, wrong);
        assert!(text.contains(said), "{text}");
    }
    let rig = Rig::new();
    let pattern = rig.capture().join("patterns/000.png");
    fs::copy(pattern, rig.folder.path().join("small")).unwrap();
    let text = fails_at_three(&rig, "cp small {photo}");
    assert!(
        text.contains("it has 4 x 3 pixels, the others have 24 x 18"),
        "{text}"
    );
}

#[test]
fn a_camera_that_hangs_is_ended() {
    let rig = Rig::new();
    let command = rig.here("sleep 60");
    let mut camera = CommandCamera::new(&command, Duration::from_millis(300), &NEVER);
    let mut screen = rig.screen();
    let failed = rig
        .open()
        .run(&at_once(), &mut screen, &mut camera, &NEVER, &mut |_| ());
    assert!(
        failed
            .unwrap_err()
            .to_string()
            .contains("took longer than 0.3 s")
    );
}

#[test]
fn a_photograph_that_fails_once_is_taken_again() {
    let rig = Rig::new();
    let options = SessionOptions {
        retries: 1,
        ..at_once()
    };
    // Fails at every first attempt.
    let camera = "if [ -e tried{index} ]; then cp now {photo}; else touch tried{index}; false; fi";
    assert_eq!(rig.run(camera, &options).0.unwrap().taken, rig.slides);
    assert!(rig.all_are_right());
    let rig = Rig::new();
    assert!(rig.run(camera, &at_once()).0.is_err());
}

#[test]
fn slides_asked_for_are_photographed_again_and_replace_what_was_there() {
    let rig = Rig::new();
    rig.run("cp now {stem}.tif", &at_once()).0.unwrap();
    assert!(rig.photos().contains(&"002.tif".to_owned()));
    let options = SessionOptions {
        again: vec![2, 4],
        ..at_once()
    };
    assert_eq!(rig.run(GOOD, &options).0.unwrap().taken, 2);
    let photos = rig.photos();
    assert_eq!(photos.len(), rig.slides);
    assert!(photos.contains(&"002.png".to_owned()) && photos.contains(&"003.tif".to_owned()));
    let options = SessionOptions {
        again: vec![999],
        ..at_once()
    };
    let error = rig.run(GOOD, &options).0.unwrap_err().to_string();
    assert!(error.contains("nothing is shown at index 999"), "{error}");
}

#[test]
fn a_folder_says_what_is_missing_and_what_is_of_no_use() {
    let rig = Rig::new();
    rig.run(GOOD, &at_once()).0.unwrap();
    let photos = rig.capture().join("photos");
    fs::remove_file(photos.join("001.png")).unwrap();
    let bytes = fs::read(photos.join("004.png")).unwrap();
    fs::write(photos.join("004.png"), &bytes[..bytes.len() / 2]).unwrap();
    fs::copy(
        rig.capture().join("patterns/000.png"),
        photos.join("005.png"),
    )
    .unwrap();
    fs::rename(photos.join("006.png"), photos.join("006.tif")).unwrap();
    fs::copy(photos.join("006.tif"), photos.join("006.jpg")).unwrap();
    let session = rig.open();
    let states: Vec<&State> = session.list().map(|(_, state)| state).collect();
    assert_eq!(states[1], &State::Missing);
    for (at, why) in [(4, "004.png"), (5, "4 x 3 pixels"), (6, "006.tif")] {
        let State::Bad(reason) = states[at] else {
            panic!("{at}: {:?}", states[at])
        };
        assert!(reason.contains(why), "{reason}");
    }
    // A session mends exactly these.
    assert_eq!(rig.run(GOOD, &at_once()).0.unwrap().taken, 4);
    assert!(rig.all_are_right());
}

/// A camera that streams: a photograph is what was on the wall two photographs ago.
#[test]
fn photographs_that_the_camera_keeps_back_are_measured_and_thrown_away() {
    let rig = Rig::new();
    let black = rig.capture().join("slides/001.png");
    for kept in ["one", "two"] {
        fs::copy(&black, rig.folder.path().join(kept)).unwrap();
    }
    let camera = "mv one {photo} && mv two one && cp now two";
    let (summary, _) = rig.run(camera, &SessionOptions::default());
    assert_eq!(summary.unwrap().latency.unwrap().discard, 2);
    assert!(rig.all_are_right());
}

#[test]
fn a_camera_that_does_not_see_the_wall_is_told_before_the_first_photograph() {
    let rig = Rig::new();
    let pattern = rig.capture().join("slides/001.png");
    fs::copy(pattern, rig.folder.path().join("lens cap")).unwrap();
    let (failed, taken) = rig.run("cp 'lens cap' {photo}", &SessionOptions::default());
    let error = failed.unwrap_err();
    assert!(matches!(error, SessionError::Latency { .. }), "{error}");
    assert!(error.to_string().contains("look alike"), "{error}");
    assert_eq!((taken, rig.photos().len()), (0, 0));
}

/// Shows nothing; but half a second later somebody's camera writes a photograph
/// into a folder, in two halves.
struct Tethered {
    folder: PathBuf,
}

impl Screen for Tethered {
    fn show(&mut self, planned: &Planned) -> Result<(), SessionError> {
        let place = self.folder.join(format!("IMG_{}.PNG", planned.index));
        let bytes = fs::read(&planned.slide).unwrap();
        let note = self.folder.join(format!("IMG_{}.xmp", planned.index));
        thread::spawn(move || {
            thread::sleep(Duration::from_millis(200));
            fs::write(note, "no photograph").unwrap();
            fs::write(&place, &bytes[..bytes.len() / 2]).unwrap();
            thread::sleep(Duration::from_millis(400));
            fs::write(&place, &bytes).unwrap();
        });
        Ok(())
    }
}

#[test]
fn photographs_that_appear_in_a_folder_are_taken_once_they_are_whole() {
    let rig = Rig::new();
    let folder = rig.folder.path().join("tethered");
    fs::create_dir(&folder).unwrap();
    // From yesterday.
    fs::write(folder.join("IMG_000.PNG"), "old").unwrap();
    let only_two = rig.slides as u32 - 2;
    rig.run(GOOD, &at_once()).0.unwrap();
    for index in [only_two, only_two + 1] {
        fs::remove_file(rig.capture().join(format!("photos/{index:03}.png"))).unwrap();
    }
    let mut camera = WatchedFolder::new(&folder, Duration::from_secs(20), &NEVER);
    let mut screen = Tethered {
        folder: folder.clone(),
    };
    let summary = rig
        .open()
        .run(
            &SessionOptions::default(),
            &mut screen,
            &mut camera,
            &NEVER,
            &mut |_| (),
        )
        .unwrap();
    assert_eq!(summary.taken, 2);
    let name = format!("{only_two:03}.PNG");
    let photo = rig.capture().join("photos").join(&name);
    assert_eq!(PhotoStats::read(&photo).unwrap().size, (24, 18), "{name}");
    let slide = rig.capture().join(slide_name(only_two));
    assert_eq!(fs::read(photo).unwrap(), fs::read(slide).unwrap());
}

#[test]
fn a_folder_that_stays_empty_is_given_up() {
    let rig = Rig::new();
    let mut camera = WatchedFolder::new(rig.folder.path(), Duration::from_millis(100), &NEVER);
    let mut screen = CommandScreen::new("true", &NEVER);
    let failed = rig
        .open()
        .run(&at_once(), &mut screen, &mut camera, &NEVER, &mut |_| ());
    let error = failed.unwrap_err().to_string();
    assert!(error.contains("no new photograph appeared"), "{error}");
}

#[test]
fn a_screen_that_fails_is_told_with_its_words() {
    let rig = Rig::new();
    let mut screen = CommandScreen::new("echo no signal; false", &NEVER);
    let failed = rig.open().run(
        &at_once(),
        &mut screen,
        &mut rig.camera(GOOD),
        &NEVER,
        &mut |_| (),
    );
    let error = failed.unwrap_err();
    assert!(matches!(error, SessionError::Display { .. }), "{error}");
    assert!(error.to_string().contains("no signal"), "{error}");
}

#[test]
fn two_lists_that_claim_one_place_are_refused() {
    let rig = Rig::new();
    let text = "index,role,pattern,photo\n2,plain-1,patterns/002.png,photos/002.png\n";
    fs::write(rig.capture().join("verify.csv"), text).unwrap();
    let error = planned(&rig.capture()).unwrap_err().to_string();
    assert!(error.contains("index 2 stands in "), "{error}");
}
