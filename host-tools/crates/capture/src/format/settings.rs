//! Settings: `capture.toml` says what photographs cannot say about themselves.

use super::error::CaptureError;
use super::manifest::read_small;
use iltm_picture::{Declared, DeviceResponse};
use iltm_runtime::{FrameSize, placement::ProjectorPixels};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;

/// Name of the settings file in a capture folder. It may be absent.
pub const SETTINGS_FILE: &str = "capture.toml";

/// Bytes a settings file may have: a person writes it.
const MAX_BYTES: u64 = 64 << 10;

/// Contents of `capture.toml`; everything has a default, unknown keys are
/// refused.
///
/// ```toml
/// [camera]
/// response = "linear"     # "linear", "srgb", a gamma number or "measure"
/// full_scale = 1.0        # of floating point photographs: their value at full scale
/// [projector]
/// response = "srgb"       # the same choice; left out, it is measured from the ramp
///                         # of calibration.csv, or sRGB where there is none
/// blur = 0.5              # out of focus: standard deviation in cells, 0 to 4; left
///                         # out, it is measured from the probe of calibration.csv
/// size = [1920, 1080]     # its own resolution, width and height in pixels
/// border = 0              # pixels that slides leave black on every side
/// [scene]
/// name = "M-shaped panels"
/// ```
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The camera that took the photographs.
    pub camera: CameraSettings,
    /// The projector that showed the patterns.
    pub projector: ProjectorSettings,
    /// What was photographed.
    pub scene: SceneSettings,
}

/// `[camera]` of [`Settings`].
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraSettings {
    /// From a photograph's values to light; linear if unsaid.
    #[serde(skip_serializing_if = "Declared::is_unsaid")]
    pub response: Declared,
    /// Value of a floating point photograph at the camera's full scale: 1 as raw
    /// converters write it; larger for light merged from exposures elsewhere.
    #[serde(deserialize_with = "full_scale", skip_serializing_if = "is_one")]
    pub full_scale: f64,
    /// Places from which the camera took what stands beside each other in each photograph.
    #[serde(skip_serializing_if = "is_one")]
    pub places: u16,
}

impl Default for CameraSettings {
    fn default() -> Self {
        Self {
            response: Declared::Unsaid,
            full_scale: 1.0,
            places: 1,
        }
    }
}

impl CameraSettings {
    /// How photographs are read before anything is measured: with the declared
    /// response, or as if they were linear.
    pub(crate) fn reading(&self) -> Reading {
        Reading {
            response: self.response.known().unwrap_or_default().into(),
            full_scale: self.full_scale,
        }
    }
}

/// How the values of photographs become light.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Reading {
    /// From a value, of full scale, to light. `OpenEXR` is linear by definition and
    /// does not ask.
    pub(crate) response: DeviceResponse,
    /// Value of a floating point file at the camera's full scale.
    pub(crate) full_scale: f64,
}

impl<R: Into<DeviceResponse>> From<R> for Reading {
    fn from(response: R) -> Self {
        Self {
            response: response.into(),
            full_scale: 1.0,
        }
    }
}

/// Full scales that make sense: values of half precision end at 65,504.
const FULL_SCALES: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// Reads a full scale and refuses what cannot be one.
fn full_scale<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    let scale = f64::deserialize(from)?;
    if FULL_SCALES.contains(&scale) {
        return Ok(scale);
    }
    let message = format!("a full scale of {scale}; it must be from 0.000001 to 1000000");
    Err(D::Error::custom(message))
}

fn is_one<T: PartialEq + From<u8>>(value: &T) -> bool {
    *value == T::from(1)
}

/// `[projector]` of [`Settings`].
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ProjectorSettings {
    /// From projector input values to light. Patterns are only on or off, so
    /// photographs do not depend on it; compensated frames do. Unsaid, it is
    /// measured where a ramp was photographed, and sRGB elsewhere.
    #[serde(skip_serializing_if = "Declared::is_unsaid")]
    pub response: Declared,
    /// Standard deviation of the projector's blur on the scene, in cells, 0 to
    /// 4; 0 if it is in focus. Unsaid, it is measured where the probe was
    /// photographed, and 0 elsewhere.
    #[serde(deserialize_with = "blur", skip_serializing_if = "Option::is_none")]
    pub blur: Option<f64>,
    /// The projector's own width and height in pixels, which slides have.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<[u16; 2]>,
    /// Pixels that slides leave black on every side, outside of the cells.
    #[serde(skip_serializing_if = "is_zero")]
    pub border: u16,
}

impl ProjectorSettings {
    /// The projector's pixels; `None` where its size is unsaid, or no pixel is left.
    #[must_use]
    pub fn pixels(&self) -> Option<ProjectorPixels> {
        let [width, height] = self.size?;
        ProjectorPixels::new(FrameSize::new(width, height)?, self.border)
    }
}

/// Whether there is no border to speak of.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
const fn is_zero(border: &u16) -> bool {
    *border == 0
}

/// Most blur that makes sense: a cell's light then spreads over some hundred.
const MOST_BLUR: f64 = 4.0;

