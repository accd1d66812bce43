#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::process::{Command, Stdio};

use lazygrid_tests::browser::{browser, decoded};
use lazygrid_tests::command::Scratch;
use serde_json::Value;

use crate::LAZYGRID;

const SCENARIO: &str = r#"
time-step = 0.001
steps = 40
seed = 5
[boundary]
kind = "periodic"
low = [-2, -2, -2]
high = [2, 2, 2]
[[species]]
name = "acid"
radius = 0.1
diffusion = 5
[[species]]
name = "base"
radius = 0.15
diffusion = 3
[[decay]]
equation = "base ->"
rate = 200
[[transmitter]]
name = "tx"
center = [-1, 0, 0]
shape = { kind = "ball", radius = 0.5 }
release = [{ species = "acid", count = 400 }]
[[transmitter]]
name = "tx-two"
center = [-1, 1.2, 0]
shape = { kind = "ball", radius = 0.5 }
release = [{ species = "base", count = 300 }]
[[receiver]]
name = "rx-one"
center = [1, 0, 0]
radius = 0.6
kind = "transparent"
[output]
every = 2
frames-every = 20
frames = ["npy"]
"#;

fn animated(scratch: &Scratch, name: &str, more: &[&str]) -> String {
    let (scenario, out) = (scratch.write("clouds.toml", SCENARIO), scratch.path(name));
    LAZYGRID.run(["simulate", &scenario, "--output", &out, "--animate"].iter().chain(more)).succeeds();
    out
}

fn between<'a>(text: &'a str, begin: &str, end: &str) -> &'a str {
    text.split_once(begin).unwrap().1.split_once(end).unwrap().0
}

fn scene(page: &str) -> Value {
    serde_json::from_str(between(page, "id=\"scene\">", "</script>")).unwrap()
}

fn from_base64(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => u32::from(c - b'A'),
        b'a'..=b'z' => u32::from(c - b'a') + 26,
        b'0'..=b'9' => u32::from(c - b'0') + 52,
        b'+' => 62,
        b'/' => 63,
        _ => panic!("'{c}' is no letter of base64"),
    };
    let four = |letters: &[u8]| {
        let known = letters.iter().filter(|&&c| c != b'=').count();
        let word = letters[..known].iter().fold(0, |word, &c| word << 6 | value(c)) << (6 * (4 - known));
        word.to_be_bytes()[1..known].to_vec()
    };
    text.as_bytes().chunks(4).flat_map(four).collect()
}

#[test]
fn the_page_has_every_particle_of_every_frame() {
    let scratch = Scratch::new();
    let out = animated(&scratch, "out", &["--animate-every", "4"]);
    let page = fs::read_to_string(out.clone() + "/animation.html").unwrap();
    assert!(!page.contains("://") && page.contains("default-src 'none'"));
    let scene = scene(&page);
    assert_eq!((&scene["title"], &scene["note"]), (&"clouds, seed 5".into(), &"".into()));
    let frames = scene["frames"].as_array().unwrap();
    let steps: Vec<u64> = frames.iter().map(|frame| frame["step"].as_u64().unwrap()).collect();
    assert_eq!(steps, (0..=10).map(|k| 4 * k).collect::<Vec<_>>());
    for step in [0, 20, 40] {
        let frame = &frames[step / 4];
        let npy = fs::read(format!("{out}/frame-{step:09}.npy")).unwrap();
        let end = 10 + usize::from(u16::from_le_bytes([npy[8], npy[9]]));
        let word = |bytes: &[u8]| <[u8; 4]>::try_from(bytes).unwrap();
        let mut expected: Vec<(u32, [f32; 3])> = npy[end..]
            .chunks_exact(24)
            .map(|row| {
                let point = [8, 12, 16].map(|at| f32::from_le_bytes(word(&row[at..at + 4])));
                (u32::from_le_bytes(word(&row[4..8])), point)
            })
            .collect();
        expected.sort_by_key(|&(species, _)| species);
        let count = |species| expected.iter().filter(|row| row.0 == species).count();
        assert_eq!(frame["counts"], serde_json::json!([count(0), count(1)]), "step {step}");
        assert_eq!(frame["present"], expected.len());
        let bytes = from_base64(between(&page, &format!("id=\"frame-{}\">", step / 4), "</script>"));
        assert_eq!(bytes.len(), 6 * expected.len(), "step {step}");
        for ((_, point), words) in expected.iter().zip(bytes.chunks_exact(6)) {
            for k in 0..3 {
                let [low, size] = ["low", "size"].map(|name| frame[name][k].as_f64().unwrap());
                let fraction = f64::from(u16::from_le_bytes([words[2 * k], words[2 * k + 1]])) / 65_535.0;
                let off = (low + fraction * size - f64::from(point[k])).abs();
                assert!(off < 1e-4, "axis {k} of step {step} is off by {off}");
            }
        }
    }
    let lines = scene["charts"][0]["lines"].as_array().unwrap();
    assert_eq!((&lines[0]["name"], &lines[0]["counts"][20]), (&"acid".into(), &400.into()));
    assert!(lines[1]["counts"][0] == 300 && lines[1]["counts"][20].as_u64().unwrap() < 10, "{}", lines[1]);
}

