use std::error::Error;
use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;

use crate::axis::{LabelSpace, Quantity, Scale, ticks, ticks_at};

#[derive(Clone, Copy, Debug)]
pub struct PlotPoint {
    at: (f64, f64),
    bar: (f64, f64),
}

impl PlotPoint {
    pub fn new(x: f64, y: f64, bar: (f64, f64)) -> Self {
        Self { at: (x, y), bar }
    }

    #[must_use]
    pub fn over(self, by: f64) -> Self {
        Self { at: (self.at.0, self.at.1 / by), bar: (self.bar.0 / by, self.bar.1 / by) }
    }

    /// Returns `true` if the value or its bar can be drawn. A logarithmic axis excludes 0, but not the upper end of its
    /// bar.
    fn is_shown(&self, [x, y]: [Scale; 2]) -> bool {
        x.holds(self.at.0) && self.at.1.is_finite() && self.bar.0.is_finite() && y.holds(self.bar.1)
    }
}

#[derive(Clone, Debug)]
pub struct Series {
    pub name: String,
    /// In ascending order of x.
    pub points: Vec<PlotPoint>,
    pub dashed: bool,
    /// Index of a color, which related lines share.
    pub color: usize,
}

impl Series {
    fn marks(&self, scales: [Scale; 2]) -> impl Iterator<Item = PlotPoint> + Clone {
        self.points.iter().copied().filter(move |mark| mark.is_shown(scales))
    }

