use super::*;

const TEXT: &str = "time-step = 0.01 # s\nsteps = 10\nseed = 3\n[[species]]\nname = 'A'\ndiffusion = 2\n\
    [[transmitter]]\nname = 'tx'\nbits = \"01\"\nsymbol-time = 0.02\nrelease = [{ species = 'A', count = 5 }]\n\
    [[receiver]]\nname = 'rx'\ncenter = [5, 0, 0]\nradius = 1\nkind = 'transparent'\n";

fn sweep(text: &str, options: &[&str]) -> Result<Option<Sweep>, String> {
    let options: Vec<String> = options.iter().map(|&option| option.to_owned()).collect();
    Sweep::parse(Path::new("s.toml"), text, &options).map_err(|error| error.to_string())
}

#[test]
fn combinations_are_scenarios_with_these_values() {
    let options = ["receiver.rx.center.x=5,10,20", "time-step=0.01, 0.005"];
    let sweep = sweep(TEXT, &options).unwrap().unwrap();
    let seen: Vec<_> = sweep
        .points
        .iter()
        .map(|point| {
            let model = &point.scenario.model;
            (point.values.join(" "), model.receivers[0].center[0], model.time_step)
        })
        .collect();
    let expected = [
        ("5 0.01", 5.0, 0.01),
        ("5 0.005", 5.0, 0.005),
        ("10 0.01", 10.0, 0.01),
        ("10 0.005", 10.0, 0.005),
        ("20 0.01", 20.0, 0.01),
        ("20 0.005", 20.0, 0.005),
    ];
    assert_eq!(seen, expected.map(|(values, x, step)| (values.to_owned(), x, step)));
    assert_eq!(sweep.points[3].scenario.text, TEXT.replace("0.01 #", "0.005 #").replace("[5,", "[10,"));
}

#[test]
fn section_is_read_and_leaves_no_trace() {
    let section = "[sweep]\n# distances\nreceiver.rx.center = [\n[5, 0, 0],\n  [7, 0, 0]]\n\"transmitter.tx.release.A.count\" = [5, 6]\n";
    let (head, tail) = TEXT.split_once("[[receiver]]").unwrap();
    for text in [format!("{TEXT}{section}"), format!("{head}{section}[[receiver]]{tail}")] {
        let sweep = sweep(&text, &["transmitter.tx.release.A.count=8"]).unwrap().unwrap();
        assert_eq!(sweep.points.len(), 2);
        let point = &sweep.points[1];
        assert_eq!(point.values, ["[7 0 0]", "8"]);
        let model = &point.scenario.model;
        assert_eq!((model.receivers[0].center[0], model.transmitters[0].release[0].1), (7.0, 8));
        assert_eq!(point.scenario.text.lines().count(), text.lines().count());
        assert!(!point.scenario.text.contains("distances"));
    }
    let error = Scenario::parse(Path::new("s.toml"), format!("{TEXT}{section}")).unwrap_err().to_string();
    assert!(error.contains("line 17, `sweep`: ") && error.contains("lazygrid simulate"), "{error}");
}

#[test]
fn equal_values_are_refused() {
    for (option, value) in [
        ("time-step=1e-2,0.005,0.01", "0.01"),
        ("transmitter.tx.bits=01,10,01", "\"01\""),
        ("receiver.rx.center=[1, 0, 0],[1, 0, 0]", "[1, 0, 0]"),
        ("seed=1_0,7,10", "10"),
        ("seed=20,2e1", "2e1"),
    ] {
        let refused = sweep(TEXT, &[option]).unwrap_err();
        assert!(refused.contains(&format!("has the value {value} of ")), "{option}: {refused}");
    }
    assert_eq!(sweep(TEXT, &["transmitter.tx.bits=01,001,1"]).unwrap().unwrap().points.len(), 3);
    // Equal as `f64`.
    for option in [
        "seed=9007199254740992,9007199254740993",
        "transmitter.tx.bits=1111111111111111111,1111111111111111110",
    ] {
        assert_eq!(sweep(TEXT, &[option]).unwrap().unwrap().points.len(), 2, "{option}");
    }
}

