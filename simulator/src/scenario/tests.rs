use super::*;
use crate::message::{Message, Modulation, Symbols};
use crate::{Boundary, Chance, Contact, Kind, Numbers, Reaction, Schedule, Shape, Unbinding};

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

#[test]
fn every_key_arrives() {
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
        chance: Chance::PerStep(0.5),
    };
    assert_eq!(model.reactions, [reaction]);
    let decay = &model.decays[0];
    assert_eq!((decay.reactant, decay.products, decay.rate), (1, [None, None], 2.0));
    assert_eq!(model.transmitters[0].shape, Shape::Gaussian(0.5));
    assert_eq!(
        (&model.transmitters[0].schedule, &model.transmitters[0].release),
        (&Schedule::Times(vec![0.0, 0.5]), &vec![(0, 3)])
    );
    assert_eq!((model.receivers[0].kind, &model.receivers[0].sees), (Kind::Transparent, &vec![false, true]));
    let expected = Output { every: 5, frames_every: 5, xyz: false, npy: true, checkpoint_every: None };
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
        ("acid + base -> base", "acid + base -> base + acid", 22, "equation", "changes nothing"),
        ("binding-radius = 1.5", "rate = 1.5", 24, "probability", "goes with binding-radius"),
        ("probability = 0.5", "probability = 1.5", 24, "probability", "1.5 is not a probability"),
        ("count = 3", "count = -3", 34, "release", "invalid value: integer `-3`"),
        ("kind = \"gaussian\", width", "kind = \"gaussian\", with", 33, "with", "unknown field"),
        ("radius = 0.5\n", "", 36, "radius", "missing field"),
        ("[\"base\"]", "[\"salt\"]", 41, "species", "no species 'salt'"),
        ("every = 5", "every = 0", 44, "every", "nonzero"),
    ];
    for (right, wrong, line, key, message) in mistakes {
        let text = GOOD.replace(right, wrong);
        assert_ne!(text, GOOD, "{right}");
        let error = parse(&text).expect_err(wrong).to_string();
        assert!(error.starts_with(&format!("s.toml, line {line}, `{key}`: ")), "{wrong}: {error}");
        assert!(error.contains(message) && !error.contains('\n'), "{wrong}: {error}");
    }
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let walls = GOOD.replace("\"periodic\"", "\"reflecting\"");
    let elastic = "contact = \"elastic\"";
    let far = "center = [2.5, 0, 0]";
    let mistakes = [
        ("radius = 0.1", "radius = 1", 13, "radius", "there is room of 2 between walls along x"),
        ("name = \"tx\"", "name = \"tx\"\ncenter = [0, 0, 1.6]", 32, "center", "outside the walls"),
        ("center = [1, 0, 0]", far, 38, "center", "[2.5, 0.0, 0.0] is outside the walls of the box from [-1"),
        ("contact = \"separate\"", elastic, 4, "contact", "give a species a thermal-speed"),
    ];
    for (right, wrong, line, key, message) in mistakes {
        let text = walls.replace(right, wrong);
        assert_ne!(text, walls, "{right}");
        let error = parse(&text).expect_err(wrong).to_string();
        assert!(error.starts_with(&format!("s.toml, line {line}, `{key}`: ")), "{wrong}: {error}");
        assert!(error.contains(message) && !error.contains('\n'), "{wrong}: {error}");
    }
    // Part of it is inside.
    assert!(parse(&walls.replace("center = [1, 0, 0]", "center = [1.25, 0, 0]")).is_ok());
}

