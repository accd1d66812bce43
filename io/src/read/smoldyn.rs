//! Smoldyn's `listmols` output: `name(state) x y z serial` per molecule, radii by species. One frame.
//!
//! Smoldyn can append several listings to one file, but writes nothing between them. Since a molecule is in a
//! listing once, a serial number that comes again shows that there are several; that is refused, for where one
//! ends cannot be known (molecules appear and vanish from one to the next).

use std::collections::HashMap;

use super::columns::{Column, Columns};
use super::lines::Lines;
use super::species::Species;
use super::{Frame, Source};
use crate::error::{Error, excerpt};

pub(super) fn read(source: Source, species: &mut Species) -> Result<Frame, Error> {
    let axes = ["x", "y", "z"].into_iter().enumerate().map(|(k, axis)| (axis, Column::Axis(k)));
    let listed =
        [("name(state)", Column::Species)].into_iter().chain(axes).chain([("serial", Column::Other)]);
    let columns = Columns::new(listed.map(|(name, meaning)| (name.to_owned(), meaning)));
    let mut lines = Lines::new(source);
    let mut seen = HashMap::<Box<[u8]>, u64>::new();
    let mut frame = Frame::default();
    while let Some(line) = lines.next()? {
        let row = columns.row(line, line.words())?;
        if !row.species.is_some_and(is_name) {
            return Err(line.unexpected("name(state) x y z serial"));
        }
        let serial = line.words().last().unwrap_or_default();
        if let Some(first) = seen.insert(serial.into(), line.number) {
            return Err(Error::RepeatedMolecule { place: line.place(), serial: excerpt(serial), first });
        }
        frame.push(line, row, species)?;
    }
    Ok(frame)
}

/// Whether a word is a species with its state in brackets.
fn is_name(word: &[u8]) -> bool {
    word.ends_with(b")") && word.iter().position(|&b| b == b'(').is_some_and(|at| at > 0)
}

/// Whether the first line of a file reads like one of a listing.
pub(super) fn is_listing(line: &[u8]) -> bool {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.next().is_some_and(is_name) && words.count() >= 2
}
