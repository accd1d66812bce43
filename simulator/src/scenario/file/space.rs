use serde::Deserialize;
use toml::Spanned;

use super::{Finite, NotNegative, Positive};

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(in crate::scenario) struct Boundary {
    pub(in crate::scenario) kind: Spanned<BoundaryKind>,
    pub(in crate::scenario) low: Option<Spanned<[Finite; 3]>>,
    pub(in crate::scenario) high: Option<Spanned<[Finite; 3]>>,
    pub(in crate::scenario) axis: Option<Spanned<AxisName>>,
    pub(in crate::scenario) center: Option<Spanned<[Finite; 3]>>,
    pub(in crate::scenario) radius: Option<Spanned<Positive>>,
    pub(in crate::scenario) ends: Option<Spanned<[Finite; 2]>>,
    pub(in crate::scenario) at_ends: Option<Spanned<Ends>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::scenario) enum BoundaryKind {
    Reflecting,
    Periodic,
    Cylinder,
    Sphere,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::scenario) enum AxisName {
    #[default]
    X,
    Y,
    Z,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::scenario) enum Ends {
    Reflecting,
    Periodic,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(in crate::scenario) struct Flow {
    pub(in crate::scenario) profile: Spanned<Profile>,
    pub(in crate::scenario) velocity: Option<Spanned<[Finite; 3]>>,
    pub(in crate::scenario) speed: Option<Spanned<Finite>>,
    pub(in crate::scenario) file: Option<Spanned<String>>,
    pub(in crate::scenario) origin: Option<Spanned<[Finite; 3]>>,
    pub(in crate::scenario) spacing: Option<Spanned<[Positive; 3]>>,
    pub(in crate::scenario) from: Option<Spanned<NotNegative>>,
    pub(in crate::scenario) until: Option<Spanned<NotNegative>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::scenario) enum Profile {
    Plug,
    Poiseuille,
    Field,
}
