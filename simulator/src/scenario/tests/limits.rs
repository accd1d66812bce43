//! Small files that describe much work.

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