#[test]
fn what_may_not_be_meant_is_said() {
    // Steps of half a micrometre beside radii of 0.1 µm and none.
    let said = parse(GOOD).unwrap().advice;
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said[0].starts_with("s.toml, line 4, `contact`: a step takes acid and base "), "{said:?}");
    assert!(said[0].contains("time-step = 3.33e-5 resolves it"), "{said:?}");
    assert!(said[1].starts_with("s.toml, line 38, `center`: "), "{said:?}");
    assert!(said[1].contains("means its image [-1.0, 0.0, 0.0]"), "{said:?}");
    let mended = GOOD.replace("0.001", "3.33e-5").replace("[1, 0, 0]\nradius", "[-1, 0, 0]\nradius");
    assert_eq!(parse(&mended).unwrap().advice, [""; 0]);
    let rare = mended.replace("binding-radius = 1.5\nprobability = 0.5", "rate = 7.5");
    let said = parse(&rare).unwrap().advice;
    assert!(said.len() == 1 && said[0].starts_with("s.toml, line 23, `rate`: 'acid + base"), "{said:?}");
}

#[test]
fn releases_behind_the_end_are_said() {
    let mut scenario = parse(GOOD).unwrap();
    let late = scenario.late_releases();
    assert!(late.len() == 1 && late[0].contains("tx has 1 releases from 0.5 s on"), "{late:?}");
    assert!(late[0].contains("the run ends at 0.01 s; make `steps` more than 500"), "{late:?}");
    scenario.steps = 501;
    assert_eq!(scenario.late_releases(), [""; 0]);
}

/// Species A to D, and what else there is.
fn network(more: &str) -> Result<Scenario, Error> {
    let species = |name: &str| format!("[[species]]\nname = \"{name}\"\nradius = 0.05\ndiffusion = 1\n");
    let head = "time-step = 1e-5\nsteps = 10\n".to_owned();
    parse(&(head + &["A", "B", "C", "D"].map(species).concat() + more))
}

fn reaction(equation: &str, more: &str) -> String {
    format!("[[reaction]]\nequation = \"{equation}\"\n{more}\n")
}

fn decay(equation: &str, more: &str) -> String {
    format!("[[decay]]\nequation = \"{equation}\"\n{more}\n")
}

#[test]
fn channels_of_a_pair_share_its_rate() {
    let text = reaction("A + B -> C", "rate = 0.3") + &reaction("B + A -> D", "rate = 0.1");
    let model = network(&text).unwrap().model;
    let radius = crate::rate::binding_radius(0.4, 2.0, 1e-5).unwrap() as f32;
    for (reaction, share) in model.reactions.iter().zip([0.75, 0.25]) {
        let Chance::PerStep(p) = reaction.chance else { panic!("{reaction:?}") };
        assert!(reaction.binding_radius == radius && (p - share).abs() < 1e-12, "{reaction:?}");
    }
}

#[test]
fn what_comes_apart_may_come_together_again() {
    let apart = |more: &str| decay("C -> B + A", &format!("rate = 50\n{more}"));
    let model =
        network(&(reaction("A + B -> C", "rate = 0.5") + &apart("unbinding-radius = 0.1"))).unwrap().model;
    assert_eq!(
        (model.decays[0].products, model.decays[0].unbinding),
        ([Some(1), Some(0)], Unbinding::Apart(0.1))
    );
    let is = crate::rate::reversible_rate_constant(
        model.reactions[0].binding_radius.into(),
        0.1_f32.into(),
        2.0,
        1e-5,
    );
    let kept = (1.0 - (-50e-5_f64).exp()) / 50e-5;
    assert!((is / (0.5 * kept) - 1.0).abs() < 1e-4, "{is}");
    // Where they meet anywhere in a ball, they come apart in it; touching where nothing else is said.
    let model = network(&(reaction("A + B -> C", "rate-inside = 100") + &apart(""))).unwrap().model;
    assert_eq!((model.reactions[0].binding_radius, model.reactions[0].chance), (0.1, Chance::PerTime(100.0)));
    assert_eq!(model.decays[0].unbinding, Unbinding::Within(0.1));
    // Nothing takes these together.
    let model = network(&(reaction("A + B -> D", "rate = 0.5") + &apart(""))).unwrap().model;
    assert_eq!(model.decays[0].unbinding, Unbinding::Apart(0.0));
}

