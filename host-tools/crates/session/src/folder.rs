//! Capture folder: writes one that waits for its photographs.

use super::{Layout, PatternsError, Purpose, Slide};
use iltm_capture::{
    CALIBRATION_FILE, CalibrationManifest, CameraSettings, MANIFEST_FILE, Manifest, Role,
    SETTINGS_FILE, STRIPES_FILE, StripeManifest, numbered,
};
use iltm_picture::{WholeFolder, progress::Progress};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Folder of the pictures to show, in the projector's own pixels.
pub const SLIDES_FOLDER: &str = "slides";

/// Folders of a capture, in the order in which its README explains them.
const FOLDERS: [&str; 4] = ["patterns", "calibration", SLIDES_FOLDER, "photos"];

/// The README of a capture folder; words in braces are filled in.
const README: &str = include_str!("readme.md");

/// The settings of a capture folder; words in braces are filled in.
const SETTINGS: &str = include_str!("settings.toml");

/// What was written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Made {
    /// Pictures to photograph, all together.
    pub slides: usize,
    /// Those of them that measure projector and camera.
    pub calibration: usize,
    /// Those of them that are stripes finer than the cells.
    pub stripes: usize,
    /// Those of them that are images.
    pub images: usize,
}

/// File of the slide with this index, relative to the capture folder.
#[must_use]
pub fn slide_name(index: u32) -> PathBuf {
    numbered(SLIDES_FOLDER, index)
}

