use super::*;
use crate::model::message::{Message, Modulation, Symbols};
use crate::{CountDistribution, Unbinding};

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
    let radius = crate::reaction::rate::binding_radius(0.4, 2.0, 1e-5).unwrap() as f32;
    for (reaction, fraction) in model.reactions.iter().zip([0.75, 0.25]) {
        let ReactionRate::PerStep(p) = reaction.chance else { panic!("{reaction:?}") };
        assert!(reaction.binding_radius == radius && (p - fraction).abs() < 1e-12, "{reaction:?}");
    }
}

#[test]
fn dissociation_products_may_react_again() {
    let apart = |more: &str| decay("C -> B + A", &format!("rate = 50\n{more}"));
    let model =
        network(&(reaction("A + B -> C", "rate = 0.5") + &apart("unbinding-radius = 0.1"))).unwrap().model;
    assert_eq!(
        (model.decays[0].products, model.decays[0].unbinding),
        ([Some(1), Some(0)], Unbinding::Apart(0.1))
    );
    let is = crate::reaction::rate::reversible_rate_constant(
        model.reactions[0].binding_radius.into(),
        0.1_f32.into(),
        2.0,
        1e-5,
    );
    let factor = (1.0 - (-50e-5_f64).exp()) / 50e-5;
    assert!((is / (0.5 * factor) - 1.0).abs() < 1e-4, "{is}");
    let model = network(&(reaction("A + B -> C", "rate-inside = 100") + &apart(""))).unwrap().model;
    assert_eq!(
        (model.reactions[0].binding_radius, model.reactions[0].chance),
        (0.1, ReactionRate::PerTime(100.0))
    );
    assert_eq!(model.decays[0].unbinding, Unbinding::Within(0.1));
    let model = network(&(reaction("A + B -> D", "rate = 0.5") + &apart(""))).unwrap().model;
    assert_eq!(model.decays[0].unbinding, Unbinding::Apart(0.0));
}

#[test]
fn reactions_that_undo_each_other_have_the_ratio_of_their_rates() {
    let both = |[there, back]: [&str; 2]| {
        reaction("A + B -> C + D", &format!("rate = 0.5\n{there}"))
            + &reaction("D + C -> A + B", &format!("rate = 0.125\n{back}"))
    };
    let apart = ["unbinding-radius = 0.1", "unbinding-radius = 0.07"];
    let model = network(&both(apart)).unwrap().model;
    for (reaction, apart, rate) in
        [(&model.reactions[0], 0.07_f32, 0.5), (&model.reactions[1], 0.1_f32, 0.125)]
    {
        let radius = reaction.binding_radius.into();
        let is = crate::reaction::rate::reversible_rate_constant(radius, apart.into(), 2.0, 1e-5);
        assert!((is / rate - 1.0).abs() < 1e-4, "{is}");
    }
    for without in [["", apart[1]], [apart[0], ""], ["", ""]] {
        let error = network(&both(without)).expect_err("they meet again").to_string();
        assert!(error.contains("`equation`") && error.contains("react back in the next step"), "{error}");
    }
    // Catalysts, and reactions inside a radius, which take their time.
    let catalyst = reaction("A + B -> A + C", "rate = 0.5") + &reaction("A + C -> A + B", "rate = 0.5");
    assert!(network(&catalyst).is_err());
    let inside =
        reaction("A + B -> C + D", "rate-inside = 9") + &reaction("C + D -> A + B", "rate-inside = 9");
    assert!(network(&inside).is_ok());
}

#[test]
fn rate_of_reactants_that_move_apart_from_diffusion_is_warned_of() {
    let text = reaction("A + B -> C", "rate = 0.5");
    let warnings = |speed: f64| {
        let species = "name = \"A\"\nradius = 0.05";
        let moving =
            network(&text).unwrap().text.replace(species, &format!("{species}\ndrift = [{speed}, 0, 0]"));
        parse(&moving).unwrap().warnings
    };
    let radius: f64 = network(&text).unwrap().model.reactions[0].binding_radius.into();
    // 5 % of the rate.
    let speed = 0.025 / (std::f64::consts::PI * radius * radius);
    assert_eq!(warnings(0.99 * speed), [""; 0]);
    assert_warns(&warnings(2.0 * speed), "sweep up to 0.050 µm³/s");
}

/// A step dissociates k(1 − exp(−RΔt))/R of the complexes, with the rate R of all their decays.
#[test]
fn association_keeps_the_equilibrium_of_a_complex_with_other_decays() {
    let [k, other, dt] = [1.0, 9.0, 1e-5];
    let text = reaction("A + B -> C", "rate = 0.5")
        + &decay("C -> A + B", &format!("rate = {}\nunbinding-radius = 0.1", k / dt / 10.0))
        + &decay("C -> D", &format!("rate = {}", other / dt / 10.0));
    let model = network(&text).unwrap().model;
    let radius = model.reactions[0].binding_radius.into();
    let associates = crate::reaction::rate::reversible_rate_constant(radius, 0.1_f32.into(), 2.0, dt);
    let all = (k + other) / 10.0;
    let expected = 0.5 * (1.0 - (-all).exp()) / all;
    assert!((associates / expected - 1.0).abs() < 1e-4, "{associates}, not {expected}");
}

