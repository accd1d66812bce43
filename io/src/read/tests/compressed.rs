use std::io::Write;

use flate2::write::GzEncoder;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};

use super::*;

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    compress_to_vec(bytes, CompressionLevel::Fastest)
}

#[test]
fn compressed_files_read_as_the_originals() {
    let text = "x,y,z,r\n1,2,3,0.5\n-4,5e-3,6.25,0\n".as_bytes();
    let (head, rest) = text.split_at(11);
    let skipped = [&[0x50, 0x2A, 0x4D, 0x18, 3, 0, 0, 0][..], b"abc"].concat();
    for (name, bytes) in [
        ("a.csv.gz", gzip(text)),
        ("a.csv.zst", zstd(text)),
        ("a.csv.gz", [gzip(head), gzip(rest)].concat()),
        ("a.csv.gz", [gzip(head), vec![0; 700], gzip(rest), vec![0; 1 << 19]].concat()),
        ("a.csv.zst", [zstd(head), skipped.clone(), zstd(rest)].concat()),
        ("a", [skipped, zstd(text)].concat()),
        ("a", gzip(text)),
        ("a.csv", zstd(text)),
    ] {
        assert_eq!(rows(name, bytes, &[]), TWO, "{name}");
    }
    let array = npy::tests::file(1, &arrays::header("<f4", false, 2), bytemuck::cast_slice(&TWO));
    assert_eq!(rows("a.npy.gz", gzip(&array), &[]), TWO);
    assert_eq!(rows("a.npy.zst", zstd(&array), &[]), TWO);
    assert_eq!(Format::from_extension(Path::new("run.lammpstrj.gz")), Some(Format::Lammps));
    assert_eq!(Format::from_extension(Path::new("a.gz")), None);
}

#[test]
fn damaged_compression_is_an_error() {
    let text = "x,y,z,r\n".to_owned() + &"1,2,3,0.5\n".repeat(100);
    for (name, whole) in [("a.csv.gz", gzip(text.as_bytes())), ("a.csv.zst", zstd(text.as_bytes()))] {
        for cut in [5, whole.len() / 2, whole.len() - 1] {
            let refused = refusal(name, &whole[..cut], &[]);
            assert!(refused.starts_with(&format!("{name}: cannot read: ")), "{cut}: {refused}");
        }
        let mut flipped = whole.clone();
        let at = if name.ends_with("gz") { whole.len() - 6 } else { whole.len() - 2 };
        flipped[at] ^= 1;
        let refused = refusal(name, flipped, &[]);
        assert!(refused.starts_with(&format!("{name}: cannot read: ")), "{refused}");
        let refused = refusal(name, [&whole[..], &[0, 0, 7]].concat(), &[]);
        assert!(refused.starts_with(&format!("{name}: cannot read: ")), "{refused}");
    }
}

#[test]
fn cut_or_foreign_compression_is_named() {
    let text = "x,y,z,r\n1,2,3,0.5\n";
    let cut = |whole: Vec<u8>, length: usize| whole[..length].to_vec();
    let [zipped, packed] = [gzip(text.as_bytes()), zstd(text.as_bytes())];
    for (bytes, message) in [
        (cut(zipped.clone(), zipped.len() - 1), "a.csv: cannot read: the gzip data end early"),
        (cut(zipped.clone(), 2), "a.csv: cannot read: the gzip data end early"),
        (
            [&zipped[..10], &[0xFF; 20]].concat(),
            "a.csv: cannot read: the gzip data are damaged: corrupt deflate stream",
        ),
        ([&packed[..], b"junk"].concat(), "Zstandard data are damaged: Read wrong magic number: 0x6B6E756A"),
        (
            b"\xFD7zXZ\0\0\0".to_vec(),
            "a.csv: the content is compressed by xz, which is not read; decompress it first",
        ),
        (b"BZh91AY".to_vec(), "compressed by bzip2"),
        (b"PK\x03\x04\x14".to_vec(), "compressed by zip"),
    ] {
        let refused = refusal("a.csv", bytes, &[]);
        assert!(refused.contains(message), "{refused}");
    }
    let refused = refusal("a.csv", cut(packed, 4), &[]);
    assert!(!refused.contains("Error {"), "{refused}");
}
