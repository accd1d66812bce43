use serde::Deserialize;
use toml::Spanned;

use super::{Finite, Name, NotNegative, Positive};

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(in crate::scenario) struct Attractant {
    pub(in crate::scenario) name: Spanned<Name>,
    #[serde(default)]
    pub(in crate::scenario) center: [Finite; 3],
    pub(in crate::scenario) profile: AttractantProfile,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case", rename_all_fields = "kebab-case", tag = "kind", deny_unknown_fields)]
pub(in crate::scenario) enum AttractantProfile {
    Linear { level: NotNegative, gradient: [Finite; 3] },
    Gaussian { peak: NotNegative, width: Positive },
    Source { peak: NotNegative, radius: Positive },
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(in crate::scenario) struct Chemotaxis {
    pub(in crate::scenario) attractant: Spanned<String>,
    pub(in crate::scenario) sensitivity: Finite,
    pub(in crate::scenario) half_saturation: Option<Positive>,
}
