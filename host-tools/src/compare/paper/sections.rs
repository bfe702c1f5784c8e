//! The words and tables of the page, each from its numbers.

use super::complexity::{self, Timed};
use super::feasible::Place;
use super::scenes::Condition;
use super::second_bounce::Lit;
use super::seeds::{ENTRIES, Mean, SEEDS, Sample};
use super::sparsity::{Counted, INVERSE_IN_HAAR, PARTS};
use crate::compare::contest::Row;
use crate::compare::table;
use crate::solve::Method;
use crate::solve::recovery::LIMIT;
use std::fmt::Write;

/// What the page says of a method with so many photographs.
pub(super) fn words(method: Method, photographs: usize) -> String {
    let name = match method {
        Method::Joint => "iltm",
        Method::Direct => "direct (the paper)",
        Method::TwoStage => "two-stage",
        Method::BruteForce => "brute force",
    };
    format!("{name}, {photographs}")
}

/// The sample of a condition and method.
fn find(samples: &[Sample], condition: Condition, entry: (Method, usize)) -> Option<&Sample> {
    samples.iter().find(|sample| {
        sample.condition == condition && (sample.method, sample.photographs) == entry
    })
}

/// The paper's claims, and whether they hold.
pub(super) fn claims(text: &mut String, samples: &[Sample]) {
    let _ = writeln!(text, "\n## The paper's claim\n");
    let _ = writeln!(
        text,
        "*The direct method finds the inverse better from the same photographs than \
         sensing the transport first and inverting it.* Second bounce under white, {SEEDS} \
         draws of patterns, noise and texture:\n"
    );
    for condition in Condition::ALL {
        for photographs in [120, 150] {
            let direct = find(samples, condition, (Method::Direct, photographs));
            let other = find(samples, condition, (Method::TwoStage, photographs));
            let (Some(direct), Some(other)) = (direct, other) else {
                continue;
            };
            let (wins, all) = direct.wins(other);
            let ratio =
                Mean::of(&other.second_bounce()).mean / Mean::of(&direct.second_bounce()).mean;
            let _ = writeln!(
                text,
                "- {}, {photographs} photographs: **{}**. Direct is better in {wins} of {all} \
                 draws; two-stage errs {} as much on average.",
                condition.name(),
                verdict(wins, all),
                times(ratio),
            );
        }
    }
    let _ = writeln!(
        text,
        "\nThis project's solver on fewer photographs against the direct method on 150:\n"
    );
    for condition in Condition::ALL {
        let direct = find(samples, condition, (Method::Direct, 150));
        let own = find(samples, condition, (Method::Joint, 50));
        let (Some(direct), Some(own)) = (direct, own) else {
            continue;
        };
        let (wins, all) = own.wins(direct);
        let means = |sample: &Sample| {
            let compensation = Mean::of(&sample.compensation());
            let second = Mean::of(&sample.second_bounce());
            (table::error(second.mean), table::error(compensation.mean))
        };
        let ((own_second, own_comp), (second, comp)) = (means(own), means(direct));
        let _ = writeln!(
            text,
            "- {}: {own_second} against {second} (second bounce, better in {wins} of {all} \
             draws), {own_comp} against {comp} (compensation).",
            condition.name(),
        );
        if wins < all {
            let enough = fewest(samples, condition, direct);
            let _ = writeln!(
                text,
                "  What is left there is noise: fewer photographs average less of it. {enough}",
            );
        }
    }
}

/// With how many photographs this project's second bounce is better than another's.
fn fewest(samples: &[Sample], condition: Condition, other: &Sample) -> String {
    let own = samples
        .iter()
        .filter(|s| s.condition == condition && s.method == Method::Joint);
    let better = own.filter(|s| {
        let (wins, all) = s.wins(other);
        wins * 20 >= all * 19
    });
    better
        .map(|s| s.photographs)
        .min()
        .map_or_else(String::new, |enough| {
            format!("With {enough} photographs it is better in this number too.")
        })
}

