//! Table of facts: what a capture and its solve say about themselves, line by line.

use iltm_capture::{NoiseSource, RegistrationMethod};
use iltm_compile::build_table::BuiltTable;
use iltm_picture::{
    html::{grouped, number, percent},
    statistics::median,
};
use iltm_solve::LambdaTrial;

/// One line: its name and what there is to say.
pub(super) type Fact = (&'static str, String);

/// All facts. `seconds` is wall-clock time by what it was spent on, beside the
/// solve's own.
pub(super) fn facts(learned: &BuiltTable, seconds: &[(String, f64)]) -> Vec<Fact> {
    let mut facts = of_photographs(learned);
    facts.extend(of_the_solve(learned));
    let own = learned.report.seconds;
    let own = [
        ("choosing the weight", own.choose),
        ("solving", own.solve),
        ("judging", own.finish + own.prepare),
    ];
    facts.push(("time of the solve", listed(own)));
    let steps = seconds
        .iter()
        .map(|(what, seconds)| (what.as_str(), *seconds));
    facts.push(("time of all steps", listed(steps)));
    facts
}

fn of_photographs(learned: &BuiltTable) -> Vec<Fact> {
    let report = &learned.report;
    let diagnostics = &learned.measurements.diagnostics;
    let (counts, pixels) = (report.photographs, diagnostics.pixels);
    let photographs = format!(
        "{} white, {} Gray code, {}, of which {} held out to choose and to judge",
        counts.white,
        counts.gray_code,
        counts.content(),
        counts.held_out
    );
    let cells = match report.cells - report.live_cells {
        0 => format!("all {} of the {} grid", report.cells, learned.inverse.grid),
        out => format!(
            "{} of {}; {out} could not be measured",
            report.live_cells, report.cells
        ),
    };
    let pixels = format!(
        "{} lit, {} used; {} left out at borders of cells, {} too weak or contradicted",
        grouped(pixels.lit as u64),
        grouped(pixels.kept as u64),
        grouped(pixels.mixed as u64),
        grouped(pixels.weak as u64)
    );
    // Of several projectors, these are known of the first one's capture.
    let of_first = |fact: String| {
        let several = learned.projectors.is_some();
        fact + if several { " (first projector)" } else { "" }
    };
    let registration = match diagnostics.method {
        RegistrationMethod::Regression {
            photographs,
            is_coded,
        } => {
            let first = if is_coded { "Gray code" } else { "Images" };
            format!("{first}, then regression on {photographs} photographs")
        }
        RegistrationMethod::GrayCode { photographs } => {
            format!("Gray code only, of {photographs} photographs")
        }
        RegistrationMethod::Images { photographs } => {
            format!("{photographs} photographs of images")
        }
    };
    let exposure = format!(
        "white{} {} of full scale",
        if learned.projectors.is_some() {
            " of one projector reaches at most"
        } else {
            " reaches"
        },
        percent(diagnostics.exposure)
    );
    let noise = format!(
        "{} of a cell\u{2019}s light under white, {}",
        percent(noise(learned)),
        of_first(noise_source(diagnostics.noise))
    );
    let mut facts = vec![
        ("photographs", photographs),
        ("cells", cells),
        ("camera pixels", pixels),
        ("registration", of_first(registration)),
        ("exposure", exposure),
        ("noise", noise),
    ];
    if let Some(excess) = diagnostics.superposition {
        let within = percent(excess.abs());
        let linearity = format!("patterns and their inverses add up to white within {within}");
        facts.push(("linearity", of_first(linearity)));
    }
    facts
}

fn of_the_solve(learned: &BuiltTable) -> [Fact; 6] {
    let report = &learned.report;
    let ended = if report.convergence.converged {
        "converged"
    } else {
        "stopped before convergence"
    };
    let condition = format!(
        "{} (largest to smallest singular value of the transport)",
        number(report.condition)
    );
    let white = number(learned.compiled.white);
    [
        ("method", report.method.to_string()),
        (
            "weight of sparsity",
            ends(report.lambda, &report.lambda_path),
        ),
        ("coefficients", grouped(report.coefficients as u64)),
        ("iterations", format!("{}, {ended}", report.iterations)),
        ("condition", condition),
        (
            "reference white",
            format!(
                "{white} of the camera\u{2019}s full scale: {}",
                learned.white.reason()
            ),
        ),
    ]
}

/// The weight, and whether the search for it ended at one of its ends.
fn ends(lambda: f64, tried: &[LambdaTrial]) -> String {
    let is = |end: Option<&LambdaTrial>| {
        tried.len() > 1 && end.is_some_and(|trial| trial.lambda.total_cmp(&lambda).is_eq())
    };
    let end = if is(tried.last()) {
        ", the least that is tried: these photographs hardly need any"
    } else if is(tried.first()) {
        ", the most that is tried: these photographs say little; take more, or with less noise"
    } else {
        ""
    };
    format!("{}{end}", number(lambda))
}

fn listed<'s>(seconds: impl IntoIterator<Item = (&'s str, f64)>) -> String {
    let seconds = seconds
        .into_iter()
        .map(|(what, seconds)| format!("{what} {seconds:.2}\u{a0}s"));
    seconds.collect::<Vec<_>>().join(", ")
}

/// Median over cells and channels of the noise of one observation under white,
/// relative to it.
fn noise(learned: &BuiltTable) -> f64 {
    let channels = learned.measurements.channels.iter().enumerate();
    let ratios = channels.flat_map(|(index, channel)| {
        // Of several projectors, the first view lights only the first one's cells.
        let white = learned.measurements.white(index);
        let cells = channel.noise.iter().zip(white);
        let lit = cells.filter(|(_, light)| *light > 0.0);
        lit.map(|(noise, light)| noise / light).collect::<Vec<_>>()
    });
    median(ratios.collect()).unwrap_or(0.0)
}

fn noise_source(source: NoiseSource) -> String {
    match source {
        NoiseSource::Pairs { pairs } => {
            format!("estimated from {pairs} pairs of a pattern and its inverse")
        }
        NoiseSource::Repeats { photographs } => {
            format!("estimated from {photographs} photographs of white")
        }
        NoiseSource::Texture => "at most: estimated from neighbouring pixels".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weight_of(lambda: f64) -> String {
        let trial = |lambda| LambdaTrial {
            lambda,
            misfit: 1.0,
        };
        ends(lambda, &[0.4, 0.2, 0.1].map(trial))
    }

    #[test]
    fn a_weight_at_an_end_of_what_was_tried_says_so() {
        assert_eq!(weight_of(0.2), "0.2");
        assert!(weight_of(0.1).contains("the least that is tried"));
        assert!(weight_of(0.4).contains("the most that is tried"));
        assert_eq!(ends(0.4, &[]), "0.4");
    }
}
