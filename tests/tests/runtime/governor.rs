//! Governor: no table's own figures keep a tier from being tried that fits.

use iltm::compile::cost;
use iltm_runtime::FrameSize;
use iltm_runtime::governor::{Governor, MOST_PATIENCE};
use iltm_runtime::image::Table;
use iltm_tests::{costs, instructions};

/// Frames larger than the grid, up to very many pixels a cell.
const SIZES: [(u16, u16); 3] = [(320, 240), (1280, 720), (3840, 2160)];

#[test]
fn every_tier_that_fits_with_the_margin_is_used() {
    let (mut asked, mut overruns) = (0, 0);
    for case in instructions::cases().into_iter().chain(costs::cases()) {
        let table = Table::check(&case.image).expect("a table");
        let larger = SIZES.map(|(width, height)| FrameSize::new(width, height));
        let larger = larger.into_iter().flatten();
        let larger = larger.filter(|size| {
            let grid = FrameSize::of_grid(table.grid());
            size.width() >= grid.width() && size.height() >= grid.height()
        });
        for size in larger.chain([case.size]) {
            let samples = size.pixels() * usize::from(table.channels());
            let tiers = 0..=table.top_tier();
            let times: Vec<u32> = tiers
                .map(|tier| cost::stages(&table, tier, size).total() as u32)
                .collect();
            for (tier, time) in times.iter().enumerate() {
                // The margin of an eighth, and what a ratio of twelve bits leaves out.
                let budget = time + time / 7 + time / 128 + 2;
                let mut governor = Governor::for_table(&table, samples, budget);
                for _ in 0..MOST_PATIENCE {
                    governor.frame(times[usize::from(governor.tier())]);
                }
                let reached = usize::from(governor.tier());
                assert!(
                    reached >= tier,
                    "{}, {size}: {reached} of {tier}",
                    case.name
                );
                overruns += governor.overruns();
                asked += 1;
            }
        }
    }
    println!("{overruns} frames over the budget in {asked} cases");
}
