use std::fmt::Write;

use crate::measure::markdown;
use lazygrid_report::{Cell, CellKind, Document, Table};

pub(super) fn text(document: &Document) -> String {
    let mut out = format!("# {}\n", document.title);
    for section in &document.sections {
        let _ = writeln!(out, "\n## {}\n", section.title);
        for paragraph in &section.text {
            let _ = writeln!(out, "{paragraph}\n");
        }
        for table in &section.tables {
            let _ = writeln!(out, "{}", rendered(table));
        }
        for note in &section.notes {
            let mark = if note.is_error { "**Error.** " } else { "" };
            let _ = writeln!(out, "- {mark}{}", note.text);
        }
    }
    out
}

fn rendered(table: &Table) -> String {
    let header: Vec<&str> = table.header.iter().map(String::as_str).collect();
    let rows: Vec<Vec<String>> = table.rows.iter().map(|row| row.iter().map(cell).collect()).collect();
    let caption = if table.caption.is_empty() { String::new() } else { format!("{}\n\n", table.caption) };
    caption + &markdown(&header, &rows)
}

fn cell(cell: &Cell) -> String {
    match cell.kind {
        CellKind::Best => format!("**{}**", cell.text),
        CellKind::Error => format!("**{}** ✗", cell.text),
        CellKind::Plain | CellKind::Absent => cell.text.clone(),
    }
}
