use serde::Serialize;

use crate::series::Series;
use lazygrid_sim::animation::{Frame, moving_receivers};
use lazygrid_sim::{Axis, Model, Receiver, Shape, Species, Transmitter};

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Scene {
    title: String,
    note: String,
    species: Vec<SpeciesStyle>,
    walls: [Option<[f32; 2]>; 3],
    vessel: Option<Tube>,
    transceivers: Vec<Transceiver>,
    view: View,
    frames: Vec<FrameSummary>,
    times: Vec<f64>,
    charts: Vec<Chart>,
    #[serde(skip)]
    time_step: f64,
    /// Distances from the center of the view.
    #[serde(skip)]
    distances: Vec<f32>,
}

#[derive(Clone, Debug, Serialize)]
struct SpeciesStyle {
    name: String,
    radius: f32,
}

#[derive(Clone, Debug, Serialize)]
struct Tube {
    along: Option<usize>,
    center: [f32; 3],
    radius: f32,
}

#[derive(Clone, Copy, Debug, Serialize)]
struct View {
    center: [f32; 3],
    radius: f32,
}

#[derive(Clone, Debug, Serialize)]
struct Transceiver {
    name: String,
    role: &'static str,
    center: [f32; 3],
    /// Index in each frame's list of centers.
    #[serde(skip_serializing_if = "Option::is_none")]
    moves: Option<usize>,
    shape: Solid,
}

#[derive(Clone, Debug, Serialize)]
struct Solid {
    kind: &'static str,
    along: usize,
    size: [f32; 3],
}

/// A frame without its positions, which are sorted by species and relative to `low` and `size`.
#[derive(Clone, Debug, Serialize)]
struct FrameSummary {
    step: u32,
    time: f64,
    present: u64,
    counts: Vec<u32>,
    low: [f32; 3],
    size: [f32; 3],
    #[serde(skip_serializing_if = "Vec::is_empty")]
    centers: Vec<[f32; 3]>,
}

#[derive(Clone, Debug, Serialize)]
struct Chart {
    title: &'static str,
    lines: Vec<Line>,
}

#[derive(Clone, Debug, Serialize)]
struct Line {
    name: String,
    color: usize,
    counts: Vec<u64>,
}

/// Rows of the series in the charts.
const MAX_CHART_ROWS: usize = 1000;
/// Particles per frame that determine the view.
const MAX_VIEW_PARTICLES: usize = 500;
/// Fraction of these particles that the view contains.
const VIEW_FRACTION: f64 = 0.8;

impl Scene {
    pub(crate) fn new(model: &Model, title: &str, series: &Series) -> Self {
        let walls = model.boundary.axes.map(|axis| match axis {
            Axis::Open | Axis::Frozen => None,
            Axis::Reflecting { low, high } | Axis::Periodic { low, high } => Some([low, high]),
        });
        let vessel = model.boundary.vessel;
        let mut receivers: Vec<_> = model.receivers.iter().map(receiver).collect();
        moving_receivers(model).enumerate().for_each(|(nth, k)| receivers[k].moves = Some(nth));
        let moves = |from: &Transmitter| receivers[from.carrier? as usize].moves;
        let sources =
            model.transmitters.iter().map(|from| Transceiver { moves: moves(from), ..transmitter(from) });
        let mut transceivers: Vec<_> = sources.collect();
        // Walls, and the points that carry moving transmitters, have no radius.
        transceivers.extend(receivers.into_iter().filter(|receiver| receiver.shape.size[0] > 0.0));
        let step = series.steps.len().div_ceil(MAX_CHART_ROWS).max(1);
        let kind = |species: &Species| SpeciesStyle { name: species.name.clone(), radius: species.radius };
        let mut scene = Self {
            title: title.to_owned(),
            note: String::new(),
            species: model.species.iter().map(kind).collect(),
            walls,
            vessel: vessel.map(|v| Tube { along: v.along, center: v.center, radius: v.radius }),
            transceivers,
            view: View { center: [0.0; 3], radius: 0.0 },
            frames: Vec::new(),
            times: series.times.iter().step_by(step).copied().collect(),
            charts: charts(model, series, step),
            time_step: model.time_step,
            distances: Vec::new(),
        };
        scene.view = scene.bounds();
        scene
    }

    fn bounds(&self) -> View {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let mut see = |k: usize, ends: [f32; 2]| {
            low[k] = low[k].min(ends[0]);
            high[k] = high[k].max(ends[1]);
        };
        for k in 0..3 {
            for Transceiver { center, shape, .. } in &self.transceivers {
                see(k, [center[k] - shape.size[k], center[k] + shape.size[k]]);
            }
            if let Some(ends) = self.walls[k] {
                see(k, ends);
            }
            if let Some(Tube { along, center, radius }) = self.vessel
                && Some(k) != along
            {
                see(k, [center[k] - radius, center[k] + radius]);
            }
        }
        let ends = |k: usize| if low[k] <= high[k] { [low[k], high[k]] } else { [0.0; 2] };
        let center = std::array::from_fn(|k| (ends(k)[0] + ends(k)[1]) / 2.0);
        let half: [f32; 3] = std::array::from_fn(|k| (ends(k)[1] - ends(k)[0]) / 2.0);
        View { center, radius: length(half) }
    }

