//! Claims of the paper, and this project's, judged draw by draw.

use super::scenes::Condition;
use super::sections::find;
use super::seeds::{DrawErrors, Mean, SEEDS};
use crate::table;
use iltm_solve::Method;
use std::fmt::Write;

/// The paper's claims, and whether they hold.
pub(super) fn claims(text: &mut String, samples: &[DrawErrors]) {
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
                 draws; two-stage errs {ratio:.2} times as much on average.",
                condition.name(),
                verdict(wins, all),
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
        let means = |sample: &DrawErrors| {
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
                "  The rest is noise, which fewer photographs average less. {enough}",
            );
        }
    }
}

/// With how many photographs this project's second bounce is better than another's.
fn fewest(samples: &[DrawErrors], condition: Condition, other: &DrawErrors) -> String {
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
            format!("With {enough} photographs `iltm` is better here too.")
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
