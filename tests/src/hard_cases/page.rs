//! Page of hard cases: lists all of them.

use super::case::{Case, CaseOutcome, METHODS};
use crate::hard_frames::page::Row;
use std::fmt::Write as _;

/// What the page says before its tables.
const HEAD: &str = "# Hard cases

This page is for those who want to know the limits of the method. It lists scenes, photographs,
grids and frames that are difficult, the bound that must hold with its theory, and the measured
result. This command writes the page:

```sh long
cargo run --release -p iltm-tests --bin hard_cases -- --write docs/hard-cases.md
```

`cargo test -p iltm-tests --test scenes hard_cases` checks every case. Each is solved by `joint` and
by `links`, of which held-out photographs choose where nothing else is asked for ([method](method.md));
both must hold.

Errors are those of the closed loop, `min_s |s T p - d| / |d|`, as the mean over 16 natural
images `d` (dead leaves, darkest parts a fifth of white), where `p` is the projector's input
clipped to its range and the scene's transport `T` is known exactly. Seeds change patterns and
noise; the worst seed counts. The chosen result (operator, gains alone or nothing) must never be
worse than gains alone or nothing by more than a tenth.

Unless a case says otherwise, the scene is 13 x 21 cells on M-shaped panels at 75 degrees,
photographed under white, Gray code with inverses and random patterns. The bound is

    perfect + min over s of (2 tail(s) + cond sigma sqrt(s ln N / m)) + cond tolerance,   s <= m / (2 ln(N / m)) <= N

where `perfect` is the error of the true inverse (clipping), `tail(s)` that of its best `s` Haar
coefficients per row, `cond` the condition number, `sigma` the noise, `m` the number of
photographs, `N` that of cells, and `tolerance` = 0.0005 the solver's own
(`tests/src/hard_cases/theory.rs` derives the bound).
";

/// What the page says of the device's arithmetic.
const FRAMES: &str = "
## Frames on the device

Every device and the host compute the same integers; here they are compared with an exact
reference. A step is 2^-15 of the projector's white: 128 steps are an 8-bit code of linear light.

| case | why it is hard | must hold | measured | verdict |
|---|---|---|---|---|
";

/// A case with what came of it by each method.
pub type CaseRow = (Case, [CaseOutcome; METHODS.len()]);

/// The page, and how many cases fail.
pub fn render(groups: &[(&str, Vec<CaseRow>)], frames: &[Row]) -> (String, usize) {
    let mut page = HEAD.to_owned();
    let mut failures = 0;
    let cell = |text: &str| text.replace('|', "\\|").replace('\n', " ");
    for (title, cases) in groups {
        let _ = write!(
            page,
            "\n## {title}\n\n| case | why it is hard | must hold | theory | measured | by links | verdict |\n|---|---|---|---|---|---|---|\n"
        );
        for (case, [joint, links]) in cases {
            failures += usize::from(!joint.holds) + usize::from(!links.holds);
            let mut measured = joint.measured.clone();
            if !joint.beside.is_empty() {
                let _ = write!(measured, "; {}", joint.beside);
            }
            let by_links = if links == joint {
                "the same".to_owned()
            } else if links.bound == joint.bound {
                links.measured.clone()
            } else {
                format!("{}; must hold: {}", links.measured, links.bound)
            };
            let verdict = if joint.holds { links } else { joint }.verdict();
            let _ = writeln!(
                page,
                "| {} | {} | {} | {} | {} | {} | {verdict} |",
                cell(case.name),
                cell(case.reason),
                cell(&joint.bound),
                cell(case.theory),
                cell(&measured),
                cell(&by_links),
            );
        }
    }
    if !frames.is_empty() {
        page.push_str(FRAMES);
    }
    for row in frames {
        failures += usize::from(!row.holds);
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {} |",
            cell(row.case),
            cell(row.reason),
            cell(&row.bound),
            cell(&row.measured),
            if row.holds { "within bound" } else { "FAILS" }
        );
    }
    (page, failures)
}
