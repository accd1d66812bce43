use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::real::{Radii, Real, Strided, Wide, widened};
use crate::InputError;

/// A sphere in the caller's length unit, 16 bytes, laid out as `[f32; 4]` = `x, y, z, r`.
///
/// Radius 0 is a point. Detectors reject a negative radius and non-finite values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Sphere {
    /// Center.
    pub center: Vec3,
    /// Radius, ≥ 0.
    pub radius: f32,
}

impl Sphere {
    /// Creates a sphere.
    pub fn new(center: impl Into<Vec3>, radius: f32) -> Self {
        Self { center: center.into(), radius }
    }

    /// Returns `true` if all values are finite and the radius is not negative.
    #[inline]
    pub fn is_valid(&self) -> bool {
        self.center.is_finite() && self.radius.is_finite() && self.radius >= 0.0
    }
}

impl From<[f32; 4]> for Sphere {
    fn from([x, y, z, r]: [f32; 4]) -> Self {
        Self::new([x, y, z], r)
    }
}

/// A borrowed set of spheres: rows (`&[Sphere]`, `&[[T; 4]]`), columns (four `&[T]`) or points with radii, where `T` is
/// `f32` or `f64`; and optionally a species id and a group per sphere. No number is rounded.
///
/// ```
/// # use lazygrid_kernels::{Sphere, Spheres};
/// let rows = vec![[0.0, 0.0, 0.0, 1.0_f32], [1.5, 0.0, 0.0, 1.0]];
/// let spheres = Spheres::from(&rows);
/// assert_eq!(spheres.get(1), Sphere::new([1.5, 0.0, 0.0], 1.0));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Spheres<'a> {
    layout: Layout<'a>,
    species: Option<&'a [u32]>,
    groups: Option<&'a [u32]>,
}

