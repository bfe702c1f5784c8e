//! Sweeps that a table alone allows.

use super::points::{Common, of_bits, of_tiers};
use super::{Missing, Sweep, Tradeoff, TradeoffError};
use iltm_compile::{Photographs, Provenance};
use iltm_picture::progress::Progress;
use iltm_runtime::image::Table;

/// See [`Tradeoff::of_table`].
pub(super) fn of_table(
    name: &str,
    table: &Table<'_>,
    progress: &dyn Progress,
) -> Result<Tradeoff, TradeoffError> {
    let provenance = Provenance::read(table.provenance());
    let count = |of: Photographs| (of.white + of.gray_code + of.bernoulli + of.images) as u64;
    let common = Common {
        sweep: Sweep::Table,
        setting: "the table".to_owned(),
        method: Some(provenance.method).filter(|name| !name.is_empty()),
        photographs: provenance.photographs.map(count),
        seconds: None,
    };
    let mut points = of_tiers(&common, table, None)?;
    let own = points.clone();
    points.extend(of_bits(table, &own, None, progress)?);
    let because = |what: &str, why: &str| Missing {
        what: what.to_owned(),
        why: why.to_owned(),
    };
    let mut missing = vec![
        because(
            "true errors",
            "a table holds no reference; give the capture folder that it came from",
        ),
        because(
            "solvers, fewer photographs, seconds of the solve",
            "a table holds no photographs; give the capture folder that it came from",
        ),
        because(
            "tiers between and coarser operators",
            "a table holds only the entries that its tiers use; give the capture folder",
        ),
    ];
    if table.inverse_error() == 0 {
        missing.push(because(
            "the error of the inverse itself",
            "the table has none: too few photographs to hold any out",
        ));
    }
    Ok(Tradeoff {
        name: name.to_owned(),
        scene: provenance.scene,
        grid: table.grid(),
        channels: table.channels(),
        points,
        missing,
    })
}