/// Whether a claim holds that is true in `wins` of `all` draws.
fn verdict(wins: usize, all: usize) -> &'static str {
    if wins * 20 >= all * 19 {
        "holds"
    } else if wins * 20 <= all {
        "does not hold, the reverse does"
    } else if wins * 4 >= all * 3 {
        "holds mostly"
    } else if wins * 4 <= all {
        "mostly does not hold"
    } else {
        "a tie"
    }
}

fn times(ratio: f64) -> String {
    format!("{ratio:.2} times")
}

/// Fig. 4.
pub(super) fn fourth(text: &mut String, samples: &[Sample]) {
    let _ = writeln!(
        text,
        "\n## Fig. 4: the second bounce, by method\n\n\
         ![Second bounce by method, uniform panels](fig4-uniform.png)\n\n\
         ![Second bounce by method, textured panels](fig4-textured.png)\n\n\
         One draw, noiseless: uniform panels above, textured ones below. Over {SEEDS} draws, mean \
         and its 95 % interval (`fig4.csv` has each):\n\n\
         ![Errors of the second bounce over the draws](fig4-seeds.svg)\n"
    );
    let names: Vec<&str> = Condition::ALL.iter().map(|c| c.name()).collect();
    let _ = writeln!(text, "| second bounce | {} |", names.join(" | "));
    let _ = writeln!(text, "|---|{}", "---:|".repeat(names.len()));
    rows(text, samples, Sample::second_bounce);
    let _ = writeln!(text, "\n| compensation | {} |", names.join(" | "));
    let _ = writeln!(text, "|---|{}", "---:|".repeat(names.len()));
    rows(text, samples, Sample::compensation);
}

fn rows(text: &mut String, samples: &[Sample], of: fn(&Sample) -> Vec<f64>) {
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
        let _ = writeln!(
            text,
            "| {} | {} |",
            words(method, photographs),
            cells.join(" | ")
        );
    }
}

/// Fig. 1.
pub(super) fn sparse(text: &mut String, counts: &[Counted]) {
    let _ = writeln!(
        text,
        "\n## Fig. 1: how sparse the matrices are\n\n\
         ![T, its inverse, and both in Haar](fig1.png)\n\n\
         Coefficients that hold a part of the energy (sum of squares), of {}:\n",
        counts.first().map_or(0, |counted| counted.all)
    );
    let parts = PARTS.map(|part| format!("{} %", 100.0 * part));
    let _ = writeln!(text, "| scene | matrix | {} |", parts.join(" | "));
    let _ = writeln!(text, "|---|---|{}", "---:|".repeat(parts.len()));
    for counted in counts {
        let scene = if counted.textured {
            "textured"
        } else {
            "uniform"
        };
        let cells = counted.counts.map(|count| count.to_string());
        let _ = writeln!(
            text,
            "| {scene} | {} | {} |",
            counted.name,
            cells.join(" | ")
        );
    }
    let _ = writeln!(
        text,
        "\n`K` is the inverse without its diagonal: `T^-1 = diag(g) - K`. It is the same for \
         both scenes, since texture is in `g` alone, and it is all that a table codes in Haar."
    );
}

