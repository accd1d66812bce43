use lazygrid::Sphere;

use super::Frame;
use super::lines::Line;
use super::species::Species;
use crate::error::{Error, excerpt};

/// What a column of a table means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
    /// A coordinate of the centre.
    Axis(usize),
    /// A coordinate of the centre as a fraction of the simulation box.
    Scaled(usize),
    Radius,
    Diameter,
    Species,
    /// Anything that is not needed.
    Other,
}

/// The columns of a table, in the order of the fields of its rows.
pub(super) struct Columns {
    meanings: Vec<Column>,
    names: Vec<String>,
    /// Whether a row may have more fields than columns.
    open_ended: bool,
}

/// One row of a table, before its species is looked up.
#[derive(Clone, Copy, Default)]
pub(super) struct Row<'a> {
    pub(super) center: [f32; 3],
    pub(super) scaled: [f64; 3],
    pub(super) radius: Option<f32>,
    pub(super) species: Option<&'a [u8]>,
}

impl Columns {
    pub(super) fn new(columns: impl IntoIterator<Item = (String, Column)>) -> Self {
        let (names, meanings) = columns.into_iter().unzip();
        Self { meanings, names, open_ended: false }
    }

    pub(super) fn open_ended(self) -> Self {
        Self { open_ended: true, ..self }
    }

    pub(super) fn has(&self, meaning: Column) -> bool {
        self.meanings.contains(&meaning)
    }

    /// Checks that the table has what spheres need and nothing twice; `header` is the line that says so.
    pub(super) fn check(&self, header: Line<'_>, species: &Species) -> Result<(), Error> {
        let refuse = |expected: &str| {
            Err(Error::Syntax {
                place: header.place(),
                expected: expected.to_owned(),
                found: format!("columns {}", excerpt(self.names.join(", ").as_bytes())),
            })
        };
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            if !self.has(Column::Axis(axis)) && !self.has(Column::Scaled(axis)) {
                return refuse(&format!("a column `{name}`"));
            }
        }
        let count = |wanted: &[Column]| self.meanings.iter().filter(|m| wanted.contains(m)).count();
        let axes = [0, 1, 2].map(|axis| count(&[Column::Axis(axis), Column::Scaled(axis)]));
        let radii = count(&[Column::Radius, Column::Diameter]);
        if axes != [1; 3] || radii > 1 || count(&[Column::Species]) > 1 {
            return refuse("one column each for x, y, z, radius and species");
        }
        let by_species = self.has(Column::Species) && species.any_given();
        if radii == 0 && !by_species {
            let remedy =
                if self.has(Column::Species) { ", or radii by species (--radius SPECIES=R)" } else { "" };
            return refuse(&format!("a radius column{remedy}"));
        }
        Ok(())
    }

    /// The values of a line whose fields are given.
    pub(super) fn row<'a>(
        &self,
        line: Line<'a>,
        mut fields: impl Iterator<Item = &'a [u8]>,
    ) -> Result<Row<'a>, Error> {
        let mut row = Row::default();
        for (k, meaning) in self.meanings.iter().enumerate() {
            let Some(field) = fields.next() else {
                return Err(self.wrong_width(line, k));
            };
            let name = &self.names[k];
            match *meaning {
                Column::Axis(axis) => row.center[axis] = line.number(name, field)?,
                Column::Scaled(axis) => row.scaled[axis] = line.number(name, field)?,
                Column::Radius => row.radius = Some(line.radius(name, field)?),
                Column::Diameter => row.radius = Some(line.radius(name, field)? * 0.5),
                Column::Species => row.species = Some(field),
                Column::Other => {}
            }
        }
        if !self.open_ended && fields.next().is_some() {
            return Err(self.wrong_width(line, self.meanings.len() + 1 + fields.count()));
        }
        Ok(row)
    }

    fn wrong_width(&self, line: Line<'_>, found: usize) -> Error {
        let (width, names) = (self.names.len(), excerpt(self.names.join(", ").as_bytes()));
        let expected = format!("{width} fields ({names})");
        let found = format!("{found}: '{}'", excerpt(line.bytes));
        Error::Syntax { place: line.place(), expected, found }
    }
}

impl Frame {
    /// Adds the sphere of a row, with the radius of its species where one is given, else its own.
    pub(super) fn push(&mut self, line: Line<'_>, row: Row<'_>, species: &mut Species) -> Result<(), Error> {
        let spheres = self.spheres.len() as u64 + 1;
        let memory = |_| Error::TooManySpheres { place: line.place(), spheres, limit: "memory" };
        // Room first, so that a refusal is an error and leaves the columns of one length.
        self.spheres.try_reserve(1).map_err(memory)?;
        let mut radius = row.radius;
        if let Some(name) = row.species {
            let (id, given) = species.intern(name);
            radius = given.or(radius);
            let ids = self.species.get_or_insert_default();
            ids.try_reserve(1).map_err(memory)?;
            ids.push(id);
        }
        let radius = radius.ok_or_else(|| {
            let species = row.species.map(|name| String::from_utf8_lossy(name).into_owned());
            Error::NoRadius { place: line.place(), species }
        })?;
        self.spheres.push(Sphere::new(row.center, radius));
        Ok(())
    }
}
