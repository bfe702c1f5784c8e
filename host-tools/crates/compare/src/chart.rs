//! Charts of intervals for the paper's experiments, over a logarithmic axis.

use iltm_picture::chart::{Chart, ChartAxis, RowName, Series};

/// Width of a chart.
const WIDTH: f64 = 760.0;

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
        size: (WIDTH, 110.0 + ROW * rows.len() as f64),
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
