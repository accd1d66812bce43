use serde::Deserialize;
use toml::Spanned;

use super::{Finite, Name, NotNegative, Positive};

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Attractant {
    pub name: Spanned<Name>,
    #[serde(default)]
    pub center: [Finite; 3],
    pub profile: AttractantProfile,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case", rename_all_fields = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum AttractantProfile {
    Linear { level: NotNegative, gradient: [Finite; 3] },
    Gaussian { peak: NotNegative, width: Positive },
    Source { peak: NotNegative, radius: Positive },
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Chemotaxis {
    pub attractant: Spanned<String>,
    pub sensitivity: Finite,
    pub half_saturation: Option<Positive>,
}
