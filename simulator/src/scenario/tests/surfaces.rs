use super::*;
use crate::{Adsorption, Axis, Ligand, Membrane, MembraneSurface, ReceptorType};

fn with(receiver: &str) -> String {
    let begin = GOOD.find("radius = 0.5\nkind").unwrap();
    let end = GOOD.find("[output]").unwrap();
    let text = format!("{}{receiver}\n{}", &GOOD[..begin], &GOOD[end..]);
    text.replace("[1, 0, 0]\nradius", "[-1, 0, 0]\nradius").replace("contact = \"separate\"", "")
}

#[test]
fn every_surface_is_read() {
    let ligand = |species, binding_rate, unbinding_rate| Ligand { species, binding_rate, unbinding_rate };
    let [fast, slow, base] = [ligand(0, 2.5, 0.5), ligand(0, 0.25, 0.0625), ligand(1, 2.5, 0.5)];
    let one = ReceptorType { count: 7, ligands: vec![fast, base] };
    let two = ReceptorType { count: 3, ligands: vec![base, slow] };
    let surfaces = [
        ("kind = \"reflecting\"", ReceiverKind::Reflecting),
        ("kind = \"partial\"\nrate = 3", ReceiverKind::Partial(Adsorption::Reactivity(3.0))),
        ("kind = \"partial\"\nprobability = 0.25", ReceiverKind::Partial(Adsorption::PerStep(0.25))),
        (
            "kind = \"receptors\"\ncount = 7\nbinding-rate = 2.5\nunbinding-rate = 0.5",
            ReceiverKind::Receptors(vec![one.clone()]),
        ),
        (
            "kind = \"receptors\"\n[[receiver.receptors]]\ncount = 7\nligands = [\
             { species = \"acid\", binding-rate = 2.5, unbinding-rate = 0.5 }, \
             { species = \"base\", binding-rate = 2.5, unbinding-rate = 0.5 }]\n\
             [[receiver.receptors]]\ncount = 3\nligands = [\
             { species = \"base\", binding-rate = 2.5, unbinding-rate = 0.5 }, \
             { species = \"acid\", binding-rate = 0.25, unbinding-rate = 0.0625 }]",
            ReceiverKind::Receptors(vec![one, two]),
        ),
    ];
    for (text, kind) in surfaces.clone() {
        let model = parse(&with(&format!("radius = 2\n{text}"))).unwrap().model;
        assert_eq!(model.receivers[0].kind, kind);
        assert!(!model.receivers[0].moves());
    }
    let moving = with("radius = 2\nkind = \"absorbing\"\nvelocity = [0, -1, 2]\ndiffusion = 3");
    let receiver = &parse(&moving).unwrap().model.receivers[0];
    assert_eq!((receiver.velocity, receiver.diffusion), ([0.0, -1.0, 2.0], 3.0));
    let (text, _) = &surfaces[3];
    let on_surface = with(&format!("radius = 2\n{text}\nsurface-diffusion = 0.75"));
    assert_eq!(parse(&on_surface).unwrap().model.receivers[0].surface_diffusion, 0.75);
    let misplaced = with("radius = 2\nkind = \"absorbing\"\nsurface-diffusion = 0.75");
    let error = parse(&misplaced).unwrap_err().to_string();
    assert!(
        error.contains("`surface-diffusion`: surface-diffusion goes with kind = \"receptors\""),
        "{error}"
    );
}

#[test]
fn lattice_makes_many_and_transmitter_has_a_body() {
    let many = "radius = 0.1\nkind = \"absorbing\"\nlattice = { size = [1, 1, 2], places = [2, 1, 4] }";
    let text = with(many).replace("name = \"tx\"", "name = \"tx\"\ncenter = [0, 0.5, 0]\nbody-radius = 0.25");
    let receivers = parse(&text).unwrap().model.receivers;
    assert_eq!(receivers.len(), 9);
    assert_eq!((receivers[3].name.as_str(), receivers[3].center), ("rx-3", [-0.75, 0.0, -0.25]));
    let body = &receivers[8];
    assert_eq!((body.name.as_str(), &body.kind, body.radius), ("tx", &ReceiverKind::Reflecting, 0.25));
    assert_eq!((body.center, &body.sees), ([0.0, 0.5, 0.0], &vec![true; 2]));
    let moving = text.replace("body-radius = 0.25", "velocity = [1, 0, 0]\ndiffusion = 2");
    let model = parse(&moving).unwrap().model;
    let body = &model.receivers[8];
    assert_eq!((model.transmitters[0].carrier, body.radius, &body.sees), (Some(8), 0.0, &vec![false; 2]));
    assert_eq!((body.velocity, body.diffusion), ([1.0, 0.0, 0.0], 2.0));
    let outside =
        text.replace("\"periodic\"", "\"reflecting\"").replace("size = [1, 1, 2]", "size = [1, 1, 9]");
    let error = parse(&outside).expect_err("a place outside").to_string();
    assert!(error.contains("is outside the walls"), "{error}");
}

