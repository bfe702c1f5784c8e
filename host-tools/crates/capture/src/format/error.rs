//! Capture errors: everything that can be wrong with a capture folder.

use crate::gate::Gate;
use std::path::PathBuf;

/// Why a capture could not be read. Every case carries its place;
/// [`CaptureError::next_step`] says what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// A file could not be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// The folder holds no `capture.csv`.
    #[error("{}: no such file, so the folder is not a capture", path.display())]
    NoManifest {
        /// Where it should be.
        path: PathBuf,
    },
    /// A line of a manifest cannot be used.
    #[error("{}, line {line}: {reason}", path.display())]
    ManifestLine {
        /// The `capture.csv`.
        path: PathBuf,
        /// Line, the first is 1.
        line: u64,
        /// What is wrong with it.
        reason: String,
        /// What to do about it.
        next_step: &'static str,
    },
    /// A file that `capture.csv` names is not there.
    #[error("{}: missing {what}, named in line {line} of capture.csv", path.display())]
    MissingFile {
        /// The file.
        path: PathBuf,
        /// "pattern" or "photograph".
        what: &'static str,
        /// Line of `capture.csv` that names it.
        line: u64,
    },
    /// `capture.toml` is not what it should be.
    #[error("{}: {reason}", path.display())]
    Settings {
        /// The `capture.toml`.
        path: PathBuf,
        /// What is wrong, with the line.
        reason: String,
    },
    /// A response shall be measured, and the photographs do not tell it.
    #[error("{}: {device}.response is to be measured, but the photographs do not tell it", path.display())]
    ResponseUnknown {
        /// The `capture.toml`.
        path: PathBuf,
        /// "camera" or "projector".
        device: &'static str,
    },
    /// A picture cannot be decoded, or is not what its line says.
    #[error("{}: {reason}", path.display())]
    Picture {
        /// The picture.
        path: PathBuf,
        /// What is wrong, with the place or with what the decoder says.
        reason: String,
        /// What to do about it.
        next_step: &'static str,
    },
    /// A photograph has another size or other channels than the first one.
    #[error("{}: {reason}", path.display())]
    Unlike {
        /// The photograph.
        path: PathBuf,
        /// Its size or channels, and those of the first one.
        reason: String,
        /// What to do about it.
        next_step: &'static str,
    },
    /// A photograph is missing under its name, and several could stand for it.
    #[error("{}: missing, and both {} and {} could stand for it", path.display(), first.display(), second.display())]
    Ambiguous {
        /// The file that the manifest names.
        path: PathBuf,
        /// One candidate.
        first: PathBuf,
        /// Another.
        second: PathBuf,
    },
    /// A picture says it is larger than any camera's.
    #[error("{}: {width} x {height} pixels; at most {limit} pixels are read", path.display())]
    TooLarge {
        /// The picture.
        path: PathBuf,
        /// Its width in pixels.
        width: u32,
        /// Its height in pixels.
        height: u32,
        /// Pixels it may have.
        limit: u64,
    },
    /// There is no black photograph.
    #[error("{}: no photograph of the black pattern", path.display())]
    NoBlack {
        /// The `capture.csv`.
        path: PathBuf,
    },
    /// There is no flood photograph.
    #[error("{}: no photograph of the white pattern", path.display())]
    NoWhite {
        /// The `capture.csv`.
        path: PathBuf,
    },
    /// The Gray code lacks bits, between others or to tell all columns or rows apart.
    #[error("{}: {reason}", path.display())]
    GrayCode {
        /// The `capture.csv`.
        path: PathBuf,
        /// Which bits.
        reason: String,
    },
    /// Photographs were asked for that the capture does not have, or cannot give.
    #[error("{place}: {reason}")]
    Asked {
        /// The `capture.csv`, with the line if one was meant.
        place: String,
        /// What was asked for and what there is.
        reason: String,
        /// What to ask for.
        next_step: &'static str,
    },
    /// Too few Bernoulli photographs and images to learn an inverse from.
    #[error("{}: {used} Bernoulli photographs and images used, a solve needs at least {needed}: \
        the Gray code's stripes alone cannot tell which cell of a row or column the light came from",
        path.display())]
    TooFewPhotographs {
        /// The `capture.csv`.
        path: PathBuf,
        /// Bernoulli photographs and images used.
        used: usize,
        /// Least number.
        needed: usize,
    },
    /// The flood photograph is no brighter than the black one.
    #[error("{}: the flood photograph is no brighter than the black one", path.display())]
    NoLight {
        /// The flood photograph.
        path: PathBuf,
    },
    /// Gates say that the photographs cannot be used.
    #[error("{}: {}", path.display(), failures(gates))]
    Refused {
        /// The capture folder.
        path: PathBuf,
        /// The gates that fail, at least one, what explains others first.
        gates: Vec<Gate>,
    },
}

