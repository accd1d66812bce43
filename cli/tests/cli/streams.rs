#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};

use lazygrid_io::scenes::Scene;
use lazygrid_tests::command::{Run, Scratch, data, has_gpu, npy, npy_bytes, table};

use crate::{FRAME, LAZYGRID, SPHERES, detect};

fn fed<const N: usize>(input: &[u8], args: [&str; N]) -> Run {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lazygrid"));
    command.args(["detect", "--backend", "cpu"]).args(args).env_remove("RUST_LOG");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let _ = child.stdin.take().unwrap().write_all(input);
    child.wait_with_output().unwrap().into()
}

#[test]
fn standard_input_is_read_as_a_file_is() {
    let pour = fs::read(data("lammps-pour.dump")).unwrap();
    assert_eq!(fed(&pour, ["-", "--json"]).succeeds().json()["pairs"], 3072);
    assert_eq!(fed(FRAME.repeat(3).as_bytes(), ["-", "--json"]).succeeds().json_lines().len(), 3);
    let npy = npy_of_two();
    assert_eq!(fed(&npy, ["-", "--json"]).succeeds().json()["pairs"], 1);
    let run = fed(b"x,y,z,r\n1,2,3,four\n", ["-"]).fails();
    assert!(run.err.contains("error: standard input, line 2: r 'four' is not a number"), "{}", run.err);
    assert!(fed(b"", ["-"]).fails().err.contains("standard input: neither the name nor the content"));
}

fn npy_of_two() -> Vec<u8> {
    let scratch = Scratch::new();
    let file = scratch.path("two.npy");
    LAZYGRID.run(["generate", "point", "-n", "2", "-o", &file]).succeeds();
    fs::read(file).unwrap()
}

#[test]
fn pairs_go_to_standard_output_and_the_summary_aside() {
    let scratch = Scratch::new();
    let file = scratch.write("a.csv", SPHERES);
    let run = detect([&file, "-o", "-"]).succeeds();
    assert_eq!(run.out, "i,j\n0,1\n");
    assert!(
        run.err.contains("pairs      1\n") && run.err.contains("output     standard output\n"),
        "{}",
        run.err
    );
    let run = detect([&file, "-o", "-", "--json"]).succeeds();
    assert!(run.out == "i,j\n0,1\n" && run.err.starts_with("{\"frame\":0"), "{}", run.err);
    assert_eq!(detect([&file, "-o", "-", "--neighbors"]).succeeds().out, "i,j\n0,1\n1,0\n");
    assert_eq!(fed(SPHERES.as_bytes(), ["-", "-o", "-"]).succeeds().out, "i,j\n0,1\n");

    let [pour, array] = [data("lammps-pour.dump"), scratch.path("pairs.npy")];
    detect([&pour, "-o", &array]).succeeds();
    for most in ["4000", "100"] {
        let run = Command::new(env!("CARGO_BIN_EXE_lazygrid"))
            .args([
                "detect",
                &pour,
                "--backend",
                "cpu",
                "-o",
                "-",
                "--output-format",
                "npy",
                "--max-pairs",
                most,
            ])
            .output()
            .unwrap();
        assert!(run.stdout == fs::read(&array).unwrap(), "{most}");
    }
    let run = detect([&file, "-o", "-", "--neighbors", "--output-format", "npy"]);
    assert!(run.code == Some(2) && run.err.contains("standard output is one"), "{}", run.err);

    let frames = scratch.write("a.xyz", &FRAME.repeat(2));
    let run = detect([&frames, "-o", "-"]).fails();
    assert!(run.out.is_empty() && run.err.contains("several frames"), "{}", run.err);
    assert_eq!(detect([&frames, "-o", "-", "--frame", "1"]).succeeds().out, "i,j\n0,1\n");
    let one = scratch.write("one.xyz", &(FRAME.to_owned() + "\n \n"));
    assert_eq!(detect([&one, "-o", "-"]).succeeds().out, "i,j\n0,1\n");
    let run = LAZYGRID.run_with_closed_output(["detect", &file, "-o", "-"]);
    assert_eq!(run.code, Some(0), "{}", run.err);
    // A file must not be appended to while it is read.
    let both = fs::File::options().append(true).open(&file).unwrap();
    let run =
        Command::new(env!("CARGO_BIN_EXE_lazygrid")).args(["detect", &file, "-o", "-"]).stdout(both).output();
    assert_eq!(run.unwrap().status.code(), Some(2));
    let run = Command::new(env!("CARGO_BIN_EXE_lazygrid"))
        .args(["detect", "-", "-o", &file])
        .stdin(fs::File::open(&file).unwrap())
        .output();
    assert_eq!(run.unwrap().status.code(), Some(2));
    assert_eq!(fs::read_to_string(&file).unwrap(), SPHERES);
}

