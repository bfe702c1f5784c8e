//! Charts: points and lines over linear or logarithmic axes as SVG, inside of a page or as
//! a file of its own. `chart.css` has the colours of both.

use crate::html::number;
use crate::numbers::{decades, steps};
use maud::{Markup, PreEscaped, html};

/// Colours that people tell apart, whatever they see of colours (Okabe, Ito, 2008), and
/// two greys.
pub const PALETTE: [&str; 8] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#5a5a5a", "#787e87",
];

/// The colour of letters, which a page has dark or light.
pub const INK: &str = "var(--ink)";

/// The colours of a page that `chart.css` names, as a file of its own has them.
const ON_WHITE: [(&str, &str); 6] = [
    (INK, "#1d2025"),
    ("var(--quiet)", "#646a73"),
    ("var(--line)", "#e2dfd9"),
    ("var(--paper)", "#ffffff"),
    ("var(--accent)", "#b4431f"),
    ("var(--good)", "#1c7a4f"),
];

/// Room at the right of the axes, above them and below them.
const RIGHT: f64 = 40.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 52.0;

/// Width of a letter, and height of a line of them, about.
const LETTER: f64 = 7.6;
const LINE: f64 = 20.0;

/// One axis.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChartAxis<'a> {
    /// What runs along it, with its unit.
    pub label: &'a str,
    /// Whether equal ratios are equally long.
    pub logarithmic: bool,
    /// Its ends; `None` for those of the data with some room.
    pub range: Option<(f64, f64)>,
}

impl<'a> ChartAxis<'a> {
    /// An axis with equal differences equally long, as the data have it.
    #[must_use]
    pub const fn linear(label: &'a str) -> Self {
        Self {
            label,
            logarithmic: false,
            range: None,
        }
    }

    /// An axis with equal ratios equally long, as the data have it.
    #[must_use]
    pub const fn logarithmic(label: &'a str) -> Self {
        Self {
            logarithmic: true,
            ..Self::linear(label)
        }
    }
}

/// Points that belong together, as dots, as a line or as both.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend; without one it is not there.
    pub name: String,
    /// One of [`PALETTE`], [`INK`], or any that CSS knows.
    pub colour: &'static str,
    /// The points, in the order in which a line joins them.
    pub points: Vec<(f64, f64)>,
    /// A few words beside each point; may be fewer than those.
    pub labels: Vec<String>,
    /// The point that matters.
    pub marked: Option<usize>,
    /// Width of the line; 0 for none.
    pub line: f64,
    /// Radius of the dots; 0 for none.
    pub dot: f64,
    /// Whether the dots are rings.
    pub hollow: bool,
    /// Of line and dots, 0 to 1.
    pub opacity: f64,
}

impl Default for Series {
    fn default() -> Self {
        Self {
            name: String::new(),
            colour: INK,
            points: Vec::new(),
            labels: Vec::new(),
            marked: None,
            line: 0.0,
            dot: 4.0,
            hollow: false,
            opacity: 1.0,
        }
    }
}

/// The name of a row, in place of a number on the axis upwards.
#[derive(Clone, Debug)]
pub struct RowName {
    /// Its height in the data's units.
    pub y: f64,
    /// The words.
    pub text: String,
    /// Whether they are above the rows that follow.
    pub heading: bool,
}

/// What is drawn over two axes.
#[derive(Clone, Debug)]
pub struct Chart<'a> {
    /// What it shows: the heading of a file, and for those who cannot see it.
    pub title: &'a str,
    /// Lines below the heading of a file.
    pub notes: Vec<String>,
    /// Width and height in its own units; a page scales it.
    pub size: (f64, f64),
    /// The axis across.
    pub x: ChartAxis<'a>,
    /// The axis upwards.
    pub y: ChartAxis<'a>,
    /// Names of rows; if there are any, the axis upwards has no numbers.
    pub rows: Vec<RowName>,
    /// A curve that the area below is shaded of.
    pub shaded: Vec<(f64, f64)>,
    /// A height to compare with, and what it is.
    pub limit: Option<(f64, &'a str)>,
    /// The points, those drawn last above the others.
    pub series: Vec<Series>,
}

