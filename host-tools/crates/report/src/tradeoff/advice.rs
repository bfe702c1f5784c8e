//! Advice in one line: the cheapest tier that is good enough, and whether fewer cells would do.

use super::{Point, Sweep};
use iltm_picture::numbers::percent;

/// One step of an 8-bit code.
const TARGET: f64 = 1.0 / 255.0;

/// A tier that errs by no more than this times the least error is as good.
const AS_GOOD: f64 = 1.05;

/// An error above this times the one before is no better.
const LEAST_GAIN: f64 = 0.97;

/// See [`Tradeoff::advice`](super::Tradeoff::advice).
pub(super) fn advice(points: &[Point]) -> String {
    let table = || points.iter().filter(|point| point.sweep == Sweep::Table);
    let least = table()
        .map(|point| point.predicted)
        .fold(f64::INFINITY, f64::min);
    let enough = |limit: f64| {
        let good = table().filter(|point| point.predicted <= limit);
        good.min_by_key(|point| point.instructions)
    };
    if let Some(chosen) = enough(TARGET) {
        return format!(
            "{} meets 1/255 at {}; {}{}",
            tier(chosen),
            cost(chosen),
            doubling(points, chosen),
            cells(points, chosen, TARGET)
        );
    }
    let Some(chosen) = enough(AS_GOOD * least) else {
        return "no tier has an error that is a number".to_owned();
    };
    let own = if chosen.inverse > TARGET {
        format!(
            "1/255 is out of reach of any tier, since the inverse itself errs by {}",
            fraction(chosen.inverse)
        )
    } else {
        "1/255 is out of reach of this table".to_owned()
    };
    let as_good = if chosen.predicted > least {
        ", within 5 % of the best tier"
    } else {
        ""
    };
    format!(
        "{} errs by {}{as_good}, at {}; {}{}; {own}",
        tier(chosen),
        fraction(chosen.predicted),
        cost(chosen),
        doubling(points, chosen),
        cells(points, chosen, AS_GOOD * chosen.predicted)
    )
}

fn tier(point: &Point) -> String {
    match point.tier {
        0 => "gain only (tier 0)".to_owned(),
        tier => format!("tier {tier}"),
    }
}

fn cost(point: &Point) -> String {
    format!(
        "{} of a frame\u{2019}s time on the reference device",
        percent(point.share())
    )
}

/// What twice the time would buy from the same photographs.
fn doubling(points: &[Point], chosen: &Point) -> String {
    let affordable = points.iter().filter(|point| {
        matches!(point.sweep, Sweep::Table | Sweep::Tiers)
            && point.instructions <= 2 * chosen.instructions
    });
    let best = affordable
        .map(|point| point.predicted)
        .fold(chosen.predicted, f64::min);
    // Written so that no error at all gains nothing either.
    if best < LEAST_GAIN * chosen.predicted {
        format!("with twice the time the error is {}", fraction(best))
    } else {
        "more time makes it no better".to_owned()
    }
}

/// Whether a coarser grid errs by no more than a limit; empty if none was tried. Finer ones
/// need photographs of their own.
fn cells(points: &[Point], chosen: &Point, limit: f64) -> String {
    let grids = || points.iter().filter(|point| point.sweep == Sweep::Grid);
    let named = |point: &Point| format!("{} cells", point.grid);
    let fewest = grids()
        .filter(|point| point.predicted <= limit)
        .min_by_key(|point| point.grid.cells());
    if let Some(fewest) = fewest {
        return format!("; {} would do as well", named(fewest));
    }
    let finest = grids().map(|point| point.grid.cells()).max();
    let best = grids()
        .filter(|point| Some(point.grid.cells()) == finest)
        .min_by(|a, b| a.predicted.total_cmp(&b.predicted));
    best.map_or_else(String::new, |best| {
        format!(
            "; {} would err by {}, so {} are not too many, and more may err less",
            named(best),
            fraction(best.predicted),
            named(chosen)
        )
    })
}

