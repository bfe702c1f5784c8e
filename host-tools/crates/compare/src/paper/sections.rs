//! Sections of the experiments page: words and tables, each from its numbers.

use super::complexity::{self, Timed};
use super::feasible::TheoremBounds;
use super::results::CapturePictures;
use super::scenes::{Condition, surface};
use super::second_bounce::Lit;
use super::seeds::{DrawErrors, ENTRIES, Mean, SEEDS};
use super::sparsity::{Counted, INVERSE_IN_HAAR, PARTS};
use crate::benchmark::BenchmarkRow;
use crate::table;
use iltm_solve::{Method, restricted_isometry::LIMIT};
use std::fmt::Write;

/// What the page says of a method with so many photographs.
pub(super) fn words(method: Method, photographs: usize) -> String {
    let name = match method {
        Method::Joint => "iltm",
        Method::Links => "iltm by links",
        Method::Direct => "direct (the paper)",
        Method::TwoStage => "two-stage",
        Method::BruteForce => "brute force",
    };
    format!("{name}, {photographs}")
}

/// The sample of a condition and method.
pub(super) fn find(
    samples: &[DrawErrors],
    condition: Condition,
    entry: (Method, usize),
) -> Option<&DrawErrors> {
    samples.iter().find(|sample| {
        sample.condition == condition && (sample.method, sample.photographs) == entry
    })
}

/// Fig. 4.
pub(super) fn fourth(text: &mut String, samples: &[DrawErrors]) {
    let _ = writeln!(
        text,
        "\n## Fig. 4: the second bounce, by method\n\n\
         ![Second bounce by method, uniform panels](fig4-uniform.png)\n\n\
         ![Second bounce by method, textured panels](fig4-textured.png)\n\n\
         One draw, noiseless: uniform panels above, textured ones below. Over {SEEDS} draws, mean \
         and its 95 % interval (`fig4.csv` has each):\n\n\
         ![Errors of the second bounce over the draws](fig4-seeds.svg)\n"
    );
    rows(text, samples, ("second bounce", DrawErrors::second_bounce));
    text.push('\n');
    rows(text, samples, ("compensation", DrawErrors::compensation));
}

/// Means of an error, a row a method and a column a condition.
fn rows(
    text: &mut String,
    samples: &[DrawErrors],
    (name, of): (&str, fn(&DrawErrors) -> Vec<f64>),
) {
    let names = Condition::ALL.map(Condition::name);
    let _ = writeln!(text, "| {name} | {} |", names.join(" | "));
    let _ = writeln!(text, "|---|{}", "---:|".repeat(names.len()));
    for (method, photographs) in ENTRIES {
        let cell = |condition: &Condition| {
            let Some(sample) = find(samples, *condition, (method, photographs)) else {
                return String::new();
            };
            let mean = Mean::of(&of(sample));
            let refused = match sample.refused {
                0 => String::new(),
                count => format!(" ({count} refused)"),
            };
            let half = table::error(mean.half);
            format!("{} \u{b1} {half}{refused}", table::error(mean.mean))
        };
        let cells: Vec<String> = Condition::ALL.iter().map(cell).collect();
        let (words, cells) = (words(method, photographs), cells.join(" | "));
        let _ = writeln!(text, "| {words} | {cells} |");
    }
}

/// Fig. 1.
pub(super) fn sparse(text: &mut String, counts: &[Counted]) {
    let _ = writeln!(
        text,
        "\n## Fig. 1: how sparse the matrices are\n\n\
         ![T, its inverse, and both in Haar](fig1.png)\n\n\
         Number of coefficients, of {}, that hold a part of the energy (sum of squares):\n",
        counts.first().map_or(0, |counted| counted.all)
    );
    let parts = PARTS.map(|part| format!("{} %", 100.0 * part));
    let _ = writeln!(text, "| scene | matrix | {} |", parts.join(" | "));
    let _ = writeln!(text, "|---|---|{}", "---:|".repeat(parts.len()));
    for counted in counts {
        let scene = surface(counted.textured);
        let cells = counted.counts.map(|count| count.to_string()).join(" | ");
        let _ = writeln!(text, "| {scene} | {} | {cells} |", counted.name);
    }
    let _ = writeln!(
        text,
        "\n`K` is the inverse without its diagonal: `T^-1 = diag(g) - K`. It is the same for \
         both scenes, since texture is only in `g`, and it is the only part that a table codes \
         in Haar."
    );
}

