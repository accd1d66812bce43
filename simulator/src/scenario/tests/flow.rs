use std::path::PathBuf;
use std::sync::Arc;

use super::*;
use crate::scenario::Sweep;

const TEXT: &str = "time-step = 0.01
steps = 3
[boundary]
kind = 'periodic'
low = [0, 0, 0]
high = [2, 1, 1]
[flow]
profile = 'field'
file = 'flow.npy'
origin = [0, -1, 0]
spacing = [1, 1, 1]
[[species]]
name = 'A'
diffusion = 1
";

/// Writes a field of shape (3, 2, 1, 3) with the velocities `along` x.
pub(super) fn write(directory: &Path, along: [f32; 3]) -> PathBuf {
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2, 1, 3)}\n";
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for v in along.into_iter().flat_map(|v| [v, 0.0, 0.0, v, 0.0, 0.0]) {
        bytes.extend(v.to_le_bytes());
    }
    std::fs::write(directory.join("flow.npy"), bytes).unwrap();
    directory.join("scenario.toml")
}

fn parse_at(path: &Path, text: &str) -> Result<Scenario, String> {
    Scenario::parse(path, text.to_owned()).map_err(|error| error.to_string())
}

#[test]
fn flow_field_is_read_from_the_scenario_directory() {
    let directory = tempfile::tempdir().unwrap();
    let path = write(directory.path(), [1.0, 2.0, 4.0]);
    let Scenario { model, warnings, .. } = parse_at(&path, TEXT).unwrap();
    assert_eq!(warnings, [""; 0]);
    assert_eq!(model.flow_at([0.5, 0.0, 0.0]), [1.5, 0.0, 0.0]);
    assert_eq!(model.flow_at([3.5, 0.0, 7.0]), [3.0, 0.0, 0.0]);
}

