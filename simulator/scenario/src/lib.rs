//! Tables of a scenario file. `docs/simulator.md` describes the keys.
//!
//! A separate crate, because the code that serde derives takes long to compile.

#![allow(missing_docs, reason = "docs/simulator.md describes the keys")]

mod chemotaxis;
mod space;

use serde::Deserialize;
use toml::Spanned;

pub use chemotaxis::{Attractant, AttractantProfile, Chemotaxis};
pub use space::{AxisName, Boundary, BoundaryKind, Ends, Flow, Profile};

/// Parses the text of a scenario file.
///
/// # Errors
/// Text that is not TOML, unknown and missing keys, and values of the wrong type or range.
pub fn parse(text: &str) -> Result<File, toml::de::Error> {
    toml::from_str(text)
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct File {
    pub time_step: Positive,
    pub steps: u32,
    #[serde(default)]
    pub seed: u64,
    pub dimensions: Option<Spanned<Dimensions>>,
    pub contact: Option<Spanned<Contact>>,
    pub boundary: Option<Boundary>,
    pub flow: Option<Flow>,
    pub species: Vec<Species>,
    #[serde(default, rename = "attractant")]
    pub attractants: Vec<Attractant>,
    #[serde(default, rename = "reaction")]
    pub reactions: Vec<Reaction>,
    #[serde(default, rename = "decay")]
    pub decays: Vec<Decay>,
    #[serde(default, rename = "source")]
    pub sources: Vec<Source>,
    #[serde(default, rename = "transmitter")]
    pub transmitters: Vec<Transmitter>,
    #[serde(default, rename = "receiver")]
    pub receivers: Vec<Receiver>,
    #[serde(default, rename = "membrane")]
    pub membranes: Vec<Membrane>,
    #[serde(default)]
    pub output: Output,
    pub sweep: Option<Spanned<serde::de::IgnoredAny>>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Contact {
    #[default]
    Ignore,
    Count,
    Separate,
    Elastic,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Species {
    pub name: Spanned<Name>,
    pub radius: Option<Spanned<NotNegative>>,
    #[serde(default)]
    pub diffusion: NotNegative,
    #[serde(default)]
    pub drift: [Finite; 3],
    pub mass: Option<Spanned<Positive>>,
    #[serde(default)]
    pub thermal_speed: NotNegative,
    pub speed: Option<Spanned<NotNegative>>,
    pub tumble_rate: Option<Spanned<NotNegative>>,
    pub chemotaxis: Option<Chemotaxis>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Reaction {
    pub equation: Spanned<String>,
    pub binding_radius: Option<Spanned<Positive>>,
    pub rate: Option<Spanned<Positive>>,
    pub rate_inside: Option<Spanned<Positive>>,
    pub unbinding_radius: Option<Spanned<NotNegative>>,
    pub probability: Option<Spanned<Probability>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Decay {
    pub equation: Spanned<String>,
    pub rate: Spanned<Positive>,
    pub unbinding_radius: Option<Spanned<NotNegative>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Source {
    pub equation: Spanned<String>,
    pub rate: Positive,
    pub center: Option<Spanned<[Finite; 3]>>,
    pub shape: Option<Spanned<Shape>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Transmitter {
    pub name: Spanned<Name>,
    pub center: Option<Spanned<[Finite; 3]>>,
    pub body_radius: Option<Spanned<Positive>>,
    #[serde(default)]
    pub velocity: [Finite; 3],
    #[serde(default)]
    pub diffusion: NotNegative,
    pub times: Option<Spanned<Vec<NotNegative>>>,
    #[serde(default)]
    pub shape: Shape,
    pub release: Spanned<Vec<Release>>,
    #[serde(default)]
    pub numbers: Numbers,
    pub from: Option<Spanned<NotNegative>>,
    pub until: Option<Spanned<NotNegative>>,
    pub bits: Option<Spanned<String>>,
    pub random_bits: Option<Spanned<std::num::NonZeroU32>>,
    pub symbol_time: Option<Spanned<Positive>>,
    pub start: Option<Spanned<NotNegative>>,
    pub modulation: Option<Spanned<Modulation>>,
    pub levels: Option<Spanned<Vec<NotNegative>>>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Numbers {
    #[default]
    Fixed,
    Poisson,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Modulation {
    #[default]
    Ook,
    Csk,
    Mosk,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Release {
    pub species: Spanned<String>,
    pub count: Option<u32>,
    pub rate: Option<Positive>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case", rename_all_fields = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum Shape {
    #[default]
    Point,
    Gaussian {
        width: NotNegative,
    },
    Ball {
        #[serde(default)]
        inner_radius: NotNegative,
        radius: Positive,
    },
    Box {
        size: [Positive; 3],
    },
    Cylinder {
        #[serde(default)]
        axis: AxisName,
        radius: Positive,
        #[serde(default)]
        length: NotNegative,
    },
    Lattice {
        size: [Positive; 3],
        places: [std::num::NonZeroU32; 3],
    },
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Receiver {
    pub name: Spanned<Name>,
    pub center: Option<Spanned<[Finite; 3]>>,
    pub radius: Option<Spanned<Positive>>,
    pub kind: Spanned<ReceiverKind>,
    pub face: Option<Spanned<Face>>,
    pub species: Option<Spanned<Vec<Spanned<String>>>>,
    pub lattice: Option<Lattice>,
    pub probability: Option<Spanned<Probability>>,
    pub rate: Option<Spanned<Positive>>,
    pub count: Option<Spanned<std::num::NonZeroU32>>,
    pub binding_rate: Option<Spanned<Positive>>,
    pub unbinding_rate: Option<Spanned<Positive>>,
    pub receptors: Option<Spanned<Vec<ReceptorType>>>,
    pub surface_diffusion: Option<Spanned<NotNegative>>,
    #[serde(default)]
    pub velocity: [Finite; 3],
    #[serde(default)]
    pub diffusion: NotNegative,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Membrane {
    pub name: Spanned<Name>,
    pub axis: Option<Spanned<AxisName>>,
    pub position: Option<Spanned<Finite>>,
    pub center: Option<Spanned<[Finite; 3]>>,
    pub radius: Option<Spanned<Positive>>,
    pub permeability: NotNegative,
    pub species: Option<Spanned<Vec<Spanned<String>>>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct ReceptorType {
    pub count: std::num::NonZeroU32,
    pub ligands: Spanned<Vec<Ligand>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Ligand {
    pub species: Spanned<String>,
    pub binding_rate: Positive,
    pub unbinding_rate: Positive,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Lattice {
    pub size: [Positive; 3],
    pub places: [std::num::NonZeroU32; 3],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReceiverKind {
    Absorbing,
    Endpoint,
    Transparent,
    Reflecting,
    Partial,
    Receptors,
    Wall,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Face {
    LowX,
    LowY,
    LowZ,
    HighX,
    HighY,
    HighZ,
    Side,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Output {
    pub every: Option<std::num::NonZeroU32>,
    pub frames_every: Option<Spanned<std::num::NonZeroU32>>,
    #[serde(default)]
    pub frames: Vec<FrameFormat>,
    pub checkpoint_every: Option<std::num::NonZeroU32>,
    pub arrivals: Option<Spanned<bool>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FrameFormat {
    Xyz,
    Npy,
}

/// Defines a number type that is checked on reading, so that an error names its line.
macro_rules! number {
    ($name:ident, $rule:expr, $allowed:literal) => {
        #[derive(Clone, Copy, Debug, Default, Deserialize)]
        #[serde(try_from = "f64")]
        pub struct $name(pub f64);

        impl TryFrom<f64> for $name {
            type Error = String;

            fn try_from(value: f64) -> Result<Self, String> {
                let rule: fn(f64) -> bool = $rule;
                // Positions and radii have single precision.
                let fits = value.is_finite() && (value as f32).is_finite();
                if fits && rule(value) {
                    Ok(Self(value))
                } else {
                    Err(format!("{value} is not {}", $allowed))
                }
            }
        }
    };
}

number!(Positive, |value| value > 0.0, "a positive number below 3.4e38");
number!(NotNegative, |value| value >= 0.0, "a number from 0 to 3.4e38");
number!(Finite, |_| true, "a number between -3.4e38 and 3.4e38");
number!(Probability, |value| value > 0.0 && value <= 1.0, "a probability above 0 and at most 1");

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "i64")]
pub struct Dimensions(pub usize);

impl TryFrom<i64> for Dimensions {
    type Error = String;

    fn try_from(value: i64) -> Result<Self, String> {
        match value {
            1..=3 => Ok(Self(value as usize)),
            _ => Err(format!("{value} dimensions are not 1, 2 or 3")),
        }
    }
}

/// Longest name, in bytes. Names are columns of tables and part of messages.
const MAX_NAME_BYTES: usize = 255;

/// A name of letters, digits, `_`, `.` and `-`.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "String")]
pub struct Name(pub String);

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let plain = |c: char| c.is_alphanumeric() || "_.-".contains(c);
        if text.len() > MAX_NAME_BYTES {
            Err(format!(
                "the name has {} bytes, more than the limit of {MAX_NAME_BYTES}; shorten it",
                text.len()
            ))
        } else if !text.is_empty() && text.chars().all(plain) && !text.contains("->") {
            Ok(Self(text))
        } else {
            Err(format!("'{text}' is not a name; use letters, digits, '_', '.' and '-'"))
        }
    }
}
