//! Gate `order`: every photograph shows the pattern of its line.

use crate::format::bracket::Bracket;
use crate::format::manifest::Shot;
use crate::format::role::Role;
use crate::format::sequence::Sequence;
use crate::gate::{Evidence, Gate, GateName, Verdict, listed};
use crate::photographs::order::{Order, Wrong};

/// Judges what was found of patterns and of images.
pub(crate) fn judge_all(sequence: &Sequence, patterns: Option<Order>, images: Order) -> Gate {
    let first = |image: &Bracket| image.shots[0].clone();
    let of_images: Vec<Shot> = sequence.images.iter().map(first).collect();
    let Some(patterns) = patterns else {
        let judged = judge(&of_images, Some(&images));
        // White alone shows no pattern.
        let images_alone = sequence.views.len() == 1;
        return if judged.fails() || images_alone {
            judged
        } else {
            judge(&[], None)
        };
    };
    let shots = [&sequence.shots[..], &of_images].concat();
    judge(&shots, Some(&patterns.and(images)))
}

/// Judges what was found of these shots.
pub(super) fn judge(shots: &[Shot], order: Option<&Order>) -> Gate {
    let name = GateName::Order;
    let Some(order) = order else {
        let why = "too few photographs, or too few pixels that follow any cell, to tell which \
             pattern each shows";
        return Gate::not_judged(name, why);
    };
    let shown = order.distances.iter().enumerate();
    let gate = |verdict, what: String, next_step| Gate {
        name,
        verdict,
        number: order.wrong.len() as f64,
        limit: 0.0,
        unit: "photographs",
        what,
        next_step,
        evidence: Evidence::Photographs {
            what: "distance to the own pattern (0: the same, 0.5: another random one)",
            values: shown
                .map(|(shot, distance)| (shots[shot].index, *distance))
                .collect(),
            limit: Some(order.none),
            from: None,
        },
    };
    let photo = |shot: usize| shots[shot].photo.display();
    match order.wrong.as_slice() {
        [] => {
            let what = format!(
                "all {} photographs show their patterns",
                order.distances.len()
            );
            gate(Verdict::Pass, what, "")
        }
        [a, b] if a.shows == Some(b.shot) && b.shows == Some(a.shot) => {
            let what = format!(
                "{} and {} are exchanged: each shows the other's pattern",
                photo(a.shot),
                photo(b.shot)
            );
            gate(
                Verdict::Fail,
                what,
                "Exchange the two files and check again.",
            )
        }
        wrong => {
            let (what, next_step) = shifted(shots, wrong).unwrap_or_else(|| {
                let dark = |shot: &usize| shots[*shot].role == Role::Black;
                let all = wrong
                    .iter()
                    .all(|wrong| wrong.shows.as_ref().is_some_and(dark));
                // A single one may as well be black that was photographed too early.
                if all && wrong.len() > 1 {
                    return (
                        format!(
                            "{} photographs are dark where their patterns are not: {}",
                            wrong.len(),
                            listed(wrong.iter().map(|wrong| photo(wrong.shot)), 4)
                        ),
                        STAY_ON,
                    );
                }
                let one = |wrong: &Wrong| match wrong.shows {
                    Some(other) if dark(&other) => format!("{} is dark", photo(wrong.shot)),
                    Some(other) => format!("{} shows that of {}", photo(wrong.shot), photo(other)),
                    None => format!("{} shows none", photo(wrong.shot)),
                };
                let what = format!(
                    "{} photographs show another pattern than their line says (exchanged, moved or \
                     disturbed): {}",
                    wrong.len(),
                    listed(wrong.iter().map(one), 4)
                );
                (what, AGAIN)
            });
            gate(Verdict::Fail, what, next_step)
        }
    }
}

/// Next step where photographs are dark.
const STAY_ON: &str = "Make sure that the projector stays on and shows every slide, and take those photographs \
                       again.";

/// Next step where nothing says why.
const AGAIN: &str = "Take those photographs again, or put them in their places.";

/// Next step where bounced light alone may be seen, which does not tell the patterns.
const OUT_OF_VIEW: &str = "Make sure that the camera sees this projector's picture, and not only its light \
                           on other walls; if it does, take those photographs again, or put them in \
                           their places.";

impl Gate {
    /// The same where so many cells were found: none may be in view.
    pub(super) fn or_out_of_view(mut self, live: usize) -> Self {
        if [AGAIN, STAY_ON].contains(&self.next_step) && live == 0 {
            self.next_step = OUT_OF_VIEW;
        }
        self
    }
}

/// The sentence and next step if all wrong photographs show the same number of
/// patterns later or earlier.
fn shifted(shots: &[Shot], wrong: &[Wrong]) -> Option<(String, &'static str)> {
    let mut counts = std::collections::BTreeMap::new();
    for wrong in wrong {
        if let Some(other) = wrong.shows {
            *counts
                .entry(other as isize - wrong.shot as isize)
                .or_insert(0) += 1;
        }
    }
    let (&shift, &count) = counts.iter().max_by_key(|(_, count)| **count)?;
    if wrong.len() < 3 || 10 * count < 7 * wrong.len() {
        return None;
    }
    let first = wrong
        .iter()
        .find(|w| w.shows == w.shot.checked_add_signed(shift))?;
    let photo = shots[first.shot].photo.display();
    let (what, next_step) = if shift > 0 {
        (
            format!(
                "from {photo} on, photographs show the pattern {shift} later than their line: {} \
                 missing before it and all others moved up",
                if shift == 1 {
                    "one is".to_owned()
                } else {
                    format!("{shift} are")
                }
            ),
            "Number the photographs from that one on one higher for each missing one, and take \
             the missing ones again.",
        )
    } else {
        (
            format!(
                "from {photo} on, photographs show the pattern {} earlier than their line: one was \
                 taken twice, or the camera was faster than the projector",
                -shift
            ),
            "Remove the photograph that was taken twice and number those after it one lower, or \
             take the capture again with a longer wait before each photograph.",
        )
    };
    Some((what, next_step))
}
