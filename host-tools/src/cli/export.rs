//! `iltm export`

use super::args::{Export, Player};
use super::failure::{Failure, Kind};
use super::output::Output;
use super::tables::{check_whole, chosen_tier, read_table};
use crate::capture::exr;
use crate::compile::shader::{glsl_files, isf_files, user_shader};
use crate::video::{CompensateOptions, Compensator};
use iltm_picture::{Picture, Response, Samples, WholeFolder, check_free, png};
use iltm_runtime::FrameSize;
use iltm_runtime::image::Table;
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::units::Light;
use serde_json::json;

/// A file's name and bytes.
type NamedFile = (String, Vec<u8>);

pub(super) fn run(arguments: &Export, output: &Output) -> Result<(), Failure> {
    let out = &arguments.output;
    check_free(out)?;
    let image = read_table(&arguments.table)?;
    let table = check_whole(&arguments.table, &image)?;
    let tier = chosen_tier(&table, arguments.tier)?;
    let (files, next) = match arguments.player {
        Player::Mpv => {
            let shader = user_shader(&table, tier).into_bytes();
            let next = format!(
                "mpv --vo=gpu --fullscreen --keepaspect=no --glsl-shader={} FILM",
                out.join("iltm.glsl").display()
            );
            (vec![("iltm.glsl".to_owned(), shader)], next)
        }
        Player::Isf => {
            let files = isf_files(&table, tier).ok_or_else(|| too_large(tier))?;
            let next =
                "load iltm.fs, with the pictures beside it, as an effect on the film".to_owned();
            (files, next)
        }
        Player::Glsl => {
            let files = glsl_files(&table, tier).ok_or_else(|| too_large(tier))?;
            let next = "connect the shaders as README.md beside them says".to_owned();
            (files, next)
        }
        Player::Maps => {
            let next = "load alpha.png as the alpha map and beta.png as the beta map".to_owned();
            (maps(&table, tier)?, next)
        }
    };
    let folder = WholeFolder::create(out)?;
    for (name, bytes) in &files {
        folder.file(name, bytes)?;
    }
    folder.finish()?;
    let bytes: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    let data = json!({
        "folder": out.display().to_string(),
        "files": names,
        "tier": tier,
        "bytes": bytes,
    });
    let text = format!(
        "written     {} in {}: tier {tier}, {bytes} bytes\n\
         next        {next}\n",
        names.join(", "),
        out.display(),
    );
    output.result(&data, &text);
    Ok(())
}

fn too_large(tier: u8) -> Failure {
    let what = format!("tier {tier} has more entries than a texture holds");
    Failure::new(Kind::Usage, what, "Choose a lower tier with --tier.")
}

