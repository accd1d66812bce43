mod chemotaxis;
mod space;

use serde::Deserialize;
use toml::Spanned;

pub(super) use self::chemotaxis::{Attractant, AttractantProfile, Chemotaxis};
pub(super) use self::space::{AxisName, Boundary, BoundaryKind, Ends, Flow, Profile};

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct File {
    pub(super) time_step: Positive,
    pub(super) steps: u32,
    #[serde(default)]
    pub(super) seed: u64,
    pub(super) dimensions: Option<Spanned<Dimensions>>,
    pub(super) contact: Option<Spanned<Contact>>,
    pub(super) boundary: Option<Boundary>,
    pub(super) flow: Option<Flow>,
    pub(super) species: Vec<Species>,
    #[serde(default, rename = "attractant")]
    pub(super) attractants: Vec<Attractant>,
    #[serde(default, rename = "reaction")]
    pub(super) reactions: Vec<Reaction>,
    #[serde(default, rename = "decay")]
    pub(super) decays: Vec<Decay>,
    #[serde(default, rename = "source")]
    pub(super) sources: Vec<Source>,
    #[serde(default, rename = "transmitter")]
    pub(super) transmitters: Vec<Transmitter>,
    #[serde(default, rename = "receiver")]
    pub(super) receivers: Vec<Receiver>,
    #[serde(default, rename = "membrane")]
    pub(super) membranes: Vec<Membrane>,
    #[serde(default)]
    pub(super) output: Output,
    pub(super) sweep: Option<Spanned<serde::de::IgnoredAny>>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Contact {
    #[default]
    Ignore,
    Count,
    Separate,
    Elastic,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct Species {
    pub(super) name: Spanned<Name>,
    pub(super) radius: Option<Spanned<NotNegative>>,
    #[serde(default)]
    pub(super) diffusion: NotNegative,
    #[serde(default)]
    pub(super) drift: [Finite; 3],
    #[serde(default)]
    pub(super) mass: One,
    #[serde(default)]
    pub(super) thermal_speed: NotNegative,
    pub(super) speed: Option<Spanned<NotNegative>>,
    #[serde(default)]
    pub(super) tumble_rate: NotNegative,
    pub(super) chemotaxis: Option<Chemotaxis>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct Reaction {
    pub(super) equation: Spanned<String>,
    pub(super) binding_radius: Option<Spanned<Positive>>,
    pub(super) rate: Option<Spanned<Positive>>,
    pub(super) rate_inside: Option<Spanned<Positive>>,
    #[serde(default)]
    pub(super) unbinding_radius: NotNegative,
    pub(super) probability: Option<Spanned<Probability>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct Decay {
    pub(super) equation: Spanned<String>,
    pub(super) rate: Spanned<Positive>,
    pub(super) unbinding_radius: Option<Spanned<NotNegative>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct Source {
    pub(super) equation: Spanned<String>,
    pub(super) rate: Positive,
    pub(super) center: Option<Spanned<[Finite; 3]>>,
    pub(super) shape: Option<Spanned<Shape>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct Transmitter {
    pub(super) name: Spanned<Name>,
    pub(super) center: Option<Spanned<[Finite; 3]>>,
    pub(super) body_radius: Option<Positive>,
    #[serde(default)]
    pub(super) velocity: [Finite; 3],
    #[serde(default)]
    pub(super) diffusion: NotNegative,
    pub(super) times: Option<Spanned<Vec<NotNegative>>>,
    #[serde(default)]
    pub(super) shape: Shape,
    pub(super) release: Spanned<Vec<Release>>,
    #[serde(default)]
    pub(super) numbers: Numbers,
    pub(super) from: Option<Spanned<NotNegative>>,
    pub(super) until: Option<Spanned<NotNegative>>,
    pub(super) bits: Option<Spanned<String>>,
    pub(super) random_bits: Option<Spanned<std::num::NonZeroU32>>,
    pub(super) symbol_time: Option<Spanned<Positive>>,
    pub(super) start: Option<Spanned<NotNegative>>,
    pub(super) modulation: Option<Spanned<Modulation>>,
    pub(super) levels: Option<Spanned<Vec<NotNegative>>>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Numbers {
    #[default]
    Fixed,
    Poisson,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Modulation {
    #[default]
    Ook,
    Csk,
    Mosk,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct Release {
    pub(super) species: Spanned<String>,
    pub(super) count: Option<u32>,
    pub(super) rate: Option<Positive>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case", rename_all_fields = "kebab-case", tag = "kind", deny_unknown_fields)]
pub(super) enum Shape {
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
pub(super) struct Receiver {
    pub(super) name: Spanned<Name>,
    pub(super) center: Option<Spanned<[Finite; 3]>>,
    pub(super) radius: Option<Spanned<Positive>>,
    pub(super) kind: Spanned<ReceiverKind>,
    pub(super) face: Option<Spanned<Face>>,
    pub(super) species: Option<Vec<Spanned<String>>>,
    pub(super) lattice: Option<Lattice>,
    pub(super) probability: Option<Spanned<Probability>>,
    pub(super) rate: Option<Spanned<Positive>>,
    pub(super) count: Option<Spanned<std::num::NonZeroU32>>,
    pub(super) binding_rate: Option<Spanned<Positive>>,
    pub(super) unbinding_rate: Option<Spanned<Positive>>,
    pub(super) receptors: Option<Spanned<Vec<ReceptorType>>>,
    pub(super) surface_diffusion: Option<Spanned<NotNegative>>,
    #[serde(default)]
    pub(super) velocity: [Finite; 3],
    #[serde(default)]
    pub(super) diffusion: NotNegative,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct Membrane {
    pub(super) name: Spanned<Name>,
    pub(super) axis: Option<Spanned<AxisName>>,
    pub(super) position: Option<Spanned<Finite>>,
    pub(super) center: Option<Spanned<[Finite; 3]>>,
    pub(super) radius: Option<Spanned<Positive>>,
    pub(super) permeability: NotNegative,
    pub(super) species: Option<Vec<Spanned<String>>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct ReceptorType {
    pub(super) count: std::num::NonZeroU32,
    pub(super) ligands: Vec<Ligand>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct Ligand {
    pub(super) species: Spanned<String>,
    pub(super) binding_rate: Positive,
    pub(super) unbinding_rate: Positive,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) struct Lattice {
    pub(super) size: [Positive; 3],
    pub(super) places: [std::num::NonZeroU32; 3],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ReceiverKind {
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
pub(super) enum Face {
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
pub(super) struct Output {
    pub(super) every: Option<std::num::NonZeroU32>,
    pub(super) frames_every: Option<std::num::NonZeroU32>,
    #[serde(default)]
    pub(super) frames: Vec<FrameFormat>,
    pub(super) checkpoint_every: Option<std::num::NonZeroU32>,
    #[serde(default)]
    pub(super) arrivals: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum FrameFormat {
    Xyz,
    Npy,
}

/// Checked when read, so that an error names its line.
macro_rules! number {
    ($name:ident, $rule:expr, $allowed:literal) => {
        #[derive(Clone, Copy, Debug, Default, Deserialize)]
        #[serde(try_from = "f64")]
        pub(super) struct $name(pub(super) f64);

        impl TryFrom<f64> for $name {
            type Error = String;

            fn try_from(value: f64) -> Result<Self, String> {
                let rule: fn(f64) -> bool = $rule;
                // Positions and radii are single precision.
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
pub(super) struct Dimensions(pub(super) usize);

impl TryFrom<i64> for Dimensions {
    type Error = String;

    fn try_from(value: i64) -> Result<Self, String> {
        match value {
            1..=3 => Ok(Self(value as usize)),
            _ => Err(format!("{value} dimensions are not 1, 2 or 3")),
        }
    }
}

/// Positive; 1 by default.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(transparent)]
pub(super) struct One(pub(super) Positive);

impl Default for One {
    fn default() -> Self {
        Self(Positive(1.0))
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "String")]
pub(super) struct Name(pub(super) String);

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let plain = |c: char| c.is_alphanumeric() || "_.-".contains(c);
        if !text.is_empty() && text.chars().all(plain) && !text.contains("->") {
            Ok(Self(text))
        } else {
            Err(format!("'{text}' is not a name; use letters, digits, '_', '.' and '-'"))
        }
    }
}
