//! Chart of the trade-off: error against instructions, as an SVG file.

use super::{Point, Sweep, Tradeoff};
use iltm_compile::cost::{BUDGET, CLOCK, RATE};
use iltm_picture::chart::{Chart, ChartAxis, INK, PALETTE, Series};

/// One step of an 8-bit code.
const STEP: f64 = 1.0 / 255.0;

/// A sweep's colour.
pub(super) const fn colour(sweep: Sweep) -> &'static str {
    match sweep {
        Sweep::Table => INK,
        Sweep::Tiers => PALETTE[7],
        Sweep::Photographs => PALETTE[0],
        Sweep::Solver => PALETTE[1],
        Sweep::Bits => PALETTE[3],
        Sweep::Grid => PALETTE[2],
    }
}

/// What a sweep is called beside its colour.
pub(super) const fn title(sweep: Sweep) -> &'static str {
    match sweep {
        Sweep::Table => "the table",
        Sweep::Tiers => "tiers between",
        Sweep::Photographs => "fewer photographs",
        Sweep::Solver => "another solver",
        Sweep::Bits => "fewer bits",
        Sweep::Grid => "coarser operator",
    }
}

impl Tradeoff {
    /// The scene, or what else it is called.
    pub(super) fn heading(&self) -> &str {
        if self.scene.is_empty() {
            &self.name
        } else {
            &self.scene
        }
    }

    /// The chart; `None` if there is nothing to draw.
    #[must_use]
    pub fn svg(&self) -> Option<String> {
        let drawn = self.points.iter().filter(|point| {
            point.predicted.is_finite() && point.predicted > 0.0 && point.instructions > 0
        });
        let drawn: Vec<&Point> = drawn.collect();
        if drawn.is_empty() {
            return None;
        }
        let mut series = vec![Series {
            name: "Pareto front".to_owned(),
            points: front_line(&drawn),
            line: 9.0,
            dot: 0.0,
            opacity: 0.18,
            ..Series::default()
        }];
        for sweep in Sweep::ALL.into_iter().rev() {
            let own: Vec<&Point> = drawn.iter().copied().filter(|p| p.sweep == sweep).collect();
            if !own.is_empty() {
                series.extend(of_sweep(sweep, &own));
            }
        }
        let title = format!("What accuracy costs: {}", self.heading());
        let x = format!(
            "thousand instructions a frame on the reference board (a {RATE} Hz frame on a {} MHz part has {})",
            CLOCK / 1_000_000,
            BUDGET / 1000
        );
        let near = drawn.iter().any(|point| point.predicted < 1.4 * STEP);
        let chart = Chart {
            title: &title,
            notes: wrapped(&self.advice(), 128),
            size: (960.0, 640.0),
            x: ChartAxis::logarithmic(&x),
            y: ChartAxis::logarithmic("predicted error, relative, %"),
            limit: near.then_some((100.0 * STEP, "1/255")),
            series,
            ..Chart::default()
        };
        Some(chart.file())
    }
}

/// The lines of a sweep, a table each, and its dots.
fn of_sweep(sweep: Sweep, own: &[&Point]) -> Vec<Series> {
    let (colour, table) = (colour(sweep), sweep == Sweep::Table);
    let curves = own.chunk_by(|a, b| a.setting == b.setting && sweep != Sweep::Tiers);
    let curves = curves.map(|curve| Series {
        colour,
        points: curve.iter().map(|point| place(point)).collect(),
        line: if table { 2.0 } else { 1.0 },
        dot: 0.0,
        opacity: if sweep == Sweep::Bits { 0.25 } else { 0.7 },
        ..Series::default()
    });
    let mut series: Vec<Series> = curves.filter(|curve| curve.points.len() > 1).collect();
    let labels = own.iter().filter(|_| table);
    series.push(Series {
        name: title(sweep).to_owned(),
        colour,
        points: own.iter().map(|point| place(point)).collect(),
        labels: labels.map(|point| point.tier.to_string()).collect(),
        dot: if table { 5.0 } else { 3.0 },
        hollow: sweep == Sweep::Bits,
        ..Series::default()
    });
    series
}

/// In thousands of instructions and per cent.
fn place(point: &Point) -> (f64, f64) {
    (point.instructions as f64 / 1e3, 100.0 * point.predicted)
}

/// The front as stairs: between two of its points, the cheaper one is what can be had.
fn front_line(drawn: &[&Point]) -> Vec<(f64, f64)> {
    let front = drawn.iter().filter(|point| point.front);
    let mut front: Vec<(f64, f64)> = front.map(|point| place(point)).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut stairs = Vec::new();
    for (x, y) in front {
        stairs.extend(stairs.last().map(|(_, before)| (x, *before)));
        stairs.push((x, y));
    }
    stairs
}

/// Words in lines of at most so many letters.
fn wrapped(text: &str, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.len() + word.len() < most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tradeoff::advice::tests::point;
    use iltm_runtime::Grid;

    fn tradeoff(points: Vec<Point>) -> Tradeoff {
        Tradeoff {
            name: "a capture".to_owned(),
            scene: "a <scene>".to_owned(),
            grid: Grid::new(2, 2).unwrap(),
            channels: 1,
            points,
            missing: Vec::new(),
        }
    }

    #[test]
    fn every_point_that_has_a_place_is_drawn() {
        let points = vec![
            point(Sweep::Table, 0, 0.1, 0.1),
            point(Sweep::Table, 1, 0.01, 0.2),
            point(Sweep::Grid, 1, 0.02, 0.2),
            point(Sweep::Bits, 1, f64::INFINITY, 0.2),
        ];
        let svg = tradeoff(points).svg().unwrap();
        // A dot each, and one for each sweep in the legend.
        assert_eq!(svg.matches("<circle").count(), 3 + 2);
        assert!(svg.contains("a &lt;scene&gt;"));
    }

    #[test]
    fn no_points_make_no_picture() {
        assert_eq!(tradeoff(Vec::new()).svg(), None);
    }

    #[test]
    fn between_two_points_of_the_front_the_cheaper_one_can_be_had() {
        let mut points = [
            point(Sweep::Table, 0, 0.5, 0.25),
            point(Sweep::Table, 1, 0.25, 0.5),
        ];
        for point in &mut points {
            point.front = true;
        }
        let drawn: Vec<&Point> = points.iter().collect();
        let (near, far) = (900.0, 1800.0);
        let stairs = [(near, 50.0), (far, 50.0), (far, 25.0)];
        assert_eq!(front_line(&drawn), stairs);
    }
}
