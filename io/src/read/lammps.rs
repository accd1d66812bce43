//! LAMMPS text dumps (`dump custom`) of any number of frames.
//!
//! Positions are `x y z`, unwrapped `xu yu zu`, or box fractions `xs ys zs` and `xsu ysu zsu`; sizes `radius`
//! or `diameter`; species `type`, else `element`; groups `mol`. An axis is periodic if `BOX BOUNDS` says
//! `pp`.

use lazygrid::{Space, short};

use super::cell::SimulationCell;
use super::columns::{Column, Columns, Row};
use super::line::{Line, rule_of};
use super::lines::Lines;
use super::read_context::ReadContext;
use super::rows::{AnnouncedRows, Table};
use super::source::Source;
use super::{Frame, MAX_RESERVED_SPHERES};
use crate::error::{Error, Location};

pub(super) struct Lammps {
    pub(super) lines: Lines,
}

#[derive(Default)]
struct Head {
    begun: bool,
    step: Option<i64>,
    atoms: Option<u64>,
    bounds: Option<Bounds>,
}

struct Bounds {
    corner: [f64; 3],
    cell: SimulationCell,
    location: Location,
}

impl Lammps {
    pub(super) fn new(source: Source) -> Self {
        Self { lines: Lines::new(source) }
    }

    pub(super) fn next_frame(&mut self, context: &mut ReadContext) -> Result<Option<Frame>, Error> {
        let mut head = Head::default();
        while let Some(line) = self.lines.next()? {
            head.begun = true;
            match line.bytes.strip_prefix(b"ITEM: ").map(<[u8]>::trim_ascii) {
                Some(b"TIMESTEP") => head.step = Some(self.step()?),
                Some(b"NUMBER OF ATOMS") => head.atoms = Some(self.atoms()?),
                Some(b"UNITS" | b"TIME") => drop(self.head_line()?),
                Some(item) if item.starts_with(b"BOX BOUNDS") => {
                    let (style, location) = (Style::from_item(item), line.location());
                    let periodic = match context.space {
                        None => periodic(line, style.flags(item))?,
                        Some(_) => [false; 3],
                    };
                    head.bounds = Some(self.bounds(style, periodic, location)?);
                }
                Some(item) if item.starts_with(b"ATOMS") => {
                    let Some(atoms) = head.atoms else {
                        return Err(line.unexpected("ITEM: NUMBER OF ATOMS before the atoms"));
                    };
                    let columns = columns(line, context)?;
                    if columns.has(Column::Scaled(0)) && head.bounds.is_none() {
                        return Err(line.unexpected("ITEM: BOX BOUNDS before scaled coordinates"));
                    }
                    return self.atoms_of(head, atoms, columns, context).map(Some);
                }
                _ => return Err(line.unexpected("ITEM: TIMESTEP, NUMBER OF ATOMS, BOX BOUNDS or ATOMS")),
            }
        }
        match head.begun {
            true => Err(Error::Truncated {
                location: self.lines.location(),
                what: "frame heads",
                found: 0,
                expected: 1,
            }),
            false => Ok(None),
        }
    }

    fn atoms_of(
        &mut self,
        head: Head,
        atoms: u64,
        columns: Columns,
        context: &mut ReadContext,
    ) -> Result<Frame, Error> {
        let space = match (context.space, &head.bounds) {
            (Some(space), _) => space,
            (None, Some(bounds)) => bounds.cell.space(&bounds.location, context.doubles)?,
            (None, None) => Space::UNBOUNDED,
        };
        let mut frame = Frame {
            step: head.step,
            space,
            ..Frame::with_capacity(atoms.min(MAX_RESERVED_SPHERES), context)
        };
        let scaled = columns.has(Column::Scaled(0));
        let table = Atoms { columns, scale: head.bounds.filter(|_| scaled) };
        self.lines.rows(&table, AnnouncedRows { what: "atoms", count: atoms }, context, &mut frame)?;
        Ok(frame)
    }