#[test]
fn sources_are_everywhere_or_in_a_region() {
    let source = |more: &str| format!("[[source]]\nequation = \"-> A\"\nrate = 3\n{more}\n");
    let walls = "[boundary]\nkind = \"reflecting\"\nlow = [0, 0, 0]\nhigh = [1, 2, 4]\n";
    let ball = "center = [0.5, 1, 1]\nshape = { kind = \"ball\", radius = 0.5 }";
    let model = network(&(source("") + &source(ball) + walls)).unwrap().model;
    let [everywhere, region] = &model.transmitters[..] else { panic!("{:?}", model.transmitters) };
    assert_eq!([&everywhere.name[..], &region.name], ["-> A", "-> A (2)"]);
    let Shape::Box(sides) = everywhere.shape else { panic!("{everywhere:?}") };
    assert!(sides.into_iter().zip([0.9, 1.9, 3.9]).all(|(side, is)| (side - is).abs() < 1e-6), "{sides:?}");
    assert_eq!(everywhere.center, [0.5, 1.0, 2.0]);
    let rate = |t: &crate::Transmitter| match &t.schedule {
        Schedule::Steady { from: 0.0, until: f64::INFINITY, rates } => rates[0],
        other => panic!("{other:?}"),
    };
    assert_eq!((rate(everywhere), everywhere.numbers), ((0, 24.0), CountDistribution::Poisson));
    assert!((rate(region).1 - 3.0 * std::f64::consts::PI / 6.0).abs() < 1e-12);
}

#[test]
fn a_vessel_has_a_flow() {
    let text = "[boundary]\nkind = \"cylinder\"\naxis = \"z\"\ncenter = [1, 2, 0]\nradius = 3\nends = [-5, 5]\n\
                at-ends = \"periodic\"\n[flow]\nprofile = \"poiseuille\"\nspeed = -4\n\
                [[source]]\nequation = \"-> A\"\nrate = 2\n";
    let model = network(text).unwrap().model;
    let vessel = crate::Vessel { along: Some(2), center: [1.0, 2.0, 0.0], radius: 3.0 };
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
    assert_eq!((plug.flow, plug.flow_pulse), (Some(crate::Flow::Plug([1.0, 2.0, 3.0])), None));
    let pulse = network("[flow]\nprofile = \"plug\"\nvelocity = [1, 2, 3]\nfrom = 0.5\n").unwrap().model;
    assert_eq!(pulse.flow_pulse, Some([0.5, f64::INFINITY]));
}

fn transmitter(more: &str) -> String {
    format!("[[transmitter]]\nname = \"tx\"\n{more}\n")
}