#[test]
fn sources_are_everywhere_or_in_a_region() {
    let source = |more: &str| format!("[[source]]\nequation = \"-> A\"\nrate = 3\n{more}\n");
    let walls = "[boundary]\nkind = \"reflecting\"\nlow = [0, 0, 0]\nhigh = [1, 2, 4]\n";
    let ball = "center = [0.5, 1, 1]\nshape = { kind = \"ball\", radius = 0.5 }";
    let model = network(&(source("") + &source(ball) + walls)).unwrap().model;
    let [everywhere, region] = &model.transmitters[..] else { panic!("{:?}", model.transmitters) };
    let Shape::Box(edges) = everywhere.shape else { panic!("{everywhere:?}") };
    assert!(edges.into_iter().zip([0.9, 1.9, 3.9]).all(|(edge, is)| (edge - is).abs() < 1e-6), "{edges:?}");
    assert_eq!(everywhere.center, [0.5, 1.0, 2.0]);
    let rate = |t: &crate::Transmitter| match &t.schedule {
        Schedule::Steady { from: 0.0, until: f64::INFINITY, rates } => rates[0],
        other => panic!("{other:?}"),
    };
    assert_eq!((rate(everywhere), everywhere.numbers), ((0, 24.0), Numbers::Poisson));
    assert!((rate(region).1 - 3.0 * std::f64::consts::PI / 6.0).abs() < 1e-12);
}

#[test]
fn a_vessel_has_a_flow() {
    let text = "[boundary]\nkind = \"cylinder\"\naxis = \"z\"\ncenter = [1, 2, 0]\nradius = 3\nends = [-5, 5]\n\
                at-ends = \"periodic\"\n[flow]\nprofile = \"poiseuille\"\nspeed = -4\n\
                [[source]]\nequation = \"-> A\"\nrate = 2\n";
    let model = network(text).unwrap().model;
    let vessel = crate::Vessel { along: 2, center: [1.0, 2.0, 0.0], radius: 3.0 };
    let axes = [crate::Axis::Open, crate::Axis::Open, crate::Axis::Periodic { low: -5.0, high: 5.0 }];
    assert_eq!(model.boundary, Boundary { axes, vessel: Some(vessel) });
    assert_eq!(model.flow, Some(crate::Flow::Poiseuille { mean: -4.0 }));
    assert_eq!(
        (model.flow_at([1.0, 2.0, 9.0]), model.flow_at([4.0, 2.0, 0.0])),
        ([0.0, 0.0, -8.0], [0.0; 3])
    );
    assert_eq!(model.transmitters[0].shape, Shape::Cylinder(2, 2.95, 10.0));
    let Schedule::Steady { rates, .. } = &model.transmitters[0].schedule else { panic!() };
    assert!((rates[0].1 / (2.0 * 9.0 * 10.0 * std::f64::consts::PI) - 1.0).abs() < 1e-6);
    let plug = network("[flow]\nprofile = \"plug\"\nvelocity = [1, 2, 3]\n").unwrap().model;
    assert_eq!(plug.flow, Some(crate::Flow::Plug([1.0, 2.0, 3.0])));
}

fn transmitter(more: &str) -> String {
    format!("[[transmitter]]\nname = \"tx\"\n{more}\n")
}

