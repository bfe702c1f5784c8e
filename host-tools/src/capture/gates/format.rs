//! Gate `format`: all photographs have one size, and values that mean light.

use super::super::{CaptureError, Shot};
use super::{Evidence, Gate, GateName, Verdict};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// How a JPEG file begins.
const JPEG: [u8; 3] = [0xff, 0xd8, 0xff];

/// The gate, when photographs do not fit each other.
pub(crate) fn refused(error: &CaptureError) -> Gate {
    gate(Verdict::Fail, 1.0, error.to_string(), error.next_step())
}

/// Judges the files of `shots`, all of which have one size; `bits` of a sample.
pub(crate) fn judge(folder: &Path, shots: &[Shot]) -> Gate {
    let lossy = shots.iter().filter(|s| is_jpeg(&folder.join(&s.photo)));
    let count = lossy.count();
    if count > 0 {
        let what = format!(
            "{count} of {} photographs are JPEG: the camera has curved and compressed their light",
            shots.len()
        );
        let next_step = "Take raw photographs and develop them linearly to 16-bit TIFF or PNG if \
             the camera can; otherwise state [camera] response = \"srgb\" in capture.toml.";
        return gate(Verdict::Warn, 0.0, what, next_step);
    }
    let what = "all photographs have one size and number of channels".to_owned();
    gate(Verdict::Pass, 0.0, what, "")
}

fn gate(verdict: Verdict, number: f64, what: String, next_step: &'static str) -> Gate {
    Gate {
        name: GateName::Format,
        verdict,
        number,
        limit: 0.0,
        unit: "photographs",
        what,
        next_step,
        evidence: Evidence::None,
    }
}

fn is_jpeg(path: &Path) -> bool {
    let mut start = [0; JPEG.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && start == JPEG
}
