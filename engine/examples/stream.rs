//! Streams more pairs than fit into memory, in bounded chunks, with an early stop.
//!
//! `cargo run --release -p lazygrid --example stream [SPHERES]`

use std::error::Error;
use std::io::{Write, stdout};
use std::ops::ControlFlow;

use lazygrid::{Config, Detector, Order, Sphere};

fn main() -> Result<(), Box<dyn Error>> {
    let count = std::env::args().nth(1).map_or(Ok(5000), |text| text.parse::<usize>())?;
    let burst: Vec<Sphere> = vec![Sphere::new([0.0; 3], 1.0); count];

    let mut detector = Detector::new(Config::default().order(Order::Unordered))?;
    let found = detector.count(&burst)?;
    writeln!(stdout(), "{count} spheres have {found} pairs, a list of {} MB", found * 8 / 1_000_000)?;

    let mut degree = vec![0_u32; burst.len()];
    let delivered = detector.stream(&burst, 10_000, |chunk| {
        for pair in chunk {
            degree[pair.i as usize] += 1;
            degree[pair.j as usize] += 1;
        }
        ControlFlow::Continue(())
    })?;
    writeln!(
        stdout(),
        "{delivered} pairs streamed; sphere 0 is in {} of them",
        degree.first().unwrap_or(&0)
    )?;

    let mut seen = 0;
    detector.stream(&burst, 1000, |chunk| {
        seen += chunk.len();
        if seen < 100_000 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    })?;
    writeln!(stdout(), "stopped after {seen}")?;
    Ok(())
}
