//! Tables as spheres, parsed by all threads, with the order and first error of the file.

use lazygrid::{MAX_SPHERES, Sphere};
use rayon::prelude::*;

use super::columns::{Column, Columns, Row};
use super::line::Line;
use super::lines::{LineBlock, Lines};
use super::read_context::ReadContext;
use super::serial::{Serial, serial};
use super::species::Species;
use super::{Frame, sphere};
use crate::error::{Error, Location, Position, excerpt};
use crate::memory;

pub(super) trait Table: Sync {
    fn columns(&self) -> &Columns;

    fn row<'a>(&self, line: Line<'a>, doubles: bool) -> Result<Option<Row<'a>>, Error>;

    fn has_serials(&self) -> bool {
        false
    }
}

#[derive(Default)]
struct ParsedBlock {
    spheres: Vec<Sphere>,
    doubles: Vec<[f64; 4]>,
    kinds: Vec<u32>,
    species: Species,
    ids: Vec<i64>,
    groups: Vec<u32>,
    serials: Vec<(Serial, u64)>,
    /// First rounded number: line, column, field.
    rounded: Option<(Location, usize, String)>,
    /// Follows the rows.
    error: Option<Error>,
}

pub(super) struct AnnouncedRows {
    pub(super) what: &'static str,
    pub(super) count: u64,
}

impl Lines {
    pub(super) fn rows(
        &mut self,
        table: &impl Table,
        announced: AnnouncedRows,
        context: &mut ReadContext,
        frame: &mut Frame,
    ) -> Result<(), Error> {
        let AnnouncedRows { what, count: expected } = announced;
        match self.up_to(expected, table, context, frame)? {
            found if found < expected => Err(Error::Truncated { place: self.place(), what, found, expected }),
            _ => Ok(()),
        }
    }

    pub(super) fn all_rows(
        &mut self,
        table: &impl Table,
        context: &mut ReadContext,
        frame: &mut Frame,
    ) -> Result<(), Error> {
        self.up_to(u64::MAX, table, context, frame).map(drop)
    }

    /// Appends blocks while the next are parsed.
    fn up_to(
        &mut self,
        most: u64,
        table: &impl Table,
        context: &mut ReadContext,
        frame: &mut Frame,
    ) -> Result<u64, Error> {
        frame.begin(table, context);
        let &mut ReadContext { ids, groups, doubles, ref species, .. } = context;
        let defaults = RowDefaults { species: species.with_names(), ids, groups, doubles };
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
            added.and_then(|()| add(before.unwrap_or_default()))?;
            let (next, more) = parsed?;
            if more == 0 {
                return Ok(lines);
            }
            (parts, lines) = (next, lines + more);
        }
    }
}

struct RowDefaults {
    species: Species,
    ids: bool,
    groups: bool,
    doubles: bool,
}

impl ParsedBlock {
    fn of(piece: LineBlock<'_>, table: &impl Table, defaults: &RowDefaults) -> Self {
        let mut part = Self { species: defaults.species.with_names(), ..Self::default() };
        // On refusal, the first row says so.
        let _ = match defaults.doubles {
            true => part.doubles.try_reserve_exact(piece.rows()),
            false => part.spheres.try_reserve_exact(piece.rows()),
        };
        part.error = piece.lines().try_for_each(|line| part.push(line?, table, defaults)).err();
        part
    }

    fn push(&mut self, line: Line<'_>, table: &impl Table, defaults: &RowDefaults) -> Result<(), Error> {
        let Some(row) = table.row(line, defaults.doubles)? else { return Ok(()) };
        let mut radius = row.radius;
        if let Some(name) = row.species {
            let refused = |_| too_many(line, self.kinds.len());
            let (kind, given) = self.species.intern(name).map_err(refused)?;
            radius = given.or(radius);
            try_push(&mut self.kinds, kind, line)?;
        }
        let radius = radius
            .ok_or_else(|| Error::NoRadius { place: line.place(), species: row.species.map(excerpt) })?;
        if let Some(id) = row.id {
            if table.has_serials() {
                try_push(&mut self.serials, (serial(line, id)?, line.number), line)?;
            }
            if defaults.ids {
                try_push(&mut self.ids, line.id(id)?, line)?;
            }
        }
        if let Some(group) = row.group.filter(|_| defaults.groups) {
            try_push(&mut self.groups, line.group(group)?, line)?;
        }
        if let Some((column, field)) = row.rounded.filter(|_| self.rounded.is_none()) {
            self.rounded = Some((line.place(), column, excerpt(field)));
        }
        let [x, y, z] = row.center;
        match defaults.doubles {
            true => try_push(&mut self.doubles, [x, y, z, radius], line),
            false => try_push(&mut self.spheres, sphere([x, y, z, radius]), line),
        }
    }
}

fn try_push<T>(all: &mut Vec<T>, value: T, line: Line<'_>) -> Result<(), Error> {
    memory::try_push(all, value).map_err(|_| too_many(line, all.len()))
}

fn too_many(line: Line<'_>, before: usize) -> Error {
    Error::TooManySpheres { place: line.place(), spheres: before as u64 + 1, limit: "memory" }
}

impl Frame {
    /// Adds requested columns even without spheres.
    fn begin(&mut self, table: &impl Table, context: &ReadContext) {
        if table.columns().has(Column::Species) {
            self.species.get_or_insert_default();
        }
        if context.ids {
            self.ids.get_or_insert_default();
        }
        if context.groups {
            self.groups.get_or_insert_default();
        }
    }

    fn add(
        &mut self,
        part: ParsedBlock,
        table: &impl Table,
        context: &mut ReadContext,
        last: &Location,
    ) -> Result<(), Error> {
        let more = part.spheres.len() + part.doubles.len();
        let spheres = (self.len() + more) as u64;
        let file = || Location { at: Position::File, ..last.clone() };
        if spheres > MAX_SPHERES {
            return Err(Error::TooManySpheres { place: file(), spheres, limit: "32-bit indices" });
        }
        let no_room = |_| Error::TooManySpheres { place: file(), spheres, limit: "memory" };
        self.try_reserve(more).map_err(no_room)?;
        self.spheres.extend_from_slice(&part.spheres);
        self.doubles.iter_mut().for_each(|doubles| doubles.extend_from_slice(&part.doubles));
        if !part.kinds.is_empty() {
            let ids = context.species.adopt(&part.species).map_err(no_room)?;
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
