//! Plots: both axes logarithmic, one line per engine.

use std::error::Error;
use std::ops::Range;

use plotters::prelude::*;

/// A point of a line, with a bar for how far it scatters.
#[derive(Clone, Copy)]
pub(super) struct Mark {
    at: (f64, f64),
    bar: (f64, f64),
}

impl Mark {
    pub(super) fn new(x: f64, y: f64, bar: (f64, f64)) -> Self {
        Self { at: (x, y), bar }
    }

    /// Whether it has a place on logarithmic axes.
    fn is_shown(&self) -> bool {
        [self.at.0, self.at.1, self.bar.0, self.bar.1].into_iter().all(|v| v.is_finite() && v > 0.0)
    }
}

/// A line of a plot.
pub(super) struct Series {
    pub(super) name: String,
    pub(super) points: Vec<Mark>,
    pub(super) dashed: bool,
    /// Which colour; lines that belong together share one.
    pub(super) colour: usize,
}

impl Series {
    fn marks(&self) -> impl Iterator<Item = Mark> + Clone {
        self.points.iter().copied().filter(Mark::is_shown)
    }

    fn colour(&self) -> RGBColor {
        COLOURS[self.colour % COLOURS.len()]
    }
}

/// What a plot shows.
pub(super) struct Axes<'a> {
    pub(super) title: &'a str,
    pub(super) x: &'a str,
    pub(super) y: &'a str,
}

const SIZE: (u32, u32) = (1080, 520);
/// Width of the legend beside the plot, enough for the longest name.
const LEGEND: u32 = 270;
const COLOURS: [RGBColor; 10] = [
    RGBColor(31, 119, 180),
    RGBColor(214, 39, 40),
    RGBColor(44, 160, 44),
    RGBColor(255, 127, 14),
    RGBColor(148, 103, 189),
    RGBColor(140, 86, 75),
    RGBColor(227, 119, 194),
    RGBColor(23, 190, 207),
    RGBColor(188, 189, 34),
    RGBColor(90, 90, 90),
];

/// The plot as SVG; none where no series has a point.
///
/// # Errors
/// Where the drawing fails.
pub(super) fn lines(axes: &Axes<'_>, series: &[Series]) -> Result<Option<String>, Box<dyn Error>> {
    let marks = || series.iter().flat_map(Series::marks);
    if marks().next().is_none() {
        return Ok(None);
    }
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let (area, beside) = root.split_horizontally(SIZE.0 - LEGEND);
        let (x, y) =
            (range(marks().map(|m| m.at.0)), range(marks().flat_map(|m| [m.at.1, m.bar.0, m.bar.1])));
        let mut chart = ChartBuilder::on(&area)
            .caption(axes.title, ("sans-serif", 20))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(84)
            .build_cartesian_2d(x.log_scale(), y.log_scale())?;
        let number = |value: &f64| value.to_string();
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(axes.x).y_desc(axes.y).x_label_formatter(&number).y_label_formatter(&number);
        mesh.light_line_style(WHITE).draw()?;
        let drawn = series.iter().filter(|line| line.marks().next().is_some());
        for (row, line) in (0..).zip(drawn) {
            let colour = line.colour();
            let points = || line.marks().map(|mark| mark.at);
            let bar = |Mark { at: (x, _), bar: (low, high) }| {
                PathElement::new([(x, low), (x, high)], colour.mix(0.35).stroke_width(5))
            };
            chart.draw_series(line.marks().map(bar))?;
            if line.dashed {
                chart.draw_series(DashedLineSeries::new(points(), 6, 4, colour.stroke_width(2)))?;
            } else {
                chart.draw_series(LineSeries::new(points(), colour.stroke_width(2)))?;
            }
            chart.draw_series(points().map(|p| Circle::new(p, 3, colour.filled())))?;
            let middle = 50 + 20 * row;
            let (gap, ends) = (if line.dashed { 5 } else { 0 }, [(0, middle), (18, middle)]);
            beside.draw(&PathElement::new([ends[0], (9 - gap, middle)], colour.stroke_width(2)))?;
            beside.draw(&PathElement::new([(9 + gap, middle), ends[1]], colour.stroke_width(2)))?;
            beside.draw(&Text::new(line.name.clone(), (24, middle - 7), ("sans-serif", 13)))?;
        }
        root.present()?;
    }
    Ok(Some(svg))
}

/// The values' range with a little room, more than a point.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    low / 1.3..high * 1.3
}
