//! Line charts as inline SVG, coloured by the page's style sheet.

use crate::html::number;
use crate::numbers::{decades, steps};
use maud::{Markup, html};

/// Size of a chart in its own units; the page scales it.
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 320.0;

/// Room for the axes.
const LEFT: f64 = 78.0;
const RIGHT: f64 = 40.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 52.0;

/// One axis.
#[derive(Clone, Copy, Debug)]
pub struct Axis<'a> {
    /// What runs along it, with its unit.
    pub label: &'a str,
    /// Whether equal ratios are equally long.
    pub logarithmic: bool,
}

/// One point, with a few words beside it if it has any.
#[derive(Clone, Debug)]
pub struct Point {
    /// Place along the first axis.
    pub x: f64,
    /// Place along the second axis.
    pub y: f64,
    /// The words.
    pub label: String,
}

/// A line through points.
#[derive(Clone, Debug)]
pub struct Chart<'a> {
    /// What it shows, for those who cannot see it.
    pub title: &'a str,
    /// The axis across.
    pub x: Axis<'a>,
    /// The axis upwards.
    pub y: Axis<'a>,
    /// The points, in the order in which the line joins them.
    pub points: Vec<Point>,
    /// The point that matters.
    pub marked: Option<usize>,
    /// A height to compare with, and what it is.
    pub level: Option<(f64, &'a str)>,
}

/// An axis with its range, from data to places on the page.
struct Scale {
    logarithmic: bool,
    low: f64,
    high: f64,
    /// Place of `low` and of `high`.
    ends: (f64, f64),
}

impl Scale {
    fn new(axis: Axis<'_>, values: impl Iterator<Item = f64> + Clone, ends: (f64, f64)) -> Self {
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        let (low, high) = if axis.logarithmic {
            // Half a decade more on either side at least keeps one tick in view.
            (low / 1.5, high * 1.5)
        } else {
            let margin = 0.06 * (high - low).max(1e-9 * high.abs());
            (low - margin, high + margin)
        };
        Self {
            logarithmic: axis.logarithmic,
            low,
            high,
            ends,
        }
    }

    fn place(&self, value: f64) -> f64 {
        let share = if self.logarithmic {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        self.ends.0 + share * (self.ends.1 - self.ends.0)
    }

    fn ticks(&self) -> Vec<f64> {
        if !self.logarithmic {
            return steps(self.low, self.high, 6);
        }
        let powers = decades(self.low, self.high);
        if powers.len() > 2 {
            return powers;
        }
        let finer = decades(self.low / 10.0, self.high);
        let finer = finer
            .into_iter()
            .flat_map(|power| [1.0, 2.0, 5.0].map(|f| f * power));
        finer
            .filter(|value| (self.low..=self.high).contains(value))
            .collect()
    }
}

impl Chart<'_> {
    /// The chart as an `svg` element.
    #[must_use]
    pub fn render(&self) -> Markup {
        let points = self.points.iter();
        let xs = points.clone().map(|point| point.x);
        let ys = points
            .map(|point| point.y)
            .chain(self.level.map(|(level, _)| level));
        let x = Scale::new(self.x, xs, (LEFT, WIDTH - RIGHT));
        let y = Scale::new(self.y, ys, (HEIGHT - BOTTOM, TOP));
        let line: Vec<String> = self
            .points
            .iter()
            .map(|point| format!("{:.1},{:.1}", x.place(point.x), y.place(point.y)))
            .collect();
        html! {
            svg .chart viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) role="img" aria-label=(self.title) {
                @for tick in y.ticks() {
                    line .grid x1=(LEFT) x2=(WIDTH - RIGHT) y1=(at(y.place(tick))) y2=(at(y.place(tick))) {}
                    text .tick x=(LEFT - 8.0) y=(at(y.place(tick) + 4.0)) text-anchor="end" { (number(tick)) }
                }
                @for tick in x.ticks() {
                    line .grid x1=(at(x.place(tick))) x2=(at(x.place(tick))) y1=(TOP) y2=(HEIGHT - BOTTOM) {}
                    text .tick x=(at(x.place(tick))) y=(HEIGHT - BOTTOM + 18.0) text-anchor="middle" { (number(tick)) }
                }
                text .axis x=(f64::midpoint(LEFT, WIDTH - RIGHT)) y=(HEIGHT - 10.0) text-anchor="middle" { (self.x.label) }
                text .axis transform=(format!("translate(15 {}) rotate(-90)", f64::midpoint(TOP, HEIGHT - BOTTOM))) text-anchor="middle" { (self.y.label) }
                @if let Some((level, name)) = self.level {
                    line .level x1=(LEFT) x2=(WIDTH - RIGHT) y1=(at(y.place(level))) y2=(at(y.place(level))) {}
                    text .note x=(WIDTH - RIGHT - 6.0) y=(at(y.place(level) - 6.0)) text-anchor="end" { (name) }
                }
                polyline .curve points=(line.join(" ")) {}
                @for (index, point) in self.points.iter().enumerate() {
                    @let marked = self.marked == Some(index);
                    circle .(if marked { "marked" } else { "point" }) cx=(at(x.place(point.x))) cy=(at(y.place(point.y))) r=(if marked { 6 } else { 4 }) {}
                    @if !point.label.is_empty() {
                        text .note x=(at(x.place(point.x) + 9.0)) y=(at(y.place(point.y) - 8.0)) { (point.label) }
                    }
                }
            }
        }
    }
}

/// A place to a tenth of a unit.
fn at(place: f64) -> String {
    format!("{place:.1}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_and_tick_lies_inside_the_chart() {
        let point = |x: f64, y: f64| Point {
            x,
            y,
            label: String::new(),
        };
        let chart = Chart {
            title: "test",
            x: Axis {
                label: "x",
                logarithmic: true,
            },
            y: Axis {
                label: "y",
                logarithmic: false,
            },
            points: vec![point(1e-4, 0.3), point(1e-2, 0.1), point(1.0, 0.2)],
            marked: Some(1),
            level: None,
        };
        let svg = chart.render().into_string();
        let coordinates = svg
            .split("points=\"")
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap();
        for pair in coordinates.split(' ') {
            let (x, y) = pair.split_once(',').unwrap();
            assert!((LEFT..=WIDTH - RIGHT).contains(&x.parse::<f64>().unwrap()));
            assert!((TOP..=HEIGHT - BOTTOM).contains(&y.parse::<f64>().unwrap()));
        }
        assert_eq!(svg.matches("class=\"marked\"").count(), 1);
        assert!(svg.matches("class=\"grid\"").count() >= 6);
    }

    #[test]
    fn a_short_logarithmic_axis_has_ticks_between_the_powers_of_ten() {
        let axis = Axis {
            label: "",
            logarithmic: true,
        };
        let scale = Scale::new(axis, [0.02, 0.09].into_iter(), (0.0, 1.0));
        assert_eq!(scale.ticks(), [0.02, 0.05, 0.1]);
    }
}