#[derive(Clone, Copy, Debug)]
enum Layout<'a> {
    Rows(&'a [Sphere]),
    Columns([&'a [f32]; 4]),
    RowsF64(&'a [[f64; 4]]),
    Wide(Wide<'a>),
}

/// The values `x, y, z, r` of [`Spheres`], for loops compiled for each layout.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub enum SphereValues<'a> {
    RowsF32(&'a [[f32; 4]]),
    StridedF32(Strided<'a, f32>),
    RowsF64(&'a [[f64; 4]]),
    StridedF64(Strided<'a, f64>),
}

impl<'a> Spheres<'a> {
    /// Value for a sphere without a group; see [`with_groups`](Self::with_groups).
    pub const NO_GROUP: u32 = u32::MAX;

    fn from_layout(layout: Layout<'a>) -> Self {
        Self { layout, species: None, groups: None }
    }

    /// Borrows columns `x`, `y`, `z` and `r` of one length.
    ///
    /// # Errors
    /// [`InputError::Lengths`] if the lengths differ.
    pub fn columns<T: Real>(x: &'a [T], y: &'a [T], z: &'a [T], r: &'a [T]) -> Result<Self, InputError> {
        for (what, column) in [("y", y), ("z", z), ("r", r)] {
            if column.len() != x.len() {
                return Err(InputError::Lengths { what, length: column.len(), expected: x.len() });
            }
        }
        let columns = [x, y, z, r];
        Ok(Self::from_layout(match T::narrow(columns) {
            Some(columns) => Layout::Columns(columns),
            None => Layout::Wide(T::wide(Strided::from_columns(columns))),
        }))
    }

    /// Borrows points with their radii.
    ///
    /// # Errors
    /// [`InputError::Lengths`] unless there is one radius per point.
    pub fn points<T: Real>(centers: &'a [[T; 3]], radii: Radii<'a, T>) -> Result<Self, InputError> {
        Ok(Self::strided(Strided::from_points(centers, radii)?))
    }

    /// Borrows spheres in strided memory.
    pub fn strided<T: Real>(strided: Strided<'a, T>) -> Self {
        Self::from_layout(Layout::Wide(T::wide(strided)))
    }

    /// Adds a species id per sphere, for [`Interactions`](crate::Interactions).
    ///
    /// # Errors
    /// [`InputError::Lengths`] unless there is one id per sphere.
    pub fn with_species(self, species: &'a [u32]) -> Result<Self, InputError> {
        Ok(Self { species: Some(self.one_each("species", species)?), ..self })
    }

    /// Adds a group per sphere, such as a molecule. Spheres of one group never pair, except in
    /// [`NO_GROUP`](Self::NO_GROUP). With two sets, equal numbers mean one group in both.
    ///
    /// # Errors
    /// [`InputError::Lengths`] unless there is one group per sphere.
    pub fn with_groups(self, groups: &'a [u32]) -> Result<Self, InputError> {
        Ok(Self { groups: Some(self.one_each("groups", groups)?), ..self })
    }

    fn one_each(&self, what: &'static str, values: &'a [u32]) -> Result<&'a [u32], InputError> {
        let (length, expected) = (values.len(), self.len());
        if length == expected { Ok(values) } else { Err(InputError::Lengths { what, length, expected }) }
    }

    /// Returns the number of spheres.
    #[inline]
    pub fn len(&self) -> usize {
        match self.layout {
            Layout::Rows(rows) => rows.len(),
            Layout::Columns([x, ..]) => x.len(),
            Layout::RowsF64(rows) => rows.len(),
            Layout::Wide(wide) => wide.len(),
        }
    }

    /// Returns `true` if the set has no sphere.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns sphere `i`, rounded to `f32`.
    ///
    /// # Panics
    /// If `i` is not below [`len`](Self::len).
    #[inline(always)]
    pub fn get(&self, i: usize) -> Sphere {
        match self.layout {
            Layout::Rows(rows) => rows[i],
            Layout::Columns([x, y, z, r]) => Sphere::new([x[i], y[i], z[i]], r[i]),
            Layout::RowsF64(_) | Layout::Wide(_) => self.rounded(i),
        }
    }

    /// Inlined, it would lengthen the loops over `f32` rows and columns.
    #[cold]
    #[inline(never)]
    fn rounded(&self, i: usize) -> Sphere {
        Sphere::from(self.get_f64(i).map(|number| number as f32))
    }

    /// Returns the numbers `x, y, z, r` of sphere `i` as given.
    ///
    /// # Panics
    /// If `i` is not below [`len`](Self::len).
    #[inline]
    pub fn get_f64(&self, i: usize) -> [f64; 4] {
        match self.layout {
            Layout::RowsF64(rows) => rows[i],
            Layout::Wide(wide) => wide.get(i),
            Layout::Rows(_) | Layout::Columns(_) => widened(bytemuck::cast::<Sphere, [f32; 4]>(self.get(i))),
        }
    }

    /// Returns addresses for prefetches; `i` may be out of range.
    #[inline]
    #[doc(hidden)]
    pub fn addresses(&self, i: usize) -> [*const u8; 4] {
        fn row_addresses<T>(rows: &[[T; 4]], i: usize) -> [*const u8; 4] {
            let row = rows.as_ptr().wrapping_add(i).cast::<T>();
            [0, 1, 2, 3].map(|component| row.wrapping_add(component).cast())
        }
        match self.layout {
            Layout::Rows(rows) => row_addresses(bytemuck::cast_slice::<Sphere, [f32; 4]>(rows), i),
            Layout::Columns(columns) => columns.map(|column| column.as_ptr().wrapping_add(i).cast()),
            Layout::RowsF64(rows) => row_addresses(rows, i),
            Layout::Wide(wide) => wide.addresses(i),
        }
    }

    /// Returns `true` if detectors accept sphere `i`.
    #[inline]
    pub fn is_valid(&self, i: usize) -> bool {
        match self.layout {
            Layout::Rows(_) | Layout::Columns(_) => self.get(i).is_valid(),
            Layout::RowsF64(_) | Layout::Wide(_) => {
                let numbers = self.get_f64(i);
                numbers.iter().all(|number| number.is_finite()) && numbers[3] >= 0.0
            }
        }
    }

    /// Returns `true` if the numbers are `f64`.
    pub fn is_f64(&self) -> bool {
        matches!(self.layout, Layout::RowsF64(_) | Layout::Wide(Wide::F64(_)))
    }

    /// Returns `true` for rows or columns of `f32`.
    pub fn is_read_in_place(&self) -> bool {
        matches!(self.layout, Layout::Rows(_) | Layout::Columns(_))
    }

    #[inline]
    #[doc(hidden)]
    pub fn as_rows(&self) -> Option<&'a [Sphere]> {
        if let Layout::Rows(rows) = self.layout { Some(rows) } else { None }
    }

    #[inline]
    #[doc(hidden)]
    pub fn as_columns(&self) -> Option<[&'a [f32]; 4]> {
        if let Layout::Columns(columns) = self.layout { Some(columns) } else { None }
    }

    #[inline]
    #[doc(hidden)]
    pub fn values(&self) -> SphereValues<'a> {
        match self.layout {
            Layout::Rows(rows) => SphereValues::RowsF32(bytemuck::cast_slice(rows)),
            Layout::Columns(columns) => SphereValues::StridedF32(Strided::from_columns(columns)),
            Layout::RowsF64(rows) => SphereValues::RowsF64(rows),
            Layout::Wide(Wide::F32(strided)) => SphereValues::StridedF32(strided),
            Layout::Wide(Wide::F64(strided)) => SphereValues::StridedF64(strided),
        }
    }

    /// Returns the species ids.
    #[inline]
    pub fn species(&self) -> Option<&'a [u32]> {
        self.species
    }

    /// Returns the groups.
    #[inline]
    pub fn groups(&self) -> Option<&'a [u32]> {
        self.groups
    }

    #[doc(hidden)]
    pub fn without_groups(self) -> Self {
        Self { groups: None, ..self }
    }

    /// Returns all spheres in order, rounded to `f32`.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Sphere> + '_ {
        (0..self.len()).map(|i| self.get(i))
    }
}

impl<'a> From<&'a [Sphere]> for Spheres<'a> {
    fn from(rows: &'a [Sphere]) -> Self {
        Self::from_layout(Layout::Rows(rows))
    }
}

