#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::io::Read;
use std::process::{Command, Stdio};

use crate::skip;

/// Returns `None` without a browser, to skip the test. Panics instead if `LAZYGRID_REQUIRE_BROWSER` is set.
pub fn browser() -> Option<&'static str> {
    let known = ["chromium", "chromium-headless-shell", "google-chrome"];
    let runs = |name: &&str| {
        let version =
            Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        version.is_ok_and(|status| status.success())
    };
    let found = known.into_iter().find(runs);
    if found.is_none() {
        let why = format!(
            "no browser among {known:?} is installed; install one (Debian: apt-get install chromium)"
        );
        skip(Some("LAZYGRID_REQUIRE_BROWSER"), &why);
    }
    found
}

pub fn decoded(png: &[u8], size: [usize; 2]) -> Vec<[u8; 3]> {
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    let (mut rest, mut packed) = (&png[8..], Vec::new());
    let mut head = [0; 13];
    while rest.len() >= 12 {
        let length = u32::from_be_bytes(rest[..4].try_into().unwrap()) as usize;
        match &rest[4..8] {
            b"IHDR" => head.copy_from_slice(&rest[8..21]),
            b"IDAT" => packed.extend(&rest[8..8 + length]),
            _ => {}
        }
        rest = &rest[12 + length..];
    }
    let [width, height] = [0, 4].map(|at| u32::from_be_bytes(head[at..at + 4].try_into().unwrap()) as usize);
    assert_eq!((head[8], head[12], [width, height]), (8, 0, size));
    let channels = if head[9] == 6 { 4 } else { 3 };
    let mut bytes = Vec::new();
    flate2::read::ZlibDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
    let mut rows = vec![vec![0_u8; width * channels]];
    for line in bytes.chunks_exact(1 + width * channels) {
        let (above, mut row) = (rows.last().unwrap(), line[1..].to_vec());
        for k in 0..row.len() {
            let [left, corner] =
                if k < channels { [0; 2] } else { [row[k - channels], above[k - channels]].map(i32::from) };
            let up = i32::from(above[k]);
            let nearest =
                [left, up, corner].into_iter().min_by_key(|v| (left + up - corner - v).abs()).unwrap();
            let add = [0, left, up, (left + up) / 2, nearest][usize::from(line[0])];
            row[k] = row[k].wrapping_add(add as u8);
        }
        rows.push(row);
    }
    rows[1..].iter().flat_map(|row| row.chunks_exact(channels).map(|p| [p[0], p[1], p[2]])).collect()
}