/// Maps as large as the projector's picture, by which MPCDI (Video Electronics Standards
/// Association, *Multiple Projection Common Data Interchange*, 2013) changes a pixel to
/// `alpha (1 - beta) pixel + beta`. With alpha and beta white becomes what the projector shows for
/// an even white, and black what it shows for the darkest even grey that the room's light
/// allows. The gain map is white without the operator, as bright as the gains allow. PNG in codes,
/// `OpenEXR` in proportion to light.
fn maps(table: &Table<'_>, tier: u8) -> Result<Vec<NamedFile>, Failure> {
    let fine = table.fine_gain().map(|fine| fine.size());
    let size = table.projector().map(ProjectorPixels::size);
    let frame = size
        .or(fine)
        .unwrap_or_else(|| FrameSize::of_grid(table.grid()));
    let even = |light: f64, encoding: Encoding, tier: u8| {
        let settings = CompensateOptions {
            tier: Some(tier),
            encoding,
            ..CompensateOptions::default()
        };
        let code = match encoding {
            Encoding::Display => Response::Srgb.value(light),
            Encoding::Linear => light,
        };
        let code = (code * f64::from(u16::MAX)).round() as u16;
        let even = Samples::Sixteen(vec![code; 3 * frame.pixels()]);
        let even = Picture::new(frame, even).expect("three samples a pixel");
        let (map, _) = Compensator::new(table, settings)?.frame(even)?;
        Ok::<_, Failure>(map)
    };
    // The room's light is taken away too, so that more may be asked for than the largest gain says.
    let gain = largest_gain(table).max(1.0);
    let light = samples_of(&even(gain.recip(), Encoding::Linear, 0)?);
    let left = 1.0 - f64::from(light.into_iter().fold(0.0, f32::max));
    let brightest = ((1.0 + left) / gain).min(1.0);
    // A table that raises black asks for its light with code 0.
    let black = if table.black() > Light::ZERO {
        0.0
    } else {
        brightest_ambient(table)
    };
    let size = (frame.width(), frame.height());
    let mut files = Vec::new();
    let mut add = |name: &str, codes: &[f32], light: &[f32]| {
        let codes = codes
            .iter()
            .map(|code| (code * f32::from(u16::MAX)).round() as u16);
        let picture = Picture::new(frame, Samples::Sixteen(codes.collect()));
        let picture = picture.expect("three samples a pixel");
        files.push((format!("{name}.png"), png::encode(&picture)));
        let bytes = exr(size, light.iter().copied()).map_err(|error| {
            let what = format!("a map cannot be written: {error}");
            Failure::new(Kind::Write, what, "Please report this.")
        })?;
        files.push((format!("{name}.exr"), bytes));
        Ok::<_, Failure>(())
    };
    let both = |light: f64, tier: u8| {
        let of = |encoding| Ok::<_, Failure>(samples_of(&even(light, encoding, tier)?));
        Ok::<_, Failure>([of(Encoding::Display)?, of(Encoding::Linear)?])
    };
    let [white, black] = [both(1.0, tier)?, both(black, tier)?];
    let alpha = [0, 1].map(|k| {
        let pairs = white[k].iter().zip(&black[k]);
        let alpha = pairs.map(|(white, black)| match white - black {
            rest if rest > 0.0 => rest / (1.0 - black),
            _ => 0.0,
        });
        alpha.collect::<Vec<f32>>()
    });
    let gain = both(brightest, 0)?;
    add("alpha", &alpha[0], &alpha[1])?;
    add("beta", &black[0], &black[1])?;
    add("gain", &gain[0], &gain[1])?;
    Ok(files)
}

/// Rows of a table's maps, a channel each.
fn lines(rows: usize, table: &Table<'_>) -> impl Iterator<Item = (usize, usize)> {
    let channels = usize::from(table.channels());
    (0..rows).flat_map(move |row| (0..channels).map(move |channel| (row, channel)))
}

fn largest_gain(table: &Table<'_>) -> f64 {
    let cells = lines(table.grid().rows(), table);
    let cells = cells.filter_map(|(row, channel)| table.gain_row(row, channel).max());
    let fine = table.fine_gain().into_iter().flat_map(|fine| {
        let lines = lines(fine.size().height(), table);
        lines.filter_map(move |(row, channel)| fine.row(row, channel).max())
    });
    let largest = cells.chain(fine).max().unwrap_or(0);
    f64::from(largest) * (-f64::from(table.gain_fraction())).exp2()
}

/// Light of the brightest cell that the projector does not light, 0 in a dark room.
fn brightest_ambient(table: &Table<'_>) -> f64 {
    let lines = lines(table.grid().rows(), table);
    let ambient = lines.filter_map(|(row, channel)| table.ambient_row(row, channel));
    let light = ambient.flatten().map(|light| light.to_num::<f64>());
    light.fold(0.0, f64::max).min(1.0)
}

/// Samples of a picture, from 0 to 1.
fn samples_of(map: &Picture) -> Vec<f32> {
    match map.samples() {
        Samples::Eight(codes) => codes.iter().map(|code| f32::from(*code) / 255.0).collect(),
        Samples::Sixteen(codes) => (codes.iter())
            .map(|code| f32::from(*code) / f32::from(u16::MAX))
            .collect(),
    }
}
