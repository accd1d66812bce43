use super::super::row::Row;
use super::table::engines;
use lazygrid_report::plot::{Axes, PlotPoint, Series};
use lazygrid_report::{Quantity, Scale};

pub(super) fn logarithmic<'a>(title: &'a str, x: (&'a str, Quantity), y: (&'a str, Quantity)) -> Axes<'a> {
    Axes { scales: [Scale::Logarithmic; 2], title, x, y }
}

pub(super) fn curves(
    rows: &[&Row],
    point: impl Fn(&Row) -> PlotPoint,
    is_dashed: impl Fn(&str) -> bool,
) -> Vec<Series> {
    let curve = |(color, engine): (usize, &str)| {
        let timed = rows.iter().filter(|row| row.engine == engine && !row.wall.is_empty());
        let points = timed.map(|row| point(row)).collect();
        Series { name: engine.to_owned(), points, dashed: is_dashed(engine), color }
    };
    engines(rows).into_iter().enumerate().map(curve).collect()
}
