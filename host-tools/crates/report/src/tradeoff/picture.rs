//! Error against instructions, as an SVG picture.

use super::{Point, Sweep, Tradeoff};
use iltm_compile::cost::{BUDGET, CLOCK, RATE};
use plotters::coord::Shift;
use plotters::coord::combinators::IntoLogRange;
use plotters::prelude::*;
use std::ops::Range;

/// Width and height, pixels.
const SIZE: (u32, u32) = (960, 640);

/// Letters that all systems have.
const FONT: &str = "sans-serif";

/// Ink of words and axes, and of grid lines.
const INK: RGBColor = RGBColor(29, 32, 37);
const FAINT: RGBColor = RGBColor(226, 223, 217);

type Failure<'a> = DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>;

/// A sweep's colour: those of Okabe and Ito, which colour-blind people can tell apart.
pub(super) const fn colour(sweep: Sweep) -> RGBColor {
    match sweep {
        Sweep::Table => RGBColor(29, 32, 37),
        Sweep::Tiers => RGBColor(120, 126, 135),
        Sweep::Photographs => RGBColor(0, 114, 178),
        Sweep::Solver => RGBColor(213, 94, 0),
        Sweep::Bits => RGBColor(204, 121, 167),
        Sweep::Grid => RGBColor(0, 158, 115),
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
    /// The picture; `None` if there is nothing to draw.
    #[must_use]
    pub fn svg(&self) -> Option<String> {
        let drawn = self.points.iter().filter(|point| {
            point.predicted.is_finite() && point.predicted > 0.0 && point.instructions > 0
        });
        let drawn: Vec<&Point> = drawn.collect();
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
            self.draw(&root, &drawn).ok()??;
            root.present().ok()?;
        }
        Some(text)
    }

    fn draw<'b>(
        &self,
        root: &DrawingArea<SVGBackend<'b>, Shift>,
        drawn: &[&Point],
    ) -> Result<Option<()>, Failure<'b>> {
        root.fill(&WHITE)?;
        let Some((x, y)) = ranges(drawn) else {
            return Ok(None);
        };
        let what = if self.scene.is_empty() {
            &self.name
        } else {
            &self.scene
        };
        let words = |size: i32| (FONT, size).into_font().color(&INK);
        root.draw(&Text::new(
            format!("What accuracy costs: {what}"),
            (24, 16),
            words(22),
        ))?;
        for (line, advice) in (0..).zip(wrapped(&self.advice(), 128)) {
            root.draw(&Text::new(advice, (24, 46 + 18 * line), words(14)))?;
        }
        let mut chart = ChartBuilder::on(root)
            .margin_top(92)
            .margin_right(28)
            .x_label_area_size(52)
            .y_label_area_size(72)
            .margin_left(22)
            .build_cartesian_2d(x.clone().log_scale(), y.clone().log_scale())?;
        let share = |x: &f64| format!("{:.0} k", x / 1e3);
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .bold_line_style(FAINT)
            .axis_style(INK)
            .x_labels(10)
            .y_labels(8)
            .x_label_formatter(&share)
            .y_label_formatter(&|error| percent(*error))
            .x_desc(format!(
                "instructions a frame on the reference board (a {RATE} Hz frame on a {} MHz part has {:.1} million)",
                CLOCK / 1_000_000,
                BUDGET as f64 / 1e6
            ))
            .y_desc("predicted error, relative")
            .label_style(words(13))
            .axis_desc_style(words(14))
            .draw()?;
        let step = 1.0 / 255.0;
        if y.contains(&step) {
            let level = [(x.start, step), (x.end, step)];
            chart.draw_series(DashedLineSeries::new(
                level,
                6,
                5,
                INK.mix(0.5).stroke_width(1),
            ))?;
        }
        let front = front_line(drawn);
        chart
            .draw_series(LineSeries::new(front, INK.mix(0.18).stroke_width(9)))?
            .label("Pareto front")
            .legend(|(x, y)| {
                PathElement::new([(x, y), (x + 18, y)], INK.mix(0.18).stroke_width(9))
            });
        for sweep in Sweep::ALL.into_iter().rev() {
            Self::draw_sweep(&mut chart, sweep, drawn)?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .label_font(words(13))
            .background_style(WHITE.mix(0.85))
            .border_style(FAINT)
            .draw()?;
        Ok(Some(()))
    }

    fn draw_sweep<'b>(
        chart: &mut Plot<'_, 'b>,
        sweep: Sweep,
        drawn: &[&Point],
    ) -> Result<(), Failure<'b>> {
        let colour = colour(sweep);
        let own: Vec<&&Point> = drawn.iter().filter(|point| point.sweep == sweep).collect();
        for curve in own.chunk_by(|a, b| a.setting == b.setting && sweep != Sweep::Tiers) {
            let line = curve.iter().map(|point| place(point));
            let width = if sweep == Sweep::Table { 2 } else { 1 };
            if sweep != Sweep::Tiers {
                let style = colour.mix(if sweep == Sweep::Bits { 0.25 } else { 0.7 });
                chart.draw_series(LineSeries::new(line, style.stroke_width(width)))?;
            }
        }
        let radius = if sweep == Sweep::Table { 5 } else { 3 };
        let hollow = sweep == Sweep::Bits;
        let style = if hollow {
            colour.stroke_width(1)
        } else {
            colour.filled()
        };
        let series = chart.draw_series(
            own.iter()
                .map(|point| Circle::new(place(point), radius, style)),
        )?;
        if !own.is_empty() {
            series
                .label(title(sweep))
                .legend(move |(x, y)| Circle::new((x + 9, y), radius, style));
        }
        if sweep == Sweep::Table {
            let label = |point: &&&Point| {
                let (x, y) = place(point);
                let name = point.tier.to_string();
                EmptyElement::at((x, y))
                    + Text::new(name, (7, -17), (FONT, 14).into_font().color(&INK))
            };
            chart.draw_series(own.iter().map(label))?;
        }
        Ok(())
    }
}

type Plot<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<
        plotters::coord::combinators::LogCoord<f64>,
        plotters::coord::combinators::LogCoord<f64>,
    >,
>;

fn place(point: &Point) -> (f64, f64) {
    (point.instructions as f64, point.predicted)
}

/// A tick's error, without digits that say nothing.
fn percent(error: f64) -> String {
    let text = format!("{:.4}", 100.0 * error);
    format!("{} %", text.trim_end_matches('0').trim_end_matches('.'))
}

/// Both axes with some room; `None` of no points.
fn ranges(drawn: &[&Point]) -> Option<(Range<f64>, Range<f64>)> {
    let range = |of: fn(&Point) -> f64| {
        let values = drawn.iter().map(|point| of(point));
        let (low, high) = (
            values.clone().fold(f64::INFINITY, f64::min),
            values.fold(0.0, f64::max),
        );
        (low <= high).then_some(low / 1.25..high * 1.4)
    };
    Some((
        range(|point| point.instructions as f64)?,
        range(|point| point.predicted)?,
    ))
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
        let (near, far) = (900_000.0, 1_800_000.0);
        assert_eq!(front_line(&drawn), [(near, 0.5), (far, 0.5), (far, 0.25)]);
    }
}