#[test]
fn compressed_files_come_and_go() {
    let scratch = Scratch::new();
    let plain = scratch.path("five.csv");
    LAZYGRID.run(["generate", "five-sizes", "-n", "2000", "-o", &plain]).succeeds();
    let expected = scratch.path("expected.csv");
    detect([&plain, "-o", &expected]).succeeds();
    let expected = fs::read(expected).unwrap();
    for (extension, magic) in [("gz", &b"\x1F\x8B"[..]), ("zst", &b"\x28\xB5\x2F\xFD"[..])] {
        for kind in ["csv", "npy", "xyz"] {
            let file = scratch.path(&format!("five.{kind}.{extension}"));
            LAZYGRID.run(["generate", "five-sizes", "-n", "2000", "-o", &file]).succeeds();
            let bytes = fs::read(&file).unwrap();
            assert!(bytes.starts_with(magic));
            let pairs = scratch.path(&format!("pairs.csv.{extension}"));
            detect([&file, "-o", &pairs]).succeeds();
            assert!(fs::read(&pairs).unwrap().starts_with(magic));
            assert!(decompressed(&pairs) == expected, "{file}");
            assert!(fed(&bytes, ["-", "-o", "-"]).succeeds().out.into_bytes() == expected, "{file}");
        }
    }
    let near = scratch.path("near.npy.gz");
    detect([&plain, "--neighbors", "-o", &near]).succeeds();
    assert!(scratch.names().contains(&"near.offsets.npy.gz".to_owned()), "{:?}", scratch.names());
    let run = detect([&plain, "-o", &scratch.path("pairs.gz")]);
    assert!(run.code == Some(2) && run.err.contains("--output-format"), "{}", run.err);
    detect([&plain, "-o", &scratch.path("pairs.gz"), "--output-format", "csv"]).succeeds();
    assert!(decompressed(&scratch.path("pairs.gz")) == expected);
}

fn decompressed(path: &str) -> Vec<u8> {
    use std::io::Read;

    let (bytes, mut text) = (fs::read(path).unwrap(), Vec::new());
    match path.ends_with("gz") {
        true => flate2::read::GzDecoder::new(&bytes[..]).read_to_end(&mut text).unwrap(),
        false => ruzstd::decoding::StreamingDecoder::new(&bytes[..]).unwrap().read_to_end(&mut text).unwrap(),
    };
    text
}

