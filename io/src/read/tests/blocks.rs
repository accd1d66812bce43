use std::fmt::Write;

use super::*;

struct Trickle {
    text: Vec<u8>,
    at: usize,
    state: u32,
}

impl Read for Trickle {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.state = self.state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let most = 1 + (self.state >> 15) as usize % 100_000;
        let rest = &self.text[self.at..];
        let length = most.min(rest.len()).min(buffer.len());
        buffer[..length].copy_from_slice(&rest[..length]);
        self.at += length;
        Ok(length)
    }
}

fn read(name: &str, text: &str) -> (Vec<Frame>, Vec<String>, Option<String>) {
    let mut all = Vec::new();
    for (threads, seed) in [(1, None), (3, None), (1, Some(7)), (3, Some(8))] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let text = text.as_bytes().to_vec();
        let input: Box<dyn Read + Send> = match seed {
            None => Box::new(Cursor::new(text)),
            Some(state) => Box::new(Trickle { text, at: 0, state }),
        };
        let options = Options { ids: name != "a.npy", ..Options::default() };
        let mut reader = Frames::new(name, input, None, options).unwrap();
        let (mut frames, mut error) = (Vec::new(), None);
        pool.install(|| {
            for frame in reader.by_ref() {
                match frame {
                    Ok(frame) => frames.push(frame),
                    Err(failure) => error = Some(failure.to_string()),
                }
            }
        });
        all.push((frames, reader.species().names().to_vec(), error));
    }
    assert!(all.windows(2).all(|w| w[0] == w[1]));
    all.remove(0)
}

fn name_of(k: usize) -> String {
    if k.is_multiple_of(50_000) { format!("rare-{k}") } else { format!("kind-{}", k % 3) }
}

fn row(k: usize) -> [f32; 4] {
    [k as f32, -0.5 * k as f32, 1e-3 * (k % 1000) as f32, (k % 7) as f32]
}

fn is_of(frame: &Frame, names: &[String], rows: std::ops::Range<usize>) {
    let species = frame.species.as_ref().unwrap();
    let ids = frame.ids.as_ref().map_or(&[][..], |ids| ids);
    assert_eq!([frame.spheres.len(), species.len(), ids.len()], [rows.len(); 3]);
    for (at, k) in rows.enumerate() {
        assert_eq!(bytemuck::cast::<_, [f32; 4]>(frame.spheres[at]), row(k), "row {k}");
        assert_eq!((&names[species[at] as usize], ids[at]), (&name_of(k), k as i64 - 5), "row {k}");
    }
}

fn csv(rows: usize) -> (String, Vec<usize>) {
    let (mut text, mut lines, mut line) = ("id,species,x,y,z,r\r\n".to_owned(), Vec::new(), 1);
    for k in 0..rows {
        if k.is_multiple_of(997) {
            text += "\n# a remark, with commas\r\n   \n";
            line += 3;
        }
        let [x, y, z, r] = row(k);
        writeln!(text, "{},{},{x},{y},{z},{r}", k as i64 - 5, name_of(k)).unwrap();
        line += 1;
        lines.push(line);
    }
    (text, lines)
}

#[test]
fn rows_come_in_order_and_errors_with_their_lines() {
    const ROWS: usize = 300_000;
    let (text, lines) = csv(ROWS);
    assert!(text.len() > 10 << 20);
    let (frames, names, error) = read("a.csv", text.trim_end());
    assert_eq!((frames.len(), error), (1, None));
    assert_eq!(names[..4], ["rare-0", "kind-1", "kind-2", "kind-0"]);
    is_of(&frames[0], &names, 0..ROWS);
    for wrong in [0, 4_000, 123_456, ROWS - 1] {
        let mut text: Vec<_> = text.lines().map(str::to_owned).collect();
        for at in [lines[wrong] - 1, lines[ROWS - 1] - 1] {
            text[at] = text[at].replacen(",", ",rare-", 1) + "x";
        }
        let (frames, _, error) = read("a.csv", &text.join("\n"));
        let start = format!("a.csv, line {}: r '", lines[wrong]);
        assert!(frames.is_empty() && error.as_ref().is_some_and(|e| e.starts_with(&start)), "{error:?}");
    }
}

#[test]
fn frames_of_all_sizes_follow_one_another() {
    let sizes = [150_000, 0, 3, 1, 100_000, 12];
    let (mut xyz, mut dump, mut first) = (String::new(), String::new(), 0);
    for size in sizes {
        write!(xyz, "{size}\nProperties=id:I:1:species:S:1:pos:R:3:radius:R:1\n").unwrap();
        write!(dump, "ITEM: NUMBER OF ATOMS\n{size}\nITEM: ATOMS id type x y z radius\n").unwrap();
        for k in first..first + size {
            let [x, y, z, r] = row(k);
            let row = format!("{} {} {x} {y} {z} {r}\n", k as i64 - 5, name_of(k));
            xyz += &row;
            dump += &row;
        }
        first += size;
    }
    for (name, text) in [("a.xyz", xyz), ("a.dump", dump)] {
        let (frames, names, error) = read(name, &text);
        assert_eq!((frames.len(), error), (sizes.len(), None));
        let mut first = 0;
        for (frame, size) in frames.iter().zip(sizes).filter(|(_, size)| *size > 0) {
            is_of(frame, &names, first..first + size);
            first += size;
        }
        let (lines, cut) = (text.lines().count(), text.trim_end().rsplit_once('\n').unwrap().0);
        let (frames, _, error) = read(name, cut);
        let end = format!("{name}, line {}: the file ends after 11 of 12 ", lines - 1);
        assert!(frames.len() == 5 && error.as_ref().is_some_and(|e| e.starts_with(&end)), "{error:?}");
    }
}

#[test]
fn a_frame_is_not_held_up_by_the_next() {
    struct Live(Vec<u8>);
    impl Read for Live {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            assert!(!self.0.is_empty(), "read beyond the frame");
            let length = self.0.len().min(buffer.len()).min(3000);
            buffer[..length].copy_from_slice(&self.0[..length]);
            self.0.drain(..length);
            Ok(length)
        }
    }
    let rows: String = (0..20_000).map(|k| format!("{k} 0 0 1\n")).collect();
    let text = format!("20000\nProperties=pos:R:3:radius:R:1\n{rows}");
    let mut frames = Frames::new("a.xyz", Live(text.into_bytes()), None, Options::default()).unwrap();
    assert_eq!(frames.next().unwrap().unwrap().spheres.len(), 20_000);
}

#[test]
fn a_disk_that_fails_later_does_not_hide_an_error() {
    struct Failing(Cursor<Vec<u8>>);
    impl Read for Failing {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            match self.0.read(buffer)? {
                0 => Err(io::Error::other("input/output error")),
                read => Ok(read),
            }
        }
    }
    let (text, lines) = csv(20_000);
    for (wrong, message) in [
        (true, format!("a.csv, line {}: r '", lines[19_999])),
        (false, "a.csv: cannot read: input/output".into()),
    ] {
        let text = if wrong { text.trim_end().to_owned() + "x\n" } else { text.clone() };
        let input = Failing(Cursor::new(text.into_bytes()));
        let error =
            Frames::new("a.csv", input, None, Options::default()).unwrap().next().unwrap().unwrap_err();
        assert!(error.to_string().starts_with(&message), "{error}");
    }
}
