use crate::{Exclusions, InputError, Spheres};

/// The input of a search: one set of spheres, or two sets across which pairs are found, and exclusions.
///
/// ```
/// # use lazygrid_kernels::{Exclusions, Query, Sphere};
/// let atoms = [0.0, 0.5, 1.0].map(|x| Sphere::new([x, 0.0, 0.0], 0.3));
/// let walls = [Sphere::new([2.0, 0.0, 0.0], 1.0)];
/// let bonds = Exclusions::new(3, [(0, 1)])?;
/// let among = Query::new(&atoms).without(&bonds);
/// let across = Query::new((&atoms, &walls));
/// assert_eq!((among.len(), across.len(), across.split()), (3, 4, Some(3)));
/// # Ok::<(), lazygrid_kernels::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Query<'a> {
    first: Spheres<'a>,
    second: Option<Spheres<'a>>,
    exclusions: Option<&'a Exclusions>,
}

impl<'a> Query<'a> {
    /// Creates a query from a set of spheres or a tuple of two.
    pub fn new(spheres: impl Into<Query<'a>>) -> Self {
        spheres.into()
    }

    /// Excludes these pairs, which must be created for these numbers of spheres.
    pub fn without(self, pairs: &'a Exclusions) -> Self {
        Self { exclusions: Some(pairs), ..self }
    }

    /// Returns the only or first set.
    #[inline]
    pub fn first(&self) -> Spheres<'a> {
        self.first
    }

    /// Returns the second set, if any.
    #[inline]
    pub fn second(&self) -> Option<Spheres<'a>> {
        self.second
    }

    /// Returns the exclusions.
    #[inline]
    pub fn exclusions(&self) -> Option<&'a Exclusions> {
        self.exclusions
    }

    /// Returns the number of spheres of both sets.
    #[inline]
    pub fn len(&self) -> usize {
        self.first.len() + self.second.map_or(0, |second| second.len())
    }

    /// Returns `true` if the query has no sphere.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the first index of the second set in a search's numbering; `None` for one set.
    #[inline]
    pub fn split(&self) -> Option<usize> {
        self.second.map(|_| self.first.len())
    }

    /// Checks that the exclusions are for these numbers of spheres.
    ///
    /// # Errors
    /// [`InputError::ExclusionSizeMismatch`].
    #[doc(hidden)]
    pub fn check_exclusions(&self) -> Result<(), InputError> {
        let given = (self.first.len(), self.second.map(|second| second.len()));
        match self.exclusions.map(Exclusions::spheres) {
            Some(made_for) if made_for != given => Err(InputError::ExclusionSizeMismatch { made_for, given }),
            _ => Ok(()),
        }
    }

    /// Checks each set. Wraps errors of the second in [`InputError::SecondSet`].
    ///
    /// # Errors
    /// The errors of `check`.
    #[doc(hidden)]
    pub fn check_each(
        &self,
        check: impl Fn(Spheres<'a>) -> Result<(), InputError>,
    ) -> Result<(), InputError> {
        check(self.first)?;
        self.second
            .map_or(Ok(()), |second| check(second).map_err(|error| InputError::SecondSet(Box::new(error))))
    }
}

impl<'a, S: Into<Spheres<'a>>> From<S> for Query<'a> {
    fn from(spheres: S) -> Self {
        Self { first: spheres.into(), second: None, exclusions: None }
    }
}

impl<'a, A: Into<Spheres<'a>>, B: Into<Spheres<'a>>> From<(A, B)> for Query<'a> {
    fn from((first, second): (A, B)) -> Self {
        Self { first: first.into(), second: Some(second.into()), exclusions: None }
    }
}