#[test]
fn ids_name_spheres_in_any_order_of_rows() {
    let scratch = Scratch::new();
    let spheres = Scene::FiveSizes.spheres(500, 3);
    let id = |k: usize| 7 * k as i64 + 100;
    let frame = |order: &[usize]| {
        let row = |&k: &usize| {
            let s = spheres[k];
            format!("{} {} {} {} {}\n", id(k), s.center.x, s.center.y, s.center.z, s.radius)
        };
        let rows: String = order.iter().map(row).collect();
        format!("ITEM: NUMBER OF ATOMS\n500\nITEM: ATOMS id x y z radius\n{rows}")
    };
    let forwards: Vec<_> = (0..500).collect();
    let shuffled: Vec<_> = (0..500).map(|k| k * 33 % 500).collect();
    let [first, second] = [&forwards, &shuffled].map(|order| frame(order));
    let file = scratch.write("a.dump", &(first + &second));
    let [csv, array, near] =
        ["p-{frame}.csv", "p-{frame}.npy", "n-{frame}.npy"].map(|name| scratch.path(name));
    for args in [[&csv, "--ids"], [&array, "--ids"]] {
        detect([&file, "-o", args[0], args[1]]).succeeds();
    }
    let text = fs::read_to_string(scratch.path("p-0.csv")).unwrap();
    assert_eq!(text, fs::read_to_string(scratch.path("p-1.csv")).unwrap());
    detect([&file, "-o", &scratch.path("rows.csv"), "--frame", "0"]).succeeds();
    let expected: Vec<_> =
        table(&scratch.path("rows.csv")).iter().map(|pair| pair.map(|k| id(k as usize))).collect();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("id_i,id_j"));
    let shown: Vec<_> = expected.iter().map(|[i, j]| format!("{i},{j}")).collect();
    assert!(shown.len() > 30 && lines.eq(shown.iter()));
    for frame in ["p-0.npy", "p-1.npy"] {
        let (shape, words) = npy::<4>(&scratch.path(frame), "<i8");
        assert_eq!(shape, format!("({}, 2)", expected.len()));
        let whole = |pair: &[i64; 2]| [pair[0] as u32, 0, pair[1] as u32, 0];
        assert!(words.iter().copied().eq(expected.iter().map(whole)));
    }
    detect([&file, "-o", &near, "--ids", "--neighbors"]).succeeds();
    let (_, ids) = npy::<2>(&scratch.path("n-1.ids.npy"), "<i8");
    assert!(ids.iter().copied().eq((0..500).map(|k| [id(k) as u32, 0])));
    let both = scratch.path("both.csv");
    detect([&file, "-o", &both, "--ids", "--neighbors", "--frame", "1"]).succeeds();
    assert_eq!(fs::read_to_string(&both).unwrap().lines().count(), 2 * expected.len() + 1);

    let twice = scratch.write("twice.csv", "id,x,y,z,r\n5,0,0,0,1\n6,0,0,0,1\n5,0,0,0,1\n");
    let refused = detect([&twice, "--ids", "-o", &both]).fails().err;
    assert!(refused.contains("frame 0: two spheres have the id 5"), "{refused}");
    let without = scratch.write("without.csv", SPHERES);
    assert!(
        detect([&without, "--ids", "-o", &both]).fails().err.contains("a column `id`, which --ids asks for")
    );
    assert_eq!(detect([&twice, "--ids"]).code, Some(2));
}

#[test]
fn digits_that_are_lost_are_said_once() {
    let scratch = Scratch::new();
    let file =
        scratch.write("a.csv", "x,y,z,r\n0.5,0,1.20000000000,1\n1,0.12345678901,0,1\n1,0.12345678901,0,1\n");
    let run = detect([&file, "--precision", "f32"]).succeeds();
    assert_eq!(run.err.matches("rounded").count(), 1, "{}", run.err);
    assert!(run.err.contains("a.csv, line 3: y is 0.12345678901, which the 32-bit numbers"), "{}", run.err);

    let file = scratch.write("b.csv", "x,y,z,r\n16777216,0,0,1\n16777217,0,0,1\n");
    let run = detect([&file, "--precision", "f32"]).succeeds();
    assert!(run.err.contains("b.csv, line 3: x is 16777217, which the 32-bit numbers"), "{}", run.err);
    let dump = |x: &str| {
        let head = "ITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS ff ff ff\n0 1000\n0 1\n0 1\n";
        let run = detect([
            &scratch.write("a.dump", &format!("{head}ITEM: ATOMS xs ys zs radius\n{x} 0.5 0.5 1\n")),
            "--precision",
            "f32",
        ]);
        run.succeeds().err
    };
    assert_eq!(dump("0.123457"), "");
    let warning = dump("0.1234567891");
    assert!(warning.contains("a.dump, line 8: xs is 0.1234567891, which the 32-bit numbers"), "{warning}");

    let rows = |value: f64| {
        let values = [0.0, 1.0, 2.0, 1.0, 0.5, value, value, 1.0].map(f64::to_le_bytes);
        npy_bytes("'<f8'", "(2, 4)", values.as_flattened())
    };
    let path = scratch.path("a.npy");
    fs::write(&path, rows(0.1)).unwrap();
    let run = detect([&path, "--precision", "f32"]).succeeds();
    assert_eq!(run.err.matches("rounded").count(), 1, "{}", run.err);
    assert!(run.err.contains("a.npy, row 1: y is 0.1, which the 32-bit numbers"), "{}", run.err);
    fs::write(&path, rows(0.125)).unwrap();
    assert_eq!(detect([&path, "--precision", "f32"]).succeeds().err, "");
}

