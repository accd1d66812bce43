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
