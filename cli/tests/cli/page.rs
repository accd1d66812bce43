#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;

use lazygrid::{Algorithm, Pair, Space, Sphere};
use lazygrid_check::detectors::compare;
use lazygrid_check::{TestInput, Tolerance, difference};
use lazygrid_io::scenes::Scene;
use lazygrid_tests::browser::{browser, decoded};
use lazygrid_tests::command::Scratch;
use lazygrid_tests::skip;
use serde_json::{Value, json};

use crate::LAZYGRID;

const SWIFTSHADER: &str = "/usr/lib/chromium/vk_swiftshader_icd.json";

static PAGE: LazyLock<PathBuf> = LazyLock::new(|| {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("lazygrid.html");
    LAZYGRID.run(["page", "--output", path.to_str().unwrap()]).succeeds();
    path
});

fn tool(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/page").join(name)
}

fn has_dawn() -> bool {
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("../kernels/tint/node_modules/webgpu");
    let missing = if !package.exists() {
        "the npm package webgpu is not installed; `npm ci --prefix kernels/tint` does that"
    } else if !Path::new(SWIFTSHADER).exists() {
        "SwiftShader's Vulkan driver is not installed (Debian: apt-get install chromium-common)"
    } else {
        return true;
    };
    skip(Some("LAZYGRID_REQUIRE_TINT"), missing);
    false
}

fn on_dawn(args: &[&str]) -> Value {
    let output = Command::new("node")
        .arg(tool("node.mjs"))
        .args(args)
        .env("VK_DRIVER_FILES", SWIFTSHADER)
        .env("VK_ICD_FILENAMES", SWIFTSHADER)
        .env("XDG_RUNTIME_DIR", std::env::temp_dir())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    parsed(&output)
}

fn parsed(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}{text}");
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {said}{text}"))
}

struct Exported {
    scenario: TestInput,
    options: Vec<&'static str>,
    files: Value,
}

