//! Spheres in `f64` compared with `f32`, in unbounded and periodic space.
#![allow(clippy::print_stdout)]

use std::error::Error;

use clap::Parser;
use lazygrid::{Config, Detector, Skin, Space, Sphere};
use lazygrid_bench::measure::{
    ContenderFactory, Found, Options, PairFinder, Plan, compare, markdown, provenance,
};

#[derive(Parser)]
#[command(
    about = "f64 spheres compared with f32 ones; checks that all pairs are equal before it reports times"
)]
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

/// Returns a box of the scene's extent, so spheres at opposite faces touch.
fn periodic_box(plan: &Plan) -> Result<Space, Box<dyn Error>> {
    let spheres = plan.scene.spheres(plan.n, plan.seed);
    let extent = spheres.iter().fold(0.0, |extent: f32, s| extent.max(s.center.abs().max_element()));
    Ok(Space::periodic([Some(f64::from((2.0 * extent).max(1.0))); 3])?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let options = args.options.shrunk();
    println!("{}\n", provenance());
    let mut rows = Vec::new();
    for (plan, &threads) in
        options.plans().into_iter().flat_map(|plan| args.threads.iter().map(move |t| (plan, t)))
    {
        for (skin, list) in [(Skin::Off, "fresh"), (Skin::Auto, "candidates")] {
            for (space, kind) in [(Space::default(), "unbounded"), (periodic_box(&plan)?, "periodic")] {
                let config = Config::default().threads(threads).skin(skin).space(space);
                let wide = config.clone();
                let contenders = [
                    ContenderFactory::list("f32", config),
                    ContenderFactory::new("f64", move || {
                        Ok(F64Rows { detector: Detector::new(wide.clone())?, rows: Vec::new() })
                    }),
                ];
                let timings = compare(&plan, &contenders)?;
                let [narrow, wide] = [&timings[0], &timings[1]];
                rows.push(vec![
                    format!("{} {}", plan.scene, plan.n),
                    threads.to_string(),
                    kind.to_owned(),
                    list.to_owned(),
                    format!("{:.1}", narrow.median()),
                    format!("{:.1}", wide.median()),
                    wide.over(narrow).to_string(),
                ]);
            }
        }
    }
    let header = [
        "scene",
        "threads",
        "space",
        "search",
        "f32, ns per sphere",
        "f64, ns per sphere",
        "f64 / f32 (low–high)",
    ];
    println!("{}", markdown(&header, &rows));
    Ok(())
}