    fn head_line(&mut self) -> Result<Line<'_>, Error> {
        self.lines.required("lines of the frame's head", 0, 1)
    }

    fn step(&mut self) -> Result<i64, Error> {
        let line = self.head_line()?;
        lexical_core::parse(line.bytes.trim_ascii())
            .map_err(|_| line.unexpected("the time step, a whole number"))
    }

    fn atoms(&mut self) -> Result<u64, Error> {
        self.head_line()?.count("the number of atoms")
    }

    fn bounds(&mut self, style: Style, periodic: [bool; 3], location: Location) -> Result<Bounds, Error> {
        const RULE: &str = "the high bound of an axis must not be less than the low one, which comes first";
        let mut rows = [[0.0; 4]; 3];
        let mut locations = [(); 3].map(|()| location.clone());
        for (row, location) in rows.iter_mut().zip(&mut locations) {
            let line = self.head_line()?;
            *location = line.location();
            let mut words = line.words();
            for value in &mut row[..style.width()] {
                let word = words.next().ok_or_else(|| line.unexpected(style.expected()))?;
                *value = line.number("box bound", word)?;
            }
            if words.next().is_some() {
                return Err(line.unexpected(style.expected()));
            }
            let [low, high, ..] = *row;
            if !matches!(style, Style::CellVectors) && high < low {
                return Err(line.refuse("high", short(high).as_bytes(), RULE));
            }
        }
        let (corner, vectors) = style.box_of(rows);
        if let Some(axis) = (0..3).find(|&axis| matches!(style, Style::Tilted) && vectors[axis][axis] < 0.0) {
            let (column, value) =
                ("high without the tilts".to_owned(), short(corner[axis] + vectors[axis][axis]));
            return Err(Error::Value { location: locations[axis].clone(), column, value, rule: RULE });
        }
        Ok(Bounds { corner, cell: SimulationCell { vectors, periodic }, location })
    }
}

struct Atoms {
    columns: Columns,
    scale: Option<Bounds>,
}

impl Table for Atoms {
    fn columns(&self) -> &Columns {
        &self.columns
    }

    fn row<'a>(&self, line: Line<'a>, doubles: bool) -> Result<Option<Row<'a>>, Error> {
        let mut row = self.columns.row(line, line.words(), doubles)?;
        if let Some(bounds) = &self.scale {
            bounds.set_center(line, &mut row, doubles)?;
        }
        Ok(Some(row))
    }
}

/// Old dumps have no flags.
fn periodic(line: Line<'_>, flags: &[u8]) -> Result<[bool; 3], Error> {
    let words = flags.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let flags: Vec<_> = words.collect();
    match flags.as_slice() {
        [] => Ok([false; 3]),
        &[x, y, z] if [x, y, z].iter().all(|flag| is_boundary(flag)) => {
            Ok([x, y, z].map(|flag| flag == b"pp"))
        }
        _ => Err(line.unexpected(
            "three boundary flags after BOX BOUNDS, such as pp pp ff, or none (or --periodic X,Y,Z or none)",
        )),
    }
}

/// Returns `true` for two of the letters for periodic, fixed, shrink-wrapped, and shrink-wrapped with a minimum.
fn is_boundary(flag: &[u8]) -> bool {
    flag == b"pp" || (flag.len() == 2 && flag.iter().all(|side| b"fsm".contains(side)))
}

#[derive(Clone, Copy)]
enum Style {
    Orthogonal,
    /// `low high tilt` of the bounding box of a box tilted by xy, xz and yz.
    Tilted,
    /// `x y z origin`: a cell vector and a coordinate of the corner.
    CellVectors,
}

impl Style {
    fn from_item(item: &[u8]) -> Self {
        match &item[b"BOX BOUNDS".len()..] {
            rest if rest.starts_with(b" xy xz yz") => Self::Tilted,
            rest if rest.starts_with(b" abc origin") => Self::CellVectors,
            _ => Self::Orthogonal,
        }
    }

