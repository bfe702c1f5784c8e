//! Refined table: a table with other gains, everything else as it was.

use crate::image::{ImageWriter, halfwords};
use crate::provenance::{Provenance, Refinement};
use crate::table::{Gains, stored_ambient};
use crate::{CompileError, FineGains};
use iltm_runtime::image::layout::{MAX_PROVENANCE, SectionKind};
use iltm_runtime::image::{Checked, Label, Meta, Table};

/// What takes the place of a table's own.
#[derive(Clone, Debug)]
pub struct RefinedParts {
    /// Gains of the cells by channel, drive per reference light.
    pub cells: Vec<Vec<f64>>,
    /// Gains finer than the cells, drive per reference light.
    pub fine: FineGains,
    /// Light under black by channel and cell, relative to reference white; the table's own if
    /// there is none.
    pub ambient: Option<Vec<Vec<f64>>>,
    /// How much the cells' mean light changes by it, root mean square: so far apart are what cells
    /// and what pixels are said to miss, which a verification by cells has to know.
    pub cell_change: f64,
    /// What the provenance says of it, but for the date, which is now.
    pub refinement: Refinement,
}

/// A table's image with other gains. It is called as before, with the day of today; a seal is not
/// taken over.
///
/// # Errors
/// [`CompileError::Gain`] if a gain cannot be stored, [`CompileError::Provenance`] if its text has
/// grown too long, [`CompileError::Image`] if `image` is no table.
pub fn refined_table(image: &[u8], parts: &RefinedParts) -> Result<Vec<u8>, CompileError> {
    let own = Checked::new(image, &mut || {}).map_err(CompileError::Image)?;
    let (meta, table) = (*own.meta(), own.table());
    let cells: Vec<&[f64]> = parts.cells.iter().map(Vec::as_slice).collect();
    let gains = Gains::stored(&cells, Some(&parts.fine), 1.0)?;
    let mut provenance = Provenance::read(table.provenance());
    let date = Provenance::now();
    provenance.refined.push(Refinement {
        date: date.clone(),
        ..parts.refinement.clone()
    });
    provenance.date = date;
    if let Some(predicted) = &mut provenance.predicted_error {
        let by_cells = &mut predicted.by_cells;
        *by_cells = by_cells.map(|error| error.hypot(parts.cell_change));
    }
    let text = provenance.to_text();
    if text.len() > MAX_PROVENANCE {
        return Err(CompileError::Provenance { bytes: text.len() });
    }
    let meta = Meta {
        gain_fraction: gains.fraction,
        label: Label::new(meta.label.name(), provenance.label().date()),
        ..meta
    };
    let mut refined = ImageWriter::of_image(image);
    refined.replace(SectionKind::Meta, Some(meta.emit().to_vec()));
    let fine = gains.fine_section(parts.fine.size);
    refined.replace(SectionKind::FineGain, fine);
    if let Some(ambient) = &parts.ambient {
        let channels: Vec<&[f64]> = ambient.iter().map(Vec::as_slice).collect();
        let stored = stored_ambient(&channels, (&gains, meta.grid), 1.0).map(halfwords);
        refined.replace(SectionKind::Ambient, stored);
    }
    refined.replace(SectionKind::Gain, Some(halfwords(gains.cells)));
    refined.replace(SectionKind::Provenance, Some(text.into_bytes()));
    let refined = refined.finish();
    Table::check(&refined).map_err(CompileError::Image)?;
    Ok(refined)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::scene;
    use crate::{CompileOptions, PredictedError, compile};
    use iltm_runtime::FrameSize;

    #[test]
    fn only_what_is_refined_changes() {
        let provenance = Provenance {
            scene: "hall".to_owned(),
            date: "2025-01-02 03:04:05 UTC".to_owned(),
            predicted_error: Some(PredictedError {
                uncompensated: 0.2,
                gain_only: 0.1,
                compensated: 0.01,
                by_cells: Some(0.003),
                figures: None,
            }),
            ..Provenance::default()
        };
        let options = CompileOptions {
            label: provenance.label(),
            provenance: provenance.to_text(),
            ..CompileOptions::default()
        };
        let image = compile(&scene(3), None, &options).unwrap().image;
        let table = Table::check(&image).unwrap();
        let (grid, unit) = (table.grid(), f64::from(table.gain_fraction()).exp2());
        // Gains that take another bit before the point.
        let cells: Vec<Vec<f64>> = (0..3)
            .map(|channel| {
                let rows = (0..grid.rows()).flat_map(|row| table.gain_row(row, channel));
                rows.map(|gain| 4.0 * f64::from(gain) / unit).collect()
            })
            .collect();
        let (rows, cols) = (grid.rows(), grid.cols());
        let size = FrameSize::new(2 * cols as u16, 2 * rows as u16).unwrap();
        let parts = RefinedParts {
            fine: FineGains {
                size,
                channels: vec![vec![0.5; size.pixels()]; 3],
            },
            ambient: Some(vec![vec![0.125; grid.cells()]; 3]),
            cells: cells.clone(),
            cell_change: 0.004,
            refinement: Refinement {
                date: String::new(),
                photographs: 8,
                before: 0.02,
                after: 0.01,
            },
        };
        let refined = refined_table(&image, &parts).unwrap();
        let new = Table::check(&refined).unwrap();
        let new_unit = f64::from(new.gain_fraction()).exp2();
        assert!(new_unit < unit);
        for (channel, cells) in cells.iter().enumerate() {
            let gains = (0..rows).flat_map(|row| new.gain_row(row, channel));
            for (gain, wanted) in gains.zip(cells) {
                assert!((f64::from(gain) / new_unit - wanted).abs() <= 0.5 / new_unit);
            }
        }
        let fine = new.fine_gain().unwrap();
        assert_eq!(fine.size(), size);
        assert!(
            fine.row(1, 2)
                .all(|gain| f64::from(gain) / new_unit - 0.5 < 1e-9)
        );
        let ambient = new.ambient_row(1, 1).unwrap();
        assert!(
            ambient
                .map(f64::from)
                .all(|light| (light - 0.125).abs() < 1e-4)
        );
        assert_eq!(new.tiers(), table.tiers());
        assert_eq!(new.reference_white(), table.reference_white());
        assert_eq!(new.label().name(), "hall");
        assert!(new.label().date() > table.label().date());
        let says = Provenance::read(new.provenance());
        assert_eq!((says.scene.as_str(), says.refined.len()), ("hall", 1));
        assert_eq!(says.refined[0].photographs, 8);
        assert_eq!(says.refined[0].date, says.date);
        let by_cells = says.predicted_error.unwrap().by_cells.unwrap();
        assert!((by_cells - 0.005).abs() < 1e-12, "{by_cells}");
        // A second round is added to the first.
        let twice = refined_table(&refined, &parts).unwrap();
        let says = Provenance::read(Table::check(&twice).unwrap().provenance());
        assert_eq!(says.refined.len(), 2);
    }
}