/// Reads a blur and refuses what cannot be one.
fn blur<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    let blur = f64::deserialize(from)?;
    if (0.0..=MOST_BLUR).contains(&blur) {
        return Ok(Some(blur));
    }
    let message = format!("a blur of {blur} cells; it must be from 0 to {MOST_BLUR}");
    Err(D::Error::custom(message))
}

/// `[scene]` of [`Settings`].
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SceneSettings {
    /// For people; goes into the table's provenance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

impl Settings {
    /// Reads `capture.toml` of a capture folder, or the defaults if there is
    /// none.
    ///
    /// # Errors
    /// [`CaptureError::Settings`] if it is not what [`Settings`] documents,
    /// [`CaptureError::Io`] if it cannot be read.
    pub fn read(folder: &Path) -> Result<Self, CaptureError> {
        let path = folder.join(SETTINGS_FILE);
        match read_small(&path, MAX_BYTES) {
            Ok(Some(bytes)) => Self::parse(&bytes, &path),
            Ok(None) => Ok(Self::default()),
            Err(source) => Err(CaptureError::Io { path, source }),
        }
    }

    /// The contents of a `capture.toml` that says this.
    #[must_use]
    pub fn to_toml(&self) -> String {
        // Numbers and strings always have a TOML form.
        toml::to_string(self).unwrap_or_default()
    }

    /// Reads the contents of a `capture.toml`; `path` is only for errors.
    ///
    /// # Errors
    /// [`CaptureError::Settings`] with the place.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, CaptureError> {
        let refuse = |reason| CaptureError::Settings {
            path: path.to_owned(),
            reason,
        };
        if bytes.len() as u64 > MAX_BYTES {
            return Err(refuse(format!("it is longer than {MAX_BYTES} bytes")));
        }
        let text = std::str::from_utf8(bytes).map_err(|error| refuse(error.to_string()))?;
        let settings: Self = toml::from_str(text)
            .map_err(|error| refuse(error.to_string().trim_end().to_owned()))?;
        let projector = &settings.projector;
        match (projector.size, projector.pixels()) {
            (Some([width, height]), None) => Err(refuse(format!(
                "a projector of {width} x {height} pixels with a border of {} has no pixel left",
                projector.border
            ))),
            (None, _) if projector.border > 0 => Err(refuse(
                "the projector has a border and no size; state both".to_owned(),
            )),
            _ => Ok(settings),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_picture::Response;

    fn parse(text: &str) -> Result<Settings, String> {
        Settings::parse(text.as_bytes(), Path::new("c")).map_err(|error| error.to_string())
    }

    #[test]
    fn a_capture_without_settings_has_a_linear_camera_and_an_srgb_projector() {
        let settings = Settings::read(tempfile::tempdir().unwrap().path()).unwrap();
        assert_eq!(settings.camera.response, Declared::Unsaid);
        assert_eq!(settings.camera.reading(), Response::Linear.into());
        assert_eq!(settings.projector.response, Declared::Unsaid);
        assert_eq!(settings.projector.blur, None);
        assert_eq!(settings.scene.name, None);
    }

    #[test]
    fn every_kind_of_response_can_be_written_and_read_back() {
        let known = [Response::Linear, Response::Srgb, Response::Gamma(2.2)];
        let declared = [Declared::Unsaid, Declared::Measure].into_iter();
        for (at, response) in declared.chain(known.map(Declared::As)).enumerate() {
            let mut settings = Settings::default();
            settings.camera.response = response;
            settings.projector.response = response;
            settings.projector.blur = (at % 2 == 0).then_some(0.5);
            settings.camera.full_scale = 1.0 + at as f64;
            settings.scene.name = Some("dome".into());
            let text = toml::to_string(&settings).unwrap();
            assert_eq!(parse(&text), Ok(settings));
        }
    }

    #[test]
    fn an_unknown_key_is_refused_with_its_line() {
        let error = parse("[camera]\nresponse = 2\n[projektor]\n").unwrap_err();
        assert!(
            error.contains("projektor") && error.contains("line 3"),
            "{error}"
        );
    }

    #[test]
    fn a_gamma_that_is_a_slip_of_the_pen_is_refused() {
        for text in ["0", "-1", "22", "nan", "inf", "\"Linear\"", "true"] {
            let text = format!("[camera]\nresponse = {text}\n");
            let error = parse(&text).unwrap_err();
            assert!(error.contains("a gamma from 0.2 to 5"), "{error}");
        }
    }

    #[test]
    fn a_border_needs_a_size_and_leaves_pixels() {
        for text in [
            "border = 3",
            "size = [20, 30]\nborder = 10",
            "size = [0, 30]",
        ] {
            let error = parse(&format!("[projector]\n{text}\n")).unwrap_err();
            assert!(error.contains("projector"), "{error}");
        }
        let settings = parse("[projector]\nsize = [20, 30]\nborder = 9\n").unwrap();
        let pixels = settings.projector.pixels().unwrap();
        assert_eq!((pixels.inner().width(), pixels.inner().height()), (2, 12));
    }

    #[test]
    fn a_full_scale_that_is_none_is_refused() {
        for text in ["0", "-1", "nan", "inf", "1e9"] {
            let error = parse(&format!("[camera]\nfull_scale = {text}\n")).unwrap_err();
            assert!(error.contains("full"), "{error}");
        }
    }
}