    fn flags(self, item: &[u8]) -> &[u8] {
        let form: &[u8] = match self {
            Self::Orthogonal => b"BOX BOUNDS",
            Self::Tilted => b"BOX BOUNDS xy xz yz",
            Self::CellVectors => b"BOX BOUNDS abc origin",
        };
        &item[form.len()..]
    }

    fn expected(self) -> &'static str {
        match self {
            Self::Orthogonal => "the low and the high bound of an axis, two numbers",
            Self::Tilted => "the low and the high bound of an axis and a tilt, three numbers",
            Self::CellVectors => "a cell vector and a coordinate of the origin, four numbers",
        }
    }

    fn width(self) -> usize {
        match self {
            Self::Orthogonal => 2,
            Self::Tilted => 3,
            Self::CellVectors => 4,
        }
    }

    fn box_of(self, rows: [[f64; 4]; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
        if let Self::CellVectors = self {
            return (rows.map(|row| row[3]), rows.map(|[x, y, z, _]| [x, y, z]));
        }
        let [xy, xz, yz] = rows.map(|row| row[2]);
        let tilts = [[0.0, xy, xz, xy + xz], [0.0, yz, 0.0, yz], [0.0; 4]];
        let bound = |axis: usize, side: usize| {
            let pick = if side == 0 { f64::min } else { f64::max };
            rows[axis][side] - tilts[axis].into_iter().fold(0.0, pick)
        };
        let corner = [bound(0, 0), bound(1, 0), bound(2, 0)];
        let length = |axis: usize| bound(axis, 1) - corner[axis];
        (corner, [[length(0), 0.0, 0.0], [xy, length(1), 0.0], [xz, yz, length(2)]])
    }
}

impl Bounds {
    fn set_center(&self, line: Line<'_>, row: &mut Row<'_>, doubles: bool) -> Result<(), Error> {
        let fractions = row.scaled;
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let steps = self
                .cell
                .vectors
                .iter()
                .zip(fractions)
                .map(|(vector, fraction)| vector[axis] * fraction.value);
            let value = self.corner[axis] + steps.sum::<f64>();
            let number = if doubles { value } else { f64::from(value as f32) };
            row.center[axis] = number;
            if !number.is_finite() {
                return Err(line.refuse(name, short(value).as_bytes(), rule_of(doubles)));
            }
            // A coordinate is known to half of the last digit of each field.
            let vectors = self.cell.vectors.iter().zip(fractions).filter(|(vector, _)| vector[axis] != 0.0);
            let units = vectors.map(|(vector, fraction)| vector[axis].abs() * fraction.unit);
            if row.rounded.is_none() && (value - number).abs() > 0.5 * units.sum::<f64>() {
                row.rounded = fractions[axis].field;
            }
        }
        Ok(())
    }
}

/// Prefers the first form in the module docs.
fn columns(header: Line<'_>, context: &ReadContext) -> Result<Columns, Error> {
    let names: Vec<_> =
        header.words().skip(2).map(|name| String::from_utf8_lossy(name).into_owned()).collect();
    let has = |wanted: &&str| names.iter().any(|name| name == wanted);
    let positions = [["x", "y", "z"], ["xu", "yu", "zu"], ["xs", "ys", "zs"], ["xsu", "ysu", "zsu"]];
    let position = positions.iter().find(|axes| axes.iter().all(&has)).unwrap_or(&positions[0]);
    let scaled = position[0].starts_with("xs");
    let size = ["radius", "diameter"].into_iter().find(has);
    let kind = ["type", "element"].into_iter().find(has);
    let columns = Columns::new(names.iter().map(|name| {
        let name = name.as_str();
        let meaning = match position.iter().position(|&axis| axis == name) {
            Some(axis) if scaled => Column::Scaled(axis),
            Some(axis) => Column::Axis(axis),
            None if Some(name) == kind => Column::Species,
            None if Some(name) == size && name == "radius" => Column::Radius,
            None if Some(name) == size => Column::Diameter,
            None if name == "id" => Column::Id,
            None if name == "mol" => Column::Group,
            None => Column::Other,
        };
        (name.to_owned(), meaning)
    }));
    columns.check(header, context)?;
    Ok(columns)
}
