use std::fmt::Write;

use crate::document::{Cell, CellKind, Document, Section, Table};

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#222;\
background:#fff}table{border-collapse:collapse;margin:.5rem 0 1.5rem;font-size:.9rem;font-variant-numeric:tabular-nums}\
th,td{border:1px solid #ccc;padding:.25rem .6rem;text-align:right}th:first-child,td:first-child{text-align:left}\
th{background:#f3f3f3}caption{text-align:left;padding:.3rem 0;color:#555}.best{font-weight:700}.absent{color:#888}\
.error{color:#fff;background:#c00}li.error{background:none;color:#c00;font-weight:700}figure{margin:1rem 0}\
svg{max-width:100%;height:auto}.wide{overflow-x:auto}";

pub fn page(document: &Document) -> String {
    let title = escaped(&document.title);
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\n\
         <meta name=\"viewport\" content=\"width=device-width\"><style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n"
    );
    document.sections.iter().for_each(|section| add(&mut out, section));
    out + "</body></html>\n"
}

fn add(out: &mut String, section: &Section) {
    let _ = writeln!(out, "<h2>{}</h2>", escaped(&section.title));
    for paragraph in &section.text {
        let _ = match paragraph.strip_prefix("```sh\n").and_then(|p| p.strip_suffix("\n```")) {
            Some(code) => writeln!(out, "<pre><code>{}</code></pre>", escaped(code)),
            None => writeln!(out, "<p>{}</p>", inline(paragraph)),
        };
    }
    for plot in &section.plots {
        let caption = inline(&plot.caption);
        let _ = writeln!(out, "<figure>{}<figcaption>{caption}</figcaption></figure>", plot.svg);
    }
    section.tables.iter().for_each(|table| add_table(out, table));
    if !section.notes.is_empty() {
        out.push_str("<ul>\n");
        for note in &section.notes {
            let class = if note.is_error { " class=\"error\"" } else { "" };
            let _ = writeln!(out, "<li{class}>{}</li>", inline(&note.text));
        }
        out.push_str("</ul>\n");
    }
}

fn add_table(out: &mut String, table: &Table) {
    let _ = write!(out, "<div class=\"wide\"><table><caption>{}</caption>\n<tr>", inline(&table.caption));
    for name in &table.header {
        let _ = write!(out, "<th>{}</th>", escaped(name));
    }
    out.push_str("</tr>\n");
    for row in &table.rows {
        let cells: String = row.iter().map(cell).collect();
        let _ = writeln!(out, "<tr>{cells}</tr>");
    }
    out.push_str("</table></div>\n");
}

fn cell(cell: &Cell) -> String {
    let class = match cell.kind {
        CellKind::Plain => "",
        CellKind::Best => " class=\"best\"",
        CellKind::Absent => " class=\"absent\"",
        CellKind::Error => " class=\"error\"",
    };
    format!("<td{class}>{}</td>", escaped(&cell.text))
}

fn inline(text: &str) -> String {
    let text = escaped(text);
    let segments: Vec<&str> = text.split('`').collect();
    let (pairs, rest) = segments.split_at((segments.len() - 1) / 2 * 2);
    let code = |pair: &[&str]| format!("{}<code>{}</code>", pair[0], pair[1]);
    pairs.chunks(2).map(code).collect::<String>() + &rest.join("`")
}

/// Escapes text, because adapter names and reasons come from other programs.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    #[test]
    fn backticks_are_code() {
        assert_eq!(
            super::inline("with `--quick` 20 and `a < b`"),
            "with <code>--quick</code> 20 and <code>a &lt; b</code>"
        );
        assert_eq!(super::inline("`a` and `b"), "<code>a</code> and `b");
        assert_eq!(super::inline("none"), "none");
    }

    #[test]
    fn text_stays_text() {
        assert_eq!(super::escaped("<b> & \"c\""), "&lt;b&gt; &amp; &quot;c&quot;");
    }
}
