//! Layouts and precisions of spheres, in each kind of space.
#![allow(clippy::print_stdout)]

use std::error::Error;

use clap::Parser;
use lazygrid::{Config, Detector, Radii, Skin, Space, Sphere, Spheres};
use lazygrid_bench::measure::{
    ContenderFactory, Found, Options, PairFinder, Plan, compare, markdown, provenance,
};

#[derive(Parser)]
#[command(about = "Layouts and spaces; checks that all pairs are equal before it reports times")]
struct Args {
    /// Numbers of threads, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [1])]
    threads: Vec<usize>,
    #[command(flatten)]
    options: Options,
}

struct F64Rows {
    detector: Detector,
    rows: Vec<[f64; 4]>,
}

impl PairFinder for F64Rows {
    fn prepare(&mut self, spheres: &[Sphere]) -> Result<(), Box<dyn Error>> {
        self.rows.clear();
        self.rows.extend(spheres.iter().map(|sphere| {
            let [x, y, z] = sphere.center.to_array();
            [x, y, z, sphere.radius].map(f64::from)
        }));
        Ok(())
    }

    fn run(&mut self, _: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        Ok(Found::Pairs(self.detector.pairs(&self.rows[..])?))
    }
}

/// The layout of most NumPy arrays.
struct F32Points {
    detector: Detector,
    points: Vec<[f32; 3]>,
    radii: Vec<f32>,
}

impl PairFinder for F32Points {
    fn prepare(&mut self, spheres: &[Sphere]) -> Result<(), Box<dyn Error>> {
        self.points.clear();
        self.points.extend(spheres.iter().map(|sphere| sphere.center.to_array()));
        self.radii.clear();
        self.radii.extend(spheres.iter().map(|sphere| sphere.radius));
        Ok(())
    }

    fn run(&mut self, _: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        let Self { detector, points, radii } = self;
        Ok(Found::Pairs(detector.pairs(Spheres::points(points, Radii::Each(radii))?)?))
    }
}

fn contenders(config: &Config) -> [ContenderFactory; 3] {
    let (points, rows) = (config.clone(), config.clone());
    [
        ContenderFactory::list("f32 rows", config.clone()),
        ContenderFactory::new("f32 points", move || {
            let detector = Detector::new(points.clone())?;
            Ok(F32Points { detector, points: Vec::new(), radii: Vec::new() })
        }),
        ContenderFactory::new("f64 rows", move || {
            Ok(F64Rows { detector: Detector::new(rows.clone())?, rows: Vec::new() })
        }),
    ]
}

/// Returns spaces in which spheres at opposite faces touch. A period that is no `f32` number needs a search frame.
fn spaces(plan: &Plan) -> Result<[(&'static str, Space); 4], Box<dyn Error>> {
    let spheres = plan.scene.spheres(plan.n, plan.seed);
    let extent = spheres.iter().fold(0.0, |extent: f32, s| extent.max(s.center.abs().max_element()));
    let length = f64::from((2.0 * extent).max(1.0));
    let tilted = [[length, 0.0, 0.0], [0.3 * length, length, 0.0], [0.2 * length, 0.1 * length, length]];
    Ok([
        ("unbounded", Space::default()),
        ("periodic", Space::periodic([Some(length); 3])?),
        ("periodic, f64 lengths", Space::periodic([Some(length.next_up()); 3])?),
        ("triclinic", Space::triclinic(tilted.map(Some))?),
    ])
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let options = args.options.shrunk();
    println!("{}\n", provenance());
    let mut rows = Vec::new();
    for (plan, &threads) in
        options.plans().into_iter().flat_map(|plan| args.threads.iter().map(move |t| (plan, t)))
    {
        for (space_name, space) in spaces(&plan)? {
            for (skin, search) in [(Skin::Off, "fresh"), (Skin::Auto, "candidates")] {
                let config = Config::default().threads(threads).skin(skin).space(space);
                let mut row = vec![
                    format!("{} {}", plan.scene, plan.n),
                    threads.to_string(),
                    space_name.to_owned(),
                    search.to_owned(),
                ];
                row.extend(
                    compare(&plan, &contenders(&config))?
                        .iter()
                        .map(|timing| format!("{:.1}", timing.median())),
                );
                rows.push(row);
            }
        }
    }
    println!("Nanoseconds per sphere and step:\n");
    println!(
        "{}",
        markdown(&["scene", "threads", "space", "search", "f32 rows", "f32 points", "f64 rows"], &rows)
    );
    Ok(())
}
