use std::collections::TryReserveError;

use super::dictionary::Field;
use super::dtype::{Dtype, DtypeKind};
use super::{ArrayNumber, Header, ReadContext, Source, syntax, truncated};
use crate::error::{Error, Position, excerpt};
use crate::read::Frame;
use crate::read::columns::{Column, Columns};
use crate::read::line::{GROUPS, group_of};

pub(super) struct Fields {
    wanted: Vec<SelectedField>,
    columns: Columns,
    width: usize,
}

struct SelectedField {
    name: String,
    meaning: Column,
    kind: Dtype,
    start: usize,
}

struct StructuredRow<'a> {
    source: &'a Source,
    header: &'a Header,
    number: u64,
    bytes: &'a [u8],
}

impl Fields {
    pub(super) fn new(source: &Source, fields: &[Field<'_>]) -> Result<Self, Error> {
        const MAX_ROW_BYTES: usize = 1 << 20;
        let mut wanted = Vec::new();
        let mut columns = Vec::new();
        let mut start = 0;
        for field in fields {
            let refuse = |expected: &str| {
                let found = format!("field {} of type '{}'", excerpt(field.name), excerpt(field.kind));
                Err(syntax(source, expected, &found))
            };
            let Some(kind) = Dtype::parse(field.kind) else { return refuse("fields of numbers and text") };
            let count = field.shape.iter().try_fold(1_u64, |all, &n| all.checked_mul(n));
            let bytes = count.and_then(|count| count.checked_mul(kind.width as u64));
            let Some(bytes) = bytes.filter(|&bytes| bytes <= MAX_ROW_BYTES as u64 - start as u64) else {
                return refuse("rows of at most a MiB");
            };
            for (k, (name, meaning)) in meanings(field).into_iter().enumerate() {
                let start = start + k * kind.width;
                let is_whole = matches!(kind.class, DtypeKind::Signed | DtypeKind::Unsigned);
                // A field of another type may mean something else.
                let is_number = matches!(meaning, Column::Group | Column::Id);
                let meaning = if is_number && !is_whole { Column::Other } else { meaning };
                match (meaning, kind.class) {
                    (Column::Other, _) => {}
                    (
                        Column::Species,
                        DtypeKind::Signed | DtypeKind::Unsigned | DtypeKind::Bytes | DtypeKind::Text,
                    ) => {}
                    (Column::Species, _) => return refuse("species as whole numbers or text"),
                    (Column::Id | Column::Group, _) => {}
                    (_, DtypeKind::Float) => {}
                    _ => return refuse("coordinates and radii of type f4 or f8"),
                }
                columns.push((name.clone(), meaning));
                wanted.push(SelectedField { name, meaning, kind, start });
            }
            start += bytes as usize;
        }
        wanted.retain(|field| field.meaning != Column::Other);
        Ok(Self { wanted, columns: Columns::new(columns), width: start })
    }

    pub(super) fn width(&self) -> usize {
        self.width
    }

    pub(super) fn has_f64(&self) -> bool {
        self.wanted.iter().any(|field| field.kind.is_f64())
    }

    pub(super) fn has_species(&self) -> bool {
        self.columns.has(Column::Species)
    }

    pub(super) fn read(
        &self,
        source: &mut Source,
        header: &Header,
        frame: &mut Frame,
        context: &mut ReadContext,
    ) -> Result<(), Error> {
        const BLOCK: usize = 1 << 18;
        if let Some(expected) = self.columns.lacks(context) {
            let found = format!("fields {}", excerpt(self.columns.names().join(", ").as_bytes()));
            return Err(syntax(source, &expected, &found));
        }
        let rows = header.rows;
        // Requested columns exist even without rows.
        self.try_reserve(0, frame, context).map_err(|_| header.out_of_memory(source))?;
        let most = (BLOCK / self.width).max(1) as u64;
        let mut bytes = vec![0; most.min(rows) as usize * self.width];
        let mut found = 0;
        while found < rows {
            let block = &mut bytes[..(rows - found).min(most) as usize * self.width];
            let read = source.fill(block)?;
            self.try_reserve(read / self.width, frame, context).map_err(|_| header.out_of_memory(source))?;
            for bytes in block[..read].chunks_exact(self.width) {
                self.push(StructuredRow { source, header, number: found, bytes }, frame, context)?;
                found += 1;
            }
            if read < block.len() {
                return Err(truncated(source, found, rows));
            }
        }
        Ok(())
    }

    fn try_reserve(
        &self,
        rows: usize,
        frame: &mut Frame,
        context: &ReadContext,
    ) -> Result<(), TryReserveError> {
        frame.try_reserve(rows)?;
        if self.columns.has(Column::Species) {
            frame.species.get_or_insert_default().try_reserve(rows)?;
        }
        if context.ids {
            frame.ids.get_or_insert_default().try_reserve(rows)?;
        }
        if context.groups {
            frame.groups.get_or_insert_default().try_reserve(rows)?;
        }
        Ok(())
    }

    fn push(
        &self,
        row: StructuredRow<'_>,
        frame: &mut Frame,
        context: &mut ReadContext,
    ) -> Result<(), Error> {
        let StructuredRow { source, header, number, bytes: row } = row;
        let (mut center, mut radius, mut species_radius) = ([0.0; 3], None, None);
        for SelectedField { name, meaning, kind, start } in &self.wanted {
            let bytes = &row[*start..start + kind.width];
            let mut float = |is_radius| {
                let written = kind.float(bytes);
                context.number(source, ArrayNumber { row: number, column: name, is_radius, written })
            };
            match meaning {
                Column::Axis(axis) => center[*axis] = float(false)?,
                Column::Radius => radius = Some(float(true)?),
                Column::Diameter => radius = Some(float(true)? * 0.5),
                Column::Species => {
                    let name = match kind.class {
                        DtypeKind::Signed | DtypeKind::Unsigned => kind.whole(bytes).to_string(),
                        _ => kind.text(bytes),
                    };
                    let refused = |_| header.out_of_memory(source);
                    let (id, by_species) = context.species.intern(name.as_bytes()).map_err(refused)?;
                    species_radius = by_species;
                    frame.species.get_or_insert_default().push(id);
                }
                Column::Id if context.ids => {
                    let id = kind.whole(bytes);
                    let too_large = || syntax(source, "ids below 2^63", &format!("{id} in row {number}"));
                    let id = i64::try_from(id).map_err(|_| too_large())?;
                    frame.ids.get_or_insert_default().push(id);
                }
                Column::Group if context.groups => {
                    let group = kind.whole(bytes);
                    let refused = || syntax(source, GROUPS, &format!("{group} in row {number}"));
                    frame.groups.get_or_insert_default().push(group_of(group).ok_or_else(refused)?);
                }
                _ => {}
            }
        }
        let species = || frame.species.as_ref().and_then(|ids| ids.last());
        let radius = species_radius.or(radius).ok_or_else(|| Error::NoRadius {
            location: source.at(Position::Row(number)),
            species: species().map(|&id| excerpt(context.species.names()[id as usize].as_bytes())),
        })?;
        let [x, y, z] = center;
        frame.push([x, y, z, radius]);
        Ok(())
    }
}

fn meanings(field: &Field<'_>) -> Vec<(String, Column)> {
    let name = String::from_utf8_lossy(field.name).into_owned();
    match (name.to_ascii_lowercase().as_str(), field.shape.as_slice()) {
        ("pos" | "position", [3]) => {
            let axes = ["x", "y", "z"].into_iter().enumerate();
            axes.map(|(k, axis)| (axis.to_owned(), Column::Axis(k))).collect()
        }
        (_, [] | [1]) => {
            let meaning = Column::named(&name);
            vec![(name, meaning)]
        }
        _ => vec![(name, Column::Other)],
    }
}
