//! A page that plays a run in any browser with WebGL 2. Positions have 16 bits per coordinate, relative to the frame's
//! extent, in base64.

mod scene;

use std::fs::File;
use std::io::{self, BufReader, Write};
use std::path::Path;

use lazygrid_io::write::base64;
use lazygrid_sim::animation::{Frame, Frames, is_drawn};
use lazygrid_sim::run::Run;
use lazygrid_sim::{Error, Model, write_atomically};
use scene::Scene;

use crate::series::Series;

const PAGE: &str = include_str!("player.html");
const SCRIPTS: [&str; 2] = [include_str!("renderer.js"), include_str!("player.js")];

/// Writes `animation.html` of a run that recorded frames; does nothing for other runs.
///
/// # Errors
/// [`Error::Read`] and [`Error::Write`].
pub fn write(run: &Run) -> Result<(), Error> {
    let frames = run.directory.join("animation.frames");
    if run.scenario.output.animation.is_none() || !frames.exists() {
        return Ok(());
    }
    let series = Series::read(&run.directory.join("series.csv"))?;
    let path = run.directory.join("animation.html");
    write_atomically(&path, |out| page(out, &run.scenario.model, &run.title(), &frames, &series))
}

fn page(out: &mut impl Write, model: &Model, title: &str, frames: &Path, series: &Series) -> io::Result<()> {
    let open = || File::open(frames).map(BufReader::new).map(Frames::new);
    let mut scene = Scene::new(model, title, series);
    let mut shift = 0;
    for frame in open()? {
        shift = shift.max(frame?.shift);
    }
    for frame in open()? {
        scene.add_frame(&thinned(frame?, shift));
    }
    let json = serde_json::to_string(&scene.finished(shift)).map_err(io::Error::other)?;
    let title = title.replace('&', "&amp;").replace('<', "&lt;");
    let mut rest = PAGE;
    for (mark, text) in [("{{title}}", title), ("{{scene}}", json.replace('<', "\\u003c"))] {
        rest = fill_mark(out, rest, mark, &text)?;
    }
    rest = fill_mark(out, rest, "{{frames}}", "")?;
    for (at, frame) in open()?.enumerate() {
        let frame = thinned(frame?, shift);
        write!(out, "<script type=\"text/plain\" id=\"frame-{at}\">")?;
        base64(out, &scene::quantized_positions(&frame))?;
        writeln!(out, "</script>")?;
    }
    rest = fill_mark(out, rest, "{{script}}", &SCRIPTS.concat())?;
    out.write_all(rest.as_bytes())
}

/// Writes the page up to `mark`, then `text`. Returns the rest of the page.
fn fill_mark<'a>(out: &mut impl Write, page: &'a str, mark: &str, text: &str) -> io::Result<&'a str> {
    let (before, after) = page.split_once(mark).unwrap_or((page, ""));
    out.write_all(before.as_bytes())?;
    out.write_all(text.as_bytes())?;
    Ok(after)
}

fn thinned(mut frame: Frame, shift: u32) -> Frame {
    frame.rows.retain(|row| is_drawn(row.id, shift));
    frame.rows.sort_unstable_by_key(|row| (row.species, row.id));
    frame
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn second_line_of_the_page_is_its_mark() {
        assert_eq!(PAGE.lines().nth(1), Some(lazygrid_sim::animation::PAGE_MARK));
    }

    #[test]
    fn page_has_a_mark_for_each_section() {
        let mut rest = PAGE;
        for mark in ["{{title}}", "{{scene}}", "{{frames}}", "{{script}}"] {
            rest = rest.split_once(mark).unwrap().1;
        }
        assert!(!rest.contains("{{") && SCRIPTS.iter().all(|script| !script.contains("</script")));
        assert!([PAGE, SCRIPTS[0], SCRIPTS[1]].iter().all(|text| !text.contains("://")));
    }
}