#[test]
fn messages_speak_the_language_of_the_command() {
    let scratch = Scratch::new();
    let file = scratch.write("a.csv", SPHERES);
    for (args, message) in [
        (["--threads", "0"], "expected a whole number above zero; leave it out to use all threads"),
        (["--threads", "many"], "expected a whole number above zero"),
        (["--timeout", "0"], "expected a number of seconds above zero"),
        (["--radius=a=1", "--radius=a=2"], "--radius a is given twice, as 1 and 2; give one"),
        (["--timeout", "1"], "--timeout limits searches on a GPU and has no effect with --backend cpu"),
        (["--periodic=none", "--tilt=2.5,0,0"], "--tilt: xy is 2.5, but space is unbounded along y"),
        (["--periodic=10,-,10", "--tilt=2.5,0,0"], "--tilt: xy is 2.5, but space is unbounded along y"),
        (["--periodic=10,10,-", "--tilt=0,0,-1"], "--tilt: yz is -1, but space is unbounded along z"),
    ] {
        let run = detect([&file, args[0], args[1]]);
        assert!(run.code == Some(2) && run.err.contains(message), "{}", run.err);
        assert!(!run.err.contains("NonZero"), "{}", run.err);
    }
    let burst = data("smoldyn-burst.lst");
    let pairs = |acid: &str, base: &str| {
        let run =
            detect([&burst, "--json", "--radius", acid, "--radius", base, "--radius", "salt(solution)=0.2"]);
        run.succeeds().json()["pairs"].clone()
    };
    assert_eq!(pairs("acid=0.1", "base=0.15"), 35_236);
    assert_eq!(pairs("acid(solution)=0.1", "base=0.15"), 35_236);
    let run = detect([&burst, "--radius", "acid=0.1"]).fails();
    assert!(run.err.contains("'salt(solution)'; give it with --radius 'salt=R'"), "{}", run.err);
}

#[test]
fn timeout_error_names_its_option() {
    if !has_gpu() {
        return;
    }
    let scratch = Scratch::new();
    let file = scratch.path("point.npy");
    LAZYGRID.run(["generate", "point", "-n", "20000", "-o", &file]).succeeds();
    // On a busy machine a search may end before the wait for it begins.
    let args = ["detect", &file, "--backend", "gpu", "--count", "--timeout", "1e-9"];
    let mut runs = (0..20).map(|_| LAZYGRID.run(args));
    let run = runs.find(|run| run.code != Some(0)).expect("a search that did not finish").fails();
    assert!(run.err.contains("did not finish") && run.err.contains("(--timeout)"), "{}", run.err);
}

#[test]
fn standard_error_has_no_foreign_messages() {
    let scratch = Scratch::new();
    let file = scratch.write("a.csv", SPHERES);
    for args in [&["devices"][..], &["detect", &file]] {
        for directory in [None, Some("relative")] {
            let mut command = Command::new(env!("CARGO_BIN_EXE_lazygrid"));
            command
                .args(args)
                .env_remove("XDG_RUNTIME_DIR")
                .env_remove("WAYLAND_DISPLAY")
                .env_remove("RUST_LOG");
            directory.map(|directory| command.env("XDG_RUNTIME_DIR", directory));
            let run = Run::from(command.output().unwrap()).succeeds();
            assert_eq!(run.err, "", "{args:?}");
        }
    }
}
