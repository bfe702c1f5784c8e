//! Sweeps that a table alone allows.

use super::points::{Common, of_bits, of_tiers};
use super::{Missing, Sweep, Tradeoff, TradeoffError};
use iltm_picture::progress::Progress;
use iltm_runtime::image::Table;

/// See [`Tradeoff::of_table`].
pub(super) fn of_table(
    name: &str,
    table: &Table<'_>,
    progress: &dyn Progress,
) -> Result<Tradeoff, TradeoffError> {
    let provenance = provenance(table);
    let text = |key: &str| Some(provenance.as_ref()?.get(key)?.as_str()?.to_owned());
    let count = |key: &str| {
        let counts = provenance.as_ref()?.get("photographs")?;
        u64::try_from(counts.get(key)?.as_integer()?).ok()
    };
    let photographs = ["white", "gray_code", "bernoulli"].map(count);
    let common = Common {
        sweep: Sweep::Table,
        setting: "the table".to_owned(),
        method: text("method"),
        photographs: photographs.into_iter().sum(),
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
        scene: scene(table),
        grid: table.grid(),
        channels: table.channels(),
        points,
        missing,
    })
}

fn provenance(table: &Table<'_>) -> Option<toml::Table> {
    table.provenance().parse().ok()
}

/// The scene's name in a table; empty if it has none.
pub(super) fn scene(table: &Table<'_>) -> String {
    let provenance = provenance(table);
    let name = provenance
        .as_ref()
        .and_then(|text| text.get("scene")?.as_str());
    name.unwrap_or_default().to_owned()
}
