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
            found if found < expected => {
                Err(Error::Truncated { location: self.location(), what, found, expected })
            }
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
        let parse = |blocks: &[LineBlock<'_>]| match blocks {
            [block] => vec![ParsedBlock::from_lines(*block, table, &defaults)],
            _ => blocks
                .par_iter()
                .map(|block| ParsedBlock::from_lines(*block, table, &defaults))
                .collect::<Vec<_>>(),
        };
        let (mut parsed_blocks, mut lines) = (Vec::new(), 0);
        loop {
            let (location, mut added) = (self.location(), Ok(()));
            let mut add = |parsed_blocks: Vec<ParsedBlock>| {
                parsed_blocks
                    .into_iter()
                    .try_for_each(|parsed_block| frame.add(parsed_block, table, context, &location))
            };
            if lines == most {
                return add(parsed_blocks).map(|()| lines);
            }
            let mut before = Some(parsed_blocks);
            let parsed = self.parse(most - lines, parse, || added = add(before.take().unwrap_or_default()));
            added.and_then(|()| add(before.unwrap_or_default()))?;
            let (next, more) = parsed?;
            if more == 0 {
                return Ok(lines);
            }
            (parsed_blocks, lines) = (next, lines + more);
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
    fn from_lines(block: LineBlock<'_>, table: &impl Table, defaults: &RowDefaults) -> Self {
        let mut parsed_block = Self { species: defaults.species.with_names(), ..Self::default() };
        // On refusal, the first row says so.
        let _ = match defaults.doubles {
            true => parsed_block.doubles.try_reserve_exact(block.rows()),
            false => parsed_block.spheres.try_reserve_exact(block.rows()),
        };
        parsed_block.error =
            block.lines().try_for_each(|line| parsed_block.push(line?, table, defaults)).err();
        parsed_block
    }

    fn push(&mut self, line: Line<'_>, table: &impl Table, defaults: &RowDefaults) -> Result<(), Error> {
        let Some(row) = table.row(line, defaults.doubles)? else { return Ok(()) };
        let mut radius = row.radius;
        if let Some(name) = row.species {
            let refused = |_| out_of_memory(line, self.kinds.len());
            let (kind, species_radius) = self.species.intern(name).map_err(refused)?;
            radius = species_radius.or(radius);
            try_push(&mut self.kinds, kind, line)?;
        }
        let radius = radius.ok_or_else(|| Error::NoRadius {
            location: line.location(),
            species: row.species.map(excerpt),
        })?;
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
            self.rounded = Some((line.location(), column, excerpt(field)));
        }
        let [x, y, z] = row.center;
        match defaults.doubles {
            true => try_push(&mut self.doubles, [x, y, z, radius], line),
            false => try_push(&mut self.spheres, sphere([x, y, z, radius]), line),
        }
    }
}

fn try_push<T>(all: &mut Vec<T>, value: T, line: Line<'_>) -> Result<(), Error> {
    memory::try_push(all, value).map_err(|_| out_of_memory(line, all.len()))
}

fn out_of_memory(line: Line<'_>, before: usize) -> Error {
    Error::OutOfMemory { location: line.location(), spheres: before as u64 + 1 }
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
        block: ParsedBlock,
        table: &impl Table,
        context: &mut ReadContext,
        last: &Location,
    ) -> Result<(), Error> {
        let more = block.spheres.len() + block.doubles.len();
        let spheres = (self.len() + more) as u64;
        let file = || Location { at: Position::File, ..last.clone() };
        if spheres > MAX_SPHERES {
            return Err(Error::TooManySpheres { location: file(), spheres });
        }
        let refused = |_| Error::OutOfMemory { location: file(), spheres };
        self.try_reserve(more).map_err(refused)?;
        self.spheres.extend_from_slice(&block.spheres);
        self.doubles.iter_mut().for_each(|doubles| doubles.extend_from_slice(&block.doubles));
        if !block.kinds.is_empty() {
            let ids = context.species.adopt(&block.species).map_err(refused)?;
            let species = self.species.get_or_insert_default();
            species.try_reserve(block.kinds.len()).map_err(refused)?;
            species.extend(block.kinds.iter().map(|&kind| ids[kind as usize]));
        }
        if context.ids {
            let ids = self.ids.get_or_insert_default();
            ids.try_reserve(block.ids.len()).map_err(refused)?;
            ids.extend_from_slice(&block.ids);
        }
        if context.groups {
            let groups = self.groups.get_or_insert_default();
            groups.try_reserve(block.groups.len()).map_err(refused)?;
            groups.extend_from_slice(&block.groups);
        }
        context.listed(&block.serials, last)?;
        if let Some((location, column, text)) = block.rounded {
            context.warn_of_rounding(location, table.columns().name(column), text);
        }
        block.error.map_or(Ok(()), Err)
    }
}