#[test]
fn fewer_dimensions_refuse_what_needs_three() {
    let plane = GOOD
        .replace("steps = 10", "steps = 10\ndimensions = 2")
        .replace("low = [-1, -1, -1]", "low = [-1, -1, 0]")
        .replace("high = [1, 1, 1.5]", "high = [1, 1, 0]");
    let model = parse(&plane).unwrap().model;
    let periodic = Axis::Periodic { low: -1.0, high: 1.0 };
    assert_eq!(model.boundary.axes, [periodic, periodic, Axis::Frozen]);
    let mistakes = [
        (
            "center = [1, 0, 0]",
            "center = [0, 0, 0.5]",
            "dimensions",
            "room for the vector [0.0, 0.0, 0.5] of rx",
        ),
        ("drift = [1, 0, 0]", "drift = [0, 0, 1]", "dimensions", "[0.0, 0.0, 1.0] of base"),
        ("dimensions = 2", "dimensions = 4", "dimensions", "4 dimensions are not 1, 2 or 3"),
        ("binding-radius = 1.5\nprobability = 0.5", "rate = 5", "rate", "needs three dimensions"),
        ("kind = \"periodic\"", "kind = \"cylinder\"\nradius = 3\nends = [0, 1]", "ends", "without ends"),
        ("kind = \"gaussian\", width", "kind = \"cylinder\", radius", "dimensions", "shape like that of tx"),
    ];
    for (right, wrong, key, message) in mistakes {
        let mut text = plane.replace(right, wrong);
        assert_ne!(text, plane, "{right}");
        if wrong.contains("ends") {
            text = text.replace("low = [-1, -1, 0]\nhigh = [1, 1, 0]\n", "");
        }
        assert_refused(parse(&text), key, message);
    }
}

#[test]
fn contradictory_surfaces_are_refused() {
    let mistakes = [
        ("kind = \"partial\"", "kind", "either a rate"),
        ("kind = \"partial\"\nrate = 1\nprobability = 0.5", "kind", "either a rate"),
        ("kind = \"absorbing\"\nrate = 1", "rate", "goes with kind = \"partial\""),
        ("kind = \"receptors\"\ncount = 1\nbinding-rate = 1", "kind", "an unbinding-rate in 1/s"),
        ("kind = \"receptors\"\nreceptors = []", "kind", "types in a list `receptors`"),
        (
            "kind = \"receptors\"\ncount = 1\nreceptors = [{ count = 1, ligands = [] }]",
            "kind",
            "types in a list `receptors`",
        ),
        (
            "kind = \"receptors\"\nspecies = [\"acid\"]\nreceptors = [{ count = 1, ligands = [\
             { species = \"base\", binding-rate = 1, unbinding-rate = 1 }] }]",
            "receptors",
            "leave out 'base'",
        ),
        (
            "kind = \"receptors\"\nreceptors = [{ count = 1, ligands = [\
             { species = \"base\", binding-rate = 1, unbinding-rate = 1 }, \
             { species = \"base\", binding-rate = 2, unbinding-rate = 1 }] }]",
            "receptors",
            "'base' is a ligand of these receptors twice",
        ),
        ("kind = \"absorbing\"\nreceptors = []", "receptors", "goes with kind = \"receptors\""),
        ("kind = \"partial\"\nrate = 1\ncount = 3", "count", "goes with kind = \"receptors\""),
        ("kind = \"partial\"\nprobability = 1.5", "probability", "1.5 is not a probability"),
    ];
    for (text, key, message) in mistakes {
        assert_refused(parse(&with(&format!("radius = 2\n{text}"))), key, message);
    }
    let text = with("radius = 2\nkind = \"partial\"\nrate = 1").replace("diffusion = 50\n", "");
    let error = parse(&text).expect_err("at rest").to_string();
    assert!(error.contains("`kind`") && error.contains("base does not"), "{error}");
}

