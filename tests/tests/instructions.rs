//! Frames must not come to take more instructions unnoticed.

use iltm_tests::instructions::{cases, count, csv};

/// What the repository says.
const COMMITTED: &str = include_str!("../../docs/instructions.csv");

/// Growth that is taken for the compiler's.
const MOST_GROWTH: f64 = 1.03;

#[test]
fn no_frame_takes_more_than_three_per_cent_more_instructions_than_the_list_says() {
    let counts: Vec<_> = cases().iter().flat_map(count).collect();
    let counted = csv(&counts);
    println!("{counted}");
    let mut committed = COMMITTED.lines().skip(1);
    for count in &counts {
        let line = committed.next().expect("the list has all tiers");
        let fields: Vec<&str> = line.split(',').collect();
        let [case, tier, .., frame, _] = fields.as_slice() else {
            panic!("{line}");
        };
        assert_eq!((*case, *tier), (&*count.case, &*count.tier.to_string()));
        let listed: f64 = frame.parse().expect("a number");
        assert!(
            count.frame as f64 <= MOST_GROWTH * listed,
            "{case}, tier {tier}: {} instructions instead of {listed}; if that is meant, run\n\
             cargo run --release -p iltm-tests --bin instructions > docs/instructions.csv",
            count.frame
        );
    }
    assert_eq!(committed.next(), None, "the list has other tiers");
}
