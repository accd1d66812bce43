use std::fmt;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    pub setting: String,
    /// Rank 0, and the first that differs from it.
    pub ranks: [u32; 2],
    pub values: [String; 2],
    pub differing: u32,
    pub all: u32,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { setting, ranks: [first, other], values: [one, another], differing, all } = self;
        let differ = if *differing == 1 { "differs" } else { "differ" };
        write!(
            f,
            "the setting `{setting}` is {one} on rank {first} and {another} on rank {other}; {differing} of {all} ranks \
             {differ} from rank {first}; give all ranks the same"
        )
    }
}
