//! Charts as SVG files.

use iltm_picture::numbers::decades;
use plotters::coord::Shift;
use plotters::coord::combinators::{BindKeyPoints, LogCoord, WithKeyPoints};
use plotters::prelude::*;
use std::ops::Range;

/// A drawing that cannot be made; the backend writes to memory, so it is the range of
/// an axis.
pub(super) type ChartError = Box<dyn std::error::Error + Send + Sync>;

const SIZE: (u32, u32) = (760, 440);
const FONT: &str = "sans-serif";

/// Colours that people tell apart, whatever they see of colours (Okabe, Ito, 2008).
pub(super) const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];

/// Colour of a region.
const SHADE: RGBColor = COLOURS[2];

/// A line, dots or intervals with a name.
#[derive(Clone, Debug)]
pub(super) struct Series {
    pub(super) name: String,
    pub(super) points: Vec<(f64, f64)>,
    /// Whether a line joins the points.
    pub(super) joined: bool,
}

/// Words of a chart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Words<'w> {
    pub(super) title: &'w str,
    pub(super) x: &'w str,
    pub(super) y: &'w str,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Points and lines over two logarithmic axes.
pub(super) fn logarithmic(words: Words<'_>, series: &[Series]) -> Result<String, ChartError> {
    let all = || series.iter().flat_map(|series| series.points.iter());
    let axes = (
        around(all().map(|point| point.0)),
        around(all().map(|point| point.1)),
    );
    lines(words, axes, None, series)
}

/// The same with the area under a curve shaded, over axes that are given.
pub(super) fn region(
    words: Words<'_>,
    axes: (Range<f64>, Range<f64>),
    border: &[(f64, f64)],
    series: &[Series],
) -> Result<String, ChartError> {
    lines(words, axes, Some(border), series)
}

fn lines(
    words: Words<'_>,
    (x, y): (Range<f64>, Range<f64>),
    shaded: Option<&[(f64, f64)]>,
    series: &[Series],
) -> Result<String, ChartError> {
    sized(SIZE, |area| {
        let base = y.start;
        let mut chart = ChartBuilder::on(area)
            .caption(words.title, (FONT, 19))
            .margin(14)
            .x_label_area_size(44)
            .y_label_area_size(66)
            .build_cartesian_2d(logarithmic_axis(x), logarithmic_axis(y))?;
        chart
            .configure_mesh()
            .x_desc(words.x)
            .y_desc(words.y)
            .label_style((FONT, 14))
            .axis_desc_style((FONT, 15))
            .x_label_formatter(&label)
            .y_label_formatter(&label)
            .light_line_style(BLACK.mix(0.04))
            .bold_line_style(BLACK.mix(0.12))
            .draw()?;
        if let Some(border) = shaded {
            let border = border.iter().copied();
            chart.draw_series(AreaSeries::new(border, base, SHADE.mix(0.22)))?;
        }
        for (index, series) in series.iter().enumerate() {
            let colour = COLOURS[index % COLOURS.len()];
            let dots = series.points.iter();
            let dots = dots.map(|point| Circle::new(*point, 4, colour.filled()));
            chart
                .draw_series(dots)?
                .label(series.name.clone())
                .legend(move |(x, y)| Circle::new((x + 9, y), 4, colour.filled()));
            if series.joined {
                let points = series.points.iter().copied();
                chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
            }
        }
        // Where there is a region it is at the left, and what is outside it at the right.
        let place = match shaded {
            Some(_) => SeriesLabelPosition::Coordinate(243, 6),
            None => SeriesLabelPosition::UpperLeft,
        };
        chart
            .configure_series_labels()
            .position(place)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.2))
            .label_font((FONT, 14))
            .draw()?;
        Ok(())
    })
}

/// One interval: what it belongs to, its middle and its ends.
#[derive(Clone, Debug)]
pub(super) struct Interval {
    pub(super) label: String,
    /// Which of [`COLOURS`].
    pub(super) colour: usize,
    pub(super) low: f64,
    pub(super) middle: f64,
    pub(super) high: f64,
    /// Every value, drawn as faint dots.
    pub(super) values: Vec<f64>,
}

