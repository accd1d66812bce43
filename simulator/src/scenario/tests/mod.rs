mod chemotaxis;
mod flow;
mod gaps;
mod idle;
mod limits;
mod network;
mod rates;
mod shapes;
mod surfaces;

use super::*;
use crate::{Boundary, Contact, Reaction, ReactionRate, ReceiverKind, Schedule, Shape};

const GOOD: &str = r#"
time-step = 0.001
steps = 10
contact = "separate"

[boundary]
kind = "periodic"
low = [-1, -1, -1]
high = [1, 1, 1.5]

[[species]]
name = "acid"
radius = 0.1
diffusion = 100.0

[[species]]
name = "base"
diffusion = 50
drift = [1, 0, 0]

[[reaction]]
equation = "acid + base -> base"
binding-radius = 1.5
probability = 0.5

[[decay]]
equation = "base ->"
rate = 2.0

[[transmitter]]
name = "tx"
times = [0.0, 0.5]
shape = { kind = "gaussian", width = 0.5 }
release = [{ species = "acid", count = 3 }]

[[receiver]]
name = "rx"
center = [1, 0, 0]
radius = 0.5
kind = "transparent"
species = ["base"]

[output]
every = 5
frames = ["npy"]
"#;

fn parse(text: &str) -> Result<Scenario, Error> {
    Scenario::parse(Path::new("s.toml"), text.to_owned())
}

#[track_caller]
fn assert_refused(parsed: Result<Scenario, Error>, key: &str, message: &str) {
    let error = parsed.expect_err(message).to_string();
    assert!(error.contains(&format!("`{key}`: ")) && error.contains(message), "{message}: {error}");
}

#[track_caller]
fn assert_warns(warnings: &[String], message: &str) {
    assert!(warnings.len() == 1 && warnings[0].contains(message), "{warnings:?}");
}

fn advised_step(warning: &str) -> &str {
    warning.split("time-step = ").nth(1).unwrap().split(' ').next().unwrap()
}

#[track_caller]
fn assert_mistake(text: &str, [right, wrong]: [&str; 2], line: u32, key: &str, message: &str) {
    let mistaken = text.replace(right, wrong);
    assert_ne!(mistaken, text, "{right}");
    let error = parse(&mistaken).expect_err(wrong).to_string();
    assert!(error.starts_with(&format!("s.toml, line {line}, `{key}`: ")), "{wrong}: {error}");
    assert!(error.contains(message) && !error.contains('\n'), "{wrong}: {error}");
}

#[test]
fn every_key_is_read() {
    let Scenario { model, steps, seed, output, .. } = parse(GOOD).unwrap();
    assert_eq!((steps, seed, model.time_step, model.contact), (10, 0, 0.001, Contact::Separate));
    assert_eq!(model.boundary, Boundary::periodic([-1.0; 3], [1.0, 1.0, 1.5]));
    assert_eq!(model.species[1].drift, [1.0, 0.0, 0.0]);
    let reaction = Reaction {
        name: "acid + base -> base".into(),
        reactants: [0, 1],
        products: [None, Some(1)],
        binding_radius: 1.5,
        unbinding_radius: 0.0,
        chance: ReactionRate::PerStep(0.5),
    };
    assert_eq!(model.reactions, [reaction]);
    let decay = &model.decays[0];
    assert_eq!((decay.reactant, decay.products, decay.rate), (1, [None, None], 2.0));
    assert_eq!(model.transmitters[0].shape, Shape::Gaussian(0.5));
    assert_eq!(
        (&model.transmitters[0].schedule, &model.transmitters[0].release),
        (&Schedule::Times(vec![0.0, 0.5]), &vec![(0, 3)])
    );
    assert_eq!(
        (&model.receivers[0].kind, &model.receivers[0].sees),
        (&ReceiverKind::Transparent, &vec![false, true])
    );
    let expected = Output {
        every: 5,
        frames_every: 5,
        xyz: false,
        npy: true,
        checkpoint_every: None,
        arrow: false,
        animation: None,
    };
    assert_eq!(output, expected);
}

