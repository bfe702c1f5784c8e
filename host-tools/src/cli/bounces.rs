//! `iltm bounces`

use super::args::Bounces;
use super::failure::{Failure, Kind};
use super::output::Output;
use super::progress::progress;
use crate::bounces::{self, BouncesError, BouncesOptions, Layer, LayerKind, WrittenBounces};
use crate::capture::CaptureOptions;
use iltm_picture::{
    check_own,
    numbers::{number, percent},
};
use serde_json::{Value, json};
use std::fmt::Write;
use std::time::Instant;

pub(super) fn run(arguments: &Bounces, output: &Output) -> Result<(), Failure> {
    let start = Instant::now();
    // A folder that is in the way is known before the work, not after it.
    check_own(&arguments.output, bounces::is_own)?;
    let options = BouncesOptions {
        photograph: arguments.photo,
        capture: CaptureOptions {
            bernoulli: arguments.photos,
            ..CaptureOptions::default()
        },
        ..BouncesOptions::default()
    };
    let bars = progress(output);
    let found = bounces::bounces(&arguments.capture, &options, bars.as_ref());
    bars.end();
    let found = found.map_err(failed)?;
    let written = bounces::write(&found, &arguments.output)?;
    let seconds = start.elapsed().as_secs_f64();
    let folder = arguments.output.display().to_string();
    let mut data = data(&found, &written);
    data["folder"] = json!(folder);
    data["seconds"] = json!(seconds);
    let mut text = text(&found);
    let _ = writeln!(
        text,
        "\n{folder}: {} files in {seconds:.2} s; look at {}\n\
         \x20           the layers in bounces.npy add up to the photograph to {:.1e}, the 16-bit\n\
         \x20           pictures, in which negative light is black, to {:.1e} of full scale",
        written.files.len(),
        arguments.output.join(bounces::PAGE).display(),
        written.largest_gap,
        written.largest_gap_of_pictures,
    );
    output.result(&data, &text);
    Ok(())
}

fn failed(error: BouncesError) -> Failure {
    match error {
        BouncesError::Capture(error) => error.into(),
        BouncesError::Solve(error) => error.into(),
        BouncesError::Folder(error) => error.into(),
        BouncesError::Changed { .. } => Failure::new(
            Kind::Photographs,
            error,
            "Run the command again once nothing writes to the capture.",
        ),
        BouncesError::DoesNotFade { .. } => Failure::new(
            Kind::Solve,
            error,
            "Take more Bernoulli photographs, or average several of each pattern.",
        ),
    }
}

fn data(found: &bounces::Bounces, written: &WrittenBounces) -> Value {
    let separated = &found.separated;
    let layer = |layer: &Layer| {
        json!({
            "layer": layer.kind.name(),
            "light_share": layer.light_share,
            "energy_share": layer.energy_share,
            "rms": layer.rms,
            "brightest": layer.brightest,
            "darkest": layer.darkest,
        })
    };
    let pixels = separated.size.0 * separated.size.1;
    json!({
        "photograph": {
            "index": found.shot.index,
            "role": found.shot.role.to_string(),
            "averaged": found.averaged,
            "width": separated.size.0,
            "height": separated.size.1,
            "channels": separated.photograph.len(),
            "saturated_pixels": found.saturated,
        },
        "layers": separated.layers.iter().map(layer).collect::<Vec<_>>(),
        "noise_of_a_pixel": found.noise.pixel,
        "noise_of_a_cell": found.noise.cell,
        "separated_pixels": separated.wall_pixels as f64 / pixels as f64,
        "ambient_share": found.ambient_share,
        "operator_confidence": found.report.prediction.confidence,
        "largest_gap": written.largest_gap,
        "largest_gap_of_pictures": written.largest_gap_of_pictures,
        "files": written.files.iter().map(|file| &file.name).collect::<Vec<_>>(),
    })
}

fn text(found: &bounces::Bounces) -> String {
    let separated = &found.separated;
    let (width, height) = separated.size;
    let mut text = String::new();
    let shot = &found.shot;
    let which = match found.averaged {
        1 => format!("{} ({})", shot.index, shot.role),
        n => format!("mean of {n} ({})", shot.role),
    };
    let _ = writeln!(
        text,
        "photograph  {which}, {width} x {height} pixels; {} of what the camera saw was there\n\
         \x20           under black and is subtracted",
        percent(found.ambient_share),
    );
    if found.saturated > 0 {
        let _ = writeln!(
            text,
            "            {} pixels are saturated: their light is more than is shown",
            found.saturated
        );
    }
    let confidence = found.report.prediction.confidence;
    if confidence < bounces::PROOF {
        let _ = writeln!(
            text,
            "            the photographs do not prove that there are bounces at all: {confidence:.1} \
             standard errors"
        );
    }
    let _ = writeln!(
        text,
        "\nlayer           light    energy   brightest   rms / noise"
    );
    for layer in &separated.layers {
        let _ = writeln!(
            text,
            "{:12} {:>8} {:>9} {:>11.4} {:>13}   {}",
            layer.kind.name(),
            percent(layer.light_share),
            percent(layer.energy_share),
            layer.brightest,
            number(layer.rms / found.noise.cell),
            meaning(layer.kind),
        );
    }
    let _ = writeln!(
        text,
        "light: share of the photograph's sum, adds up to 100 %; energy: share of its sum of\n\
         squares, which does not add up, since bounces overlap; noise: the camera's in the mean\n\
         of a cell, {:.2e} of full scale (a pixel's is {:.2e})",
        found.noise.cell, found.noise.pixel,
    );
    text
}

const fn meaning(kind: LayerKind) -> &'static str {
    match kind {
        LayerKind::Bounce(1) => "direct light",
        LayerKind::Bounce(_) => "",
        LayerKind::Rest => "all further bounces",
        LayerKind::Unseparated => "where no cell was solved for",
    }
}
