use super::*;

#[test]
fn sequences_on_the_cpu_are_right() {
    let mut tally = Tally::default();
    for seed in 0..400 {
        assert_eq!(
            Sequence::drawn(seed, true, false).to_string(),
            Sequence::drawn(seed, true, false).to_string()
        );
        if let Some(FailedCase { name, what, .. }) =
            Sequence::drawn(seed, true, false).check(None, 300, &mut tally)
        {
            panic!("{name}: {what}");
        }
    }
    let Tally { sequences, calls, served, refused } = tally;
    let enough = sequences == 400 && calls > 2000 && served > 100 && refused > 100;
    assert!(enough, "{tally:?}");
}