#[test]
fn a_mistake_is_named_by_line_and_key() {
    let mistakes = [
        ("time-step = 0.001", "time-step = -1", 2, "time-step", "-1 is not a positive number"),
        ("steps = 10", "steps = \"x\"", 3, "steps", "invalid type: string"),
        ("contact = \"separate\"", "contact = \"push\"", 4, "contact", "unknown variant `push`"),
        ("high = [1, 1, 1.5]", "high = [1, 1, -2]", 9, "high", "not above low"),
        ("radius = 0.1", "radios = 0.1", 13, "radios", "unknown field"),
        ("name = \"base\"", "name = \"acid\"", 17, "name", "two species 'acid'"),
        ("name = \"base\"", "name = \"pairs\"", 17, "name", "'pairs' is another column of the series"),
        ("drift = [1, 0, 0]", "drift = [1, 0]", 19, "drift", "invalid length 2"),
        (
            "acid + base -> base",
            "acid + bas -> base",
            22,
            "equation",
            "no species 'bas'; there are acid, base",
        ),
        ("acid + base -> base", "acid -> base", 22, "equation", "must have two reactants"),
        ("acid + base -> base", "acid + base", 22, "equation", "no '->'"),
        (
            "acid + base -> base",
            "acid <-> base",
            22,
            "equation",
            "'acid <-> base' goes both ways; write a reaction for each: 'acid -> base' and 'base -> acid'",
        ),
        ("acid + base -> base", "acid + base -> base + acid", 22, "equation", "changes nothing"),
        ("binding-radius = 1.5", "rate = 1.5", 24, "probability", "goes with binding-radius"),
        ("probability = 0.5", "probability = 1.5", 24, "probability", "1.5 is not a probability"),
        ("count = 3", "count = -3", 34, "release", "invalid value: integer `-3`"),
        ("kind = \"gaussian\", width", "kind = \"gaussian\", with", 33, "with", "unknown field"),
        ("radius = 0.5\n", "", 39, "kind", "a receiver needs a center and a radius"),
        ("[\"base\"]", "[\"salt\"]", 41, "species", "no species 'salt'"),
        ("every = 5", "every = 0", 44, "every", "nonzero"),
    ];
    for (right, wrong, line, key, message) in mistakes {
        assert_mistake(GOOD, [right, wrong], line, key, message);
    }
}

#[test]
fn messages_do_not_grow_with_the_file() {
    let long = "acid + ".repeat(5000);
    let dotted = "a.".repeat(50_000) + "a";
    let certain = "[[reaction]]\nequation = \"acid + base -> 0 + 0 + 0\"\nbinding-radius = 1.5\n";
    for (right, wrong, reason) in [
        ("acid + base -> base", format!("{long}acid"), "has no '->'"),
        ("acid + base -> base", format!("{long}acid <-> {long}base"), "goes both ways"),
        ("acid + base -> base", format!("acid + {} -> base", "x".repeat(10_000)), "there are acid, base"),
        ("acid + base -> base", format!("acid + base -> {long}acid"), "has 5001 products"),
        ("acid + base -> base", format!("{long}acid -> base"), "two reactants"),
        ("\"base ->\"", format!("\"base -> {long}acid\""), "at most two products"),
        ("rate = 2.0", format!("r{} = 2.0", "e".repeat(10_000)), "the nearest is `"),
        ("time-step", format!("{dotted} = 1\ntime-step"), "recursion limit"),
        ("rate = 2.0", format!("rate = \"{}\"", "nine ".repeat(2000)), "…\", expected"),
        ("name = \"base\"", format!("name = \"{}\"", "b".repeat(10_000)), "more than the limit of 255"),
        ("[[decay]]", format!("{}[[decay]]", certain.repeat(100)), "add up to 100.5 in a step"),
    ] {
        let text = GOOD.replacen(right, &wrong, 1);
        let error = parse(&text).expect_err("a mistake").to_string();
        assert!(error.chars().count() < 400 && error.contains(reason), "{} characters: {error}", error.len());
    }
}

