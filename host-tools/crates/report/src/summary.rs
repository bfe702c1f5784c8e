//! Summary picture: wanted, photographed without compensation, photographed with it, and
//! both errors.

use super::{Example, Treatment};
use iltm_picture::{ColourScale, ContactSheet, Picture, Tile};

/// Composes the summary; the colour bar of the error maps is `errors`.
///
/// `None` if the pictures are so large that their composition is not a frame.
#[must_use]
pub fn summary(example: &Example, errors: &ColourScale) -> Option<Picture> {
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
