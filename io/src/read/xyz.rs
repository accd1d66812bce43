//! XYZ: a count, a comment, then `species x y z` per sphere, in any number of frames. The comment of extended
//! XYZ has columns (`Properties=`) and a box (`Lattice=`), periodic along `pbc=` or all vectors.

use lazygrid::Space;

use super::cell::SimulationCell;
use super::columns::{Column, Columns, Row};
use super::comment::{elements, unclosed, value_of};
use super::line::Line;
use super::lines::Lines;
use super::read_context::ReadContext;
use super::rows::{AnnouncedRows, Table};
use super::source::Source;
use super::{Frame, MAX_RESERVED_SPHERES};
use crate::error::{Error, excerpt};

pub(super) struct Xyz {
    pub(super) lines: Lines,
}

impl Xyz {
    pub(super) fn new(source: Source) -> Self {
        Self { lines: Lines::new(source) }
    }

    pub(super) fn next_frame(&mut self, context: &mut ReadContext) -> Result<Option<Frame>, Error> {
        let Some(line) = self.lines.next()? else { return Ok(None) };
        let count = line.count("the number of spheres of the next frame")?;
        let comment = self.lines.required("lines of the frame's head", 1, 2)?;
        let columns = columns(comment, context)?;
        let space = match context.space {
            Some(space) => space,
            None => space(comment, context.doubles)?,
        };
        let step = value_of(comment.bytes, "Step").and_then(|step| lexical_core::parse(step).ok());
        let mut frame =
            Frame { step, space, ..Frame::with_capacity(count.min(MAX_RESERVED_SPHERES), context) };
        self.lines.rows(&Words(columns), AnnouncedRows { what: "spheres", count }, context, &mut frame)?;
        Ok(Some(frame))
    }
}

struct Words(Columns);

impl Table for Words {
    fn columns(&self) -> &Columns {
        &self.0
    }

    fn row<'a>(&self, line: Line<'a>, doubles: bool) -> Result<Option<Row<'a>>, Error> {
        self.0.row(line, line.words(), doubles).map(Some)
    }
}

fn columns(comment: Line<'_>, context: &ReadContext) -> Result<Columns, Error> {
    if let Some(key) = unclosed(comment.bytes, &["Properties", "Lattice", "pbc"]) {
        return Err(comment.unexpected(format!("a closing quote or bracket after the value of {key}=")));
    }
    let columns = match value_of(comment.bytes, "Properties") {
        Some(properties) => {
            let columns = Columns::new(declared(comment, properties)?);
            check_properties(&columns, comment, context)?;
            columns
        }
        None => {
            let axes = ["x", "y", "z"].into_iter().enumerate().map(|(k, name)| (name, Column::Axis(k)));
            let plain = std::iter::once(("species", Column::Species)).chain(axes);
            Columns::new(plain.map(|(name, meaning)| (name.to_owned(), meaning))).open_ended()
        }
    };
    columns.check(comment, context)?;
    Ok(columns)
}

/// Names the properties that a reader of columns `x` and `r` does not find.
fn check_properties(columns: &Columns, comment: Line<'_>, context: &ReadContext) -> Result<(), Error> {
    let refuse = |expected: &str| {
        let found = format!("columns {}", excerpt(columns.names().join(", ").as_bytes()));
        Err(Error::Syntax { location: comment.location(), expected: expected.to_owned(), found })
    };
    if !columns.has(Column::Axis(0)) {
        return refuse("coordinates as pos:R:3 in Properties");
    }
    let by_species = columns.has(Column::Species) && context.species.has_radii();
    match columns.has(Column::Radius) || columns.has(Column::Diameter) || by_species {
        true => Ok(()),
        false if columns.has(Column::Species) => {
            refuse("radius:R:1 or diameter:R:1 in Properties, or radii by species (--radius SPECIES=R)")
        }
        false => refuse("radius:R:1 or diameter:R:1 in Properties"),
    }
}

/// Parses triples of name, type and width: `species:S:1:pos:R:3:radius:R:1`.
fn declared(comment: Line<'_>, properties: &[u8]) -> Result<Vec<(String, Column)>, Error> {
    const MAX_COLUMNS: usize = 1000;
    let malformed = || comment.unexpected("Properties=name:type:columns, such as pos:R:3:radius:R:1");
    let fields: Vec<_> = properties.split(|&b| b == b':').collect();
    let (triples, []) = fields.as_chunks::<3>() else { return Err(malformed()) };
    let mut columns = Vec::new();
    for &[name, _type, width] in triples {
        let name = String::from_utf8_lossy(name).into_owned();
        let width: usize = lexical_core::parse(width).map_err(|_| malformed())?;
        if width == 0 || width > MAX_COLUMNS - columns.len() {
            return Err(comment
                .unexpected(format!("Properties=name:type:columns with 1 to {MAX_COLUMNS} columns in all")));
        }
        match (name.to_ascii_lowercase().as_str(), width) {
            ("pos", 3) => {
                let axes = ["x", "y", "z"].into_iter().enumerate();
                columns.extend(axes.map(|(k, axis)| (axis.to_owned(), Column::Axis(k))));
            }
            ("radius" | "radii", 1) => columns.push((name, Column::Radius)),
            ("diameter", 1) => columns.push((name, Column::Diameter)),
            ("id", 1) => columns.push((name, Column::Id)),
            ("group" | "molecule" | "mol", 1) => columns.push((name, Column::Group)),
            ("species", 1) => columns.push((name, Column::Species)),
            _ => columns.extend(std::iter::repeat_n((name, Column::Other), width)),
        }
    }
    Ok(columns)
}

fn space(comment: Line<'_>, doubles: bool) -> Result<Space, Error> {
    let periodic = value_of(comment.bytes, "pbc").map(|value| flags(comment, value)).transpose()?;
    match (value_of(comment.bytes, "Lattice"), periodic) {
        (Some(lattice), periodic) => {
            let (vectors, periodic) = (vectors(comment, lattice)?, periodic.unwrap_or([true; 3]));
            SimulationCell { vectors, periodic }.space(&comment.location(), doubles)
        }
        (None, Some([false, false, false]) | None) => Ok(Space::UNBOUNDED),
        (None, Some(_)) => {
            Err(comment
                .unexpected("Lattice= with a periodic pbc=, or lengths with --periodic X,Y,Z (or none)"))
        }
    }
}

fn vectors(comment: Line<'_>, lattice: &[u8]) -> Result<[[f64; 3]; 3], Error> {
    let numbers = elements(lattice).map(|element| comment.number("Lattice", element));
    match *numbers.collect::<Result<Vec<f64>, Error>>()? {
        [ax, ay, az, bx, by, bz, cx, cy, cz] => Ok([[ax, ay, az], [bx, by, bz], [cx, cy, cz]]),
        [a, b, c] => Ok([[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]),
        _ => Err(comment.unexpected("Lattice=\"ax ay az bx by bz cx cy cz\" (or --periodic X,Y,Z or none)")),
    }
}

fn flags(comment: Line<'_>, pbc: &[u8]) -> Result<[bool; 3], Error> {
    let flag = |element: &[u8]| match element.to_ascii_lowercase().as_slice() {
        b"t" | b"true" | b"1" => Some(true),
        b"f" | b"false" | b"0" => Some(false),
        _ => None,
    };
    let flags: Option<Vec<_>> = elements(pbc).map(flag).collect();
    flags.and_then(|flags| flags.try_into().ok()).ok_or_else(|| {
        comment.unexpected("pbc=\"T T F\", one of T and F for each axis (or --periodic X,Y,Z or none)")
    })
}