#[test]
fn messages_become_symbols() {
    let sent = |more: &str| match network(&transmitter(more)).unwrap().model.transmitters.remove(0).schedule {
        Schedule::Message(message) => message,
        other => panic!("{other:?}"),
    };
    let one = "release = [{ species = \"A\", count = 9 }]\nsymbol-time = 0.5\n";
    let two =
        "release = [{ species = \"A\", count = 9 }, { species = \"B\", count = 9 }]\nsymbol-time = 0.5\n";
    let symbols = Symbols::Given(vec![1, 0, 1, 1]);
    let expected = Message { start: 0.0, symbol_time: 0.5, symbols, modulation: Modulation::OnOff };
    assert_eq!(sent(&format!("{one}bits = \"10 11\"")), expected);
    let csk =
        sent(&format!("{one}bits = \"0110\"\nmodulation = \"csk\"\nlevels = [0, 0.5, 0.8, 1]\nstart = 2"));
    let modulation = Modulation::Concentration(vec![0.0, 0.5, 0.8, 1.0]);
    assert_eq!(
        csk,
        Message { start: 2.0, symbols: Symbols::Given(vec![1, 2]), modulation, ..expected.clone() }
    );
    let mosk = sent(&format!("{two}random-bits = 7\nmodulation = \"mosk\""));
    assert_eq!(
        (mosk.symbols, mosk.modulation),
        (Symbols::Random { count: 7, alphabet: 2 }, Modulation::Molecule)
    );
}

#[test]
fn a_rate_releases_all_the_time() {
    let text = transmitter(
        "release = [{ species = \"B\", rate = 0.5 }]\nfrom = 1\nuntil = 2\nnumbers = \"poisson\"",
    );
    let transmitter = network(&text).unwrap().model.transmitters.remove(0);
    assert_eq!(transmitter.schedule, Schedule::Steady { from: 1.0, until: 2.0, rates: vec![(1, 0.5)] });
    assert_eq!((transmitter.numbers, transmitter.release), (Numbers::Poisson, vec![]));
}

#[test]
fn what_does_not_go_together_is_refused() {
    let a = "release = [{ species = \"A\", count = 9 }]\n";
    let r = "release = [{ species = \"A\", rate = 9 }]\n";
    let ab = reaction("A + B -> C", "rate = 0.5");
    for (text, key, message) in [
        (ab.clone() + &reaction("A + B -> D", "binding-radius = 0.1"), "equation", "give all of them a rate"),
        (
            reaction("A + B -> C", "rate = 1\nbinding-radius = 0.1"),
            "equation",
            "give that alone, or rate-inside",
        ),
        (
            reaction("A + B -> C", "rate-inside = 1\nprobability = 0.1"),
            "probability",
            "goes with binding-radius",
        ),
        (reaction("A + B -> C", ""), "equation", "needs a rate, or a binding-radius, or rate-inside"),
        (reaction("A -> C", "rate = 1"), "equation", "one alone is a [[decay]], none a [[source]]"),
        (ab.clone() + &decay("C -> A + B", "rate = 1"), "equation", "give an unbinding-radius"),
        (
            ab.clone() + &reaction("A + B -> D", "rate = 1") + &decay("C -> A + B", "rate = 1"),
            "rate",
            "whose rates cannot be kept",
        ),
        (decay("C -> A", "rate = 1\nunbinding-radius = 1"), "unbinding-radius", "no two products"),
        (decay("C -> A + B + D", "rate = 1"), "equation", "at most two products"),
        ("[[source]]\nequation = \"-> A\"\nrate = 1\n".into(), "equation", "needs a [boundary], or a shape"),
        ("[[source]]\nequation = \"B -> A\"\nrate = 1\n".into(), "equation", "as in '-> A'"),
        (transmitter(&format!("{a}bits = \"01\"")), "bits", "need a symbol-time"),
        (transmitter(&format!("{a}bits = \"012\"\nsymbol-time = 1")), "bits", "'012' is not of 0 and 1"),
        (
            transmitter(&format!("{a}bits = \"01\"\nsymbol-time = 1\ntimes = [0]")),
            "times",
            "instead of times",
        ),
        (transmitter(&format!("{a}symbol-time = 1")), "symbol-time", "goes with bits"),
        (transmitter(&format!("{a}from = 1")), "from", "goes with release rates"),
        (transmitter(&format!("{r}times = [1]")), "times", "write from and until"),
        (
            transmitter(&format!("{a}bits = \"01\"\nsymbol-time = 1\nmodulation = \"mosk\"")),
            "bits",
            "there are 1 symbols",
        ),
        (
            transmitter(&format!("{a}bits = \"01\"\nsymbol-time = 1\nmodulation = \"csk\"")),
            "modulation",
            "csk needs levels",
        ),
        (
            transmitter(&format!(
                "{a}bits = \"011\"\nsymbol-time = 1\nmodulation = \"csk\"\nlevels = [0, 1, 2, 3]"
            )),
            "bits",
            "3 bits are no whole number of symbols of 2",
        ),
        ("[boundary]\nkind = \"cylinder\"\n".into(), "kind", "a cylinder needs a radius"),
        ("[boundary]\nkind = \"periodic\"\nlow = [0, 0, 0]\n".into(), "kind", "needs low and high"),
        ("[boundary]\nkind = \"reflecting\"\nradius = 1\n".into(), "radius", "goes with kind = \"cylinder\""),
        (
            "[boundary]\nkind = \"cylinder\"\nradius = 1\nat-ends = \"periodic\"\n".into(),
            "at-ends",
            "needs ends",
        ),
        ("[boundary]\nkind = \"cylinder\"\nradius = 1\nends = [2, 1]\n".into(), "ends", "1 is not above 2"),
        (
            "[boundary]\nkind = \"cylinder\"\nradius = 0.05\n".into(),
            "radius",
            "0.1 between walls across the cylinder",
        ),
        (
            "[flow]\nprofile = \"poiseuille\"\nspeed = 1\n".into(),
            "profile",
            "along a cylinder, and there is none",
        ),
        ("[flow]\nprofile = \"plug\"\n".into(), "profile", "either a velocity, or a speed"),
        (
            "[boundary]\nkind = \"cylinder\"\nradius = 1\n".to_owned()
                + &transmitter(&format!("{a}center = [9, 2, 0]")),
            "center",
            "outside the cylinder of radius 1 along x",
        ),
        (transmitter("release = [{ species = \"A\" }]"), "release", "either a count, for a burst, or a rate"),
    ] {
        let error = network(&text).expect_err(&text).to_string();
        assert!(error.contains(&format!("`{key}`: ")) && error.contains(message), "{text}: {error}");
    }
}