impl<'a> From<&'a Vec<Sphere>> for Spheres<'a> {
    fn from(rows: &'a Vec<Sphere>) -> Self {
        Self::from(rows.as_slice())
    }
}

impl<'a, const N: usize> From<&'a [Sphere; N]> for Spheres<'a> {
    fn from(rows: &'a [Sphere; N]) -> Self {
        Self::from(rows.as_slice())
    }
}

impl<'a> From<&'a [[f32; 4]]> for Spheres<'a> {
    fn from(rows: &'a [[f32; 4]]) -> Self {
        Self::from(bytemuck::cast_slice::<[f32; 4], Sphere>(rows))
    }
}

impl<'a> From<&'a [[f64; 4]]> for Spheres<'a> {
    fn from(rows: &'a [[f64; 4]]) -> Self {
        Self::from_layout(Layout::RowsF64(rows))
    }
}

impl<'a, T: Real> From<&'a Vec<[T; 4]>> for Spheres<'a>
where
    Self: From<&'a [[T; 4]]>,
{
    fn from(rows: &'a Vec<[T; 4]>) -> Self {
        Self::from(rows.as_slice())
    }
}

impl<'a, T: Real, const N: usize> From<&'a [[T; 4]; N]> for Spheres<'a>
where
    Self: From<&'a [[T; 4]]>,
{
    fn from(rows: &'a [[T; 4]; N]) -> Self {
        Self::from(rows.as_slice())
    }
}