/// Fig. 2.
pub(super) fn second(text: &mut String, places: &[Place], counts: &[Counted]) {
    let _ = writeln!(
        text,
        "\n## Fig. 2: what the theorem promises\n\n\
         ![The region of the theorem, and the scene](fig2.svg)\n\n\
         Theorem 3.1 promises that the direct method finds rows of `k` coefficients exactly where \
         `kappa^2 gamma < sqrt 2 + 1 = 2.41`. The exact constants are NP-hard. These are bounds: \
         from below by supports that were looked at, so that the scene lies where it is drawn or \
         further up and right; from above by Gershgorin\u{2019}s discs (`inf`: nothing known). \
         Patterns count as +1 and -1, which is the form that promises most.\n"
    );
    let _ = writeln!(
        text,
        "| scene | photographs | k | kappa at least | gamma at least | kappa^2 gamma at least | at most |\n\
         |---|---:|---:|---:|---:|---:|---:|"
    );
    for place in places {
        let scene = if place.textured {
            "textured"
        } else {
            "uniform"
        };
        let _ = writeln!(
            text,
            "| {scene} | {} | {} | {:.2} | {:.2} | {:.2} | {:.2} |",
            place.photographs, place.k, place.kappa, place.gamma, place.product.0, place.product.1
        );
    }
    let inside = places
        .iter()
        .filter(|place| place.product.1 < LIMIT)
        .count();
    let open = places
        .iter()
        .filter(|place| place.product.0 < LIMIT)
        .count()
        - inside;
    let a_row = |textured: bool| {
        let own = |c: &&Counted| c.textured == textured && c.name == INVERSE_IN_HAAR;
        let counted = counts.iter().find(own);
        counted.map_or(0.0, |c| c.counts[2] as f64 / (c.all as f64).sqrt())
    };
    let _ = writeln!(
        text,
        "\nOf {} places {inside} are proven to lie in the region and {open} may. Rows of the \
         inverse have {:.0} coefficients (uniform) and {:.0} (textured) for 99.99 % of the energy \
         (Fig. 1). The theorem does not say why the method works here: it works far outside the \
         region, as l1 methods do.",
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
         The paper gives `O(N^2 m)` an iteration, and counts the exact inversion, `O(N^3)`, as the \
         price of the two-stage method. Exponents fitted to the times of one iteration; `N^a` of \
         a whole solve has the number of iterations in it:\n"
    );
    let _ = writeln!(
        text,
        "| method | N, an iteration | m, an iteration | N, a whole solve |\n|---|---:|---:|---:|"
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
         two-stage solve, and {:.0} ms at {largest}, {:.0} %. So the claim holds in the \
         exponents; at the paper's size the l1 problems take the time, not the inversion. `m` \
         enters less than linearly: the l1 step does not depend on it.",
        complexity::inversion_exponent(timed),
        paper.0,
        paper.1,
        most.0,
        most.1,
    );
}

/// Every method on the same light.
pub(super) fn every(text: &mut String, contests: &[(&str, Vec<Row>, Vec<Row>)]) {
    let _ = writeln!(text, "\n## Every method on the same light\n");
    for (scene, photographed, inverted) in contests {
        let _ = writeln!(
            text,
            "### Ways to photograph, {scene}\n\n{}",
            table::markdown(photographed)
        );
        let _ = writeln!(
            text,
            "### Ways to invert or to do without an inverse, {scene}\n\n{}",
            table::markdown(inverted)
        );
    }
    let Some((_, photographed, inverted)) = contests.first() else {
        return;
    };
    let _ = writeln!(text, "## Sources\n");
    sources(text, photographed.iter().chain(inverted));
}

/// Where methods come from; rows that differ in a parameter only stand together.
fn sources<'r>(text: &mut String, rows: impl Iterator<Item = &'r Row>) {
    let rows: Vec<&Row> = rows.collect();
    for alike in rows.chunk_by(|a, b| (a.source, a.how) == (b.source, b.how)) {
        let names: Vec<String> = alike
            .iter()
            .map(|row| format!("**{}**", row.name))
            .collect();
        let remarks: Vec<&str> = alike
            .iter()
            .filter_map(|row| row.result.as_ref().ok())
            .map(|done| done.remark.as_str())
            .filter(|remark| !remark.is_empty())
            .collect();
        let (source, how) = (alike[0].source, alike[0].how);
        let _ = write!(text, "- {}: {source}. {how}", names.join("; "));
        if !remarks.is_empty() {
            let _ = write!(text, " Here: {}.", remarks.join("; "));
        }
        text.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claim_holds_in_nineteen_of_twenty_draws() {
        let verdicts = [(20, 20), (19, 20), (16, 20), (10, 20), (4, 20), (1, 20)];
        let words = verdicts.map(|(wins, all)| verdict(wins, all));
        assert_eq!(words[..2], ["holds"; 2]);
        assert_eq!(words[2], "holds mostly");
        assert_eq!(words[3], "a tie");
        assert_eq!(words[4], "mostly does not hold");
        assert_eq!(words[5], "does not hold, the reverse does");
    }
}
