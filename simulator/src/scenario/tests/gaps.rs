use super::*;

/// A radius of 0.5 µm and a diffusion coefficient of 2 µm²/s: a time step of 1.01 s has a diffusion step of 2.01 µm.
fn warnings(time_step: &str, more: &str, drift: &str) -> Vec<String> {
    let text = format!(
        "time-step = {time_step}\nsteps = 3\n{more}[[species]]\nname = 'A'\nradius = 0.5\ndiffusion = 2\n\
         drift = {drift}\n"
    );
    parse(&text).unwrap().warnings
}

const NO_DRIFT: &str = "[0, 0, 0]";

fn sphere(name: &str, kind: &str, center: &str, radius: &str) -> String {
    format!("[[receiver]]\nname = '{name}'\nkind = {kind}\ncenter = {center}\nradius = {radius}\n")
}

fn reflecting(high: &str) -> String {
    format!("[boundary]\nkind = 'reflecting'\nlow = [0, 0, 0]\nhigh = {high}\n")
}

#[test]
fn long_steps_across_gaps_are_warned_of() {
    let [a, b] = ["[20, 20, 20]", "[35, 20, 20]"];
    let rx = |center: &str| sphere("rx", "'absorbing'", center, "5");
    let pair = rx(a) + &sphere("ry", "'absorbing'", b, "5");
    let body = rx(a) + &sphere("ry", "'reflecting'", b, "5");
    let near = reflecting("[90, 90, 90]") + &rx("[10.5, 20, 20]");
    let partial = reflecting("[90, 90, 90]") + &sphere("rx", "'partial'\nrate = 1", "[79.5, 20, 20]", "5");
    let image = "[boundary]\nkind = 'periodic'\nlow = [0, 0, 0]\nhigh = [90, 15, 90]\n".to_owned()
        + &rx("[20, 5, 20]");
    let vessel = "[boundary]\nkind = 'cylinder'\nradius = 10.5\n".to_owned() + &rx("[0, 0, 0]");
    for (text, message) in [
        (&pair, "the gap of 5.000 µm between rx and ry"),
        (&body, "the gap of 5.000 µm between rx and ry"),
        (&near, "the gap of 5.000 µm between rx and the wall low-x"),
        (&partial, "the gap of 5.000 µm between rx and the wall high-x"),
        (&image, "the gap of 5.000 µm between rx and its image in the periodic box"),
        (&vessel, "the gap of 5.000 µm between rx and the side of the vessel"),
    ] {
        let found = warnings("1.01", text, NO_DRIFT);
        assert_warns(&found, message);
        assert_eq!(advised_step(&found[0]), "9.90e-1", "{found:?}");
        assert_eq!(warnings("9.90e-1", text, NO_DRIFT), [""; 0]);
    }
    let touching = rx(a) + &sphere("ry", "'absorbing'", "[30, 20, 20]", "5");
    let resting = reflecting("[90, 90, 90]") + &sphere("rx", "'reflecting'", "[10.5, 20, 20]", "5");
    for text in [touching, resting] {
        assert_eq!(warnings("1.01", &text, NO_DRIFT), [""; 0], "{text}");
    }
}

/// The last two of 1331 receivers are 0.5 µm closer than the others, which are 5 µm apart.
#[test]
fn gaps_of_all_receivers_are_tested() {
    let many = "[[receiver]]\nname = 'cell'\nkind = 'absorbing'\ncenter = [0, 0, 0]\nradius = 5\n\
                lattice = { size = [165, 165, 165], places = [11, 11, 11] }\n";
    let last = |x: f32| sphere("last", "'absorbing'", &format!("[{x}, 75, 75]"), "5");
    let found = warnings("0.9", &(many.to_owned() + &last(89.5)), NO_DRIFT);
    assert_warns(&found, "the gap of 4.500 µm between cell-1330 and last");
    assert_eq!(warnings("0.9", &(many.to_owned() + &last(90.0)), NO_DRIFT), [""; 0]);
    let found = warnings("0.9", &(many.to_owned() + &last(80.0)), NO_DRIFT);
    assert_warns(&found, "last overlaps cell-1330, and both absorb the same particles");
}