/// Groups of intervals, each under its heading, one below the other over a logarithmic
/// axis.
pub(super) fn intervals(
    words: Words<'_>,
    groups: &[(&str, Vec<Interval>)],
) -> Result<String, ChartError> {
    const ROW: u32 = 21;
    let all = || groups.iter().flat_map(|(_, rows)| rows);
    let x = around(all().flat_map(|row| row.values.iter().copied()));
    let lines = groups.len() + all().count();
    sized((SIZE.0, 100 + ROW * lines as u32), |area| {
        let mut chart = ChartBuilder::on(area)
            .caption(words.title, (FONT, 19))
            .margin(14)
            .x_label_area_size(44)
            .y_label_area_size(160)
            .build_cartesian_2d(logarithmic_axis(x), -(lines as f64)..0.0)?;
        chart
            .configure_mesh()
            .x_desc(words.x)
            .label_style((FONT, 14))
            .axis_desc_style((FONT, 15))
            .x_label_formatter(&label)
            .disable_y_mesh()
            .y_labels(0)
            .light_line_style(BLACK.mix(0.04))
            .bold_line_style(BLACK.mix(0.12))
            .draw()?;
        let mut line = 0;
        let mut next = || {
            line += 1;
            0.5 - f64::from(line)
        };
        for (heading, rows) in groups {
            let y = next();
            let height = chart
                .backend_coord(&(rows.first().map_or(1.0, |r| r.middle), y))
                .1;
            let style = (FONT, 14, FontStyle::Bold).into_font().color(&BLACK);
            area.draw(&Text::new((*heading).to_owned(), (14, height - 7), style))?;
            for row in rows {
                let y = next();
                let colour = COLOURS[row.colour % COLOURS.len()];
                let faint = row.values.iter();
                let faint = faint.map(|x| Circle::new((*x, y), 3, colour.mix(0.25).filled()));
                chart.draw_series(faint)?;
                let interval = [(row.low, y), (row.high, y)];
                chart.draw_series(LineSeries::new(interval, colour.stroke_width(3)))?;
                chart.draw_series([Circle::new((row.middle, y), 4, colour.filled())])?;
                let height = chart.backend_coord(&(row.middle, y)).1;
                let style = (FONT, 14).into_font().color(&BLACK);
                area.draw(&Text::new(row.label.clone(), (26, height - 7), style))?;
            }
        }
        Ok(())
    })
}

/// A logarithmic axis with ticks at powers of ten, or at 1, 2 and 5 times those where
/// there are few.
fn logarithmic_axis(range: Range<f64>) -> WithKeyPoints<LogCoord<f64>> {
    let mut ticks = decades(range.start, range.end);
    if ticks.len() < 3 {
        let below = decades(range.start / 10.0, range.end);
        let finer = below
            .into_iter()
            .flat_map(|power| [1.0, 2.0, 5.0].map(|f| f * power));
        ticks = finer.filter(|value| range.contains(value)).collect();
    }
    range.log_scale().with_key_points(ticks)
}

fn sized(
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> Result<(), ChartError>,
) -> Result<String, ChartError> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        area.fill(&WHITE)?;
        draw(&area)?;
        area.present()?;
    }
    Ok(svg)
}

/// A range with a little room on either side of positive values.
fn around(values: impl Iterator<Item = f64>) -> Range<f64> {
    let positive = values.filter(|value| *value > 0.0 && value.is_finite());
    let (low, high) = positive.fold((f64::INFINITY, 0.0_f64), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    if low > high {
        return 0.1..10.0;
    }
    low / 1.4..high * 1.4
}

#[allow(clippy::trivially_copy_pass_by_ref)] // plotters wants a reference.
fn label(value: &f64) -> String {
    iltm_picture::numbers::number(*value)
}
