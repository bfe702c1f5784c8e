//! Charts of the paper's experiments, over logarithmic axes.

use iltm_picture::chart::{Chart, ChartAxis, PALETTE, RowName, Series};

/// Width and height.
const SIZE: (f64, f64) = (760.0, 440.0);

/// Points with a name, joined by a line.
pub(super) type ChartCurve = (String, Vec<(f64, f64)>);

/// Curves over two logarithmic axes.
pub(super) fn curves<'w>(
    title: &'w str,
    (x, y): (&'w str, &'w str),
    curves: Vec<ChartCurve>,
) -> Chart<'w> {
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
        size: SIZE,
        x: ChartAxis::logarithmic(x),
        y: ChartAxis::logarithmic(y),
        series: series.collect(),
        ..Chart::default()
    }
}

/// One interval: what it belongs to, its middle and its ends.
#[derive(Clone, Debug)]
pub(super) struct Interval {
    pub(super) label: String,
    pub(super) colour: &'static str,
    pub(super) low: f64,
    pub(super) middle: f64,
    pub(super) high: f64,
    /// Every value, drawn as faint dots.
    pub(super) values: Vec<f64>,
}

/// Groups of intervals, each under its heading, one below the other over a logarithmic
/// axis.
pub(super) fn intervals<'w>(
    title: &'w str,
    x: &'w str,
    groups: impl IntoIterator<Item = (&'static str, Vec<Interval>)>,
) -> Chart<'w> {
    const ROW: f64 = 21.0;
    let (mut rows, mut series) = (Vec::new(), Vec::new());
    for (heading, intervals) in groups {
        let mut row = |text: String, heading| {
            let y = -(rows.len() as f64) - 0.5;
            rows.push(RowName { y, text, heading });
            y
        };
        row(heading.to_owned(), true);
        for interval in intervals {
            let y = row(interval.label, false);
            let of = |points: Vec<f64>| Series {
                colour: interval.colour,
                points: points.into_iter().map(|x| (x, y)).collect(),
                ..Series::default()
            };
            series.push(Series {
                dot: 3.0,
                opacity: 0.25,
                ..of(interval.values)
            });
            series.push(Series {
                line: 3.0,
                dot: 0.0,
                ..of(vec![interval.low, interval.high])
            });
            series.push(of(vec![interval.middle]));
        }
    }
    Chart {
        title,
        size: (SIZE.0, 110.0 + ROW * rows.len() as f64),
        x: ChartAxis::logarithmic(x),
        y: ChartAxis {
            range: Some((-(rows.len() as f64), 0.0)),
            ..ChartAxis::default()
        },
        rows,
        series,
        ..Chart::default()
    }
}