#[test]
fn long_steps_to_a_sphere_that_an_absorbing_wall_cuts_are_warned_of() {
    let wall = |face: &str| format!("[[receiver]]\nname = 'w'\nkind = 'wall'\nface = '{face}'\n");
    for (kind, x) in [("'absorbing'", 3.0), ("'absorbing'", 5.6), ("'partial'\nrate = 1", 0.5)] {
        let text = reflecting("[90, 90, 90]") + &sphere("rx", kind, &format!("[{x}, 20, 20]"), "5");
        let found = warnings("1.01", &(text.clone() + &wall("low-x")), NO_DRIFT);
        assert_warns(&found, "long for rx, a sphere of radius 5 µm that an absorbing wall cuts");
        assert_eq!(advised_step(&found[0]), "9.90e-1", "{found:?}");
        assert_eq!(warnings("9.90e-1", &(text.clone() + &wall("low-x")), NO_DRIFT), [""; 0]);
        assert_eq!(warnings("1.01", &(text + &wall("high-x")), NO_DRIFT), [""; 0]);
    }
}

#[test]
fn drift_between_two_walls_in_long_steps_is_warned_of() {
    let walls = reflecting("[6, 90, 90]");
    let found = warnings("1.01", &walls, "[1, 0, 0]");
    assert_warns(&found, "which is long for two walls 5.000 µm apart");
    assert_eq!(advised_step(&found[0]), "9.90e-1", "{found:?}");
    assert_eq!(warnings("9.90e-1", &walls, "[1, 0, 0]"), [""; 0]);
    assert_eq!(warnings("1.01", &walls, "[0, 1, 0]"), [""; 0]);
    assert_eq!(warnings("1.01", &walls, NO_DRIFT), [""; 0]);
}

#[test]
fn planes_closer_than_some_steps_are_warned_of() {
    let plane = |name: &str, at: &str| {
        format!("[[membrane]]\nname = '{name}'\naxis = 'x'\nposition = {at}\npermeability = 1\n")
    };
    let boxed =
        |kind: &str, high: &str| format!("[boundary]\nkind = '{kind}'\nlow = [0, 0, 0]\nhigh = {high}\n");
    let [wide, narrow] = ["[90, 90, 90]", "[0.3125, 90, 90]"];
    let two = boxed("periodic", wide) + &plane("m", "40") + &plane("n", "40.3125");
    let wall = boxed("reflecting", wide) + &plane("m", "89.1875");
    let image = boxed("periodic", narrow) + &plane("m", "0.125");
    for (text, message) in [
        (&two, "the gap of 0.312 µm between m and n"),
        (&wall, "the gap of 0.312 µm between m and a wall"),
        (&image, "the gap of 0.312 µm between m and its periodic image"),
    ] {
        let found = warnings("1.01", text, NO_DRIFT);
        assert!(found.iter().any(|warning| warning.contains(message)), "{message}: {found:?}");
        assert_eq!(advised_step(&found[0]), "9.90e-1", "{found:?}");
        assert_eq!(warnings("9.90e-1", text, NO_DRIFT), [""; 0]);
    }
    let far = boxed("reflecting", wide) + &plane("m", "40") + &plane("n", "40.5");
    assert_eq!(warnings("1.01", &far, NO_DRIFT), [""; 0]);
}

#[test]
fn sphere_near_a_plane_or_in_a_narrow_box_has_no_right_equilibrium() {
    let sphere = "[[membrane]]\nname = 'm'\ncenter = [20, 20, 20]\nradius = 4\npermeability = 1\n";
    let boxed = |side: u32| {
        format!("[boundary]\nkind = 'periodic'\nlow = [0, 0, 0]\nhigh = [{side}, {side}, {side}]\n{sphere}")
    };
    let near = boxed(90) + "[[membrane]]\nname = 'n'\naxis = 'x'\nposition = 25\npermeability = 1\n";
    let message = warnings("1.01", &near, NO_DRIFT).join("\n");
    assert!(message.contains("neither the flux nor, so near n, the equilibrium is right"), "{message}");
    let crossing = warnings("1e-3", &near.replace("position = 25", "position = 22"), NO_DRIFT).join("\n");
    assert!(crossing.contains("n touches or crosses m: steps that reach both"), "{crossing}");
    let narrow = boxed(12).replace("[20, 20, 20]", "[6, 6, 6]");
    let message = warnings("1.01", &narrow, NO_DRIFT).join("\n");
    assert!(message.contains("so near its periodic image, the equilibrium is right"), "{message}");
    let message = warnings("1.01", &boxed(90), NO_DRIFT).join("\n");
    assert!(message.contains("the equilibrium is right, but the flux is not"), "{message}");
}