/// A rising receiver and little acid, as both have similar colors.
fn with_a_rising_receiver() -> String {
    let rising = "kind = \"transparent\"\n[[receiver]]\nname = \"rx-two\"\ncenter = [0, -1.2, 0]\nradius = 0.5\n\
                  kind = \"transparent\"\nvelocity = [0, 60, 0]";
    SCENARIO.replace("kind = \"transparent\"", rising).replace("count = 400", "count = 1")
}

#[test]
fn moving_receivers_are_drawn_at_their_positions() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("rising.toml", &with_a_rising_receiver()), scratch.path("out"));
    LAZYGRID.run(["simulate", &scenario, "--output", &out, "--animate"]).succeeds();
    let page = out.clone() + "/animation.html";
    let scene = scene(&fs::read_to_string(&page).unwrap());
    let moves: Vec<&Value> = scene["transceivers"].as_array().unwrap().iter().map(|t| &t["moves"]).collect();
    assert_eq!(moves, [&Value::Null, &Value::Null, &Value::Null, &0.into()]);
    let frames = scene["frames"].as_array().unwrap();
    let mut highest = f64::NEG_INFINITY;
    for frame in frames {
        let number = |value: &Value| value.as_f64().unwrap();
        let (center, expected) = (&frame["centers"][0], -1.2 + 60.0 * number(&frame["time"]));
        assert!((number(&center[1]) - expected).abs() < 1e-4, "{center} and not {expected}");
        assert_eq!((number(&center[0]), number(&center[2])), (0.0, 0.0));
        highest = highest.max(expected);
    }
    assert!((1.0..1.5).contains(&highest), "it goes to {highest}, and is to stay clear of the walls");
    let Some(browser) = browser() else { return };
    let shot = |hash: &str| screenshot(browser, &scratch, &page, hash, &[]);
    let row = |pixels: Vec<[u8; 3]>| {
        let rows = rows_of(&pixels, ACID);
        assert!(rows.len() > 500, "receivers have {} pixels", rows.len());
        rows.iter().sum::<usize>() / rows.len()
    };
    let [first, last] = ["frame=0", "frame=40"].map(|hash| row(shot(hash)));
    assert!(first > last + 30, "from row {first} to row {last}");
}

#[test]
fn a_resumed_animation_is_the_same_and_a_thinned_one_says_so() {
    let scratch = Scratch::new();
    let whole = animated(&scratch, "whole", &[]);
    let resumed = animated(&scratch, "parts", &["--steps", "17"]);
    let page = |out: &str| fs::read_to_string(format!("{out}/animation.html")).unwrap();
    assert_eq!(scene(&page(&resumed))["frames"].as_array().unwrap().len(), 18);
    let frames = resumed.clone() + "/animation.frames";
    fs::write(&frames, [fs::read(&frames).unwrap(), vec![1, 2, 3]].concat()).unwrap();
    animated(&scratch, "parts", &["--resume"]);
    assert!(page(&resumed) == page(&whole), "the page is another one");
    let scenario = scratch.path("clouds.toml");
    let run = LAZYGRID.run(["simulate", &scenario, "--output", &resumed, "--resume"]).fails();
    assert!(run.err.contains("it has an animation; give --animate --animate-every 1"), "{}", run.err);

    let few = scene(&page(&animated(&scratch, "few", &["--animate-particles", "200"])));
    assert_eq!(few["note"], "1 of 4 particles is drawn, chosen by its id");
    let drawn =
        |frame: &Value| frame["counts"].as_array().unwrap().iter().map(|c| c.as_u64().unwrap()).sum::<u64>();
    assert!(few["frames"].as_array().unwrap().iter().all(|frame| (50..=200).contains(&drawn(frame))));
    assert_eq!(few["frames"][0]["present"], 700);
}