#[test]
fn impossible_values_are_refused() {
    let walls = GOOD.replace("\"periodic\"", "\"reflecting\"");
    let elastic = "contact = \"elastic\"";
    let far = "center = [2.5, 0, 0]";
    let mistakes = [
        ("radius = 0.1", "radius = 1", 13, "radius", "the walls along x are 2 µm apart"),
        ("name = \"tx\"", "name = \"tx\"\ncenter = [0, 0, 1.6]", 32, "center", "outside the walls"),
        ("center = [1, 0, 0]", far, 38, "center", "[2.5, 0.0, 0.0] is outside the walls of the box from [-1"),
        ("contact = \"separate\"", elastic, 4, "contact", "give a species a thermal-speed"),
    ];
    for (right, wrong, line, key, message) in mistakes {
        assert_mistake(&walls, [right, wrong], line, key, message);
    }
    assert!(parse(&walls.replace("center = [1, 0, 0]", "center = [1.25, 0, 0]")).is_ok());
    let message = "collide in a periodic box that is 2 µm long; make the radius at most a quarter";
    assert_mistake(GOOD, ["radius = 0.1", "radius = 0.51"], 13, "radius", message);
    assert!(parse(&GOOD.replace("radius = 0.1", "radius = 0.5")).is_ok());
}

#[test]
fn likely_mistakes_are_warned_of() {
    let messages = parse(GOOD).unwrap().warnings;
    assert_eq!(messages.len(), 1, "{messages:?}");
    assert!(messages[0].starts_with("s.toml, line 38, `center`: "), "{messages:?}");
    assert!(messages[0].contains("is wrapped to [-1.0, 0.0, 0.0]"), "{messages:?}");
    let warnings = parse(&GOOD.replace("count = 3", "count = 3000")).unwrap().warnings;
    let collides = "s.toml, line 4, `contact`: acid collides about ";
    assert!(warnings.iter().any(|warning| warning.starts_with(collides)), "{warnings:?}");
    let inside = GOOD.replace("transparent", "absorbing").replace("[1, 0, 0]\nradius", "[0, 0, 0]\nradius");
    let inside = inside
        .replace("gaussian\", width = 0.5", "ball\", radius = 0.25")
        .replace("time-step = 0.001", "time-step = 7e-4")
        .replace("species = [\"base\"]", "");
    let messages = parse(&inside).unwrap().warnings;
    assert_warns(&messages, "transmitter tx is inside receiver rx");
    let mended = GOOD.replace("0.001", "3.33e-5").replace("[1, 0, 0]\nradius", "[-1, 0, 0]\nradius");
    assert_eq!(parse(&mended).unwrap().warnings, [""; 0]);
    let rare = mended.replace("binding-radius = 1.5\nprobability = 0.5", "rate = 7.5");
    let messages = parse(&rare).unwrap().warnings;
    assert!(
        messages.len() == 1 && messages[0].starts_with("s.toml, line 23, `rate`: 'acid + base"),
        "{messages:?}"
    );
}

#[test]
fn releases_after_the_end_are_warned_of() {
    let mut scenario = parse(GOOD).unwrap();
    let late = scenario.run_warnings();
    assert_warns(&late, "tx has a release at or after 0.5 s");
    assert!(late[0].contains("the run ends at 0.01 s; make `steps` more than 500"), "{late:?}");
    scenario.steps = 501;
    assert_eq!(scenario.run_warnings(), [""; 0]);
}

#[test]
fn a_rate_becomes_a_binding_radius() {
    let text = GOOD.replace("binding-radius = 1.5", "rate = 1000").replace("probability = 0.5", "");
    let radius = parse(&text).unwrap().model.reactions[0].binding_radius;
    let back = crate::reaction::rate::rate_constant(f64::from(radius), 150.0, 0.001);
    assert!((back / 1000.0 - 1.0).abs() < 1e-5);
}

#[test]
fn shipped_scenarios_are_valid() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let mut count = 0;
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        let sweep = super::Sweep::read(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
        let points = sweep.into_iter().flat_map(|sweep| sweep.points).map(|point| point.scenario);
        let mut scenarios: Vec<_> = points.collect();
        if scenarios.is_empty() {
            scenarios.push(Scenario::read(&path).unwrap_or_else(|error| panic!("{error}")));
        }
        for scenario in scenarios {
            let name = path.display();
            assert_eq!((scenario.run_warnings(), scenario.warnings), (vec![], vec![]), "{name}");
            #[cfg(feature = "gpu")]
            crate::gpu::check(&scenario.model).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
        count += 1;
    }
    assert!(count >= 3);
}
