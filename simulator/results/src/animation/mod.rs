//! A page that plays a run in any browser with WebGL 2. Positions have 16 bits per coordinate, relative to the frame's
//! extent, in base64.

mod scene;

use std::fs::File;
use std::io::{self, BufReader, Write};
use std::path::Path;

use lazygrid_io::write::base64;
use lazygrid_sim::animation::{Frame, Frames, is_drawn, moving_receivers};
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
    let (title, path) = (run.title(), run.directory.join("animation.html"));
    let (scene, shift) = read_scene(&run.scenario.model, &title, &frames, &series)
        .map_err(|source| Error::Read { path: frames.clone(), source })?;
    write_atomically(&path, |out| page(out, &scene, shift, &title, &frames))
}

fn open(frames: &Path) -> io::Result<Frames<BufReader<File>>> {
    File::open(frames).map(BufReader::new).map(Frames::new)
}

/// Returns the scene of all frames, and the shift of the thinnest.
fn read_scene(model: &Model, title: &str, frames: &Path, series: &Series) -> io::Result<(Scene, u32)> {
    let mut scene = Scene::new(model, title, series);
    let (species, centers, mut shift) = (model.species.len(), moving_receivers(model).count(), 0);
    for frame in open(frames)? {
        let frame = frame?;
        let is_known = frame.rows.iter().all(|row| (row.species as usize) < species);
        if !is_known || frame.centers.len() != centers || frame.shift > 32 {
            let message = format!("the frame of step {} is one of another model", frame.step);
            return Err(io::Error::new(io::ErrorKind::InvalidData, message));
        }
        shift = shift.max(frame.shift);
    }
    for frame in open(frames)? {
        scene.add_frame(&thinned(frame?, shift));
    }
    Ok((scene.finished(shift), shift))
}

fn page(out: &mut impl Write, scene: &Scene, shift: u32, title: &str, frames: &Path) -> io::Result<()> {
    let json = serde_json::to_string(&scene).map_err(io::Error::other)?;
    let title = title.replace('&', "&amp;").replace('<', "&lt;");
    let mut rest = PAGE;
    for (mark, text) in [("{{title}}", title), ("{{scene}}", json.replace('<', "\\u003c"))] {
        rest = fill_mark(out, rest, mark, &text)?;
    }
    rest = fill_mark(out, rest, "{{frames}}", "")?;
    for (at, frame) in open(frames)?.enumerate() {
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
    use std::num::NonZeroU32;
    use std::ops::ControlFlow;

    use lazygrid_sim::animation::Animation;
    use lazygrid_sim::scenario::Scenario;

    use super::*;

    #[test]
    fn damaged_frames_are_refused_by_name() {
        let directory = tempfile::tempdir().unwrap();
        let text = "time-step = 0.01\nsteps = 2\n[[species]]\nname = 'A'\n\
            [[transmitter]]\nname = 'tx'\nvelocity = [1, 0, 0]\nrelease = [{ species = 'A', count = 1 }]\n";
        let mut scenario = Scenario::parse(Path::new("s.toml"), text.to_owned()).unwrap();
        scenario.output.animation = Some(Animation { every: 1, particles: NonZeroU32::MAX });
        let run = Run::new(scenario, "s.toml", directory.path().join("out"));
        run.run(|_| ControlFlow::Continue(())).unwrap();
        write(&run).unwrap();
        let path = run.directory.join("animation.frames");
        let whole = std::fs::read(&path).unwrap();
        // Shift, number of moving receivers and species of the first frame.
        for word in [1, 5, 7] {
            let mut other = whole.clone();
            other[4 * word] ^= 33;
            std::fs::write(&path, other).unwrap();
            let error = write(&run).unwrap_err().to_string();
            assert!(error.starts_with(&path.display().to_string()), "{error}");
        }
        for length in [1, 3, whole.len() - 1] {
            std::fs::write(&path, &whole[..length]).unwrap();
            let error = write(&run).unwrap_err().to_string();
            assert!(error.starts_with(&path.display().to_string()), "{error}");
        }
    }

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