#[test]
fn faulty_flow_files_are_named_by_line() {
    let directory = tempfile::tempdir().unwrap();
    let path = write(directory.path(), [1.0, f32::INFINITY, 4.0]);
    let error = parse_at(&path, TEXT).unwrap_err();
    assert!(error.contains("line 9, `file`: ") && error.contains("number at [1, 0, 0, 0] is inf"), "{error}");
    write(directory.path(), [1.0; 3]);
    for (right, wrong, message) in [
        ("flow.npy", "flaw.npy", "line 9, `file`: "),
        ("flow.npy", "flaw.npy", "cannot read"),
        (
            "profile = 'field'",
            "profile = 'plug'\nspeed = 1",
            "line 10, `file`: file goes with profile = \"field\"",
        ),
        (
            "origin",
            "velocity = [0, 0, 0]\norigin",
            "line 10, `velocity`: the velocities of a field are in its file",
        ),
        ("spacing = [1, 1, 1]", "", "line 8, `profile`: a field needs a file, and the spacing"),
        ("spacing = [1, 1, 1]", "spacing = [1, 0, 1]", "line 11, `spacing`: 0 is not a positive number"),
    ] {
        let error = parse_at(&path, &TEXT.replace(right, wrong)).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
    let shape = std::fs::read(directory.path().join("flow.npy")).unwrap();
    let shape = String::from_utf8_lossy(&shape[10..74]).into_owned();
    assert!(shape.contains("(3, 2, 1, 3)"), "{shape}");
    let mut bytes = std::fs::read(directory.path().join("flow.npy")).unwrap();
    let at = 10 + shape.find("1, 3)").unwrap();
    bytes[at..at + 5].copy_from_slice(b"3, 1)");
    std::fs::write(directory.path().join("flow.npy"), bytes).unwrap();
    let error = parse_at(&path, TEXT).unwrap_err();
    assert!(error.contains("has the shape [3, 2, 3, 1]; it must be (nx, ny, nz, 3)"), "{error}");
}

#[test]
fn unresolved_flow_fields_are_warned_of() {
    let directory = tempfile::tempdir().unwrap();
    let path = write(directory.path(), [0.0, 50.0, 0.0]);
    let messages = parse_at(&path, TEXT).unwrap().warnings;
    assert_warns(&messages, "by 50 %; time-step = 5.99e-3 is short enough");
    let messages =
        parse_at(&path, &TEXT.replace("0.01", "5.99e-3").replace("high = [2", "high = [4")).unwrap().warnings;
    assert_warns(&messages, "is from 0 to 2 µm along x and the boundary from 0 to 4");
}

#[test]
fn points_of_a_sweep_name_the_file_by_its_absolute_path() {
    let directory = tempfile::tempdir().unwrap();
    let path = write(directory.path(), [1.0; 3]);
    let sweep = Sweep::parse(&path, TEXT, &["seed=1,2".to_owned()]);
    assert!(sweep.unwrap_err().to_string().contains("no key 'seed'"));
    let text = format!("seed = 0\n{TEXT}");
    let sweep = Sweep::parse(&path, &text, &["seed=1,2".to_owned()]).unwrap().unwrap();
    let fields: Vec<_> =
        sweep.points.iter().map(|point| point.scenario.model.flow_field().unwrap().clone()).collect();
    assert!(Arc::ptr_eq(&fields[0], &fields[1]));
    let again = parse_at(Path::new("elsewhere/scenario.toml"), &sweep.points[1].scenario.text).unwrap();
    assert_eq!(again.model, sweep.points[1].scenario.model);
}

#[test]
fn drift_to_the_curved_wall_of_a_vessel_is_warned_of() {
    let warnings = |time_step: &str, drift: &str, more: &str| {
        let text = format!(
            "time-step = {time_step}\nsteps = 3\n[boundary]\nkind = 'cylinder'\naxis = 'z'\nradius = 5\n\
             [[species]]\nname = 'A'\ndiffusion = 100\ndrift = {drift}\n{more}"
        );
        parse(&text).unwrap().warnings
    };
    let [warning] = &warnings("0.01", "[0, -100, 0]", "")[..] else { panic!("no warning") };
    assert!(warning.contains("line 8, `name`: ") && warning.contains("curved wall"), "{warning}");
    let short = advised_step(warning);
    assert_eq!(warnings(short, "[0, -100, 0]", ""), [""; 0]);
    assert_eq!(warnings("0.01", "[0, 0, -100]", ""), [""; 0]);
    let side = "[[receiver]]\nname = 'rx'\nkind = 'wall'\nface = 'side'\n";
    assert_eq!(warnings("0.01", "[0, -100, 0]", side), [""; 0]);
}

#[test]
fn drift_to_a_plane_wall_is_warned_of_if_the_wall_mirrors_paths() {
    let warnings = |time_step: &str, contact: &str, more: &str| {
        let text = format!(
            "time-step = {time_step}\nsteps = 3\ncontact = '{contact}'\n[boundary]\nkind = 'reflecting'\nlow = [0, 0, 0]\n\
             high = [9, 9, 9]\n[[species]]\nname = 'A'\nradius = 0.1\ndiffusion = 100\n{more}"
        );
        parse(&text).unwrap().warnings
    };
    let drift = "drift = [0, 0, -100]";
    let [warning] = &warnings("0.01", "separate", drift)[..] else { panic!("no warning") };
    assert!(warning.contains("line 9, `name`: ") && warning.contains("plane wall"), "{warning}");
    let short = advised_step(warning);
    assert_eq!(warnings(short, "separate", drift), [""; 0]);
    assert_eq!(warnings("0.01", "separate", ""), [""; 0]);
    assert_eq!(warnings("0.01", "count", drift), [""; 0]);
    let plug = "[flow]\nprofile = 'plug'\nvelocity = [-100, 0, 0]";
    assert_eq!(warnings("0.01", "separate", plug).len(), 1);
    for speed in ["speed = 20", "thermal-speed = 5"] {
        let messages = warnings("0.01", "ignore", &format!("{drift}\n{speed}"));
        assert_warns(&messages, "because the species has a speed or thermal-speed");
        assert_eq!(warnings("0.01", "ignore", speed), [""; 0]);
    }
    let wall = |face: &str| format!("{drift}\n[[receiver]]\nname = 'rx'\nkind = 'wall'\nface = '{face}'\n");
    let messages = warnings("0.01", "ignore", &wall("high-z"));
    assert_warns(&messages, "because the opposite wall absorbs");
    assert_eq!(warnings(short, "ignore", &wall("high-z")), [""; 0]);
    // The drift leads to the absorbing wall, or no wall across its axis absorbs.
    assert_eq!(warnings("0.01", "ignore", &wall("low-z")), [""; 0]);
    assert_eq!(warnings("0.01", "ignore", &wall("high-x")), [""; 0]);
}

#[test]
fn diffusion_across_a_flow_is_warned_of() {
    let warnings = |time_step: &str, speed: &str| {
        let text = format!(
            "time-step = {time_step}\nsteps = 3\n[boundary]\nkind = 'cylinder'\nradius = 5\n[flow]\n\
             profile = 'poiseuille'\nspeed = {speed}\n[[species]]\nname = 'A'\ndiffusion = 50\n"
        );
        parse(&text).unwrap().warnings
    };
    // Convection makes 675 of 676 parts of the spread, and a step has 1.47 relaxation times.
    let [message] = &warnings("0.05", "1800")[..] else { panic!("no warning") };
    assert!(message.contains("line 10, `name`: a step takes A 2.236 µm by diffusion"), "{message}");
    assert!(message.contains("the spread along the vessel is 17.3 % too large"), "{message}");
    let short = advised_step(message);
    assert_eq!(short, "1.66e-2");
    assert_eq!(warnings(short, "1800"), [""; 0]);
    assert_eq!(warnings("0.017", "1800").len(), 1);
    assert_eq!(warnings("0.05", "10"), [""; 0]);
    assert_eq!(warnings("0.05", "0"), [""; 0]);
}

#[test]
fn diffusion_across_a_flow_field_is_warned_of() {
    let directory = tempfile::tempdir().unwrap();
    let path = write(directory.path(), [0.0, 50.0, 0.0]);
    // The flow changes on 1 µm: half of it is √(2DΔt) in 2.5e-3 s.
    let text = |time_step: &str| TEXT.replace("0.01", time_step).replace("diffusion = 1", "diffusion = 50");
    let messages = parse_at(&path, &text("2.6e-3")).unwrap().warnings;
    assert_warns(&messages, "the spread along the flow is too large");
    assert!(messages[0].contains("time-step = 2.49e-3 is short enough"), "{messages:?}");
    assert_eq!(parse_at(&path, &text("2.49e-3")).unwrap().warnings, [""; 0]);
    let path = write(directory.path(), [0.0, 40.0, 0.0]);
    assert_eq!(parse_at(&path, &text("2.6e-3")).unwrap().warnings, [""; 0]);
}
