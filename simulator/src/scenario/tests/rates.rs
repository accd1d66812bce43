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
