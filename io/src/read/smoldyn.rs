//! Smoldyn's `listmols` output, one frame: `name(state) x y z serial` per molecule, radii by species.
//!
//! Smoldyn may append listings without a separator, which a repeated serial number reveals.

use super::Frame;
use super::columns::{Column, Columns, Row};
use super::line::Line;
use super::lines::Lines;
use super::read_context::ReadContext;
use super::rows::Table;
use super::source::Source;
use crate::error::Error;

struct ListingTable(Columns);

pub(super) fn read(source: Source, context: &mut ReadContext) -> Result<Frame, Error> {
    let axes = ["x", "y", "z"].into_iter().enumerate().map(|(k, axis)| (axis, Column::Axis(k)));
    let listed = [("name(state)", Column::Species)].into_iter().chain(axes).chain([("serial", Column::Id)]);
    let listing = ListingTable(Columns::new(listed.map(|(name, meaning)| (name.to_owned(), meaning))));
    let mut frame = Frame::with_capacity(0, context);
    let mut lines = Lines::new(source);
    if context.groups {
        let expected = "a format with groups, which --exclude-groups asks for".to_owned();
        let found = "molecules without groups, as Smoldyn lists them".to_owned();
        return Err(Error::Syntax { location: lines.location(), expected, found });
    }
    lines.all_rows(&listing, context, &mut frame)?;
    Ok(frame)
}

impl Table for ListingTable {
    fn columns(&self) -> &Columns {
        &self.0
    }

    fn row<'a>(&self, line: Line<'a>, doubles: bool) -> Result<Option<Row<'a>>, Error> {
        if line.is_blank() {
            return Ok(None);
        }
        let row = self.0.row(line, line.words(), doubles)?;
        if !row.species.is_some_and(is_name) {
            return Err(line.unexpected("name(state) x y z serial"));
        }
        Ok(Some(row))
    }

    fn has_serials(&self) -> bool {
        true
    }
}

fn is_name(word: &[u8]) -> bool {
    word.ends_with(b")") && word.iter().position(|&b| b == b'(').is_some_and(|at| at > 0)
}

pub(super) fn is_listing(line: &[u8]) -> bool {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.next().is_some_and(is_name) && words.count() >= 2
}
