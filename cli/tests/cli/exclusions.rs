use lazygrid_tests::command::{Scratch, data, table};

use crate::{LAZYGRID, detect_file};

const CHAIN: &str =
    "x,y,z,r,id,molecule\n0,0,0,0.5,10,1\n1,0,0,0.5,11,1\n2,0,0,0.5,9,2\n3,0,0,0.5,8,2\n4,0,0,0.5,7,0\n";

#[test]
fn rows_that_a_file_names() {
    let scratch = Scratch::new();
    let (file, output) = (scratch.write("chain.csv", CHAIN), scratch.path("pairs.csv"));
    let bonds = scratch.write("bonds.txt", "# bonds\n2 1\n3 2\n\n1 2\n");
    detect_file(&file, ["-o", &output, "--exclude", &bonds]).succeeds();
    assert_eq!(table(&output), [[0, 1], [3, 4]]);
    let all = scratch.path("all.csv");
    detect_file(&file, ["-o", &all]).succeeds();
    assert_eq!(detect_file(&file, ["--json", "--exclude", &all]).succeeds().json()["pairs"], 0);
    for (text, message) in [
        ("0 1\n4 5\n", "bonds.txt, frame 0: the excluded pair (4, 5) is out of range (5 and 5 spheres)"),
        ("0 1\n-1 2\n", "bonds.txt, frame 0: the excluded pair"),
        ("0 1 2\n", "bonds.txt, line 1: expected two whole numbers"),
    ] {
        let bonds = scratch.write("bonds.txt", text);
        let run = detect_file(&file, ["--exclude", &bonds]).fails();
        assert!(run.err.contains(message), "{}", run.err);
    }
    assert!(detect_file(&file, ["--exclude", "no-such-file"]).fails().err.contains("no-such-file"));
}

#[test]
fn ids_that_a_file_names() {
    let scratch = Scratch::new();
    let (file, output) = (scratch.write("chain.csv", CHAIN), scratch.path("pairs.csv"));
    let bonds = scratch.write("bonds.csv", "id_i,id_j\n11,9\n99,7\n7,8\n");
    detect_file(&file, ["--ids", "-o", &output, "--exclude", &bonds]).succeeds();
    assert_eq!(std::fs::read_to_string(&output).unwrap(), "id_i,id_j\n8,9\n10,11\n");
}

#[test]
fn excluded_ids_that_no_frame_has_are_warned_of() {
    let scratch = Scratch::new();
    let head = "Properties=pos:R:3:radius:R:1:id:I:1";
    let frames = format!("1\n{head}\n0 0 0 1 7\n2\n{head}\n0 0 0 1 7\n1 0 0 1 8\n");
    let (file, output) = (scratch.write("a.xyz", &frames), scratch.path("pairs-{frame}.csv"));
    for (pairs, warning) in
        [("7,8\n", None), ("7,8\n7,9\n5,6\n", Some("no frame has both ids of 2 of 3 pairs, first of 7,9"))]
    {
        let bonds = scratch.write("bonds.csv", pairs);
        let run = detect_file(&file, ["--ids", "-o", &output, "--exclude", &bonds]).succeeds();
        assert_eq!(run.err.contains("no frame has"), warning.is_some(), "{}", run.err);
        assert!(warning.is_none_or(|warning| run.err.contains(warning)), "{}", run.err);
    }
}

#[test]
fn molecules() {
    let scratch = Scratch::new();
    let (file, output) = (scratch.write("chain.csv", CHAIN), scratch.path("pairs.csv"));
    detect_file(&file, ["-o", &output, "--exclude-groups"]).succeeds();
    assert_eq!(table(&output), [[1, 2], [3, 4]]);
    detect_file(&file, ["-o", &output, "--exclude-groups", "--ids"]).succeeds();
    assert_eq!(std::fs::read_to_string(&output).unwrap(), "id_i,id_j\n7,8\n9,11\n");
    let atoms = "1 1 0 0 0 0.5\n2 1 1 0 0 0.5\n3 0 2 0 0 0.5\n4 0 3 0 0 0.5\n";
    let dump = format!(
        "ITEM: TIMESTEP\n7\nITEM: NUMBER OF ATOMS\n4\nITEM: BOX BOUNDS ff ff ff\n0 9\n0 9\n0 9\n\
         ITEM: ATOMS id mol x y z radius\n{atoms}"
    );
    detect_file(&scratch.write("a.dump", &dump), ["-o", &output, "--exclude-groups"]).succeeds();
    assert_eq!(table(&output), [[1, 2], [2, 3]]);
    let without = detect_file(&data("lammps-pour.dump"), ["--exclude-groups"]).fails();
    assert!(
        without.err.contains("`group`, `molecule` or `mol`, which --exclude-groups asks for"),
        "{}",
        without.err
    );
    let array = scratch.path("plain.npy");
    LAZYGRID.run(["generate", "point", "-n", "2", "-o", &array]).succeeds();
    let listing = scratch.write("a.lst", "A(up) 0 0 0 1\nA(up) 0 0 0 2\n");
    for args in [[&array, "--exclude-groups", "--json"], [&listing, "--exclude-groups", "--radius=A=1"]] {
        let run = detect_file(args[0], [args[1], args[2]]).fails();
        assert!(run.err.contains("which --exclude-groups asks for, found"), "{}", run.err);
    }
    let wrong = scratch.write("wrong.csv", &CHAIN.replace("10,1\n", "10,-1\n"));
    let wrong = detect_file(&wrong, ["--exclude-groups"]).fails();
    assert!(
        wrong.err.contains("line 2: expected groups as whole numbers below 2^32 - 1, 0 for none"),
        "{}",
        wrong.err
    );
}

#[test]
fn frames_without_spheres_keep_the_columns() {
    let scratch = Scratch::new();
    let head = "Properties=pos:R:3:radius:R:1:id:I:1:group:I:1";
    let text = format!("0\n{head}\n2\n{head}\n0 0 0 1 7 0\n1 0 0 1 8 0\n0\n{head}\n");
    let (file, bonds) = (scratch.write("a.xyz", &text), scratch.write("bonds.csv", "1,2\n"));
    for (name, columns) in [("p-{frame}.csv", "id_i,id_j\n"), ("n-{frame}.csv", "id_i,id_j\n")] {
        let neighbors = name.starts_with('n').then_some("--neighbors");
        let args =
            ["detect", "--backend", "cpu", &file, "--ids", "--exclude-groups", "--exclude", &bonds, "-o"];
        let output = scratch.path(name);
        LAZYGRID.run(args.into_iter().chain([&*output]).chain(neighbors)).succeeds();
        for frame in ["0", "2"] {
            let path = scratch.path(&name.replace("{frame}", frame));
            assert_eq!(std::fs::read_to_string(path).unwrap(), columns);
        }
    }
    assert_eq!(std::fs::read_to_string(scratch.path("p-1.csv")).unwrap(), "id_i,id_j\n7,8\n");
}
