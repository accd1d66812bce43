//! Values separated by commas, semicolons or tabs, one frame. A header names the columns ([`Column::named`])
//! in any order. `#` begins comments; without a header line, the last fitting leading comment is the
//! header, as by NumPy's `savetxt`.

use super::Frame;
use super::columns::{Column, Columns, Row};
use super::line::Line;
use super::lines::Lines;
use super::read_context::ReadContext;
use super::rows::Table;
use super::source::Source;
use crate::error::Error;

const SEPARATORS: [u8; 3] = *b",;\t";
const HEADER: &str = "a header with x, y, z and r, radius or diameter";

struct Csv {
    columns: Columns,
    separator: u8,
}

pub(super) fn read(source: Source, context: &mut ReadContext) -> Result<Frame, Error> {
    let mut lines = Lines::new(source);
    let table = header(&mut lines, context)?;
    let mut frame = Frame::with_capacity(0, context);
    lines.all_rows(&table, context, &mut frame)?;
    Ok(frame)
}

fn header(lines: &mut Lines, context: &ReadContext) -> Result<Csv, Error> {
    let mut in_comment = None;
    while let Some(line) = lines.next()? {
        // Old programs end lines by `\r` alone.
        if line.bytes.trim_ascii().contains(&b'\r') {
            return Err(Error::Syntax {
                location: line.location(),
                expected: "lines that end with \\n or \\r\\n".to_owned(),
                found: "\\r within a line; convert the line ends, for example with tr '\\r' '\\n'".to_owned(),
            });
        }
        let Some(comment) = commented(line.bytes) else {
            let table = Csv::from_header(line, line.bytes);
            return match in_comment {
                Some(table) if !is_header(line.bytes) => {
                    lines.put_back();
                    table
                }
                _ => {
                    let table = table?;
                    if (0..3).all(|axis| !table.columns.has(Column::Axis(axis))) {
                        return Err(
                            line.unexpected(format!("{HEADER}, separated by commas, semicolons or tabs"))
                        );
                    }
                    table.columns.check(line, context).map(|()| table)
                }
            };
        };
        if is_header(comment) {
            let table = Csv::from_header(line, comment);
            let table = table.and_then(|table| table.columns.check(line, context).map(|()| table));
            if table.is_ok() || !matches!(in_comment, Some(Ok(_))) {
                in_comment = Some(table);
            }
        }
    }
    in_comment.unwrap_or_else(|| {
        let (location, expected) = (lines.location(), HEADER.to_owned());
        Err(Error::Syntax { location, expected, found: "an empty file".to_owned() })
    })
}

impl Csv {
    fn from_header(line: Line<'_>, header: &[u8]) -> Result<Self, Error> {
        let separator = separator(header);
        let columns = fields(line, header, separator)?.map(|field| {
            let name = String::from_utf8_lossy(field).to_lowercase();
            let meaning = Column::named(&name);
            (name, meaning)
        });
        Ok(Self { columns: Columns::new(columns), separator })
    }
}

impl Table for Csv {
    fn columns(&self) -> &Columns {
        &self.columns
    }

    fn row<'a>(&self, line: Line<'a>, doubles: bool) -> Result<Option<Row<'a>>, Error> {
        if line.is_blank() || commented(line.bytes).is_some() {
            return Ok(None);
        }
        self.columns.row(line, fields(line, line.bytes, self.separator)?, doubles).map(Some)
    }
}

fn commented(line: &[u8]) -> Option<&[u8]> {
    line.trim_ascii_start().strip_prefix(b"#")
}

fn separator(header: &[u8]) -> u8 {
    let most = SEPARATORS.into_iter().rev().max_by_key(|&s| memchr::memchr_iter(s, header).count());
    most.unwrap_or(b',')
}

/// Refuses quoted separators and quotes, which no column needs.
fn fields<'a>(
    line: Line<'a>,
    bytes: &'a [u8],
    separator: u8,
) -> Result<impl Iterator<Item = &'a [u8]>, Error> {
    let quoted = memchr::memchr(b'"', bytes).is_some();
    let fields = bytes.split(move |&b| b == separator).map(move |field| {
        let field = field.trim_ascii();
        if quoted { unquoted(field).unwrap_or(field) } else { field }
    });
    if quoted && fields.clone().any(|field| field.contains(&b'"')) {
        return Err(line.unexpected("quotes around whole fields without separators or quotes in them"));
    }
    Ok(fields)
}

fn unquoted(field: &[u8]) -> Option<&[u8]> {
    field.strip_prefix(b"\"")?.strip_suffix(b"\"")
}

pub(super) fn is_header(line: &[u8]) -> bool {
    let line = commented(line).unwrap_or(line);
    let separator = separator(line);
    let fields = line.split(|&b| b == separator).map(|f| f.trim_ascii().to_ascii_lowercase());
    let names: Vec<_> = fields.collect();
    [b"x", b"y", b"z"]
        .iter()
        .all(|axis| names.iter().any(|name| unquoted(name).unwrap_or(name) == axis.as_slice()))
}

pub(super) fn is_comment(line: &[u8]) -> bool {
    commented(line).is_some()
}