#[test]
fn advice_about_surfaces_is_right_when_followed() {
    let surfaces = [
        ("radius = 0.2\nkind = \"reflecting\"", "are in the wrong places"),
        ("radius = 0.2\nkind = \"partial\"\nrate = 1", "are in the wrong places"),
        ("radius = 9\nkind = \"partial\"\nrate = 1\nvelocity = [200, 0, 0]", "by drift"),
        (
            "radius = 9\nkind = \"receptors\"\ncount = 1\nbinding-rate = 1\nunbinding-rate = 900",
            "bind and unbind within",
        ),
    ];
    for (text, message) in surfaces {
        let text = with(text).replace("high = [1, 1, 1.5]", "high = [90, 90, 90]");
        let find_warning = |text: &str| {
            let warnings = parse(text).unwrap().warnings;
            warnings.into_iter().find(|warning| warning.contains(message))
        };
        let warning =
            find_warning(&text).unwrap_or_else(|| panic!("{text}: {:?}", parse(&text).unwrap().warnings));
        let step = warning.split("time-step = ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
        assert_eq!(
            find_warning(&text.replace("time-step = 0.001", &format!("time-step = {step}"))),
            None,
            "{warning}"
        );
        let longer = 1.05 * step.parse::<f64>().unwrap();
        assert!(find_warning(&text.replace("0.001", &longer.to_string())).is_some(), "{warning}");
    }
}

#[test]
fn membranes_are_read_or_refused() {
    const MEMBRANE: &str = "[[membrane]]\nname = \"skin\"\naxis = \"y\"\nposition = 0.25\npermeability = 3\n\
                            species = [\"acid\"]\n";
    let text = |membranes: &str| GOOD.replace("contact = \"separate\"", "") + membranes;
    let model = parse(&text(MEMBRANE)).unwrap().model;
    let sees = vec![true, false];
    let surface = MembraneSurface::Plane { axis: 1, position: 0.25 };
    let expected = Membrane { name: "skin".into(), surface, permeability: 3.0, sees };
    assert_eq!(model.membranes, [expected]);
    let replaced = |from, to| MEMBRANE.replace(from, to);
    let absorbing = text(MEMBRANE).replace("\"transparent\"\nspecies = [\"base\"]", "\"absorbing\"");
    let reflecting = |step: &str| {
        let away = absorbing.replace("absorbing", "reflecting").replace("position = 0.25", "position = 0.75");
        away.replace("time-step = 0.001", &format!("time-step = {step}"))
    };
    for (text, key, message) in [
        (text(&replaced("0.25", "1")), "name", "is at 1 µm, where no plane fits"),
        (text(&replaced("\"y\"", "\"x\"").replace("acid", "base")), "name", "holds back base, which drifts"),
        (text(&(MEMBRANE.to_owned() + MEMBRANE)), "name", "has the same surface as skin"),
        (text(&replaced("= 3", "= -3")), "permeability", "-3 is not a number from 0"),
        (text(&replaced("[\"acid\"]", "[]")), "species", "so that no species is seen"),
        (GOOD.to_owned() + MEMBRANE, "name", "particles that collide"),
        (absorbing.clone(), "name", "meets receiver rx"),
        (
            reflecting("0.001"),
            "name",
            "is 0.250 µm from the surface of receiver rx, which reflects acid; the distance must",
        ),
    ] {
        assert_refused(parse(&text), key, message);
    }
    let moving = |step: &str| {
        let moves = "\"reflecting\"\nvelocity = [3, 4, 0]\ndiffusion = 2";
        reflecting(step).replace("\"reflecting\"", moves)
    };
    assert!(parse(&moving("0.001").replace("\"reflecting\"", "\"absorbing\"")).is_ok());
    for with_step in [&reflecting as &dyn Fn(&str) -> String, &moving] {
        let error = parse(&with_step("0.001")).expect_err("a surface near a membrane").to_string();
        let step = error.split("let time-step be ").nth(1).and_then(|rest| rest.split_whitespace().next());
        let step: f64 = step.expect("a time step").parse().expect("a number");
        assert!(parse(&with_step(&step.to_string())).is_ok(), "{error}");
        assert!(parse(&with_step(&(1.02 * step).to_string())).is_err(), "{error}");
    }
    let error = parse(&moving("0.001")).expect_err("a surface near a membrane").to_string();
    assert!(
        error.contains("which moves and reflects acid") && error.contains("the diffusion of both"),
        "{error}"
    );
}

#[test]
fn spherical_membranes_are_read_or_refused() {
    const SPHERE: &str = "[[membrane]]\nname = \"cell\"\ncenter = [0, 0, 0.5]\nradius = 0.25\npermeability = 3\n\
                          species = [\"acid\"]\n";
    let text = |membranes: &str| GOOD.replace("contact = \"separate\"", "") + membranes;
    let model = parse(&text(SPHERE)).unwrap().model;
    let surface = MembraneSurface::Sphere { center: [0.0, 0.0, 0.5], radius: 0.25 };
    let sees = vec![true, false];
    assert_eq!(model.membranes, [Membrane { name: "cell".into(), surface, permeability: 3.0, sees }]);
    let warning = parse(&text(SPHERE)).unwrap().warnings.join("\n");
    assert!(
        warning.contains("0.447 µm, which is long compared with the radius of 0.25 µm of cell"),
        "{warning}"
    );
    let short = text(SPHERE).replace("time-step = 0.001", "time-step = 1.95e-5");
    assert!(warning.contains("time-step = 1.95e-5 is short enough"), "{warning}");
    assert!(
        parse(&short).unwrap().warnings.iter().all(|warning| !warning.contains("which is long compared"))
    );
    let receiver = |motion: &str| {
        let kind = format!("\"absorbing\"\n{motion}");
        parse(&text(SPHERE).replace("\"transparent\"\nspecies = [\"base\"]", &kind))
            .unwrap()
            .warnings
            .join("\n")
    };
    let warning = receiver("diffusion = 2");
    assert!(warning.contains("takes rx 0.063 µm by diffusion and 0.000 µm by its velocity"), "{warning}");
    assert!(warning.contains("time-step = 9.76e-4 is short enough"), "{warning}");
    assert!(receiver("velocity = [0, 251, 0]").contains("0.251 µm by its velocity"));
    for motion in ["diffusion = 1.95", "velocity = [0, 249, 0]", ""] {
        assert!(!receiver(motion).contains("jump across"), "{motion}");
    }
    let replaced = |from, to| SPHERE.replace(from, to);
    let touching = replaced("[0, 0, 0.5]", "[0.5, 0.5, 0]");
    let absorbing = text(&touching).replace("\"transparent\"\nspecies = [\"base\"]", "\"absorbing\"");
    for (text, message) in [
        (
            text(&replaced("0, 0.5]", "0, 1.4]")),
            "has the radius 0.25 µm around [0.0, 0.0, 1.4], where no sphere fits",
        ),
        (text(&replaced("acid", "base")), "holds back base, which drifts"),
        (text(&(SPHERE.to_owned() + SPHERE)), "has the same surface as cell"),
        (
            text(&replaced("radius = 0.25", "position = 0.25")),
            "either axis and position, or center and radius",
        ),
        (absorbing, "meets receiver rx"),
    ] {
        let error = parse(&text).expect_err(message).to_string();
        assert!(error.contains("`name`") && error.contains(message), "{message}: {error}");
    }
}

#[test]
fn long_steps_to_surfaces_that_absorb_are_warned_of() {
    let warnings = |time_step: &str, more: &str| {
        let text = format!(
            "time-step = {time_step}\nsteps = 3\n{more}[[species]]\nname = 'A'\nradius = 0.5\ndiffusion = 2\n"
        );
        parse(&text).unwrap().warnings
    };
    let wall = |face: &str| format!("[[receiver]]\nname = '{face}'\nkind = 'wall'\nface = '{face}'\n");
    let walls = "[boundary]\nkind = 'reflecting'\nlow = [0, 0, 0]\nhigh = [6, 9, 9]\n";
    let disk =
        "dimensions = 2\n[[receiver]]\nname = 'disk'\nkind = 'absorbing'\ncenter = [0, 0, 0]\nradius = 2\n";
    let cylinder = format!("[boundary]\nkind = 'cylinder'\nradius = 4.5\n{}", wall("side"));
    for (text, warning, short) in [
        (disk.to_owned(), "for disk, a disk of radius 2 µm", "9.90e-1"),
        (cylinder, "for side, the side of a cylinder of radius 4.5 µm", "9.90e-1"),
        (
            walls.to_owned() + &wall("low-x") + &wall("high-x"),
            "one of two walls that absorb, 6 µm apart",
            "9.90e-1",
        ),
    ] {
        let found = warnings("1.01", &text);
        assert_warns(&found, warning);
        assert!(found[0].contains(&format!("time-step = {short} is short enough")), "{found:?}");
        assert_eq!(warnings(short, &text), [""; 0]);
    }
    let mixed = walls.to_owned() + &wall("low-x") + &wall("high-y");
    assert_warns(&warnings("1.01", &mixed), "for low-x, opposite to a wall that reflects, 6 µm apart");
    assert_eq!(warnings("0.99", &mixed), [""; 0]);
    assert_eq!(warnings("1.01", &disk.replace("dimensions = 2\n", "")), [""; 0]);
}