/// What the gates that fail say.
fn failures(gates: &[Gate]) -> String {
    let failed: Vec<String> = gates.iter().map(ToString::to_string).collect();
    match failed.len() {
        1 => format!("the photographs do not pass the gate {}", failed[0]),
        count => format!(
            "the photographs do not pass {count} gates: {}",
            failed.join("; ")
        ),
    }
}

impl CaptureError {
    /// What to do about it, one sentence.
    #[must_use]
    pub fn next_step(&self) -> &'static str {
        match self {
            Self::Io { .. } => "Check that the file exists and may be read.",
            Self::NoManifest { .. } => {
                "Give the folder that holds capture.csv; `iltm patterns` makes one."
            }
            Self::MissingFile { .. } => {
                "Put the file there, or remove its line if it was never taken."
            }
            Self::Settings { .. } => {
                "Correct capture.toml; it may hold camera.response, camera.full_scale, \
                 projector.response, projector.blur, projector.size, projector.border and \
                 scene.name."
            }
            Self::ResponseUnknown {
                device: "camera", ..
            } => {
                "Photograph a few patterns with two or three exposures, or write the camera's \
                 response (\"srgb\" for camera JPEGs)."
            }
            Self::ResponseUnknown { .. } => {
                "Photograph the pictures of calibration.csv, or write the projector's response."
            }
            Self::ManifestLine { next_step, .. }
            | Self::Picture { next_step, .. }
            | Self::Unlike { next_step, .. }
            | Self::Asked { next_step, .. } => next_step,
            Self::Ambiguous { .. } => "Name the right one in capture.csv, or remove the other.",
            Self::TooLarge { .. } => "Scale the photographs down, all by the same factor.",
            Self::NoBlack { .. } => {
                "Photograph the black pattern with the same exposure; ambient light is subtracted \
                 with it."
            }
            Self::NoWhite { .. } => {
                "Photograph the white pattern with the same exposure; it sets the gains."
            }
            Self::GrayCode { .. } => {
                "Photograph the missing Gray code patterns, or check the roles in capture.csv."
            }
            Self::TooFewPhotographs { .. } => {
                "Photograph more Bernoulli patterns or images, or ask for more; 40 are a good start."
            }
            Self::NoLight { .. } => {
                "Check that the projector lit the scene, and that white and black are not exchanged."
            }
            Self::Refused { gates, .. } => gates
                .first()
                .map_or("Run `iltm check` on the capture.", |gate| gate.next_step),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Manifest;
    use std::path::Path;

    #[test]
    fn an_error_names_its_place_and_fits_a_register_sized_result() {
        let path = Path::new("c/capture.csv");
        let text = b"index,role,pattern,photo\n0,whit,p,f\n";
        let error = Manifest::parse(text, path).unwrap_err();
        assert_eq!(
            error.to_string(),
            "c/capture.csv, line 2: unknown role \"whit\""
        );
        assert!(error.next_step().contains("white"));
        assert!(size_of::<CaptureError>() <= 128);
    }
}