#[test]
fn long_steps_are_said_with_what_is_short_enough() {
    let advice = |text: &str| network(text).unwrap().advice;
    let said = advice(&(reaction("A + B -> C", "rate = 0.5") + &decay("C ->", "rate = 3000")));
    assert!(said.len() == 1 && said[0].contains("'C ->': 3.0 % of C decay"), "{said:?}");
    assert!(said[0].contains("time-step = 6.66e-6 is short enough"), "{said:?}");
    // Decays alone are right for any step.
    assert_eq!(advice(&(decay("B -> C", "rate = 3000") + &decay("C ->", "rate = 3000"))), [""; 0]);
    let said = advice(&reaction("A + B -> C", "rate-inside = 30000"));
    assert!(said.len() == 1 && said[0].contains("react in 3.333e-5 s on average"), "{said:?}");
    assert!(said[0].contains("time-step = 6.66e-6 is short enough"), "{said:?}");
}

#[test]
fn a_rate_becomes_a_binding_radius() {
    let text = GOOD.replace("binding-radius = 1.5", "rate = 1000").replace("probability = 0.5", "");
    let radius = parse(&text).unwrap().model.reactions[0].binding_radius;
    let back = crate::rate::rate_constant(f64::from(radius), 150.0, 0.001);
    assert!((back / 1000.0 - 1.0).abs() < 1e-5);
}

#[test]
fn shipped_scenarios_are_valid() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let mut count = 0;
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        let scenario = Scenario::read(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((scenario.late_releases(), scenario.advice), (vec![], vec![]), "{}", path.display());
        count += 1;
    }
    assert!(count >= 3);
}
