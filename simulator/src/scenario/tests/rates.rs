use super::*;

fn decays(time_step: &str, all: &[(&str, &str)]) -> String {
    let mut text = format!("time-step = {time_step}\nsteps = 3\n");
    for name in ["A", "B", "C", "D"] {
        text += &format!("[[species]]\nname = '{name}'\ndiffusion = 1\n");
    }
    for (equation, rate) in all {
        text += &format!("[[decay]]\nequation = '{equation}'\nrate = {rate}\n");
    }
    text
}

#[test]
fn chain_of_too_many_decays_is_refused_at_its_line() {
    let text = |time_step| decays(time_step, &[("A -> B", "3e6"), ("B -> A", "1e6")]);
    let refused = parse(&text("1e-3")).unwrap_err().to_string();
    let expected =
        "line 17, `rate`: 'A -> B' at 3000.0 expected decays per step begins a chain of more than 1000";
    assert!(refused.contains(expected), "{refused}");
    let step = refused.split("set time-step to ").nth(1).unwrap().split(' ').next().unwrap();
    assert!(parse(&text(step)).is_ok(), "{refused}");
}

#[test]
fn products_of_a_species_that_can_dissociate_are_warned_of() {
    let cycle = [("C -> A + B", "0.001"), ("C -> D", "9"), ("D -> C", "9")];
    let warnings = parse(&decays("0.1", &cycle)).unwrap().warnings;
    assert_warns(&warnings, "'D -> C': 90.0 % of D decay in a step");
    let step = advised_step(&warnings[0]);
    assert_eq!(parse(&decays(step, &cycle)).unwrap().warnings, [""; 0]);
    let alone = [("C -> D", "9"), ("D -> C", "9")];
    assert_eq!(parse(&decays("0.1", &alone)).unwrap().warnings, [""; 0]);
}

#[test]
fn reactants_that_decay_within_a_step_are_warned_of() {
    let text = |time_step: &str, equation: &str, more: &str| {
        let of_pair = "[[reaction]]\nequation = 'A + B -> C'\nbinding-radius = 1\nrate-inside = 0.01\n";
        let release = "[[transmitter]]\nname = 'tx'\nrelease = [{ species = 'A', count = 9 }]\n";
        decays(time_step, &[(equation, "3"), ("C -> D", "0.1")]) + of_pair + release + more
    };
    let warnings = |time_step, equation, more| parse(&text(time_step, equation, more)).unwrap().warnings;
    let messages = warnings("0.1", "A ->", "");
    assert_warns(&messages, "'A ->': 30.0 % of A decay in a step, and pairs react at the ends of steps");
    assert!(messages.iter().any(|one| one.contains("so that up to 25.9 % too few react")), "{messages:?}");
    assert_eq!(warnings(advised_step(&messages[0]), "A ->", ""), [""; 0]);
    // Products of a decay are as many at the ends of steps as within these.
    assert_eq!(warnings("0.1", "B ->", ""), [""; 0]);
    let other = "[[transmitter]]\nname = 'other'\nrelease = [{ species = 'B', rate = 9 }]\n";
    assert_warns(&warnings("0.1", "B -> D", other), "'B -> D': 30.0 % of B decay in a step");
    // A catalyst is not formed.
    let catalyst = text("0.1", "A ->", "").replace("A + B -> C", "A + B -> A + C");
    assert_warns(&parse(&catalyst).unwrap().warnings, "up to 25.9 % too few react");
}

#[test]
fn decays_of_one_species_are_added_up() {
    let all = [("C -> A + B", "1"), ("C -> D", "2"), ("C ->", "1.5"), ("D -> C", "1")];
    let messages = parse(&decays("0.0045", &all)).unwrap().warnings;
    assert_eq!(messages, [""; 0]);
    let pair = "[[reaction]]\nequation = 'A + B -> C'\nbinding-radius = 1\nunbinding-radius = 2\n";
    let pair = pair.replace("unbinding-radius = 2\n", "rate-inside = 0.1\n");
    let text = |time_step: &str| decays(time_step, &all).replace("C -> A + B", "C -> A + A") + &pair;
    let messages = parse(&text("0.0045")).unwrap().warnings;
    assert_warns(&messages, "'C -> D': 2.0 % of C decay in a step");
    assert_eq!(parse(&text(advised_step(&messages[0]))).unwrap().warnings, [""; 0]);
}