/// Fig. 2.
pub(super) fn second(text: &mut String, places: &[TheoremBounds], counts: &[Counted]) {
    let _ = writeln!(
        text,
        "\n## Fig. 2: what the theorem promises\n\n\
         ![The region of the theorem, and the scene](fig2.svg)\n\n\
         Theorem 3.1 promises that the direct method finds rows of `k` coefficients exactly where \
         `kappa^2 gamma < sqrt 2 + 1 = 2.41`. Computing the exact constants is NP-hard, so \
         the table has bounds. Lower bounds come from the supports that were tried, so the scene \
         lies where it is drawn or further up and right. Upper bounds come from \
         Gershgorin\u{2019}s discs (`inf`: no bound). Patterns enter as +1 and -1, the form that \
         promises most.\n"
    );
    let _ = writeln!(
        text,
        "| scene | photographs | k | kappa at least | gamma at least | kappa^2 gamma at least | at most |\n\
         |---|---:|---:|---:|---:|---:|---:|"
    );
    for place in places {
        let scene = surface(place.textured);
        let _ = writeln!(
            text,
            "| {scene} | {} | {} | {:.2} | {:.2} | {:.2} | {:.2} |",
            place.photographs, place.k, place.kappa, place.gamma, place.product.0, place.product.1
        );
    }
    let below =
        |bound: fn(&TheoremBounds) -> f64| places.iter().filter(|p| bound(p) < LIMIT).count();
    let inside = below(|place| place.product.1);
    let open = below(|place| place.product.0) - inside;
    let a_row = |textured: bool| {
        let own = |c: &&Counted| c.textured == textured && c.name == INVERSE_IN_HAAR;
        let counted = counts.iter().find(own);
        counted.map_or(0.0, |c| c.counts[2] as f64 / (c.all as f64).sqrt())
    };
    let _ = writeln!(
        text,
        "\nOf {} places {inside} are proven to lie in the region and {open} may. Rows of the \
         inverse have {:.0} coefficients (uniform) and {:.0} (textured) for 99.99 % of the energy \
         (Fig. 1). The theorem does not explain why the method works here: like other l1 \
         methods, it works far outside the region.",
        places.len(),
        a_row(false),
        a_row(true),
    );
}

/// Fig. 3.
pub(super) fn third(text: &mut String, bounces: &[Lit]) {
    let _ = writeln!(
        text,
        "\n## Fig. 3: second bounces from {} photographs\n\n\
         ![Second bounces found and true](fig3.png)\n\n\
         By the paper's direct method, on uniform panels without noise.\n",
        super::second_bounce::PHOTOGRAPHS
    );
    let _ = writeln!(text, "| lit | error of the second bounce |\n|---|---:|");
    for lit in bounces {
        let _ = writeln!(text, "| {} | {} |", lit.name, table::error(lit.error));
    }
}

