use crate::names::text_is_name;

/// The type of coordinates and radii.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Precision {
    /// `f32`; warns if a number loses digits.
    #[default]
    F32,
    /// `f64`.
    F64,
    /// The type that rounds nothing: `f32` for NumPy arrays of `f32`, else `f64`, as few decimal numbers are
    /// `f32` numbers. Arrays with species are `f64` if a radius in the options is not an `f32` number.
    Auto,
}

impl Precision {
    /// All precisions.
    pub const ALL: [Self; 3] = [Self::Auto, Self::F32, Self::F64];

    /// Returns the name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
            Self::Auto => "auto",
        }
    }
}

text_is_name!(Precision, "precision");
