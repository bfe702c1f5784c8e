//! Figs. 3 and 4: the second bounce in pictures.

use super::scenes::Condition;
use crate::acquisition::{Acquisition, Sparse};
use crate::{GroundTruth, Rig};
use iltm_picture::{ColourScale, ContactSheet, Palette, Picture, Tile};
use iltm_runtime::FrameSize;
use iltm_solve::Method;
use nalgebra::{DMatrix, DVector};

/// Photographs of Fig. 3.
pub(super) const PHOTOGRAPHS: usize = 170;
/// Photographs of Fig. 4.
pub(super) const COMPARED: [usize; 2] = [120, 150];
/// Panels of the scene.
const PANELS: usize = 4;

/// Error of a second bounce relative to the true one's brightest cell.
const WORST: f64 = 0.1;

/// Second-bounce error of each picture of Fig. 3.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Lit {
    /// What is lit.
    pub(super) name: String,
    /// `||found - true|| / ||true||`.
    pub(super) error: f64,
}

/// Fig. 3: the second bounce under white and under each panel alone, found by the
/// direct method, above the true one; errors by picture.
#[must_use]
pub(super) fn panels() -> Option<(Picture, Vec<Lit>)> {
    let (truth, rig) = Condition::ALL[0].world(1)?;
    let size = FrameSize::of_grid(truth.grid);
    let found = found(Method::Direct, PHOTOGRAPHS, &rig, &truth)?;
    let white = DVector::from_element(truth.live.len(), 1.0);
    let mut lights = vec![("flood".to_owned(), white)];
    for panel in 0..PANELS {
        let lit = (0..truth.live.len()).map(|cell| {
            let col = cell % truth.grid.cols();
            let edge = |k: usize| (k as f64 / PANELS as f64 * truth.grid.cols() as f64).round();
            let inside = (edge(panel)..edge(panel + 1)).contains(&(col as f64));
            f64::from(u8::from(inside))
        });
        let lit = DVector::from_iterator(truth.live.len(), lit);
        lights.push((format!("panel {}", panel + 1), lit));
    }
    let mut rows = vec![Vec::new(), Vec::new(), Vec::new()];
    let mut errors = Vec::new();
    for (name, pattern) in lights {
        let light = &truth.transport * pattern;
        let wanted = truth.second_bounce_by(&truth.inverse, &light);
        let seen = truth.second_bounce_by(&found, &light);
        let error = (&seen - &wanted).norm() / wanted.norm();
        let bright = wanted.max();
        let found = ("second bounce", &*format!("found, error {error:.4}"));
        rows[0].push(tile((&name, "photograph"), size, &light, light.max()));
        rows[1].push(tile(found, size, &seen, bright));
        rows[2].push(tile(("second bounce", "true"), size, &wanted, bright));
        errors.push(Lit { name, error });
    }
    let sheet = ContactSheet {
        rows,
        ..ContactSheet::default()
    };
    Some((sheet.compose()?, errors))
}

/// Fig. 4: the second bounce under white by both methods, and where it errs.
#[must_use]
pub(super) fn compared(condition: Condition) -> Option<Picture> {
    let (truth, rig) = condition.world(1)?;
    let wanted = &truth.second_bounce;
    let bright = wanted.max();
    let scale = ColourScale::linear(Palette::Magma, WORST);
    let size = FrameSize::of_grid(truth.grid);
    let flood = truth.flood();
    let mut first = vec![tile(("true", "second bounce"), size, wanted, bright)];
    let mut second = vec![tile(("flood", "photograph"), size, &flood, flood.max())];
    for (method, name, photographs) in [
        (Method::TwoStage, "two-stage", COMPARED[0]),
        (Method::Direct, "direct", COMPARED[0]),
        (Method::TwoStage, "two-stage", COMPARED[1]),
        (Method::Direct, "direct", COMPARED[1]),
        (Method::Joint, "iltm", 50),
    ] {
        let found = found(method, photographs, &rig, &truth)?;
        let seen = truth.second_bounce_by(&found, &flood);
        let error = (&seen - wanted).norm() / wanted.norm();
        let title = format!("{name}, {photographs}");
        let caption = format!("error {error:.4}");
        first.push(tile((&title, &caption), size, &seen, bright));
        let off = (&seen - wanted).map(|value| value.abs() / bright);
        let words = (&*title, "where it errs");
        second.push(Tile::scaled(words, size, off.iter().copied(), &scale));
    }
    let sheet = ContactSheet {
        rows: vec![first, second],
        bar: Some((
            &scale,
            "error of the second bounce, relative to its brightest cell",
        )),
        ..ContactSheet::default()
    };
    sheet.compose()
}

/// Light of each cell, white at `bright`, below its words.
fn tile(words: (&str, &str), size: FrameSize, light: &DVector<f64>, bright: f64) -> Tile {
    Tile::light(words, size, light.iter().copied(), bright)
}

fn found(
    method: Method,
    photographs: usize,
    rig: &Rig,
    truth: &GroundTruth,
) -> Option<DMatrix<f64>> {
    let acquired = Sparse::new(method, photographs, 1).acquire(&mut rig.clone());
    acquired.ok()?.inverse(&truth.live)
}
