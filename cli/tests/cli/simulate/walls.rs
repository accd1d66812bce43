use super::{lazygrid, rows};
use lazygrid_tests::command::Scratch;

#[test]
fn shipped_wall_absorbs_by_the_closed_form() {
    let scratch = Scratch::new();
    let out = scratch.path("out");
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/../simulator/scenarios/wall.toml");
    lazygrid(["simulate", scenario, "--output", &out, "--report"]).succeeds();
    let arrivals = rows(&(out.clone() + "/arrivals.csv"));
    for row in rows(&(out.clone() + "/series.csv")) {
        let [time, count] = ["time", "outlet:A"].map(|name| row[name].parse::<f64>().unwrap());
        // erfc(a/√(4Dt)), from 6 µm.
        let fraction = if time > 0.0 { libm::erfc(6.0 / (400.0 * time).sqrt()) } else { 0.0 };
        let error = (4000.0 * fraction * (1.0 - fraction)).sqrt();
        assert!((count - 4000.0 * fraction).abs() <= 4.0 * error, "{row:?}, not {}", 4000.0 * fraction);
        let logged = arrivals.iter().filter(|row| row["time"].parse::<f64>().unwrap() <= time + 1e-9).count();
        assert_eq!(logged as f64, count);
    }
    assert!(rows(&(out + "/impulse-response.csv")).iter().any(|row| row["receiver"] == "outlet"));
}

#[test]
fn faulty_walls_are_refused_by_line() {
    let scratch = Scratch::new();
    let text = include_str!("../../../../simulator/scenarios/wall.toml");
    let cases = [
        ("face = \"low-x\"", "face = \"side\"", "is a wall that the boundary does not have"),
        ("face = \"low-x\"", "", "a wall needs a face"),
        ("kind = \"wall\"", "kind = \"absorbing\"", "face goes with kind = \"wall\""),
        ("face = \"low-x\"", "face = \"low-x\"\nradius = 3", "neither center, radius"),
        ("kind = \"wall\"\nface = \"low-x\"", "kind = \"absorbing\"", "needs a center and a radius"),
        ("steps = 400", "steps = 400\ncontact = \"separate\"", "set contact = \"count\""),
    ];
    for (from, to, message) in cases {
        let scenario = scratch.write("s.toml", &text.replace(from, to));
        let run = lazygrid(["simulate", &scenario, "--output", &scratch.path("out")]).fails();
        assert!(run.err.contains(message) && run.err.contains("line "), "{to}: {}", run.err);
    }
}