    pub(crate) fn add_frame(&mut self, frame: &Frame) {
        let mut counts = vec![0; self.species.len()];
        frame.rows.iter().for_each(|row| counts[row.species as usize] += 1);
        let (low, size) = extent(frame);
        let time = f64::from(frame.step) * self.time_step;
        let (present, centers) = (frame.present, frame.centers.clone());
        self.frames.push(FrameSummary { step: frame.step, time, present, counts, low, size, centers });
        for row in frame.rows.iter().step_by(frame.rows.len().div_ceil(MAX_VIEW_PARTICLES).max(1)) {
            let offset = std::array::from_fn(|k| row.position[k] - self.view.center[k]);
            self.distances.push(length(offset));
        }
    }

    /// Completes the scene after all frames, which have one in 2ˢʰⁱᶠᵗ particles.
    pub(crate) fn finished(mut self, shift: u32) -> Self {
        if shift > 0 {
            self.note = format!("1 of {} particles is drawn, chosen by its id", 1_u64 << shift);
        }
        if self.walls.iter().any(Option::is_none) {
            self.distances.retain(|distance| distance.is_finite());
            self.distances.sort_unstable_by(f32::total_cmp);
            let last = self.distances.len().saturating_sub(1);
            let view_distance =
                self.distances.get((last as f64 * VIEW_FRACTION) as usize).copied().unwrap_or(0.0);
            let moved = self.transceivers.iter().filter_map(|transceiver| {
                let distance = |frame: &FrameSummary| {
                    let center = frame.centers[transceiver.moves?];
                    let offset = std::array::from_fn(|k| center[k] - self.view.center[k]);
                    Some(length(offset) + transceiver.shape.size[0]).filter(|distance| distance.is_finite())
                };
                self.frames.iter().filter_map(distance).reduce(f32::max)
            });
            self.view.radius = moved.fold(self.view.radius.max(view_distance), f32::max);
        }
        if self.view.radius <= 0.0 || !self.view.radius.is_finite() {
            self.view.radius = 1.0;
        }
        let min_size = self.view.radius / 80.0;
        for transceiver in &mut self.transceivers {
            transceiver.shape.size = transceiver.shape.size.map(|half| half.max(min_size));
        }
        self
    }
}

pub(crate) fn quantized_positions(frame: &Frame) -> Vec<u8> {
    let (low, size) = extent(frame);
    let fraction = |k: usize, x: f32| if size[k] > 0.0 { (x - low[k]) / size[k] } else { 0.0 };
    let words = frame
        .rows
        .iter()
        .flat_map(|row| [0, 1, 2].map(|k: usize| (fraction(k, row.position[k]) * 65_535.0).round() as u16));
    words.flat_map(u16::to_le_bytes).collect()
}

fn extent(frame: &Frame) -> ([f32; 3], [f32; 3]) {
    let column = |k: usize| frame.rows.iter().map(move |row| row.position[k]).filter(|x| x.is_finite());
    let low = std::array::from_fn(|k| column(k).reduce(f32::min).unwrap_or(0.0));
    let size = std::array::from_fn(|k| column(k).reduce(f32::max).unwrap_or(0.0) - low[k]);
    (low, size)
}

fn length([x, y, z]: [f32; 3]) -> f32 {
    (x * x + y * y + z * z).sqrt()
}

fn transmitter(transmitter: &Transmitter) -> Transceiver {
    let solid = |kind, along, size| Solid { kind, along, size };
    let shape = match transmitter.shape {
        Shape::Point => solid("ball", 0, [0.0; 3]),
        Shape::Gaussian(width) => solid("ball", 0, [width; 3]),
        Shape::Shell(_, radius) => solid("ball", 0, [radius; 3]),
        Shape::Box(sides) | Shape::Lattice(sides, _) => solid("box", 0, sides.map(|side| side / 2.0)),
        Shape::Cylinder(along, radius, length) => {
            let half = |k: usize| if k == along { length / 2.0 } else { radius };
            solid("cylinder", along, std::array::from_fn(half))
        }
    };
    Transceiver {
        name: transmitter.name.clone(),
        role: "transmitter",
        center: transmitter.center,
        moves: None,
        shape,
    }
}

fn receiver(receiver: &Receiver) -> Transceiver {
    let shape = Solid { kind: "ball", along: 0, size: [receiver.radius; 3] };
    Transceiver { name: receiver.name.clone(), role: "receiver", center: receiver.center, moves: None, shape }
}

fn charts(model: &Model, series: &Series, step: usize) -> Vec<Chart> {
    let species = model.species.len();
    let reactions = species + model.reactions.len() + model.decays.len();
    let received = series.names.len().saturating_sub(2).max(reactions);
    let charts = [
        ("particles", 0..species),
        ("reactions so far", species..reactions),
        ("receivers", reactions..received),
        ("pairs and contacts", received..series.names.len()),
    ];
    let chart = |(title, columns): (&'static str, std::ops::Range<usize>)| {
        let line = |(color, column): (usize, usize)| {
            let counts: Vec<u64> = series.column(column).step_by(step).collect();
            let name = series.names[column].clone();
            counts.iter().any(|&count| count > 0).then_some(Line { name, color, counts })
        };
        let lines: Vec<_> =
            columns.filter(|&k| k < series.names.len()).enumerate().filter_map(line).collect();
        (!lines.is_empty()).then_some(Chart { title, lines })
    };
    charts.into_iter().filter_map(chart).collect()
}
