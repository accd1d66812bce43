//! Plots: both axes logarithmic, one line per engine.

use std::error::Error;
use std::ops::Range;

use plotters::prelude::*;

/// A line of a plot.
pub(super) struct Series {
    pub(super) name: String,
    pub(super) points: Vec<(f64, f64)>,
    pub(super) dashed: bool,
}

/// What a plot shows.
pub(super) struct Axes<'a> {
    pub(super) title: &'a str,
    pub(super) x: &'a str,
    pub(super) y: &'a str,
}

const SIZE: (u32, u32) = (900, 520);
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
    let positive = |v: f64| v.is_finite() && v > 0.0;
    let points = || series.iter().flat_map(|s| &s.points).filter(|p| positive(p.0) && positive(p.1));
    if points().next().is_none() {
        return Ok(None);
    }
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let (x, y) = (range(points().map(|p| p.0)), range(points().map(|p| p.1)));
        let mut chart = ChartBuilder::on(&root)
            .caption(axes.title, ("sans-serif", 20))
            .margin(12)
            .margin_right(24)
            .x_label_area_size(44)
            .y_label_area_size(76)
            .build_cartesian_2d(x.log_scale(), y.log_scale())?;
        chart.configure_mesh().x_desc(axes.x).y_desc(axes.y).light_line_style(WHITE).draw()?;
        for (k, line) in series.iter().enumerate() {
            let colour = COLOURS[k % COLOURS.len()];
            let points = || line.points.iter().copied().filter(|p| positive(p.0) && positive(p.1));
            if points().next().is_none() {
                continue;
            }
            if line.dashed {
                chart.draw_series(DashedLineSeries::new(points(), 6, 4, colour.stroke_width(2)))?;
            } else {
                chart.draw_series(LineSeries::new(points(), colour.stroke_width(2)))?;
            }
            chart
                .draw_series(points().map(|p| Circle::new(p, 3, colour.filled())))?
                .label(&line.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.3))
            .draw()?;
        root.present()?;
    }
    Ok(Some(svg))
}

/// The values' range with a little room, more than a point.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    low / 1.3..high * 1.3
}