fn export(scratch: &Scratch, scenario: &TestInput, options: &[&'static str]) -> Exported {
    let number = fs::read_dir(scratch.path("")).unwrap().count();
    let [plan, spheres] = ["plan.json", "spheres.bin"].map(|name| scratch.path(&format!("{number}-{name}")));
    let count = scenario.spheres.len().to_string();
    let lengths = scenario.space.lengths_f32().map(|l| l.map_or("-".to_owned(), |l| l.to_string())).join(",");
    let mut args = vec!["plan", "--output", &plan, "--pairs", "65536"];
    if !options.contains(&"-n") {
        args.extend(["-n", &count]);
    }
    args.extend(options);
    if scenario.space.is_periodic() {
        args.extend(["--periodic", &lengths]);
    }
    LAZYGRID.run(&args).succeeds();
    let row = |sphere: &Sphere| [sphere.center.x, sphere.center.y, sphere.center.z, sphere.radius];
    let bytes: Vec<u8> = scenario.spheres.iter().flat_map(row).flat_map(f32::to_le_bytes).collect();
    fs::write(&spheres, bytes).unwrap();
    let files = json!({ "plan": plan, "spheres": spheres, "count": scenario.spheres.len() });
    Exported { scenario: scenario.clone(), options: options.to_vec(), files }
}

fn assert_pairs(exported: &Exported, replayed: &Value) {
    let Exported { scenario, options, .. } = exported;
    let numbers: Vec<u32> =
        replayed["pairs"].as_array().unwrap().iter().map(|number| number.as_u64().unwrap() as u32).collect();
    let found: Vec<Pair> = numbers.chunks_exact(2).map(|ij| Pair { i: ij[0], j: ij[1] }).collect();
    let expected = compare::expected(scenario).unwrap();
    assert!(!expected.is_empty(), "a scene without pairs shows nothing");
    let compared = difference(scenario, &found, &expected, Tolerance::Tangent);
    assert_eq!(compared, Ok(()), "{options:?}: {}", replayed["outcome"]);
    assert_eq!(replayed["outcome"]["found"], found.len());
}

#[test]
fn exported_plans_find_the_pairs_of_the_cpu_on_dawn() {
    if !has_dawn() {
        return;
    }
    let scratch = Scratch::new();
    let mixed = TestInput::from(Scene::FiveSizes.spheres(2000, 3));
    let mut exported = Vec::new();
    for algorithm in Algorithm::GPU {
        let with_subgroups =
            ["--algorithm", algorithm.name(), "--subgroups", "4", "--workgroup-memory", "32"];
        exported.push(export(&scratch, &mixed, &with_subgroups[..2]));
        exported.push(export(&scratch, &mixed, &with_subgroups));
    }
    let periodic =
        TestInput { space: Space::periodic([Some(40.0), None, Some(60.0)]).unwrap(), ..mixed.clone() };
    for algorithm in ["lazy-grid", "cell-list"] {
        exported.push(export(&scratch, &periodic, &["--algorithm", algorithm]));
    }
    // The plan has room for more spheres than the buffer's count.
    exported.push(export(&scratch, &mixed, &["--algorithm", "cell-list", "-n", "5000", "--count-in-buffer"]));
    // Crowded cells need indirect dispatches.
    let crowded = TestInput::from(vec![Sphere::new([3.0, -1.0, 7.0], 0.25); 300]);
    exported.push(export(&scratch, &crowded, &["--algorithm", "lazy-grid"]));
    let manifest: Value = exported.iter().map(|exported| exported.files.clone()).collect();
    let manifest = scratch.write("manifest.json", &manifest.to_string());
    let replayed = on_dawn(&["replay", &manifest]);
    assert_eq!(replayed.as_array().map(Vec::len), Some(exported.len()));
    for (exported, replayed) in exported.iter().zip(replayed.as_array().unwrap()) {
        assert_pairs(exported, replayed);
    }
}

#[test]
fn page_is_one_small_file_that_loads_nothing() {
    let page = fs::read_to_string(&*PAGE).unwrap();
    assert!(page.len() <= 600_000, "{} bytes", page.len());
    assert!(page.contains("default-src 'none'") && !page.contains("://") && !page.contains("{{"));
}

/// `full` runs all variants, which takes minutes in software.
static FULL: LazyLock<&str> =
    LazyLock::new(|| if std::env::var_os("LAZYGRID_TEST_FULL").is_some() { "full" } else { "" });

fn assert_right(report: &Value, least: u64) {
    assert_eq!(report["wrong"], 0, "{:#}", report["failures"]);
    assert_eq!(report["ok"], true);
    assert_eq!(report["left_out"], json!([]));
    let least = if FULL.is_empty() { least } else { 800 };
    assert!(report["scenes"]["searches"].as_u64().unwrap() > least, "{}", report["scenes"]);
}

#[test]
fn check_of_the_page_finds_no_fault_on_dawn() {
    // Chromium runs the same scripts on the same Dawn.
    if has_dawn() && (browser().is_none() || !FULL.is_empty()) {
        assert_right(&on_dawn(&["check", PAGE.to_str().unwrap(), &FULL]), 50);
    }
}

#[test]
fn lost_device_ends_a_check_with_a_remedy() {
    if !has_dawn() {
        return;
    }
    let ended = on_dawn(&["check-lost", PAGE.to_str().unwrap()]);
    for (at, rows) in [3, 4].into_iter().enumerate() {
        assert_eq!(ended[at]["rows"], rows, "{ended}");
        let error = ended[at]["error"].as_str().unwrap();
        assert!(error.starts_with("The GPU was lost (") && error.contains("Reload the page"), "{error}");
    }
}

#[test]
fn device_with_the_least_limits_leaves_nothing_out() {
    if !has_dawn() {
        return;
    }
    let small = on_dawn(&["check-small", PAGE.to_str().unwrap()]);
    let report = &small["report"];
    assert_eq!((&report["wrong"], &report["ok"]), (&0.into(), &true.into()), "{:#}", report["failures"]);
    assert_eq!(report["left_out"], json!([]));
    let largest = small["largest"].as_str().unwrap();
    assert!(largest.contains(" needed, this GPU offers "), "{largest}");
    let exhausted = small["exhausted"].as_str().unwrap();
    assert!(exhausted.ends_with("the GPU is out of memory; choose fewer spheres"), "{exhausted}");
}

#[test]
fn page_uses_portable_kernels_if_subgroups_are_not_full() {
    if !has_dawn() {
        return;
    }
    let page = PAGE.to_str().unwrap();
    let right = on_dawn(&["probe", page]);
    assert_eq!(right, json!({ "texts": 1, "subgroups": "subgroups of 4" }));
    let altered = on_dawn(&["probe", page, "altered"]);
    assert_eq!(altered, json!({ "texts": 0, "subgroups": "no subgroups (subgroups are not full)" }));
}

#[test]
fn check_of_the_page_notices_a_wrong_number_of_pairs() {
    if !has_dawn() {
        return;
    }
    let report = on_dawn(&["check-altered", PAGE.to_str().unwrap()]);
    let failures = report["failures"].as_array().unwrap();
    assert!(!failures.is_empty() && report["ok"] == false && report["wrong"] == failures.len());
    assert!(failures.iter().all(|failure| failure["what"].as_str().unwrap().contains("are expected")));
}

#[test]
fn measurement_of_the_page_has_the_rows_of_lazygrid_check() {
    if !has_dawn() {
        return;
    }
    // One tile per submission divides the calls of the burst.
    let report = on_dawn(&["measure", PAGE.to_str().unwrap(), "3000"]);
    assert_eq!((&report["wrong"], &report["ok"]), (&0.into(), &true.into()), "{:#}", report["failures"]);
    let speeds = report["speeds"].as_array().unwrap();
    assert!(speeds.len() >= 2 * 4, "{} rows: {:#}", speeds.len(), report["left_out"]);
    for row in speeds {
        let [low, high] = [0, 1].map(|at| row["quartiles"]["busy_seconds"][at].as_f64().unwrap());
        assert!((low..=high).contains(&row["busy_seconds"].as_f64().unwrap()), "{row}");
        assert!(row["seconds"].as_f64().unwrap() > 0.0 && row["gpu"]["dispatches"].as_u64().unwrap() > 0);
    }
    let divided =
        |scene: &str| speeds.iter().filter(|row| row["scene"] == scene && row["divided"] == true).count();
    assert!(divided("burst") > 0 && divided("five-sizes") == 0, "{report:#}");
}

const SIZE: [usize; 2] = [1100, 700];

/// Opens the page until `until` is true. Returns the text of `#result`, the console and a screenshot.
fn visit(scratch: &Scratch, browser: &str, page: &str, until: &str) -> (String, Vec<String>, Vec<[u8; 3]>) {
    let (profile, picture) = (scratch.path("profile"), scratch.path("page.png"));
    let size = SIZE.map(|length| length.to_string());
    let output = Command::new("node")
        .arg(tool("browser.mjs"))
        .args([browser, &profile, &format!("file://{page}"), &size[0], &size[1], until, &picture])
        .env("XDG_RUNTIME_DIR", std::env::temp_dir())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let visited = parsed(&output);
    let said = visited["said"].as_array().unwrap().iter().map(|line| line.as_str().unwrap().to_owned());
    (
        visited["result"].as_str().unwrap().to_owned(),
        said.collect(),
        decoded(&fs::read(picture).unwrap(), SIZE),
    )
}

#[test]
fn check_of_the_page_finds_no_fault_in_a_browser() {
    let Some(browser) = browser().filter(|_| has_dawn()) else { return };
    let page = format!("{}#check&{}", PAGE.display(), *FULL);
    let scratch = Scratch::new();
    let (result, said, _) =
        visit(&scratch, browser, &page, "document.getElementById('result').textContent !== ''");
    assert_right(&serde_json::from_str(&result).unwrap(), 300);
    assert_eq!(said, [""; 0]);
}

#[test]
fn overlapping_spheres_have_their_color_in_a_browser() {
    let Some(browser) = browser().filter(|_| has_dawn()) else { return };
    let scratch = Scratch::new();
    let colors = |filling: u32| {
        let page = format!("{}#scene=equal&spheres=1000&filling={filling}&pause=4", PAGE.display());
        let until = "window.page?.scene.paused && !window.page.scene.stage.showing";
        let (_, said, pixels) = visit(&scratch, browser, &page, until);
        assert_eq!(said, [""; 0]);
        let scene = pixels.chunks_exact(SIZE[0]).flat_map(|row| &row[..SIZE[0] - 360]);
        let (mut orange, mut blue) = (0, 0);
        for &[r, _, b] in scene {
            orange += usize::from(i16::from(r) > i16::from(b) + 60);
            blue += usize::from(i16::from(b) > i16::from(r) + 30);
        }
        (orange, blue)
    };
    let (few, many) = (colors(1), colors(20));
    // 8 % of the spheres have a neighbor at a filling of 1 %, and 80 % at 20 %.
    assert!(few.0 > 20 && few.1 > 8 * few.0, "orange and blue pixels: {few:?}");
    assert!(many.0 > 2 * many.1, "orange and blue pixels: {many:?}");
}

#[test]
fn controls_change_the_scene_in_a_browser() {
    let Some(browser) = browser().filter(|_| has_dawn()) else { return };
    let scratch = Scratch::new();
    let page = format!("{}#scene=equal&spheres=1000&filling=5&pause=2", PAGE.display());
    let until = format!(
        "(() => {{ if (window.tried === undefined) {{ window.tried = false; ({})().catch((error) => error.stack)\
         .then((report) => {{ window.tried = true; document.getElementById('result').textContent = \
         JSON.stringify(report); }}); }} return window.tried; }})()",
        include_str!("page/controls.js")
    );
    let (result, said, _) = visit(&scratch, browser, &page, &until);
    assert_eq!(said, [""; 0]);
    let report: Value = serde_json::from_str(&result).unwrap();
    let numbers = |section: &str, name: &str| -> Vec<f64> {
        let rows = report[section].as_array().unwrap_or_else(|| panic!("{report:#}"));
        rows.iter().map(|row| row[name].as_f64().unwrap_or(f64::NAN)).collect()
    };
    let kinds = numbers("kinds", "pairs");
    assert!(kinds.len() == 5 && kinds.iter().all(|&pairs| pairs > 0.0), "{kinds:?}");
    let found = numbers("algorithms", "pairs");
    assert!(found.len() == 6 && found.iter().all(|&pairs| pairs == found[1]), "{:#}", report["algorithms"]);
    for row in &report["algorithms"].as_array().unwrap()[1..] {
        assert_eq!(row["algorithm"], row["value"]);
    }
    let fillings = numbers("fillings", "pairs");
    assert!(fillings[1] > 10.0 * fillings[0], "{fillings:?}");
    assert_eq!(numbers("sizes", "count"), [3000.0, 1000.0]);
    assert!(report["refused"]["note"].as_str().unwrap().contains("tests all pairs"), "{}", report["refused"]);
    assert_eq!(report["paused"][0], report["paused"][1]);
    assert_eq!(report["label"], "Pause");
    let times = numbers("speeds", "time");
    assert!(times[0] == times[1] && times[2] > times[1], "{times:?}");
    assert_eq!((&report["stopped"], &report["continued"]), (&true.into(), &true.into()));
    let views = report["views"].as_array().unwrap();
    let [turn, tilt, distance] = ["turn", "tilt", "distance"].map(|name| numbers("views", name));
    assert!(turn[1] < turn[0] && tilt[1] > tilt[0] && distance[1] == distance[0], "{views:#?}");
    assert!(distance[2] < distance[1] && turn[2] == turn[1], "{views:#?}");
    assert!(distance[3] > distance[2] && turn[3] == turn[2], "{views:#?}");
    assert_eq!(views[4], views[0]);
    assert_eq!(report["tabs"], json!([true, false, "Measure", false, true]));
    assert_eq!(report["copied"]["wrong"], 0);
    assert!(report["back"]["pairs"].as_f64().unwrap() > 0.0, "{}", report["back"]);
    let hurried = &report["hurried"];
    assert_eq!(
        (&hurried["failures"], &hurried["note"], &hurried["count"]),
        (&json!([]), &"".into(), &3000.into())
    );
}

fn failure_with(device: &str, until: &str) -> Option<String> {
    let browser = browser().filter(|_| has_dawn())?;
    let scratch = Scratch::new();
    let altered = scratch.path("altered.html");
    let page = fs::read_to_string(&*PAGE).unwrap();
    fs::write(&altered, page.replacen("Player.open(navigator.gpu)", &format!("Player.open({device})"), 1))
        .unwrap();
    let (result, said, _) = visit(&scratch, browser, &altered, until);
    assert_eq!(said, [""; 0]);
    let report: Value = serde_json::from_str(&result).unwrap();
    assert_eq!((&report["wrong"], &report["ok"]), (&1.into(), &false.into()));
    Some(report["failures"][0]["what"].as_str().unwrap().to_owned())
}

#[test]
fn page_without_webgpu_names_the_missing_feature() {
    let until = "document.getElementById('failure').textContent !== ''";
    let Some(what) = failure_with("undefined", until) else { return };
    assert!(what.contains("no WebGPU"), "{what}");
}

#[test]
fn page_whose_device_is_lost_says_what_to_do() {
    let until = "window.page?.player.device.destroy(), document.getElementById('failure').textContent !== ''";
    let Some(what) = failure_with("navigator.gpu", until) else { return };
    assert!(what.contains("was lost") && what.contains("Reload the page"), "{what}");
}