/// An error as people say it.
pub(super) fn fraction(error: f64) -> String {
    if error > 0.0 && error < 0.1 {
        format!("1/{:.0}", 1.0 / error)
    } else {
        percent(error)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use iltm_compile::cost::BUDGET;
    use iltm_runtime::Grid;

    pub(in crate::tradeoff) fn point(sweep: Sweep, tier: u8, predicted: f64, share: f64) -> Point {
        Point {
            sweep,
            setting: String::new(),
            tier,
            method: None,
            photographs: None,
            bits: 16,
            grid: Grid::new(2, 2).unwrap(),
            left_out: predicted,
            inverse: 0.0,
            predicted,
            truth: None,
            instructions: (share * BUDGET as f64) as u64,
            microseconds: None,
            bytes: 1,
            seconds: None,
            hypothetical: false,
            front: false,
        }
    }

    #[test]
    fn the_cheapest_tier_that_meets_the_target_is_advised() {
        let points = [
            point(Sweep::Table, 0, 0.1, 0.05),
            point(Sweep::Table, 2, 0.01, 0.2),
            point(Sweep::Table, 3, 0.0039, 0.41),
            point(Sweep::Table, 4, 0.0030, 0.95),
            point(Sweep::Tiers, 9, 0.0036, 0.8),
            point(Sweep::Photographs, 5, 0.001, 0.5),
        ];
        assert_eq!(
            advice(&points),
            "tier 3 meets 1/255 at 41 % of a frame\u{2019}s time on the reference device; \
             with twice the time the error is 1/278"
        );
    }

    #[test]
    fn where_the_target_is_out_of_reach_it_says_whose_error_that_is() {
        let mut points = [
            point(Sweep::Table, 0, 0.1, 0.005),
            point(Sweep::Table, 3, 0.0078, 0.012),
            point(Sweep::Table, 6, 0.0076, 0.03),
        ];
        for point in &mut points {
            point.inverse = 0.0075;
        }
        assert_eq!(
            advice(&points),
            "tier 3 errs by 1/128, within 5 % of the best tier, at 1.2 % of a frame\u{2019}s time \
             on the reference device; more time makes it no better; 1/255 is out of reach of any tier, \
             since the inverse itself errs by 1/133"
        );
    }

    #[test]
    fn the_fewest_cells_that_are_as_good_are_named() {
        let on = |cells: (u16, u16), sweep, predicted| Point {
            grid: Grid::new(cells.0, cells.1).unwrap(),
            ..point(sweep, 1, predicted, 0.1)
        };
        let with_grids = |error: f64, half: f64, quarter: f64| {
            advice(&[
                on((16, 24), Sweep::Table, error),
                // The tiers of a grid: its best one counts.
                on((8, 12), Sweep::Grid, 2.0 * half),
                on((8, 12), Sweep::Grid, half),
                on((4, 6), Sweep::Grid, quarter),
            ])
        };
        let as_good = "; 8 x 12 cells would do as well";
        assert!(with_grids(0.02, 0.0209, 0.03).contains(as_good));
        // Beyond the target no accuracy is asked for.
        assert!(with_grids(0.002, 0.0039, 0.004).ends_with(as_good));
        let quarter = with_grids(0.002, 0.0039, 0.0039);
        assert!(
            quarter.ends_with("; 4 x 6 cells would do as well"),
            "{quarter}"
        );
        let none = with_grids(0.02, 0.0211, 0.03);
        let words = "; 8 x 12 cells would err by 1/47, so 16 x 24 cells are not too many, and more may err less;";
        assert!(none.contains(words), "{none}");
    }

    #[test]
    fn a_table_of_gains_alone_has_advice_too() {
        let points = [point(Sweep::Table, 0, 0.2, 0.004)];
        assert_eq!(
            advice(&points),
            "gain only (tier 0) errs by 20 %, at 0.4 % of a frame\u{2019}s time on the reference device; \
             more time makes it no better; 1/255 is out of reach of this table"
        );
    }

    #[test]
    fn points_whose_error_is_no_number_are_not_advised() {
        let points = [point(Sweep::Table, 0, f64::NAN, 0.1)];
        assert_eq!(advice(&points), "no tier has an error that is a number");
    }
}
