//! Small files that describe much work.

use std::fmt::Write;
use std::time::{Duration, Instant};

use super::super::Sweep;
use super::*;

fn at_once<T>(work: impl FnOnce() -> T) -> T {
    let begun = Instant::now();
    let result = work();
    assert!(begun.elapsed() < Duration::from_secs(30), "{:?}", begun.elapsed());
    result
}

#[test]
fn nested_arrays_have_few_keys() {
    let sweep = |text: &str, option: &str| {
        at_once(|| Sweep::parse(Path::new("s.toml"), text, &[option.to_owned()]))
            .map(|sweep| sweep.map_or(0, |sweep| sweep.points.len()))
            .map_err(|error| error.to_string())
    };
    let nested = format!("{}0{}", "[0, 0, ".repeat(40), "]".repeat(40));
    let tables = (0..20).fold("0".to_owned(), |inner, _| format!("[{{ name = \"a\", v = {inner} }}]"));
    let keys: String = (0..2_000).map(|k| format!(", k{k} = 0")).collect();
    let long = format!("[{{ name = \"{}\"{keys} }}]", "n".repeat(100_000));
    for value in [nested, tables, long] {
        let text = format!("v = {value}\n{GOOD}");
        let refused = sweep(&text, "nothing=1,2").unwrap_err();
        assert!(refused.contains("has no key 'nothing' to sweep"), "{refused}");
    }
    assert_eq!(sweep(GOOD, "transmitter.tx.release.acid.count=1,2,3"), Ok(3));
    assert_eq!(sweep(GOOD, "receiver.rx.center.z=1,2"), Ok(2));
}

#[test]
fn many_reactions_of_a_pair_are_refused() {
    let reactions = |count: u32| {
        let mut text = GOOD.to_owned();
        for k in 0..count {
            let equation =
                if k.is_multiple_of(2) { "base + base -> acid" } else { "base + base -> acid + base" };
            let radius = 1.0 + f64::from(k) / 65536.0;
            write!(text, "[[reaction]]\nequation = \"{equation}\"\n").unwrap();
            write!(text, "binding-radius = {radius}\nprobability = 1e-6\n").unwrap();
        }
        at_once(|| parse(&text))
            .map(|scenario| scenario.model.reactions.len())
            .map_err(|error| error.to_string())
    };
    assert_eq!(reactions(300), Ok(301));
    let refused = reactions(1001).unwrap_err();
    let message = "base and base have 1001 reactions, more than the limit of 1000; merge or remove some";
    assert!(refused.contains(message), "{refused}");
}