const SIZE: [usize; 2] = [1000, 640];

fn screenshot(browser: &str, scratch: &Scratch, page: &str, hash: &str, more: &[&str]) -> Vec<[u8; 3]> {
    let shot = scratch.path("shot.png");
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--hide-scrollbars", "--force-device-scale-factor=1"])
        .args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--virtual-time-budget=2000"])
        .arg(format!("--window-size={},{}", SIZE[0], SIZE[1]))
        .arg(format!("--user-data-dir={}", scratch.path("profile")))
        .args(more)
        .arg(format!("--screenshot={shot}"))
        .arg(format!("file://{page}#{hash}"))
        .env("XDG_RUNTIME_DIR", std::env::temp_dir())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    decoded(&fs::read(shot).unwrap(), SIZE)
}

fn hued(pixels: &[[u8; 3]], like: [u8; 3]) -> usize {
    rows_of(pixels, like).len()
}

fn rows_of(pixels: &[[u8; 3]], like: [u8; 3]) -> Vec<usize> {
    let chroma = |[r, g, b]: [u8; 3]| {
        let mean = (f64::from(r) + f64::from(g) + f64::from(b)) / 3.0;
        let differences = [r, g, b].map(|c| f64::from(c) - mean);
        (differences, differences.iter().map(|c| c * c).sum::<f64>().sqrt())
    };
    let (wanted, size) = chroma(like);
    let rows = pixels.chunks_exact(SIZE[0]).take(SIZE[1] - 60);
    let is_like = |pixel: &&[u8; 3]| {
        let (chromaticity, pixel_size) = chroma(**pixel);
        let product: f64 = chromaticity.iter().zip(&wanted).map(|(a, b)| a * b).sum();
        pixel_size > 40.0 && product / (pixel_size * size) > 0.97
    };
    let found =
        |(at, row): (usize, &'_ [[u8; 3]])| vec![at; row[..SIZE[0] - 360].iter().filter(is_like).count()];
    rows.enumerate().flat_map(found).collect()
}

const ACID: [u8; 3] = [0x4C, 0x9B, 0xE8];
const BASE: [u8; 3] = [0xF2, 0x69, 0x5C];

#[test]
fn a_browser_shows_the_particles_and_time() {
    let Some(browser) = browser() else { return };
    let scratch = Scratch::new();
    let page = animated(&scratch, "out", &[]) + "/animation.html";
    let shot = |hash: &str, more: &[&str]| screenshot(browser, &scratch, &page, hash, more);
    let [first, last] = ["frame=0", "frame=40"].map(|hash| shot(hash, &[]));
    let counts = [&first, &last].map(|pixels| [ACID, BASE].map(|color| hued(pixels, color)));
    let [[acid, base], [acid_later, base_later]] = counts;
    assert!(acid > 500 && base > 2000, "{counts:?}");
    assert!(acid_later > 3 * acid && base_later < base / 5, "{counts:?}");
    let [below, above] = [ACID, BASE].map(|color| {
        let rows = rows_of(&first, color);
        rows.iter().sum::<usize>() / rows.len()
    });
    assert!(below > above + 50, "row {below} and row {above}");
    assert_ne!(shot("frame=0&turn=2.5", &[]), first);
    let without = shot("frame=0", &["--disable-3d-apis"]);
    assert_eq!([ACID, BASE].map(|color| hued(&without, color)), [0, hued(&without, BASE)]);
    assert!(hued(&without, [0xFF, 0x8A, 0x80]) > 100, "there is no message");
}
