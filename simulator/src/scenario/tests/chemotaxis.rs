use super::*;
use crate::{Attractant, AttractantProfile, Chemotaxis};

const TEXT: &str = "time-step = 0.01
steps = 3
[boundary]
kind = 'periodic'
low = [0, 0, 0]
high = [2, 1, 1]
[[attractant]]
name = 'food'
center = [1, 0, 0]
profile = { kind = 'source', peak = 2, radius = 0.25 }
[[species]]
name = 'A'
speed = 20
tumble-rate = 1
chemotaxis = { attractant = 'food', sensitivity = 0.1, half-saturation = 4 }
";

#[test]
fn attractants_become_a_model() {
    let Scenario { model, warnings, .. } = parse(TEXT).unwrap();
    let profile = AttractantProfile::Source { peak: 2.0, radius: 0.25 };
    assert_eq!(model.attractants, [Attractant { name: "food".into(), center: [1.0, 0.0, 0.0], profile }]);
    let taxis = Chemotaxis { attractant: 0, sensitivity: 0.1, half_saturation: Some(4.0) };
    assert_eq!((model.species[0].chemotaxis, warnings), (Some(taxis), vec![]));
    let profile = AttractantProfile::Gaussian { peak: 2.0, width: 0.5 };
    let text = TEXT.replace("'source', peak = 2, radius = 0.25", "'gaussian', peak = 2, width = 0.5");
    assert_eq!(parse(&text).unwrap().model.attractants[0].profile, profile);
}

#[test]
fn faulty_attractants_are_named_by_line() {
    let linear = "kind = 'linear', level = 1, gradient = [0, 0.5, 0]";
    for (right, wrong, message) in [
        (
            "kind = 'source', peak = 2, radius = 0.25",
            linear,
            "line 8, `name`: attractant food rises along y, which is periodic",
        ),
        (
            "attractant = 'food'",
            "attractant = 'bait'",
            "line 15, `chemotaxis`: there is no attractant 'bait'; there are food",
        ),
        (
            "speed = 20\ntumble-rate = 1\n",
            "",
            "line 13, `chemotaxis`: species A follows an attractant but does not swim",
        ),
        ("half-saturation = 4", "half-saturation = 0", "0 is not a positive number"),
        ("peak = 2", "peak = -2", "-2 is not a number from 0"),
    ] {
        let error = parse(&TEXT.replace(right, wrong)).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
}

#[test]
fn gradients_too_steep_for_the_time_step_are_warned_of() {
    // Up to exp(0.35·20·4/(4 + 2)²·2/0.25) times the rate of 1/s, at a probability of 0.01/1.005.
    let steep = TEXT.replace("sensitivity = 0.1", "sensitivity = 0.35");
    let messages = parse(&steep).unwrap().warnings;
    assert_warns(&messages, "A tumbles at up to 5.038e2 times its tumble-rate");
    assert!(messages[0].contains("time-step = 1.98e-3 is short enough"), "{messages:?}");
    assert_eq!(parse(&steep.replace("0.01", "1.98e-3")).unwrap().warnings, [""; 0]);
}

#[test]
fn rates_above_two_tumbles_per_step_are_warned_of() {
    let text = |rate: &str| {
        format!("time-step = 0.05\nsteps = 3\n[[species]]\nname = 'A'\nspeed = 20\ntumble-rate = {rate}\n")
    };
    let messages = parse(&text("100")).unwrap().warnings;
    assert_warns(&messages, "line 6, `tumble-rate`: A tumbles 5.000 times in a step");
    assert!(messages[0].contains("2.500 times as fast; time-step = 1.99e-2 is short enough"), "{messages:?}");
    assert_eq!(parse(&text("40")).unwrap().warnings, [""; 0]);
}
