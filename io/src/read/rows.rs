//! The rows of a table as spheres, parsed by all threads of the caller's pool. Whatever their number, spheres come in
//! the order of the file, and the first thing that is wrong is the one that is told.

use lazygrid::{MAX_SPHERES, Sphere};
use rayon::prelude::*;

use super::columns::{Columns, Row};
use super::line::Line;
use super::lines::{LineBlock, Lines};
use super::read_context::ReadContext;
use super::species::Species;
use super::{Frame, smoldyn};
use crate::error::{Error, Location, Position};

/// The contents of a table's lines.
pub(super) trait Table: Sync {
    /// The columns, for messages.
    fn columns(&self) -> &Columns;

    /// The values of a line, or `None` for one that is no row.
    fn row<'a>(&self, line: Line<'a>) -> Result<Option<Row<'a>>, Error>;

    /// Returns `true` if ids tell that one thing is listed twice.
    fn has_serials(&self) -> bool {
        false
    }
}

/// The rows that one thread parses of a piece.
#[derive(Default)]
struct ParsedBlock {
    spheres: Vec<Sphere>,
    /// Of each sphere the id of its species in this part.
    kinds: Vec<u32>,
    species: Species,
    ids: Vec<i64>,
    groups: Vec<u32>,
    serials: Vec<(smoldyn::Serial, u64)>,
    /// The first number that lost digits: line, column and field.
    rounded: Option<(Location, usize, String)>,
    /// The reason for which there are no more rows.
    error: Option<Error>,
}

impl Lines {
    /// Adds the rows of a table to a frame: so many of `what`, of which none may be missing.
    pub(super) fn rows(
        &mut self,
        table: &impl Table,
        (what, expected): (&'static str, u64),
        context: &mut ReadContext,
        frame: &mut Frame,
    ) -> Result<(), Error> {
        match self.up_to(expected, table, context, frame)? {
            found if found < expected => Err(Error::Truncated { place: self.place(), what, found, expected }),
            _ => Ok(()),
        }
    }

    /// Adds the rows of a table to a frame, up to the end of the file.
    pub(super) fn all_rows(
        &mut self,
        table: &impl Table,
        context: &mut ReadContext,
        frame: &mut Frame,
    ) -> Result<(), Error> {
        self.up_to(u64::MAX, table, context, frame).map(drop)
    }

    /// Adds so many lines of a table, or all; returns how many there were. What threads have made of a block is put
    /// together while they parse the next.
    fn up_to(
        &mut self,
        most: u64,
        table: &impl Table,
        context: &mut ReadContext,
        frame: &mut Frame,
    ) -> Result<u64, Error> {
        let defaults =
            RowDefaults { species: context.species.anew(), ids: context.ids, groups: context.groups };
        let parse = |pieces: &[LineBlock<'_>]| match pieces {
            [piece] => vec![ParsedBlock::of(*piece, table, &defaults)],
            _ => pieces.par_iter().map(|piece| ParsedBlock::of(*piece, table, &defaults)).collect::<Vec<_>>(),
        };
        let (mut parts, mut lines) = (Vec::new(), 0);
        loop {
            let (place, mut added) = (self.place(), Ok(()));
            let mut add = |parts: Vec<ParsedBlock>| {
                parts.into_iter().try_for_each(|part| frame.add(part, table, context, &place))
            };
            if lines == most {
                return add(parts).map(|()| lines);
            }
            let mut before = Some(parts);
            let parsed = self.parse(most - lines, parse, || added = add(before.take().unwrap_or_default()));
            // Where nothing was parsed, that is still to do.
            added.and_then(|()| add(before.unwrap_or_default()))?;
            let (next, more) = parsed?;
            if more == 0 {
                return Ok(lines);
            }
            (parts, lines) = (next, lines + more);
        }
    }
}

/// What every part begins with: the radii that were given, and whether ids and groups are wanted.
struct RowDefaults {
    species: Species,
    ids: bool,
    groups: bool,
}

impl ParsedBlock {
    fn of(piece: LineBlock<'_>, table: &impl Table, defaults: &RowDefaults) -> Self {
        let mut part = Self { species: defaults.species.anew(), ..Self::default() };
        part.spheres.reserve(piece.rows());
        part.error = piece.lines().try_for_each(|line| part.push(line?, table, defaults)).err();
        part
    }

    /// Adds the sphere of a row, with the radius of its species where one is given, else its own.
    fn push(&mut self, line: Line<'_>, table: &impl Table, defaults: &RowDefaults) -> Result<(), Error> {
        let Some(row) = table.row(line)? else { return Ok(()) };
        let mut radius = row.radius;
        if let Some(name) = row.species {
            let (kind, given) = self.species.intern(name);
            radius = given.or(radius);
            self.kinds.push(kind);
        }
        let radius = radius.ok_or_else(|| {
            let species = row.species.map(|name| String::from_utf8_lossy(name).into_owned());
            Error::NoRadius { place: line.place(), species }
        })?;
        if let Some(id) = row.id {
            if table.has_serials() {
                self.serials.push((smoldyn::serial(line, id)?, line.number));
            }
            if defaults.ids {
                self.ids.push(line.id(id)?);
            }
        }
        if let Some(group) = row.group.filter(|_| defaults.groups) {
            self.groups.push(line.group(group)?);
        }
        if let Some((column, field)) = row.rounded.filter(|_| self.rounded.is_none()) {
            self.rounded = Some((line.place(), column, String::from_utf8_lossy(field).into_owned()));
        }
        self.spheres.push(Sphere::new(row.center, radius));
        Ok(())
    }
}

impl Frame {
    /// Adds what a thread made of a piece, behind what is there.
    fn add(
        &mut self,
        part: ParsedBlock,
        table: &impl Table,
        context: &mut ReadContext,
        last: &Location,
    ) -> Result<(), Error> {
        let spheres = (self.spheres.len() + part.spheres.len()) as u64;
        let file = || Location { at: Position::File, ..last.clone() };
        if spheres > MAX_SPHERES {
            return Err(Error::TooManySpheres { place: file(), spheres, limit: "32-bit indices" });
        }
        let no_room = |_| Error::TooManySpheres { place: file(), spheres, limit: "memory" };
        self.spheres.try_reserve(part.spheres.len()).map_err(no_room)?;
        self.spheres.extend_from_slice(&part.spheres);
        if !part.kinds.is_empty() {
            let ids = context.species.adopt(&part.species);
            let species = self.species.get_or_insert_default();
            species.try_reserve(part.kinds.len()).map_err(no_room)?;
            species.extend(part.kinds.iter().map(|&kind| ids[kind as usize]));
        }
        if context.ids {
            let ids = self.ids.get_or_insert_default();
            ids.try_reserve(part.ids.len()).map_err(no_room)?;
            ids.extend_from_slice(&part.ids);
        }
        if context.groups {
            let groups = self.groups.get_or_insert_default();
            groups.try_reserve(part.groups.len()).map_err(no_room)?;
            groups.extend_from_slice(&part.groups);
        }
        context.listed(&part.serials, last)?;
        if let Some((place, column, text)) = part.rounded {
            context.warn_of_rounding(place, table.columns().name(column), text);
        }
        part.error.map_or(Ok(()), Err)
    }
}
