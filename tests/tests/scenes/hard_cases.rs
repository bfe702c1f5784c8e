//! Hard cases: every one holds, and the page in the docs lists them all.

use iltm_tests::hard_cases::case::{METHODS, Trials};
use iltm_tests::hard_cases::cases;
use iltm_tests::hard_frames;
use rayon::prelude::*;

/// One seed each: the page has the worst of five.
#[test]
fn every_hard_case_holds() {
    let all: Vec<_> = cases::all()
        .into_iter()
        .flat_map(|(_, cases)| cases)
        .collect();
    let runs = all
        .par_iter()
        .flat_map(|case| METHODS.map(|method| (case, method)));
    let failures: Vec<String> = runs
        .filter_map(|(case, method)| {
            let outcome = (case.run)(Trials { seeds: 1, method });
            (!outcome.holds).then(|| {
                format!(
                    "{}, {method}: {} where {} must hold",
                    case.name, outcome.measured, outcome.bound
                )
            })
        })
        .collect();
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn the_page_lists_every_case_and_none_that_fails() {
    let page = include_str!("../../../docs/hard-cases.md");
    for (title, cases) in cases::all() {
        assert!(page.contains(&format!("## {title}")), "{title}");
        for case in cases {
            assert!(
                page.contains(&format!("| {} | {} |", case.name, case.reason)),
                "{}",
                case.name
            );
        }
    }
    let rows = hard_frames::page::rows();
    // Five frames, four limits, drift, five kinds of grid.
    assert_eq!(rows.len(), 15);
    for row in rows {
        assert!(row.holds, "{row:?}");
        assert!(page.contains(&format!("| {} |", row.case)), "{}", row.case);
    }
    assert!(!page.contains("| FAILS |"));
}