impl Default for Chart<'_> {
    fn default() -> Self {
        Self {
            title: "",
            notes: Vec::new(),
            size: (560.0, 320.0),
            x: ChartAxis::default(),
            y: ChartAxis::default(),
            rows: Vec::new(),
            shaded: Vec::new(),
            limit: None,
            series: Vec::new(),
        }
    }
}

/// Points with a name, joined by a line.
pub type ChartCurve = (String, Vec<(f64, f64)>);

/// Curves over two logarithmic axes, whose names are `x` and `y`.
#[must_use]
pub fn curves<'a>(
    title: &'a str,
    (x, y): (&'a str, &'a str),
    curves: Vec<ChartCurve>,
) -> Chart<'a> {
    let colours = PALETTE.into_iter().cycle();
    let series = curves.into_iter().zip(colours);
    let series = series.map(|((name, points), colour)| Series {
        name,
        colour,
        points,
        line: 2.0,
        ..Series::default()
    });
    Chart {
        title,
        size: (760.0, 440.0),
        x: ChartAxis::logarithmic(x),
        y: ChartAxis::logarithmic(y),
        series: series.collect(),
        ..Chart::default()
    }
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
    fn new(axis: ChartAxis<'_>, values: impl Iterator<Item = f64>, ends: (f64, f64)) -> Self {
        let drawn = values.filter(|value| has_place(axis, *value));
        let (low, high) = drawn.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        let (low, high) = match (axis.range, axis.logarithmic) {
            (Some(range), _) => range,
            (None, _) if low > high => (0.1, 10.0),
            (None, true) => (low / 1.4, high * 1.4),
            (None, false) => {
                let margin = 0.06 * (high - low).max(1e-9 * high.abs().max(1e-9));
                (low - margin, high + margin)
            }
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
            // As many as there is room for: numbers are wider than high.
            let room = (self.ends.1 - self.ends.0).abs();
            return steps(self.low, self.high, if room > 200.0 { 6 } else { 4 });
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

fn has_place(axis: ChartAxis<'_>, value: f64) -> bool {
    value.is_finite() && (value > 0.0 || !axis.logarithmic)
}

impl Chart<'_> {
    /// The chart as an element of a page, with the colours that the page has.
    #[must_use]
    pub fn render(&self) -> Markup {
        let (width, height) = self.size;
        html! {
            svg .chart viewBox=(format!("0 0 {width} {height}")) role="img" aria-label=(self.title) {
                (self.drawing(TOP))
            }
        }
    }

    /// The chart as an SVG file with its title above, on white.
    #[must_use]
    pub fn file(&self) -> String {
        let (width, height) = self.size;
        let top = 42.0 + LINE * self.notes.len() as f64;
        let svg = html! {
            svg .chart xmlns="http://www.w3.org/2000/svg" width=(width) height=(height)
                viewBox=(format!("0 0 {width} {height}")) font-family="sans-serif" {
                style { (PreEscaped(include_str!("chart.css"))) }
                rect width=(width) height=(height) fill="var(--paper)" {}
                text .title x="20" y="28" { (self.title) }
                @for (at, note) in self.notes.iter().enumerate() {
                    text x="20" y=(50.0 + LINE * at as f64) { (note) }
                }
                (self.drawing(top))
            }
        };
        let colours = ON_WHITE.iter();
        colours.fold(svg.into_string(), |svg, (name, colour)| {
            svg.replace(name, colour)
        })
    }

    /// Everything below `top`.
    fn drawing(&self, top: f64) -> Markup {
        let (width, height) = self.size;
        let names = self.rows.iter().map(|row| row.text.chars().count());
        let left = match names.max() {
            Some(longest) => 34.0 + LETTER * longest as f64,
            None => 78.0,
        };
        let (right, bottom) = (width - RIGHT, height - BOTTOM);
        let (legend, top) = self.legend((left, right), top);
        let points = || self.series.iter().flat_map(|series| &series.points);
        let points = || points().chain(&self.shaded);
        let ys = points().map(|point| point.1);
        let ys = ys.chain(self.limit.map(|(limit, _)| limit));
        let x = Scale::new(self.x, points().map(|point| point.0), (left, right));
        let y = Scale::new(self.y, ys, (bottom, top));
        let middle = (f64::midpoint(left, right), f64::midpoint(top, bottom));
        html! {
            @for (tick, place) in x.ticks().into_iter().map(|tick| (tick, at(x.place(tick)))) {
                line .grid x1=(place) x2=(place) y1=(top) y2=(bottom) {}
                text x=(place) y=(bottom + 18.0) text-anchor="middle" { (number(tick)) }
            }
            @if self.rows.is_empty() {
                @for tick in y.ticks() {
                    line .grid x1=(left) x2=(right) y1=(at(y.place(tick))) y2=(at(y.place(tick))) {}
                    text x=(left - 8.0) y=(at(y.place(tick) + 4.0)) text-anchor="end" { (number(tick)) }
                }
            }
            @for row in &self.rows {
                text .(if row.heading { "heading" } else { "axis" }) x=(if row.heading { 14 } else { 26 }) y=(at(y.place(row.y) + 4.0)) { (row.text) }
            }
            text .axis x=(at(middle.0)) y=(height - 10.0) text-anchor="middle" { (self.x.label) }
            text .axis transform=(format!("translate(18 {}) rotate(-90)", at(middle.1))) text-anchor="middle" { (self.y.label) }
            @if let (Some(first), Some(last)) = (self.shaded.first(), self.shaded.last()) {
                polygon .shaded points=(format!("{} {},{bottom} {},{bottom}", line(&self.shaded, &x, &y), at(x.place(last.0)), at(x.place(first.0)))) {}
            }
            @if let Some((limit, name)) = self.limit {
                line .limit x1=(left) x2=(right) y1=(at(y.place(limit))) y2=(at(y.place(limit))) {}
                text .note x=(right - 6.0) y=(at(y.place(limit) - 6.0)) text-anchor="end" { (name) }
            }
            @for series in &self.series { (self.drawn(series, &x, &y)) }
            @for (series, x, y) in legend {
                @if series.dot > 0.0 {
                    (circle(series, (x, y), series.dot))
                } @else {
                    line x1=(at(x - 9.0)) x2=(at(x + 9.0)) y1=(y) y2=(y) stroke=(series.colour) stroke-width=(series.line) opacity=(series.opacity) {}
                }
                text .axis x=(at(x + 14.0)) y=(y + 4.0) { (series.name) }
            }
        }
    }

    /// Where the names of the series begin, row by row above the axes; and where those may.
    fn legend(&self, (left, right): (f64, f64), top: f64) -> (Vec<(&Series, f64, f64)>, f64) {
        let named = || self.series.iter().filter(|series| !series.name.is_empty());
        let width = |series: &Series| 34.0 + LETTER * series.name.chars().count() as f64;
        let one_row = named().map(width).sum::<f64>() < right - left;
        let widest = named().map(width).fold(1.0, f64::max);
        let columns = ((right - left) / widest).floor().max(1.0) as usize;
        let mut places = Vec::new();
        let (mut x, mut y) = (left + 10.0, top + 8.0);
        for (index, series) in named().enumerate() {
            if !one_row && index > 0 && index.is_multiple_of(columns) {
                (x, y) = (left + 10.0, y + LINE);
            }
            places.push((series, x, y));
            x += if one_row { width(series) } else { widest };
        }
        let below = if places.is_empty() { top } else { y + LINE };
        (places, below)
    }

    fn drawn(&self, series: &Series, x: &Scale, y: &Scale) -> Markup {
        let points = series.points.iter().copied();
        let points = points.filter(|p| has_place(self.x, p.0) && has_place(self.y, p.1));
        let points: Vec<(f64, f64)> = points.collect();
        html! {
            @if series.line > 0.0 {
                polyline .curve points=(line(&points, x, y)) stroke=(series.colour) stroke-width=(series.line) opacity=(series.opacity) {}
            }
            @if series.dot > 0.0 {
                @for (index, point) in points.iter().enumerate() {
                    @let place = (x.place(point.0), y.place(point.1));
                    @if series.marked == Some(index) {
                        circle .marked cx=(at(place.0)) cy=(at(place.1)) r=(series.dot + 2.0) {}
                    } @else {
                        (circle(series, place, series.dot))
                    }
                    @if let Some(label) = series.labels.get(index) {
                        text .note x=(at(place.0 + 9.0)) y=(at(place.1 - 8.0)) { (label) }
                    }
                }
            }
        }
    }
}

fn circle(series: &Series, (x, y): (f64, f64), radius: f64) -> Markup {
    let (fill, stroke) = if series.hollow {
        ("none", Some(series.colour))
    } else {
        (series.colour, None)
    };
    let opacity = (series.opacity < 1.0).then_some(series.opacity);
    html! { circle cx=(at(x)) cy=(at(y)) r=(radius) fill=(fill) stroke=[stroke] opacity=[opacity] {} }
}

/// The corners of a line.
fn line(points: &[(f64, f64)], x: &Scale, y: &Scale) -> String {
    let corner = |point: &(f64, f64)| format!("{},{}", at(x.place(point.0)), at(y.place(point.1)));
    points.iter().map(corner).collect::<Vec<_>>().join(" ")
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
        let series = Series {
            points: vec![(1e-4, 0.3), (1e-2, 0.1), (0.0, 0.1), (1.0, 0.2)],
            marked: Some(1),
            line: 2.0,
            ..Series::default()
        };
        let chart = Chart {
            x: ChartAxis::logarithmic("x"),
            series: vec![series],
            ..Chart::default()
        };
        let svg = chart.render().into_string();
        let coordinates = svg.split("points=\"").nth(1).unwrap();
        let coordinates: Vec<&str> = coordinates.split('"').next().unwrap().split(' ').collect();
        // What is not above zero has no place on a logarithmic axis.
        assert_eq!(coordinates.len(), 3);
        let (width, height) = chart.size;
        for pair in coordinates {
            let (x, y) = pair.split_once(',').unwrap();
            assert!((78.0..=width - RIGHT).contains(&x.parse::<f64>().unwrap()));
            assert!((TOP..=height - BOTTOM).contains(&y.parse::<f64>().unwrap()));
        }
        assert_eq!(svg.matches("class=\"marked\"").count(), 1);
        assert!(svg.matches("class=\"grid\"").count() >= 6);
    }

    #[test]
    fn a_short_logarithmic_axis_has_ticks_between_the_powers_of_ten() {
        let scale = Scale::new(
            ChartAxis::logarithmic(""),
            [0.02, 0.09].into_iter(),
            (0.0, 1.0),
        );
        assert_eq!(scale.ticks(), [0.02, 0.05, 0.1]);
    }

    #[test]
    fn a_file_names_no_colours_of_a_page_and_has_its_legend_inside() {
        let series = |name: &str| Series {
            name: name.to_owned(),
            points: vec![(1.0, 2.0)],
            ..Series::default()
        };
        let names = [
            "a rather long name of a series",
            "another that is as long",
            "a third",
        ];
        let chart = Chart {
            title: "a <title>",
            series: names.map(series).to_vec(),
            ..Chart::default()
        };
        let svg = chart.file();
        assert!(!svg.contains("var(") && svg.contains("a &lt;title&gt;"));
        let (places, below) = chart.legend((78.0, 520.0), TOP);
        assert!(places.windows(2).all(|pair| pair[0].2 <= pair[1].2));
        assert!(places[2].2 > places[0].2 && below > places[2].2);
    }
}
