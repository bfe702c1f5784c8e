//! Gate `format`: all photographs have one size, and values that mean light.

use super::super::{CaptureError, FileFormat};
use super::{Evidence, Gate, GateName, Verdict};

/// The gate, when photographs do not fit each other.
pub(crate) fn refused(error: &CaptureError) -> Gate {
    gate(Verdict::Fail, 1.0, error.to_string(), error.next_step())
}

/// Judges the kind of the files, all of which have one size, and the `bits` of their
/// samples.
pub(crate) fn judge(file: FileFormat, bits: u8) -> Gate {
    if file == FileFormat::Jpeg {
        let what = "photographs are JPEG: the camera has curved and compressed their light";
        let next_step = "Take raw photographs and develop them linearly to 16-bit TIFF or PNG if \
             the camera can; otherwise state [camera] response = \"srgb\" in capture.toml.";
        return gate(Verdict::Warn, 0.0, what.to_owned(), next_step);
    }
    let what = format!("all photographs have one size, {bits} bits a sample");
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
