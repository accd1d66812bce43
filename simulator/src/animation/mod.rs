//! A run as one page that plays it in three dimensions, in any browser with WebGL 2 and without a network.
//!
//! While the run goes on, the particles that are drawn are appended to a file (`record`). At its end the page is made of
//! that, of the model and of the series: what stands in the scene (`scene`), and the places of each frame, as 16 bits of
//! the frame's extent for each coordinate, in base64.

mod record;
mod scene;

use std::fs::File;
use std::io::{self, BufReader, Write};
use std::num::NonZeroU32;
use std::path::Path;

use lazygrid_io::write::base64;
use record::{Frame, Frames};
pub(crate) use record::{append, bytes_of};
use scene::Scene;

use crate::Model;
use crate::results::series::Series;

/// The options of an animation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Animation {
    /// Steps between frames.
    pub every: u32,
    /// The most particles that are drawn. Of more, all frames show those whose ids a hash chooses, half of
    /// them, a quarter, and so on.
    pub particles: NonZeroU32,
}

const PAGE: &str = include_str!("player.html");
const SCRIPTS: [&str; 2] = [include_str!("stage.js"), include_str!("player.js")];

/// Writes the page of a run that recorded its frames.
///
/// # Errors
/// Fails if the reader or the writer fails.
pub(crate) fn page(
    out: &mut impl Write,
    (model, title): (&Model, &str),
    frames: &Path,
    series: &Series,
) -> io::Result<()> {
    let open = || File::open(frames).map(BufReader::new).map(Frames::new);
    let mut scene = Scene::new(model, title, series);
    let mut shift = 0;
    for frame in open()? {
        shift = shift.max(frame?.shift);
    }
    for frame in open()? {
        scene.see(&thinned(frame?, shift));
    }
    let json = serde_json::to_string(&scene.finished(shift)).map_err(io::Error::other)?;
    // The title is a file's name.
    let title = title.replace('&', "&amp;").replace('<', "&lt;");
    let mut rest = PAGE;
    for (mark, text) in [("{{title}}", title), ("{{scene}}", json.replace('<', "\\u003c"))] {
        rest = put(out, rest, mark, &text)?;
    }
    rest = put(out, rest, "{{frames}}", "")?;
    for (at, frame) in open()?.enumerate() {
        let frame = thinned(frame?, shift);
        write!(out, "<script type=\"text/plain\" id=\"frame-{at}\">")?;
        base64(out, &scene::places(&frame))?;
        writeln!(out, "</script>")?;
    }
    rest = put(out, rest, "{{script}}", &SCRIPTS.concat())?;
    out.write_all(rest.as_bytes())
}

/// Writes a page up to a mark, and the text in place of it; returns what is left.
fn put<'a>(out: &mut impl Write, page: &'a str, mark: &str, text: &str) -> io::Result<&'a str> {
    let (before, after) = page.split_once(mark).unwrap_or((page, ""));
    out.write_all(before.as_bytes())?;
    out.write_all(text.as_bytes())?;
    Ok(after)
}

/// Without those that are too many in some other frame, species by species.
fn thinned(mut frame: Frame, shift: u32) -> Frame {
    frame.rows.retain(|row| record::is_drawn(row.id, shift));
    frame.rows.sort_unstable_by_key(|row| (row.species, row.id));
    frame
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_a_place_for_everything() {
        let mut rest = PAGE;
        for mark in ["{{title}}", "{{scene}}", "{{frames}}", "{{script}}"] {
            rest = rest.split_once(mark).unwrap().1;
        }
        assert!(!rest.contains("{{") && SCRIPTS.iter().all(|script| !script.contains("</script")));
        // Nothing is asked of a network.
        assert!([PAGE, SCRIPTS[0], SCRIPTS[1]].iter().all(|text| !text.contains("://")));
    }
}
