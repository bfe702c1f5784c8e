//! Interreflection: light between surfaces, computed as far as the scene calls for it. What was
//! found on the way is told to the decisions.

use super::effects::{Decisions, Effect};
use super::facets::Facets;
use super::patches::Patch;
use super::radiosity::{FormFactorError, FormFactorMatrix, FormFactorOptions, Occlusion};
use super::specular::{Specular, Surfaces, TooGlossy};
use iltm_picture::progress::Progress;
use std::time::Instant;

/// Light between patches, with what was found on the way.
pub(super) fn exchange(
    facets: &Facets<'_>,
    patches: &[Patch],
    decisions: &mut Decisions,
    progress: &dyn Progress,
) -> Result<FormFactorMatrix, FormFactorError> {
    let piece = |patch: &Patch| super::radiosity::Element {
        polygon: patch.polygon.clone(),
        facet: patch.facet,
    };
    let pieces: Vec<_> = patches.iter().map(piece).collect();
    let forced = decisions.forced(Effect::Occlusion);
    let options = FormFactorOptions {
        occlusion: match forced {
            Some(true) => Occlusion::Everywhere,
            Some(false) => Occlusion::Ignore,
            None => Occlusion::Decide,
        },
        ..FormFactorOptions::default()
    };
    let exchange = FormFactorMatrix::new(&pieces, facets.obstacles(), &options, progress)?;
    let report = exchange.report();
    let reason = match report
        .pairs
        .iter()
        .find_map(|p| Some((p.facets, p.between?)))
    {
        Some(((a, b), between)) => {
            let [a, b, between] = [a, b, between].map(|facet| facets.name(facet));
            let which = if a == b && a == between {
                format!("parts of `{a}` between others of it")
            } else {
                format!("`{between}` between `{a}` and `{b}`")
            };
            format!(
                "between {} of {} pairs of surfaces another may stand, {which}; {} pairs are hidden wholly",
                report.occludable, report.surveyed, report.blocked,
            )
        }
        None => "no surface reaches between two others".to_owned(),
    };
    decisions.decide(Effect::Occlusion, report.occludable > 0, reason);
    let found = format!(
        "{} form factors, {} stored, {} of it as low rank",
        thousands(report.evaluated as usize),
        megabytes(report.bytes),
        match report.low_rank_blocks {
            0 => "none".to_owned(),
            n => format!("{n} blocks"),
        },
    );
    decisions.found(Effect::Interreflection, &found);
    decisions.took(Effect::Interreflection, report.seconds);
    Ok(exchange)
}

/// A count for people.
fn thousands(count: usize) -> String {
    match count {
        0..10_000 => count.to_string(),
        10_000..10_000_000 => format!("{} thousand", count / 1_000),
        _ => format!("{} million", count / 1_000_000),
    }
}

fn megabytes(bytes: usize) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

/// Light over mirrors and lobes, where the scene calls for it.
pub(super) fn specular(
    surfaces: Surfaces<'_>,
    exchange: Option<&FormFactorMatrix>,
    decisions: &mut Decisions,
) -> Result<Option<Specular>, TooGlossy> {
    let (mirrors, gloss) = (decisions.on(Effect::Mirrors), decisions.on(Effect::Gloss));
    if !mirrors && !gloss {
        return Ok(None);
    }
    let clock = Instant::now();
    let specular = Specular::new(surfaces, mirrors, exchange.filter(|_| gloss))?;
    let effect = if mirrors {
        Effect::Mirrors
    } else {
        Effect::Gloss
    };
    decisions.took(effect, clock.elapsed().as_secs_f64());
    Ok(Some(specular))
}
