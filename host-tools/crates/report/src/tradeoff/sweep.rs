//! Sweeps over a capture: the ways, and what is asked of each.

use super::coarse::{averaged, coarser};
use super::float_table::FloatTable;
use super::judge::{ReferenceTransport, of_other_grid};
use super::points::{Common, of_bits, of_tiers};
use super::{Missing, Point, Sweep, Tradeoff, TradeoffError};
use crate::{microseconds_at, tier_costs};
use iltm_capture::{CaptureOptions, Measurements, read_reference};
use iltm_compile::{
    CompileOptions, Provenance,
    build_table::{BuildError, BuiltTable, TableOptions, build_table_from},
    compile, cost,
    ladder::TARGETS,
};
use iltm_picture::progress::Progress;
use iltm_runtime::{
    FrameSize, Grid,
    image::{Table, layout::fine_gain},
};
use iltm_solve::{Method, SolveOptions};
use std::path::Path;
use strum::VariantArray;

/// Numbers of Bernoulli photographs that are tried, and all.
const PHOTOGRAPHS: [usize; 7] = [10, 20, 30, 40, 80, 120, 160];

/// Targets of tiers beside those of a table: few enough for the segments that an image
/// can have in colour.
const BETWEEN: [f64; 11] = [
    1.0 / 8.0,
    1.0 / 16.0,
    1.0 / 24.0,
    1.0 / 32.0,
    1.0 / 48.0,
    1.0 / 96.0,
    1.0 / 192.0,
    1.0 / 384.0,
    1.0 / 768.0,
    1.0 / 1536.0,
    1.0 / 2730.0,
];

/// Cells of the original along each side of a coarser one.
const FACTORS: [usize; 2] = [2, 4];

/// What is known of the scene by the table that it has now.
struct Base<'b> {
    folder: &'b Path,
    learned: &'b BuiltTable,
    common: Common,
    truth: Option<ReferenceTransport>,
    progress: &'b dyn Progress,
}

/// See [`Tradeoff::of_capture`].
pub(super) fn of_capture(
    folder: &Path,
    progress: &dyn Progress,
) -> Result<Tradeoff, TradeoffError> {
    let measurements = iltm_capture::read(folder, &CaptureOptions::default(), progress)?;
    let channels = measurements.channels.len();
    let reference = read_reference(folder, measurements.grid, channels)?;
    let options = SolveOptions::default();
    let learned = build_table_from(
        measurements.into(),
        folder,
        &options,
        &TableOptions::default(),
        progress,
    )?;
    let truth = reference.map(|transports| ReferenceTransport {
        transports,
        white: learned.compiled.white,
        live: learned.inverse.live.clone(),
        grid: learned.inverse.grid,
    });
    let mut missing = Vec::new();
    if truth.is_none() {
        missing.push(Missing {
            what: "true errors".to_owned(),
            why: format!(
                "the capture has no {}, the transport measured one light at a time",
                iltm_capture::REFERENCE_FILE
            ),
        });
    }
    let setting = "as `iltm solve` makes it".to_owned();
    let base = Base {
        folder,
        common: Common::solved(Sweep::Table, setting, &learned.report),
        learned: &learned,
        truth,
        progress,
    };
    let table = Table::check(&learned.compiled.image).map_err(TradeoffError::Table)?;
    let mut points = of_tiers(&base.common, &table, base.truth.as_ref())?;
    let own = points.clone();
    points.extend(base.between()?);
    points.extend(base.fewer_photographs(&mut missing)?);
    points.extend(base.other_methods(&mut missing)?);
    points.extend(of_bits(&table, &own, base.truth.as_ref(), progress)?);
    points.extend(base.coarser(&table, &mut missing)?);
    Ok(Tradeoff {
        name: folder.display().to_string(),
        scene: Provenance::read(table.provenance()).scene,
        grid: table.grid(),
        channels: table.channels(),
        points,
        missing,
    })
}

