use serde::Deserialize;
use toml::Spanned;

use super::{Finite, NotNegative, Positive};

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Boundary {
    pub kind: Spanned<BoundaryKind>,
    pub low: Option<Spanned<[Finite; 3]>>,
    pub high: Option<Spanned<[Finite; 3]>>,
    pub axis: Option<Spanned<AxisName>>,
    pub center: Option<Spanned<[Finite; 3]>>,
    pub radius: Option<Spanned<Positive>>,
    pub ends: Option<Spanned<[Finite; 2]>>,
    pub at_ends: Option<Spanned<Ends>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoundaryKind {
    Reflecting,
    Periodic,
    Cylinder,
    Sphere,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AxisName {
    #[default]
    X,
    Y,
    Z,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ends {
    Reflecting,
    Periodic,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Flow {
    pub profile: Spanned<Profile>,
    pub velocity: Option<Spanned<[Finite; 3]>>,
    pub speed: Option<Spanned<Finite>>,
    pub file: Option<Spanned<String>>,
    pub origin: Option<Spanned<[Finite; 3]>>,
    pub spacing: Option<Spanned<[Positive; 3]>>,
    pub from: Option<Spanned<NotNegative>>,
    pub until: Option<Spanned<NotNegative>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    Plug,
    Poiseuille,
    Field,
}