/// Time and its exponents.
pub(super) fn cost(text: &mut String, timed: &[Timed]) {
    let _ = writeln!(
        text,
        "\n## Complexity\n\n\
         ![Time against cells](complexity-cells.svg)\n\n\
         ![Time against photographs](complexity-photographs.svg)\n\n\
         The paper gives `O(N^2 m)` per iteration, and names the exact inversion, `O(N^3)`, as the \
         additional cost of the two-stage method. The exponents are fitted to the time of one \
         iteration; that of a whole solve includes the number of iterations:\n"
    );
    let _ = writeln!(
        text,
        "| method | N, one iteration | m, one iteration | N, whole solve |\n|---|---:|---:|---:|"
    );
    for fit in complexity::exponents(timed) {
        let _ = writeln!(
            text,
            "| {} | {:.2} | {:.2} | {:.2} |",
            fit.method, fit.cells, fit.photographs, fit.cells_whole
        );
    }
    let share = |cells: usize| {
        let of = |t: &&Timed| (t.method, t.cells) == (Method::TwoStage, cells);
        let timed = timed.iter().find(of)?;
        Some((
            1e3 * timed.inversion,
            100.0 * timed.inversion / timed.seconds,
        ))
    };
    let largest = timed.iter().map(|t| t.cells).max().unwrap_or(0);
    let (Some(paper), Some(most)) = (share(13 * 21), share(largest)) else {
        return;
    };
    let _ = writeln!(
        text,
        "\nThe exact inversion alone grows as `N^{:.2}`: {:.0} ms at 273 cells, {:.0} % of the \
         two-stage solve, and {:.0} ms at {largest}, {:.0} %; the l1 problems take the rest. \
         Exponents of `m` below 1 come from the l1 step, whose time does not depend on `m`.",
        complexity::inversion_exponent(timed),
        paper.0,
        paper.1,
        most.0,
        most.1,
    );
}

/// What accuracy costs in time, and bounces, on photographs.
pub(super) fn time(text: &mut String, pictures: &CapturePictures) {
    let (direct, second) = pictures.shares;
    let _ = writeln!(
        text,
        "\n## What accuracy costs in time\n\n\
         Measured on the 60 photographs of coloured panels that are built into the program. For \
         your own scene, run `iltm tradeoff CAPTURE -o DIR`.\n\n\
         ![Error against instructions a frame](tradeoff.svg)\n\n\
         In one line: {}. `tradeoff.html` is an interactive version, `tradeoff.csv` has every \
         number.\n\n\
         ## Bounce by bounce\n\n\
         The same scene under white: {:.0} % of the light is direct, {:.0} % is the second \
         bounce. For your own scene, run `iltm bounces CAPTURE -o DIR`.\n\n\
         ![Light by bounces](bounces.png)",
        pictures.advice,
        100.0 * direct,
        100.0 * second,
    );
}

/// Every method on the same light.
pub(super) fn every(text: &mut String, contests: &[(&str, Vec<BenchmarkRow>, Vec<BenchmarkRow>)]) {
    let _ = writeln!(text, "\n## Every method on the same light\n");
    for (scene, photographed, inverted) in contests {
        for (ways, rows) in [
            ("photograph", photographed),
            ("invert or to do without an inverse", inverted),
        ] {
            let rows = table::markdown(rows);
            let _ = writeln!(text, "### Ways to {ways}, {scene}\n\n{rows}");
        }
    }
    let Some((_, photographed, inverted)) = contests.first() else {
        return;
    };
    let _ = writeln!(text, "## Sources\n");
    sources(text, photographed.iter().chain(inverted));
}

/// Where methods come from; rows that differ in a parameter only stand together.
fn sources<'r>(text: &mut String, rows: impl Iterator<Item = &'r BenchmarkRow>) {
    let rows: Vec<&BenchmarkRow> = rows.collect();
    for alike in
        rows.chunk_by(|a, b| (a.method.source, a.method.how) == (b.method.source, b.method.how))
    {
        let names: Vec<String> = alike
            .iter()
            .map(|row| format!("**{}**", row.method.name))
            .collect();
        let remarks: Vec<&str> = alike
            .iter()
            .filter_map(|row| row.result.as_ref().ok())
            .map(|done| done.remark.as_str())
            .filter(|remark| !remark.is_empty())
            .collect();
        let (source, how) = (alike[0].method.source, alike[0].method.how);
        let _ = write!(text, "- {}: {source}. {how}", names.join("; "));
        if !remarks.is_empty() {
            let _ = write!(text, " Here: {}.", remarks.join("; "));
        }
        text.push('\n');
    }
}