impl Base<'_> {
    fn options(&self) -> CompileOptions {
        CompileOptions {
            projector: self.learned.measurements.devices.projector.clone(),
            inverse_error: self.learned.predicted_error(),
            ..CompileOptions::default()
        }
    }

    /// Tiers between those of the table.
    fn between(&self) -> Result<Vec<Point>, TradeoffError> {
        let BuiltTable { inverse, fine, .. } = self.learned;
        let options = CompileOptions {
            targets: Some(BETWEEN.to_vec()),
            ..self.options()
        };
        self.progress.begin("compiling tiers between", 0);
        let compiled = compile(inverse, fine.as_ref(), &options);
        self.progress.end();
        let compiled = compiled?;
        let table = Table::check(&compiled.image).map_err(TradeoffError::Table)?;
        let common = self.common.again(Sweep::Tiers, "a tier between".to_owned());
        let mut points = of_tiers(&common, &table, self.truth.as_ref())?;
        // The table has gain only as well.
        points.retain(|point| point.tier > 0);
        Ok(points)
    }

    fn fewer_photographs(&self, missing: &mut Vec<Missing>) -> Result<Vec<Point>, TradeoffError> {
        let all = self.learned.report.photographs.bernoulli;
        let counts = PHOTOGRAPHS.into_iter().filter(|count| *count < all);
        let mut points = Vec::new();
        for count in counts {
            let setting = format!("{count} Bernoulli photographs");
            let options = CaptureOptions {
                bernoulli: Some(count),
                ..CaptureOptions::default()
            };
            let learned = iltm_capture::read(self.folder, &options, self.progress);
            let learned = learned
                .map_err(BuildError::from)
                .and_then(|measurements| self.learn(measurements, &SolveOptions::default()));
            points.extend(self.solved(Sweep::Photographs, setting, learned, missing)?);
        }
        Ok(points)
    }

    fn other_methods(&self, missing: &mut Vec<Missing>) -> Result<Vec<Point>, TradeoffError> {
        let own = self.learned.report.method;
        let mut points = Vec::new();
        for &method in Method::VARIANTS.iter().filter(|method| **method != own) {
            let options = SolveOptions {
                method: Some(method),
                ..SolveOptions::default()
            };
            let learned = self.learn(self.learned.measurements.clone(), &options);
            let setting = method.to_string();
            points.extend(self.solved(Sweep::Solver, setting, learned, missing)?);
        }
        Ok(points)
    }

    fn learn(
        &self,
        measurements: Measurements,
        options: &SolveOptions,
    ) -> Result<BuiltTable, BuildError> {
        build_table_from(
            measurements.into(),
            self.folder,
            options,
            &TableOptions::default(),
            self.progress,
        )
    }

    /// Points of what was learned in another way; why there are none goes to `missing`.
    fn solved(
        &self,
        sweep: Sweep,
        setting: String,
        learned: Result<BuiltTable, BuildError>,
        missing: &mut Vec<Missing>,
    ) -> Result<Vec<Point>, TradeoffError> {
        let learned = match learned {
            Ok(learned) => learned,
            Err(error) => {
                self.progress.end();
                missing.push(Missing {
                    what: setting,
                    why: error.to_string(),
                });
                return Ok(Vec::new());
            }
        };
        let table = Table::check(&learned.compiled.image).map_err(TradeoffError::Table)?;
        let common = Common::solved(sweep, setting, &learned.report);
        of_tiers(&common, &table, self.truth.as_ref())
    }

    fn coarser(
        &self,
        table: &Table<'_>,
        missing: &mut Vec<Missing>,
    ) -> Result<Vec<Point>, TradeoffError> {
        let inverse = &self.learned.inverse;
        if table.operator().is_none() {
            return Ok(Vec::new());
        }
        let mut points = Vec::new();
        for factor in FACTORS {
            match coarser(inverse.grid, factor) {
                Some(grid) => points.extend(self.at_grid(table, grid)?),
                None => missing.push(Missing {
                    what: format!("an operator of one {factor}th of the grid along each side"),
                    why: format!("the grid has {} cells", inverse.grid),
                }),
            }
        }
        Ok(points)
    }

    fn at_grid(&self, table: &Table<'_>, grid: Grid) -> Result<Vec<Point>, TradeoffError> {
        let inverse = &self.learned.inverse;
        let Some((coarse, fine)) = averaged(inverse, grid) else {
            return Ok(Vec::new());
        };
        let white = self.learned.compiled.white;
        let options = CompileOptions {
            reference_white: Some(white),
            targets: Some(TARGETS.to_vec()),
            ..self.options()
        };
        self.progress.begin("averaging the operator", 0);
        let compiled = compile(&coarse, Some(&fine), &options);
        self.progress.end();
        let compiled = compiled?;
        let coarse = Table::check(&compiled.image).map_err(TradeoffError::Table)?;
        let Some(numbers) = FloatTable::finer(&coarse, inverse.grid) else {
            return Ok(Vec::new());
        };
        let timed = microseconds_at(&coarse, inverse.grid).map_err(TradeoffError::Timing)?;
        let size = FrameSize::of_grid(inverse.grid);
        let own = self.learned.predicted_error();
        let common = self
            .common
            .again(Sweep::Grid, format!("operator of {grid} cells"));
        let point = |(cost, microseconds): (crate::TierCost, f64)| {
            let entries = numbers.entries(&numbers.segments(cost.tier));
            let left_out = of_other_grid(&numbers, &entries, inverse, white);
            let truth = self.truth.as_ref();
            Point {
                left_out,
                inverse: own,
                predicted: left_out.hypot(own),
                truth: truth.map(|truth| truth.error(&numbers, &entries, white)),
                instructions: cost::stages(&coarse, cost.tier, size).total(),
                bytes: cost.table_bytes - fine_bytes(&coarse) + fine_bytes(table),
                ..common.point(&coarse, cost, microseconds)
            }
        };
        let points = tier_costs(&coarse).into_iter().zip(timed).map(point);
        // Gain only is the same on every grid.
        Ok(points.filter(|point| point.tier > 0).collect())
    }
}

/// Bytes of a table's fine gains, which a coarser operator's table would have as well.
fn fine_bytes(table: &Table<'_>) -> u64 {
    table.fine_gain().map_or(0, |fine| {
        let samples = fine.size().pixels() * usize::from(table.channels());
        (fine_gain::SIZE + 2 * samples).next_multiple_of(4) as u64
    })
}
