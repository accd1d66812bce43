//! Parts of a scenario without effect.

use super::*;

const TEXT: &str = "time-step = 0.001
steps = 10
[boundary]
kind = 'reflecting'
low = [-9, -9, -9]
high = [9, 9, 9]
[[species]]
name = 'A'
radius = 0.1
diffusion = 1
[[transmitter]]
name = 'tx'
bits = '10'
symbol-time = 0.005
release = [{ species = 'A', count = 3 }]
[[receiver]]
name = 'rx'
center = [5, 0, 0]
radius = 1
kind = 'transparent'
";

fn with(right: &str, wrong: &str) -> Scenario {
    let text = TEXT.replace(right, wrong);
    assert_ne!(text, TEXT, "{right}");
    parse(&text).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn keys_without_effect_are_warned_of() {
    assert_eq!(parse(TEXT).unwrap().warnings, [""; 0]);
    let attractant =
        "[[attractant]]\nname = 'food'\nprofile = { kind = 'source', peak = 2, radius = 1 }\n[[receiver]]";
    for (right, wrong, message) in [
        ("radius = 0.1", "mass = 2\nradius = 0.1", "line 9, `mass`: the mass of A has no effect"),
        ("[[receiver]]", attractant, "line 17, `name`: no species follows food"),
        ("kind = 'tr", "[output]\nframes-every = 5\n#", "`frames-every`: no frames are written"),
        ("kind = 'tr", "[output]\narrivals = true\n#", "`arrivals`: no receiver takes or counts particles"),
    ] {
        // A section before the kind ends the receiver.
        let wrong = match wrong.strip_prefix("[output]") {
            Some(_) => format!("kind = 'reflecting'\n{wrong}"),
            None => wrong.to_owned(),
        };
        assert_warns(&with(right, &wrong).warnings, message);
    }
    let frames = "kind = 'transparent'\n[output]\narrivals = true\nframes-every = 5\nframes = ['xyz']";
    assert_eq!(with("kind = 'transparent'", frames).warnings, [""; 0]);
    let elastic = "thermal-speed = 1\nmass = 2\n[[transmitter]]";
    let text = with("[[transmitter]]", elastic).text;
    let warnings = parse(&format!("contact = 'elastic'\n{text}")).unwrap().warnings;
    assert!(warnings.iter().all(|warning| !warning.contains("mass")), "{warnings:?}");
}

#[test]
fn lists_without_entries_are_refused() {
    let empty = [
        ("bits = '10'", "bits = ' _'", 13, "bits", "there are no bits"),
        (
            "kind = 'transparent'",
            "kind = 'receptors'\nreceptors = [{ count = 3, ligands = [] }]",
            21,
            "receptors",
            "these receptors bind nothing",
        ),
    ];
    for (right, wrong, line, key, message) in empty {
        assert_mistake(TEXT, [right, wrong], line, key, message);
    }
}

#[test]
fn flow_after_the_end_is_warned_of() {
    let flow = "[flow]\nprofile = 'plug'\nvelocity = [0, 1, 0]\nfrom = 0.01\n[[species]]";
    let mut scenario = with("[[species]]", flow);
    assert_warns(&scenario.run_warnings(), "the flow begins at 0.01 s, but the run ends at 0.01 s");
    scenario.steps = 11;
    assert_eq!(scenario.run_warnings(), [""; 0]);
}

#[test]
fn species_without_particles_are_warned_of() {
    let other = "[[species]]\nname = 'B'\n[[transmitter]]";
    assert_warns(&with("[[transmitter]]", other).run_warnings(), "makes species B, so that");
    let third = format!("[[species]]\nname = 'C'\n{other}");
    assert_warns(&with("[[transmitter]]", &third).run_warnings(), "makes species C and 1 more, so that");
    let decay = format!("[[decay]]\nequation = 'A -> B'\nrate = 1\n{other}");
    assert_eq!(with("[[transmitter]]", &decay).run_warnings(), [""; 0]);
}

#[test]
fn symbols_with_unequal_numbers_of_rows_are_warned_of() {
    let mut scenario = parse(TEXT).unwrap();
    let mut warnings = |every| {
        scenario.output.every = every;
        scenario.run_warnings()
    };
    assert_eq!([1, 5].map(&mut warnings), [const { Vec::<String>::new() }; 2]);
    for every in [2, 3, 7] {
        assert_warns(&warnings(every), &format!("takes 5 steps, and the series has a row every {every}, so"));
    }
    let absorbing = with("'transparent'", "'absorbing'");
    assert_eq!(
        Scenario { output: Output { every: 3, ..absorbing.output }, ..absorbing }.run_warnings(),
        [""; 0]
    );
}

#[test]
fn series_without_a_later_row_is_warned_of() {
    let mut scenario = with("kind = 'transparent'", "kind = 'absorbing'");
    scenario.output.every = 10;
    assert_eq!(scenario.run_warnings(), [""; 0]);
    scenario.output.every = 11;
    assert_warns(&scenario.run_warnings(), "a row every 11 steps, but the run has 10, so");
}
