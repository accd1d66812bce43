use super::*;

const BOX: &str = "kind = 'reflecting'\nlow = [-5, -5, -5]\nhigh = [5, 5, 5]";
const PERIODIC: &str = "kind = 'periodic'\nlow = [-5, -5, -5]\nhigh = [5, 5, 5]";
const SPHERE: &str = "kind = 'sphere'\nradius = 5";

fn warnings(boundary: &str, more: &str) -> Vec<String> {
    let text = format!(
        "time-step = 1e-3\nsteps = 3\n[boundary]\n{boundary}\n[[species]]\nname = 'A'\ndiffusion = 1\n{more}"
    );
    parse(&text).unwrap_or_else(|error| panic!("{error}")).warnings
}

fn released(boundary: &str, center: &str, shape: &str) -> Vec<String> {
    let release = "release = [{ species = 'A', count = 3 }]";
    let more = format!("[[transmitter]]\nname = 'tx'\ncenter = {center}\nshape = {{ {shape} }}\n{release}\n");
    warnings(boundary, &more)
}

#[test]
fn points_that_walls_mirror_are_warned_of() {
    let beyond = "of the points of transmitter tx are beyond the walls, which mirror them";
    for shape in [
        "kind = 'ball', inner-radius = 12, radius = 13",
        "kind = 'box', size = [11, 1, 1]",
        "kind = 'lattice', size = [30, 1, 1], places = [3, 1, 1]",
        "kind = 'cylinder', axis = 'x', radius = 1, length = 11",
    ] {
        assert_warns(&released(BOX, "[0, 0, 0]", shape), beyond);
    }
    for shape in
        ["kind = 'box', size = [10, 10, 10]", "kind = 'ball', radius = 5", "kind = 'gaussian', width = 2"]
    {
        assert_eq!(released(BOX, "[0, 0, 0]", shape), [""; 0], "{shape}");
    }
    assert_warns(&released(BOX, "[1, 0, 0]", "kind = 'ball', radius = 5"), beyond);
}

#[test]
fn shapes_longer_than_a_period_are_warned_of() {
    let lattice = "kind = 'lattice', size = [30, 1, 1], places = [3, 1, 1]";
    let found = released(PERIODIC, "[0, 0, 0]", lattice);
    assert_warns(&found, "the shape of transmitter tx is 30 µm long along x, more than the period of 10 µm");
    for shape in
        ["kind = 'ball', radius = 5", "kind = 'box', size = [10, 10, 10]", "kind = 'gaussian', width = 9"]
    {
        assert_eq!(released(PERIODIC, "[4, 4, 4]", shape), [""; 0], "{shape}");
    }
}

#[test]
fn shapes_mostly_outside_a_vessel_are_warned_of() {
    let shell = |inner: u32, outer: u32| format!("kind = 'ball', inner-radius = {inner}, radius = {outer}");
    let found = released(SPHERE, "[4, 0, 0]", &shell(12, 13));
    assert_warns(&found, "100.0 % of the points of transmitter tx are outside the vessel, so that some");
    assert_eq!(released(SPHERE, "[4, 0, 0]", &shell(3, 5)), [""; 0]);
}

#[test]
fn sources_outside_walls_are_warned_of() {
    let source = |boundary: &str, radius: f64| {
        let shape = format!("center = [0, 4, 0]\nshape = {{ kind = 'ball', radius = {radius} }}");
        warnings(boundary, &format!("[[source]]\nequation = '-> A'\nrate = 1\n{shape}\n"))
    };
    for boundary in [BOX, SPHERE] {
        assert_warns(&source(boundary, 2.0), "% of the shape of '-> A' is outside the walls, so that more");
        assert_eq!(source(boundary, 0.99), [""; 0]);
    }
    assert_warns(&source(PERIODIC, 5.1), "the shape of '-> A' is 10.2 µm long along x, more than");
}
