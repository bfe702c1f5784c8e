//! Gates `complete` and `format`: every photograph is there, once; all have one size, and
//! values that mean light.

use crate::format::error::CaptureError;
use crate::format::photo_files::PhotoFiles;
use crate::format::picture_file::FileFormat;
use crate::gate::{Evidence, Gate, GateName, Verdict, listed};

/// File names that a sentence lists.
const MOST_NAMED: usize = 12;

/// Judges which photographs are there.
pub(crate) fn judge(files: &PhotoFiles) -> Gate {
    let all = files.listed;
    let gate = |verdict, number: usize, what, next_step| {
        gate(GateName::Complete, verdict, number, what, next_step)
    };
    if !files.missing.is_empty() {
        let count = files.missing.len();
        let names = listed(
            files.missing.iter().map(|photo| photo.display()),
            MOST_NAMED,
        );
        let what = format!("{count} of {all} photographs missing: {names}");
        if let Some(raw) = files.raw.first() {
            let what = format!(
                "{what}; there is {}, a raw file or one of another kind, which is not read",
                raw.display()
            );
            let next_step = "Develop it to a PNG or TIFF of the listed name, linear (without a tone \
                 curve), and all others in the same way.";
            return gate(Verdict::Fail, count, what, next_step);
        }
        let next_step = "Take the missing photographs: `iltm capture` goes on where it stopped.";
        return gate(Verdict::Fail, count, what, next_step);
    }
    if let Some((first, second)) = files.copies.first() {
        let count = files.copies.len();
        let copies = match count {
            1 => "one photograph is an exact copy of one that shows".to_owned(),
            count => format!("{count} photographs are exact copies of others that show"),
        };
        let what = format!(
            "{copies} another pattern: {} is {}",
            second.display(),
            first.display()
        );
        let next_step =
            "Take those photographs again: the camera or the copying gave an old file twice.";
        return gate(Verdict::Fail, count, what, next_step);
    }
    let what = format!("all {all} photographs are there");
    gate(Verdict::Pass, 0, what, "")
}

/// Gate `format`, when photographs do not fit each other.
pub(crate) fn refuse_format(error: &CaptureError) -> Gate {
    let (what, next_step) = (error.to_string(), error.next_step());
    gate(GateName::Format, Verdict::Fail, 1, what, next_step)
}

/// Judges the kind of the files, all of which have one size, and the `bits` of their
/// samples; `stated` is whether `capture.toml` says how they follow the light.
pub(crate) fn judge_format(file: FileFormat, bits: u8, stated: bool) -> Gate {
    if file == FileFormat::Jpeg {
        let what = "photographs are JPEG: the camera has curved and compressed their light";
        let next_step = if stated {
            "Take raw photographs and develop them linearly to 16-bit TIFF or PNG if the camera can."
        } else {
            "Take raw photographs and develop them linearly to 16-bit TIFF or PNG if the camera can; \
             otherwise state [camera] response = \"srgb\" in capture.toml."
        };
        return gate(
            GateName::Format,
            Verdict::Warn,
            0,
            what.to_owned(),
            next_step,
        );
    }
    let what = format!("all photographs have one size, {bits} bits a sample");
    gate(GateName::Format, Verdict::Pass, 0, what, "")
}

/// A gate that counts photographs of which there must be none.
fn gate(
    name: GateName,
    verdict: Verdict,
    number: usize,
    what: String,
    next_step: &'static str,
) -> Gate {
    Gate {
        name,
        verdict,
        number: number as f64,
        limit: 0.0,
        unit: "photographs",
        what,
        next_step,
        evidence: Evidence::None,
    }
}