    fn color(&self) -> RGBColor {
        COLORS[self.color % COLORS.len()]
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Axes<'a> {
    pub title: &'a str,
    pub x: (&'a str, Quantity),
    pub y: (&'a str, Quantity),
    pub scales: [Scale; 2],
}

const SIZE: (u32, u32) = (1120, 600);
/// Fits the longest name.
const LEGEND_WIDTH: u32 = 320;
const FONT: &str = "sans-serif";
const TITLE_SIZE: u32 = 27;
const LABEL_SIZE: u32 = 22;
const NAME_SIZE: u32 = 19;
const MARGIN: u32 = 12;
const X_LABEL_HEIGHT: u32 = 64;
const Y_LABEL_WIDTH: u32 = 110;
const COLORS: [RGBColor; 10] = [
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
const GRID: RGBColor = RGBColor(225, 225, 225);

/// Longer series are lines without circles.
const MAX_CIRCLES: usize = 50;

/// Draws the plot as SVG; returns `None` without points.
pub fn lines(axes: &Axes<'_>, series: &[Series]) -> Result<Option<String>, Box<dyn Error>> {
    let scales = axes.scales;
    let marks = || series.iter().flat_map(|line| line.marks(scales));
    if marks().next().is_none() {
        return Ok(None);
    }
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let root = root.titled(axes.title, (FONT, TITLE_SIZE))?;
        let (area, legend) = root.split_horizontally(SIZE.0 - LEGEND_WIDTH);
        let measured: Vec<f64> = marks().map(|mark| mark.at.0).collect();
        let x = range(scales[0], measured.iter().copied());
        let heights = marks().flat_map(|mark| [mark.at.1, mark.bar.0, mark.bar.1]);
        let y = range(scales[1], heights.filter(|&value| scales[1].holds(value)));
        let bottom = y.start;
        let (width, height) = area.dim_in_pixel();
        let (x_space, y_space) = (x_label_space(width, scales[0]), y_label_space(height, scales[1]));
        let (at_x, at_y) = (ticks_at(&measured, &x, axes.x.1, x_space), ticks(&y, axes.y.1, y_space));
        let mut chart = ChartBuilder::on(&area)
            .margin(MARGIN)
            .x_label_area_size(X_LABEL_HEIGHT)
            .y_label_area_size(Y_LABEL_WIDTH)
            .build_cartesian_2d(
                AxisTicks { scale: scales[0], range: x, ticks: at_x },
                AxisTicks { scale: scales[1], range: y, ticks: at_y },
            )?;
        let (x_label, y_label) = (|value: &f64| axes.x.1.label(*value), |value: &f64| axes.y.1.label(*value));
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(axes.x.0).y_desc(axes.y.0).x_label_formatter(&x_label).y_label_formatter(&y_label);
        mesh.label_style((FONT, LABEL_SIZE))
            .axis_desc_style((FONT, LABEL_SIZE))
            .bold_line_style(GRID)
            .draw()?;
        let drawn = series.iter().filter(|line| line.marks(scales).next().is_some());
        for (row, line) in (0..).zip(drawn) {
            let color = line.color();
            let marks = || line.marks(scales);
            let points = || marks().map(|mark| mark.at).filter(|at| scales[1].holds(at.1));
            let bar = |PlotPoint { at: (x, _), bar: (low, high) }| {
                let low = if scales[1].holds(low) { low } else { bottom };
                PathElement::new([(x, low), (x, high)], color.mix(0.35).stroke_width(5))
            };
            chart.draw_series(marks().filter(|mark| mark.bar.0 < mark.bar.1).map(bar))?;
            if line.dashed {
                chart.draw_series(DashedLineSeries::new(points(), 6, 4, color.stroke_width(2)))?;
            } else {
                chart.draw_series(LineSeries::new(points(), color.stroke_width(2)))?;
            }
            if points().count() <= MAX_CIRCLES {
                chart.draw_series(points().map(|p| Circle::new(p, 3, color.filled())))?;
            }
            draw_legend_entry(&legend, row, line)?;
        }
        root.present()?;
    }
    Ok(Some(svg))
}

fn draw_legend_entry<B: DrawingBackend>(
    legend: &DrawingArea<B, plotters::coord::Shift>,
    row: i32,
    line: &Series,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let (color, middle) = (line.color(), 24 + 24 * row);
    let gap = if line.dashed { 5 } else { 0 };
    legend.draw(&PathElement::new([(0, middle), (9 - gap, middle)], color.stroke_width(2)))?;
    legend.draw(&PathElement::new([(9 + gap, middle), (18, middle)], color.stroke_width(2)))?;
    legend.draw(&Text::new(line.name.clone(), (24, middle - NAME_SIZE as i32 / 2), (FONT, NAME_SIZE)))
}

fn x_label_space(width: u32, scale: Scale) -> LabelSpace {
    let text = f64::from(LABEL_SIZE);
    LabelSpace {
        axis: f64::from(width - 2 * MARGIN - Y_LABEL_WIDTH),
        gap: 0.8 * text,
        character: 0.48 * text,
        scale,
    }
}

fn y_label_space(height: u32, scale: Scale) -> LabelSpace {
    LabelSpace {
        axis: f64::from(height - 2 * MARGIN - X_LABEL_HEIGHT),
        gap: 1.5 * f64::from(LABEL_SIZE),
        character: 0.0,
        scale,
    }
}

struct AxisTicks {
    scale: Scale,
    range: Range<f64>,
    ticks: Vec<f64>,
}

impl Ranged for AxisTicks {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let [low, at, high] =
            [self.range.start, *value, self.range.end].map(|value| self.scale.position(value));
        let fraction = (at - low) / (high - low);
        limit.0 + (fraction * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

/// Begins a linear axis of non-negative values at 0.
fn range(scale: Scale, values: impl Iterator<Item = f64>) -> Range<f64> {
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.fold(ends, |(low, high), v| (low.min(v), high.max(v)));
    match scale {
        Scale::Logarithmic => low / 1.3..high * 1.3,
        Scale::Linear => {
            let low = low.min(0.0);
            let space = if high > low { 0.03 * (high - low) } else { 1.0 };
            (if low < 0.0 { low - space } else { 0.0 })..high + space
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_on_a_logarithmic_axis_is_its_bar() {
        let number = |title| (title, Quantity::Number);
        let scales = [Scale::Linear, Scale::Logarithmic];
        let axes = Axes { title: "", x: number("x"), y: number("y"), scales };
        let drawn = |points: Vec<PlotPoint>| {
            let series = Series { name: String::new(), points, dashed: false, color: 0 };
            lines(&axes, &[series]).unwrap().map(|svg| {
                let bars = svg.matches("stroke-width=\"5\"").count();
                (svg.matches("<circle").count(), bars)
            })
        };
        let [with_bar, without_bar] =
            [PlotPoint::new(0.0, 0.1, (0.05, 0.2)), PlotPoint::new(1.0, 0.0, (0.0, 0.02))];
        assert_eq!(drawn(vec![with_bar, without_bar]), Some((1, 2)));
        assert_eq!(drawn(vec![without_bar]), Some((0, 1)));
        assert_eq!(drawn(vec![PlotPoint::new(1.0, 0.0, (0.0, 0.0))]), None);
    }
}