#[test]
fn keys_of_several_entries_are_refused() {
    let entry = "{ species = 'A', count = 5 }";
    let twice =
        TEXT.replace("bits = \"01\"\nsymbol-time = 0.02\n", "").replace(entry, &format!("{entry}, {entry}"));
    let refused = sweep(&twice, &["transmitter.tx.release.A.count=1,2"]).unwrap_err();
    assert!(refused.contains("several keys 'transmitter.tx.release.A.count' to sweep"), "{refused}");
    let points = sweep(&twice, &["transmitter.tx.release.1.count=1,2"]).unwrap().unwrap().points;
    let counts = points.iter().map(|point| &point.scenario.model.transmitters[0].release);
    assert!(counts.eq(&[vec![(0, 5), (0, 1)], vec![(0, 5), (0, 2)]]));
    // The first receiver has the name of the second one's index.
    let named =
        format!("{TEXT}[[receiver]]\nname = 'ry'\ncenter = [9, 0, 0]\nradius = 1\nkind = 'transparent'\n");
    assert!(sweep(&named, &["receiver.1.radius=2,3"]).is_ok());
    assert!(sweep(&named.replace("'rx'", "'1'"), &["receiver.1.radius=2,3"]).is_err());
}

#[test]
fn strings_stay_strings() {
    for (option, bits) in [("bits=0110,10", ["0110", "10"]), ("bits='11',\"00\"", ["11", "00"])] {
        let sweep = sweep(TEXT, &[&format!("transmitter.tx.{option}")]).unwrap().unwrap();
        assert_eq!(sweep.points.iter().map(|point| &point.values[0][..]).collect::<Vec<_>>(), bits);
    }
}

#[test]
fn faulty_sweeps_are_explained() {
    for (option, message) in [
        ("receiver.rx.radios=1,2", "the nearest is 'receiver.rx.radius'"),
        ("reciever.rx.center.x=1", "the nearest is 'receiver.rx.center.x'"),
        ("timestep=1", "the nearest is 'time-step'"),
        ("time-step", "is not KEY=VALUE,VALUE"),
        ("time-step=", "is not KEY=VALUE,VALUE"),
        ("time-step=0.02,-1", "time-step = -1: s.toml, line 1, `time-step`: -1 is not a positive number"),
        ("receiver.rx.kind=transparent,opaque", "receiver.rx.kind = opaque: s.toml, line 16"),
    ] {
        let error = sweep(TEXT, &[option]).unwrap_err();
        assert!(error.contains(message), "{option}: {error}");
    }
    let both = sweep(TEXT, &["receiver.rx.center.x=1", "receiver.0.center=[1, 1, 1]"]).unwrap_err();
    assert!(both.contains("a part of the other"), "{both}");
    let twice = sweep(TEXT, &["steps=10,20", "seed=1", "steps=30"]).unwrap_err();
    assert!(
        twice.contains("--sweep steps: given twice; give all values at once, such as steps=1,2,3"),
        "{twice}"
    );
    let values = (0..400).map(|k| k.to_string()).collect::<Vec<_>>().join(",");
    let [a, b] = ["seed", "steps"].map(|key| format!("{key}={values}"));
    assert!(sweep(TEXT, &[&a, &b]).unwrap_err().contains("more than 100000 combinations"));
    for (section, message) in [
        ("[sweep]\n", "line 17, `sweep`: it has no keys"),
        ("[sweep]\nseed = 3\n", "line 18, `seed`: it needs a list"),
    ] {
        let error = sweep(&format!("{TEXT}{section}"), &[]).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
    assert!(sweep(&format!("sweep.seed = [1]\n{TEXT}"), &[]).unwrap_err().contains("a section of its own"));
    assert!(sweep(TEXT, &[]).unwrap().is_none());
}