/// Writes the folder `out`: beside its place first, then renamed, so that it is
/// whole or not there. What is known of the `camera` goes into its settings.
///
/// # Errors
/// [`PatternsError::Folder`] if something is in its place or it cannot be written.
pub fn write(
    slides: &[Slide],
    layout: &Layout,
    camera: &CameraSettings,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Made, PatternsError> {
    let folder = WholeFolder::create(out)?;
    for name in FOLDERS {
        folder.folder(name)?;
    }
    progress.begin("drawing slides", slides.len() as u64);
    slides.par_iter().enumerate().try_for_each(|(at, slide)| {
        let index = at as u32;
        let pattern = match slide.purpose {
            // The slide says it all.
            Purpose::Scene(Role::Image) | Purpose::Stripes(_) => None,
            Purpose::Scene(_) => Some("patterns"),
            Purpose::Calibration(_) => Some("calibration"),
        };
        if let Some(pattern) = pattern {
            folder.picture(numbered(pattern, index), &slide.picture)?;
        }
        folder.picture(slide_name(index), &layout.slide(&slide.picture)?)?;
        progress.advance(1);
        Ok::<(), PatternsError>(())
    })?;
    let (scene, calibration, stripes) = lists(slides);
    let made = Made {
        slides: slides.len(),
        calibration: calibration.shots.len(),
        stripes: stripes.shots.len(),
        images: (scene.shots.iter())
            .filter(|shot| shot.role == Role::Image)
            .count(),
    };
    folder.file(MANIFEST_FILE, scene.to_csv())?;
    folder.file(SETTINGS_FILE, filled(SETTINGS, layout, camera, made))?;
    folder.file("README.md", filled(README, layout, camera, made))?;
    if made.calibration > 0 {
        folder.file(CALIBRATION_FILE, calibration.to_csv())?;
    }
    if made.stripes > 0 {
        folder.file(STRIPES_FILE, stripes.to_csv())?;
    }
    folder.finish()?;
    progress.end();
    Ok(made)
}

/// The lists of a folder with these slides.
fn lists(slides: &[Slide]) -> (Manifest, CalibrationManifest, StripeManifest) {
    let slides = || (0..).zip(slides.iter().map(|slide| slide.purpose));
    let scene = slides().filter_map(|(index, purpose)| match purpose {
        Purpose::Scene(role) => Some((index, role)),
        Purpose::Calibration(_) | Purpose::Stripes(_) => None,
    });
    let calibration = slides().filter_map(|(index, purpose)| match purpose {
        Purpose::Calibration(role) => Some((index, role)),
        Purpose::Scene(_) | Purpose::Stripes(_) => None,
    });
    let stripes = slides().filter_map(|(index, purpose)| match purpose {
        Purpose::Stripes(role) => Some((index, role)),
        Purpose::Scene(_) | Purpose::Calibration(_) => None,
    });
    let mut scene = Manifest::numbered("patterns", scene);
    for shot in &mut scene.shots {
        if shot.role == Role::Image {
            shot.pattern = slide_name(shot.index);
        }
    }
    (
        scene,
        CalibrationManifest::numbered("calibration", calibration),
        StripeManifest::numbered(SLIDES_FOLDER, stripes),
    )
}

/// A text for people with this folder's numbers.
fn filled(text: &str, layout: &Layout, camera: &CameraSettings, made: Made) -> String {
    let (grid, projector) = (layout.grid(), layout.projector());
    // The key with its value; nothing has no TOML form.
    let response = toml::Table::try_from(camera).ok();
    let response = response.and_then(|table| table.get("response").map(ToString::to_string));
    let words = [
        (
            "{response}",
            response.unwrap_or_else(|| "\"linear\"".to_owned()),
        ),
        ("{rows}", grid.rows().to_string()),
        ("{cols}", grid.cols().to_string()),
        ("{width}", projector.width().to_string()),
        ("{height}", projector.height().to_string()),
        ("{border}", layout.border().to_string()),
        ("{slides}", made.slides.to_string()),
        (
            "{last}",
            format!("{:03}.png", made.slides.saturating_sub(1)),
        ),
    ];
    words.iter().fold(text.to_owned(), |text, (word, value)| {
        text.replace(word, value)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{OrderOptions, order};
    use iltm_capture::{CaptureOptions, Settings};
    use iltm_picture::png;
    use iltm_picture::{FolderError, Response, progress::Silent};
    use iltm_runtime::{FrameSize, Grid};
    use std::fs;

    fn layout() -> Layout {
        let projector = FrameSize::new(64, 48).unwrap();
        Layout::new(Grid::new(5, 7).unwrap(), projector, 3).unwrap()
    }

    fn camera() -> CameraSettings {
        CameraSettings {
            response: Response::Gamma(2.2).into(),
            ..CameraSettings::default()
        }
    }

    fn made(options: &OrderOptions) -> (tempfile::TempDir, PathBuf, Made) {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("c");
        let layout = layout();
        let slides = order(&layout, options);
        let made = write(&slides, &layout, &camera(), &out, &Silent).unwrap();
        (folder, out, made)
    }

    /// The reader of captures checks that patterns are of one grid and light what
    /// their roles say before it opens the first photograph.
    #[test]
    fn the_patterns_are_good_in_the_eyes_of_the_reader_of_captures() {
        let (_folder, out, made) = made(&OrderOptions::default());
        for index in 0..made.slides {
            fs::write(out.join(format!("photos/{index:03}.png")), "none").unwrap();
        }
        let error = iltm_capture::read(&out, &CaptureOptions::default(), &Silent).unwrap_err();
        let first = out.join("photos/000.png");
        assert!(
            error.to_string().starts_with(&first.display().to_string()),
            "{error}"
        );
    }

    #[test]
    fn every_index_stands_in_one_list_and_has_its_pictures() {
        let (_folder, out, made) = made(&OrderOptions::default());
        let scene = Manifest::read(&out).unwrap().shots;
        let calibration = CalibrationManifest::read(&out).unwrap().shots;
        let stripes = StripeManifest::read_if_there(&out).unwrap().unwrap().shots;
        let all = scene.len() + calibration.len() + stripes.len();
        assert_eq!(all, made.slides);
        assert_eq!(calibration.len(), made.calibration);
        assert_eq!(stripes.len(), made.stripes);
        let files = scene.iter().map(|shot| (shot.index, &shot.pattern));
        let files = files.chain(calibration.iter().map(|shot| (shot.index, &shot.pattern)));
        // Fine stripes are slides themselves.
        for shot in &stripes {
            assert_eq!(shot.pattern, slide_name(shot.index));
        }
        let mut indices: Vec<u32> = stripes.iter().map(|shot| shot.index).collect();
        for (index, pattern) in files {
            indices.push(index);
            let size = |path: &Path| png::read(fs::File::open(path).unwrap()).unwrap().size();
            assert_eq!(size(&out.join(pattern)), FrameSize::new(7, 5).unwrap());
            let slide = out.join(slide_name(index));
            assert_eq!(size(&slide), FrameSize::new(64, 48).unwrap());
        }
        indices.sort_unstable();
        assert!(indices.iter().copied().eq(0..made.slides as u32));
    }

    #[test]
    fn the_settings_are_read_and_know_the_projector() {
        let (_folder, out, _) = made(&OrderOptions::default());
        let settings = Settings::read(&out).unwrap();
        assert_eq!(settings.projector.size, Some([64, 48]));
        assert_eq!(settings.projector.border, 3);
        assert_eq!(settings.camera, camera());
        let readme = fs::read_to_string(out.join("README.md")).unwrap();
        assert!(readme.contains("64 x 48 pixels"), "{readme}");
        // What is left in braces is for the camera command.
        let words = readme.split('{').skip(1);
        for word in words {
            assert!(word.starts_with("stem}"), "{word}");
        }
    }

    #[test]
    fn without_calibration_there_is_no_list_of_it() {
        let (_folder, out, made) = made(&OrderOptions {
            ramp: 0,
            probe: false,
            ..OrderOptions::default()
        });
        assert_eq!(made.calibration, 0);
        assert!(CalibrationManifest::read_if_there(&out).unwrap().is_none());
    }

    #[test]
    fn a_folder_in_the_way_is_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("mine"), "kept").unwrap();
        let layout = layout();
        let slides = order(&layout, &OrderOptions::default());
        let error = write(&slides, &layout, &camera(), folder.path(), &Silent).unwrap_err();
        let taken = matches!(error, PatternsError::Folder(FolderError::Taken { .. }));
        assert!(taken, "{error}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