#[test]
fn surfaces_that_absorb_twice_are_refused() {
    let wall = |name: &str| format!("[[receiver]]\nname = '{name}'\nkind = 'wall'\nface = 'low-x'\n");
    let boxed = reflecting("[90, 90, 90]");
    let at = "[20, 20, 20]";
    let partial = "'partial'\nprobability = 0.5";
    for (one, two) in [
        (wall("rx"), wall("ry")),
        (sphere("rx", "'absorbing'", at, "5"), sphere("ry", "'absorbing'", at, "5")),
        (sphere("rx", "'absorbing'", at, "5"), sphere("ry", partial, at, "5")),
    ] {
        let text =
            format!("time-step = 1e-3\nsteps = 3\n{boxed}[[species]]\nname = 'A'\ndiffusion = 2\n{one}{two}");
        let message = "ry has the same surface as rx, and both would absorb the same particles; remove one";
        assert_refused(parse(&text), "name", message);
    }
    let apart = sphere("rx", "'absorbing'", at, "5") + &sphere("ry", "'absorbing'", "[25, 20, 20]", "5");
    assert_warns(&warnings("1e-3", &apart, NO_DRIFT), "ry overlaps rx, and both absorb the same particles");
}

#[test]
fn drift_to_a_wall_without_diffusion_is_warned_of() {
    let boxed = reflecting("[6, 90, 90]");
    let text = |time_step: &str, face: &str| {
        let wall = format!("[[receiver]]\nname = 'w'\nkind = 'wall'\nface = '{face}'\n");
        let species = "[[species]]\nname = 'A'\nradius = 0.5\ndrift = [2, 0, 0]\n";
        parse(&format!("time-step = {time_step}\nsteps = 3\n{boxed}{species}{wall}")).unwrap().warnings
    };
    let found = text("0.051", "low-x");
    assert_warns(&found, "a step takes A 0.102 µm by drift towards a wall, 5.000 µm from the opposite one");
    assert_eq!(advised_step(&found[0]), "4.99e-2");
    assert_eq!(text("4.99e-2", "low-x"), [""; 0]);
    assert_eq!(text("0.051", "high-x"), [""; 0]);
}

#[test]
fn steps_below_the_resolution_of_positions_are_warned_of() {
    let parsed = |time_step: &str, motion: &str| {
        let boxed = "[boundary]\nkind = 'periodic'\nlow = [0, 0, 0]\nhigh = [1000, 1000, 1000]\n";
        parse(&format!("time-step = {time_step}\nsteps = 3\n{boxed}[[species]]\nname = 'A'\n{motion}\n"))
            .unwrap()
            .warnings
    };
    for (motion, message) in [
        ("drift = [1, 0, 0]", "a step takes A 1.000e-6 µm by its velocity, but coordinates up to 1e3 µm"),
        ("diffusion = 1e-3", "a step takes A 4.472e-5 µm by diffusion, but coordinates up to 1e3 µm"),
    ] {
        let found = parsed("1e-6", motion);
        assert_warns(&found, message);
        assert_eq!(parsed(advised_step(&found[0]), motion), [""; 0]);
    }
    assert_eq!(parsed("1e-6", "drift = [1, 0, 0]\ndiffusion = 1"), [""; 0]);
    let receiver = "diffusion = 1\n[[receiver]]\nname = 'rx'\nkind = 'transparent'\ncenter = [0, 0, 0]\nradius = 1\n\
                    velocity = [0, 1, 0]";
    assert_warns(&parsed("1e-6", receiver), "a step takes rx 1.000e-6 µm by its velocity");
}
