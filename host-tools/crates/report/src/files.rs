//! PNG files of a report's pictures.

use super::{CoefficientMap, Example, Treatment};
use color_quant::NeuQuant;
use iltm_picture::{
    ColourScale, ContactSheet, Picture, Samples, Tile,
    html::{PictureFile, picture_file},
    png,
};
use rayon::prelude::*;

/// Colours of a picture with a palette.
const COLOURS: usize = 256;

/// Every how many-th pixel teaches the palette; 1 would be every one.
const SAMPLING: i32 = 3;

/// Thresholds of ordered dithering in sixteenths (Bayer 1973), so that smooth skies
/// do not fall into bands.
const BAYER: [[i16; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];

/// Codes from the lowest to the highest threshold: about the distance of
/// neighbouring colours of a palette.
const DITHER: i16 = 12;

/// Composes the summary: wanted, photographed without compensation, photographed with it,
/// and both errors; the colour bar of the error maps is `errors`.
///
/// `None` if the pictures are so large that their composition is not a frame.
fn summary(example: &Example, errors: &ColourScale) -> Option<Picture> {
    let size = example.wanted.picture.size();
    let mut photographs = vec![Tile::new(("Wanted", ""), &example.wanted.picture)];
    let mut maps = vec![Tile::default()];
    for treatment in [Treatment::None, Treatment::Compensated] {
        let mut shown = example.shown.iter();
        let Some(shown) = shown.find(|shown| shown.treatment == treatment) else {
            continue;
        };
        let words = (treatment.title(), "predicted photograph");
        photographs.push(Tile::new(words, &shown.photograph.for_display()));
        let error = format!("Error {:.1} %", 100.0 * shown.comparison.error);
        let values = shown.comparison.map.iter().map(|error| f64::from(*error));
        maps.push(Tile::new((&error, ""), &errors.picture(size, values)));
    }
    let sheet = ContactSheet {
        rows: vec![photographs, maps],
        bar: Some((
            errors,
            "Error of the photograph, in units of reference white",
        )),
        notes: vec![
            "What is left is mostly darker than the light that arrives there anyway.".to_owned(),
        ],
        ..ContactSheet::default()
    };
    sheet.compose()
}

/// Encodes all pictures of a report. `summary` is of the first example and has a
/// palette, since it is made to be small.
pub(super) fn encode(
    flood: Option<Picture>,
    coefficients: &CoefficientMap,
    examples: &[Example],
    errors: &ColourScale,
) -> Vec<PictureFile> {
    let mut pictures = vec![("coefficients".to_owned(), coefficients.picture.clone())];
    pictures.extend(flood.map(|flood| ("flood".to_owned(), flood)));
    for example in examples {
        let name = example.wanted.name;
        let bounced = example.bounced.scaled(example.brightening());
        pictures.push((format!("{name}-wanted"), example.wanted.picture.clone()));
        pictures.push((format!("{name}-bounced"), bounced.for_display()));
        for shown in &example.shown {
            let name = format!("{name}-{}", shown.treatment.name());
            let values = shown.comparison.map.iter().map(|error| f64::from(*error));
            let error = errors.picture(shown.input.size(), values);
            pictures.push((format!("{name}-input"), shown.input.clone()));
            pictures.push((format!("{name}-photograph"), shown.photograph.for_display()));
            pictures.push((format!("{name}-error"), error));
        }
    }
    let encoded = pictures
        .into_par_iter()
        .map(|(name, picture)| picture_file(&name, &picture));
    let mut files: Vec<PictureFile> = encoded.collect();
    let summary = examples
        .first()
        .and_then(|example| summary(example, errors));
    let summary = summary.as_ref().and_then(with_palette);
    files.extend(summary.map(|png| PictureFile {
        name: "summary".to_owned(),
        png,
    }));
    files
}

/// An 8-bit RGB picture as a PNG file with a palette of its own, about a quarter
/// as large; `None` of any other picture.
fn with_palette(picture: &Picture) -> Option<Vec<u8>> {
    let (3, Samples::Eight(samples)) = (picture.channels(), picture.samples()) else {
        return None;
    };
    let (pixels, _) = samples.as_chunks::<3>();
    let opaque = |[red, green, blue]: &[u8; 3]| [*red, *green, *blue, u8::MAX];
    let rgba: Vec<u8> = pixels.iter().flat_map(opaque).collect();
    let quantised = NeuQuant::new(SAMPLING, COLOURS, &rgba);
    let width = picture.size().width();
    let index = |(at, pixel): (usize, &[u8; 3])| {
        let threshold = BAYER[at / width % 4][at % width % 4];
        let offset = (threshold * DITHER - 15 * DITHER / 2) / 16;
        let dithered = pixel.map(|code| (i16::from(code) + offset).clamp(0, 255) as u8);
        // Black stays what it is: letters and frames shall have no grain.
        let even = pixel.iter().all(|code| *code < 48);
        quantised.index_of(&opaque(if even { pixel } else { &dithered })) as u8
    };
    let indices: Vec<u8> = pixels.par_iter().enumerate().map(index).collect();
    let palette = quantised.color_map_rgb();
    Some(png::encode_indexed(picture.size(), palette, &indices))
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::FrameSize;

    #[test]
    fn a_palette_of_as_many_colours_as_there_are_hardly_changes_a_picture() {
        let size = FrameSize::new(64, 64).unwrap();
        let colours = (0..size.pixels()).flat_map(|at| {
            let shade = (at / 512 * 32) as u8;
            [shade, 255 - shade, shade / 2]
        });
        let given = Picture::new(size, Samples::Eight(colours.collect())).unwrap();
        let bytes = with_palette(&given).unwrap();
        let read = png::read(bytes.as_slice()).unwrap();
        let (Samples::Eight(given), Samples::Eight(read)) = (given.samples(), read.samples())
        else {
            panic!("8 bits");
        };
        let differences = given.iter().zip(read).map(|(a, b)| a.abs_diff(*b));
        assert!(differences.max().unwrap() <= 24);
    }
}