#[test]
fn excessive_probabilities_are_refused_with_a_time_step_that_works() {
    let text = |time_step: &str, more: &str| {
        let one = "[[reaction]]\nequation = 'A + B -> C'\nbinding-radius = 1\nprobability = 0.8\n";
        decays(time_step, &[]) + one + "[[reaction]]\nequation = 'A + B -> D'\nbinding-radius = 1\n" + more
    };
    let rate = "rate-inside = 100\n";
    let refused = parse(&text("0.01", rate)).unwrap_err().to_string();
    let expected = "of A + B -> C and of A + B -> D add up to 1.432121 in a step, more than the limit of 1";
    assert!(refused.contains(expected), "{refused}");
    let step = refused.split("set time-step to ").nth(1).unwrap().split(' ').next().unwrap();
    assert!(parse(&text(step, rate)).is_ok(), "{refused}");
    let longer = (1.02 * step.parse::<f64>().unwrap()).to_string();
    assert!(parse(&text(&longer, rate)).is_err(), "{refused}");
    let refused = parse(&text("0.01", "probability = 0.6\n")).unwrap_err().to_string();
    assert!(refused.ends_with("add up to 1.4 in a step, more than the limit of 1; lower them"), "{refused}");
}

#[test]
fn radii_that_are_zero_in_single_precision_are_refused() {
    let reaction = "[[reaction]]\nequation = 'A + B -> C'\n";
    let receiver = "[[receiver]]\nname = 'rx'\nkind = 'absorbing'\ncenter = [0, 0, 0]\n";
    let transmitter = "[[transmitter]]\nname = 'tx'\nrelease = [{ species = 'A', count = 1 }]\n";
    for (text, key) in [
        (format!("{reaction}binding-radius = 1e-60\n"), "binding-radius"),
        (format!("{reaction}rate = 1e-200\n"), "rate"),
        (format!("{receiver}radius = 1e-60\n"), "radius"),
        (format!("{receiver}radius = 1e-60\n").replace("'absorbing'", "'partial'\nrate = 1"), "radius"),
        ("[[species]]\nname = 'E'\nradius = 1e-60\n".to_owned(), "radius"),
        (format!("{transmitter}body-radius = 7e-46\n"), "body-radius"),
        (
            format!("{reaction}binding-radius = 1\nunbinding-radius = 1e-60\n").replace("C", "C + C"),
            "unbinding-radius",
        ),
    ] {
        assert_refused(parse(&(decays("0.01", &[]) + &text)), key, "µm is 0 in single precision");
    }
    // A radius that is small, but not 0, has a warning.
    assert!(parse(&(decays("0.01", &[]) + reaction + "rate = 1e-90\n")).is_ok());
}

#[test]
fn contradictory_releases_are_refused_at_their_line() {
    let transmitter = |more: &str| {
        decays("0.01", &[]) + "[[transmitter]]\nname = 'tx'\nrelease = [{ species = 'A', rate = 5 }]\n" + more
    };
    let ends = "the release is from 5 s until 2 s; the end must be later than the beginning";
    assert_refused(parse(&transmitter("from = 5\nuntil = 2\n")), "until", ends);
    let ball = "shape = { kind = 'ball', inner-radius = 3, radius = 2 }\n";
    let inverted = "the inner-radius 3 µm of the ball exceeds its radius 2 µm";
    assert_refused(parse(&transmitter(ball)), "shape", inverted);
    let source = format!("[[source]]\nequation = '-> A'\nrate = 1\n{ball}");
    assert_refused(parse(&(decays("0.01", &[]) + &source)), "shape", inverted);
}

#[test]
fn rate_of_reactants_that_do_not_diffuse_is_refused() {
    let text = decays("0.1", &[]) + "[[reaction]]\nequation = 'A + B -> C'\nrate = 5\n";
    assert!(parse(&text).is_ok());
    let refused = parse(&text.replace("diffusion = 1", "diffusion = 0")).unwrap_err().to_string();
    let expected = "`rate`: the reactants do not diffuse, and a rate is that of diffusion; give one of them";
    assert!(refused.contains(expected), "{refused}");
}

#[test]
fn releases_beyond_the_range_of_numbers_are_refused_at_their_line() {
    let shape = "center = [3e38, 0, 0]\nshape = { kind = 'gaussian', width = 1e38 }\n";
    let release = "release = [{ species = 'A', count = 9 }]\n";
    let text = decays("0.1", &[]) + "[[transmitter]]\nname = 'tx'\n" + shape + release;
    let refused = parse(&text).unwrap_err().to_string();
    assert!(
        refused.contains("line 16, `name`: tx may release particles at coordinates up to 9.0e38"),
        "{refused}"
    );
}

#[test]
fn rare_unbinding_is_warned_of() {
    let text = |rate: &str| {
        let cell = "[[receiver]]\nname = 'cell'\ncenter = [0, 0, 0]\nradius = 9\nkind = 'receptors'\n";
        let rates = format!("count = 1\nbinding-rate = 1e-6\nunbinding-rate = {rate}\n");
        decays("0.1", &[]) + cell + &rates
    };
    let messages = parse(&text("1e-8")).unwrap().warnings;
    assert_warns(&messages, "'unbinding of A from cell' has the probability 1.000e-9 in a step");
    assert!(messages[0].contains("its rate is off by 6.9 %"), "{messages:?}");
    assert_eq!(parse(&text("1e-6")).unwrap().warnings, [""; 0]);
}