fn receiver(name: &str) -> String {
    format!("[[receiver]]\nkind = \"absorbing\"\ncenter = [0, 0, 0]\nradius = 1\nname = \"{name}\"\n")
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
fn separators_do_not_count_as_bits_of_a_message() {
    const LIMIT: usize = 1 << 22;
    let one = "release = [{ species = \"A\", count = 9 }]\nsymbol-time = 0.5\n";
    let sent = |bits: &str| network(&transmitter(&format!("{one}bits = \"{bits}\"")));
    let schedule = sent(&format!("1{}0", " _".repeat(LIMIT))).unwrap().model.transmitters.remove(0).schedule;
    let Schedule::Message(message) = schedule else { panic!("{schedule:?}") };
    assert_eq!(message.symbols, Symbols::Given(vec![1, 0]));
    let error = sent(&"1".repeat(LIMIT + 1)).unwrap_err().to_string();
    assert!(error.contains("4194305 bits are more than the limit of 4194304"), "{error}");
}

#[test]
fn a_rate_releases_all_the_time() {
    let text = transmitter(
        "release = [{ species = \"B\", rate = 0.5 }]\nfrom = 1\nuntil = 2\nnumbers = \"poisson\"",
    );
    let transmitter = network(&text).unwrap().model.transmitters.remove(0);
    assert_eq!(transmitter.schedule, Schedule::Steady { from: 1.0, until: 2.0, rates: vec![(1, 0.5)] });
    assert_eq!((transmitter.numbers, transmitter.release), (CountDistribution::Poisson, vec![]));
}

#[test]
fn contradictory_reactions_are_refused() {
    let one_product = "does not have two products to separate";
    let a = "release = [{ species = \"A\", count = 9 }]\n";
    let r = "release = [{ species = \"A\", rate = 9 }]\n";
    let ab = reaction("A + B -> C", "rate = 0.5");
    for (text, key, message) in [
        (ab.clone() + &reaction("A + B -> D", "binding-radius = 0.1"), "equation", "give all of them a rate"),
        (
            reaction("A + B -> C", "rate = 1\nbinding-radius = 0.1"),
            "equation",
            "give only the rate, or in its place rate-inside",
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
        (decay("C -> A", "rate = 1\nunbinding-radius = 1"), "unbinding-radius", one_product),
        (reaction("A + B -> C", "rate = 1\nunbinding-radius = 1"), "unbinding-radius", one_product),
        (decay("C -> A + B + D", "rate = 1"), "equation", "at most two products"),
        ("[[species]]\nname = \"0\"\n".into(), "name", "'0' stands for no product"),
        ("[[species]]\nname = \"E\"\ntumble-rate = 1\n".into(), "tumble-rate", "give the species a speed"),
        ("[[source]]\nequation = \"-> A\"\nrate = 1\n".into(), "equation", "needs a [boundary], or a shape"),
        ("[[source]]\nequation = \"B -> A\"\nrate = 1\n".into(), "equation", "as in '-> A'"),
        (transmitter(&format!("{a}bits = \"01\"")), "bits", "need a symbol-time"),
        (
            transmitter(&format!("{a}bits = \"012\"\nsymbol-time = 1")),
            "bits",
            "'012' may contain only 0, 1, spaces and '_'",
        ),
        (
            transmitter(&format!("{a}bits = \"01\"\nsymbol-time = 1\ntimes = [0]")),
            "times",
            "instead of times",
        ),
        (transmitter(&format!("{a}symbol-time = 1")), "symbol-time", "goes with bits"),
        (
            transmitter(&format!("{a}bits = \"01\"\nsymbol-time = 9e-6")),
            "symbol-time",
            "the symbol time of tx is 0.000009 s, and a step has 0.00001 s, so that symbols share a step",
        ),
        (transmitter("release = []"), "release", "the list is empty, so that nothing is released"),
        (receiver("rx") + "species = []\n", "species", "the list is empty, so that no species is seen"),
        (transmitter(&format!("{a}from = 1")), "from", "goes with release rates"),
        (transmitter(&format!("{r}times = [1]")), "times", "write from and until"),
        (
            transmitter(&format!("{a}bits = \"01\"\nsymbol-time = 1\nmodulation = \"mosk\"")),
            "bits",
            "the number of symbols is 1 (one per entry of release), but must be a power of two",
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
            "3 bits are not a multiple of 2 bits per symbol",
        ),
        ("[boundary]\nkind = \"sphere\"\nradius = 1\naxis = \"x\"\n".into(), "axis", "goes with a cylinder"),
        ("[boundary]\nkind = \"sphere\"\nradius = 1\nlow = [0, 0, 0]\n".into(), "low", "goes with a box"),
        ("[boundary]\nkind = \"cylinder\"\n".into(), "kind", "a cylinder or sphere needs a radius"),
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
            "the walls across the vessel are 0.1 µm apart",
        ),
        ("[flow]\nprofile = \"poiseuille\"\nspeed = 1\n".into(), "profile", "a speed needs a cylinder"),
        (
            "[flow]\nprofile = \"plug\"\nvelocity = [1, 2, 3]\nfrom = 2\nuntil = 1\n".into(),
            "until",
            "the end must be later than the beginning",
        ),
        ("[flow]\nprofile = \"plug\"\n".into(), "profile", "either a velocity, or a speed"),
        (
            "[boundary]\nkind = \"cylinder\"\nradius = 1\n".to_owned()
                + &transmitter(&format!("{a}center = [9, 2, 0]")),
            "center",
            "outside the cylinder of radius 1 along x",
        ),
        (transmitter("release = [{ species = \"A\" }]"), "release", "either a count, for a burst, or a rate"),
        (transmitter(a) + &transmitter(r), "name", "two transmitters 'tx'"),
        (
            transmitter(&format!("{a}bits = \"01\"\nsymbol-time = 1\nmodulation = \"mosk\""))
                .replace("count = 9 }", "count = 9 }, { species = \"A\", count = 4 }"),
            "release",
            "species 'A' occurs twice in `release`",
        ),
        (
            ["rx-1", "rx\"\nlattice = { size = [1, 1, 1], places = [2, 1, 1] }\n#"].map(receiver).concat(),
            "name",
            "two receivers 'rx-1'",
        ),
    ] {
        assert_refused(network(&text), key, message);
    }
}

#[test]
fn long_steps_are_warned_of_with_a_short_enough_one() {
    let warnings = |text: &str| network(text).unwrap().warnings;
    let found = warnings(&(reaction("A + B -> C", "rate = 0.5") + &decay("C ->", "rate = 3000")));
    assert_warns(&found, "'C ->': 3.0 % of C decay");
    assert!(found[0].contains("time-step = 6.66e-6 is short enough"), "{found:?}");
    assert_eq!(warnings(&(decay("B -> C", "rate = 3000") + &decay("C ->", "rate = 3000"))), [""; 0]);
    let found = warnings(&reaction("A + B -> C", "rate-inside = 30000"));
    assert_warns(&found, "react after 3.333e-5 s on average");
    assert!(found[0].contains("time-step = 6.66e-6 is short enough"), "{found:?}");
}

#[test]
fn dissociation_of_particles_released_within_a_step_is_warned_of() {
    let warnings = |text: &str| network(text).unwrap().warnings;
    let steady = transmitter("release = [{ species = \"C\", rate = 9 }]");
    let source = "[[source]]\nequation = \"-> C\"\nrate = 1\nshape = { kind = \"ball\", radius = 1 }\n";
    let split = decay("C -> A + B", "rate = 3000\nunbinding-radius = 0.1");
    for release in [&steady[..], source] {
        let found = warnings(&(split.clone() + release));
        assert_warns(&found, "'C -> A + B': 3.0 % of C decay in a step");
        assert!(found[0].contains("time-step = 6.66e-6 is short enough"), "{found:?}");
    }
    // The rest of a species that dissociates decays at the ends of steps, too.
    let both = decay("C -> A + B", "rate = 30") + &decay("C ->", "rate = 3000");
    assert_warns(&warnings(&(both + &steady)), "'C ->': 3.0 % of C decay");
    // Products of decays dissociate in the rest of the step, except after a release within it.
    let chain = decay("D -> C", "rate = 30") + &split;
    let burst = transmitter("release = [{ species = \"C\", count = 9 }]");
    assert_eq!(warnings(&(chain.clone() + &burst)), [""; 0]);
    let early = transmitter("release = [{ species = \"D\", rate = 9 }]");
    assert_warns(&warnings(&(chain + &early)), "'C -> A + B': 3.0 % of C decay");
    assert_eq!(warnings(&(decay("C ->", "rate = 3000") + &steady)), [""; 0]);
}

#[test]
fn rates_that_random_numbers_round_are_warned_of() {
    let warnings = |text: &str| network(text).unwrap().warnings;
    // 4.29 and 0.43 of 2³² words, and 100.
    let found = warnings(&decay("C ->", "rate = 1e-4"));
    assert_warns(&found, "'C ->' has the probability 1.000e-9 in a step");
    assert!(found[0].contains("rounded to 9.313e-10") && found[0].contains("is off by 6.9 %"), "{found:?}");
    assert_warns(&warnings(&decay("C -> A + B", "rate = 1e-5\nunbinding-radius = 0.1")), "it never happens");
    let inside = |rate: &str| reaction("A + B -> C", &format!("rate-inside = {rate}"));
    assert_warns(&warnings(&inside("1e-4")), "'A + B -> C' has the probability 1.000e-9");
    let swimmer = |rate: &str| format!("[[species]]\nname = \"E\"\nspeed = 1\ntumble-rate = {rate}\n");
    assert_warns(&warnings(&swimmer("1e-4")), "'a tumble of E' has the probability 1.000e-9");
    let fine = decay("C ->", "rate = 2.34e-3") + &inside("2.34e-3") + &swimmer("2.34e-3");
    assert_eq!(warnings(&fine), [""; 0]);
    assert_eq!(warnings(&swimmer("0")), [""; 0]);
}

#[test]
fn names_of_equations_are_one_line_and_distinct() {
    let text = reaction("A\\n+ B  ->\\tC", "rate = 0.3")
        + &reaction("A + B -> C", "rate = 0.1")
        + &decay("C\\n-> D", "rate = 1")
        + &decay("C -> D", "rate = 2")
        + &decay("C ->  D", "rate = 3");
    let model = network(&text).unwrap().model;
    let reactions: Vec<_> = model.reactions.iter().map(|reaction| &reaction.name[..]).collect();
    let decays: Vec<_> = model.decays.iter().map(|decay| &decay.name[..]).collect();
    assert_eq!(reactions, ["A + B -> C", "A + B -> C (2)"]);
    assert_eq!(decays, ["C -> D", "C -> D (2)", "C -> D (3)"]);
    let source = |equation: &str| format!("[[source]]\nequation = \"{equation}\"\nrate = 1\n");
    let boundary = "[boundary]\nkind = \"periodic\"\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\n";
    let model = network(&(boundary.to_owned() + &source("->\\nA") + &source("-> A"))).unwrap().model;
    let sources: Vec<_> = model.transmitters.iter().map(|source| &source.name[..]).collect();
    assert_eq!(sources, ["-> A", "-> A (2)"]);
}
