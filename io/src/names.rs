/// Implements `Display` and `FromStr` by the names of `ALL`.
macro_rules! text_is_name {
    ($type:ty, $kind:literal) => {
        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $type {
            type Err = lazygrid::UnknownName;

            fn from_str(text: &str) -> Result<Self, lazygrid::UnknownName> {
                let found = Self::ALL.into_iter().find(|one| one.name() == text);
                found.ok_or_else(|| lazygrid::UnknownName::new($kind, text, &Self::ALL.map(Self::name)))
            }
        }
    };
}

pub(crate) use text_is_name;
